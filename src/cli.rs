//! The command line: words to `Command`, errors to text and an exit code. Does no work of its own.

use std::ffi::OsString;
use std::io::{self, IsTerminal, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use crate::command::failure::{Failure, UsageError};
use crate::command::{
    CacheChoice, Context, Exit, bake, cache, check, completions, diff, evaluate, explain, init, inspect, report,
    reproduce, schema, study,
};
use crate::progress::{JsonLines, Lines, Paint, Reporter, Terminal, Verbosity};

/// The pipeline that a bare `lodbake` bakes.
const DEFAULT_PIPELINE: &str = "pipeline.toml";
/// The command that a pipeline file stands for.
const DEFAULT_COMMAND: &str = "bake";

/// Find repeated meshes in glTF scenes, simplify each once, write instanced LOD chains.
#[derive(Debug, Parser)]
#[command(name = "lodbake", version, max_term_width = 100, subcommand_required = true)]
#[command(override_usage = "lodbake [OPTIONS] [PIPELINE]\n       lodbake [OPTIONS] <COMMAND>")]
#[command(after_help = AFTER_HELP)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
`lodbake pipeline.toml` is short for `lodbake bake pipeline.toml`, and so is `lodbake` alone.

Exit codes:
  0  everything asked for is done
  1  a budget is exceeded, or a regression was found
  2  wrong usage or configuration; nothing was done
  3  some work could not be done; the rest is";

/// Options of every command.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
struct Global {
    /// Threads to use [default: as many as the machine has]
    #[arg(long, short = 'j', global = true, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Folder of the cache [env: LODBAKE_CACHE] [default: as the pipeline says]
    #[arg(long, global = true, value_name = "DIR", conflicts_with = "no_cache")]
    cache: Option<PathBuf>,
    /// Neither read nor write the cache
    #[arg(long, global = true)]
    no_cache: bool,
    /// JSON on standard output: events as lines while baking, one document elsewhere
    #[arg(long, global = true)]
    json: bool,
    /// Tell errors only
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Tell each scene and each mesh
    #[arg(long, short, global = true)]
    verbose: bool,
    /// Colour the text
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: ColorChoice,
}

/// When to colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ColorChoice {
    /// On a terminal, unless `NO_COLOR` is set
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

/// What to do.
#[derive(Debug, Subcommand)]
enum Command {
    /// Bake the scenes of a pipeline
    Bake(bake::Bake),
    /// Hold what was baked against the budgets of a pipeline
    Check(check::Check),
    /// Tell what changed between two reports or revisions
    Diff(diff::Diff),
    /// Write what was recorded for comments, CI services, trackers, or as a page
    Report(report::ReportCommand),
    /// Write a commented pipeline to start from
    Init(init::Init),
    /// Show what is in a scene, and what a bake would save
    Inspect(inspect::Inspect),
    /// Measure how scenes or levels differ from a reference
    Evaluate(evaluate::Evaluate),
    /// Tell why a scene would be baked again
    Explain(explain::Explain),
    /// Compare ways to simplify: looks, distance, time and memory
    Study(study::Study),
    /// Make the instanced-model paper's tables again
    Reproduce(reproduce::Reproduce),
    /// Look after the cache
    Cache(cache::CacheCommand),
    /// Write the JSON schema of a file format to standard output
    Schema(schema::Schema),
    #[command(hide = true)]
    Measured(study::Measured),
    #[command(hide = true)]
    StudyLevel(study::StudyLevel),
    /// Write completions for a shell to standard output
    Completions(completions::Completions),
}

/// Parses `args` (the program's name first), runs, and tells errors. Everything but the exit code itself.
pub fn run(args: impl IntoIterator<Item = OsString>) -> Exit {
    let args: Vec<OsString> = args.into_iter().collect();
    let cli = match parse(&args) {
        Ok(cli) => cli,
        Err(Refused::Clap(error)) => {
            let printed = error.print(); // help and version go to standard output, errors to standard error
            drop(printed);
            return if error.use_stderr() { Exit::Usage } else { Exit::Fine };
        }
        Err(Refused::Usage(error)) => return tell_error(&error.into(), paint_before_parsing()),
    };
    let context = cli.global.settle();
    let done = match &cli.command {
        Command::Bake(command) => command.run(&context),
        Command::Check(command) => command.run(&context),
        Command::Diff(command) => command.run(&context),
        Command::Report(command) => command.run(&context),
        Command::Init(command) => command.run(&context),
        Command::Evaluate(command) => command.run(&context),
        Command::Explain(command) => command.run(&context),
        Command::Cache(command) => command.run(&context),
        Command::Study(command) => command.run(&context),
        Command::Reproduce(command) => command.run(&context),
        Command::Measured(command) => command.run(&context),
        Command::StudyLevel(command) => command.run(&context),
        Command::Schema(command) => command.run(&context),
        Command::Inspect(command) => command.run(&context),
        Command::Completions(command) => command.run(Cli::command(), &context),
    };
    match done {
        Ok(exit) => exit,
        Err(error) => {
            let paint = context.paint_told;
            drop(context); // takes the bars away before the error is told
            tell_error(&error, paint)
        }
    }
}

/// Why a command line was not understood.
#[derive(Debug)]
enum Refused {
    Clap(clap::Error),
    Usage(UsageError),
}

fn parse(args: &[OsString]) -> Result<Cli, Refused> {
    let args = with_default_command(args, &Cli::command(), &|path| path.exists()).map_err(Refused::Usage)?;
    let matches = Cli::command().try_get_matches_from(args).map_err(Refused::Clap)?;
    Cli::from_arg_matches(&matches).map_err(Refused::Clap)
}

/// `lodbake x.toml` and bare `lodbake` become `lodbake bake …`.
///
/// Written out before parsing: a positional argument beside subcommands would make of a mistyped command a strange
/// file name, and of its arguments unexpected ones.
fn with_default_command(
    args: &[OsString],
    command: &clap::Command,
    exists: &dyn Fn(&Path) -> bool,
) -> Result<Vec<OsString>, UsageError> {
    let mut with_bake = args.to_vec();
    with_bake.insert(1.min(args.len()), DEFAULT_COMMAND.into());
    match first_word(args, command) {
        FirstWord::Help => Ok(args.to_vec()),
        FirstWord::None if exists(Path::new(DEFAULT_PIPELINE)) => Ok(with_bake),
        FirstWord::None => Err(UsageError {
            message: format!("there is no `{DEFAULT_PIPELINE}` in this folder"),
            hint: Some("`lodbake init` writes one, `lodbake --help` lists the commands".into()),
        }),
        FirstWord::Word(word) => {
            let path = Path::new(&word);
            let name = word.to_string_lossy();
            if name == "help" || command.find_subcommand(&*name).is_some() {
                Ok(args.to_vec())
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
                Ok(with_bake)
            } else {
                Err(unknown_word(&name, exists(path), command))
            }
        }
    }
}

/// A word that is neither a command nor a pipeline file.
fn unknown_word(word: &str, exists: bool, command: &clap::Command) -> UsageError {
    let message = format!("`{word}` is neither a command nor a pipeline file (`.toml`)");
    let hint = if exists {
        let path = Path::new(word);
        if path.is_dir() {
            "`lodbake init` writes a pipeline that names the folders to bake".to_owned()
        } else {
            format!("`lodbake inspect {word}` shows what is in a scene; a bake needs a pipeline, see `lodbake init`")
        }
    } else {
        match nearest_command(word, command) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`lodbake --help` lists the commands".to_owned(),
        }
    };
    UsageError { message, hint: Some(hint) }
}

