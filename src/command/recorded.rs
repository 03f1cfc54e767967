//! A recorded report, named as people name one: a file, a folder that a bake wrote to, or a git revision.

use std::path::Path;
use std::process::Command;

use anyhow::Context as _;

use super::failure::UsageError;
use crate::config::Pipeline;
use crate::report::{self, FILE_NAME, Report};

/// Reads a report. A revision's is looked for where `pipeline` keeps its baseline, and where it writes its outputs.
pub fn read(written: &str, pipeline: Option<&Pipeline>) -> anyhow::Result<Report> {
    let path = Path::new(written);
    if path.is_dir() {
        return Ok(report::read(&path.join(FILE_NAME))?);
    }
    if path.is_file() || looks_like_a_path(written) {
        return Ok(report::read(path)?);
    }
    of_revision(written, pipeline)
}

/// The report of a pipeline's outputs.
pub fn of_outputs(pipeline: Option<&Pipeline>) -> anyhow::Result<Report> {
    let Some(pipeline) = pipeline else {
        let hint = Some("name a report, or a pipeline with `--pipeline`".to_owned());
        return Err(UsageError { message: "there is no pipeline here whose outputs are meant".to_owned(), hint }.into());
    };
    Ok(report::read(&pipeline.output.path.join(FILE_NAME))?)
}

/// Revisions have no extension that a report has.
fn looks_like_a_path(written: &str) -> bool {
    Path::new(written).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

fn of_revision(revision: &str, pipeline: Option<&Pipeline>) -> anyhow::Result<Report> {
    let folder = pipeline.and_then(|p| Path::new(&p.file).parent()).unwrap_or(Path::new(""));
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut tried = Vec::new();
    for place in places(pipeline) {
        let name = format!("{revision}:./{place}");
        // After `--end-of-options` a revision that begins with a dash is no option.
        let words = ["show", "--end-of-options", &name];
        let shown = Command::new("git").arg("-C").arg(folder).args(words).output();
        let shown = shown.context("failed to run `git`")?;
        if shown.status.success() {
            return Ok(report::from_bytes(&shown.stdout, Path::new(&format!("{revision}:{place}")))?);
        }
        let said = String::from_utf8_lossy(&shown.stderr);
        let said = said.lines().next().unwrap_or("git gave no reason").trim_start_matches("fatal: ").to_owned();
        tried.push(format!("`{place}`: {said}"));
    }
    let message = format!("`{revision}` is neither a file nor a revision with a report ({})", tried.join("; "));
    let hint = "commit a report: `baseline = \"lodbake.report.json\"` in the pipeline, and `lodbake report --output \
                lodbake.report.json` after a bake";
    Err(UsageError { message, hint: Some(hint.to_owned()) }.into())
}

/// From the pipeline's folder, with `/`.
fn places(pipeline: Option<&Pipeline>) -> Vec<String> {
    let Some(pipeline) = pipeline else { return vec![format!("out/{FILE_NAME}")] };
    let clean = |path: &str| path.trim_start_matches("./").trim_end_matches('/').replace('\\', "/");
    let baseline = pipeline.baseline.as_ref().map(|baseline| clean(&baseline.written));
    baseline.into_iter().chain([format!("{}/{FILE_NAME}", clean(&pipeline.output.written))]).collect()
}
