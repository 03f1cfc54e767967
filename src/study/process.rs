//! One run of a command: what it took, and how it ended.
//!
//! [`run`] belongs into a process that does nothing else: the kernel adds up the children of a process, and on Linux a
//! child's largest resident set is at least that of the process which started it. `lodbake measured` is that process,
//! and [`run_apart`] asks it.

use std::ffi::{OsStr, OsString};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use wait_timeout::ChildExt;

/// The name of the hidden command that runs a program.
pub const MEASURED: &str = "measured";

/// The name of the hidden command that makes one level.
pub const LEVEL: &str = "study-level";

/// Bytes of a failing command's words that are kept, from the end.
const KEPT_WORDS: u64 = 4000;

/// What a run took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// From the start to the end.
    pub wall_seconds: f64,
    /// User and system time of the program and of its children; `None` where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Largest resident set of one process; `None` where the system does not tell.
    pub peak_bytes: Option<u64>,
    /// How it ended.
    pub end: End,
    /// The end of what it wrote to standard output and standard error.
    pub words: String,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum End {
    /// With this exit code.
    Exit(i32),
    /// By a signal.
    Killed,
    /// By the clock.
    TimedOut,
}

/// A run that could not even begin, or not be watched.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// There is no such program, or it may not be run.
    #[error("failed to start `{program}`: {source}")]
    Start {
        /// As written.
        program: String,
        /// From the operating system.
        source: std::io::Error,
    },
    /// Something between this process and the program failed.
    #[error("failed to measure `{program}`: {cause}")]
    Watch {
        /// As written.
        program: String,
        /// In words.
        cause: String,
    },
}

/// Runs `words` in `folder` and waits for it, for `timeout` at most; then it is killed (itself, not its children).
pub fn run(words: &[OsString], folder: &Path, timeout: Duration) -> Result<Run, RunError> {
    let (program, arguments) = words.split_first().map_or((OsStr::new(""), words), |(p, rest)| (p.as_os_str(), rest));
    let named = program.to_string_lossy().into_owned();
    let watch = |error: std::io::Error| RunError::Watch { program: named.clone(), cause: error.to_string() };
    // A file takes any number of words without a reader that would cost time.
    let mut told = tempfile::tempfile().map_err(watch)?;
    let (out, err) = (told.try_clone().map_err(watch)?, told.try_clone().map_err(watch)?);
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(out).stderr(err);
    let before = usage_of_children();
    let began = Instant::now();
    let mut child = command.spawn().map_err(|source| RunError::Start { program: named.clone(), source })?;
    let status = child.wait_timeout(timeout).map_err(watch)?;
    let end = if let Some(status) = status {
        status.code().map_or(End::Killed, End::Exit)
    } else {
        child.kill().and_then(|()| child.wait()).map_err(watch)?;
        End::TimedOut
    };
    let wall_seconds = began.elapsed().as_secs_f64();
    let after = usage_of_children();
    let cpu_seconds = before.zip(after).map(|(before, after)| after.cpu_seconds - before.cpu_seconds);
    let words = tail(&mut told).map_err(watch)?;
    Ok(Run { wall_seconds, cpu_seconds, peak_bytes: after.map(|usage| usage.peak_bytes), end, words })
}

fn tail(file: &mut std::fs::File) -> std::io::Result<String> {
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(KEPT_WORDS)))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
}

/// As [`run`], in a process of its own. `folder` must be absolute.
pub fn run_apart(words: &[OsString], folder: &Path, timeout: Duration) -> Result<Run, RunError> {
    let program = words.first().map_or_else(String::new, |word| word.to_string_lossy().into_owned());
    let watch = |cause: String| RunError::Watch { program: program.clone(), cause };
    let own = std::env::current_exe().map_err(|error| watch(error.to_string()))?;
    let mut command = Command::new(own);
    command.arg(MEASURED).arg("--timeout").arg(timeout.as_secs_f64().to_string());
    command.arg("--folder").arg(folder).arg("--").args(words).stdin(Stdio::null());
    let output = command.output().map_err(|error| watch(error.to_string()))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let said = said.trim().trim_start_matches("error: ").to_owned();
        return Err(watch(if said.is_empty() { output.status.to_string() } else { said }));
    }
    serde_json::from_slice(&output.stdout).map_err(|error| watch(error.to_string()))
}

/// What the kernel has counted.
#[derive(Clone, Copy, Debug)]
struct Usage {
    cpu_seconds: f64,
    peak_bytes: u64,
}

/// User and system time of this process, all threads; `None` where the system does not tell.
pub fn own_cpu_seconds() -> Option<f64> {
    usage_of_self().map(|usage| usage.cpu_seconds)
}

#[cfg(unix)]
mod kernel {
    use super::Usage;
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;

    /// Of `ru_maxrss`: kibibytes, but on Apple's systems bytes.
    const UNIT: u64 = if cfg!(target_vendor = "apple") { 1 } else { 1024 };

    fn usage(who: UsageWho) -> Option<Usage> {
        let usage = getrusage(who).ok()?;
        let microseconds = usage.user_time().num_microseconds() + usage.system_time().num_microseconds();
        Some(Usage { cpu_seconds: microseconds as f64 / 1e6, peak_bytes: usage.max_rss() as u64 * UNIT })
    }

    pub(super) fn usage_of_self() -> Option<Usage> {
        usage(UsageWho::RUSAGE_SELF)
    }

    /// Those that have ended and were waited for.
    pub(super) fn usage_of_children() -> Option<Usage> {
        usage(UsageWho::RUSAGE_CHILDREN)
    }
}

#[cfg(not(unix))]
mod kernel {
    use super::Usage;

    pub(super) fn usage_of_self() -> Option<Usage> {
        None
    }

    pub(super) fn usage_of_children() -> Option<Usage> {
        None
    }
}

use kernel::{usage_of_children, usage_of_self};

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn words(line: &[&str]) -> Vec<OsString> {
        line.iter().map(OsString::from).collect()
    }

    fn here(line: &[&str], seconds: f64) -> Result<Run, RunError> {
        run(&words(line), Path::new("."), Duration::from_secs_f64(seconds))
    }

    #[test]
    fn a_run_tells_what_it_took() {
        let run = here(&["sh", "-c", "i=0; while [ $i -lt 20000 ]; do i=$((i+1)); done; echo done"], 60.0).unwrap();
        assert_eq!((run.end, run.words.as_str()), (End::Exit(0), "done"));
        assert!(0.0 < run.wall_seconds && 0.0 < run.cpu_seconds.unwrap(), "{:?}", run.cpu_seconds);
        assert!(100_000 < run.peak_bytes.unwrap(), "{:?}", run.peak_bytes);
    }

    #[test]
    fn failures_keep_their_words() {
        let run = here(&["sh", "-c", "echo out; echo err >&2; exit 7"], 60.0).unwrap();
        assert_eq!((run.end, run.words.as_str()), (End::Exit(7), "out\nerr"));
        assert_eq!(here(&["sh", "-c", "kill -9 $$"], 60.0).unwrap().end, End::Killed);
    }

    #[test]
    fn the_clock_ends_a_run() {
        assert_eq!(here(&["sleep", "600"], 0.05).unwrap().end, End::TimedOut);
    }

    #[test]
    fn a_missing_program_is_named() {
        let error = here(&["no such program"], 1.0).unwrap_err();
        assert!(error.to_string().starts_with("failed to start `no such program`: "), "{error}");
    }
}