fn nearest_command<'a>(word: &str, command: &'a clap::Command) -> Option<&'a str> {
    let scored = command.get_subcommands().map(|c| (strsim::jaro_winkler(word, c.get_name()), c.get_name()));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 > 0.75).then_some(best.1)
}

/// The first argument that is not an option.
#[derive(Debug, PartialEq, Eq)]
enum FirstWord {
    Word(OsString),
    None,
    /// Help or version is asked for, with no word.
    Help,
}

fn first_word(args: &[OsString], command: &clap::Command) -> FirstWord {
    let mut rest = args.iter().skip(1);
    while let Some(arg) = rest.next() {
        let text = arg.to_string_lossy();
        match text.as_ref() {
            "-h" | "--help" | "-V" | "--version" => return FirstWord::Help,
            "--" => return rest.next().map_or(FirstWord::None, |word| FirstWord::Word(word.clone())),
            "-" => return FirstWord::Word(arg.clone()),
            option if takes_next(option, command) => drop(rest.next()),
            option if option.starts_with('-') => {}
            _ => return FirstWord::Word(arg.clone()),
        }
    }
    FirstWord::None
}

/// Whether `option` is one whose value is the next argument: `--jobs`, `-j`, `-qj`; not `--jobs=2`, `-j2`, `--quiet`.
fn takes_next(option: &str, command: &clap::Command) -> bool {
    let bake = command.find_subcommand(DEFAULT_COMMAND);
    let mut known = command.get_arguments().chain(bake.into_iter().flat_map(clap::Command::get_arguments));
    if let Some(long) = option.strip_prefix("--") {
        return known.any(|a| a.get_long() == Some(long) && a.get_action().takes_values());
    }
    let Some(shorts) = option.strip_prefix('-') else { return false };
    let valued: Vec<char> = known.filter(|a| a.get_action().takes_values()).filter_map(clap::Arg::get_short).collect();
    // The first letter that takes a value takes the rest of the word, if there is any.
    shorts.find(|letter| valued.contains(&letter)).is_some_and(|at| at + 1 == shorts.len())
}

impl Global {
    /// Reads what the environment says, and makes the reporter.
    fn settle(&self) -> Context {
        let paint = Paint { on: self.colours(io::stdout().is_terminal()) };
        let paint_told = Paint { on: self.colours(io::stderr().is_terminal()) };
        Context {
            jobs: self.jobs,
            cache: self.cache_choice(),
            json: self.json,
            quiet: self.quiet,
            verbose: self.verbose,
            paint,
            paint_told,
            reporter: self.reporter(paint_told),
        }
    }

