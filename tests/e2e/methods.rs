//! Every metric bakes; the instanced-model paper's tables can be made again.

use lodbake::config::Metric;
use serde_json::Value;

use crate::scene::{Scene, Shape};
use crate::space::Space;

/// `extras.lodbake` of the first node that has it.
fn facts(space: &Space, name: &str) -> Value {
    let document = space.json(name);
    let nodes = document["nodes"].as_array().expect("it has nodes");
    nodes.iter().find_map(|node| node.pointer("/extras/lodbake").cloned()).unwrap_or_default()
}

#[test]
fn every_metric_bakes_and_two_state_bounds() {
    let space = Space::new();
    space.write("in/ball.gltf", Scene::of(&Shape::sphere(12, 20)).gltf());
    for metric in Metric::ALL {
        let name = metric.name();
        let pipeline = format!(
            "input = 'in'\noutput = 'out-{name}'\ncache = 'cache-{name}'\nlod = [{{ ratio = 0.5 }}]\n\
             [simplify]\nmetric = '{name}'\n[appearance]\nrecord = false\n"
        );
        space.write("pipeline.toml", pipeline);
        space.run_fine(&["pipeline.toml"]);
        let facts = facts(&space, &format!("out-{name}/ball.gltf"));
        let (triangles, bound) = (&facts["triangles"][0], facts.pointer("/facts/0/bound").and_then(Value::as_f64));
        assert!(triangles.as_u64().is_some_and(|n| 0 < n && n <= 240), "{name}: {facts}");
        assert_eq!(bound.is_some(), matches!(metric, Metric::Aps | Metric::Gaps), "{name}: {facts}");
        assert!(bound.is_none_or(|bound| 0.0 < bound && bound < 1.0), "{name}: {facts}");
        if *metric == Metric::Aps {
            // Texture deviation is never less than the distance between the surfaces.
            let error = facts["errors"][0].as_f64().expect("a length");
            assert!(error <= bound.expect("it was there a moment ago"), "{facts}");
        }
    }
}

#[test]
fn the_papers_tables_are_made_again() {
    let space = Space::new();
    space.write("ball.glb", Scene::of(&Shape::sphere(16, 24)).glb());
    let args = ["reproduce", "ball.glb", "-o", "out", "--instances", "3", "--many", "6", "--repetitions", "1"];
    let run = space.run_fine(&[&args[..], &["--json"]].concat());
    let record = run.document();
    let rows = record["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 15, "five methods at three shares");
    let source = record["source"][0].as_f64().expect("vertices");
    for row in rows {
        let share = match row["percent"].as_u64() {
            Some(10) => 2247.0 / 2503.0,
            Some(20) => 1998.0 / 2503.0,
            _ => 1244.0 / 2503.0,
        };
        let vertices = row["vertices"].as_f64().expect("a number");
        // A ball has slivers at its poles: what contracts them may leave more vertices without a face than the one that goes.
        assert!(vertices < source * share + 2.0 && 0.9 * source * share < vertices, "{row}");
    }
    let bytes = |at: usize, of: &str| record["growth"][at][of].as_u64().expect("bytes");
    for (few, many) in [(0, 1), (2, 3)] {
        assert_eq!(bytes(few, "mesh_bytes"), bytes(many, "mesh_bytes"), "the mesh does not grow with its instances");
        assert!(bytes(few, "transform_bytes") < bytes(many, "transform_bytes"));
    }
    let instanced = String::from_utf8(space.read("out/its-50.obj")).expect("text");
    assert_eq!(instanced.lines().filter(|line| line.starts_with("#@ instance ")).count(), 3);
    let flattened = String::from_utf8(space.read("out/its-50-flattened.obj")).expect("text");
    let count = |text: &str, mark: &str| text.lines().filter(|line| line.starts_with(mark)).count();
    assert_eq!(count(&flattened, "f "), 3 * count(&instanced, "f "));
    // Other readers take what is written: lodbake's own among them.
    for name in ["its-50.obj", "its-50-flattened.obj", "its-50.glb", "its-50-flattened.glb", "gaps-10.glb"] {
        space.run_fine(&["inspect", &format!("out/{name}")]);
    }
    assert!(String::from_utf8_lossy(&space.read("out/tables.md")).contains("| `its` |"));
    let again = space.run(&["reproduce", "nothing.obj"]);
    assert_eq!(again.code, 3, "{again:#?}");
}
