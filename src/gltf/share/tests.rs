//! Documents before and after.

use super::super::document::Container;
use super::super::fixture::square;
use super::super::read::from_document;
use super::super::scene::SourcePrimitive;
use super::*;
use glam::{DQuat, DVec3};
use std::path::Path;
use std::sync::Arc;

const MOVED: Similarity =
    Similarity { scale: 2.0, mirror: false, rotation: DQuat::IDENTITY, translation: DVec3::new(5.0, 0.0, 0.0) };

/// The fixture's square, and the same square moved, as a second mesh with bytes of its own: on the nodes 1 and 2.
fn twice() -> Document {
    let mut document = square();
    let own = document.bin.clone().unwrap();
    let mut bin = own[..60].to_vec();
    for i in 0..12 {
        let value = f32::from_le_bytes(own[i * 4..i * 4 + 4].try_into().unwrap());
        let to = if i % 3 == 0 { 2.0 * value + 5.0 } else { 2.0 * value };
        bin.extend(to.to_le_bytes());
    }
    bin.extend_from_slice(&own[48..60]);
    document.json["bufferViews"] = json!([
        { "buffer": 0, "byteLength": 48 },
        { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
        { "buffer": 0, "byteOffset": 60, "byteLength": 48, "name": "kept" },
        { "buffer": 0, "byteOffset": 108, "byteLength": 12 },
        { "buffer": 0, "byteOffset": 120, "byteLength": 8 },
    ]);
    bin.extend(*b"an image");
    document.json["images"] = json!([{ "bufferView": 4, "mimeType": "image/png" }]);
    let mut copy = document.json["accessors"].as_array().unwrap()[..2].to_vec();
    copy[0]["bufferView"] = json!(2);
    copy[0]["min"] = json!([5, 0, 0]);
    copy[0]["max"] = json!([7, 2, 0]);
    copy[1]["bufferView"] = json!(3);
    let first = document.json["accessors"].as_array().unwrap()[..2].to_vec();
    document.json["accessors"] = json!([first[0], first[1], copy[0], copy[1]]);
    let mesh =
        json!({ "name": "Copy", "primitives": [{ "attributes": { "POSITION": 2 }, "indices": 3, "material": 0 }] });
    document.push("meshes", mesh).unwrap();
    document.push("nodes", json!({ "name": "B", "mesh": 1, "rotation": [0, 1, 0, 0], "extras": { "id": 8 } })).unwrap();
    document.push("nodes", json!({ "mesh": 1, "children": [1] })).unwrap();
    document.json["scenes"][0]["nodes"] = json!([0, 2]);
    document.json["buffers"] = json!([{ "byteLength": bin.len() }]);
    document.bin = Some(Arc::from(bin));
    document
}

fn copy(by: Similarity) -> Copy {
    Copy { mesh: 1, of: 0, by }
}

fn shared(document: &mut Document, by: Similarity) -> Buffers {
    let buffers = Buffers::load(document, Path::new("")).unwrap();
    assert_eq!(Sharing::new(document).unwrap().obstacle(&copy(by)), None);
    share(document, &buffers, &[copy(by)]).unwrap().buffers
}

#[test]
fn nodes_keep_all_that_is_theirs_and_show_the_first_mesh_on_a_child() {
    let mut document = twice();
    let before = document.clone();
    let buffers = shared(&mut document, MOVED);
    let nodes = document.array("nodes").unwrap();
    assert_eq!(nodes[0], before.json["nodes"][0]);
    assert_eq!(nodes[1], json!({ "name": "B", "rotation": [0, 1, 0, 0], "extras": { "id": 8 }, "children": [3] }));
    assert_eq!(nodes[2], json!({ "children": [1, 4] }));
    let child = json!({ "mesh": 0, "translation": [5.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0] });
    assert_eq!(nodes[3..], [child.clone(), child]);
    // The copy's 60 bytes are gone (56: cuts keep what stands behind them aligned to eight); the image is not.
    assert_eq!(buffers.bytes(0).unwrap().len(), 128 - 56);
    assert_eq!(buffers.bytes(0).unwrap(), &document.bin.as_ref().unwrap()[..]);
    let image = &document.json["bufferViews"][4];
    let at = image["byteOffset"].as_u64().unwrap() as usize;
    assert_eq!(&buffers.bytes(0).unwrap()[at..at + 8], b"an image");
    // What lost its bytes stands for the first mesh's.
    assert_eq!(document.json["accessors"][2], document.json["accessors"][0]);
    assert_eq!(document.json["bufferViews"][2]["byteOffset"], Value::Null);
    assert_eq!(document.json["bufferViews"][2]["name"], "kept");
    assert_eq!(document.json["meshes"][1]["name"], "Copy");
    let scene = from_document(document, buffers, Path::new("")).unwrap();
    assert_eq!(scene.meshes[0].primitives, scene.meshes[1].primitives);
    let SourcePrimitive::Triangles(read) = &scene.meshes[1].primitives[0] else { panic!("no triangles") };
    assert_eq!(read.positions()[2], [1.0, 1.0, 0.0]);
}

#[test]
fn without_a_transform_the_node_shows_the_first_mesh_itself() {
    let mut document = twice();
    shared(&mut document, Similarity::IDENTITY);
    assert_eq!(document.json["nodes"][1]["mesh"], 0);
    assert_eq!(document.array("nodes").unwrap().len(), 3);
}

#[test]
fn other_looks_keep_a_mesh_of_their_own_over_shared_bytes() {
    let mut document = twice();
    document.push("materials", json!({})).unwrap();
    document.json["meshes"][1]["primitives"][0]["material"] = json!(1);
    let buffers = shared(&mut document, MOVED);
    assert_eq!(document.json["nodes"][3]["mesh"], 1);
    let primitive = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "material": 1 });
    assert_eq!(document.json["meshes"][1]["primitives"], json!([primitive]));
    assert_eq!(buffers.bytes(0).unwrap().len(), 128 - 56);
}

