//! Scenes before and after: drawn by a walk of these tests' own, which knows nothing of how batches are found.

use super::*;
use crate::gltf::document::Container;
use crate::gltf::fixture::square;
use crate::gltf::rules::{self, Rule};
use crate::gltf::{similarity, structure, uri};
use glam::{DMat4, DQuat};
use proptest::prelude::*;
use std::path::Path;

const SPHERE: Option<Sphere> = Some((DVec3::new(0.5, 0.5, 0.0), 0.75));

fn settings() -> InstanceSettings {
    InstanceSettings { instancing: crate::config::Instancing::Gpu, ..InstanceSettings::default() }
}

/// A document with one mesh and these nodes; those that are nobody's children are in the scene.
fn document(nodes: Value) -> Document {
    let mut document = square();
    let below: BTreeSet<u64> = nodes
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|n| n["children"].as_array().into_iter().flatten().filter_map(Value::as_u64).collect::<Vec<_>>())
        .collect();
    let roots: Vec<u64> = (0..nodes.as_array().unwrap().len() as u64).filter(|n| !below.contains(n)).collect();
    document.json["scenes"] = json!([{ "nodes": roots }]);
    document.json["nodes"] = nodes;
    document
}

fn folded(document: &mut Document, settings: &InstanceSettings) -> (Folded, Buffers) {
    let mut buffers = Buffers::load(document, Path::new("")).unwrap();
    let spheres = vec![SPHERE; document.array("meshes").unwrap().len()];
    let folded = fold(document, &mut buffers, &spheres, settings).unwrap();
    structure::check(document).unwrap();
    // What the document says of its bytes is what they are.
    let again = Buffers::load(document, Path::new("")).unwrap();
    (0..buffers.len()).for_each(|i| assert_eq!(buffers.bytes(i), again.bytes(i)));
    (folded, buffers)
}

fn floats<const N: usize>(document: &Document, buffers: &Buffers, accessor: &Value) -> Vec<[f64; N]> {
    let accessor = &document.json["accessors"][accessor.as_u64().unwrap() as usize];
    let view = &document.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |key: &str| view[key].as_u64().unwrap_or(0);
    let bytes = buffers.range(number("buffer") as usize, number("byteOffset"), number("byteLength"), "test").unwrap();
    assert_eq!(bytes.len(), accessor["count"].as_u64().unwrap() as usize * N * 4);
    let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    bytes.chunks_exact(4 * N).map(|e| std::array::from_fn(|i| float(&e[4 * i..]))).collect()
}

/// Where the corners (1, 0, 0), (0, 1, 0) and the origin of every mesh are drawn, sorted.
fn drawn(document: &Document, buffers: &Buffers) -> Vec<(u64, [DVec3; 3])> {
    let local = |node: &Value| {
        let list = |key: &str, default: &[f64]| -> Vec<f64> {
            node[key].as_array().map_or(default.to_vec(), |l| l.iter().map(|v| v.as_f64().unwrap()).collect())
        };
        if node["matrix"].is_array() {
            return DMat4::from_cols_slice(&list("matrix", &[]));
        }
        DMat4::from_scale_rotation_translation(
            DVec3::from_slice(&list("scale", &[1.0; 3])),
            similarity::rotation(DQuat::from_slice(&list("rotation", &[0.0, 0.0, 0.0, 1.0]))),
            DVec3::from_slice(&list("translation", &[0.0; 3])),
        )
    };
    let mut found = Vec::new();
    let nodes = document.json["nodes"].as_array().unwrap();
    let list = |v: &Value| v.as_array().into_iter().flatten().filter_map(Value::as_u64).collect::<Vec<u64>>();
    let mut open: Vec<(u64, DMat4)> =
        list(&document.json["scenes"][0]["nodes"]).into_iter().map(|n| (n, DMat4::IDENTITY)).collect();
    while let Some((node, above)) = open.pop() {
        let node = &nodes[node as usize];
        let matrix = above * local(node);
        open.extend(list(&node["children"]).into_iter().map(|child| (child, matrix)));
        let Some(mesh) = node["mesh"].as_u64() else { continue };
        let attributes = &node["extensions"][INSTANCING]["attributes"];
        let mut instances = vec![DMat4::IDENTITY];
        if attributes.is_object() {
            let t = floats::<3>(document, buffers, &attributes["TRANSLATION"]);
            let r = floats::<4>(document, buffers, &attributes["ROTATION"]);
            let s = floats::<3>(document, buffers, &attributes["SCALE"]);
            assert_eq!((t.len(), t.len()), (r.len(), s.len()));
            let instance = |i: usize| {
                let turn = similarity::rotation(DQuat::from_array(r[i]));
                DMat4::from_scale_rotation_translation(s[i].into(), turn, t[i].into())
            };
            instances = (0..t.len()).map(instance).collect();
        }
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        found.extend(instances.into_iter().map(|i| (mesh, corners.map(|p| (matrix * i).transform_point3(p)))));
    }
    let key = |e: &(u64, [DVec3; 3])| e.1.map(|p| (p * 1e3).round().to_array().map(|v| v as i64));
    found.sort_by_key(|e| (e.0, key(e)));
    found
}

