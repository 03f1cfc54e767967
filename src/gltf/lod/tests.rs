//! Groups on hand-made documents, each checked against `rules` and read again.

use super::*;
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Container;
use crate::gltf::fixture::{chain, level, own, shared, square};
use crate::gltf::package::Package;
use crate::gltf::read;
use crate::gltf::rules;
use crate::gltf::scene::{Scene, SourcePrimitive};
use crate::mesh::LevelVertices;
use std::path::Path;

/// Adds levels, checks every rule, and reads the result.
fn bake(source: &Document, levels: &[MeshLevels]) -> (Document, Added) {
    bake_for(source, levels, &EmitSettings::default())
}

fn bake_for(source: &Document, levels: &[MeshLevels], settings: &EmitSettings) -> (Document, Added) {
    let mut document = source.clone();
    let added = add_levels(&mut document, levels, &Batches::new(), settings).unwrap();
    let violations = rules::check(source, &document);
    assert!(violations.is_empty(), "{violations:#?}");
    (document, added)
}

fn reread(document: &Document) -> Scene {
    let bytes = match document.container {
        Container::Glb => document.to_glb_bytes().unwrap(),
        Container::Gltf => document.to_gltf_bytes(),
    };
    read::read_bytes(&bytes, Path::new("")).unwrap()
}

fn triangles(scene: &Scene, mesh: usize) -> Vec<usize> {
    let count = |p: &SourcePrimitive| match p {
        SourcePrimitive::Triangles(p) => p.triangles(),
        SourcePrimitive::PassThrough { .. } => 0,
    };
    scene.meshes[mesh].primitives.iter().map(count).collect()
}

fn refusal(source: &Document, levels: &[MeshLevels]) -> String {
    let mut document = source.clone();
    add_levels(&mut document, levels, &Batches::new(), &EmitSettings::default()).unwrap_err().to_string()
}

#[test]
fn one_node_becomes_an_anchor_with_a_child_and_two_levels() {
    let source = square();
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    insta::assert_snapshot!(serde_json::to_string_pretty(&document.json["nodes"]).unwrap());
    assert_eq!((added.groups, added.levels.len()), (1, 2));
    assert_eq!(added.levels[0], AddedLevel { meshes: 1, triangles: 1, bytes: 36 + 8 });
    assert_eq!(added.levels[1], AddedLevel { meshes: 1, triangles: 1, bytes: 8 });
    let names: Vec<&Value> = document.array("meshes").unwrap().iter().map(|m| &m["name"]).collect();
    assert_eq!(names, ["Square", "Square_LOD1", "Square_LOD2"]);
    assert_eq!(document.json["meshes"][1]["primitives"][0]["material"], 0);
    // Level 2 borrows the source's vertices.
    assert_eq!(document.json["meshes"][2]["primitives"][0]["attributes"], json!({ "POSITION": 0 }));
    let scene = reread(&document);
    assert_eq!((triangles(&scene, 0), triangles(&scene, 1), triangles(&scene, 2)), (vec![2], vec![1], vec![1]));
    assert_eq!(document.json["extensionsUsed"], json!(["MSFT_lod"]));
    assert!(document.json.get("extensionsRequired").is_none());
}

#[test]
fn the_source_document_and_its_bytes_come_first() {
    let source = square();
    let (document, _) = bake(&source, &[chain(0, &own(0), &own(0))]);
    let bin = document.bin.as_deref().unwrap();
    assert!(bin.starts_with(source.bin.as_deref().unwrap()));
    // Coarsest first: level 2 lies before level 1.
    let view = |level: usize| {
        let accessor = &document.json["meshes"][level]["primitives"][0]["attributes"]["POSITION"];
        let view = &document.json["accessors"][accessor.as_u64().unwrap() as usize]["bufferView"];
        document.json["bufferViews"][view.as_u64().unwrap() as usize]["byteOffset"].as_u64().unwrap()
    };
    assert!(view(2) < view(1));
    let accessor = document.array("accessors").unwrap().last().unwrap();
    assert_eq!((&accessor["min"], &accessor["max"]), (&json!([0.0, 0.0, 0.0]), &json!([1.0, 1.0, 0.0])));
}

