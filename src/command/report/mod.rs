//! `lodbake report`: what was recorded, in the formats in which others read it. Bakes nothing; only pages read scenes, for
//! their pictures.

mod assets;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::diff::{Limits, pipeline_at};
use super::failure::UsageError;
use super::{Context, Exit, recorded};
use crate::budget::{self, Finding};
use crate::config::Pipeline;
use crate::difference::Difference;
use crate::publish::{self, Publication, ScenePaths, html::Extras};
use crate::report::{self as record, Report, SceneRecord};

/// Write what was recorded for comments, CI services, trackers, or as a page
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct ReportCommand {
    /// A pipeline (`.toml`), or reports: files, folders with one, git revisions; of several the last is the newest, the
    /// others are its history [default: the report of the pipeline's outputs]
    #[arg(value_name = "PIPELINE|REPORT")]
    words: Vec<String>,
    /// The pipeline that the reports belong to: its budgets are checked
    #[arg(long, value_name = "PIPELINE", default_value = "pipeline.toml")]
    pipeline: PathBuf,
    /// The format [default: by the name of the output, else markdown]
    #[arg(long, short, value_enum)]
    format: Option<Format>,
    /// The file to write; several may be given [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// What changes are told against: a report, a folder with one, or a git revision [default: as the pipeline says]
    #[arg(long, value_name = "REPORT|REVISION")]
    baseline: Option<String>,
    #[command(flatten)]
    limits: Limits,
    /// Contact sheets on a page, of the assets with the worst findings
    #[arg(long, value_name = "N", default_value_t = 24)]
    sheets: usize,
    /// A live view of these assets on a page: the levels in 3-D, switched by distance. Makes the page larger by 0.8 MB
    /// and by the assets
    #[arg(long)]
    viewer: bool,
}

const AFTER_HELP: &str = "\
Formats by name: .html, .md, .sarif, .xml (JUnit), .json (the report itself, e.g. for a baseline). With `github`, \
annotations go to standard output and a summary to $GITHUB_STEP_SUMMARY. Run it at the top of the repository, so that \
code hosts find the files that it names.

The exit code does not tell whether there are findings: `lodbake check` and `lodbake diff` do.";

/// In which form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// The report itself
    Json,
    /// For a comment: at most 64 KB
    Markdown,
    /// One page with tables, plots and pictures
    Html,
    /// JUnit XML: a test case for each scene
    Junit,
    /// SARIF 2.1.0, for code scanning
    Sarif,
    /// Annotations of GitHub Actions, and the step's summary
    Github,
    /// Bencher Metric Format
    Bencher,
    /// github-action-benchmark's `customSmallerIsBetter`
    Benchmark,
}

/// Most bytes of a comment: GitHub takes 65,536 characters.
const COMMENT: usize = 64_000;

/// Most bytes of a step's summary: GitHub takes a mebibyte.
const SUMMARY: usize = 1_000_000;

impl Format {
    fn of(path: &Path) -> Result<Self, UsageError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        match extension.as_str() {
            "json" => Ok(Self::Json),
            "md" | "markdown" => Ok(Self::Markdown),
            "html" | "htm" => Ok(Self::Html),
            "xml" => Ok(Self::Junit),
            "sarif" => Ok(Self::Sarif),
            _ => Err(UsageError {
                message: format!("`{}` does not tell its format", path.display()),
                hint: Some("name it with `--format`, or end the file in .html, .md, .sarif, .xml or .json".to_owned()),
            }),
        }
    }
}

/// All that is known before a format is chosen.
struct Known {
    pipeline: Option<Pipeline>,
    report: Report,
    history: Vec<(String, Report)>,
    /// Where the outputs are that the report tells of.
    outputs: Option<PathBuf>,
    difference: Option<Difference>,
    findings: Vec<Finding>,
}

