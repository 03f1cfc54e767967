//! What can be wrong with a `pipeline.toml`: each error names the file, the line and what would be right.

use std::fmt;

/// A key inside the document: `lod[1].ratio`.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Place(Vec<Step>);

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Key(String),
    Index(usize),
}

impl Place {
    pub(crate) fn key(&self, key: &str) -> Self {
        self.with(Step::Key(key.to_owned()))
    }

    pub(crate) fn index(&self, index: usize) -> Self {
        self.with(Step::Index(index))
    }

    fn with(&self, step: Step) -> Self {
        let mut steps = self.0.clone();
        steps.push(step);
        Self(steps)
    }

    pub(super) fn steps(&self) -> &[Step] {
        &self.0
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) if i == 0 => f.write_str(key)?,
                Step::Key(key) => write!(f, ".{key}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// The names that would be right, and the one that looks most like what was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// `None` if no name looks like it at all.
    pub nearest: Option<String>,
    /// All of them.
    pub known: Vec<String>,
}

impl Names {
    pub(crate) fn near(written: &str, known: Vec<String>) -> Self {
        let nearest = known
            .iter()
            .map(|name| (strsim::normalized_damerau_levenshtein(written, name), name))
            .filter(|(likeness, _)| *likeness >= 0.5)
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, name)| name.clone());
        Self { nearest, known }
    }
}

impl fmt::Display for Names {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(nearest) = &self.nearest {
            write!(f, "did you mean `{nearest}`? ")?;
        }
        f.write_str("known:")?;
        for (i, name) in self.known.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            write!(f, "{comma} `{name}`")?;
        }
        Ok(())
    }
}

/// A `pipeline.toml` that cannot be used. Exit code 2. `file` is the path as the user wrote it.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be opened or is not UTF-8.
    #[error("failed to read `{file}`: {source}")]
    Read {
        /// As the user wrote it.
        file: String,
        /// From the operating system.
        source: std::io::Error,
    },

    /// Not TOML.
    #[error("`{file}` line {line}: {cause}")]
    Syntax {
        /// As the user wrote it.
        file: String,
        /// From 1.
        line: usize,
        /// In the words of the TOML parser.
        cause: String,
    },

    /// A key that does not exist.
    #[error("unknown key `{place}` in `{file}` line {line} ({names})")]
    UnknownKey {
        /// As the user wrote it.
        file: String,
        /// From 1.
        line: usize,
        /// The unknown key, with the tables it is in.
        place: Place,
        /// All keys of that table.
        names: Box<Names>,
        /// The table that does have a key of this name, if another has.
        belongs_to: Option<String>,
    },

    /// A name that is not in the closed list of its key.
    #[error("unknown {place} `{value}` in `{file}` line {line} ({names})")]
    UnknownValue {
        /// As the user wrote it.
        file: String,
        /// From 1.
        line: usize,
        /// The key.
        place: Place,
        /// As written.
        value: String,
        /// All values of that key.
        names: Box<Names>,
    },

    /// A required key is absent.
    #[error("missing key `{place}` in `{file}` line {line}")]
    Missing {
        /// As the user wrote it.
        file: String,
        /// From 1: the table that lacks it.
        line: usize,
        /// The absent key.
        place: Place,
    },

    /// A value of the right kind that is too small or too large.
    #[error("`{file}` line {line}: {place} {value} is out of range: must be {range}")]
    OutOfRange {
        /// As the user wrote it.
        file: String,
        /// From 1.
        line: usize,
        /// The key.
        place: Place,
        /// As written.
        value: String,
        /// In words.
        range: String,
    },

    /// A value that makes no sense, alone or beside another.
    #[error("`{file}` line {line}: {place} {cause}")]
    Invalid {
        /// As the user wrote it.
        file: String,
        /// From 1.
        line: usize,
        /// The key.
        place: Place,
        /// What is wrong and what would be right.
        cause: String,
    },
}

impl ConfigError {
    /// A way out, for the line after the error.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Some("`lodbake init` writes a commented `pipeline.toml`".to_owned())
            }
            Self::UnknownKey { place, belongs_to: Some(table), .. } => {
                let key = place.to_string();
                let key = key.rsplit('.').next().unwrap_or_default();
                Some(match table.as_str() {
                    "" => format!("`{key}` stands at the top of the file, before the first `[table]`"),
                    table => format!("`{key}` is a key of `[{table}]`"),
                })
            }
            _ => None,
        }
    }
}