#[test]
fn one_level_primitive_in_two_meshes_is_written_once() {
    let mut source = square();
    source.json["meshes"] = json!([source.json["meshes"][0], source.json["meshes"][0]]);
    source.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "mesh": 1 }]);
    let level = own(0);
    let (document, _) = bake(&source, &[chain(0, &level, &level), chain(1, &level, &level)]);
    assert_eq!(document.array("accessors").unwrap().len(), 3 + 2);
    assert_eq!(document.array("meshes").unwrap().len(), 2 + 4, "but every part has a mesh of its own");
}

#[test]
fn nodes_that_share_a_mesh_share_its_levels_but_no_nodes() {
    let mut source = square();
    source.json["nodes"] = json!([{ "mesh": 0, "children": [1, 2] }, { "mesh": 0, "scale": [2, 2, 2] }, { "mesh": 0 }]);
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    assert_eq!(added.groups, 3);
    assert_eq!(document.array("nodes").unwrap().len(), 3 + 3 * 3);
    assert_eq!(document.array("meshes").unwrap().len(), 3);
    assert_eq!(document.json["nodes"][1], json!({ "scale": [2, 2, 2], "children": [6] }));
}

#[test]
fn skins_and_weights_go_with_the_mesh_and_joints_stay() {
    let mut source = square();
    source.json["nodes"] = json!([
        { "name": "A", "mesh": 0, "skin": 0, "weights": [0.5], "children": [1] },
        // A joint that shows a mesh itself.
        { "name": "J", "mesh": 0, "rotation": [0, 0, 0, 1], "camera": 0 },
    ]);
    source.json["skins"] = json!([{ "joints": [1] }]);
    source.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 2 }]);
    source.json["meshes"][0]["weights"] = json!([0.25]);
    source.json["meshes"][0]["extras"] = json!({ "targetNames": ["wide"], "x": 1 });
    let (document, _) = bake(&source, &[chain(0, &own(1), &shared())]);
    let nodes = document.array("nodes").unwrap();
    assert_eq!(nodes[0], json!({ "name": "A", "children": [1, 2] }));
    assert_eq!(nodes[1], json!({ "name": "J", "rotation": [0, 0, 0, 1], "camera": 0, "children": [5] }));
    assert_eq!((&nodes[2]["skin"], &nodes[2]["weights"]), (&json!(0), &json!([0.5])));
    assert_eq!(nodes[3], json!({ "mesh": 1, "skin": 0, "weights": [0.5] }));
    assert_eq!(document.json["meshes"][1]["weights"], json!([0.25]));
    assert_eq!(document.json["meshes"][1]["extras"], json!({ "targetNames": ["wide"], "x": 1 }));
    assert_eq!(document.json["skins"], source.json["skins"]);
}

fn morph_animated() -> Document {
    let mut source = square();
    source.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 2 }]);
    source.json["meshes"][0]["extras"] = json!({ "targetNames": ["wide"] });
    source.json["nodes"][0]["weights"] = json!([0.0]);
    source.json["animations"] = json!([{
        "channels": [
            { "sampler": 1, "target": { "node": 0, "path": "weights" } },
            { "sampler": 0, "target": { "node": 0, "path": "translation" } },
        ],
        "samplers": [{ "input": 1, "output": 0 }, { "input": 1, "output": 1 }],
    }]);
    source
}

#[test]
fn animated_weights_drive_every_level_and_transforms_the_anchor() {
    let (document, _) = bake(&morph_animated(), &[chain(0, &own(1), &shared())]);
    let expected = json!([
        { "sampler": 1, "target": { "node": 4, "path": "weights" } },
        { "sampler": 0, "target": { "node": 0, "path": "translation" } },
        { "sampler": 1, "target": { "node": 2, "path": "weights" } },
        { "sampler": 1, "target": { "node": 3, "path": "weights" } },
    ]);
    assert_eq!(document.json["animations"][0]["channels"], expected);
    // The node with the levels shows nothing itself: three.js would find no weights on it.
    let nodes = &document.json["nodes"];
    assert_eq!((&nodes[0]["children"], &nodes[1]["children"]), (&json!([1]), &json!([4])));
    assert_eq!(nodes[1].get("mesh"), None);
    assert_eq!(nodes[4]["mesh"], 0);
}

