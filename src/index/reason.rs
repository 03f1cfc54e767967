//! Why a scene has to be baked again, for `explain`.

use std::fmt;

use serde::Serialize;

use crate::key::Change;

/// One reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "reason", content = "what", rename_all = "snake_case")]
pub enum Reason {
    /// The content of the scene file.
    Scene,
    /// The content of a file that the scene refers to, by its path from the scene.
    DependencyChanged(String),
    /// A file that the scene refers to is not there any more.
    DependencyGone(String),
    /// A file that the scene refers to, and that was not there, is.
    DependencyAppeared(String),
    /// A setting, or a version of lodbake.
    Settings(Change),
    /// An output was removed, by its path in the output folder.
    OutputMissing(String),
    /// An output is not as it was written.
    OutputChanged(String),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene => f.write_str("the scene file has changed"),
            Self::DependencyChanged(path) => write!(f, "`{path}` has changed"),
            Self::DependencyGone(path) => write!(f, "`{path}` is gone"),
            Self::DependencyAppeared(path) => write!(f, "`{path}` was missing and is there now"),
            Self::Settings(change) => change.fmt(f),
            Self::OutputMissing(path) => write!(f, "output `{path}` is missing"),
            Self::OutputChanged(path) => write!(f, "output `{path}` is not as it was written"),
        }
    }
}
