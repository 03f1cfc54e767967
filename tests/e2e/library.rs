//! `layout = "library"`: scenes share the files of their meshes, and nobody loses one that another scene has.

use std::fs;
use std::path::Path;

use lodbake::gltf::read::read;
use serde_json::Value;

use crate::scene::{Scene, Shape};
use crate::space::{Run, Space};

const LIBRARY: &str = "layout = 'library'";

fn pipeline(settings: &str) -> String {
    format!("input = 'scenes'\noutput = 'out'\n{settings}\n[[lod]]\nratio = 0.5\n[[lod]]\nratio = 0.2\n")
}

/// A street with a ball and a hill, and a shelf elsewhere, in the other container, with the same ball in another material.
fn space(settings: &str) -> Space {
    let space = Space::new();
    space.write("pipeline.toml", pipeline(settings));
    let mut street = Scene::new();
    let hill = street.mesh("hill", &Shape::grid(12, 0.2));
    let ball = street.mesh("ball", &Shape::sphere(12, 16));
    street.node("hill", hill, [0.0; 3]);
    street.node("ball", ball, [0.0, 1.0, 0.0]);
    street.node("ball", ball, [0.0, 2.0, 0.0]);
    space.write("scenes/town/street.glb", street.glb());
    let mut shelf = Scene::new();
    let ball = shelf.mesh_with_material("painted ball", &Shape::sphere(12, 16), 1);
    let small = shelf.mesh("too small for levels", &Shape::grid(3, 0.0));
    shelf.node("ball", ball, [5.0, 0.0, 0.0]);
    shelf.node("small", small, [6.0, 0.0, 0.0]);
    let (text, buffer) = shelf.gltf_beside("shelf.bin");
    space.write("scenes/shelf.gltf", text);
    space.write("scenes/shelf.bin", buffer);
    space
}

fn shared(space: &Space) -> Vec<String> {
    space.files("out/lodbake-library").into_keys().collect()
}

/// Addresses of the library in a scene, from the output folder on.
fn addresses(space: &Space, scene: &str) -> Vec<String> {
    let scene = read(&space.path(scene)).expect("outputs can be read");
    let buffers = scene.document.json["buffers"].as_array().expect("it has buffers").clone();
    let uris = buffers.iter().filter_map(|buffer| buffer["uri"].as_str());
    uris.filter(|uri| uri.contains("lodbake-library")).map(str::to_owned).collect()
}

fn numbers(run: &Run, names: &[&str]) -> Vec<u64> {
    names.iter().map(|name| run.summary()[name].as_u64().expect("a number")).collect()
}

fn remove(space: &Space, file: &str) {
    fs::remove_file(space.path(file)).unwrap_or_else(|error| panic!("`{file}`: {error}"));
}

#[test]
fn a_mesh_that_two_scenes_have_is_one_file_and_reads_as_before() {
    let (with, without) = (space(LIBRARY), space(""));
    with.run_fine(&["pipeline.toml", "--jobs", "1"]);
    without.run_fine(&["pipeline.toml"]);
    assert!(!without.path("out/lodbake-library").exists());
    let files = shared(&with);
    assert_eq!(files.len(), 2, "a ball and a hill: {files:?}");
    let (street, shelf) = (addresses(&with, "out/town/street.glb"), addresses(&with, "out/shelf.gltf"));
    assert_eq!((street.len(), shelf.len()), (2, 1));
    assert!(street.contains(&format!("%2E%2E/{}", shelf[0])), "{street:?} {shelf:?}");
    for name in ["town/street.glb", "shelf.gltf"] {
        let one = |space: &Space| read(&space.path(&format!("out/{name}"))).expect("outputs can be read");
        let (found, expected) = (one(&with), one(&without));
        assert_eq!(found.meshes, expected.meshes, "{name}");
        for member in ["nodes", "materials", "scenes", "extensionsUsed"] {
            assert_eq!(found.document.json[member], expected.document.json[member], "{name}: {member}");
        }
    }
    // The small mesh and nothing else is left in the scene's own buffer.
    assert_eq!(
        with.files("out").keys().filter(|name| name.starts_with("shelf")).collect::<Vec<_>>(),
        ["shelf.gltf", "shelf.mesh.bin"]
    );
    let length = |space: &Space, name: &str| space.read(name).len();
    assert!(length(&with, "out/shelf.mesh.bin") * 10 < length(&with, "scenes/shelf.bin"));
    assert!(length(&with, "out/town/street.glb") * 4 < length(&without, "out/town/street.glb"));

    // The report counts for each scene what it loads, in sum each file once.
    let report = with.json("out/report.json");
    let bytes = |value: &Value| value["bytes_out"].as_u64().expect("a number");
    let all: u64 =
        with.files("out").iter().filter(|(name, _)| *name != "report.json").map(|(_, b)| b.len() as u64).sum();
    assert_eq!(bytes(&report["totals"]), all);
    let ball = with.read(&format!("out/{}", shelf[0])).len() as u64;
    assert_eq!(bytes(&report["scenes"][0]) + bytes(&report["scenes"][1]), all + ball);

    let again = space(LIBRARY);
    again.run_fine(&["pipeline.toml", "--jobs", "4"]);
    assert_eq!(again.files("out"), with.files("out"), "four threads");
    // What the program itself makes of both.
    assert_eq!(with.difference("scenes/shelf.gltf", "out/shelf.gltf", 64), 0.0);
    with.run_fine(&["check", "pipeline.toml"]);
    let page = with.run_fine(&["report", "pipeline.toml", "--output", "page.html", "--viewer"]);
    assert!(!page.stderr.contains("no live view"), "{}", page.stderr);
}

