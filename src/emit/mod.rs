//! Scenes to files in the output folder: whole or not at all, and untouched where nothing changed.
//!
//! Everything is first written to temporary files in the folders it is for, then renamed, binary files before the
//! document that refers to them. A file that has the right bytes already keeps its time stamp. Knows nothing of glTF
//! but which files a document consists of; runs from several threads at once.

mod claims;
mod error;
mod stage;

use crate::gltf::dependencies::{Dependency, DependencyKind};
use crate::gltf::library::{self, LibraryFile};
use crate::gltf::package::Files;
use claims::{Claims, Whose};
pub use error::EmitError;
use stage::{Origin, Stage};
use std::path::{Component, Path, PathBuf};

/// What one scene becomes.
#[derive(Debug)]
pub enum Content {
    /// The source's own bytes, because there is nothing to add.
    AsSource {
        /// Files beside the source that the document refers to.
        copied: Vec<Dependency>,
    },
    /// New files.
    Files(Files),
}

/// One scene to write.
#[derive(Debug)]
pub struct Emission<'a> {
    /// The scene's file.
    pub source: &'a Path,
    /// Where its main file goes: below the output folder, with the extension of its container.
    pub target: &'a Path,
    /// What goes there.
    pub content: &'a Content,
}

/// What was done for one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmittedFile {
    /// Its place.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// `false`: it had these bytes already and was not touched.
    pub written: bool,
}

/// What was done for one scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Emitted {
    /// Files of this scene, the main file last. A file that scenes share is named for each.
    pub files: Vec<EmittedFile>,
    /// Addresses in the document behind which there is no file, sorted: the source lacks it too.
    pub missing: Vec<String>,
}

/// The output folder of one run. It remembers which scene wrote what, so that no scene overwrites another's files.
#[derive(Debug)]
pub struct OutputFolder {
    root: PathBuf,
    claims: Claims,
}

impl OutputFolder {
    /// `root` is created when the first file is written.
    pub fn new(root: &Path) -> Self {
        Self { root: normal(root), claims: Claims::default() }
    }

    /// Path of an output from the folder on, with `/` as separator.
    pub fn relative(&self, path: &Path) -> String {
        let path = normal(path);
        let below = path.strip_prefix(&self.root).unwrap_or(&path);
        below.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    }

    /// Refuses scenes that would become the same file; `scenes` are pairs of source and target. Names the first such
    /// pair in the order given.
    pub fn check_targets<'p>(scenes: impl IntoIterator<Item = (&'p Path, &'p Path)>) -> Result<(), EmitError> {
        let claims = Claims::default();
        for (source, target) in scenes {
            claims.claim(&normal(target), source, Whose::Own)?;
        }
        Ok(())
    }

    /// Writes one scene.
    pub fn emit(&self, scene: &Emission<'_>) -> Result<Emitted, EmitError> {
        if same_file(scene.source, scene.target) {
            return Err(EmitError::OverSource { path: scene.source.to_owned() });
        }
        let mut emitted = Emitted::default();
        let copied = match scene.content {
            Content::AsSource { copied } => copied,
            Content::Files(files) => &files.copied,
        };
        for dependency in copied {
            self.copy_resource(scene, dependency, &mut emitted)?;
        }
        let folder = scene.target.parent().unwrap_or(Path::new(""));
        let mut stage = Stage::default();
        match scene.content {
            Content::AsSource { .. } => self.stage(&mut stage, scene, scene.target, Origin::File(scene.source))?,
            Content::Files(files) => {
                // Before anything that refers to them.
                for file in &files.library {
                    self.emit_shared(scene, file, &mut emitted)?;
                }
                for (name, bytes) in &files.beside {
                    self.stage(&mut stage, scene, &folder.join(name), Origin::Bytes(bytes))?;
                }
                self.stage(&mut stage, scene, scene.target, Origin::Bytes(&files.main))?;
            }
        }
        emitted.files.extend(stage.commit()?);
        Ok(emitted)
    }

    fn stage(
        &self,
        stage: &mut Stage,
        scene: &Emission<'_>,
        target: &Path,
        origin: Origin<'_>,
    ) -> Result<(), EmitError> {
        self.claims.claim(&normal(target), scene.source, Whose::Own)?;
        if let Origin::Bytes(_) = origin
            && same_file(scene.source, target)
        {
            return Err(EmitError::OverSource { path: scene.source.to_owned() });
        }
        stage.add(target, origin)
    }

    /// Scenes share files of the library: whoever comes first writes one.
    fn emit_shared(&self, scene: &Emission<'_>, file: &LibraryFile, emitted: &mut Emitted) -> Result<(), EmitError> {
        let target = self.root.join(library::FOLDER).join(&file.name);
        let claim = self.claims.claim(&target, scene.source, Whose::Library)?;
        let mut done = claim.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(done) = &*done {
            emitted.files.push(EmittedFile { written: false, ..done.clone() });
            return Ok(());
        }
        let mut stage = Stage::default();
        stage.add(&target, Origin::Bytes(&file.bytes))?;
        *done = stage.commit()?.pop();
        emitted.files.extend(done.clone());
        Ok(())
    }

    /// Scenes may share a texture: whoever comes first copies it, the others find it done.
    fn copy_resource(
        &self,
        scene: &Emission<'_>,
        dependency: &Dependency,
        emitted: &mut Emitted,
    ) -> Result<(), EmitError> {
        let base = scene.source.parent().unwrap_or(Path::new(""));
        let below = dependency.path.strip_prefix(base).unwrap_or(&dependency.path);
        let target = scene.target.parent().unwrap_or(Path::new("")).join(below);
        if same_file(&dependency.path, &target) {
            return Ok(());
        }
        if !dependency.path.is_file() {
            // Whatever an extension or `extras` calls an address need not be a file.
            if dependency.kind != DependencyKind::Other {
                emitted.missing.push(dependency.uri.clone());
            }
            return Ok(());
        }
        let target = normal(&target);
        if !target.starts_with(&self.root) {
            return Err(EmitError::Outside { uri: dependency.uri.clone(), target, root: self.root.clone() });
        }
        let claim = self.claims.claim(&target, scene.source, Whose::Copy(dependency.path.clone()))?;
        let mut done = claim.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if done.is_none() {
            let mut stage = Stage::default();
            stage.add(&target, Origin::File(&dependency.path))?;
            *done = stage.commit()?.pop();
        }
        emitted.files.extend(done.clone());
        Ok(())
    }
}

/// Without `.` and `..`, by the names alone: the path need not exist.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// Do both paths exist and lead to the same file, through links too? A folder of the output need not exist yet, so
/// `..` may have to go up by name, as it does in addresses.
fn same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().or_else(|_| normal(path).canonicalize());
    match (real(a), real(b)) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests;
