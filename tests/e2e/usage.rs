//! What the command line says to people who know it and to people who do not.

use std::io::Read;
use std::process::{Command, Stdio};

use crate::space::Space;

#[test]
fn alone_in_a_folder_without_a_pipeline_it_names_the_first_step() {
    let run = Space::new().run(&[]);
    assert_eq!((run.code, run.stdout.as_str()), (2, ""));
    assert_eq!(
        run.stderr,
        "error: there is no `pipeline.toml` in this folder\n\
         hint: `lodbake init` writes one, `lodbake --help` lists the commands\n"
    );
}

#[test]
fn a_mistyped_command_is_no_file() {
    let run = Space::new().run(&["completion", "bash"]);
    assert_eq!(run.code, 2);
    assert_eq!(
        run.stderr,
        "error: `completion` is neither a command nor a pipeline file (`.toml`)\nhint: did you mean `completions`?\n"
    );
}

#[test]
fn a_scene_in_the_place_of_a_pipeline_is_explained() {
    let space = Space::new();
    space.write("lamp.glb", crate::scene::Scene::of(&crate::scene::Shape::grid(2, 0.0)).glb());
    let run = space.run(&["lamp.glb"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("hint: `lodbake inspect lamp.glb` shows"), "{}", run.stderr);
}

#[test]
fn help_and_version_are_data() {
    let space = Space::new();
    let help = space.run_fine(&["--help"]);
    assert!(help.stdout.contains("Usage: lodbake [OPTIONS] [PIPELINE]"), "{}", help.stdout);
    assert!(help.stdout.contains("Exit codes:"), "{}", help.stdout);
    assert_eq!(help.stderr, "");
    let version = space.run_fine(&["--version"]);
    assert_eq!(version.stdout, concat!("lodbake ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn options_that_exclude_each_other_are_wrong_usage() {
    let space = Space::new();
    for args in [["--quiet", "--verbose"], ["--no-cache", "--cache=x"], ["--jobs=0", "--json"]] {
        let run = space.run(&[args[0], args[1], "completions", "bash"]);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{args:?}");
        assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    }
}

#[test]
fn every_shell_gets_completions() {
    let space = Space::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = space.run_fine(&["completions", shell]);
        assert!(run.stdout.contains("completions") && run.stdout.contains("no-cache"), "{shell}: {}", run.stdout);
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_lodbake"))
        .args(["completions", "zsh"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    drop(child.stdout.take());
    let mut told = String::new();
    child.stderr.take().expect("it is piped").read_to_string(&mut told).expect("the binary writes UTF-8");
    let status = child.wait().expect("it was started");
    assert_eq!((status.code(), told.as_str()), (Some(0), ""));
}
