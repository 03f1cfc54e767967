//! Why a scene could not be written, and what to do about it.

use std::io;
use std::path::{Path, PathBuf};

/// A scene that was not written. What was in the output folder before is still there.
#[derive(Debug, thiserror::Error)]
pub enum EmitError {
    /// The operating system refused.
    #[error("failed to {action} `{path}`: {}", words(.source))]
    Io {
        /// `write`, `copy`, `create the folder`, …
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The output would be the input.
    #[error("the output of `{path}` would overwrite it")]
    OverSource {
        /// The scene.
        path: PathBuf,
    },
    /// Something that is no file has the name of the output.
    #[error("failed to write `{path}`: it is {what}")]
    InTheWay {
        /// The output.
        path: PathBuf,
        /// With its article: `a folder`.
        what: &'static str,
    },
    /// Two scenes want to be the same file.
    #[error("`{first}` and `{second}` would both write `{target}`")]
    Taken {
        /// The file.
        target: PathBuf,
        /// One scene.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A file that the scene refers to would be copied out of the output folder.
    #[error("`{uri}` would be copied to `{target}`, outside the output folder `{root}`")]
    Outside {
        /// As written in the document.
        uri: String,
        /// Where it would go.
        target: PathBuf,
        /// The output folder.
        root: PathBuf,
    },
}

impl EmitError {
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    /// What a user can do about it, where that is known.
    pub fn hint(&self) -> Option<&'static str> {
        use io::ErrorKind::{
            AlreadyExists, NotADirectory, PermissionDenied, QuotaExceeded, ReadOnlyFilesystem, StorageFull,
        };
        match self {
            Self::Io { source, .. } => match source.kind() {
                StorageFull | QuotaExceeded => Some("make room on the disk of the output folder and run again"),
                PermissionDenied => Some("check the permissions of the output folder"),
                ReadOnlyFilesystem => Some("choose an output folder that can be written to"),
                NotADirectory | AlreadyExists => Some("a file has the name of a folder that is needed; move it away"),
                _ => None,
            },
            Self::OverSource { .. } => Some("choose an output folder outside the input folder"),
            Self::InTheWay { .. } => Some("move it away, or choose another output folder"),
            Self::Taken { .. } => Some("give one of the scenes another name, or exclude it"),
            Self::Outside { .. } => {
                Some("let `input` be a folder above the scene and the file, or write `.glb`, which holds its files")
            }
        }
    }
}

/// Without the number that the standard library appends.
fn words(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::StorageFull => "the disk is full".to_owned(),
        io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        io::ErrorKind::NotFound => "there is no such file or folder".to_owned(),
        _ => error.to_string(),
    }
}