#[test]
fn what_a_transform_would_break_is_an_obstacle() {
    let obstacle = |change: &dyn Fn(&mut Document), by| {
        let mut document = twice();
        change(&mut document);
        Sharing::new(&document).unwrap().obstacle(&copy(by))
    };
    let skin = |document: &mut Document| document.json["nodes"][2]["skin"] = json!(0);
    assert_eq!(obstacle(&skin, MOVED), Some("a skin ignores the transforms of nodes"));
    assert_eq!(obstacle(&skin, Similarity::IDENTITY), None);
    let morph = |document: &mut Document| document.json["meshes"][1]["primitives"][0]["targets"] = json!([{}]);
    assert!(obstacle(&morph, MOVED).is_some());
    let instanced =
        |document: &mut Document| document.json["nodes"][1]["extensions"] = json!({ "EXT_mesh_gpu_instancing": {} });
    assert!(obstacle(&instanced, MOVED).is_some());
    let lamp = |document: &mut Document| document.json["nodes"][1]["extensions"] = json!({ "KHR_lights_punctual": {} });
    assert_eq!(obstacle(&lamp, MOVED), None);
}

#[test]
fn what_is_not_understood_is_left_alone() {
    let eligible = |change: &dyn Fn(&mut Document)| {
        let mut document = twice();
        change(&mut document);
        let sharing = Sharing::new(&document).unwrap();
        [0, 1].map(|mesh| sharing.is_eligible(mesh))
    };
    assert_eq!(eligible(&|_| {}), [true, true]);
    assert_eq!(eligible(&|document| document.json["meshes"][1]["other"] = json!(1)), [true, false]);
    let vendor = |document: &mut Document| document.json["extensionsUsed"] = json!(["VENDOR_geometry"]);
    assert_eq!(eligible(&vendor), [false, false]);
    let levels = |document: &mut Document| {
        document.json["nodes"][0]["extensions"] = json!({ "MSFT_lod": { "ids": [1] } });
    };
    assert_eq!(eligible(&levels), [false, false]);
}

/// Two meshes in one view, one behind the other and interleaved: what the second needed goes, the rest moves up.
#[test]
fn one_view_of_many_meshes_shrinks() {
    let mut document = Document::new(Container::Gltf, "test");
    let bytes: Vec<u8> = (0..96).collect();
    document.json["bufferViews"] = json!([{ "buffer": 0, "byteLength": 96, "byteStride": 8 }]);
    let accessor = |offset: u32| json!({ "bufferView": 0, "byteOffset": offset, "componentType": 5126, "count": 4, "type": "SCALAR" });
    document.json["accessors"] =
        json!([accessor(0), accessor(4), accessor(32), accessor(36), accessor(64), accessor(68)]);
    let mesh = |a: u32| json!({ "primitives": [{ "attributes": { "POSITION": a, "_B": a + 1 } }] });
    document.json["meshes"] = json!([mesh(0), mesh(2), mesh(4)]);
    document.json["buffers"] = json!([{ "byteLength": 96, "uri": super::super::package::data_uri(&bytes) }]);
    let buffers = Buffers::load(&document, Path::new("")).unwrap();
    let copies = [Copy { mesh: 1, of: 0, by: Similarity::IDENTITY }];
    let after = share(&mut document, &buffers, &copies).unwrap().buffers;
    let expected: Vec<u8> = (0..32).chain(64..96).collect();
    assert_eq!(after.bytes(0), Some(expected.as_slice()));
    assert_eq!(document.json["bufferViews"][0]["byteLength"], 64);
    let offsets: Vec<u64> =
        document.array("accessors").unwrap().iter().map(|a| a["byteOffset"].as_u64().unwrap()).collect();
    assert_eq!(offsets, [0, 4, 0, 4, 32, 36]);
    assert_eq!(Buffers::load(&document, Path::new("")).unwrap().bytes(0), Some(expected.as_slice()));
}

#[test]
fn equal_accessors_are_kept_once() {
    let mut document = twice();
    let buffers = Buffers::load(&document, Path::new("")).unwrap();
    let after = share(&mut document, &buffers, &[]).unwrap();
    assert!(after.is_changed);
    let primitive = |mesh: usize| document.json["meshes"][mesh]["primitives"][0].clone();
    // The twelve bytes of indices are equal, the positions are not.
    assert_eq!((primitive(0)["indices"].clone(), primitive(1)["indices"].clone()), (json!(1), json!(1)));
    assert_eq!(primitive(1)["attributes"]["POSITION"], 2);
    assert_eq!(after.buffers.bytes(0).unwrap().len(), 128 - 8);
    let nothing = share(&mut document, &after.buffers, &[]).unwrap();
    assert!(!nothing.is_changed);
    assert_eq!(nothing.buffers.bytes(0), after.buffers.bytes(0));
}
