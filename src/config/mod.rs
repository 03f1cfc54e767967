//! `pipeline.toml` → [`Pipeline`]: the only place with defaults and ranges.
//!
//! Three steps: the text is parsed with its line numbers and checked against the schema (`check.rs`, `file.rs`), the
//! rules between keys are applied (`resolve.rs`), and [`Pipeline::settings_for`] lays overrides over each other for one
//! scene. Reads that one file; knows nothing of scenes, meshes or the cache.

mod budget;
pub(crate) mod check;
mod choice;
pub mod defaults;
mod error;
pub(crate) mod file;
mod globs;
mod resolve;
mod settings;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

pub use budget::{Bounds, Budget, Fact, Limit};
pub use choice::{
    Effort, ErrorUnit, Format, Instancing, Layout, Metric, NodeNames, Placement, Profile, Recover, Renderer, Storage,
};
pub use error::{ConfigError, Names, Place};
pub use file::schema;
pub use globs::Globs;
pub use settings::{
    AppearanceSettings, ChainSettings, EmitSettings, InstanceSettings, LevelTarget, SceneSettings, Screen,
    SimplifySettings, ViewSettings, Weights,
};

/// A folder: as the user wrote it, for messages, and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    /// As written in `pipeline.toml` or on the command line.
    pub written: String,
    /// Relative to the current folder, or absolute.
    pub path: PathBuf,
}

impl Folder {
    fn below(base: &Path, written: String) -> Self {
        Self { path: base.join(&written), written }
    }

    /// A folder that was named elsewhere than in `pipeline.toml`.
    pub fn at(path: PathBuf) -> Self {
        Self { written: path.display().to_string(), path }
    }
}

impl std::fmt::Display for Folder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.written)
    }
}

/// A validated `pipeline.toml`.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// Path of the file as the user wrote it.
    pub file: String,
    /// At least one; several are laid over each other in `output`.
    pub inputs: Vec<Folder>,
    /// Mirrors the inputs.
    pub output: Folder,
    /// Files that are scenes.
    pub include: Globs,
    /// Files and folders that are left out.
    pub exclude: Globs,
    /// `.gitignore` and `.ignore` files are obeyed.
    pub ignore_files: bool,
    /// Symbolic links are followed.
    pub follow_links: bool,
    /// May be deleted at any time. `--cache` and `LODBAKE_CACHE` replace it (see `cli`).
    pub cache: Folder,
    /// Jobs at the same time; 0 means one for each core.
    pub jobs: usize,
    /// In the order of the file.
    pub budgets: Vec<Budget>,
    /// A report that growth is measured against.
    pub baseline: Option<Folder>,
    layer: resolve::Layer,
    overrides: Vec<(Globs, resolve::Layer)>,
}

/// Text of a configuration file, and the file's path as the user wrote it.
pub fn read_text(file: &Path) -> Result<(String, String), ConfigError> {
    let written = file.display().to_string();
    match std::fs::read_to_string(file) {
        Ok(text) => Ok((text, written)),
        Err(source) => Err(ConfigError::Read { file: written, source }),
    }
}

impl Pipeline {
    /// Reads and validates a file.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        let (text, written) = read_text(file)?;
        Self::parse(&text, &written)
    }

    /// Validates `text`. Relative paths are relative to the folder of `file`.
    pub fn parse(text: &str, file: &str) -> Result<Self, ConfigError> {
        let schema = file::schema();
        let document = check::Document::parse(file, text, &schema)?;
        resolve::pipeline(&document, file)
    }

    /// The settings of one scene: `relative` is its path below the input folder, with `/` as separator.
    pub fn settings_for(&self, relative: &str) -> SceneSettings {
        let mut layer = self.layer.clone();
        for (globs, over) in &self.overrides {
            if globs.matches(relative) {
                layer.lay(over);
            }
        }
        layer.settle()
    }

    /// The settings of scenes that no override matches.
    pub fn settings(&self) -> SceneSettings {
        self.layer.settle()
    }
}
