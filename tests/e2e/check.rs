//! The gate: what was baked against the budgets, without reading a scene and without writing anything.

use std::process::Command;

use crate::scene::{Scene, Shape};
use crate::space::{Run, Space};

const BUDGETS: &str = "\n[[budget]]\nlevel = [1]\ntriangles = { warn = 100, error = 130 }\n";

/// Two scenes: a small one within the budgets and one beyond.
fn space(budgets: &str) -> Space {
    let space = Space::new();
    space.write("pipeline.toml", format!("input = \"scenes\"\noutput = \"out\"\n{budgets}"));
    space.write("scenes/low.glb", Scene::of(&Shape::grid(8, 0.2)).glb());
    let (text, buffer) = Scene::of(&Shape::grid(12, 0.2)).gltf_beside("hill.bin");
    space.write("scenes/land/hill.gltf", text);
    space.write("scenes/land/hill.bin", buffer);
    space
}

fn findings(run: &Run) -> Vec<String> {
    let document = run.document();
    let text = |f: &serde_json::Value| {
        format!("{} {} {} {}", f["severity"], f["scene"], f["rule"], f["level"]).replace('"', "")
    };
    document["findings"].as_array().expect("a list").iter().map(text).collect()
}

#[test]
fn a_limit_that_is_exceeded_is_told_with_what_would_help() {
    let space = space(BUDGETS);
    space.run_fine(&[]);
    let run = space.run(&["check"]);
    assert_eq!(run.code, 1);
    assert_eq!(
        run.stdout,
        "error: land/hill.gltf: mesh `shape`, level 1: 143 triangles; limit 130, 10 % over\n\
         hint: `ratio = 0.451` instead of 0.5 for level 1 would reach it\n"
    );
    assert!(run.stderr.starts_with("checked 2 scenes: 1 error, 0 warnings ("), "{}", run.stderr);

    // What the hint says is true.
    space.write(
        "pipeline.toml",
        format!("input = \"scenes\"\noutput = \"out\"\n[[lod]]\nratio = 0.451\n{BUDGETS}").replace("100", "129"),
    );
    assert_eq!(space.run(&["check"]).code, 3, "the settings have changed");
    space.run_fine(&[]);
    let run = space.run_fine(&["check"]);
    assert_eq!(run.stdout, "");
}

#[test]
fn nothing_is_written_and_files_choose_their_scenes() {
    let space = space(BUDGETS);
    space.run_fine(&[]);
    let before = (space.times(""), space.files("").len());
    assert_eq!(
        findings(&space.run(&["check", "--json", "pipeline.toml"])),
        ["error land/hill.gltf budget/triangles 1"]
    );
    for (file, expected) in
        [("scenes/low.glb", 0), ("scenes/land/hill.bin", 1), ("out/land/hill.gltf", 1), ("pipeline.md", 0)]
    {
        let run = space.run(&["check", "--json", "pipeline.toml", file]);
        assert_eq!((findings(&run).len(), run.code), (expected, expected as i32), "{file}");
    }
    // The outputs are not needed: a commit may be judged where they were never made.
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    assert_eq!(findings(&space.run(&["check", "--json"])).len(), 1);
    let after = space.times("");
    assert_eq!(before.1 - before.0.keys().filter(|name| name.starts_with("out/")).count(), after.len());
    assert!(after.iter().all(|(name, time)| before.0[name] == *time));
}

#[test]
fn a_scene_that_was_not_baked_is_not_judged() {
    let space = space(BUDGETS);
    let run = space.run(&["check"]);
    assert_eq!(run.code, 3, "{run:#?}");
    assert!(run.stdout.starts_with("error: land/hill.gltf: not baked yet, or its bake failed\n"), "{}", run.stdout);
    assert!(!space.path("out").exists() && !space.path(".lodbake").exists(), "it writes nothing");

    space.run_fine(&[]);
    space.write("scenes/low.glb", Scene::of(&Shape::grid(9, 0.2)).glb());
    let run = space.run(&["check", "pipeline.toml", "scenes/low.glb"]);
    assert_eq!(run.code, 3);
    assert_eq!(
        run.stdout,
        "error: low.glb: not baked since it changed: the scene file has changed\n\
         hint: `lodbake` bakes them, `lodbake check --bake-missing` bakes and checks\n"
    );
    let run = space.run(&["check", "--bake-missing", "--json"]);
    assert_eq!((run.code, run.document()["scenes"].as_u64()), (1, Some(2)));
    assert_eq!(space.run(&["check", "--json"]).document()["unknown"].as_array().map(Vec::len), Some(0));
}

