//! Events as plain lines, for logs and for `--quiet`.
//!
//! Reads no clock: progress is told at every tenth of the work, so a log has the same length on every machine.

use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::quantity::{count, plural};
use super::{Event, Paint, Reporter, Sink, Summary, failure_message, write_line};

/// Failed scenes named again at the end; more than these are counted only.
const NAMED_AT_THE_END: usize = 20;

/// Fewer scenes are written in no time once their meshes are baked: not worth ten lines.
const SCENES_WORTH_TELLING: u64 = 100;

/// How much is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only.
    Quiet,
    /// Errors, warnings, and progress at every tenth.
    Normal,
    /// Also each scene and each job.
    Verbose,
}

/// Writes lines.
pub struct Lines {
    sink: Sink,
    paint: Paint,
    verbosity: Verbosity,
    tally: Mutex<Tally>,
}

/// What has been done so far.
#[derive(Default)]
struct Tally {
    files: Tenths,
    jobs: Tenths,
    failed: Vec<String>,
}

/// Counts to a total and speaks at each tenth of it.
#[derive(Default)]
struct Tenths {
    done: u64,
    total: u64,
    told: u64,
}

impl Tenths {
    /// One more; the percentage if a new tenth is complete.
    fn step(&mut self) -> Option<u64> {
        self.done += 1;
        let tenth = (self.done * 10).checked_div(self.total)?.min(10);
        let new = tenth > self.told;
        self.told = tenth.max(self.told);
        new.then_some(tenth * 10)
    }
}

impl Lines {
    /// Lines go to `sink`.
    pub fn new(sink: Box<dyn Write + Send>, paint: Paint, verbosity: Verbosity) -> Self {
        Self { sink: Mutex::new(sink), paint, verbosity, tally: Mutex::default() }
    }

    fn tell(&self, least: Verbosity, line: &str) {
        if self.verbosity >= least {
            write_line(&self.sink, line);
        }
    }

    fn tally(&self) -> MutexGuard<'_, Tally> {
        self.tally.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn scene_done(&self) {
        if self.tally().files.total >= SCENES_WORTH_TELLING {
            self.step("scenes", |tally| &mut tally.files);
        }
    }

    fn step(&self, what: &str, pick: impl Fn(&mut Tally) -> &mut Tenths) {
        let line = {
            let mut tally = self.tally();
            let tenths = pick(&mut tally);
            tenths.step().map(|percent| format!("{what} {percent} % ({} of {})", tenths.done, tenths.total))
        };
        if let Some(line) = line {
            self.tell(Verbosity::Normal, &line);
        }
    }

    fn failed(&self, path: &str, error: &str, hint: Option<&str>) {
        self.tell(Verbosity::Quiet, &self.paint.error_lines(&failure_message(path, error), hint));
        self.tally().failed.push(path.to_owned());
    }

    fn finished(&self, summary: &Summary) {
        let mut failed = std::mem::take(&mut self.tally().failed);
        failed.sort();
        if let Some(text) = failures(&failed, summary.files) {
            self.tell(Verbosity::Normal, &format!("{} {text}", self.paint.error("error:")));
        }
    }
}

/// Names the failed scenes once more, since their errors may be far up in a long log. `None` when one line was enough.
pub(super) fn failures(failed: &[String], files: u64) -> Option<String> {
    if failed.len() < 2 {
        return None;
    }
    let title = format!("{} of {} could not be baked:", count(failed.len() as u64), plural(files, "scene"));
    let named = failed.iter().take(NAMED_AT_THE_END).cloned();
    let rest = failed.len().saturating_sub(NAMED_AT_THE_END);
    let rest = (rest > 0).then(|| format!("and {rest} more"));
    Some(std::iter::once(title).chain(named).chain(rest).collect::<Vec<_>>().join("\n  "))
}

