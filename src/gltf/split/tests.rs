//! Documents before and after: what is drawn must be the same.

use super::super::document::Container;
use super::super::read::from_document;
use super::super::scene::{Scene, SourcePrimitive};
use super::super::structure;
use super::*;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Shapes of three triangles each, with whole coordinates: moved by whole numbers they keep every bit.
const SHAPES: [[[i8; 3]; 5]; 2] =
    [[[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [1, 4, 1]], [[0, 0, 0], [5, 0, 0], [5, 1, 2], [0, 1, 1], [2, 3, 2]]];
const CORNERS: [u32; 9] = [0, 1, 2, 0, 2, 3, 3, 2, 4];

/// One primitive on its way into a document.
#[derive(Clone, Default)]
struct Made {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    /// First triangle and place of each part.
    parts: Vec<(u32, i8, usize)>,
}

impl Made {
    fn add(&mut self, shape: usize, x: i8) {
        let first = self.positions.len() as u32;
        self.parts.push((self.indices.len() as u32 / 3, x, shape));
        self.positions
            .extend(SHAPES[shape].map(|[a, b, c]| [f32::from(a) + f32::from(x) * 8.0, f32::from(b), f32::from(c)]));
        self.indices.extend(CORNERS.map(|i| first + i));
    }

    fn part(&self, mesh: usize, primitive: usize, number: usize) -> Part {
        let first = self.parts[number].0;
        Part { mesh, triangles: vec![(primitive, (first..first + 3).collect())] }
    }

    /// Where one part is, seen from another.
    fn from(&self, of: usize, number: usize) -> Similarity {
        let x = 8.0 * (f64::from(self.parts[number].1) - f64::from(self.parts[of].1));
        Similarity { scale: 1.0, mirror: false, rotation: DQuat::IDENTITY, translation: DVec3::new(x, 0.0, 0.0) }
    }
}

/// How a document stores its vertices.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Apart,
    Interleaved,
    Unindexed,
}

/// Meshes of primitives as a GLB; a second attribute numbers the vertices of each shape. Every mesh is on `nodes` nodes.
fn document(meshes: &[Vec<Made>], form: Form, nodes: usize) -> Document {
    let mut document = Document::new(Container::Glb, "test");
    let mut bin: Vec<u8> = b"an image".to_vec();
    document.push("bufferViews", json!({ "buffer": 0, "byteLength": 8 })).unwrap();
    document.json["images"] = json!([{ "bufferView": 0, "mimeType": "image/png" }]);
    document.json["materials"] = json!([{}, {}]);
    for (number, primitives) in meshes.iter().enumerate() {
        let mut entries = Vec::new();
        for (i, made) in primitives.iter().enumerate() {
            let rows: Vec<usize> = match form {
                Form::Unindexed => made.indices.iter().map(|&i| i as usize).collect(),
                _ => (0..made.positions.len()).collect(),
            };
            let mut push = |bytes: Vec<u8>, stride: Option<usize>| {
                let mut view = json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() });
                if let Some(stride) = stride {
                    view["byteStride"] = json!(stride);
                }
                bin.extend(bytes);
                bin.resize(bin.len().next_multiple_of(4), 0);
                document.push("bufferViews", view).unwrap()
            };
            let position = |&row: &usize| made.positions[row].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
            let own = |&row: &usize| [(row % 5) as u8, (row % 5) as u8 + 1, 7, 0];
            let count = rows.len();
            let (views, offset) = if form == Form::Interleaved {
                let bytes = rows.iter().flat_map(|row| [position(row), own(row).to_vec()].concat()).collect();
                let view = push(bytes, Some(16));
                ([view, view], 12)
            } else {
                let positions = push(rows.iter().flat_map(position).collect(), None);
                ([positions, push(rows.iter().flat_map(own).collect(), Some(4))], 0)
            };
            let indices = push(made.indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect(), None);
            let low = [0, 1, 2].map(|axis| made.positions.iter().map(|p| p[axis]).fold(f32::INFINITY, f32::min));
            let high = [0, 1, 2].map(|axis| made.positions.iter().map(|p| p[axis]).fold(-f32::INFINITY, f32::max));
            let entry = json!({ "bufferView": views[0], "componentType": 5126, "count": count, "type": "VEC3",
                "min": low, "max": high, "name": "positions" });
            let a = document.push("accessors", entry).unwrap();
            let entry = json!({ "bufferView": views[1], "byteOffset": offset, "componentType": 5121, "count": count,
                "type": "VEC3" });
            let b = document.push("accessors", entry).unwrap();
            let mut primitive = json!({ "attributes": { "POSITION": a, "_OWN": b }, "material": i % 2 });
            if form != Form::Unindexed {
                let entry = json!({ "bufferView": indices, "componentType": 5123, "count": made.indices.len(),
                    "type": "SCALAR" });
                primitive["indices"] = json!(document.push("accessors", entry).unwrap());
            }
            entries.push(primitive);
        }
        document.push("meshes", json!({ "name": format!("M{number}"), "primitives": entries })).unwrap();
        for node in 0..nodes {
            document
                .push(
                    "nodes",
                    json!({ "name": "N", "mesh": number, "translation": [0, 100 * node, 0], "extras": node }),
                )
                .unwrap();
        }
    }
    let roots: Vec<usize> = (0..document.array("nodes").unwrap().len()).collect();
    document.json["scenes"] = json!([{ "nodes": roots }]);
    document.json["buffers"] = json!([{ "byteLength": bin.len() }]);
    document.bin = Some(Arc::from(bin));
    document
}