#[test]
fn a_touched_scene_is_hashed_and_trusted() {
    let space = space("[[budget]]\ntriangles = 1000\n");
    space.run_fine(&[]);
    space.write("scenes/low.glb", space.read("scenes/low.glb"));
    space.run_fine(&["check"]);
}

#[test]
fn growth_is_measured_against_a_report_or_a_revision() {
    let space =
        space("baseline = \"base.json\"\n[[budget]]\nfile_bytes = { grow_percent = { warn = 1, error = 10 } }\n");
    space.run_fine(&[]);
    let run = space.run_fine(&["check"]);
    assert!(run.stdout.contains("growth is not checked: the baseline `base.json` is not there"), "{}", run.stdout);
    std::fs::copy(space.path("out/report.json"), space.path("base.json")).expect("a bake writes it");
    assert_eq!(space.run_fine(&["check"]).stdout, "");
    git(&space, &["init", "-q"]);
    git(&space, &["add", "base.json"]);
    git(&space, &["commit", "-q", "-m", "baseline"]);

    space.write("scenes/low.glb", Scene::of(&Shape::grid(9, 0.2)).glb());
    space.run_fine(&[]);
    for words in [&["check", "--json"][..], &["check", "--json", "--baseline", "HEAD"]] {
        let run = space.run(words);
        assert_eq!((run.code, findings(&run)), (1, vec!["error low.glb budget/file_bytes null".to_owned()]));
    }
    let run = space.run(&["check", "--baseline", "nowhere"]);
    assert_eq!(run.code, 2);
    assert!(
        run.stderr.starts_with("error: `nowhere` is neither a file nor a revision with a report"),
        "{}",
        run.stderr
    );
}

/// Runs git here as nobody in particular.
pub fn git(space: &Space, words: &[&str]) {
    let run = git_command(space, words).output().expect("git is installed");
    assert!(run.status.success(), "git {words:?}: {}", String::from_utf8_lossy(&run.stderr));
}

pub fn git_command(space: &Space, words: &[&str]) -> Command {
    let mut command = Command::new("git");
    command.current_dir(space.path("")).args(["-c", "user.name=A", "-c", "user.email=a@example.org"]).args(words);
    let binary = std::path::Path::new(env!("CARGO_BIN_EXE_lodbake"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = binary.parent().map(ToOwned::to_owned).into_iter().chain(std::env::split_paths(&path));
    command.env("PATH", std::env::join_paths(folders).expect("folders without colons"));
    command.env_remove("LODBAKE_CACHE").env_remove("GIT_DIR").env_remove("GIT_INDEX_FILE");
    command
}

#[test]
fn the_git_hook_stops_a_commit_beyond_the_budget() {
    let space = space(BUDGETS);
    let run = space.run(&["init", "--hook"]);
    assert_eq!((run.code, run.stderr.lines().next()), (2, Some("error: this folder is in no git repository")));
    git(&space, &["init", "-q"]);
    let run = space.run_fine(&["init", "--hook"]);
    assert_eq!(run.stderr, "wrote `.git/hooks/pre-commit`: each commit checks the budgets of `pipeline.toml`\n");
    space.run_fine(&["init", "--hook"]);
    space.run_fine(&[]);
    git(&space, &["add", "scenes/low.glb"]);
    git(&space, &["commit", "-q", "-m", "low"]);
    git(&space, &["add", "scenes/land"]);
    let run = git_command(&space, &["commit", "-q", "-m", "hill"]).output().expect("git is installed");
    assert!(!run.status.success());
    let said = String::from_utf8_lossy(&run.stderr).into_owned() + &String::from_utf8_lossy(&run.stdout);
    assert!(said.contains("land/hill.gltf: mesh `shape`, level 1: 143 triangles"), "{said}");
    // A pipeline that is committed is checked with all its scenes.
    git(&space, &["reset", "-q"]);
    git(&space, &["add", "pipeline.toml"]);
    assert!(!git_command(&space, &["commit", "-q", "-m", "p"]).output().expect("git is installed").status.success());
    space.write(".git/hooks/pre-commit", "#!/bin/sh\n");
    assert_eq!(space.run(&["init", "--hook"]).code, 2);
    space.run_fine(&["init", "--hook", "--force"]);
}
