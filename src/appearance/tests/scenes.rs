//! Drawables of documents: nodes, levels, instances, skins.

use crate::appearance::assemble;
use crate::appearance::drawable::Drawable;
use crate::gltf::document::DocumentError;
use crate::gltf::read::read_bytes;
use crate::mesh::{LevelPrimitive, LevelVertices};
use base64::Engine as _;
use glam::DVec3;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// A document whose meshes 0, 1, 2 are 1, 2, 3 times the triangle (0,0,0) (1,0,0) (0,1,0). Accessor 2: two
/// translations, (1, 2, 3) and (4, 5, 6); 3: joints (all 0); 4: weights (all the first); 5: two scales.
fn scene(more: &Value) -> crate::gltf::scene::Scene {
    let floats = |values: &[f32]| values.iter().flat_map(|f| f.to_le_bytes()).collect::<Vec<u8>>();
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend([0u8, 1, 2, 0, 1, 2, 0, 1, 2, 0, 0, 0]);
    bytes.extend(floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    bytes.extend([0u8; 12]);
    bytes.extend(floats(&[1.0, 0.0, 0.0, 0.0].repeat(3)));
    bytes.extend(floats(&[2.0; 6]));
    let uri = format!("data:;base64,{}", base64::engine::general_purpose::STANDARD.encode(&bytes));
    let mesh = |count: usize| {
        let primitive = json!({ "attributes": { "POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4 }, "indices": 1 });
        json!({ "primitives": vec![primitive; count] })
    };
    let mut document = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": bytes.len(), "uri": uri }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 36, "componentType": 5121, "count": 3, "type": "SCALAR" },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 2, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 72, "componentType": 5121, "count": 3, "type": "VEC4" },
            { "bufferView": 0, "byteOffset": 84, "componentType": 5126, "count": 3, "type": "VEC4" },
            { "bufferView": 0, "byteOffset": 132, "componentType": 5126, "count": 2, "type": "VEC3" },
        ],
        "meshes": [mesh(1), mesh(2), mesh(3)],
    });
    for (key, value) in more.as_object().unwrap() {
        document[key] = value.clone();
    }
    read_bytes(document.to_string().as_bytes(), Path::new(".")).unwrap()
}

fn drawn(more: &Value, level: usize) -> Result<Drawable, DocumentError> {
    let scene = scene(more);
    assemble::scene(&scene, assemble::looks(&scene, Path::new(".")), level)
}

/// Where the origin of each instance lies.
fn places(drawable: &Drawable) -> Vec<[f64; 3]> {
    drawable.instances.iter().map(|i| i.transform.transform_point3(DVec3::ZERO).to_array()).collect()
}

#[test]
fn transforms_go_down_the_default_scene() {
    let drawable = drawn(
        &json!({
            "scene": 1,
            "scenes": [{ "nodes": [2] }, { "nodes": [0] }],
            "nodes": [
                { "translation": [1, 0, 0], "scale": [2, 2, 2], "children": [1, 3, 4] },
                { "mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0, 2, 0] },
                { "mesh": 1 },
                { "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1] },
                { "mesh": 1, "extensions": { "KHR_node_visibility": { "visible": false } } },
            ],
        }),
        0,
    )
    .unwrap();
    assert_eq!(places(&drawable), [[3.0, 0.0, 0.0], [1.0, 10.0, 0.0]]);
    // The same mesh is the same part.
    assert_eq!((drawable.parts.len(), drawable.triangles()), (1, 2));
    let turned = drawable.instances[0].transform.transform_point3(DVec3::X);
    assert!((turned - DVec3::new(1.0, 0.0, 0.0)).length() < 1e-12);
}

#[test]
fn levels_take_the_place_of_their_node() {
    let nodes = json!([
        { "translation": [7, 0, 0], "children": [1, 4] },
        { "mesh": 2, "extensions": { "MSFT_lod": { "ids": [2, 3] } } },
        { "mesh": 1, "translation": [0, 1, 0] },
        { "mesh": 0 },
        { "mesh": 2, "extensions": { "MSFT_lod": { "ids": [5] } } },
        { "mesh": 1 },
    ]);
    let count = |level| {
        let drawable = drawn(&json!({ "scenes": [{ "nodes": [0] }], "nodes": nodes }), level).unwrap();
        (drawable.triangles(), places(&drawable)[0])
    };
    assert_eq!(count(0), (6, [7.0, 0.0, 0.0]));
    assert_eq!(count(1), (4, [7.0, 1.0, 0.0]));
    assert_eq!(count(2), (3, [7.0, 0.0, 0.0]));
    assert_eq!(count(9), (3, [7.0, 0.0, 0.0]));
    // Without a scene all roots are drawn, levels are none.
    assert_eq!(drawn(&json!({ "nodes": nodes }), 0).unwrap().triangles(), 6);
    let wrong = json!({ "nodes": [{ "mesh": 0, "extensions": { "MSFT_lod": { "ids": [44] } } }] });
    let words = drawn(&wrong, 1).unwrap_err().to_string();
    assert_eq!(words, "nodes[0].extensions.MSFT_lod: level 1 is node 44, which does not exist");
    assert_eq!(drawn(&json!({}), 0).unwrap().triangles(), 6, "meshes without nodes");
}

#[test]
fn batches_are_drawn_once_for_each_instance() {
    let batch = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 2, "SCALE": 5 } } });
    let drawable = drawn(&json!({ "nodes": [{ "mesh": 0, "translation": [10, 0, 0], "extensions": batch }] }), 0);
    let drawable = drawable.unwrap();
    assert_eq!(places(&drawable), [[11.0, 2.0, 3.0], [14.0, 5.0, 6.0]]);
    let edge = drawable.instances[1].transform.transform_vector3(DVec3::X);
    assert_eq!(edge, DVec3::X * 2.0);
}

#[test]
fn skins_stand_where_their_joints_are() {
    let drawable = drawn(
        &json!({
            "skins": [{ "joints": [2] }],
            "nodes": [
                { "mesh": 0, "skin": 0, "translation": [100, 0, 0] },
                { "translation": [0, 3, 0], "children": [2] },
                { "translation": [0, 0, 4] },
            ],
        }),
        0,
    )
    .unwrap();
    assert_eq!(places(&drawable), [[0.0; 3]]);
    assert_eq!(drawable.parts[0].positions[1].to_array(), [1.0, 3.0, 4.0]);
}

#[test]
fn levels_that_were_just_made_share_what_they_can() {
    let scene = scene(&json!({}));
    let source = assemble::mesh(&scene, assemble::looks(&scene, Path::new(".")), 1);
    assert_eq!(source.triangles(), 2);
    let empty = LevelPrimitive { indices: Vec::new(), vertices: LevelVertices::Source };
    let level = assemble::mesh_level(&scene, &source, 1, &[None, Some(&empty)]);
    assert_eq!(level.triangles(), 1);
    assert!(Arc::ptr_eq(&level.parts[0], &source.parts[0]));
    assert_eq!(assemble::mesh(&scene, Arc::clone(&source.looks), 77).triangles(), 0);
}