type Corner = ([i32; 3], Vec<u32>);

/// All triangles that nodes draw, with all attributes and the material, in some order.
fn drawn(scene: &Scene) -> Vec<(Value, [Corner; 3])> {
    let nodes = scene.document.array("nodes").unwrap();
    let mut drawn = Vec::new();
    let mut open: Vec<(usize, DVec3)> = scene.document.json["scenes"][0]["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|root| (root.as_u64().unwrap() as usize, DVec3::ZERO))
        .collect();
    while let Some((node, base)) = open.pop() {
        let node = &nodes[node];
        let own = node.get("translation").map_or(DVec3::ZERO, |t| {
            DVec3::new(t[0].as_f64().unwrap(), t[1].as_f64().unwrap(), t[2].as_f64().unwrap())
        });
        let base = base + own;
        open.extend(
            node.get("children")
                .and_then(Value::as_array)
                .into_iter()
                .flatten()
                .map(|child| (child.as_u64().unwrap() as usize, base)),
        );
        let Some(mesh) = node.get("mesh").and_then(Value::as_u64) else { continue };
        let entries = &scene.document.json["meshes"][mesh as usize]["primitives"];
        for (i, primitive) in scene.meshes[mesh as usize].primitives.iter().enumerate() {
            let SourcePrimitive::Triangles(primitive) = primitive else { panic!("no triangles") };
            for t in primitive.indices.as_chunks::<3>().0 {
                let corner = |&v: &u32| -> Corner {
                    let p = primitive.positions()[v as usize];
                    let at = DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])) + base;
                    let values = primitive.attributes.iter().filter(|a| a.name != "POSITION");
                    let bits = values.flat_map(|a| &a.values[v as usize * a.components..][..a.components]);
                    (at.to_array().map(|c| c as i32), bits.map(|v| v.to_bits()).collect())
                };
                drawn.push((entries[i]["material"].clone(), [&t[0], &t[1], &t[2]].map(corner)));
            }
        }
    }
    drawn.sort_by_key(|triangle| format!("{triangle:?}"));
    drawn
}

fn read(document: Document, buffers: Option<Buffers>) -> Scene {
    structure::check(&document).unwrap();
    let buffers = buffers.unwrap_or_else(|| Buffers::load(&document, Path::new("")).unwrap());
    from_document(document, buffers, Path::new("")).unwrap()
}