fn same(before: &[(u64, [DVec3; 3])], after: &[(u64, [DVec3; 3])]) {
    assert_eq!(before.len(), after.len());
    // Rounding may order equal ones otherwise: each has one of its own that is near.
    let mut free: Vec<bool> = vec![true; after.len()];
    for (mesh, points) in before {
        let near = |other: &[DVec3; 3]| std::iter::zip(points, other).all(|(a, b)| a.distance(*b) < 1e-4);
        let found = (0..after.len()).find(|&i| free[i] && after[i].0 == *mesh && near(&after[i].1));
        free[found.unwrap_or_else(|| panic!("{points:?} is drawn no more"))] = false;
    }
}

/// Instances of the file's own making keep the rules.
fn sound(source: &Document, output: &Document) {
    let of_instances = [Rule::Instances, Rule::InstanceData, Rule::InstancingDeclared];
    let found: Vec<_> = rules::check(source, output).into_iter().filter(|v| of_instances.contains(&v.rule)).collect();
    assert_eq!(found, []);
}

fn at(x: f64) -> Value {
    json!({ "mesh": 0, "translation": [x, 0, 0] })
}

#[test]
fn a_row_of_nodes_becomes_one_batch_at_their_middle() {
    let source = document(json!([at(0.0), { "name": "other" }, at(1.0), at(2.0), at(3.0), at(4.0)]));
    let mut output = source.clone();
    let (told, buffers) = folded(&mut output, &settings());
    assert_eq!((told.batches, told.instances, told.stayed.len()), (1, 5, 0));
    // In the first one's place; the others were the last entries.
    assert_eq!(output.json["nodes"].as_array().unwrap().len(), 2);
    assert_eq!(output.json["nodes"][0]["translation"], json!([2.5, 0.5, 0.0]));
    assert_eq!(output.json["nodes"][1], source.json["nodes"][1]);
    assert_eq!(output.json["scenes"][0]["nodes"], json!([1, 0]));
    assert_eq!(output.json["extensionsRequired"], json!([INSTANCING]));
    let attributes = &output.json["nodes"][0]["extensions"][INSTANCING]["attributes"];
    let shifts = floats::<3>(&output, &buffers, &attributes["TRANSLATION"]);
    assert_eq!(shifts.iter().map(|t| t[0]).collect::<Vec<_>>(), [-2.5, -1.5, -0.5, 0.5, 1.5]);
    assert_eq!(floats::<3>(&output, &buffers, &attributes["SCALE"]), [[1.0; 3]; 5]);
    let before = Buffers::load(&source, Path::new("")).unwrap();
    same(&drawn(&source, &before), &drawn(&output, &buffers));
    sound(&source, &output);
}

