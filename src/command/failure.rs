//! An error on its way to a person: what it says, the way out, the exit code. The one place that knows every area's
//! error type.

use crate::appearance::render::RenderError;
use crate::config::ConfigError;
use crate::emit::EmitError;
use crate::evaluation::SubjectError;
use crate::gltf::error::{DocumentError, ReadError};
use crate::progress::Paint;
use crate::report::ReportError;

use super::Exit;

/// Standard output was closed by its reader (`lodbake … | head`): the end of the work, and not an error.
#[derive(Debug, thiserror::Error)]
#[error("standard output is closed")]
pub struct OutputClosed;

/// The user asked for something that cannot be: [`Exit::Usage`].
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct UsageError {
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
}

/// What a person is told about an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The error and its causes, on one line.
    pub message: String,
    /// The way out, if one is known.
    pub hint: Option<String>,
    /// What the shell is told; [`Exit::Fine`] if there is nothing to tell.
    pub exit: Exit,
}

impl Failure {
    /// Looks through an error and its causes.
    pub fn of(error: &anyhow::Error) -> Self {
        Self { message: message(error), hint: hint(error), exit: exit(error) }
    }

    /// As printed: `error: …`, and the hint on a line of its own.
    pub fn lines(&self, paint: Paint) -> String {
        paint.error_lines(&self.message, self.hint.as_deref())
    }
}

/// A cause that the error above it already tells is not repeated.
fn message(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let told = cause.to_string();
        if text.is_empty() {
            text = told;
        } else if !text.contains(&told) {
            text = format!("{text}: {told}");
        }
    }
    text
}

/// The way out that the first cause with one offers.
fn hint(error: &anyhow::Error) -> Option<String> {
    error.chain().find_map(|cause| {
        let owned = |hint: Option<&str>| hint.map(str::to_owned);
        if let Some(error) = cause.downcast_ref::<UsageError>() {
            error.hint.clone()
        } else if let Some(error) = cause.downcast_ref::<ConfigError>() {
            error.hint()
        } else if let Some(error) = cause.downcast_ref::<ReadError>() {
            owned(error.hint())
        } else if let Some(error) = cause.downcast_ref::<DocumentError>() {
            owned(error.hint())
        } else if let Some(error) = cause.downcast_ref::<SubjectError>() {
            owned(error.hint())
        } else if let Some(error) = cause.downcast_ref::<EmitError>() {
            owned(error.hint())
        } else if let Some(error) = cause.downcast_ref::<RenderError>() {
            owned(error.hint())
        } else {
            owned(cause.downcast_ref::<ReportError>()?.hint())
        }
    })
}

fn exit(error: &anyhow::Error) -> Exit {
    if has::<OutputClosed>(error) {
        Exit::Fine
    } else if has::<UsageError>(error) || has::<ConfigError>(error) {
        Exit::Usage
    } else {
        Exit::Undone
    }
}

/// Whether an error of that type is among the causes.
fn has<E: std::error::Error + 'static>(error: &anyhow::Error) -> bool {
    error.chain().any(<dyn std::error::Error + 'static>::is::<E>)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_told_once() {
        let inner = anyhow::anyhow!("permission denied");
        let error = inner.context("failed to write `a`: permission denied").context("failed to bake");
        assert_eq!(Failure::of(&error).message, "failed to bake: failed to write `a`: permission denied");
    }

    #[test]
    fn usage_errors_have_their_own_exit_code() {
        let usage = anyhow::Error::new(UsageError { message: "no".into(), hint: Some("yes".into()) }).context("in `x`");
        let failure = Failure::of(&usage);
        assert_eq!((failure.exit, failure.lines(Paint::OFF).as_str()), (Exit::Usage, "error: in `x`: no\nhint: yes"));
        assert_eq!(Failure::of(&anyhow::anyhow!("no")).exit, Exit::Undone);
        assert_eq!(Failure::of(&anyhow::Error::new(OutputClosed)).exit, Exit::Fine);
    }

    #[test]
    fn the_hint_of_a_cause_is_offered() {
        let pipeline = crate::config::Pipeline::load(std::path::Path::new("no such file.toml"));
        let failure = Failure::of(&anyhow::Error::new(pipeline.expect_err("there is none")).context("failed to bake"));
        assert_eq!(failure.exit, Exit::Usage);
        assert!(failure.hint.expect("it names the first step").contains("lodbake init"));
    }
}