impl ReportCommand {
    /// Writes the report; [`Exit::Fine`] whatever it says.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let targets: Vec<(Option<&Path>, Format)> = match (&self.output[..], self.format) {
            ([], format) => vec![(None, format.unwrap_or(Format::Markdown))],
            ([one], Some(format)) => vec![(Some(one), format)],
            ([_, ..], Some(_)) => {
                let hint = Some("leave `--format` away: each file is written by its name".to_owned());
                return Err(UsageError { message: "`--format` is for one output".to_owned(), hint }.into());
            }
            (many, None) => many
                .iter()
                .map(|path| Ok((Some(path.as_path()), Format::of(path)?)))
                .collect::<Result<_, UsageError>>()?,
        };
        let jobs = context.jobs.map_or(0, std::num::NonZeroUsize::get);
        let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().context("failed to start threads")?;
        // The record alone, as for a first baseline, needs nothing to be compared with.
        let is_compared = targets.iter().any(|(_, format)| *format != Format::Json);
        let known = self.read(context, is_compared)?;
        for (path, format) in targets {
            let text = threads.install(|| self.text(&known, format, context))?;
            match path {
                None => context.print(&text)?,
                Some(path) => {
                    write(path, text.as_bytes()).with_context(|| format!("failed to write `{}`", path.display()))?;
                    context.tell(&format!("wrote `{}`", path.display()));
                }
            }
        }
        Ok(Exit::Fine)
    }

    fn read(&self, context: &Context, is_compared: bool) -> anyhow::Result<Known> {
        let is_pipeline = |word: &String| Path::new(word).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let (file, words) = match self.words.split_first() {
            Some((first, rest)) if is_pipeline(first) => (Path::new(first), rest),
            _ => (self.pipeline.as_path(), &self.words[..]),
        };
        // A pipeline that was named must be there.
        let is_named = file != Path::new("pipeline.toml");
        let pipeline = if is_named { Some(Pipeline::load(file)?) } else { pipeline_at(file)? };
        let mut reports = Vec::new();
        for word in words {
            reports.push((word.clone(), recorded::read(word, pipeline.as_ref())?));
        }
        let written = || pipeline.as_ref().map(|pipeline| pipeline.output.path.clone());
        let (report, outputs) = match reports.pop() {
            None => (recorded::of_outputs(pipeline.as_ref())?, written()),
            Some((word, report)) => {
                let path = PathBuf::from(&word);
                let beside = if path.is_dir() { Some(path) } else { path.parent().map(Path::to_owned) };
                // A copy of the record, such as a baseline, has no outputs beside it.
                let has_outputs =
                    |folder: &PathBuf| report.scenes.iter().any(|s| assets::main_file(s, folder).is_some());
                let outputs = beside.filter(has_outputs).or_else(written);
                (report, outputs)
            }
        };
        let base = if is_compared { self.base(pipeline.as_ref(), context)? } else { None };
        let difference = base.as_ref().map(|base| Difference::between(base, &report, &self.limits.thresholds()));
        let findings = findings(&report, pipeline.as_ref(), base.as_ref(), difference.as_ref());
        Ok(Known { pipeline, report, history: reports, outputs, difference, findings })
    }

    fn base(&self, pipeline: Option<&Pipeline>, context: &Context) -> anyhow::Result<Option<Report>> {
        if let Some(named) = &self.baseline {
            return recorded::read(named, pipeline).map(Some);
        }
        let Some(file) = pipeline.and_then(|pipeline| pipeline.baseline.as_ref()) else { return Ok(None) };
        if file.path.is_file() {
            return recorded::read(&file.path.to_string_lossy(), pipeline).map(Some);
        }
        context.tell(&format!("the baseline `{file}` is not there: no changes are told"));
        Ok(None)
    }

    fn text(&self, known: &Known, format: Format, context: &Context) -> anyhow::Result<String> {
        let paths = Paths::new(known.pipeline.as_ref());
        let publication = Publication {
            report: &known.report,
            findings: &known.findings,
            difference: known.difference.as_ref(),
            paths: &paths,
        };
        let pretty = |value: serde_json::Value| format!("{value:#}\n");
        Ok(match format {
            Format::Json => String::from_utf8(record::to_json(&known.report)).context("failed to write the report")?,
            Format::Markdown => publish::markdown(&publication, COMMENT),
            Format::Junit => publish::junit(&publication),
            Format::Sarif => pretty(publish::sarif(&publication)),
            Format::Bencher => pretty(publish::bencher(&publication)),
            Format::Benchmark => pretty(publish::benchmark(&publication)),
            Format::Github => {
                if let Some(path) = std::env::var_os("GITHUB_STEP_SUMMARY").filter(|path| !path.is_empty()) {
                    append(Path::new(&path), &publish::markdown(&publication, SUMMARY))
                        .context("failed to write to $GITHUB_STEP_SUMMARY")?;
                }
                publish::annotations(&publication)
            }
            Format::Html => {
                let wanted: Vec<&SceneRecord> =
                    publish::by_severity(&publication).into_iter().take(self.sheets).collect();
                let made = match &known.outputs {
                    Some(folder) => assets::make(&wanted, folder, self.viewer, context),
                    None => Vec::new(),
                };
                let viewer = self.viewer.then_some(assets::VIEWER);
                publish::html::html(&publication, &Extras { history: &known.history, assets: &made, viewer })
            }
        })
    }
}

