//! `lodbake explain FILE`: why a scene would be baked again, by the index and the settings; reads no scene unless its
//! file facts alone cannot tell.

use std::path::PathBuf;

use super::failure::UsageError;
use super::{CacheChoice, Context, Exit};
use crate::config::Pipeline;
use crate::index::{Index, Reason, SettingsKey, Status};
use crate::scan::scan;

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
    /// Writes the reasons to standard output, one a line.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let pipeline = Pipeline::load(&self.pipeline)?;
        let wanted = self.file.canonicalize().ok();
        let found = scan(&pipeline)?;
        let scene = found.files.iter().find(|file| wanted.is_some() && file.path.canonicalize().ok() == wanted);
        let Some(scene) = scene else {
            let message = format!("`{}` is no scene of `{}`", self.file.display(), self.pipeline.display());
            let hint = Some("look at `input`, `include` and `exclude` in the pipeline".to_owned());
            return Err(UsageError { message, hint }.into());
        };
        let settings = pipeline.settings_for(&scene.relative);
        if settings.skip {
            context.print(&format!("{}: skipped by an override of the pipeline\n", scene.relative))?;
            return Ok(Exit::Fine);
        }
        let cache = match &context.cache {
            CacheChoice::Folder(folder) => folder.clone(),
            CacheChoice::Pipeline | CacheChoice::Off => pipeline.cache.path.clone(),
        };
        let (index, warning) = Index::open(&cache, &pipeline);
        if let Some(warning) = warning {
            context.tell(&format!("warning: {warning}"));
        }
        let reasons = match index.status(scene, &SettingsKey::of(settings)) {
            Status::Unchanged(_) => Vec::new(),
            Status::Touched(entry) => words(&index.recheck(scene, entry).reasons),
            Status::Changed(reasons) => words(&reasons),
            Status::New => vec!["it was not baked yet".to_owned()],
        };
        let text = if reasons.is_empty() {
            format!("{}: unchanged, nothing would be done\n", scene.relative)
        } else {
            let lines: Vec<String> = reasons.iter().map(|reason| format!("{}: {reason}\n", scene.relative)).collect();
            lines.concat()
        };
        context.print(&text)?;
        Ok(Exit::Fine)
    }
}

fn words(reasons: &[Reason]) -> Vec<String> {
    reasons.iter().map(ToString::to_string).collect()
}