#[test]
fn whatever_can_be_missed_stays_and_the_reason_is_told() {
    let odd = [
        json!({ "mesh": 0, "name": "door" }),
        json!({ "mesh": 0, "extras": {} }),
        json!({ "mesh": 0, "extensions": { "KHR_node_visibility": {} } }),
        json!({ "mesh": 0, "children": [12] }),
        json!({ "mesh": 0, "scale": [1, -1, 1] }),
        json!({ "mesh": 0, "scale": [1, 0, 1] }),
        json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }),
        json!({ "mesh": 0, "rotation": [0, 0, 0, 0] }),
        json!({ "mesh": 0, "translation": [1e9, 0, 0] }),
        json!({ "mesh": 0, "translation": [1, 0, 0] }),
    ];
    let mut nodes: Vec<Value> = vec![at(0.0), at(1.0)];
    nodes.extend(odd);
    nodes.extend([at(3.0), at(4.0), at(5.0)]);
    let mut source = document(json!(nodes));
    source.json["animations"] = json!([{ "channels": [{ "target": { "node": 11, "path": "translation" } }] }]);
    let mut output = source.clone();
    let (told, buffers) = folded(&mut output, &settings());
    assert_eq!((told.batches, told.instances), (1, 5), "{told:#?}");
    source.json["nodes"][5].as_object_mut().unwrap().shift_remove("children");
    for i in 2..12 {
        assert_eq!(output.json["nodes"][i], source.json["nodes"][i]);
    }
    let reasons: Vec<(&str, usize)> = told.stayed.iter().map(|(why, count)| (*why, *count)).collect();
    let expected = [
        ("an animation, a skin or a pointer means them", 1),
        ("their transforms are flat", 1),
        ("their transforms are sheared", 1),
        ("their transforms cannot be read", 1),
        ("their transforms mirror", 1),
        ("they have `extras` or a camera", 1),
        ("they have an extension", 1),
        ("they have children", 1),
        ("they have names, which `names = \"drop\"` would lose", 1),
        ("too few with their mesh are near them, below the same parent", 1),
    ];
    assert_eq!(reasons, expected);
    sound(&source, &output);
    assert_eq!(output.json["nodes"].as_array().unwrap().len(), 12);
    assert!(output.json["nodes"][1] == json!({}) && !buffers.is_empty());
}

#[test]
fn groups_that_hold_nothing_else_go_and_names_only_where_they_may() {
    let group = |children: [u64; 2], name: bool| {
        let mut group = json!({ "children": children, "translation": [0, 2, 0], "rotation": [0, 0, 0.6, 0.8] });
        if name {
            group["name"] = json!("group");
        }
        group
    };
    let nodes = json!([group([1, 2], false), at(0.0), at(1.0), group([4, 5], true), at(0.5), at(1.5)]);
    let source = document(nodes);
    let mut output = source.clone();
    assert_eq!(folded(&mut output, &settings()).0.batches, 0);
    assert_eq!(output, source);
    let drop = InstanceSettings { names: NodeNames::Drop, required: false, ..settings() };
    let (told, buffers) = folded(&mut output, &drop);
    assert_eq!((told.batches, told.instances), (1, 4));
    assert_eq!(output.json["nodes"][0], json!({}));
    assert_eq!(output.json["nodes"].as_array().unwrap().len(), 2);
    assert_eq!((&output.json["scenes"][0]["nodes"], output.json.get("extensionsRequired")), (&json!([1]), None));
    let before = Buffers::load(&source, Path::new("")).unwrap();
    same(&drawn(&source, &before), &drawn(&output, &buffers));
}

#[test]
fn what_moves_takes_its_batch_along() {
    let mut nodes = vec![json!({ "name": "cart", "children": [1, 2, 3, 4] })];
    nodes.extend((0..8).map(|i| at(f64::from(i))));
    let mut output = document(json!(nodes));
    let (told, _) = folded(&mut output, &settings());
    assert_eq!((told.batches, told.instances), (2, 8));
    assert_eq!(output.json["nodes"][0]["children"], json!([1]));
    assert_eq!(output.json["scenes"][0]["nodes"], json!([0, 5]));
    // Unit scales and no rotation: written once for both.
    let attributes = |i: usize| &output.json["nodes"][i]["extensions"][INSTANCING]["attributes"];
    assert_eq!(
        (&attributes(1)["SCALE"], &attributes(1)["ROTATION"]),
        (&attributes(5)["SCALE"], &attributes(5)["ROTATION"])
    );
}

