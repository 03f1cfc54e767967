//! The record as a file: `report.json` in the output folder, and its schema.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{FORMAT, Report};

/// Name of the file in the output folder.
pub const FILE_NAME: &str = "report.json";

/// A record that could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// No such file, or not readable.
    #[error("failed to read `{}`: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// From the operating system.
        source: io::Error,
    },
    /// Not a record.
    #[error("failed to read `{}`: {source}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// From the JSON parser.
        source: serde_json::Error,
    },
    /// Written by a later version.
    #[error("`{}` has format {found}, but this version of lodbake reads up to {FORMAT}", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u64,
    },
    /// The folder cannot be written to.
    #[error("failed to write `{}`: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// From the operating system.
        source: io::Error,
    },
}

impl ReportError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Read { source, .. } if source.kind() == io::ErrorKind::NotFound => {
                Some("a bake writes it into the output folder")
            }
            Self::Read { .. } | Self::Write { .. } => None,
            Self::Parse { .. } => Some("bake again: it is written anew"),
            Self::Newer { .. } => Some("use the version of lodbake that wrote it, or bake again with this one"),
        }
    }
}

/// Whether a file had to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Written {
    /// It was written.
    Changed,
    /// It already had these bytes and was not touched.
    Untouched,
}

/// The bytes of the file: two spaces of indentation, a line feed at the end.
pub fn to_json(report: &Report) -> Vec<u8> {
    let mut bytes = serde_json::to_vec_pretty(report).expect("a record holds only strings and numbers");
    bytes.push(b'\n');
    bytes
}

/// Writes `report.json` into the output folder, whole or not at all, and not if it is already there.
pub fn write(report: &Report, folder: &Path) -> Result<Written, ReportError> {
    let path = folder.join(FILE_NAME);
    let bytes = to_json(report);
    if fs::read(&path).is_ok_and(|old| old == bytes) {
        return Ok(Written::Untouched);
    }
    let write = || {
        fs::create_dir_all(folder)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".report");
        #[cfg(unix)]
        builder.permissions(readable());
        let mut file = builder.tempfile_in(folder)?;
        file.write_all(&bytes)?;
        file.persist(&path).map_err(|error| error.error)
    };
    match write() {
        Ok(_) => Ok(Written::Changed),
        Err(source) => Err(ReportError::Write { path, source }),
    }
}

/// As any new file: a temporary file is private, a record is not.
#[cfg(unix)]
fn readable() -> fs::Permissions {
    use std::os::unix::fs::PermissionsExt;
    fs::Permissions::from_mode(0o666)
}

/// Reads a record back.
pub fn read(path: &Path) -> Result<Report, ReportError> {
    let bytes = fs::read(path).map_err(|source| ReportError::Read { path: path.to_owned(), source })?;
    from_bytes(&bytes, path)
}

/// Reads a record that is in memory; `path` is named in errors.
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Report, ReportError> {
    let path_of = || path.to_owned();
    let parse = |source| ReportError::Parse { path: path_of(), source };
    let version: Version = serde_json::from_slice(bytes).map_err(parse)?;
    if version.format > u64::from(FORMAT) {
        return Err(ReportError::Newer { path: path_of(), found: version.format });
    }
    serde_json::from_slice(bytes).map_err(parse)
}

/// What every version of the record has.
#[derive(Deserialize)]
struct Version {
    format: u64,
}

/// The JSON schema of the file.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Report).to_value()
}
