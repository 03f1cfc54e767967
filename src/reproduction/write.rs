//! The outputs of the paper: OBJ in two dialects and glTF, instanced and flattened.
//!
//! The paper's dialects (its section 5): a classical OBJ of indexed triangles with every instance expanded, and an OBJ of
//! the reference mesh to which the transforms of its instances are added. Those are lines `#@ instance` with the sixteen
//! numbers of the matrix, rows first: comments to every other reader, which therefore shows the reference mesh. Knows
//! neither levels nor time.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::{Value, json};

use super::copies::Copy;
use crate::gltf::document::{Container, Document, DocumentError};
use crate::mesh::Primitive;

/// How an instance's line begins.
const INSTANCE: &str = "#@ instance";

/// An OBJ of one primitive; `copies` are added as lines of their own.
pub fn obj(mesh: &Primitive, copies: &[Copy]) -> String {
    let mut out = String::new();
    let mut lines = |mark: &str, values: &[f32], n: usize| {
        for row in values.chunks_exact(n) {
            out.push_str(mark);
            for (k, value) in row.iter().enumerate() {
                // OBJ counts texture coordinates from the lower edge of the picture, glTF from the upper one.
                let value = if mark == "vt" && k == 1 { 1.0 - value } else { *value };
                write!(out, " {value}").expect("a String takes any text");
            }
            out.push('\n');
        }
    };
    let of = |name: &str| mesh.attribute(name);
    for (mark, name) in [("v", "POSITION"), ("vt", "TEXCOORD_0"), ("vn", "NORMAL")] {
        if let Some(attribute) = of(name) {
            lines(mark, &attribute.values, attribute.components);
        }
    }
    let (textured, lit) = (of("TEXCOORD_0").is_some(), of("NORMAL").is_some());
    for t in mesh.indices.chunks_exact(3) {
        out.push('f');
        for i in t.iter().map(|i| i + 1) {
            match (textured, lit) {
                (true, true) => write!(out, " {i}/{i}/{i}"),
                (true, false) => write!(out, " {i}/{i}"),
                (false, true) => write!(out, " {i}//{i}"),
                (false, false) => write!(out, " {i}"),
            }
            .expect("a String takes any text");
        }
        out.push('\n');
    }
    for copy in copies {
        out.push_str(INSTANCE);
        for value in copy.matrix().into_iter().flatten() {
            write!(out, " {value}").expect("a String takes any text");
        }
        out.push('\n');
    }
    out
}

/// A GLB of one primitive: a node for each copy, or one node if there are none.
pub fn glb(mesh: &Primitive, copies: &[Copy]) -> Result<Vec<u8>, DocumentError> {
    let mut document = Document::new(Container::Glb, concat!("lodbake ", env!("CARGO_PKG_VERSION")));
    let mut bin: Vec<u8> = Vec::new();
    let mut attributes = serde_json::Map::new();
    for attribute in &mesh.attributes {
        let kind = if attribute.components == 2 { "VEC2" } else { "VEC3" };
        let bytes: Vec<u8> = attribute.values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = view(&mut document, &mut bin, &bytes, 34962)?;
        let mut accessor = json!({ "bufferView": view, "componentType": 5126, "count": mesh.count, "type": kind });
        if attribute.name == "POSITION" {
            let bound = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..3).map(|k| attribute.values.iter().skip(k).step_by(3).fold(start, |a, &b| pick(a, b))).collect()
            };
            accessor["min"] = json!(bound(f32::INFINITY, f32::min));
            accessor["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        }
        attributes.insert(attribute.name.clone(), json!(document.push("accessors", accessor)?));
    }
    let narrow = mesh.count <= 65535;
    let bytes: Vec<u8> = if narrow {
        mesh.indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
    } else {
        mesh.indices.iter().flat_map(|i| i.to_le_bytes()).collect()
    };
    let view = view(&mut document, &mut bin, &bytes, 34963)?;
    let component = if narrow { 5123 } else { 5125 };
    let indices =
        json!({ "bufferView": view, "componentType": component, "count": mesh.indices.len(), "type": "SCALAR" });
    let indices = document.push("accessors", indices)?;
    document.push("meshes", json!({ "primitives": [{ "attributes": attributes, "indices": indices }] }))?;
    let nodes: Vec<Value> = if copies.is_empty() {
        vec![json!({ "mesh": 0 })]
    } else {
        let node = |copy: &Copy| {
            let m = copy.matrix();
            let columns: Vec<f64> = (0..4).flat_map(|c| (0..4).map(move |r| m[r][c])).collect();
            json!({ "mesh": 0, "matrix": columns })
        };
        copies.iter().map(node).collect()
    };
    let count = nodes.len();
    document.array_mut("nodes")?.extend(nodes);
    document.json["scene"] = json!(document.push("scenes", json!({ "nodes": (0..count).collect::<Vec<_>>() }))?);
    document.push("buffers", json!({ "byteLength": bin.len() }))?;
    document.bin = Some(Arc::from(bin));
    document.to_glb_bytes()
}

fn view(document: &mut Document, bin: &mut Vec<u8>, bytes: &[u8], target: u32) -> Result<usize, DocumentError> {
    let offset = bin.len();
    bin.extend_from_slice(bytes);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target });
    document.push("bufferViews", view)
}
