//! What happens during a bake, as events, and the writers that tell it: a terminal, plain lines, JSON lines, silence.
//!
//! Knows nothing of files or meshes beyond their names and numbers. Nothing here decides anything: a bake with
//! [`Silent`] does exactly what a bake with any other reporter does.

mod json;
mod lines;
pub mod quantity;
mod terminal;

use std::io::{self, Write};
use std::sync::Mutex;

use schemars::JsonSchema;
use serde::Serialize;

pub use json::JsonLines;
pub use lines::{Lines, Verbosity};
pub use terminal::Terminal;

/// One thing that happened. `--json` writes each as one line; `type` is the name of the case in snake case.
///
/// Paths are relative to the input folder, with `/`. Meshes are named by the first 12 hexadecimal digits of their hash.
/// The order of events of different scenes and jobs depends on the threads; within one scene or job it does not.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Event {
    /// The input folders were listed.
    ScanFinished {
        /// Scene files found.
        files: u64,
    },
    /// A scene is known and nothing about it changed: it is not opened.
    SceneUnchanged {
        /// Scene file.
        path: String,
    },
    /// A scene is about to be read.
    SceneStarted {
        /// Scene file.
        path: String,
    },
    /// A scene and its buffers were read and its meshes identified.
    SceneRead {
        /// Scene file.
        path: String,
        /// Bytes read from disk: the file and its buffers, not its images.
        bytes: u64,
        /// Sub-meshes found in the scene.
        meshes: u64,
    },
    /// A wave of scenes is read: this is its work. A large bake has several waves.
    PlanFinished {
        /// Sub-meshes found in the wave.
        found: u64,
        /// Distinct ones among them, each of them at most one job.
        distinct: u64,
        /// Jobs to look up or to run; fewer than `distinct` where a chain is already in place.
        jobs: u64,
        /// Triangles of those jobs.
        triangles: u64,
    },
    /// A level chain is being computed.
    JobStarted {
        /// Short mesh hash.
        mesh: String,
        /// Source triangles.
        triangles: u64,
    },
    /// A level chain is there.
    JobFinished {
        /// Short mesh hash.
        mesh: String,
        /// Source triangles.
        triangles: u64,
        /// It came from the cache.
        cached: bool,
    },
    /// Pictures of levels are about to be drawn and compared, so that their looks can be recorded.
    LooksStarted {
        /// Meshes whose levels are not measured yet.
        meshes: u64,
    },
    /// The looks of one mesh's levels are measured.
    LookFinished,
    /// `--dry-run` only: what would be done with a scene.
    ScenePlanned {
        /// Scene file.
        path: String,
        /// Why it would be baked.
        reason: String,
        /// Jobs it would need that are not in the cache.
        jobs: u64,
    },
    /// A scene's outputs are complete.
    SceneWritten {
        /// Scene file.
        path: String,
        /// Bytes of its outputs.
        bytes: u64,
        /// `false`: the outputs already had these bytes and were not touched.
        changed: bool,
    },
    /// A scene could not be baked; the others go on.
    SceneFailed {
        /// Scene file.
        path: String,
        /// What went wrong, with the place.
        error: String,
        /// What to do about it.
        #[serde(skip_serializing_if = "Option::is_none")]
        hint: Option<String>,
    },
    /// A file or folder that could not be taken as a scene.
    ScanFailed {
        /// What went wrong, with the path.
        error: String,
    },
    /// A scene is no longer there (or is skipped now): what was written for it is removed.
    SceneVanished {
        /// Scene file.
        path: String,
    },
    /// Something a person should know that does not stop the work.
    Warning {
        /// What is odd.
        message: String,
        /// What to do about it.
        #[serde(skip_serializing_if = "Option::is_none")]
        hint: Option<String>,
    },
    /// Everything is done.
    Finished {
        /// The figures of the whole run.
        summary: Summary,
        /// Wall time in seconds.
        seconds: f64,
    },
}

