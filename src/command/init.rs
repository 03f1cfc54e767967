//! `lodbake init`: writes a commented pipeline, the one that bakes lodbake's own sample scenes; and a git hook.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

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
    /// Also check the budgets before each commit: write a git hook
    #[arg(long)]
    hook: bool,
    /// Replace files that are there
    #[arg(long)]
    force: bool,
}

/// The first line of the hook after the shell's: by it the hook is known as ours.
const HOOK_MARK: &str = "# Written by `lodbake init --hook`.";

impl Init {
    /// Writes the file, and the hook if it is asked for. With `--hook`, a pipeline that is there stays as it is: `--force` is then about the hook.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        if !self.hook || !self.file.exists() {
            self.write_pipeline(context)?;
        }
        if self.hook {
            self.write_hook(context)?;
        }
        Ok(Exit::Fine)
    }

    fn write_pipeline(&self, context: &Context) -> anyhow::Result<()> {
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
        Ok(())
    }

    /// A hook of someone else is left alone: it is told what to add.
    fn write_hook(&self, context: &Context) -> anyhow::Result<()> {
        let pipeline = git(&["rev-parse", "--show-prefix"])?;
        let pipeline = format!("{pipeline}{}", self.file.display()).replace('\\', "/");
        let path = PathBuf::from(git(&["rev-parse", "--git-path", "hooks/pre-commit"])?);
        let shown = path.display();
        if let Ok(old) = fs::read_to_string(&path)
            && !old.contains(HOOK_MARK)
            && !self.force
        {
            let hint = Some(format!("add the line `lodbake check {pipeline}` to it, or replace it with `--force`"));
            return Err(UsageError { message: format!("`{shown}` is there already"), hint }.into());
        }
        let written = || {
            fs::create_dir_all(path.parent().unwrap_or(Path::new("")))?;
            fs::write(&path, hook(&pipeline))?;
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                fs::set_permissions(&path, fs::Permissions::from_mode(0o755))?;
            }
            Ok::<_, io::Error>(())
        };
        written().with_context(|| format!("failed to write `{shown}`"))?;
        context.tell(&format!("wrote `{shown}`: each commit checks the budgets of `{pipeline}`"));
        Ok(())
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
        // What names folders and limits of the samples is shown as a comment elsewhere.
        let (start, samples) = text.split_at(text.find(SAMPLES_ONLY).unwrap_or(text.len()));
        let comment = |line: &str| if line.is_empty() || line.starts_with('#') { "" } else { "#" };
        let samples: Vec<String> = samples.lines().map(|line| format!("{}{line}\n", comment(line))).collect();
        format!("{start}{}", samples.concat())
    }
}

/// A script for any shell that git has. Hooks run at the top of the repository; `pipeline` is seen from there.
fn hook(pipeline: &str) -> String {
    let quoted = format!("'{}'", pipeline.replace('\'', "'\\''"));
    format!(
        "#!/bin/sh\n{HOOK_MARK}\n# Holds scenes that are about to be committed against the budgets of a pipeline.\n\
         set -e\npipeline={quoted}\n\
         if ! git diff --cached --quiet --no-ext-diff -- \"$pipeline\"; then\n  exec lodbake check \"$pipeline\"\nfi\n\
         git diff --cached --name-only --no-ext-diff --diff-filter=ACMRT -z -- \\\n    \
         '*.glb' '*.gltf' '*.bin' '*.obj' '*.png' '*.jpg' '*.jpeg' '*.webp' '*.ktx2' |\n  \
         xargs -0 -r lodbake check \"$pipeline\" --\n"
    )
}

/// One line that git says about the repository that the pipeline is in.
fn git(words: &[&str]) -> anyhow::Result<String> {
    let run = Command::new("git").args(words).output().context("failed to run `git`")?;
    if !run.status.success() {
        let message = "this folder is in no git repository".to_owned();
        return Err(UsageError { message, hint: Some("`git init` makes one".to_owned()) }.into());
    }
    Ok(String::from_utf8_lossy(&run.stdout).trim_end_matches(['\n', '\r']).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{defaults, schema};

    fn parse(text: &str) -> Pipeline {
        Pipeline::parse(text, "pipeline.toml").unwrap()
    }

    fn init(input: &str) -> Init {
        Init {
            file: "pipeline.toml".into(),
            input: input.to_owned(),
            output: "o".to_owned(),
            hook: false,
            force: false,
        }
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
        assert_eq!((example.budgets.len(), parse(&init("in").text()).budgets.len()), (2, 0));
        let limited: usize = spelled.budgets[0].limits().len();
        assert_eq!(limited, crate::config::Fact::ALL.len(), "every fact has its line");
    }

    #[test]
    fn the_example_names_every_key() {
        let schema = schema();
        let tables =
            ["Screen", "Simplify", "Appearance", "Scene", "Limit", "Growth"].map(|name| format!("/$defs/{name}Table"));
        let entries = ["Lod", "Override", "Budget"].map(|name| format!("/$defs/{name}Entry"));
        for table in tables.iter().chain(&entries).map(String::as_str).chain([""]) {
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
