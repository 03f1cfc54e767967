//! Looking after the cache.

use crate::scene::{Scene, Shape};
use crate::space::Space;

fn baked() -> Space {
    let space = Space::new();
    space.write("pipeline.toml", "input = \"scenes\"\noutput = \"out\"\n");
    space.write("scenes/hill.glb", Scene::of(&Shape::grid(12, 0.2)).glb());
    space.run_fine(&[]);
    space
}

#[test]
fn stats_count_what_is_there() {
    let space = baked();
    let stats = space.run_fine(&["cache", "stats", "--json"]).document();
    let buckets = stats["buckets"].as_array().expect("it lists buckets");
    let entries: u64 = buckets.iter().filter_map(|bucket| bucket["entries"].as_u64()).sum();
    assert!(entries > 0, "{stats}");
    let told = space.run_fine(&["cache", "stats"]).stdout;
    assert!(told.lines().last().is_some_and(|line| line.starts_with("all ")), "{told}");
}

#[test]
fn a_cleaned_cache_is_filled_again() {
    let space = baked();
    let out = space.files("out");
    let run = space.run_fine(&["cache", "clean"]);
    assert!(run.stdout.starts_with("removed "), "{}", run.stdout);
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    assert_eq!(space.run_fine(&["--json"]).summary()["jobs"], 1);
    assert_eq!(space.files("out"), out);
}

#[test]
fn verify_takes_out_what_is_damaged() {
    let space = baked();
    let good = space.run_fine(&["cache", "verify", "--json"]).document();
    assert_eq!(good["damaged"], serde_json::json!([]));
    for (name, mut bytes) in space.files(".lodbake") {
        if bytes.len() > 100 {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            space.write(&format!(".lodbake/{name}"), bytes);
        }
    }
    let found = space.run_fine(&["cache", "verify", "--json"]).document();
    assert!(found["damaged"].as_array().is_some_and(|damaged| !damaged.is_empty()), "{found}");
    let again = space.run_fine(&["cache", "verify", "--json"]).document();
    assert_eq!(again["damaged"], serde_json::json!([]), "what was damaged is gone");
}

#[test]
fn the_option_and_the_variable_choose_the_folder() {
    let space = baked();
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    assert_eq!(space.run_fine(&["--json", "--cache", "other"]).summary()["jobs"], 1);
    assert!(!space.files("other").is_empty());
    let run = space.run(&["cache", "stats", "--no-cache"]);
    assert_eq!(run.code, 2, "{run:#?}");
}