/// The figures of a whole run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Summary {
    /// Nothing was written: `--dry-run`.
    pub dry_run: bool,
    /// Scene files found.
    pub files: u64,
    /// Scenes baked (or that would be, in a dry run).
    pub baked: u64,
    /// Scenes in which nothing changed.
    pub unchanged: u64,
    /// Files copied as they are, since they hold nothing to bake.
    pub copied: u64,
    /// Scenes that could not be baked.
    pub failed: u64,
    /// Files left out by a setting.
    pub skipped: u64,
    /// Sub-meshes found in all scenes, unchanged ones included.
    pub meshes_found: u64,
    /// Distinct ones among them.
    pub meshes_distinct: u64,
    /// Level chains computed.
    pub jobs: u64,
    /// Level chains taken from the cache.
    pub cache_hits: u64,
    /// Bytes read from scene files and their buffers; 0 when nothing changed.
    pub scene_bytes_read: u64,
    /// Outputs written; outputs that already had their bytes are not counted.
    pub outputs_written: u64,
    /// Warnings told.
    pub warnings: u64,
    /// Milliseconds of the run's wall time in which the looks of levels were measured for the record; the pictures that
    /// decide levels (`metric = "auto"`, `effort = "best"`, targets by looks) are part of the jobs.
    pub looks_milliseconds: u64,
}

/// Takes events, from any thread.
pub trait Reporter: Sync + Send {
    /// Told when it happens. Must be quick: the work waits for it.
    fn event(&self, event: &Event);
}

/// The JSON schema of one line of `--json`.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Event).to_value()
}

/// Tells nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Reporter for Silent {
    fn event(&self, _: &Event) {}
}

/// Where a writer's text goes: standard output or error, or a test's buffer. A closed pipe is not an error.
pub(crate) type Sink = Mutex<Box<dyn Write + Send>>;

/// Writes one line at once, so that lines of several threads never mix. Failure to write is no reason to stop a bake.
pub(crate) fn write_line(sink: &Sink, line: &str) {
    let mut sink = sink.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let written: io::Result<()> = sink.write_all(format!("{line}\n").as_bytes()).and_then(|()| sink.flush());
    drop(written);
}

/// Colour for the few words that carry it; everything reads the same without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paint {
    /// Write the escape codes.
    pub on: bool,
}

impl Paint {
    /// No colour.
    pub const OFF: Self = Self { on: false };

    fn code(self, code: &str, text: &str) -> String {
        if self.on { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }

    /// For `error:`.
    pub fn error(self, text: &str) -> String {
        self.code("1;31", text)
    }

    /// For `warning:`.
    pub fn warning(self, text: &str) -> String {
        self.code("1;33", text)
    }

    /// For `hint:`.
    pub fn hint(self, text: &str) -> String {
        self.code("1;36", text)
    }

    /// For titles and the figures that matter.
    pub fn strong(self, text: &str) -> String {
        self.code("1", text)
    }

    /// For what can be skipped.
    pub fn faint(self, text: &str) -> String {
        self.code("2", text)
    }

    /// `error: …`, and the hint on a line of its own.
    pub fn error_lines(self, message: &str, hint: Option<&str>) -> String {
        self.told(&self.error("error:"), message, hint)
    }

    /// `warning: …`, and the hint on a line of its own.
    pub fn warning_lines(self, message: &str, hint: Option<&str>) -> String {
        self.told(&self.warning("warning:"), message, hint)
    }

    fn told(self, word: &str, message: &str, hint: Option<&str>) -> String {
        match hint {
            Some(hint) => format!("{word} {message}\n{} {hint}", self.hint("hint:")),
            None => format!("{word} {message}"),
        }
    }
}

/// The message of a failed scene: names the file once, whether or not the error already does.
pub(crate) fn failure_message(path: &str, error: &str) -> String {
    if error.contains(path) { error.to_owned() } else { format!("`{path}`: {error}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_tagged_with_its_type() {
        let event = Event::JobFinished { mesh: "00ff".into(), triangles: 12, cached: true };
        assert_eq!(
            serde_json::to_string(&event).expect("events are plain data"),
            r#"{"type":"job_finished","mesh":"00ff","triangles":12,"cached":true}"#
        );
    }

    #[test]
    fn a_failure_names_its_file_once() {
        assert_eq!(failure_message("a.glb", "failed to read `in/a.glb`: short"), "failed to read `in/a.glb`: short");
        assert_eq!(failure_message("a.glb", "short"), "`a.glb`: short");
    }

    #[test]
    fn paint_off_adds_nothing() {
        assert_eq!(Paint::OFF.error_lines("no", Some("yes")), "error: no\nhint: yes");
        assert_eq!(Paint { on: true }.warning_lines("no", None), "\x1b[1;33mwarning:\x1b[0m no");
    }
}
