//! `lodbake check`: what was baked, held against the budgets of the pipeline. Reads file facts and what the index
//! remembers, no scene; bakes nothing and writes nothing unless it is asked to. Fast enough for a commit hook.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::bake::{self, record};
use super::failure::UsageError;
use super::{CacheChoice, Context, Exit, recorded};
use crate::budget::{self, Finding};
use crate::config::{Pipeline, SceneSettings};
use crate::index::{Index, Reason, SettingsKey, Status};
use crate::progress::quantity::{count, duration, plural};
use crate::report::{Report, SceneRecord, Severity};
use crate::scan::{SceneFile, scan};

/// Hold what was baked against the budgets of a pipeline
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Check {
    /// The pipeline file (`.toml`), then the files to check: scenes, their buffers, or their outputs [default: all]
    #[arg(value_name = "FILE")]
    words: Vec<PathBuf>,
    /// What growth is measured against: a report, a folder with one, or a git revision [default: as the pipeline says]
    #[arg(long, value_name = "REPORT|REVISION")]
    baseline: Option<String>,
    /// Bake what is missing or has changed first
    #[arg(long)]
    bake_missing: bool,
}

const AFTER_HELP: &str = "\
The facts are those that the last bake recorded: a scene that has changed since, or was never baked, cannot be judged \
and is named. Files that are no part of the pipeline are passed over, so that hooks can name whatever has changed.

Exit codes: 1 if a limit `error` is exceeded; 3 if some scene could not be judged; 0 with warnings alone.";

/// Scenes that are judged by one thread: a scene takes some microseconds, a thread's start more.
const ONE_THREAD: usize = 100;

/// Findings that are told without `--verbose`: the worst.
const SHOWN: usize = 40;

/// What `check --json` writes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct Checked {
    /// Scenes that were judged.
    scenes: u64,
    /// Scenes that could not be.
    unknown: Vec<Unknown>,
    /// What is beyond its limit, the worst first.
    findings: Vec<Finding>,
    /// What was not checked, and other words.
    notes: Vec<String>,
}

/// A scene without facts.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct Unknown {
    /// Relative to its input folder.
    scene: String,
    /// Why nothing is known of it.
    reason: String,
}

/// The JSON schema of `check --json`.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Checked).to_value()
}

