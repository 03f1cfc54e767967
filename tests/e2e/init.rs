//! The first minute of a newcomer.

use crate::scene::{Scene, Shape};
use crate::space::Space;

#[test]
fn what_it_writes_bakes() {
    let space = Space::new();
    let run = space.run_fine(&["init"]);
    assert_eq!(
        (run.stdout.as_str(), run.stderr.as_str()),
        ("", "wrote `pipeline.toml`; bake it with `lodbake pipeline.toml`\n")
    );
    space.write("scenes/hill.glb", Scene::of(&Shape::grid(12, 0.2)).glb());
    let run = space.run_fine(&["pipeline.toml"]);
    assert!(run.stderr.contains("baked 1 scene ("), "{}", run.stderr);
    assert!(!space.read("out/hill.glb").is_empty());
}

#[test]
fn it_replaces_nothing_unasked() {
    let space = Space::new();
    space.write("pipeline.toml", "mine");
    let run = space.run(&["init"]);
    assert_eq!(run.code, 2);
    assert_eq!(run.stderr, "error: `pipeline.toml` is there already\nhint: `--force` replaces it\n");
    assert_eq!(space.read("pipeline.toml"), b"mine");
    space.run_fine(&["init", "--force"]);
    assert!(String::from_utf8_lossy(&space.read("pipeline.toml")).contains("input = \"scenes\""));
}

#[test]
fn a_pipeline_without_its_input_folder_says_so() {
    let space = Space::new();
    space.run_fine(&["init"]);
    let run = space.run(&[]);
    assert_ne!(run.code, 0, "{run:#?}");
    assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    assert!(run.stderr.contains("`scenes`"), "{}", run.stderr);
}
