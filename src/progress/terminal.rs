//! Events on a terminal: three bars that disappear when the work is done, and lines for what must be read.

use std::fmt;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::lines::failures;
use super::quantity::{count, duration, plural, short};
use super::{Event, Paint, Reporter, Summary, failure_message};

/// Redraws per second; more is flicker, and every redraw is a system call.
const REDRAWS_PER_SECOND: u8 = 10;
/// The clock of a long job goes on although no event comes.
const TICK: Duration = Duration::from_millis(250);
/// A rate from less than this is noise.
const RATE_AFTER: Duration = Duration::from_millis(500);

/// Draws bars on standard error.
pub struct Terminal {
    bars: MultiProgress,
    files: ProgressBar,
    jobs: ProgressBar,
    looks: ProgressBar,
    paint: Paint,
    verbose: bool,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    phase: Phase,
    files: u64,
    /// Scenes that need not be read any more.
    read: u64,
    /// Scenes that are through: written, unchanged or failed.
    done: u64,
    meshes: u64,
    meshes_done: u64,
    running: Vec<(String, u64)>,
    failed: Vec<String>,
}

/// What is done with scenes now. Both alternate, since scenes come in waves.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Reading,
    Writing,
}

impl Terminal {
    /// Bars on standard error; `verbose` also tells each scene on a line that stays.
    pub fn new(paint: Paint, verbose: bool) -> Self {
        let bars = MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(REDRAWS_PER_SECOND));
        // Hidden until there is something to count: most commands send no event.
        let files = ProgressBar::hidden().with_style(files_style());
        let jobs = ProgressBar::hidden().with_style(jobs_style());
        let looks = ProgressBar::hidden().with_style(files_style());
        Self { bars, files, jobs, looks, paint, verbose, state: Mutex::default() }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A line above the bars that stays.
    fn say(&self, text: &str) {
        let written = self.bars.println(text);
        drop(written); // a closed terminal is no reason to stop a bake
    }

    fn detail(&self, text: &str) {
        if self.verbose {
            self.say(&self.paint.faint(text));
        }
    }

    fn scanned(&self, files: u64) {
        self.state().files = files;
        self.files.set_length(2 * files);
        self.bars.add(self.files.clone());
        self.files.enable_steady_tick(TICK);
        self.describe_files(|_| {});
    }

    /// A scene is half done when it is read and done when it is written: so the bar never runs backwards.
    fn describe_files(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.state();
        change(&mut state);
        let (what, number) = match state.phase {
            Phase::Reading => ("reading", state.read),
            Phase::Writing => ("scenes", state.done),
        };
        let label = format!("{what} {}/{}", count(number), count(state.files));
        let position = state.read + state.done;
        drop(state);
        self.files.set_prefix(label);
        self.files.set_position(position);
    }

    fn planned(&self, jobs: u64, triangles: u64) {
        self.describe_files(|state| {
            state.phase = Phase::Writing;
            state.meshes += jobs;
        });
        if jobs == 0 {
            return;
        }
        let is_first = self.jobs.length().unwrap_or(0) == 0;
        self.jobs.set_length(self.jobs.length().unwrap_or(0) + triangles);
        if is_first {
            self.bars.add(self.jobs.clone());
            self.jobs.reset_elapsed();
            self.jobs.reset_eta();
            self.jobs.enable_steady_tick(TICK);
        }
        self.describe_jobs();
    }

    fn job_started(&self, mesh: &str, triangles: u64) {
        self.state().running.push((mesh.to_owned(), triangles));
        self.describe_jobs();
    }

    fn job_finished(&self, mesh: &str, triangles: u64, cached: bool) {
        {
            let mut state = self.state();
            state.meshes_done += 1;
            state.running.retain(|(running, _)| running != mesh);
        }
        if cached {
            // Work that need not be done: out of the total, or the rate and the remaining time would be far too good.
            self.jobs.dec_length(triangles);
        } else {
            self.jobs.inc(triangles);
        }
        self.describe_jobs();
    }

    /// `baking 31/80`, and at the end of the line `now 115 k tri`: the largest mesh in work is what people wait for.
    fn describe_jobs(&self) {
        let state = self.state();
        let label = format!("baking {}/{}", count(state.meshes_done), count(state.meshes));
        let largest = state.running.iter().map(|(_, triangles)| *triangles).max();
        drop(state);
        self.jobs.set_prefix(label);
        let now = largest.map(|triangles| format!("now {} tri", short(triangles as f64)));
        self.jobs.set_message(now.unwrap_or_default());
    }