impl Check {
    /// Checks; [`Exit::OverBudget`] if an error was found, [`Exit::Undone`] if a scene could not be judged.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let started = Instant::now();
        let (file, files) = self.split()?;
        let pipeline = Pipeline::load(file)?;
        if self.bake_missing {
            let bake = bake::Bake { pipeline: file.to_owned(), dry_run: false };
            // Events would stand before the one document that `--json` promises. What fails is named below as unknown.
            if context.json {
                bake.run(&context.silent())?
            } else {
                bake.run(context)?
            };
        }
        let checked = self.check(context, &pipeline, files)?;
        if context.json {
            context.print(&format!("{}\n", serde_json::to_string_pretty(&checked)?))?;
        } else {
            context.print(&checked.to_text(context))?;
            let baked = if files.is_empty() { "" } else { " of the files named" };
            let (errors, warnings) = (checked.count(Severity::Error), checked.count(Severity::Warning));
            let found = format!("{}, {}", plural(errors, "error"), plural(warnings, "warning"));
            let unknown = match checked.unknown.len() as u64 {
                0 => String::new(),
                unknown => format!(", {} not judged", plural(unknown, "scene")),
            };
            let scenes = plural(checked.scenes, "scene");
            context.tell(&format!("checked {scenes}{baked}: {found}{unknown} ({})", duration(started.elapsed())));
        }
        Ok(if 0 < checked.count(Severity::Error) {
            Exit::OverBudget
        } else if checked.unknown.is_empty() {
            Exit::Fine
        } else {
            Exit::Undone
        })
    }

    /// The pipeline, and the files to check.
    fn split(&self) -> Result<(&Path, &[PathBuf]), UsageError> {
        let is_pipeline = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let (file, files) = match self.words.split_first() {
            Some((first, rest)) if is_pipeline(first) => (first.as_path(), rest),
            _ => (Path::new("pipeline.toml"), &self.words[..]),
        };
        match files.iter().find(|path| is_pipeline(path)) {
            Some(second) => Err(UsageError {
                message: format!("`{}` is a second pipeline: `check` takes one", second.display()),
                hint: Some("the pipeline comes first, then the files to check".to_owned()),
            }),
            None => Ok((file, files)),
        }
    }

    fn check(&self, context: &Context, pipeline: &Pipeline, files: &[PathBuf]) -> anyhow::Result<Checked> {
        let mut notes = Vec::new();
        if pipeline.budgets.is_empty() {
            notes.push(format!("`{}` has no `[[budget]]`: nothing is limited", pipeline.file));
        }
        let base = self.base(pipeline, &mut notes)?;
        let base: BTreeMap<&str, &SceneRecord> =
            base.iter().flat_map(|report| &report.scenes).map(|scene| (scene.path.as_str(), scene)).collect();
        let found = scan(pipeline)?;
        let cache = match &context.cache {
            CacheChoice::Folder(folder) => folder.clone(),
            CacheChoice::Pipeline | CacheChoice::Off => pipeline.cache.path.clone(),
        };
        let (index, warning) = Index::open(&cache, pipeline);
        notes.extend(warning.map(|warning| warning.to_string()));
        let wanted = if files.is_empty() { None } else { Some(named(files, pipeline, &found.files, &index)) };
        let limited = |file: &SceneFile| pipeline.budgets.iter().any(|budget| budget.matches(&file.relative));
        let scenes: Vec<&SceneFile> = (found.files.iter())
            .filter(|file| wanted.as_ref().is_none_or(|wanted| wanted.contains(file.relative.as_str())))
            .filter(|file| limited(file))
            .collect();
        // Settings are the same for most scenes: their key is made once for each kind.
        let mut kinds: Vec<(SceneSettings, SettingsKey)> = Vec::new();
        let mut tasks = Vec::new();
        for file in scenes {
            let settings = pipeline.settings_for(&file.relative);
            if settings.skip {
                continue;
            }
            let known = kinds.iter().position(|(other, _)| *other == settings);
            let kind = known.unwrap_or_else(|| {
                kinds.push((settings.clone(), SettingsKey::of(settings)));
                kinds.len() - 1
            });
            tasks.push((file, kind));
        }
        if files.is_empty() {
            index.load_facts();
        }
        let judged: Vec<Result<Vec<Finding>, Unknown>> = tasks
            .par_iter()
            .with_min_len(ONE_THREAD)
            .map(|&(file, kind)| {
                let (settings, key) = &kinds[kind];
                let scene = record_of(&index, file, key)?;
                let base = base.get(file.relative.as_str()).copied();
                Ok(budget::check(&scene, &pipeline.budgets, settings.min_triangles as u64, base))
            })
            .collect();
        let mut checked = Checked { scenes: 0, unknown: Vec::new(), findings: Vec::new(), notes };
        for result in judged {
            match result {
                Ok(findings) => {
                    checked.scenes += 1;
                    checked.findings.extend(findings);
                }
                Err(unknown) => checked.unknown.push(unknown),
            }
        }
        if files.is_empty() {
            let is_there = |path: &str| found.files.iter().any(|file| file.relative == path);
            let gone = base.values().filter(|scene| scene.status != crate::report::Status::Skipped);
            checked.findings.extend(gone.filter(|scene| !is_there(&scene.path)).map(|scene| vanished(&scene.path)));
        }
        budget::sort(&mut checked.findings);
        Ok(checked)
    }

    /// The report that growth is measured against, where a limit needs one.
    fn base(&self, pipeline: &Pipeline, notes: &mut Vec<String>) -> anyhow::Result<Option<Report>> {
        if let Some(named) = &self.baseline {
            return recorded::read(named, Some(pipeline)).map(Some);
        }
        if !budget::needs_baseline(&pipeline.budgets) {
            return Ok(None);
        }
        match &pipeline.baseline {
            Some(file) if file.path.is_file() => recorded::read(&file.path.to_string_lossy(), Some(pipeline)).map(Some),
            Some(file) => {
                let text = format!(
                    "growth is not checked: the baseline `{file}` is not there; `lodbake report --output {file}` after a bake writes it"
                );
                notes.push(text);
                Ok(None)
            }
            None => {
                notes.push("growth is not checked: name a `baseline` in the pipeline, or with `--baseline`".to_owned());
                Ok(None)
            }
        }
    }
}

