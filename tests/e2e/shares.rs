//! Levels that are a budget of a whole scene.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::scene::{Scene, Shape};
use crate::space::Space;

/// A ball, four times as large on one of its nodes; a hill that five nodes show, and the same one with another material; a square
/// that is too small for levels.
fn street() -> Scene {
    let mut scene = Scene::new();
    let ball = scene.mesh("ball", &Shape::sphere(20, 24));
    scene.node("small", ball, [0.0; 3]);
    let large = scene.node("large", ball, [9.0, 0.0, 0.0]);
    scene.set(large, "scale", json!([4, 4, 4]));
    let hill = scene.mesh("hill", &Shape::grid(14, 0.2));
    for i in 0..5 {
        scene.node(&format!("hill {i}"), hill, [0.0, i as f32, 0.0]);
    }
    let painted = scene.mesh_with_material("painted", &Shape::grid(14, 0.2), 1);
    scene.node("painted", painted, [0.0, 0.0, 3.0]);
    let square = scene.mesh("square", &Shape::grid(4, 0.0));
    scene.node("square", square, [0.0, 0.0, 5.0]);
    scene
}

fn space(levels: &str) -> Space {
    let space = Space::new();
    space.write("pipeline.toml", format!("input = 'scenes'\noutput = 'out'\n{levels}\n"));
    space.write("scenes/street.glb", street().glb());
    space
}

const LEVELS: &str = "lod = [{ scene_ratio = 0.5 }, { scene_ratio = 0.2 }]";