/// Problems of the bake, violations of budgets, regressions: the worst first.
fn findings(
    report: &Report,
    pipeline: Option<&Pipeline>,
    base: Option<&Report>,
    difference: Option<&Difference>,
) -> Vec<Finding> {
    let mut found: Vec<Finding> = report.problems.iter().map(Finding::of_problem).collect();
    let budgets = pipeline.map(|pipeline| &pipeline.budgets[..]).unwrap_or_default();
    let before = |path: &str| base?.scenes.iter().find(|scene| scene.path == path);
    for scene in &report.scenes {
        let settings = scene.settings.as_ref().unwrap_or(&report.settings);
        found.extend(budget::check(scene, budgets, settings.min_triangles as u64, before(&scene.path)));
    }
    // What a budget already says of a fact's growth is not said again.
    let said = |one: &Finding| {
        let same = |f: &Finding| (&f.scene, &f.mesh, f.value, f.base) == (&one.scene, &one.mesh, one.value, one.base);
        one.value.is_some() && found.iter().any(same)
    };
    let regressions = difference.into_iter().flat_map(Difference::findings).filter(|one| !said(one));
    let regressions: Vec<Finding> = regressions.collect();
    found.extend(regressions);
    budget::sort(&mut found);
    found
}

/// Where sources are, seen from the folder that the command runs in.
#[derive(Debug)]
struct Paths {
    inputs: Vec<PathBuf>,
    pipeline: String,
}

impl Paths {
    fn new(pipeline: Option<&Pipeline>) -> Self {
        Self {
            inputs: pipeline.map(|p| p.inputs.iter().map(|input| input.path.clone()).collect()).unwrap_or_default(),
            pipeline: pipeline.map_or_else(|| "pipeline.toml".to_owned(), |p| slashes(Path::new(&p.file))),
        }
    }
}

impl ScenePaths for Paths {
    fn scene(&self, relative: &str) -> String {
        let of = self.inputs.iter().find(|input| input.join(relative).is_file()).or(self.inputs.first());
        of.map_or_else(|| relative.to_owned(), |input| slashes(&input.join(relative)))
    }

    fn pipeline(&self) -> String {
        self.pipeline.clone()
    }
}

/// As addresses have it: `/`, no leading `./`.
fn slashes(path: &Path) -> String {
    let text = path.to_string_lossy().replace('\\', "/");
    text.strip_prefix("./").map(str::to_owned).unwrap_or(text)
}

/// Whole or not at all.
fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".report");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

fn append(path: &Path, text: &str) -> std::io::Result<()> {
    std::fs::File::options().create(true).append(true).open(path)?.write_all(text.as_bytes())
}
