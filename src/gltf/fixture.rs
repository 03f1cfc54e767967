//! A small document and levels for it, for the tests of this room.

use super::document::{Container, Document};
use super::lod::{MeshLevel, MeshLevels, PrimitiveLevel};
use crate::mesh::{Attribute, Format, LevelOwnVertices, LevelPrimitive, LevelVertices};
use serde_json::json;
use std::sync::Arc;

/// A unit square of two triangles, with a displacement for morphing:
///
/// ```text
/// 3──2
/// │ ╱│
/// 0──1
/// ```
const POSITIONS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

fn square_bytes() -> Vec<u8> {
    let floats = POSITIONS.iter().flatten().flat_map(|f| f.to_le_bytes());
    let indices = [0u16, 1, 2, 0, 2, 3].into_iter().flat_map(u16::to_le_bytes);
    let morph = POSITIONS.iter().flatten().flat_map(|f| f.to_le_bytes());
    floats.chain(indices).chain(morph).collect()
}

/// One square on one node, as a GLB.
pub(super) fn square() -> Document {
    let mut document = Document::new(Container::Glb, "test");
    let bytes = square_bytes();
    let root = json!({
        "asset": { "version": "2.0", "generator": "test" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "A", "mesh": 0, "translation": [1, 2, 3], "extras": { "id": 7 } }],
        "meshes": [{
            "name": "Square",
            "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }],
        }],
        "materials": [{ "name": "M" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48, "target": 34962 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12, "target": 34963 },
            { "buffer": 0, "byteOffset": 60, "byteLength": 48 },
        ],
        "buffers": [{ "byteLength": bytes.len() }],
    });
    document.json = root;
    document.bin = Some(Arc::from(bytes));
    document
}

fn positions(values: &[[f32; 3]]) -> Attribute {
    let values = values.iter().flatten().copied().collect();
    Attribute { name: "POSITION".into(), components: 3, format: Format::F32, values }
}

/// A triangle with vertices of its own.
pub(super) fn own(targets: usize) -> Arc<LevelPrimitive> {
    let attributes = vec![positions(&POSITIONS[..3])];
    let targets = vec![vec![positions(&POSITIONS[..3])]; targets];
    let vertices = LevelVertices::Own(LevelOwnVertices { count: 3, attributes, targets });
    Arc::new(LevelPrimitive { indices: vec![0, 1, 2], vertices })
}

/// The same triangle by the source's vertices.
pub(super) fn shared() -> Arc<LevelPrimitive> {
    Arc::new(LevelPrimitive { indices: vec![0, 1, 2], vertices: LevelVertices::Source })
}

pub(super) fn level(primitives: &[Arc<LevelPrimitive>], error: f64) -> MeshLevel {
    let primitives = primitives.iter().cloned().map(PrimitiveLevel::Level).collect();
    MeshLevel { primitives, error, facts: None }
}

/// Two levels for `mesh`, of one primitive each.
pub(super) fn chain(mesh: usize, first: &Arc<LevelPrimitive>, second: &Arc<LevelPrimitive>) -> MeshLevels {
    let levels = vec![level(std::slice::from_ref(first), 0.01), level(std::slice::from_ref(second), 0.1)];
    MeshLevels { mesh, radius: 0.75, levels }
}