    fn cache_choice(&self) -> CacheChoice {
        if self.no_cache {
            return CacheChoice::Off;
        }
        let named = self.cache.clone().or_else(|| variable("LODBAKE_CACHE").map(PathBuf::from));
        named.map_or(CacheChoice::Pipeline, CacheChoice::Folder)
    }

    fn reporter(&self, paint: Paint) -> Box<dyn Reporter> {
        let to_stderr = |verbosity| Box::new(Lines::new(Box::new(io::stderr()), paint, verbosity));
        if self.json {
            Box::new(JsonLines::new(Box::new(io::stdout())))
        } else if self.quiet {
            to_stderr(Verbosity::Quiet)
        } else if io::stderr().is_terminal() && variable("TERM").is_none_or(|term| term != "dumb") {
            Box::new(Terminal::new(paint, self.verbose))
        } else {
            to_stderr(if self.verbose { Verbosity::Verbose } else { Verbosity::Normal })
        }
    }

    fn colours(&self, terminal: bool) -> bool {
        match self.color {
            ColorChoice::Always => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => auto_colours(terminal),
        }
    }
}

/// <https://no-color.org>: set and not empty means no colour.
fn auto_colours(terminal: bool) -> bool {
    terminal && variable("NO_COLOR").is_none() && variable("TERM").is_none_or(|term| term != "dumb")
}

/// An error before `--color` is known follows the terminal.
fn paint_before_parsing() -> Paint {
    Paint { on: auto_colours(io::stderr().is_terminal()) }
}

/// An environment variable that is set and not empty.
fn variable(name: &str) -> Option<OsString> {
    std::env::var_os(name).filter(|value| !value.is_empty())
}

/// Tells an error once, with its causes and its hint, and chooses the exit code.
fn tell_error(error: &anyhow::Error, paint: Paint) -> Exit {
    let failure = Failure::of(error);
    if failure.exit != Exit::Fine {
        let written = writeln!(io::stderr().lock(), "{}", failure.lines(paint));
        drop(written); // nobody listens
    }
    failure.exit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split_whitespace().map(OsString::from).collect()
    }

    /// The real command line with a `bake` in it, whether or not the build has one.
    fn command() -> clap::Command {
        let bake = clap::Command::new(DEFAULT_COMMAND).arg(clap::Arg::new("only").long("only").num_args(1));
        let inspect = clap::Command::new("inspect");
        let command = Cli::command();
        let missing = [bake, inspect].into_iter().filter(|c| command.find_subcommand(c.get_name()).is_none());
        command.clone().subcommands(missing)
    }

    fn defaulted(line: &str, exists: bool) -> Result<String, UsageError> {
        let args = with_default_command(&words(line), &command(), &|_| exists)?;
        Ok(args.iter().map(|a| a.to_string_lossy()).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_pipeline_file_means_bake() {
        for (line, meant) in [
            ("lodbake pipeline.toml", "lodbake bake pipeline.toml"),
            ("lodbake -j 2 a/b.TOML --json", "lodbake bake -j 2 a/b.TOML --json"),
            ("lodbake --cache completions x.toml", "lodbake bake --cache completions x.toml"),
            ("lodbake --jobs=2 x.toml", "lodbake bake --jobs=2 x.toml"),
            ("lodbake -qj 2 x.toml", "lodbake bake -qj 2 x.toml"),
            ("lodbake -j2 x.toml", "lodbake bake -j2 x.toml"),
            ("lodbake -- x.toml", "lodbake bake -- x.toml"),
        ] {
            assert_eq!(defaulted(line, false).as_deref().ok(), Some(meant));
        }
    }

    #[test]
    fn commands_help_and_version_stay() {
        for line in
            ["lodbake completions bash", "lodbake help", "lodbake --help", "lodbake -q -V", "lodbake -j 2 bake x.toml"]
        {
            assert_eq!(defaulted(line, false).as_deref().ok(), Some(line));
        }
    }

    #[test]
    fn a_bare_call_bakes_the_pipeline_that_is_there() {
        assert_eq!(defaulted("lodbake", true).as_deref().ok(), Some("lodbake bake"));
        assert_eq!(defaulted("lodbake --quiet", true).as_deref().ok(), Some("lodbake bake --quiet"));
        let error = defaulted("lodbake", false).expect_err("there is nothing to bake");
        assert_eq!(error.message, "there is no `pipeline.toml` in this folder");
        assert!(error.hint.expect("a newcomer needs one").contains("lodbake init"));
    }

    #[test]
    fn a_mistyped_command_names_the_nearest() {
        let error = defaulted("lodbake inpsect a.glb", false).expect_err("it is no command");
        assert_eq!(error.message, "`inpsect` is neither a command nor a pipeline file (`.toml`)");
        assert_eq!(error.hint.as_deref(), Some("did you mean `inspect`?"));
        let error = defaulted("lodbake zzz", false).expect_err("it is no command");
        assert_eq!(error.hint.as_deref(), Some("`lodbake --help` lists the commands"));
    }
}
