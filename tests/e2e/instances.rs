//! Instances that no file declares, recovered by a bake.

use serde_json::{Value, json};

use crate::scene::{Scene, Shape};
use crate::space::Space;

/// Two hills, the second moved in its own space, on five nodes; the last one has another material.
fn hills() -> Scene {
    let mut scene = Scene::new();
    let hill = scene.mesh("hill", &Shape::grid(12, 0.2));
    let moved = scene.mesh("moved", &Shape::grid(12, 0.2).shifted(3.0));
    let painted = scene.mesh_with_material("painted", &Shape::grid(12, 0.2).shifted(5.0), 1);
    for (i, mesh) in [hill, moved, moved, painted].into_iter().enumerate() {
        scene.node(&format!("node {i}"), mesh, [0.0, i as f32, 0.0]);
    }
    scene
}

fn space(settings: &str) -> Space {
    let space = Space::new();
    space.write("pipeline.toml", format!("input = 'scenes'\noutput = 'out'\n{settings}\n[[lod]]\nratio = 0.5\n"));
    space.write("scenes/hills.glb", hills().glb());
    let (text, buffer) = hills().gltf_beside("hills.bin");
    space.write("scenes/hills.gltf", text);
    space.write("scenes/hills.bin", buffer);
    space
}

const RECOVER: &str = "[instances]\nrecover = 'rigid'";

fn length(space: &Space, name: &str) -> usize {
    space.read(name).len()
}

#[test]
fn moved_copies_become_nodes_of_the_first_and_their_bytes_go() {
    let (with, without) = (space(RECOVER), space(""));
    let told = with.run_fine(&["pipeline.toml"]);
    without.run_fine(&["pipeline.toml"]);
    assert!(told.stderr.contains("4 recovered of 4 found"), "{}", told.stderr);
    assert!(length(&with, "out/hills.glb") * 2 < length(&without, "out/hills.glb"));
    let document = with.json("out/hills.gltf");
    let buffers: Vec<&str> =
        document["buffers"].as_array().unwrap().iter().map(|buffer| buffer["uri"].as_str().unwrap()).collect();
    assert_eq!(buffers, ["hills.mesh.bin", "hills.lod.bin"]);
    assert!(length(&with, "out/hills.mesh.bin") * 3 <= length(&with, "scenes/hills.bin") + 64);
    assert!(!with.path("out/hills.bin").exists());
    // The node stays, its mesh is two nodes below: the transform, then the levels.
    let node = &document["nodes"][1];
    assert_eq!(
        (&node["name"], &node["translation"], node.get("mesh")),
        (&json!("node 1"), &json!([0.0, 1.0, 0.0]), None)
    );
    let moved = &document["nodes"][node["children"][0].as_u64().unwrap() as usize];
    assert_eq!(moved["translation"], json!([3.0, 0.0, 0.0]));
    let shown = &document["nodes"][moved["children"][0].as_u64().unwrap() as usize];
    assert_eq!((&shown["mesh"], shown["extensions"]["MSFT_lod"]["ids"].as_array().unwrap().len()), (&json!(0), 1));
    // Another material: a mesh of its own over the first one's accessors.
    assert_eq!(
        document["meshes"][2]["primitives"][0]["attributes"],
        document["meshes"][0]["primitives"][0]["attributes"]
    );
    assert_eq!(document["meshes"][2]["primitives"][0]["material"], 1);
    let meshes = with.json("out/report.json")["scenes"][0]["meshes"].clone();
    let found: Vec<&Value> = meshes.as_array().unwrap().iter().map(|mesh| &mesh["instance_of"]).collect();
    assert_eq!(
        (found[0], &found[1]["mesh"], &found[1]["kind"], &found[1]["kept"]),
        (&Value::Null, &json!(0), &json!("rigid"), &Value::Null)
    );
    assert!(found[2]["residual"]["position"].as_f64().unwrap() < 1e-6);
}