/// Splits and holds what comes out against what went in.
fn checked(source: &Document, groups: &[Repeated]) -> (Document, Split) {
    let before = read(source.clone(), None);
    let mut document = source.clone();
    let done = split(&mut document, &before.buffers, groups).unwrap();
    assert_eq!(done.buffers.bytes(0).unwrap(), &document.bin.as_ref().unwrap()[..]);
    let after = read(document.clone(), Some(done.buffers.clone()));
    assert_eq!(drawn(&before), drawn(&after));
    for name in ["nodes", "meshes", "accessors", "bufferViews", "materials", "images"] {
        let (old, new) = (source.array(name).unwrap(), document.array(name).unwrap());
        assert!(old.len() <= new.len());
        let kept = |key| old.iter().zip(new).all(|(a, b)| a.get(key) == b.get(key));
        assert!(["name", "extras", "translation"].into_iter().all(kept), "{name}");
    }
    let image = &document.json["bufferViews"][0];
    let at = image["byteOffset"].as_u64().unwrap_or(0) as usize;
    assert_eq!(&done.buffers.bytes(0).unwrap()[at..at + 8], b"an image");
    for accessor in document.array("accessors").unwrap().iter().filter(|a| a.get("min").is_some()) {
        assert!(accessor["min"][0].as_f64().unwrap() <= accessor["max"][0].as_f64().unwrap());
    }
    (document, done)
}

/// All parts of a shape but the first `stays`, which are left.
fn group(made: &Made, mesh: usize, shape: usize, stays: usize) -> Repeated {
    let own: Vec<usize> = (0..made.parts.len()).filter(|&i| made.parts[i].2 == shape).collect();
    let occurrence = |&i: &usize| (made.part(mesh, 0, i), made.from(own[0], i));
    Repeated { of: made.part(mesh, 0, own[0]), mesh: None, occurrences: own[stays..].iter().map(occurrence).collect() }
}

fn row(shapes: &[usize]) -> Made {
    let mut made = Made::default();
    shapes.iter().enumerate().for_each(|(i, &shape)| made.add(shape, i as i8));
    made
}

#[test]
fn parts_become_children_and_the_mesh_keeps_the_rest() {
    for form in [Form::Apart, Form::Interleaved, Form::Unindexed] {
        let made = row(&[0, 1, 0, 0, 0, 0]);
        let source = document(&[vec![made.clone()]], form, 1);
        let (document, done) = checked(&source, &[group(&made, 0, 0, 0)]);
        assert_eq!((done.meshes, done.nodes), (vec![1], 5));
        assert!(done.bytes.1 < done.bytes.0, "{:?}", done.bytes);
        let nodes = document.array("nodes").unwrap();
        assert_eq!((&nodes[0]["mesh"], &nodes[0]["children"]), (&json!(0), &json!([1, 2, 3, 4, 5])));
        assert_eq!(nodes[1], json!({ "mesh": 1 }));
        assert_eq!(nodes[2], json!({ "mesh": 1, "translation": [16.0, 0.0, 0.0] }));
        let meshes = document.array("meshes").unwrap();
        assert_eq!((&meshes[0]["name"], &meshes[1]["name"]), (&json!("M0"), &json!("M0_part_0_0")));
        assert_eq!(meshes[0]["primitives"][0]["attributes"], source.json["meshes"][0]["primitives"][0]["attributes"]);
        assert_eq!(meshes[1]["primitives"][0]["material"], 0);
        // What is left is the second part alone.
        let position = &document.json["accessors"][0];
        let rows = if form == Form::Unindexed { 9 } else { 5 };
        assert_eq!((&position["count"], &position["name"]), (&json!(rows), &json!("positions")));
        assert_eq!((&position["min"], &position["max"]), (&json!([8.0, 0.0, 0.0]), &json!([13.0, 3.0, 2.0])));
    }
}

#[test]
fn a_mesh_that_is_left_with_the_part_shows_it() {
    let made = row(&[0, 0, 0, 0]);
    let source = document(&[vec![made.clone()]], Form::Apart, 2);
    let one = Repeated { mesh: Some(0), ..group(&made, 0, 0, 1) };
    let (document, done) = checked(&source, &[one]);
    assert_eq!((done.meshes, done.nodes, document.array("meshes").unwrap().len()), (vec![0], 6, 1));
    assert_eq!(document.json["nodes"][1]["children"], json!([5, 6, 7]));
}

