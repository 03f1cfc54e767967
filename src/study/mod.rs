//! The evaluation as a tool: meshes × algorithms × targets, measured again and again and compared by tests.
//!
//! `file` and `resolve` make a [`Study`] of `study.toml`; [`run()`] does it: `own` and `process` run its algorithms, in
//! this process and as commands, `evaluate` judges their levels. The [`Record`] is all that is known afterwards;
//! `statistics` and `contrast` sum it up, `sections` puts it into words, which `markdown` and `html` write down. Knows
//! nothing of arguments and terminals.

mod contrast;
mod csv_file;
mod evaluate;
mod file;
pub mod heap;
mod html;
mod machine;
mod markdown;
mod own;
pub mod process;
pub mod record;
mod resolve;
mod run;
mod sections;
pub mod statistics;
mod template;
#[cfg(test)]
mod tests;
mod words;

use std::path::PathBuf;

pub use file::schema;
pub use record::Record;
pub use resolve::{Algorithm, Kind, MeshFile, Study, Target};
pub use run::{Step, StudyError, level, run};

/// The JSON schema of a [`Record`].
pub fn record_schema() -> serde_json::Value {
    schemars::schema_for!(Record).to_value()
}

impl Record {
    /// Writes `study.csv`, `study.md` and `study.html` into a folder; answers with their paths.
    pub fn write(&self, folder: &std::path::Path) -> Result<[PathBuf; 3], StudyError> {
        let write = |name: &str, text: String| {
            let path = folder.join(name);
            let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, text));
            written.map(|()| path.clone()).map_err(|source| StudyError::Write { path, source })
        };
        Ok([
            write("study.csv", csv_file::csv(self))?,
            write("study.md", markdown::markdown(self))?,
            write("study.html", html::page(self))?,
        ])
    }

    /// The section that sums a study up, as Markdown; empty if there is nothing to compare.
    pub fn summary(&self) -> String {
        markdown::summary(self)
    }
}