#[test]
fn what_is_not_asked_for_is_told_and_left() {
    let (exact, none) = (space("[instances]\nrecover = 'exact'"), space(""));
    let told = exact.run_fine(&["pipeline.toml"]);
    none.run_fine(&["pipeline.toml"]);
    assert!(told.stderr.contains("0 recovered of 4 found"), "{}", told.stderr);
    let (document, other) = (exact.json("out/hills.gltf"), none.json("out/hills.gltf"));
    assert_eq!(document["nodes"], other["nodes"]);
    // Normals, texture coordinates and indices are equal all the same: they are kept once.
    let attributes = |mesh: usize| document["meshes"][mesh]["primitives"][0]["attributes"].clone();
    assert_eq!(attributes(1)["NORMAL"], attributes(0)["NORMAL"]);
    assert_ne!(attributes(1)["POSITION"], attributes(0)["POSITION"]);
    assert!(length(&exact, "out/hills.glb") < length(&none, "out/hills.glb"));
    let kept = exact.json("out/report.json")["scenes"][0]["meshes"][1]["instance_of"]["kept"].clone();
    assert_eq!(kept, "`recover` does not ask for it");
}

/// A field of hills without names: 60 near each other, 3 far away, one with `extras`.
fn field() -> Scene {
    let mut scene = Scene::new();
    let hill = scene.mesh("hill", &Shape::grid(12, 0.2));
    for i in 0..60u8 {
        scene.nameless(hill, [f32::from(i % 10), f32::from(i / 10), 0.0]);
    }
    for i in 0..3u8 {
        scene.nameless(hill, [60.0, 60.0, f32::from(i)]);
    }
    let last = scene.nameless(hill, [0.0; 3]);
    scene.set(last, "extras", json!({ "id": 1 }));
    scene
}

#[test]
fn batches_switch_levels_as_one_and_the_report_tells_what_is_none() {
    let space = Space::new();
    let pipeline = |settings: &str| {
        format!(
            "input = 'scenes'\noutput = 'out'\n[instances]\ninstancing = 'gpu'\n{settings}\n[[lod]]\nratio = 0.5\n[[lod]]\nratio = 0.2\n"
        )
    };
    space.write("pipeline.toml", pipeline(""));
    space.write("scenes/field.glb", field().glb());
    space.write("scenes/field.gltf", field().gltf());
    let told = space.run_fine(&["pipeline.toml"]);
    assert!(told.stderr.contains("120 nodes in 2 batches"), "{}", told.stderr);
    assert!(told.stderr.contains("stay nodes    8; 6 of them: too few"), "{}", told.stderr);
    let document = space.json("out/field.gltf");
    assert_eq!(document["extensionsRequired"], json!(["EXT_mesh_gpu_instancing"]));
    let nodes = document["nodes"].as_array().unwrap();
    assert_eq!((&nodes[0]["translation"][0], &nodes[0]["translation"][1]), (&json!(5.0), &json!(3.0)));
    let child = &nodes[nodes[0]["children"][0].as_u64().unwrap() as usize];
    let batch = &child["extensions"]["EXT_mesh_gpu_instancing"];
    let count = |name: &str| {
        let accessor = batch["attributes"][name].as_u64().unwrap() as usize;
        document["accessors"][accessor]["count"].as_u64().unwrap()
    };
    assert_eq!(["TRANSLATION", "ROTATION", "SCALE"].map(count), [60; 3]);
    let levels = child["extensions"]["MSFT_lod"]["ids"].as_array().unwrap();
    assert_eq!(levels.len(), 2);
    for level in levels {
        assert_eq!(&nodes[level.as_u64().unwrap() as usize]["extensions"]["EXT_mesh_gpu_instancing"], batch);
    }
    // What stays has its index.
    assert_eq!((&nodes[63]["extras"]["id"], &nodes[59]), (&json!(1), &json!({})));
    let record = space.json("out/report.json")["scenes"][0].clone();
    assert_eq!((&record["batches"]["batches"], &record["batches"]["instances"]), (&json!(1), &json!(60)));
    assert_eq!((&record["meshes"][0]["instances"], &record["meshes"][0]["draw_calls"]), (&json!(64), &json!(5)));
    assert_eq!(record["batches"]["stayed"]["they have `extras` or a camera"], 1);
    assert!(space.run_fine(&["pipeline.toml"]).stderr.contains("no work"));
    // The same scene by the eye of the program itself.
    let d_rms = space.difference("scenes/field.glb", "out/field.glb", 64);
    assert!(d_rms < 0.05, "{d_rms}");
    space.write("pipeline.toml", pipeline("required = false"));
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(space.json("out/field.gltf").get("extensionsRequired"), None);
}

