//! What can be wrong with a scene, and where. Prints nothing.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A fault at one place of a document: `meshes[2].primitives[0]: index 812 is out of range (640 vertices)`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{problem}", Self::prefix(place))]
pub struct DocumentError {
    /// JSON place, such as `meshes[2].primitives[0]`; empty for the file as a whole.
    pub place: String,
    /// What is wrong there.
    pub problem: Problem,
}

/// Kinds of faults.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// The text is not JSON, or is nested too deeply.
    #[error("invalid JSON at line {line} column {column}: {message}")]
    Json {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// In the parser's words.
        message: String,
    },
    /// The binary container is damaged.
    #[error("damaged GLB: {0}")]
    Glb(String),
    /// The file is in a version of glTF that is not 2.0.
    #[error("glTF version `{0}` is not supported (known: 2.0)")]
    Version(String),
    /// A required property is absent.
    #[error("`{0}` is missing")]
    Missing(&'static str),
    /// A value has another JSON type than the specification gives it.
    #[error("expected {expected}, found {found}")]
    Type {
        /// With its article: `an array`.
        expected: &'static str,
        /// With its article: `a string`.
        found: &'static str,
    },
    /// A reference points to nothing.
    #[error("{kind} {index} does not exist (there are {count})")]
    Unresolved {
        /// `mesh`, `accessor`, …
        kind: &'static str,
        /// The reference.
        index: u64,
        /// Length of the array it points into.
        count: usize,
    },
    /// A range of bytes or elements leaves what holds it.
    #[error("{what} needs {needed} bytes, but {holder} has {available}")]
    Short {
        /// What asks.
        what: String,
        /// What holds.
        holder: String,
        /// Bytes asked for.
        needed: u64,
        /// Bytes there.
        available: u64,
    },
    /// A vertex index points behind the last vertex.
    #[error("index {index} is out of range ({vertices} vertices)")]
    Index {
        /// The index.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A buffer's or image's address cannot be used.
    #[error("uri `{uri}` {reason}")]
    Uri {
        /// As written, shortened if long.
        uri: String,
        /// Why not.
        reason: String,
    },
    /// A referenced file cannot be read.
    #[error("cannot read `{uri}`: {reason}")]
    File {
        /// As written in the document.
        uri: String,
        /// In the operating system's words.
        reason: String,
    },
    /// A compressed stream cannot be decoded.
    #[error("cannot decode {extension}: {reason}")]
    Decode {
        /// The glTF extension.
        extension: &'static str,
        /// In the decoder's words.
        reason: String,
    },
    /// A value that is neither a finite number nor usable otherwise.
    #[error("element {element} is not finite ({value})")]
    NotFinite {
        /// Element of the accessor.
        element: usize,
        /// `NaN`, `inf` or `-inf`.
        value: String,
    },
    /// A buffer whose bytes are needed has none.
    #[error("buffer {buffer} has neither an address nor data")]
    NoData {
        /// Index of the buffer.
        buffer: usize,
    },
    /// Any other contradiction, in words.
    #[error("{0}")]
    Invalid(String),
}

impl DocumentError {
    /// A fault at `place`.
    pub fn new(place: impl Display, problem: Problem) -> Self {
        Self { place: place.to_string(), problem }
    }

    /// A fault described in words.
    pub fn invalid(place: impl Display, words: impl Into<String>) -> Self {
        Self::new(place, Problem::Invalid(words.into()))
    }

    /// What a user can do about it, where that is known.
    pub fn hint(&self) -> Option<&'static str> {
        match &self.problem {
            Problem::Version(_) => Some("convert the file to glTF 2.0 first"),
            Problem::Glb(_) => Some("the file was probably cut short or changed in transfer; export or copy it again"),
            Problem::Json { .. } => Some("check that the file is a complete glTF document"),
            Problem::File { .. } => Some("keep the files a scene refers to beside it, under the names it uses"),
            Problem::Uri { .. } => Some("refer to files by addresses relative to the scene"),
            Problem::Short { .. } => Some("the binary data does not belong to this document, or was cut short"),
            Problem::Decode { .. } => Some("export the scene again, or without compression"),
            Problem::Index { .. } | Problem::NotFinite { .. } => Some("export the scene again, or exclude it"),
            _ => None,
        }
    }

    fn prefix(place: &str) -> String {
        if place.is_empty() { String::new() } else { format!("{place}: ") }
    }
}

/// A scene could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("failed to read `{}`: {cause}", path.display())]
pub struct ReadError {
    /// The scene's file, as given by the caller.
    pub path: PathBuf,
    /// Why.
    pub cause: ReadCause,
}

/// Why a scene could not be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadCause {
    /// The file itself could not be opened, in the operating system's words.
    #[error("{0}")]
    File(String),
    /// Its content is at fault.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// An OBJ file is at fault.
    #[error("{0}")]
    Obj(String),
}

impl ReadError {
    /// The file could not be opened.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let words = match error.kind() {
            std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
            _ => error.to_string(),
        };
        Self { path: path.to_owned(), cause: ReadCause::File(words) }
    }

    /// Its content is at fault.
    pub fn document(path: &Path, fault: DocumentError) -> Self {
        Self { path: path.to_owned(), cause: ReadCause::Document(fault) }
    }

    /// What a user can do about it, where that is known.
    pub fn hint(&self) -> Option<&'static str> {
        match &self.cause {
            ReadCause::File(_) => None,
            ReadCause::Document(fault) => fault.hint(),
            ReadCause::Obj(_) => Some("export the scene again, or as glTF"),
        }
    }
}
