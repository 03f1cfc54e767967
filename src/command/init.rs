//! `lodbake init`: writes a commented pipeline, the one that bakes lodbake's own sample scenes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context as _;

use super::failure::UsageError;
use super::{Context, Exit};
use crate::config::Pipeline;

/// The documented example.
const EXAMPLE: &str = include_str!("../../pipeline.toml");

/// Lines of the example that are replaced.
const INPUT: &str = "input = \"scenes\"";
const OUTPUT: &str = "output = \"out\"";

/// Where the part begins that only suits the samples.
const SAMPLES_ONLY: &str = "[[override]]";

/// Write a commented pipeline to start from
#[derive(Clone, Debug, clap::Args)]
pub struct Init {
    /// The file to write
    #[arg(value_name = "PIPELINE", default_value = "pipeline.toml")]
    file: PathBuf,
    /// The folder with the scenes
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    input: String,
    /// The folder for the baked scenes
    #[arg(long, value_name = "DIR", default_value = "out")]
    output: String,
    /// Replace a file that is there
    #[arg(long)]
    force: bool,
}

impl Init {
    /// Writes the file.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let shown = self.file.display();
        let text = self.text();
        // A file that this command wrote must be one that `bake` takes.
        Pipeline::parse(&text, &shown.to_string()).with_context(|| format!("failed to write `{shown}`"))?;
        if let Some(folder) = self.file.parent() {
            fs::create_dir_all(folder).with_context(|| format!("failed to write `{shown}`"))?;
        }
        match self.open().and_then(|mut file| file.write_all(text.as_bytes())) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                let hint = Some("`--force` replaces it".to_owned());
                return Err(UsageError { message: format!("`{shown}` is there already"), hint }.into());
            }
            written => written.with_context(|| format!("failed to write `{shown}`"))?,
        }
        context.tell(&format!("wrote `{shown}`; bake it with `lodbake {shown}`"));
        Ok(Exit::Fine)
    }

    /// Of two that run at the same time only one makes the file.
    fn open(&self) -> io::Result<File> {
        let mut options = File::options();
        options.write(true);
        if self.force {
            options.create(true).truncate(true)
        } else {
            options.create_new(true)
        };
        options.open(&self.file)
    }

    fn text(&self) -> String {
        let quoted = |path: &str| toml::Value::from(path).to_string();
        let text = EXAMPLE.replacen(INPUT, &format!("input = {}", quoted(&self.input)), 1).replacen(
            OUTPUT,
            &format!("output = {}", quoted(&self.output)),
            1,
        );
        // The override names a folder of the samples: elsewhere it is shown as a comment.
        let (start, samples) = text.split_at(text.find(SAMPLES_ONLY).unwrap_or(text.len()));
        let samples: Vec<String> = samples.lines().map(|line| format!("#{line}\n")).collect();
        format!("{start}{}", samples.concat())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{defaults, schema};

    fn parse(text: &str) -> Pipeline {
        Pipeline::parse(text, "pipeline.toml").unwrap()
    }

    fn init(input: &str) -> Init {
        Init { file: "pipeline.toml".into(), input: input.to_owned(), output: "o".to_owned(), force: false }
    }

    /// The example with every `#key = value` line made a setting.
    fn spelled() -> String {
        let is_setting = |line: &str| line.starts_with(|c: char| c.is_ascii_lowercase()) && line.contains(" = ");
        let line =
            |line: &str| line.strip_prefix('#').filter(|rest| is_setting(rest)).unwrap_or(line).to_owned() + "\n";
        EXAMPLE.lines().map(line).collect()
    }

    #[test]
    fn the_example_shows_the_defaults() {
        let [short, example, spelled] = ["input = 'scenes'\noutput = 'out'", EXAMPLE, &spelled()].map(parse);
        assert_eq!(example.settings(), short.settings());
        assert_eq!(spelled.settings(), short.settings());
        assert_eq!((&spelled.cache, spelled.jobs), (&short.cache, short.jobs));
        assert_eq!((spelled.ignore_files, spelled.follow_links), (short.ignore_files, short.follow_links));
        assert_eq!(spelled.include.patterns(), defaults::INCLUDE);
        assert_eq!(example.settings_for("props/vase.glb").simplify.weights.normal, 0.01);
    }

    #[test]
    fn the_example_names_every_key() {
        let schema = schema();
        let tables = ["", "/$defs/ScreenTable", "/$defs/SimplifyTable", "/$defs/LodEntry", "/$defs/OverrideEntry"];
        for table in tables {
            for key in schema.pointer(table).unwrap()["properties"].as_object().unwrap().keys() {
                assert!(EXAMPLE.contains(key.as_str()), "`{key}` is not in pipeline.toml");
            }
        }
    }

    #[test]
    fn the_example_is_valid_by_its_schema() {
        let validator = jsonschema::validator_for(&schema()).unwrap();
        let valid = |text: &str| {
            let value: toml::Table = text.parse().unwrap();
            validator.is_valid(&serde_json::to_value(value).unwrap())
        };
        assert!(valid(EXAMPLE) && valid(&spelled()) && valid(&init("in").text()));
        for broken in ["[screen]\nfov = 180", "[simplify]\nmetric = 'x'", "[[lod]]\nratio = 0.5\nerror = 1", "x = 1"] {
            assert!(!valid(&format!("input = 'a'\noutput = 'b'\n{broken}")), "{broken}");
        }
        assert!(!valid("output = 'b'"));
    }

    #[test]
    fn folders_are_filled_in() {
        let text = init(r#"art\"new""#).text();
        let pipeline = parse(&text);
        assert_eq!(pipeline.inputs[0].written, r#"art\"new""#);
        assert_eq!(pipeline.output.written, "o");
        assert_eq!(pipeline.settings_for("props/vase.glb"), pipeline.settings(), "the override is a comment");
        assert!(text.contains("\n#[[override]]\n#match = "), "{text}");
    }
}
