//! Inspections of small scenes made in code.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use super::*;
use crate::gltf::read::read_bytes;
use crate::identify::survey;

/// A row of `triangles` triangles along x, 12 bytes for each of `triangles + 2` vertices.
fn strip(triangles: u16) -> Vec<u8> {
    let vertex = |i: u16| [f32::from(i), f32::from(i % 2), 0.0];
    (0..triangles + 2).flat_map(vertex).flat_map(f32::to_le_bytes).collect()
}

/// Strips of triangles, one accessor for each entry of `strips`; meshes, nodes as given.
fn inspected(strips: &[u16], meshes: &Value, nodes: &Value) -> Inspection {
    let mut bin = Vec::new();
    let mut views = Vec::new();
    let mut accessors = Vec::new();
    for &triangles in strips {
        let bytes = strip(triangles);
        views.push(json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() }));
        let view = views.len() - 1;
        accessors.push(json!({ "bufferView": view, "componentType": 5126, "count": triangles + 2, "type": "VEC3",
            "min": [0, 0, 0], "max": [triangles + 1, 1, 0] }));
        bin.extend(bytes);
    }
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&bin));
    let document = json!({ "asset": { "version": "2.0", "generator": "a test" }, "bufferViews": views,
        "accessors": accessors, "buffers": [{ "byteLength": bin.len(), "uri": uri }], "meshes": meshes, "nodes": nodes });
    let scene = read_bytes(document.to_string().as_bytes(), Path::new("")).expect("the scene is sound");
    let found = survey(&scene).expect("the scene is sound");
    Inspection::new("a.gltf".into(), 1234, &scene, &found).expect("the scene is sound")
}

fn primitive(accessor: usize, mode: u8) -> Value {
    json!({ "attributes": { "POSITION": accessor }, "mode": mode })
}

#[test]
fn copies_are_found_and_their_bytes_counted_once() {
    // Accessors 0 and 1 hold the same strip; mesh 2 declares it again with the accessor of mesh 0.
    let meshes = json!([
        { "name": "one", "primitives": [primitive(0, 5)] },
        { "name": "copy", "primitives": [primitive(1, 5)] },
        { "primitives": [primitive(0, 5)] },
        { "name": "other", "primitives": [primitive(2, 5), primitive(2, 1)] },
    ]);
    let nodes = json!([{ "mesh": 0 }, { "mesh": 1 }, { "mesh": 1 }, { "mesh": 2 }, { "mesh": 3 }, {}]);
    let inspection = inspected(&[100, 100, 10], &meshes, &nodes);
    assert_eq!((inspection.triangles, inspection.triangles_drawn), (310, 410));
    let mut uses: Vec<_> = inspection.distinct.iter().map(|d| (d.triangles, d.uses, d.instances)).collect();
    uses.sort_unstable();
    assert_eq!(uses, [(10, 1, 1), (100, 3, 4)]);
    assert_eq!(inspection.meshes[3].left_alone, ["lines"]);
    assert_eq!(inspection.bake.duplicate_bytes, 102 * 12);
    assert_eq!(inspection.bake.jobs, 1, "ten triangles are not worth a level");
    let half = &inspection.bake.levels[0];
    assert_eq!((half.ratio, half.triangles, half.triangles_drawn), (0.5, 160, 210));
}

#[test]
fn the_text_fits_a_terminal() {
    let name = "a very long name of a mesh\nwith a line feed, as exporters write it";
    let meshes = json!([
        { "name": name, "primitives": [primitive(0, 5), primitive(1, 0)] },
        { "primitives": [primitive(2, 5)] },
        { "name": "points", "primitives": [primitive(2, 0)] },
    ]);
    let inspection = inspected(&[500, 4, 500], &meshes, &json!([{ "mesh": 0 }, { "mesh": 1 }]));
    let text = inspection.to_text();
    insta::assert_snapshot!(text);
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn an_empty_scene_has_no_tables() {
    let text = inspected(&[3], &json!([]), &json!([])).to_text();
    assert!(
        text.ends_with("a bake with default settings\n  sub-meshes  0 found, 0 distinct\n  jobs        0\n"),
        "{text}"
    );
}

#[test]
fn it_obeys_its_schema() {
    let inspection = inspected(&[100], &json!([{ "primitives": [primitive(0, 5)] }]), &json!([{ "mesh": 0 }]));
    let validator = jsonschema::validator_for(&schema()).expect("the schema is one");
    let record = serde_json::to_value(&inspection).expect("it is plain data");
    let errors: Vec<String> = validator.iter_errors(&record).map(|error| error.to_string()).collect();
    assert_eq!(errors, Vec::<String>::new());
}