fn meshes(space: &Space) -> Vec<Value> {
    space.json("out/report.json")["scenes"][0]["meshes"].as_array().expect("a list").clone()
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Triangles of a mesh at a level, with all its instances; those of the level before where it has none.
fn drawn(mesh: &Value, level: u64) -> u64 {
    let levels = mesh["levels"].as_array().expect("a list");
    let shown = levels.iter().rfind(|shown| number(&shown["number"]) <= level).unwrap_or(mesh);
    number(&shown["triangles"]) * number(&mesh["instances"])
}

/// The shares of a level, by name.
fn shares(space: &Space, level: u64) -> BTreeMap<String, u64> {
    let share = |mesh: &Value| {
        let shares = mesh["shares"].as_array().expect("a list");
        let share = shares.iter().find(|share| number(&share["level"]) == level)?;
        Some((mesh["name"].as_str().expect("a name").to_owned(), number(&share["triangles"])))
    };
    meshes(space).iter().filter_map(share).collect()
}

#[test]
fn a_budget_is_met_and_its_shares_are_told() {
    let space = space(LEVELS);
    space.run_fine(&["pipeline.toml"]);
    let meshes = meshes(&space);
    let whole: u64 = meshes.iter().map(|mesh| drawn(mesh, 0)).sum();
    for (level, ratio) in [(1, 0.5), (2, 0.2)] {
        let budget = whole as f64 * ratio;
        let left: u64 = meshes.iter().map(|mesh| drawn(mesh, level)).sum();
        // One step more was too many: of a hill, which six nodes show, it saves 12 triangles.
        assert!(budget - 12.0 <= left as f64 && left as f64 <= budget, "level {level}: {left} of {budget}");
        let shares = shares(&space, level);
        assert_eq!(shares["hill"], shares["painted"], "the same geometry has the same levels");
        assert_eq!(shares.keys().collect::<Vec<_>>(), ["ball", "hill", "painted"]);
        for mesh in meshes.iter().filter(|mesh| mesh["name"] != "square") {
            let share = shares[mesh["name"].as_str().expect("a name")];
            assert_eq!(drawn(mesh, level), share * number(&mesh["instances"]), "level {level}");
        }
    }
    let explained = space.run_fine(&["explain", "scenes/street.glb"]).stdout;
    let line = format!(
        "street.glb: level 2 shared by the scene: mesh 0 `ball` keeps {} of 912 triangles, 2 times\n",
        shares(&space, 2)["ball"]
    );
    assert!(explained.contains(&line), "{explained}");
    let document = space.run_fine(&["explain", "--json", "scenes/street.glb"]).document();
    assert_eq!(document["shares"].as_array().map(Vec::len), Some(6));
}

#[test]
fn more_of_the_scene_never_leaves_less_of_a_mesh() {
    let space = space("lod = [{ scene_triangles = 1 }]");
    let mut before = BTreeMap::new();
    for budget in [300, 700, 1200, 1900, 2600, 3300, 4000] {
        space.write(
            "pipeline.toml",
            format!("input = 'scenes'\noutput = 'out'\nlod = [{{ scene_triangles = {budget} }}]\nappearance.record = false\n"),
        );
        space.run_fine(&["pipeline.toml"]);
        let now = shares(&space, 1);
        assert_eq!(now.len(), 3);
        for (name, triangles) in &now {
            assert!(before.get(name).is_none_or(|less| less <= triangles), "{budget}: {before:?} then {now:?}");
        }
        assert!(before.is_empty() || before != now, "{budget}: {now:?}");
        before = now;
    }
}

#[test]
fn a_second_run_does_nothing_and_threads_do_not_matter() {
    let (one, four) = (space(LEVELS), space(LEVELS));
    one.run_fine(&["--jobs", "1", "pipeline.toml"]);
    four.run_fine(&["--jobs", "4", "pipeline.toml"]);
    assert!(one.files("out") == four.files("out"));
    let times = one.times("out");
    let again = one.run_fine(&["pipeline.toml", "--json"]).summary();
    assert_eq!((number(&again["baked"]), number(&again["jobs"]), number(&again["scene_bytes_read"])), (0, 0, 0));
    assert_eq!(times, one.times("out"));
    // Another budget cuts the same sequences.
    let rest = "input = 'scenes'\noutput = 'out'\nlod = [{ scene_triangles = 1500 }]\n";
    one.write("pipeline.toml", rest);
    let other = one.run_fine(&["pipeline.toml", "--json"]).summary();
    assert_eq!((number(&other["baked"]), number(&other["jobs"]), number(&other["cache_hits"])), (1, 0, 2));
}

#[test]
fn a_budget_that_cannot_be_met_is_told() {
    let space = space("lod = [{ scene_triangles = 20 }]");
    let told = space.run_fine(&["pipeline.toml"]).stderr;
    // The square alone has 32, and of the rest something is left.
    assert!(told.contains("level 1: the scene keeps ") && told.contains("more than the 20 asked for"), "{told}");
    assert!(meshes(&space).iter().all(|mesh| 0 < drawn(mesh, 1)));
    let plain = self::space("lod = [{ ratio = 0.5 }]");
    plain.run_fine(&["pipeline.toml"]);
    assert!(meshes(&plain).iter().all(|mesh| mesh["shares"] == json!([])));
}

#[test]
fn bytes_are_counted_once_for_each_geometry() {
    let space = space("storage = 'compact'\nlod = [{ scene_bytes = 22_000 }, { scene_bytes = 16_000 }]");
    space.run_fine(&["pipeline.toml"]);
    let meshes = meshes(&space);
    // `painted` is `hill` with another material; the square stays as it is: 32 bytes a vertex, 6 a triangle.
    let bytes = |mesh: &Value, number: u64| -> u64 {
        let levels = mesh["levels"].as_array().expect("a list");
        let level = levels.iter().rfind(|level| self::number(&level["number"]) <= number);
        let source = 32 * self::number(&mesh["vertices"]) + 6 * self::number(&mesh["triangles"]);
        level.map_or(source, |level| self::number(&level["bytes"]))
    };
    for (number, budget) in [(1, 22_000.0), (2, 16_000.0)] {
        let written: u64 = meshes.iter().filter(|m| m["name"] != "painted").map(|mesh| bytes(mesh, number)).sum();
        // Estimated from counts, and exact where levels are not fitted, but for what lies between two counts.
        let share = written as f64 / budget;
        assert!((0.95..1.02).contains(&share), "level {number}: {written} of {budget}");
    }
    let triangles = [1, 2].map(|level| shares(&space, level));
    assert!(triangles[1] != triangles[0] && triangles[1].iter().all(|(name, left)| *left <= triangles[0][name]));
}

#[test]
fn what_is_near_a_camera_keeps_more() {
    let kept = |views: &str| {
        let space = space(&format!("{views}\nlod = [{{ scene_ratio = 0.3 }}]\nappearance.record = false"));
        space.run_fine(&["pipeline.toml"]);
        shares(&space, 1)
    };
    let (nowhere, hills, ball) = (kept(""), kept("scene.cameras = [[0.5, 2, 1]]"), kept("scene.cameras = [[9, 0, 4]]"));
    assert!(nowhere["hill"] < hills["hill"], "{nowhere:?} {hills:?}");
    assert!(hills["ball"] < ball["ball"] && ball["hill"] < hills["hill"], "{hills:?} {ball:?}");
    // From far away everything is equally far: as without views.
    assert_eq!(kept("scene.distances = [1e7]"), nowhere);
}