    fn looks_started(&self, meshes: u64) {
        // Nothing is simplified now, so there is no rate to tell.
        self.jobs.disable_steady_tick();
        if self.looks.length().unwrap_or(0) == 0 {
            self.bars.add(self.looks.clone());
        }
        self.looks.set_length(self.looks.length().unwrap_or(0) + meshes);
        self.describe_looks();
    }

    fn describe_looks(&self) {
        let (done, all) = (self.looks.position(), self.looks.length().unwrap_or(0));
        self.looks.set_prefix(format!("looking {}/{}", count(done), count(all)));
    }

    fn scene_done(&self) {
        self.describe_files(|state| state.done += 1);
    }

    fn failed(&self, path: &str, error: &str, hint: Option<&str>) {
        self.say(&self.paint.error_lines(&failure_message(path, error), hint));
        self.describe_files(|state| {
            state.failed.push(path.to_owned());
            state.done += 1;
            state.read += u64::from(state.phase == Phase::Reading);
        });
    }

    fn finished(&self, summary: &Summary) {
        self.looks.finish_and_clear();
        self.jobs.finish_and_clear();
        self.files.finish_and_clear();
        let mut failed = std::mem::take(&mut self.state().failed);
        failed.sort();
        if let Some(text) = failures(&failed, summary.files) {
            self.say(&format!("{} {text}", self.paint.error("error:")));
        }
    }
}

impl Reporter for Terminal {
    fn event(&self, event: &Event) {
        match event {
            Event::ScanFinished { files } => self.scanned(*files),
            Event::SceneStarted { .. } => self.describe_files(|state| state.phase = Phase::Reading),
            Event::SceneRead { path, meshes, .. } => {
                self.detail(&format!("read {path}: {}", plural(*meshes, "mesh")));
                self.describe_files(|state| state.read += 1);
            }
            Event::SceneUnchanged { path } => {
                self.detail(&format!("unchanged {path}"));
                self.describe_files(|state| {
                    state.read += 1;
                    state.done += 1;
                });
            }
            Event::PlanFinished { jobs, triangles, .. } => self.planned(*jobs, *triangles),
            Event::JobStarted { mesh, triangles } => self.job_started(mesh, *triangles),
            Event::JobFinished { mesh, triangles, cached } => self.job_finished(mesh, *triangles, *cached),
            Event::LooksStarted { meshes } => self.looks_started(*meshes),
            Event::LookFinished => {
                self.looks.inc(1);
                self.describe_looks();
            }
            Event::ScanFailed { error } => self.say(&self.paint.error_lines(error, None)),
            Event::SceneVanished { path } => self.say(&format!("removed the outputs of {path}, which is gone")),
            Event::ScenePlanned { path, reason, jobs } => {
                self.say(&format!("would bake {path}: {reason} ({})", plural(*jobs, "job")));
                self.scene_done();
            }
            Event::SceneWritten { path, changed, .. } => {
                self.detail(&format!("{} {path}", if *changed { "wrote" } else { "left untouched" }));
                self.scene_done();
            }
            Event::SceneFailed { path, error, hint } => self.failed(path, error, hint.as_deref()),
            Event::Warning { message, hint } => self.say(&self.paint.warning_lines(message, hint.as_deref())),
            Event::Finished { summary, .. } => self.finished(summary),
        }
    }
}

impl Drop for Terminal {
    /// A bake that ends by an error leaves no half bar behind.
    fn drop(&mut self) {
        self.looks.finish_and_clear();
        self.jobs.finish_and_clear();
        self.files.finish_and_clear();
    }
}

fn files_style() -> ProgressStyle {
    ProgressStyle::with_template("{prefix:<19} {bar:20}").expect("the template is a constant").progress_chars("━╸ ")
}

/// 19 + 20 columns and a rate of about 25 leave room for the message on a terminal of 80; what is too long is cut.
fn jobs_style() -> ProgressStyle {
    ProgressStyle::with_template("{prefix:<19} {bar:20} {rate} {wide_msg}")
        .expect("the template is a constant")
        .with_key("rate", write_rate)
        .progress_chars("━╸ ")
}

/// Whole seconds: an estimate is no better than that.
fn remaining(time: Duration) -> String {
    if time < Duration::from_secs(60) { format!("{:.0} s", time.as_secs_f64().ceil()) } else { duration(time) }
}

/// `1.2 M tri/s, 12 s left`, once there is something to go by.
fn write_rate(state: &ProgressState, to: &mut dyn fmt::Write) {
    if state.pos() == 0 || state.elapsed() < RATE_AFTER {
        return;
    }
    let rate = short(state.per_sec());
    let written = match state.len() {
        Some(length) if state.pos() < length => write!(to, "{rate} tri/s, {} left", remaining(state.eta())),
        _ => write!(to, "{rate} tri/s"),
    };
    written.expect("a line in memory can be written");
}