#[test]
fn levels_without_morph_targets_have_no_weights() {
    let (document, _) = bake(&morph_animated(), &[chain(0, &own(0), &own(0))]);
    assert_eq!(document.json["animations"][0]["channels"].as_array().unwrap().len(), 2);
    assert_eq!(document.json["nodes"][2], json!({ "mesh": 1 }));
    assert_eq!(document.json["meshes"][1]["extras"], json!({}));
    // All of a mesh's primitives have the targets, or none.
    let mut two = morph_animated();
    let primitive = two.json["meshes"][0]["primitives"][0].clone();
    two.json["meshes"][0]["primitives"] = json!([primitive, primitive]);
    let levels = vec![level(&[own(1), own(0)], 0.1)];
    let words = refusal(&two, &[MeshLevels { mesh: 0, radius: 1.0, levels }]);
    assert_eq!(
        words,
        "meshes[0].primitives[1], level 1: 0 morph targets, the source has 1 (a level has all of them or none)"
    );
}

#[test]
fn pointers_follow_what_moved_and_nothing_else() {
    let mut source = morph_animated();
    let channel = |pointer: &str| json!({ "sampler": 0, "target": { "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } } });
    source.json["animations"][0]["channels"] = json!([
        channel("/nodes/0/weights/0"),
        channel("/nodes/0/rotation"),
        channel("/meshes/0/weights"),
        channel("/nodes/0/extensions/KHR_node_visibility/visible"),
    ]);
    source.json["extensions"] = json!({ "VENDOR_x": { "a": ["/nodes/0/weights", "/nodes/{i}/weights"] } });
    source.json["extras"] = json!({ "note": "/nodes/0/weights" });
    let (document, added) = bake(&source, &[chain(0, &own(1), &shared())]);
    let channels = document.json["animations"][0]["channels"].as_array().unwrap();
    let pointers: Vec<&str> = channels
        .iter()
        .map(|c| c["target"]["extensions"]["KHR_animation_pointer"]["pointer"].as_str().unwrap())
        .collect();
    let expected = [
        "/nodes/4/weights/0",
        "/nodes/0/rotation",
        "/meshes/0/weights",
        "/nodes/0/extensions/KHR_node_visibility/visible",
        "/nodes/2/weights/0",
        "/nodes/3/weights/0",
        "/meshes/1/weights",
        "/meshes/2/weights",
    ];
    assert_eq!(pointers, expected);
    assert_eq!(document.json["extensions"]["VENDOR_x"]["a"][0], "/nodes/4/weights");
    assert_eq!(document.json["extras"], source.json["extras"], "what users keep to themselves stays");
    assert_eq!(added.notes.len(), 2, "{:?}", added.notes);
}

#[test]
fn avatars_keep_their_expressions() {
    let mut source = morph_animated();
    source.json["extensions"] = json!({
        "VRMC_vrm": {
            "humanoid": { "humanBones": { "hips": { "node": 0 } } },
            "expressions": { "preset": { "happy": { "morphTargetBinds": [{ "node": 0, "index": 0, "weight": 1 }] } } },
            "firstPerson": { "meshAnnotations": [{ "node": 0, "type": "auto" }] },
        },
        "VRM": {
            "blendShapeMaster": { "blendShapeGroups": [{ "binds": [{ "mesh": 0, "index": 0, "weight": 100 }] }] },
            "firstPerson": { "meshAnnotations": [{ "mesh": 0, "firstPersonFlag": "Auto" }] },
        },
    });
    let (document, _) = bake(&source, &[chain(0, &own(1), &shared())]);
    let list = |place: &str, key: &str| -> Vec<u64> {
        let list = document.json["extensions"].pointer(place).unwrap().as_array().unwrap();
        list.iter().map(|entry| entry[key].as_u64().unwrap()).collect()
    };
    assert_eq!(list("/VRMC_vrm/expressions/preset/happy/morphTargetBinds", "node"), [4, 2, 3]);
    assert_eq!(list("/VRMC_vrm/firstPerson/meshAnnotations", "node"), [4, 2, 3]);
    assert_eq!(list("/VRM/blendShapeMaster/blendShapeGroups/0/binds", "mesh"), [0, 1, 2]);
    assert_eq!(list("/VRM/firstPerson/meshAnnotations", "mesh"), [0, 1, 2]);
    assert_eq!(document.json["extensions"]["VRMC_vrm"]["humanoid"], source.json["extensions"]["VRMC_vrm"]["humanoid"]);
}

#[test]
fn instances_are_drawn_at_every_level_and_switch_as_one() {
    let mut source = square();
    let instancing = json!({ "attributes": { "TRANSLATION": 0, "SCALE": 0 } });
    source.json["nodes"][0]["extensions"] = json!({
        "EXT_mesh_gpu_instancing": instancing,
        "EXT_instance_features": { "featureIds": [] },
        "KHR_node_visibility": { "visible": true },
    });
    source.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    let mut document = source.clone();
    let buffers = Buffers::load(&source, Path::new("")).unwrap();
    let batches = instancing::batches(&source, &buffers).unwrap();
    add_levels(&mut document, &[chain(0, &own(0), &shared())], &batches, &EmitSettings::default()).unwrap();
    assert_eq!(rules::check(&source, &document), []);
    let nodes = document.array("nodes").unwrap();
    assert_eq!(nodes[0]["extensions"], json!({ "KHR_node_visibility": { "visible": true } }));
    for member in &nodes[1..4] {
        assert_eq!(member["extensions"]["EXT_mesh_gpu_instancing"], instancing);
        assert!(member["extensions"].get("EXT_instance_features").is_some());
    }
    // Middles lie on a square of side 1.5, since scales are translations too: half its diagonal, plus the mesh.
    let radius = nodes[1]["extras"]["lodbake"]["radius"].as_f64().unwrap();
    assert!((radius - (1.5 * 0.5_f64.sqrt() + 0.75)).abs() < 1e-6, "{radius}");
}

#[test]
fn levels_of_the_source_stay_as_they_are() {
    let mut source = square();
    let mesh = source.json["meshes"][0].clone();
    source.json["meshes"] = json!([mesh, mesh]);
    source.json["nodes"] = json!([
        { "mesh": 0, "extensions": { "MSFT_lod": { "ids": [1] } }, "children": [2] },
        { "mesh": 1 },
        { "mesh": 0 },
        { "mesh": 1 },
    ]);
    source.json["scenes"] = json!([{ "nodes": [0, 3] }]);
    source.json["extensionsUsed"] = json!(["MSFT_lod"]);
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared()), chain(1, &own(0), &shared())]);
    assert_eq!(added.groups, 1);
    assert_eq!(document.json["nodes"].as_array().unwrap()[..3], source.json["nodes"].as_array().unwrap()[..3]);
    // Mesh 1 is already a lower level, which a reader may drop: the new group has a copy.
    let repeated = document.json["nodes"][4]["mesh"].as_u64().unwrap() as usize;
    assert!(repeated > 1);
    assert_eq!(document.json["meshes"][repeated], source.json["meshes"][1]);
    assert!(
        added.notes.iter().any(|note| note.text.contains("stay as they are") && note.count == 3),
        "{:?}",
        added.notes
    );
}

