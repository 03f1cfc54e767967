//! Why a scene would be baked again.

use crate::scene::{Scene, Shape};
use crate::space::Space;

fn space() -> Space {
    let space = Space::new();
    let (text, buffer) = Scene::of(&Shape::grid(12, 0.2)).gltf_beside("hill.bin");
    space.write("pipeline.toml", "input = \"scenes\"\noutput = \"out\"\n");
    space.write("scenes/land/hill.gltf", text);
    space.write("scenes/land/hill.bin", buffer);
    space
}

fn explained(space: &Space) -> String {
    space.run_fine(&["explain", "scenes/land/hill.gltf"]).stdout
}

#[test]
fn each_cause_is_named() {
    let space = space();
    assert_eq!(explained(&space), "land/hill.gltf: it was not baked yet\n");
    space.run_fine(&[]);
    assert_eq!(explained(&space), "land/hill.gltf: unchanged, nothing would be done\n");

    space.write("scenes/land/hill.bin", Scene::of(&Shape::grid(12, 0.3)).gltf_beside("").1);
    assert!(explained(&space).contains("hill.bin"), "{}", explained(&space));
    space.run_fine(&[]);

    std::fs::remove_file(space.path("out/land/hill.gltf")).expect("it was just made");
    assert!(explained(&space).contains("out"), "{}", explained(&space));
    space.run_fine(&[]);

    space.write("pipeline.toml", "input = \"scenes\"\noutput = \"out\"\n[[lod]]\nratio = 0.4\n");
    let text = explained(&space);
    assert!(text.starts_with("land/hill.gltf: ") && text.contains("0.4"), "{text}");
    space.run_fine(&[]);
    assert_eq!(explained(&space), "land/hill.gltf: unchanged, nothing would be done\n");
}

#[test]
fn a_scene_may_be_named_as_messages_name_it() {
    let space = space();
    let run = space.run_fine(&["explain", "--json", "land/hill.gltf"]);
    let explained = run.document();
    assert_eq!((&explained["scene"], &explained["state"]), (&"land/hill.gltf".into(), &"changed".into()));
    assert_eq!(explained["reasons"].as_array().map(Vec::len), Some(1));
}

#[test]
fn it_agrees_with_a_dry_run() {
    let space = space();
    space.run_fine(&[]);
    space.write("pipeline.toml", "input = \"scenes\"\noutput = \"out\"\nformat = \"glb\"\n");
    let told = explained(&space);
    let planned = space.run_fine(&["--dry-run", "--json"]).events_of("scene_planned");
    let reason = planned[0]["reason"].as_str().unwrap_or_default().to_owned();
    let lines: Vec<&str> = told.lines().filter_map(|line| line.strip_prefix("land/hill.gltf: ")).collect();
    assert_eq!(lines.join("; "), reason);
}

#[test]
fn other_files_are_refused() {
    let space = space();
    space.write("elsewhere.glb", Scene::of(&Shape::grid(2, 0.0)).glb());
    for file in ["elsewhere.glb", "missing.glb", "scenes/land/hill.bin"] {
        let run = space.run(&["explain", file]);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{file}");
        assert!(
            run.stderr.starts_with(&format!("error: `{file}` is no scene of `pipeline.toml`\nhint: ")),
            "{}",
            run.stderr
        );
    }
}
