//! What changed between two reports, or two revisions.

use crate::check::git;
use crate::scene::{Scene, Shape};
use crate::space::Space;

/// Three scenes, baked, and their report committed as the baseline.
fn space() -> Space {
    let space = Space::new();
    space.write("pipeline.toml", "input = \"scenes\"\noutput = \"out\"\nbaseline = \"base.json\"\n");
    for (name, side) in [("a", 8), ("b", 12), ("c", 10)] {
        space.write(&format!("scenes/{name}.glb"), Scene::of(&Shape::grid(side, 0.2)).glb());
    }
    space.run_fine(&[]);
    std::fs::copy(space.path("out/report.json"), space.path("base.json")).expect("a bake writes it");
    git(&space, &["init", "-q"]);
    git(&space, &["add", "base.json"]);
    git(&space, &["commit", "-q", "-m", "baseline"]);
    space
}

#[test]
fn an_unchanged_rebuild_has_no_change() {
    let space = space();
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    std::fs::remove_dir_all(space.path(".lodbake")).expect("it was just made");
    space.run_fine(&[]);
    assert_eq!(space.run_fine(&["diff", "HEAD"]).stdout, "no change: 3 scenes the same\n");
    assert_eq!(space.run_fine(&["diff", "base.json", "out"]).stdout, "no change: 3 scenes the same\n");
}

#[test]
fn planted_regressions_are_told_first() {
    let space = space();
    // One with coarser levels than before, one grown, one vanished.
    let over = "[[override]]\nmatch = 'a.glb'\nlod = [{ ratio = 0.2 }, { ratio = 0.1 }, { ratio = 0.05 }]\n";
    space.write("pipeline.toml", format!("input = \"scenes\"\noutput = \"out\"\nbaseline = \"base.json\"\n{over}"));
    space.write("scenes/b.glb", Scene::of(&Shape::grid(13, 0.2)).glb());
    std::fs::remove_file(space.path("scenes/c.glb")).expect("it is there");
    space.run_fine(&[]);
    let run = space.run(&["diff", "HEAD"]);
    assert_eq!(run.code, 1);
    let first: Vec<&str> = run.stdout.lines().take(2).collect();
    assert_eq!(first[0], "! vanished c.glb: the scene is not there any more");
    assert!(first[1].starts_with("! uglier a.glb: mesh `shape`, level "), "{}", first[1]);
    assert!(
        run.stdout.contains("\n! uglier a.glb: mesh `shape`, level 1: image difference (d_RMS) "),
        "{}",
        run.stdout
    );
    assert!(run.stdout.contains("\n! grew b.glb: bytes of the files +"), "{}", run.stdout);
    assert!(run.stdout.contains("\n  shrank a.glb: mesh `shape`, level 1: triangles −"), "{}", run.stdout);

    let lenient = ["diff", "HEAD", "--max-growth", "50", "--max-uglier", "100000%", "--allow-vanished"];
    space.run_fine(&lenient);
    let run = space.run(&[&lenient[..], &["--max-sum-growth", "0"]].concat());
    assert_eq!(run.code, 0, "in sum it became less: {}", run.stdout);
    let document = space.run(&["diff", "--json", "out", "base.json", "--max-sum-growth", "1"]).document();
    let changes = document["changes"].as_array().expect("a list");
    let sums: Vec<_> = changes.iter().filter(|change| change["scene"].is_null()).collect();
    assert!(!sums.is_empty() && sums.iter().all(|sum| sum["kind"] == "grew"), "{document:#}");
    let validator = jsonschema::validator_for(&space.run_fine(&["schema", "diff"]).document()).expect("a schema");
    assert!(validator.is_valid(&document));
}

#[test]
fn what_is_no_report_is_refused() {
    let space = space();
    for (words, code, said) in [
        (&["diff", "nowhere"][..], 2, "error: `nowhere` is neither a file nor a revision with a report"),
        (&["diff", "none.json"], 3, "error: failed to read `none.json`"),
        (&["diff", "HEAD", "pipeline.toml"], 3, "error: failed to read `pipeline.toml`"),
        (&["diff", "HEAD", "--max-growth", "-1"], 2, "error: "),
    ] {
        let run = space.run(words);
        assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{run:#?}");
        assert!(run.stderr.starts_with(said), "{}", run.stderr);
    }
}
