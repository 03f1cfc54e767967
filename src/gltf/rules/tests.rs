//! Every rule, broken once on an output that is otherwise sound.

use super::*;
use crate::config::EmitSettings;
use crate::gltf::fixture::{chain, own, shared, square};
use crate::gltf::instancing::Batches;
use crate::gltf::lod::add_levels;
use serde_json::json;

/// A morph-animated, skinned, instanced square with variants, and a second node with the same mesh.
fn source() -> Document {
    let mut source = square();
    let root = &mut source.json;
    root["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 2 }]);
    root["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_materials_variants": { "mappings": [] } });
    root["nodes"] = json!([
        { "mesh": 0, "skin": 0, "weights": [0], "children": [1],
          "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } } },
        { "mesh": 0 },
    ]);
    root["skins"] = json!([{ "joints": [1] }]);
    root["animations"] = json!([{
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
        "samplers": [{ "input": 1, "output": 1 }],
    }]);
    root["extras"] = json!({ "kept": [1, 2.5, null] });
    source
}

/// Nodes 0 and 1 are anchors, 2 and 6 their children, 3 and 4 and 7 and 8 the levels; 5 shows level 0 below node 2.
fn output() -> Document {
    let mut output = source();
    add_levels(&mut output, &[chain(0, &own(1), &shared())], &Batches::new(), &EmitSettings::default()).unwrap();
    output
}

/// The rules that `change` breaks, each once.
fn broken(change: impl FnOnce(&mut Value)) -> Vec<Rule> {
    let mut output = output();
    change(&mut output.json);
    rules_of(&check(&source(), &output))
}

fn rules_of(violations: &[Violation]) -> Vec<Rule> {
    let mut rules: Vec<Rule> = violations.iter().map(|violation| violation.rule).collect();
    rules.sort();
    rules.dedup();
    rules
}

#[test]
fn a_sound_output_has_no_violation() {
    assert_eq!(check(&source(), &output()), []);
    assert_eq!(check(&source(), &source()), [], "nor has one to which nothing was added");
}

#[test]
fn violations_say_where() {
    let mut output = output();
    output.json["nodes"][3]["scale"] = json!([1, 1, 1]);
    let words: Vec<String> = check(&source(), &output).iter().map(ToString::to_string).collect();
    assert_eq!(words, ["nodes[3]: `scale` belongs to the anchor (rule 1)"]);
}

#[test]
fn nothing_lost() {
    assert_eq!(broken(|root| root["extras"]["kept"][1] = json!(2)), [Rule::NothingLost]);
    assert_eq!(broken(|root| root["materials"][0] = json!({})), [Rule::NothingLost]);
    assert_eq!(broken(|root| root["asset"]["extras"] = json!(1)), [Rule::NothingLost]);
    assert_eq!(broken(|root| root["accessors"][0]["max"][0] = json!(2)), [Rule::NothingLost]);
    assert_eq!(broken(|root| root["nodes"][1]["name"] = json!("new")), [Rule::NothingLost]);
    assert_eq!(broken(|root| root["buffers"][0]["byteLength"] = json!(4))[0], Rule::NothingLost);
    let mut bytes = output();
    let mut bin = bytes.bin.clone().unwrap().to_vec();
    bin[5] ^= 1;
    bytes.bin = Some(bin.into());
    assert_eq!(rules_of(&check(&source(), &bytes)), [Rule::NothingLost]);
    let mut chunks = output();
    chunks.extra_chunks.push((1, vec![0; 4]));
    assert_eq!(rules_of(&check(&source(), &chunks)), [Rule::NothingLost]);
}

#[test]
fn transforms() {
    assert_eq!(broken(|root| root["nodes"][2]["translation"] = json!([0, 0, 0])), [Rule::Transforms]);
    assert_eq!(broken(|root| root["nodes"][4]["matrix"] = json!([])), [Rule::Transforms]);
    assert_eq!(broken(|root| root["nodes"][3]["children"] = json!([])), [Rule::Transforms]);
    let moved = broken(|root| {
        let target = json!({ "sampler": 0, "target": { "node": 3, "path": "rotation" } });
        root["animations"][0]["channels"].as_array_mut().unwrap().push(target);
    });
    assert_eq!(moved, [Rule::Transforms]);
    assert!(broken(|root| root["nodes"][1]["children"] = json!([])).contains(&Rule::Transforms));
}

#[test]
fn followers() {
    let without = |node: usize, key: &'static str| {
        move |root: &mut Value| {
            root["nodes"][node].as_object_mut().unwrap().shift_remove(key);
        }
    };
    assert_eq!(broken(without(3, "skin")), [Rule::Follow]);
    assert_eq!(broken(without(3, "weights")), [Rule::Follow]);
    let lost_twin = broken(|root| {
        root["animations"][0]["channels"].as_array_mut().unwrap().pop();
    });
    assert_eq!(lost_twin, [Rule::Follow]);
    assert!(broken(|root| root["animations"][0]["channels"][0]["target"]["node"] = json!(0)).contains(&Rule::Follow));
    assert_eq!(broken(|root| root["meshes"][1]["primitives"][0]["material"] = json!(5)), [Rule::Follow]);
    // three.js finds no weights on a node with levels: the mesh may not move up from node 5 to node 2.
    let one_up = broken(|root| {
        for key in ["mesh", "skin", "weights"] {
            let value = root["nodes"][5].as_object_mut().unwrap().shift_remove(key).unwrap();
            root["nodes"][2][key] = value;
        }
        let instancing = root["nodes"][5]["extensions"]["EXT_mesh_gpu_instancing"].take();
        root["nodes"][2]["extensions"]["EXT_mesh_gpu_instancing"] = instancing;
        root["nodes"][2].as_object_mut().unwrap().shift_remove("children");
        root["nodes"][5] = json!({});
        root["animations"][0]["channels"][0]["target"]["node"] = json!(2);
    });
    assert!(one_up.contains(&Rule::Follow), "{one_up:?}");
    assert!(broken(|root| root["nodes"][2]["weights"] = json!([0])).contains(&Rule::Follow));
    let variants = |root: &mut Value| root["meshes"][1]["primitives"][0]["extensions"] = json!({});
    assert_eq!(broken(variants), [Rule::Follow]);
}

