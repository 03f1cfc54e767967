//! `lodbake reproduce MODEL`: the instanced-model paper's tables 2 and 3, beside the printed figures.

use std::fs;
use std::path::PathBuf;

use anyhow::Context as _;

use super::{Context, Exit};
use crate::reproduction::{Options, paper, run, table};

/// Make the instanced-model paper's tables again: methods on one model with many instances
#[derive(Clone, Debug, clap::Args)]
pub struct Reproduce {
    /// The model, one mesh of triangles: the paper's bunny has 2503 vertices and 4968 faces
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Instances of the model
    #[arg(long, value_name = "N", default_value_t = paper::INSTANCES, value_parser = at_least_one)]
    instances: usize,
    /// Instances of a second scene, which shows what grows with their number
    #[arg(long, value_name = "N", default_value_t = 1000 * paper::INSTANCES, value_parser = at_least_one)]
    many: usize,
    /// Timed runs of each method
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    repetitions: usize,
    /// Folder for the scenes and tables
    #[arg(long, short, value_name = "DIR", default_value = "reproduction")]
    output: PathBuf,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("must be 1 or more".to_owned()),
        Ok(number) => Ok(number),
    }
}

impl Reproduce {
    /// Prints the tables, or one JSON document; both tables and all scenes are left in the folder.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let options = Options {
            instances: self.instances,
            many: self.many,
            repetitions: self.repetitions,
            folder: self.output.clone(),
        };
        let record = run(&self.model, &options, |text| context.tell(text))?;
        let text = table::markdown(&record);
        for (name, text) in [("tables.md", &text), ("tables.csv", &table::csv(&record))] {
            let path = self.output.join(name);
            fs::write(&path, text).with_context(|| format!("failed to write `{}`", path.display()))?;
        }
        if context.json {
            context.print(&format!("{}\n", serde_json::to_string_pretty(&record)?))?;
        } else {
            context.print(&text)?;
        }
        Ok(Exit::Fine)
    }
}