#[test]
fn primitives_that_share_vertices_are_renumbered_together() {
    let made = row(&[0, 1, 0, 0, 0, 1]);
    let mut source = document(&[vec![made.clone()], vec![row(&[1])]], Form::Apart, 1);
    // A second mesh over the vertices of the first, of which it draws the second and the last part.
    let mut shared = source.json["meshes"][0].clone();
    let view = source.json["accessors"][2]["bufferView"].clone();
    let indices = [3u32, 15].map(|first| {
        let entry = json!({ "bufferView": view, "byteOffset": first * 6, "componentType": 5123, "count": 9,
            "type": "SCALAR" });
        source.push("accessors", entry).unwrap()
    });
    shared["primitives"] = indices
        .iter()
        .map(|i| json!({ "attributes": shared["primitives"][0]["attributes"], "indices": i, "material": 1 }))
        .collect();
    // An accessor that nothing uses, of the same bytes.
    let mut alias = source.json["accessors"][0].clone();
    alias["name"] = json!("unused");
    source.push("accessors", alias).unwrap();
    source.json["meshes"][1] = shared;
    let (document, done) = checked(&source, &[group(&made, 0, 0, 0)]);
    assert_eq!(document.json["accessors"][0]["count"], 10);
    // Four parts of five vertices of sixteen bytes went, and one came.
    assert!(done.bytes.0 - done.bytes.1 >= 200, "{:?}", done.bytes);
    let last = document.json["accessors"].as_array().unwrap().iter().find(|a| a["name"] == "unused").unwrap();
    assert_eq!(last["count"], 10);
}

#[test]
fn triangles_without_extent_and_vertices_without_triangles_stay() {
    let mut made = row(&[0, 0, 1, 0]);
    // Two corners are one vertex: readers leave it out, the list that was read does not count it.
    made.indices.splice(0..0, [4, 4, 7]);
    made.positions.push([-1.0; 3]);
    let source = document(&[vec![made.clone()]], Form::Apart, 1);
    let (document, _) = checked(&source, &[group(&made, 0, 0, 0)]);
    let primitive = &document.json["meshes"][0]["primitives"][0];
    // One triangle and the odd one; the vertices of both, and the unused one.
    assert_eq!(document.json["accessors"][primitive["indices"].as_u64().unwrap() as usize]["count"], 12);
    assert_eq!(document.json["accessors"][0]["count"], 5 + 2 + 1);
}

struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % limit
    }
}

proptest::proptest! {
    #[test]
    fn whatever_is_taken_out_is_drawn_as_before(seed in 0u64..u64::MAX) {
        let mut chance = Chance(seed);
        let form = [Form::Apart, Form::Interleaved, Form::Unindexed][chance.below(3)];
        let meshes: Vec<Vec<Made>> = (0..=chance.below(2))
            .map(|_| {
                let mut primitive = || row(&(0..2 + chance.below(12)).map(|_| chance.below(2)).collect::<Vec<_>>());
                let first = primitive();
                vec![first, primitive()]
            })
            .collect();
        let source = document(&meshes, form, 1 + chance.below(3));
        // By shape and primitive, of all meshes; each primitive keeps one part or more.
        let mut groups: BTreeMap<(usize, usize), Repeated> = BTreeMap::new();
        for (mesh, primitives) in meshes.iter().enumerate() {
            for (primitive, made) in primitives.iter().enumerate() {
                let kept = chance.below(made.parts.len());
                for number in (0..made.parts.len()).filter(|&number| number != kept) {
                    let (_, x, shape) = made.parts[number];
                    if chance.below(4) == 0 {
                        continue;
                    }
                    let part = made.part(mesh, primitive, number);
                    let group = groups.entry((shape, primitive)).or_insert_with(|| {
                        Repeated { of: part.clone(), mesh: None, occurrences: Vec::new() }
                    });
                    let of = &meshes[group.of.mesh][primitive];
                    let first = of.parts.iter().find(|p| p.0 == group.of.place().1).unwrap().1;
                    let by = Similarity { translation: DVec3::new(8.0 * (f64::from(x) - f64::from(first)), 0.0, 0.0), ..Similarity::IDENTITY };
                    group.occurrences.push((part, by));
                }
            }
        }
        let groups: Vec<Repeated> = groups.into_values().collect();
        let (document, done) = checked(&source, &groups);
        proptest::prop_assert_eq!(document.array("meshes").unwrap().len(), meshes.len() + groups.len());
        proptest::prop_assert!(done.bytes.1 <= done.bytes.0 + 8 * 6 * (groups.len() as u64 + 4) + 80 * groups.len() as u64);
    }
}