/// A scene of the baseline that is not there any more: told, and no reason to stop a commit.
fn vanished(path: &str) -> Finding {
    Finding {
        severity: Severity::Warning,
        rule: "regression/vanished".to_owned(),
        scene: Some(path.to_owned()),
        mesh: None,
        level: None,
        value: None,
        base: None,
        limit: None,
        message: "the scene is in the baseline and not there any more".to_owned(),
        help: "if it was meant: take a new baseline".to_owned(),
        line: None,
        excess: f64::MAX,
    }
}

/// What is remembered of a scene, if it is as it was then.
fn record_of(index: &Index, file: &SceneFile, key: &SettingsKey) -> Result<SceneRecord, Unknown> {
    let unknown = |reason: String| Unknown { scene: file.relative.clone(), reason };
    let words = |reasons: &[Reason]| reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    match index.knows(file, key) {
        Status::Unchanged(_) => {}
        Status::Touched(entry) => {
            let reasons = index.recheck_sources(file, entry).reasons;
            if !reasons.is_empty() {
                return Err(unknown(format!("not baked since it changed: {}", words(&reasons))));
            }
        }
        Status::Changed(reasons) => return Err(unknown(format!("not baked since it changed: {}", words(&reasons)))),
        Status::New => return Err(unknown("not baked yet, or its bake failed".to_owned())),
    }
    let facts = index.facts(&file.relative).as_deref().and_then(record::from_bytes);
    facts.map(|facts| facts.record).ok_or_else(|| unknown("baked by another version of lodbake".to_owned()))
}

/// The scenes that the named files belong to, as scenes, as files that they refer to, or as their outputs.
fn named(files: &[PathBuf], pipeline: &Pipeline, scenes: &[SceneFile], index: &Index) -> BTreeSet<String> {
    let wanted: BTreeSet<PathBuf> =
        files.iter().map(|file| file.canonicalize().unwrap_or_else(|_| file.clone())).collect();
    let folder = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let inputs: Vec<PathBuf> = pipeline.inputs.iter().map(|input| folder(&input.path)).collect();
    let output = folder(&pipeline.output.path);
    let belongs = |scene: &&SceneFile| {
        let path = inputs[scene.input].join(&scene.relative);
        let base = path.parent().unwrap_or(Path::new("")).to_owned();
        let is_dependency = |entry: &crate::index::Entry| {
            entry.dependencies.iter().any(|d| wanted.contains(&folder(&base.join(&d.relative))))
                || entry.outputs.iter().any(|o| wanted.contains(&output.join(&o.relative)))
        };
        // Links below an input folder are followed only where the plain path says nothing.
        wanted.contains(&path) || index.entry(&scene.relative).is_some_and(is_dependency)
    };
    let mut found: BTreeSet<String> = scenes.iter().filter(belongs).map(|scene| scene.relative.clone()).collect();
    if found.len() < wanted.len() {
        let linked = scenes.iter().filter(|scene| wanted.contains(&folder(&scene.path)));
        found.extend(linked.map(|scene| scene.relative.clone()));
    }
    found
}

impl Checked {
    fn count(&self, severity: Severity) -> u64 {
        self.findings.iter().filter(|finding| finding.severity == severity).count() as u64
    }

    fn to_text(&self, context: &Context) -> String {
        let paint = context.paint;
        let mut lines = Vec::new();
        let shown = if context.verbose { usize::MAX } else { SHOWN };
        for finding in self.findings.iter().take(shown) {
            let text = format!("{}: {}", finding.place(), finding.message);
            let hint = (!finding.help.is_empty()).then_some(finding.help.as_str());
            lines.push(match finding.severity {
                Severity::Error => paint.error_lines(&text, hint),
                Severity::Warning => paint.warning_lines(&text, hint),
            });
        }
        if shown < self.findings.len() {
            lines.push(format!("and {} more: `--verbose` lists all", count((self.findings.len() - shown) as u64)));
        }
        let hint = "`lodbake` bakes them, `lodbake check --bake-missing` bakes and checks";
        let told = self.unknown.len().min(shown);
        for (i, unknown) in self.unknown.iter().take(told).enumerate() {
            let is_last = i + 1 == told;
            lines.push(paint.error_lines(&format!("{}: {}", unknown.scene, unknown.reason), is_last.then_some(hint)));
        }
        if told < self.unknown.len() {
            let more = count((self.unknown.len() - told) as u64);
            lines.push(format!("and {more} more that cannot be judged: `--verbose` lists all"));
        }
        lines.extend(self.notes.iter().map(|note| paint.warning_lines(note, None)));
        lines.into_iter().map(|line| line + "\n").collect()
    }
}