#[test]
fn constant_columns_are_the_beginning_of_the_longest() {
    let mut nodes: Vec<Value> = (0..4).map(|i| at(f64::from(i))).collect();
    nodes.extend((0..6).map(|i| at(1e6 + f64::from(i))));
    let source = document(json!(nodes));
    let mut output = source.clone();
    let (told, buffers) = folded(&mut output, &settings());
    assert_eq!((told.batches, told.instances), (2, 10));
    let grown = buffers.bytes(0).unwrap().len() - source.bin.as_ref().unwrap().len();
    assert_eq!(grown, 10 * 12 + 6 * (12 + 16));
    sound(&source, &output);
    let before = Buffers::load(&source, Path::new("")).unwrap();
    same(&drawn(&source, &before), &drawn(&output, &buffers));
}

#[test]
fn each_kind_of_buffer_takes_the_bytes() {
    let rows = json!([at(0.0), at(1.0), at(2.0), at(3.0)]);
    let bytes = square().bin.unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("square.bin"), &bytes).unwrap();
    for address in ["data", "square.bin"] {
        let mut source = document(rows.clone());
        source.container = Container::Gltf;
        source.bin = None;
        let data = crate::gltf::package::data_uri(&bytes);
        source.json["buffers"][0]["uri"] = json!(if address == "data" { &data } else { address });
        let mut buffers = Buffers::load(&source, folder.path()).unwrap();
        fold(&mut source, &mut buffers, &[SPHERE], &settings()).unwrap();
        let entry = &source.json["buffers"][0];
        assert_eq!(entry["byteLength"], buffers.bytes(0).unwrap().len());
        // A file that has changed is one no more: `package` gives it another name.
        let form = entry["uri"].as_str().map(uri::form);
        assert_eq!(form, (address == "data").then_some(uri::Form::Data));
    }
}

#[test]
fn an_extension_that_might_name_nodes_keeps_everything() {
    let mut output = document(json!([at(0.0), at(1.0), at(2.0), at(3.0)]));
    output.json["extensionsUsed"] = json!(["VENDOR_doors"]);
    let before = output.clone();
    let (told, _) = folded(&mut output, &settings());
    assert_eq!((told.batches, told.stayed.values().sum::<usize>()), (0, 4));
    assert_eq!(output, before);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the hierarchy: everything is drawn where it was, and what stays has its index.
    #[test]
    fn everything_is_drawn_where_it_was(
        nodes in prop::collection::vec(
            (any::<prop::sample::Index>(), 0..10u8, prop::array::uniform3(-5.0..5.0f64), prop::array::uniform4(-1.0..1.0f64), 0.5..2.0f64),
            1..60,
        ),
        cell in 1.0..40.0f64,
    ) {
        let mut list: Vec<Value> = Vec::new();
        for (i, (parent, kind, shift, turn, size)) in nodes.iter().enumerate() {
            let turn = DQuat::from_array(*turn);
            let turn = if turn.length() < 0.1 { DQuat::IDENTITY } else { similarity::rotation(turn) };
            let mut node = json!({ "translation": shift, "rotation": turn.to_array() });
            if kind % 3 != 0 { node["mesh"] = json!(0); }
            if *kind == 7 { node["name"] = json!(format!("node {i}")); }
            if *kind == 8 { node["scale"] = json!([size, 1.0, -size]); }
            if *kind == 5 { node["scale"] = json!([size, size, size]); }
            list.push(node);
            let parent = parent.index(i + 1);
            if parent < i && list[parent].get("mesh").is_none() {
                let entry = list[parent].as_object_mut().unwrap();
                entry.entry("children").or_insert_with(|| json!([])).as_array_mut().unwrap().push(json!(i));
            }
        }
        let source = document(json!(list));
        let mut output = source.clone();
        let (told, buffers) = folded(&mut output, &InstanceSettings { cell, ..settings() });
        let before = Buffers::load(&source, Path::new("")).unwrap();
        same(&drawn(&source, &before), &drawn(&output, &buffers));
        sound(&source, &output);
        let after = output.json["nodes"].as_array().unwrap();
        for (i, node) in list.iter().enumerate().filter(|(_, node)| node.get("name").is_some()) {
            prop_assert_eq!(&after[i]["name"], &node["name"]);
            prop_assert_eq!(&after[i]["translation"], &node["translation"]);
        }
        let batches = after.iter().filter(|node| json::extension(node, INSTANCING).is_some()).count();
        prop_assert_eq!(batches, told.batches);
    }
}