#[test]
fn what_must_stay_whole_says_why() {
    let look = |change: &dyn Fn(&mut Document)| {
        let mut document = document(&[vec![row(&[0, 0, 1])]], Form::Apart, 1);
        change(&mut document);
        Splitting::new(&document, &|_, _| true, true).unwrap().looks(0, 0)
    };
    let primitive = |change: &dyn Fn(&mut Value)| look(&|d| change(&mut d.json["meshes"][0]["primitives"][0]));
    assert_eq!(look(&|_| {}), Ok(0));
    assert_eq!(primitive(&|p| p["mode"] = json!(5)), Err("it is no list of triangles"));
    assert!(primitive(&|p| p["targets"] = json!([{ "POSITION": 0 }])).unwrap_err().contains("morph targets"));
    assert!(primitive(&|p| p["extensions"] = json!({ "EXT_mesh_features": {} })).unwrap_err().contains("not known"));
    let draco = json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": {} } });
    assert_eq!(primitive(&|p| p["extensions"] = draco.clone()), Err("it is compressed"));
    let variants = json!({ "KHR_materials_variants": { "mappings": [{ "material": 1, "variants": [0] }] } });
    assert_eq!(primitive(&|p| p["extensions"] = variants.clone()), Ok(0));
    let transparent = |d: &mut Document| {
        d.json["materials"][1]["alphaMode"] = json!("BLEND");
        d.json["meshes"][0]["primitives"][0]["extensions"] = variants.clone();
    };
    assert!(look(&transparent).unwrap_err().contains("transparent"));
    let thick = |d: &mut Document| d.json["materials"][0]["extensions"] = json!({ "KHR_materials_volume": {} });
    assert!(look(&thick).unwrap_err().contains("thickness"));
    assert!(look(&|d| d.json["nodes"][0]["skin"] = json!(0)).unwrap_err().contains("skin"));
    let batch = json!({ "EXT_mesh_gpu_instancing": { "attributes": {} } });
    assert!(look(&|d| d.json["nodes"][0]["extensions"] = batch.clone()).unwrap_err().contains("instances already"));
    assert!(look(&|d| d.json["accessors"][1]["sparse"] = json!({})).unwrap_err().contains("sparsely"));
    assert!(look(&|d| d.json["accessors"][1]["type"] = json!("MAT2")).unwrap_err().contains("matrix"));
    let packed = json!({ "EXT_meshopt_compression": { "buffer": 0 } });
    assert_eq!(look(&|d| d.json["bufferViews"][1]["extensions"] = packed.clone()), Err("it is compressed"));
    let moving = json!([{ "samplers": [{ "input": 2, "output": 0 }], "channels": [] }]);
    assert!(look(&|d| d.json["animations"] = moving.clone()).unwrap_err().contains("something else"));
    // Another mesh over the same vertices that stays whole.
    let other = |d: &mut Document| {
        let mut mesh = d.json["meshes"][0].clone();
        mesh["primitives"][0]["mode"] = json!(0);
        d.push("meshes", mesh).unwrap();
    };
    assert!(look(&other).unwrap_err().contains("the same vertices"));
}

#[test]
fn looks_are_numbers_of_all_but_the_geometry() {
    let mut made = document(&[vec![row(&[0]), row(&[1]), row(&[0]), row(&[0])]], Form::Apart, 3);
    made.json["meshes"][0]["primitives"][2]["extras"] = json!({ "id": 1 });
    let splitting = Splitting::new(&made, &|_, primitive| primitive != 3, false).unwrap();
    assert_eq!([0, 1, 2].map(|primitive| splitting.looks(0, primitive)), [Ok(0), Ok(1), Ok(2)]);
    assert!(splitting.looks(0, 3).is_err(), "it was not read");
    assert_eq!((splitting.shown(0), splitting.shown(1)), (3, 0));
}
