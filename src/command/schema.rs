//! `lodbake schema KIND`: the JSON schema of a file that lodbake reads or writes, for editors and other programs.

use super::{Context, Exit};
use crate::{config, difference, evaluation, progress, report, study};

/// Write the JSON schema of a file format
#[derive(Clone, Debug, clap::Args)]
pub struct Schema {
    /// The format
    #[arg(value_enum)]
    kind: Kind,
}

/// Formats with a published schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// `pipeline.toml`
    Pipeline,
    /// `report.json`
    Report,
    /// One line of `lodbake bake --json`
    Events,
    /// `lodbake check --json`
    Check,
    /// `lodbake diff --json`
    Diff,
    /// `lodbake inspect --json FILE`
    Inspection,
    /// `lodbake evaluate --json REFERENCE CANDIDATE`
    Evaluation,
    /// `study.toml`
    Study,
    /// `lodbake study --json`
    StudyRecord,
}

impl Schema {
    /// Prints the schema.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let schema = match self.kind {
            Kind::Pipeline => config::schema(),
            Kind::Report => report::schema(),
            Kind::Events => progress::schema(),
            Kind::Evaluation => evaluation::schema(),
            Kind::Check => super::check::schema(),
            Kind::Diff => difference::schema(),
            Kind::Inspection => report::inspection::schema(),
            Kind::Study => study::schema(),
            Kind::StudyRecord => study::record_schema(),
        };
        context.print(&format!("{schema:#}\n"))?;
        Ok(Exit::Fine)
    }
}