#[test]
fn variants_and_unknown_extensions() {
    let mut source = square();
    source.json["meshes"][0]["primitives"][0]["extensions"] = json!({
        "KHR_materials_variants": { "mappings": [{ "material": 0, "variants": [0] }] },
        "FB_ngon_encoding": {},
        "VENDOR_x": { "a": 1 },
    });
    source.json["meshes"][0]["primitives"][0]["extras"] = json!({ "part": "door" });
    source.json["nodes"][0]["extensions"] = json!({ "VENDOR_y": {} });
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    let extensions = |mesh: usize| {
        let extensions = document.json["meshes"][mesh]["primitives"][0]["extensions"].as_object().unwrap();
        extensions.keys().cloned().collect::<Vec<_>>()
    };
    assert_eq!(extensions(1), ["KHR_materials_variants"]);
    assert_eq!(extensions(2), ["KHR_materials_variants", "VENDOR_x"]);
    assert_eq!(document.json["meshes"][1]["primitives"][0]["extras"], json!({ "part": "door" }));
    let notes: Vec<String> = added.notes.iter().map(ToString::to_string).collect();
    insta::assert_snapshot!(notes.join("\n"));
}

#[test]
fn lines_are_repeated_and_empty_primitives_left_out() {
    let mut source = square();
    let triangles_json = source.json["meshes"][0]["primitives"][0].clone();
    let lines = json!({ "attributes": { "POSITION": 0 }, "mode": 1, "extensions": { "VENDOR_x": {} } });
    source.json["meshes"][0]["primitives"] = json!([triangles_json, lines, triangles_json]);
    let nothing = Arc::new(LevelPrimitive { indices: vec![], vertices: LevelVertices::Source });
    let primitives =
        vec![PrimitiveLevel::Level(nothing.clone()), PrimitiveLevel::AsSource, PrimitiveLevel::Level(own(0))];
    let levels = vec![MeshLevel { primitives, error: 0.1, facts: Some(json!({ "stopped": "target" })) }];
    let (document, _) = bake(&source, &[MeshLevels { mesh: 0, radius: 1.0, levels }]);
    let primitives = document.json["meshes"][1]["primitives"].as_array().unwrap();
    assert_eq!((primitives.len(), &primitives[0]), (2, &lines));
    assert_eq!(document.json["nodes"][1]["extras"]["lodbake"]["facts"], json!([{ "stopped": "target" }]));
    // A level of which nothing is left is no level.
    let levels = vec![level(std::slice::from_ref(&nothing), 0.1)];
    let mut one = square();
    let added =
        add_levels(&mut one, &[MeshLevels { mesh: 0, radius: 1.0, levels }], &Batches::new(), &EmitSettings::default());
    assert_eq!((added.unwrap().is_empty(), one), (true, square()));
}