impl Reporter for Lines {
    fn event(&self, event: &Event) {
        match event {
            Event::ScanFinished { files } => {
                self.tally().files.total = *files;
                self.tell(Verbosity::Verbose, &format!("found {}", plural(*files, "scene")));
            }
            Event::PlanFinished { found, distinct, jobs, triangles } => {
                self.tally().jobs.total += *jobs;
                if *jobs > 0 {
                    let (found, distinct, triangles) =
                        (plural(*found, "mesh"), count(*distinct), plural(*triangles, "triangle"));
                    self.tell(
                        Verbosity::Normal,
                        &format!("{found}, {distinct} distinct: {} to bake, {triangles}", count(*jobs)),
                    );
                }
            }
            Event::SceneUnchanged { path } => {
                self.tell(Verbosity::Verbose, &format!("unchanged {path}"));
                let mut tally = self.tally();
                tally.files.total = tally.files.total.saturating_sub(1);
            }
            Event::SceneStarted { .. } | Event::LookFinished => {}
            Event::SceneRead { path, meshes, .. } => {
                self.tell(Verbosity::Verbose, &format!("read {path}: {}", plural(*meshes, "mesh")));
            }
            Event::JobStarted { mesh, triangles } => {
                self.tell(Verbosity::Verbose, &format!("baking {mesh}: {}", plural(*triangles, "triangle")));
            }
            Event::JobFinished { mesh, cached, .. } => {
                let how = if *cached { "from the cache" } else { "baked" };
                self.tell(Verbosity::Verbose, &format!("{how} {mesh}"));
                self.step("meshes", |tally| &mut tally.jobs);
            }
            Event::LooksStarted { meshes } => {
                self.tell(Verbosity::Normal, &format!("looking at the levels of {}", plural(*meshes, "mesh")));
            }
            Event::ScanFailed { error } => self.tell(Verbosity::Quiet, &self.paint.error_lines(error, None)),
            Event::SceneVanished { path } => {
                self.tell(Verbosity::Normal, &format!("removed the outputs of {path}, which is gone"));
            }
            Event::ScenePlanned { path, reason, jobs } => {
                self.tell(Verbosity::Normal, &format!("would bake {path}: {reason} ({})", plural(*jobs, "job")));
            }
            Event::SceneWritten { path, changed, .. } => {
                let how = if *changed { "wrote" } else { "left untouched" };
                self.tell(Verbosity::Verbose, &format!("{how} {path}"));
                self.scene_done();
            }
            Event::SceneFailed { path, error, hint } => {
                self.failed(path, error, hint.as_deref());
                self.scene_done();
            }
            Event::Warning { message, hint } => {
                self.tell(Verbosity::Normal, &self.paint.warning_lines(message, hint.as_deref()));
            }
            Event::Finished { summary, .. } => self.finished(summary),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    /// A buffer that can be read while the writer owns it.
    #[derive(Clone, Default)]
    struct Buffer(Arc<Mutex<Vec<u8>>>);

    impl Write for Buffer {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().expect("no test panics while it writes").extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn told(verbosity: Verbosity, events: &[Event]) -> String {
        let buffer = Buffer::default();
        let lines = Lines::new(Box::new(buffer.clone()), Paint::OFF, verbosity);
        for event in events {
            lines.event(event);
        }
        let bytes = buffer.0.lock().expect("no test panics while it writes").clone();
        String::from_utf8(bytes).expect("lines are UTF-8")
    }

    fn written(path: &str) -> Event {
        Event::SceneWritten { path: path.into(), bytes: 1, changed: true }
    }

    fn failed(path: &str) -> Event {
        Event::SceneFailed { path: path.into(), error: "no good".into(), hint: Some("mend it".into()) }
    }

    #[test]
    fn progress_is_told_at_tenths_only() {
        let mut events = vec![Event::ScanFinished { files: 200 }];
        events.extend((0..200).map(|_| written("a.glb")));
        let text = told(Verbosity::Normal, &events);
        assert_eq!(text.lines().count(), 10);
        assert_eq!(text.lines().next(), Some("scenes 10 % (20 of 200)"));
        assert_eq!(text.lines().last(), Some("scenes 100 % (200 of 200)"));
    }

    #[test]
    fn few_meshes_skip_tenths_rather_than_repeat_them() {
        let mesh = || Event::JobFinished { mesh: "00ff".into(), triangles: 9, cached: false };
        let plan = Event::PlanFinished { found: 3, distinct: 3, jobs: 3, triangles: 27 };
        let text = told(Verbosity::Normal, &[plan, mesh(), mesh(), mesh()]);
        let lines: Vec<&str> = text.lines().collect();
        let tenths = ["meshes 30 % (1 of 3)", "meshes 60 % (2 of 3)", "meshes 100 % (3 of 3)"];
        assert_eq!((lines[0], &lines[1..]), ("3 meshes, 3 distinct: 3 to bake, 27 triangles", &tenths[..]));
    }

    #[test]
    fn unchanged_and_few_scenes_are_not_counted_aloud() {
        let mut events = vec![Event::ScanFinished { files: 150 }];
        events.extend((0..90).map(|_| Event::SceneUnchanged { path: "a.glb".into() }));
        events.extend((0..60).map(|_| written("b.glb")));
        assert_eq!(told(Verbosity::Normal, &events), "");
    }

    #[test]
    fn quiet_tells_errors_only() {
        let events = [
            Event::ScanFinished { files: 2 },
            Event::Warning { message: "odd".into(), hint: None },
            written("a.glb"),
            failed("b.glb"),
            Event::Finished { summary: Summary::default(), seconds: 1.0 },
        ];
        assert_eq!(told(Verbosity::Quiet, &events), "error: `b.glb`: no good\nhint: mend it\n");
    }

    #[test]
    fn several_failures_are_named_again_in_order() {
        let summary = Summary { files: 3, failed: 2, ..Summary::default() };
        let events = [failed("b"), failed("a"), Event::Finished { summary, seconds: 0.0 }];
        assert!(told(Verbosity::Normal, &events).ends_with("error: 2 of 3 scenes could not be baked:\n  a\n  b\n"));
    }

    #[test]
    fn a_long_list_of_failures_is_cut() {
        let paths: Vec<String> = (0..25).map(|i| format!("{i:02}.glb")).collect();
        let text = failures(&paths, 1000).expect("there are many");
        assert!(text.starts_with("25 of 1,000 scenes"), "{text}");
        assert!(text.ends_with("19.glb\n  and 5 more"), "{text}");
    }
}
