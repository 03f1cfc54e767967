//! `lodbake explain FILE`: why a scene would be baked again, by the index and the settings; reads no scene unless its
//! file facts alone cannot tell.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::failure::UsageError;
use super::{CacheChoice, Context, Exit};
use crate::config::Pipeline;
use crate::index::{Index, Reason, SettingsKey, Status};
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
            return tell(context, &scene.relative, "skipped", &["an override of the pipeline skips it".to_owned()]);
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
        tell(context, &scene.relative, if reasons.is_empty() { "unchanged" } else { "changed" }, &reasons)
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

fn tell(context: &Context, scene: &str, state: &str, reasons: &[String]) -> anyhow::Result<Exit> {
    let text = if context.json {
        format!("{:#}\n", json!({ "scene": scene, "state": state, "reasons": reasons }))
    } else if reasons.is_empty() {
        format!("{scene}: unchanged, nothing would be done\n")
    } else {
        reasons.iter().map(|reason| format!("{scene}: {reason}\n")).collect::<Vec<_>>().concat()
    };
    context.print(&text)?;
    Ok(Exit::Fine)
}