#[test]
fn meshes_that_no_node_uses_get_no_levels() {
    let mut source = square();
    source.json["nodes"] = json!([{ "name": "empty" }]);
    let mut document = source.clone();
    let levels = [chain(0, &own(0), &shared())];
    let added = add_levels(&mut document, &levels, &Batches::new(), &EmitSettings::default()).unwrap();
    assert!(added.is_empty() && added.notes.len() == 1);
    assert_eq!(document, source);
}

#[test]
fn names_for_godot_are_new_and_end_in_the_level() {
    let mut source = square();
    source.json["nodes"] = json!([{ "name": "T", "mesh": 0 }, { "name": "T_LOD1" }, { "mesh": 0 }]);
    source.json["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
    let settings = EmitSettings { profile: Profile::Godot, ..EmitSettings::default() };
    let (document, _) = bake_for(&source, &[chain(0, &own(0), &shared())], &settings);
    let names: Vec<_> = document.array("nodes").unwrap()[3..].iter().map(|n| n["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["T_2_LOD0", "T_2_LOD1", "T_2_LOD2", "node2_LOD0", "node2_LOD1", "node2_LOD2"]);
}

#[test]
fn every_profile_keeps_the_rules() {
    for &profile in Profile::ALL {
        let settings = EmitSettings { profile, ..EmitSettings::default() };
        bake_for(&square(), &[chain(0, &own(0), &shared())], &settings);
    }
}

#[test]
fn a_glb_without_bytes_gets_a_bin_chunk() {
    // All accessors without a buffer view: a square of zeros, which is legal.
    let mut source = square();
    for accessor in source.json["accessors"].as_array_mut().unwrap() {
        accessor.as_object_mut().unwrap().shift_remove("bufferView");
    }
    for key in ["buffers", "bufferViews"] {
        source.json.as_object_mut().unwrap().shift_remove(key);
    }
    source.bin = None;
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    assert_eq!(added.buffer, None);
    let length = document.json["buffers"][0]["byteLength"].as_u64().unwrap() as usize;
    assert_eq!((document.array("buffers").unwrap().len(), document.bin.unwrap().len()), (1, length));
}

#[test]
fn a_glb_whose_buffer_is_elsewhere_gets_another_one() {
    let mut source = square();
    source.bin = None;
    source.json["buffers"][0]["uri"] = json!("square.bin");
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    let buffer = added.buffer.unwrap();
    assert_eq!((buffer.index, buffer.bytes.len()), (1, 36 + 8 + 8));
    assert_eq!(document.bin, None);
    assert_eq!(document.json["buffers"][0], source.json["buffers"][0]);
}

#[test]
fn a_document_in_one_piece_stays_in_one_piece() {
    let mut source = square();
    source.container = Container::Gltf;
    let bytes = source.bin.take().unwrap();
    let text = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &bytes[..]);
    source.json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{text}"));
    let (document, added) = bake(&source, &[chain(0, &own(0), &shared())]);
    let package = Package::new(document, &Buffers::default(), Vec::new(), Container::Gltf).unwrap();
    let files = package.finish("square", added.buffer, &Buffers::default()).unwrap();
    assert_eq!(files.beside, []);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(rules::check(&source, &output), []);
    assert_eq!(triangles(&reread(&output), 1), [1]);
}

#[test]
fn compressed_vertices_cannot_be_shared() {
    let mut source = square();
    source.json["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression": {} });
    let words = refusal(&source, &[chain(0, &own(0), &shared())]);
    assert_eq!(
        words,
        "meshes[0].primitives[0], level 2: the source's vertices are compressed with `KHR_draco_mesh_compression` and \
         cannot be shared"
    );
    bake(&source, &[chain(0, &own(0), &own(0))]);
}

#[test]
fn levels_that_do_not_fit_are_refused() {
    let source = square();
    let with = |change: fn(&mut MeshLevels)| {
        let mut levels = chain(0, &own(0), &shared());
        change(&mut levels);
        refusal(&source, &[levels])
    };
    assert_eq!(with(|l| l.mesh = 9), "meshes[9]: this mesh does not exist (there are 1)");
    assert_eq!(with(|l| l.radius = f64::NAN), "meshes[0]: `radius` is NaN, which is no length");
    assert_eq!(with(|l| l.levels[1].error = -1.0), "meshes[0], level 2: `error` is -1, which is no length");
    assert_eq!(with(|l| l.levels[0].primitives.clear()), "meshes[0], level 1: the level has 0 primitives, the mesh 1");
    let mut primitive = (*shared()).clone();
    primitive.indices[2] = 4;
    let levels = [chain(0, &Arc::new(primitive.clone()), &shared())];
    assert_eq!(refusal(&source, &levels), "meshes[0].primitives[0], level 1: index 4 is out of range (4 vertices)");
    primitive.indices.pop();
    let levels = [chain(0, &Arc::new(primitive), &shared())];
    assert!(refusal(&source, &levels).ends_with("2 indices are not a list of triangles"));
    let mut primitive = (*own(0)).clone();
    if let LevelVertices::Own(own) = &mut primitive.vertices {
        own.attributes[0].values[0] = f32::INFINITY;
    }
    let levels = [chain(0, &Arc::new(primitive.clone()), &shared())];
    assert!(refusal(&source, &levels).ends_with("attribute `POSITION` is not finite"));
    if let LevelVertices::Own(own) = &mut primitive.vertices {
        own.attributes[0].values.pop();
    }
    let levels = [chain(0, &Arc::new(primitive), &shared())];
    assert!(refusal(&source, &levels).ends_with("`POSITION` has 8 values for 3 vertices of 3 components"));
    let twice = [chain(0, &own(0), &shared()), chain(0, &own(0), &shared())];
    assert_eq!(refusal(&source, &twice), "meshes[0]: this mesh is given levels twice");
}

#[test]
fn errors_that_tie_still_give_falling_coverage() {
    let levels = [0.0, 0.0, 0.0].map(|error| level(&[own(0)], error)).to_vec();
    let (document, _) = bake(&square(), &[MeshLevels { mesh: 0, radius: 0.0, levels }]);
    let coverage = document.json["nodes"][1]["extras"]["MSFT_screencoverage"].as_array().unwrap();
    assert_eq!(coverage.len(), 4);
    assert_eq!(coverage[3], 0.0);
}
