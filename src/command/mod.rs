//! The commands, one file each: they join the stages and are the only ones, with `progress` and `cli`, that print.
//!
//! A command is a struct of its own arguments ([`clap::Args`], so that its help stands beside its code) with
//! `run(&self, &Context) -> anyhow::Result<Exit>`. It knows nothing of other commands' arguments.

pub mod bake;
pub mod cache;
pub mod check;
pub mod completions;
pub mod diff;
pub mod evaluate;
pub mod explain;
pub mod failure;
pub mod init;
pub mod inspect;
mod recorded;
pub mod report;
pub mod reproduce;
pub mod schema;
pub mod study;

use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::PathBuf;

use crate::progress::{Paint, Reporter, Silent};
use failure::{Failure, OutputClosed};

/// Exit codes, a promise to scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Exit {
    /// Everything asked for is done.
    Fine = 0,
    /// A budget is exceeded, or a regression was found.
    OverBudget = 1,
    /// Wrong usage or configuration; nothing was done.
    Usage = 2,
    /// Some work could not be done; the rest is.
    Undone = 3,
}

/// The options that every command takes, settled.
pub struct Context {
    /// Threads; `None` leaves it to the machine.
    pub jobs: Option<NonZeroUsize>,
    /// Where results are kept.
    pub cache: CacheChoice,
    /// Data as JSON.
    pub json: bool,
    /// Nothing but data and errors.
    pub quiet: bool,
    /// Tell more.
    pub verbose: bool,
    /// Colour of the text on standard output.
    pub paint: Paint,
    /// Colour of the text on standard error.
    pub paint_told: Paint,
    /// Takes the events of long work.
    pub reporter: Box<dyn Reporter>,
}

/// What the command line and the environment say about the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CacheChoice {
    /// As the pipeline says.
    Pipeline,
    /// This folder (`--cache`, else the environment variable `LODBAKE_CACHE`).
    Folder(PathBuf),
    /// None (`--no-cache`).
    Off,
}

impl Context {
    /// Data, to standard output.
    pub fn print(&self, text: &str) -> anyhow::Result<()> {
        let mut out = io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Err(OutputClosed.into()),
            written => written.map_err(|error| anyhow::Error::new(error).context("failed to write the output")),
        }
    }

    /// The same for work before a command's own: it tells nothing.
    pub fn silent(&self) -> Self {
        let (cache, reporter) = (self.cache.clone(), Box::new(Silent));
        Self {
            jobs: self.jobs,
            cache,
            json: false,
            quiet: true,
            verbose: false,
            paint: self.paint,
            paint_told: self.paint_told,
            reporter,
        }
    }

    /// An error that does not end the command, to standard error.
    pub fn error(&self, error: &anyhow::Error) {
        let written = writeln!(io::stderr().lock(), "{}", Failure::of(error).lines(self.paint_told));
        drop(written); // nobody listens: no reason to stop
    }

    /// Words for a person, to standard error; nothing with `--quiet` and `--json`.
    pub fn tell(&self, text: &str) {
        if !self.quiet && !self.json {
            let written = writeln!(io::stderr().lock(), "{text}");
            drop(written); // nobody listens: no reason to stop
        }
    }
}
