//! Looking into scenes without baking them.

use crate::scene::{Scene, Shape};
use crate::space::Space;

fn street() -> Scene {
    let mut scene = Scene::new();
    let lamp = scene.mesh("lamp", &Shape::sphere(8, 12));
    for i in 0..3 {
        scene.node("lamp", lamp, [i as f32, 0.0, 0.0]);
    }
    let copy = scene.mesh_with_material("copy", &Shape::sphere(8, 12), 1);
    scene.node("copy", copy, [9.0, 0.0, 0.0]);
    scene
}

#[test]
fn a_scene_is_told_in_a_table() {
    let space = Space::new();
    space.write("street.glb", street().glb());
    let run = space.run_fine(&["inspect", "street.glb"]);
    insta::assert_snapshot!(run.stdout);
    assert_eq!(run.stderr, "");
    assert_eq!(space.files("").len(), 1, "nothing is written");
}

#[test]
fn both_forms_hold_the_same_meshes() {
    let space = Space::new();
    let (text, buffer) = street().gltf_beside("street%20buffer.bin");
    space.write("a.glb", street().glb());
    space.write("b.gltf", street().gltf());
    space.write("c.gltf", text);
    space.write("street buffer.bin", &buffer);
    let all = space.run_fine(&["inspect", "--json", "a.glb", "b.gltf", "c.gltf"]).document();
    let all = all.as_array().expect("several files are a list");
    assert_eq!(all.len(), 3);
    for other in &all[1..] {
        assert_eq!(other["distinct"], all[0]["distinct"]);
    }
    let sizes: Vec<_> = all.iter().map(|inspection| inspection["bytes"].as_u64()).collect();
    assert_eq!(sizes[2], Some((space.read("c.gltf").len() + buffer.len()) as u64), "the buffer counts");

    let one = space.run_fine(&["--json", "inspect", "a.glb"]).document();
    assert_eq!(one, all[0], "a single file is no list");
    assert_eq!(one["triangles"].as_u64(), Some(2 * Shape::sphere(8, 12).triangles() as u64));
    assert_eq!(one["distinct"][0]["uses"], 2);
    assert_eq!(one["distinct"][0]["instances"], 4);
}

#[test]
fn a_broken_file_does_not_stop_the_others() {
    let space = Space::new();
    let mut short = street().glb();
    short.truncate(short.len() - 100);
    space.write("good.glb", street().glb());
    space.write("short.glb", short);
    let run = space.run(&["inspect", "short.glb", "good.glb", "missing.glb"]);
    assert_eq!(run.code, 3);
    assert!(run.stdout.starts_with("good.glb  "), "{}", run.stdout);
    assert!(run.stderr.contains("error: failed to read `short.glb`: "), "{}", run.stderr);
    assert!(run.stderr.contains("error: failed to read `missing.glb`: there is no such file\n"), "{}", run.stderr);
}

#[test]
fn it_asks_for_a_file() {
    let run = Space::new().run(&["inspect"]);
    assert_eq!((run.code, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.contains("<FILE>"), "{}", run.stderr);
}
