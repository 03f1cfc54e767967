//! `lodbake study STUDY`: meshes × algorithms × targets, measured and compared. And `lodbake measured`, hidden: the
//! process that a program is started from, and `lodbake study-level`, hidden: one run alone in a process.

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;

use super::failure::UsageError;
use super::{Context, Exit};
use crate::study::{self, Step, process};

/// Compare ways to simplify: looks, distance, time and memory over meshes and targets
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Study {
    /// The study
    #[arg(value_name = "STUDY", default_value = "study.toml")]
    pub file: PathBuf,
}

const AFTER_HELP: &str = "\
Writes study.csv, study.md and study.html into the study's output folder, and the levels beside them. `lodbake schema \
study` tells the keys of a study. With --json, all that was measured goes to standard output.

Run it on a machine that does nothing else: other work makes times longer and their intervals wider.";

impl Study {
    /// A failing algorithm is recorded and does not stop the study: it is [`Exit::Undone`] at the end.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        if !self.file.is_file() {
            let message = format!("there is no study `{}`", self.file.display());
            let hint = "`lodbake schema study` tells the keys of a study; the folder `studies` of the sources has one";
            return Err(UsageError { message, hint: Some(hint.to_owned()) }.into());
        }
        let study = study::Study::load(&self.file)?;
        let record = study::run(&study, &|step| tell(context, &step))?;
        let written = record.write(&study.output)?;
        if context.json {
            let json = serde_json::to_string_pretty(&record).context("failed to write the study as JSON")?;
            context.print(&format!("{json}\n"))?;
        } else if !context.quiet {
            context.print(&record.summary())?;
        }
        for path in written {
            context.tell(&format!("wrote {}", path.display()));
        }
        let failed = record.meshes.iter().any(|mesh| mesh.error.is_some())
            || record.cells.iter().any(|cell| cell.error.is_some());
        Ok(if failed { Exit::Undone } else { Exit::Fine })
    }
}

/// Lines, not bars: a bar would draw while a run is timed.
fn tell(context: &Context, step: &Step<'_>) {
    match step {
        Step::Mesh(name, number, of) => context.tell(&format!("{name} ({number} of {of})")),
        Step::First(algorithm, target) if context.verbose => context.tell(&format!("  {target}: {algorithm}")),
        Step::First(..) => {}
        Step::Timed(target, rounds) => context.tell(&format!("  {target}: {rounds} timed rounds")),
        Step::Failed(mesh, "", error) => context.tell(&format!("  {mesh}: {error}")),
        Step::Failed(_, algorithm, error) => context.tell(&format!("  {algorithm} failed: {error}")),
    }
}

/// Run a program and write what it took to standard output, as JSON.
#[derive(Clone, Debug, clap::Args)]
pub struct Measured {
    /// Longest run, in seconds
    #[arg(long)]
    timeout: f64,
    /// Where it runs
    #[arg(long)]
    folder: PathBuf,
    /// The program and its arguments
    #[arg(last = true, required = true)]
    words: Vec<OsString>,
}

impl Measured {
    /// [`Exit::Fine`] whatever the program's own exit code.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let timeout = Duration::try_from_secs_f64(self.timeout).context("the timeout is no number of seconds")?;
        let run = process::run(&self.words, &self.folder, timeout)?;
        context.print(&serde_json::to_string(&run)?)?;
        Ok(Exit::Fine)
    }
}

/// Make one level with one of the study's own algorithms
#[derive(Clone, Debug, clap::Args)]
pub struct StudyLevel {
    /// The study
    study: PathBuf,
    /// Name of an algorithm with `simplify`
    algorithm: String,
    /// Name of a mesh
    mesh: String,
    /// Share of the triangles
    ratio: f64,
    /// The GLB to write
    out: PathBuf,
}

impl StudyLevel {
    /// Just what a timed run of a study does.
    pub fn run(&self, _: &Context) -> anyhow::Result<Exit> {
        let study = study::Study::load(&self.study)?;
        study::level(&study, &self.algorithm, &self.mesh, self.ratio, &self.out)?;
        Ok(Exit::Fine)
    }
}