/// A plate with 24 studs and one that is dented, all one mesh, on two nodes.
fn machine() -> Scene {
    let mut shape = Shape::grid(8, 0.0).moved(30.0, 0, [-4.0, -4.0, -1.0]);
    for i in 0..25u8 {
        let (x, y) = (f32::from(i % 5) * 4.0, f32::from(i / 5) * 4.0);
        let mut stud = Shape::sphere(8, 10).moved(1.0, usize::from(i), [x, y, 0.0]);
        if i == 12 {
            stud = stud.dented(7, 1e-3);
        }
        shape = shape.with(&stud);
    }
    let mut scene = Scene::new();
    let mesh = scene.mesh("machine", &shape);
    scene.node("left", mesh, [0.0; 3]);
    scene.node("right", mesh, [40.0, 0.0, 5.0]);
    scene
}

#[test]
fn parts_of_one_mesh_become_instances() {
    let settings = |more: &str| {
        format!("input = 'scenes'\noutput = 'out'\n[instances]\nrecover = 'rigid'\n{more}\n[[lod]]\nratio = 0.5\n")
    };
    let spaces: Vec<Space> = ["", "split = true", "split = true\ninstancing = 'gpu'"]
        .iter()
        .map(|more| {
            let space = Space::new();
            space.write("pipeline.toml", settings(more));
            space.write("scenes/machine.glb", machine().glb());
            space.write("scenes/machine.gltf", machine().gltf());
            let told = space.run_fine(&["pipeline.toml", "--jobs", "3"]);
            assert_eq!(told.stderr.contains("48 (2 different) on 96 nodes"), !more.is_empty(), "{}", told.stderr);
            assert!(space.run_fine(&["pipeline.toml"]).stderr.contains("no work"));
            let d_rms = space.difference("scenes/machine.glb", "out/machine.glb", 96);
            assert!(d_rms < 0.05, "{more}: {d_rms}");
            space
        })
        .collect();
    let [whole, nodes, gpu] = &spaces[..] else { panic!("three") };
    assert!(length(nodes, "out/machine.glb") < length(whole, "out/machine.glb"));
    assert!(length(gpu, "out/machine.glb") < length(nodes, "out/machine.glb"));
    let document = nodes.json("out/machine.gltf");
    assert_eq!(document["nodes"][0]["children"].as_array().unwrap().len(), 1 + 24, "its levels and the studs");
    assert_eq!(document["meshes"][1]["name"], "machine_part_0_128");
    let record = nodes.json("out/report.json")["scenes"][0].clone();
    let part = &record["parts"]["groups"][0];
    assert_eq!((&part["mesh"], &part["instances"], &part["nodes"]), (&json!(1), &json!(24), &json!(48)));
    assert_eq!(part["kinds"]["rigid"], 23);
    assert!(part["residual"]["position"].as_f64().unwrap() < 1e-5);
    assert!(record["parts"]["bytes_after"].as_u64().unwrap() * 3 < record["parts"]["bytes_before"].as_u64().unwrap());
    let drawn = |space: &Space| space.json("out/report.json")["totals"]["triangles_drawn"][0].clone();
    assert_eq!((drawn(whole), drawn(whole)), (drawn(nodes), drawn(gpu)));
    // Two nodes with 24 studs each.
    let record = gpu.json("out/report.json")["scenes"][0].clone();
    assert_eq!((&record["batches"]["batches"], &record["batches"]["instances"]), (&json!(2), &json!(48)));
    let one = Space::new();
    one.write("pipeline.toml", settings("split = true"));
    for name in ["machine.glb", "machine.gltf"] {
        one.write(&format!("scenes/{name}"), nodes.read(&format!("scenes/{name}")));
    }
    one.run_fine(&["pipeline.toml", "--jobs", "1"]);
    assert_eq!(one.files("out"), nodes.files("out"));
}

#[test]
fn the_same_bytes_with_any_number_of_threads_and_nothing_to_do_after_it() {
    let (one, many) = (space(RECOVER), space(RECOVER));
    one.run_fine(&["pipeline.toml", "--jobs", "1"]);
    many.run_fine(&["pipeline.toml", "--jobs", "4"]);
    assert_eq!(one.files("out"), many.files("out"));
    assert!(one.run_fine(&["pipeline.toml"]).stderr.contains("no work"));
}