#[test]
fn nothing_is_written_where_nothing_changed_and_what_is_lost_comes_back() {
    let space = space(LIBRARY);
    space.run_fine(&["pipeline.toml"]);
    let (files, times) = (space.files("out"), space.times("out"));
    let run = space.run_fine(&["pipeline.toml", "--json"]);
    assert_eq!(numbers(&run, &["unchanged", "outputs_written", "jobs", "scene_bytes_read"]), [2, 0, 0, 0]);
    assert_eq!(space.times("out"), times);
    // The index is lost: all is made again, and found as it is.
    let run = space.run_fine(&["pipeline.toml", "--json", "--no-cache"]);
    assert_eq!(numbers(&run, &["baked", "outputs_written"]), [2, 0]);
    assert_eq!(space.times("out"), times);
    for name in shared(&space) {
        remove(&space, &format!("out/lodbake-library/{name}"));
    }
    let run = space.run_fine(&["pipeline.toml", "--json"]);
    assert_eq!(numbers(&run, &["baked", "jobs", "outputs_written"]), [2, 0, 2]);
    assert_eq!(space.files("out"), files);
    // One byte of another value.
    let name = format!("out/lodbake-library/{}", shared(&space)[0]);
    let mut bytes = space.read(&name);
    bytes[17] ^= 1;
    space.write(&name, bytes);
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(space.files("out"), files);
}

#[test]
fn a_file_goes_with_the_last_scene_that_has_it() {
    let space = space(LIBRARY);
    space.run_fine(&["pipeline.toml"]);
    let ball = addresses(&space, "out/shelf.gltf").remove(0);
    let times = space.times("out");
    remove(&space, "scenes/town/street.glb");
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(shared(&space), [Path::new(&ball).file_name().unwrap().to_str().unwrap()]);
    assert_eq!(space.times("out")[&ball], times[&ball], "another scene's change does not touch it");
    remove(&space, "scenes/shelf.gltf");
    space.run(&["pipeline.toml"]);
    assert!(!space.path("out/lodbake-library").exists(), "{:?}", shared(&space));
    // Whatever else lies there is nobody's business.
    let space = self::space(LIBRARY);
    space.write("out/lodbake-library/notes.txt", "mine");
    space.run_fine(&["pipeline.toml"]);
    space.write("pipeline.toml", pipeline(""));
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(shared(&space), ["notes.txt"]);
}

#[test]
fn files_that_a_scene_has_no_more_go_unless_another_scene_has_them() {
    let space = space(LIBRARY);
    space.run_fine(&["pipeline.toml"]);
    let before = shared(&space);
    space.write(
        "pipeline.toml",
        pipeline(&format!("{LIBRARY}\n[[override]]\nmatch = 'shelf.gltf'\nsimplify.normal = 0.5")),
    );
    let street = space.times("out")["town/street.glb"];
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(shared(&space).len(), 3, "the shelf has another ball");
    assert_eq!(space.times("out")["town/street.glb"], street);
    space.write("pipeline.toml", pipeline(LIBRARY));
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(shared(&space), before);
    // An override lays out some scenes in another way.
    space.write(
        "pipeline.toml",
        pipeline(&format!("{LIBRARY}\n[[override]]\nmatch = 'town/**'\nlayout = 'self-contained'")),
    );
    space.run_fine(&["pipeline.toml"]);
    assert_eq!((shared(&space).len(), addresses(&space, "out/town/street.glb").len()), (1, 0));
    // So it is with all outputs: the other container's file goes.
    space.write("pipeline.toml", pipeline(&format!("{LIBRARY}\nformat = 'glb'\nprofile = 'core'")));
    space.run_fine(&["pipeline.toml"]);
    let names: Vec<String> =
        space.files("out").into_keys().filter(|name| !name.starts_with("lodbake-library/")).collect();
    assert_eq!(names, ["report.json", "shelf.glb", "town/street.glb"]);
    assert!(addresses(&space, "out/town/street.glb").iter().all(|address| address.starts_with("../lodbake-library/")));
}

#[test]
fn a_scene_that_fails_keeps_what_it_has() {
    let space = space(LIBRARY);
    space.run_fine(&["pipeline.toml"]);
    let files = space.files("out/lodbake-library");
    let good = space.read("scenes/town/street.glb");
    space.write("scenes/town/street.glb", b"glTF broken");
    // The shelf no longer has a ball, but the old street is still there.
    space.write("scenes/shelf.gltf", Scene::of(&Shape::grid(3, 0.0)).gltf());
    assert_eq!(space.run(&["pipeline.toml"]).code, 3);
    assert_eq!(space.files("out/lodbake-library"), files);
    assert_eq!(space.run(&["pipeline.toml"]).code, 3);
    assert_eq!(space.files("out/lodbake-library"), files);
    space.write("scenes/town/street.glb", good);
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(space.files("out/lodbake-library"), files);
    remove(&space, "scenes/town/street.glb");
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(space.files("out/lodbake-library").len(), 0);
}
