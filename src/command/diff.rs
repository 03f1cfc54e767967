//! `lodbake diff BASE HEAD`: two recorded reports, and what changed between them.

use std::path::{Path, PathBuf};

use super::{Context, Exit, recorded};
use crate::config::Pipeline;
use crate::difference::{Difference, Thresholds};
use crate::progress::quantity::plural;

/// Tell what changed between two reports: what grew, shrank, looks worse, appeared, vanished
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Diff {
    /// What was: a report, a folder with one, or a git revision
    #[arg(value_name = "BASE")]
    base: String,
    /// What is: the same [default: the report of the pipeline's outputs]
    #[arg(value_name = "HEAD")]
    head: Option<String>,
    /// The pipeline: says where revisions keep their report
    #[arg(long, value_name = "PIPELINE", default_value = "pipeline.toml")]
    pipeline: PathBuf,
    #[command(flatten)]
    limits: Limits,
}

/// What is too much.
#[derive(Clone, Debug, clap::Args)]
pub struct Limits {
    /// Growth of a fact of a scene that is a regression, in percent
    #[arg(long, value_name = "PERCENT", default_value_t = Thresholds::default().growth, value_parser = percent)]
    max_growth: f64,
    /// Growth of an image difference or a distance that is a regression, in percent
    #[arg(long, value_name = "PERCENT", default_value_t = Thresholds::default().looks, value_parser = percent)]
    max_uglier: f64,
    /// Growth of a sum over all scenes that is a regression, in percent [default: any]
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    max_sum_growth: Option<f64>,
    /// Scenes, meshes and levels may vanish
    #[arg(long)]
    allow_vanished: bool,
}

const AFTER_HELP: &str = "\
A revision's report is the one that it has at the pipeline's `baseline`, else in its output folder. Looks that change by \
less than 3 % and sizes that change by less than 0.1 % are no changes.

Exit codes: 1 if anything is past its limit, or broke; else 0.";

/// Changes that are told without `--verbose`; regressions always are.
const SHOWN: usize = 40;

impl Limits {
    /// As the comparison takes them.
    pub fn thresholds(&self) -> Thresholds {
        Thresholds {
            growth: self.max_growth,
            sum: self.max_sum_growth,
            looks: self.max_uglier,
            may_vanish: self.allow_vanished,
        }
    }
}

impl Diff {
    /// Changes to standard output; [`Exit::OverBudget`] if one is a regression.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let pipeline = pipeline_at(&self.pipeline)?;
        let base = recorded::read(&self.base, pipeline.as_ref())?;
        let head = match &self.head {
            Some(head) => recorded::read(head, pipeline.as_ref())?,
            None => recorded::of_outputs(pipeline.as_ref())?,
        };
        let found = Difference::between(&base, &head, &self.limits.thresholds());
        if context.json {
            context.print(&format!("{}\n", serde_json::to_string_pretty(&found)?))?;
        } else {
            context.print(&found.to_text(if context.verbose { usize::MAX } else { SHOWN }))?;
        }
        let regressions = found.changes.iter().filter(|change| change.is_regression).count() as u64;
        if 0 < regressions {
            context.tell(&format!("{} past its limit, marked `!`", plural(regressions, "change")));
            return Ok(Exit::OverBudget);
        }
        Ok(Exit::Fine)
    }
}

/// The pipeline, if there is one: two files can be compared without.
pub fn pipeline_at(file: &Path) -> anyhow::Result<Option<Pipeline>> {
    if file.is_file() { Ok(Some(Pipeline::load(file)?)) } else { Ok(None) }
}

fn percent(text: &str) -> Result<f64, String> {
    match text.trim_end_matches('%').trim().parse::<f64>() {
        Ok(percent) if 0.0 <= percent && percent.is_finite() => Ok(percent),
        _ => Err("must be 0 or more".to_owned()),
    }
}
