//! Exporters let many primitives use parts of one big vertex buffer. Levels that share the source's vertices must
//! point at the same parts.

use lodbake::gltf::document::{Container, Document};
use lodbake::gltf::scene::{Scene, SourcePrimitive};
use lodbake::gltf::{read, rules};
use serde_json::json;
use std::sync::Arc;

/// Vertices along one side of the grid, and rows of quads in each of its strips.
const SIDE: u32 = 41;
const ROWS: u32 = 10;

/// Four primitives, one for each strip of a bumpy grid, all with the same attributes.
fn grid() -> Document {
    let height = |x: u32, y: u32| ((x * 7 + y * 13) % 5) as f32 * 0.02;
    let vertices = (0..SIDE).flat_map(|y| (0..SIDE).flat_map(move |x| [x as f32, y as f32, height(x, y)]));
    let mut bytes: Vec<u8> = vertices.flat_map(f32::to_le_bytes).collect();
    let vertex_bytes = bytes.len();
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": 5126, "count": SIDE * SIDE, "type": "VEC3",
        "min": [0, 0, 0], "max": [SIDE - 1, SIDE - 1, 0.08],
    })];
    let mut primitives = Vec::new();
    for strip in 0..4 {
        let quads = (strip * ROWS..(strip + 1) * ROWS).flat_map(|y| (0..SIDE - 1).map(move |x| y * SIDE + x));
        let corners = |a: u32| [a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE];
        let indices: Vec<u32> = quads.flat_map(corners).collect();
        let offset = bytes.len() - vertex_bytes;
        accessors.push(json!({
            "bufferView": 1, "byteOffset": offset, "componentType": 5125, "count": indices.len(), "type": "SCALAR",
        }));
        bytes.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
        primitives.push(json!({ "attributes": { "POSITION": 0 }, "indices": accessors.len() - 1 }));
    }
    let mut document = Document::new(Container::Glb, "test");
    document.json["buffers"] = json!([{ "byteLength": bytes.len() }]);
    document.json["bufferViews"] = json!([
        { "buffer": 0, "byteLength": vertex_bytes, "target": 34962 },
        { "buffer": 0, "byteOffset": vertex_bytes, "byteLength": bytes.len() - vertex_bytes, "target": 34963 },
    ]);
    document.json["accessors"] = json!(accessors);
    document.json["meshes"] = json!([{ "primitives": primitives }]);
    document.json["nodes"] = json!([{ "mesh": 0 }]);
    document.json["scenes"] = json!([{ "nodes": [0] }]);
    document.bin = Some(Arc::from(bytes));
    document
}

fn bake(storage: &str) -> (Document, Scene) {
    let folder = tempfile::tempdir().unwrap();
    let source = grid();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    std::fs::write(folder.path().join("in/grid.glb"), source.to_glb_bytes().unwrap()).unwrap();
    let pipeline = folder.path().join("pipeline.toml");
    let text =
        format!("input = 'in'\noutput = 'out'\nstorage = '{storage}'\n[[lod]]\nratio = 0.5\n[[lod]]\nratio = 0.25\n");
    std::fs::write(&pipeline, text).unwrap();
    let output = assert_cmd::Command::cargo_bin("lodbake").unwrap().arg(&pipeline).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (source, read::read(&folder.path().join("out/grid.glb")).unwrap())
}

#[test]
fn every_level_of_a_strip_lies_in_its_strip() {
    for storage in ["shared", "compact", "smallest"] {
        let (source, output) = bake(storage);
        assert_eq!(rules::check(&source, &output.document), []);
        assert_eq!(output.meshes.len(), 3, "{storage}");
        for mesh in &output.meshes {
            for (strip, primitive) in mesh.primitives.iter().enumerate() {
                let SourcePrimitive::Triangles(primitive) = primitive else { panic!("triangles") };
                let positions = primitive.positions();
                // New vertices may lie a little outside the old ones.
                let low = strip as f32 * ROWS as f32 - 0.25;
                for &i in &primitive.indices {
                    let y = positions[i as usize][1];
                    assert!(
                        (low..=low + ROWS as f32 + 0.5).contains(&y),
                        "{storage}: {y} in strip {strip} of mesh {}",
                        mesh.index
                    );
                }
            }
        }
    }
}
