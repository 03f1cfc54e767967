//! `lodbake explain FILE`: why a scene would be baked again, by the index and the settings; reads no scene unless its
//! file facts alone cannot tell.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::bake::record;
use super::failure::UsageError;
use super::{CacheChoice, Context, Exit};
use crate::config::Pipeline;
use crate::index::{Index, Reason, SettingsKey, Status};
use crate::report::{MeshRecord, SceneRecord, ShareRecord};
use crate::scan::{SceneFile, scan};

/// Tell why a scene would be baked again
#[derive(Debug, clap::Args)]
pub struct Explain {
    /// The scene file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The pipeline it belongs to
    #[arg(long, value_name = "PIPELINE", default_value = "pipeline.toml")]
    pipeline: PathBuf,
}

impl Explain {
    /// Writes the reasons to standard output, one a line; with `--json` one object.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let pipeline = Pipeline::load(&self.pipeline)?;
        let found = scan(&pipeline)?;
        let scene = found.files.iter().find(|file| self.means(file));
        let Some(scene) = scene else {
            let message = format!("`{}` is no scene of `{}`", self.file.display(), self.pipeline.display());
            let hint = Some("look at `input`, `include` and `exclude` in the pipeline".to_owned());
            return Err(UsageError { message, hint }.into());
        };
        let settings = pipeline.settings_for(&scene.relative);
        if settings.skip {
            return tell(
                context,
                &scene.relative,
                "skipped",
                &["an override of the pipeline skips it".to_owned()],
                &[],
            );
        }
        let cache = match &context.cache {
            CacheChoice::Folder(folder) => folder.clone(),
            CacheChoice::Pipeline | CacheChoice::Off => pipeline.cache.path.clone(),
        };
        let (index, warning) = Index::open(&cache, &pipeline);
        if let Some(warning) = warning {
            context.tell(&format!("warning: {warning}"));
        }
        let facts = index.facts(&scene.relative).as_deref().and_then(record::from_bytes);
        let shares = facts.as_ref().map_or_else(Vec::new, |facts| shares(&facts.record));
        let reasons = match index.status(scene, &SettingsKey::of(settings)) {
            Status::Unchanged(_) => Vec::new(),
            Status::Touched(entry) => words(&index.recheck(scene, entry).reasons),
            Status::Changed(reasons) => words(&reasons),
            Status::New => vec!["it was not baked yet".to_owned()],
        };
        let state = if reasons.is_empty() { "unchanged" } else { "changed" };
        tell(context, &scene.relative, state, &reasons, &shares)
    }

    /// The file itself, or a scene as messages and reports name it: relative to its input folder.
    fn means(&self, scene: &SceneFile) -> bool {
        let wanted = self.file.canonicalize();
        let is_file = wanted.is_ok_and(|wanted| scene.path.canonicalize().is_ok_and(|path| path == wanted));
        is_file || Path::new(&scene.relative) == self.file
    }
}

fn words(reasons: &[Reason]) -> Vec<String> {
    reasons.iter().map(ToString::to_string).collect()
}

/// What each mesh got of the levels that are budgets of the scene, by the last bake.
struct Share {
    mesh: u64,
    name: Option<String>,
    instances: u64,
    level: u64,
    triangles: u64,
    of: u64,
}

fn shares(record: &SceneRecord) -> Vec<Share> {
    let of = |mesh: &MeshRecord| {
        let share = |share: &ShareRecord| Share {
            mesh: mesh.index,
            name: mesh.name.clone(),
            instances: mesh.instances,
            level: share.level,
            triangles: share.triangles,
            of: mesh.triangles,
        };
        mesh.shares.iter().map(share).collect::<Vec<_>>()
    };
    let mut shares: Vec<Share> = record.meshes.iter().flat_map(of).collect();
    shares.sort_by_key(|share| share.level);
    shares
}

fn tell(context: &Context, scene: &str, state: &str, reasons: &[String], shares: &[Share]) -> anyhow::Result<Exit> {
    let text = if context.json {
        let share = |share: &Share| {
            let Share { mesh, name, instances, level, triangles, of } = share;
            json!({ "level": level, "mesh": mesh, "name": name, "instances": instances, "triangles": triangles, "of": of })
        };
        let shares: Vec<_> = shares.iter().map(share).collect();
        format!("{:#}\n", json!({ "scene": scene, "state": state, "reasons": reasons, "shares": shares }))
    } else {
        let mut lines = reasons.to_vec();
        if reasons.is_empty() {
            lines.push("unchanged, nothing would be done".to_owned());
        }
        lines.extend(shares.iter().map(|share| {
            let Share { mesh, name, instances, level, triangles, of } = share;
            let name = name.as_ref().map(|name| format!(" `{name}`")).unwrap_or_default();
            format!("level {level} shared by the scene: mesh {mesh}{name} keeps {triangles} of {of} triangles, {instances} times")
        }));
        lines.iter().map(|line| format!("{scene}: {line}\n")).collect::<Vec<_>>().concat()
    };
    context.print(&text)?;
    Ok(Exit::Fine)
}
