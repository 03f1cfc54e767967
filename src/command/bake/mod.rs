//! `lodbake bake`: the stages of a bake in order; the only place where they meet.
//!
//! ```text
//! scan ▶ index ▶ [ read ▶ identify ▶ plan ▶ work ▶ emit ] for each wave of scenes ▶ report
//! ```
//!
//! A wave is as many changed scenes as fit into a share of memory, so that memory follows the largest scene and not
//! their number. One bad scene does not stop the others.

pub(super) mod record;
mod parts;
mod recover;
mod seen;
mod share;
mod survey;
mod sweep;
mod wave;
mod write;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Context as _;

use super::{CacheChoice, Context, Exit};
use crate::cache::Cache;
use crate::config::Pipeline;
use crate::emit::OutputFolder;
use crate::index::Index;
use crate::progress::{Event, Summary};
use crate::report::{self, Problem, Report, SceneRecord};
use crate::scan::scan;
use record::SceneFacts;
use survey::Survey;

/// Bake the scenes of a pipeline
#[derive(Debug, clap::Args)]
pub struct Bake {
    /// The pipeline file
    #[arg(value_name = "PIPELINE", default_value = "pipeline.toml")]
    pub(super) pipeline: PathBuf,
    /// Tell what would be done, write nothing
    #[arg(long, short = 'n')]
    pub(super) dry_run: bool,
}

/// What a bake carries from stage to stage.
struct Session<'a> {
    pipeline: &'a Pipeline,
    context: &'a Context,
    cache: Cache,
    index: Index,
    summary: Summary,
    /// Facts of every scene, by path.
    scenes: BTreeMap<String, SceneFacts>,
    /// Problems of no scene.
    problems: Vec<Problem>,
    /// Files that could not even be taken as scenes.
    undone: u64,
}

impl Bake {
    /// Bakes; `Exit::Undone` if a scene failed.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let started = Instant::now();
        let pipeline = Pipeline::load(&self.pipeline)?;
        let jobs = context.jobs.map_or(pipeline.jobs, std::num::NonZeroUsize::get);
        let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().context("failed to start threads")?;
        threads.install(|| self.bake(context, &pipeline, started))
    }

    fn bake(&self, context: &Context, pipeline: &Pipeline, started: Instant) -> anyhow::Result<Exit> {
        let mut session = Session::open(pipeline, context, self.dry_run)?;
        let found = scan(pipeline)?;
        context.reporter.event(&Event::ScanFinished { files: found.files.len() as u64 });
        session.summary.files = found.files.len() as u64;
        session.take_scan(&found);
        let Survey { todo } = session.survey(&found);
        let output = OutputFolder::new(&pipeline.output.path);
        for wave in wave::waves(todo) {
            if self.dry_run {
                session.plan_only(wave);
            } else {
                session.bake_wave(wave, &output);
            }
        }
        if !self.dry_run {
            session.sweep(&found);
        }
        session.finish(started.elapsed(), self.dry_run)
    }
}

impl<'a> Session<'a> {
    fn open(pipeline: &'a Pipeline, context: &'a Context, dry_run: bool) -> anyhow::Result<Self> {
        let folder = match &context.cache {
            CacheChoice::Pipeline => Some(pipeline.cache.path.clone()),
            CacheChoice::Folder(folder) => Some(folder.clone()),
            CacheChoice::Off => None,
        };
        let cache = match &folder {
            Some(folder) => Cache::open(folder),
            None => Cache::temporary().context("failed to make a temporary cache folder")?,
        };
        let (index, warning) = match &folder {
            Some(folder) => Index::open(folder, pipeline),
            None => Index::open(cache.folder(), pipeline),
        };
        let mut session = Self {
            pipeline,
            context,
            cache,
            index,
            summary: Summary { dry_run, ..Summary::default() },
            scenes: BTreeMap::new(),
            problems: Vec::new(),
            undone: 0,
        };
        if let Some(warning) = warning {
            session.warn_run(&warning.to_string());
        }
        Ok(session)
    }

    /// A warning that concerns this run and no scene: it is told and not recorded, since the outputs are the same.
    fn warn_run(&mut self, message: &str) {
        self.summary.warnings += 1;
        let event = Event::Warning { message: message.to_owned(), hint: None };
        self.context.reporter.event(&event);
    }

    /// Writes index and report, tells the summary.
    fn finish(mut self, wall: Duration, dry_run: bool) -> anyhow::Result<Exit> {
        if !dry_run && let Err(error) = self.index.save() {
            self.warn_run(&format!("{error}; the next bake starts anew"));
        }
        let mut problems = std::mem::take(&mut self.problems);
        let mut records: Vec<SceneRecord> = Vec::with_capacity(self.scenes.len());
        for facts in std::mem::take(&mut self.scenes).into_values() {
            problems.extend(facts.problems);
            records.push(facts.record);
        }
        let report = Report::new(self.pipeline.settings(), records, problems);
        self.summary.meshes_found = report.totals.meshes_found;
        self.summary.meshes_distinct = report.totals.meshes_distinct;
        if !dry_run {
            report::write(&report, &self.pipeline.output.path)?;
        }
        let failed = 0 < self.summary.failed || 0 < self.undone;
        let finished = Event::Finished { summary: self.summary.clone(), seconds: wall.as_secs_f64() };
        self.context.reporter.event(&finished);
        self.context.tell(&report::summary_table(&report, &self.summary, wall));
        Ok(if failed { Exit::Undone } else { Exit::Fine })
    }
}