#[test]
fn roles() {
    assert_eq!(broken(|root| root["scenes"][0]["nodes"] = json!([0, 3])), [Rule::NothingLost, Rule::Roles]);
    assert!(broken(|root| root["skins"][0]["joints"] = json!([1, 4])).contains(&Rule::Roles));
    assert!(broken(|root| root["nodes"][6]["extensions"]["MSFT_lod"]["ids"] = json!([3, 8])).contains(&Rule::Roles));
    assert!(broken(|root| root["nodes"][3]["mesh"] = json!(0)).contains(&Rule::Roles));
    assert!(broken(|root| root["nodes"][3]["mesh"] = json!(2)).contains(&Rule::Roles));
    assert_eq!(broken(|root| root["nodes"][3]["extras"] = json!({})), [Rule::Roles]);
    assert!(broken(|root| root["nodes"][2]["extensions"]["MSFT_lod"]["ids"] = json!([1])).contains(&Rule::Roles));
}

#[test]
fn coverage() {
    let with = |coverage: Value| broken(move |root| root["nodes"][2]["extras"]["MSFT_screencoverage"] = coverage);
    assert_eq!(with(json!([0.5, 0.4, 0.0])), []);
    for wrong in [json!([0.5, 0.0]), json!([0.5, 0.5, 0.0]), json!([0.5, 0.4, 0.1]), json!([1.5, 0.4, 0.0]), json!(1)] {
        assert_eq!(with(wrong.clone()), [Rule::Coverage], "{wrong}");
    }
    assert_eq!(broken(|root| root["nodes"][2]["extras"]["lodbake"]["distances"] = json!([2, 1])), [Rule::Coverage]);
    assert_eq!(broken(|root| root["nodes"][2]["extras"]["lodbake"]["errors"] = json!([2])), [Rule::Coverage]);
}

#[test]
fn declared() {
    assert!(broken(|root| root["extensionsUsed"] = json!([])).contains(&Rule::Declared));
    assert!(broken(|root| root["extensionsRequired"] = json!(["MSFT_lod"])).contains(&Rule::Declared));
}

#[test]
fn layout() {
    let swap = |root: &mut Value| {
        // The views of the finer level before those of the coarser one.
        let views = root["bufferViews"].as_array_mut().unwrap();
        let (first, second) = (views[3]["byteOffset"].clone(), views[4]["byteOffset"].clone());
        views[3]["byteOffset"] = second;
        views[4]["byteOffset"] = first;
    };
    assert_eq!(broken(swap), [Rule::Layout]);
    let overlap = |root: &mut Value| root["bufferViews"][3]["byteOffset"] = json!(0);
    assert_eq!(broken(overlap), [Rule::Layout]);
    assert_eq!(broken(|root| root["accessors"][4]["count"] = json!(1000)), [Rule::Layout]);
    assert_eq!(broken(|root| root["bufferViews"][4]["byteLength"] = json!(100_000)), [Rule::Layout]);
}

#[test]
fn own_anchors_and_instances() {
    let shared_anchor = broken(|root| {
        root["nodes"][1]["children"] = json!([]);
        root["nodes"][0]["children"] = json!([1, 2, 6]);
    });
    assert!(shared_anchor.contains(&Rule::OwnAnchor));
    let fewer = broken(|root| {
        root["nodes"][4].as_object_mut().unwrap().shift_remove("extensions");
    });
    assert_eq!(fewer, [Rule::Instances]);
}

#[test]
fn new_instances_need_all_three_attributes_and_a_declaration() {
    let instances = |root: &mut Value| {
        let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } });
        for node in 7..9 {
            root["nodes"][node]["extensions"] = instancing.clone();
        }
        root["nodes"][6]["extensions"]["EXT_mesh_gpu_instancing"] = instancing["EXT_mesh_gpu_instancing"].clone();
    };
    assert_eq!(broken(instances), [Rule::NothingLost, Rule::InstanceData, Rule::InstancingDeclared]);
}
