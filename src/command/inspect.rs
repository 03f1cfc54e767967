//! `lodbake inspect FILE…`: what is in a scene, and what a bake would save. Writes nothing.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::{Context, Exit};
use crate::gltf::dependencies::DependencyKind;
use crate::gltf::scene::Scene;
use crate::identify::survey;
use crate::obj;
use crate::report::inspection::Inspection;

/// Show what is in a scene: structure, distinct meshes, instances, and what a bake would save.
#[derive(Clone, Debug, clap::Args)]
pub struct Inspect {
    /// Scenes (`.glb`, `.gltf`, `.obj`)
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
}

impl Inspect {
    /// One table for each file; with `--json` one document: an object for a single file, else an array. A file that
    /// cannot be read does not stop the others.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let mut exit = Exit::Fine;
        let mut inspections = Vec::new();
        for file in &self.files {
            match inspect(file) {
                Ok(inspection) if context.json => inspections.push(inspection),
                Ok(inspection) => context.print(&inspection.to_text())?,
                Err(error) if self.files.len() == 1 => return Err(error),
                Err(error) => {
                    context.error(&error);
                    exit = Exit::Undone;
                }
            }
        }
        if context.json {
            let single = self.files.len() == 1;
            let json = match inspections.as_slice() {
                [only] if single => serde_json::to_string_pretty(only)?,
                all => serde_json::to_string_pretty(all)?,
            };
            context.print(&format!("{json}\n"))?;
        }
        Ok(exit)
    }
}

fn inspect(file: &Path) -> anyhow::Result<Inspection> {
    let scene = obj::read_any(file)?;
    let named = || format!("failed to inspect `{}`", file.display());
    let found = survey(&scene).with_context(named)?;
    Inspection::new(file.display().to_string(), size(file, &scene), &scene, &found).with_context(named)
}

/// Bytes of the file and of its buffers. What cannot be asked for its size any more counts nothing.
fn size(file: &Path, scene: &Scene) -> u64 {
    let buffers = scene.dependencies.iter().filter(|d| d.kind == DependencyKind::Buffer).map(|d| d.path.as_path());
    std::iter::once(file).chain(buffers).filter_map(|path| path.metadata().ok()).map(|meta| meta.len()).sum()
}
