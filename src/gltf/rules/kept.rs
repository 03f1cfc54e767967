//! Is everything that the source says still said, at the same place?
//!
//! Takes the documented moves back (the mesh from the child to its anchor, what follows it, appended entries) and
//! compares what is left with the source, value by value.

use super::group::Group;
use super::{Found, Rule, array, index};
use crate::gltf::document::{Container, Document};
use crate::gltf::json;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Lists of the root that may grow at the end.
const GROWING: [&str; 6] = ["accessors", "bufferViews", "buffers", "meshes", "nodes", "extensionsUsed"];

/// More differences than this have one cause.
const REPORTED: usize = 20;

pub(super) fn check(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    let mut restored = output.json.clone();
    // Deepest knowledge first: groups refer to entries that truncation removes.
    for group in groups {
        restore_anchor(&mut restored, source, group);
    }
    restore_references(&mut restored, &source.json, groups);
    for name in GROWING {
        truncate(&mut restored, &source.json, name);
    }
    restore_storage(&mut restored, source, output);
    let mut differences = Vec::new();
    compare(&source.json, &restored, &mut String::new(), &mut differences);
    for (place, text) in differences {
        found.add(Rule::NothingLost, place, text);
    }
    check_binary(source, output, found);
}

/// Puts the mesh and what belongs to it back on the anchor.
fn restore_anchor(root: &mut Value, source: &Document, group: &Group) {
    let before = &array(source, "nodes")[group.anchor];
    let mut carrier = root["nodes"][group.carrier].clone();
    // A repeated mesh stands for the one it repeats.
    if let (Some(mesh), Some(original)) = (index(&carrier, "mesh"), index(before, "mesh"))
        && mesh >= array(source, "meshes").len()
        && root["meshes"][mesh] == root["meshes"][original]
    {
        carrier["mesh"] = json!(original);
    }
    let anchor = &mut root["nodes"][group.anchor];
    if let Some(children) = anchor["children"].as_array_mut() {
        children.retain(|c| json::integer(c) != Some(group.child as u64));
        if children.is_empty() && before.get("children").is_none() {
            anchor.as_object_mut().map(|node| node.shift_remove("children"));
        }
    }
    for key in ["mesh", "skin", "weights"] {
        if let Some(value) = carrier.get(key) {
            anchor[key] = value.clone();
        }
    }
    for (name, value) in carrier["extensions"].as_object().into_iter().flatten() {
        if name != "MSFT_lod" {
            anchor["extensions"][name] = value.clone();
        }
    }
}

/// Lets everything that points at a child point at its anchor again, and drops what was repeated for the levels.
fn restore_references(root: &mut Value, source: &Value, groups: &[Group]) {
    let anchors: BTreeMap<usize, usize> = groups.iter().map(|group| (group.carrier, group.anchor)).collect();
    let animations = source["animations"].as_array().map_or(0, Vec::len);
    for i in 0..animations {
        truncate(&mut root["animations"][i], &source["animations"][i], "channels");
        for channel in root["animations"][i]["channels"].as_array_mut().into_iter().flatten() {
            restore_index(channel.get_mut("target"), "node", &anchors);
        }
    }
    for node in root["nodes"].as_array_mut().into_iter().flatten() {
        for kind in ["collider", "trigger"] {
            let place = format!("/extensions/KHR_physics_rigid_bodies/{kind}/geometry");
            restore_index(node.pointer_mut(&place), "node", &anchors);
        }
    }
    if let (Some(output), Some(source)) = (root.get_mut("extensions"), source.get("extensions")) {
        restore_vrm(output, source, &anchors);
    }
    restore_pointers(root, false, &anchors);
}

fn restore_vrm(output: &mut Value, source: &Value, anchors: &BTreeMap<usize, usize>) {
    let mut lists =
        vec!["/VRMC_vrm/firstPerson/meshAnnotations".to_owned(), "/VRM/firstPerson/meshAnnotations".to_owned()];
    for kind in ["preset", "custom"] {
        let place = format!("/VRMC_vrm/expressions/{kind}");
        let names = source.pointer(&place).and_then(Value::as_object).into_iter().flat_map(|e| e.keys());
        lists.extend(
            names.map(|name| format!("{place}/{}/morphTargetBinds", name.replace('~', "~0").replace('/', "~1"))),
        );
    }
    let groups = source.pointer("/VRM/blendShapeMaster/blendShapeGroups").and_then(Value::as_array);
    lists.extend((0..groups.map_or(0, Vec::len)).map(|i| format!("/VRM/blendShapeMaster/blendShapeGroups/{i}/binds")));
    for place in lists {
        let length = source.pointer(&place).and_then(Value::as_array).map(Vec::len);
        let list = output.pointer_mut(&place).and_then(Value::as_array_mut);
        if let (Some(length), Some(list)) = (length, list) {
            list.truncate(length);
            for entry in list {
                restore_index(Some(entry), "node", anchors);
            }
        }
    }
}

fn restore_index(object: Option<&mut Value>, key: &str, anchors: &BTreeMap<usize, usize>) {
    let Some(object) = object else { return };
    if let Some(anchor) = index(object, key).and_then(|child| anchors.get(&child)) {
        object[key] = json!(anchor);
    }
}

fn restore_pointers(value: &mut Value, inside: bool, anchors: &BTreeMap<usize, usize>) {
    match value {
        Value::String(text) if inside => {
            let pointer = text.strip_prefix("/nodes/").and_then(|rest| rest.split_once('/'));
            let anchor = pointer.and_then(|(node, rest)| Some((anchors.get(&node.parse().ok()?)?, rest)));
            if let Some((anchor, rest)) = anchor {
                *text = format!("/nodes/{anchor}/{rest}");
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| restore_pointers(item, inside, anchors)),
        Value::Object(entries) => {
            for (key, entry) in entries {
                restore_pointers(entry, inside || key == "extensions", anchors);
            }
        }
        _ => {}
    }
}

/// Drops what was appended to the list `name`, and the list itself where the source has none.
fn truncate(output: &mut Value, source: &Value, name: &str) {
    match source.get(name) {
        Some(Value::Array(before)) => {
            if let Some(after) = output.get_mut(name).and_then(Value::as_array_mut) {
                after.truncate(before.len());
            }
        }
        Some(_) => {}
        None => {
            output.as_object_mut().map(|root| root.shift_remove(name));
        }
    }
}

/// The BIN chunk or a buffer that levels were appended to grows, and another container keeps buffers and images in other ways.
fn restore_storage(root: &mut Value, source: &Document, output: &Document) {
    let converted = source.container != output.container;
    for (i, before) in array(source, "buffers").iter().enumerate() {
        let Some(after) = root["buffers"].get_mut(i) else { continue };
        let is_bin = i == 0 && output.container == Container::Glb && after.get("uri").is_none();
        // Levels may lie behind the source's bytes in a file of another name.
        let old_views = array(source, "bufferViews").len();
        let hosts =
            !is_bin && array(output, "bufferViews").iter().skip(old_views).any(|v| index(v, "buffer") == Some(i));
        if (is_bin || hosts) && index(after, "byteLength") >= index(before, "byteLength") {
            after["byteLength"] = before["byteLength"].clone();
        }
        if hosts {
            copy_key(after, before, "uri");
        }
        if converted {
            copy_key(after, before, "uri");
        }
    }
    for (i, before) in array(source, "images").iter().enumerate().filter(|_| converted) {
        let Some(after) = root["images"].get_mut(i) else { continue };
        // Exactly one of the two says where the image is.
        if after.get("uri").is_some() != after.get("bufferView").is_some() {
            for key in ["uri", "bufferView", "mimeType"] {
                copy_key(after, before, key);
            }
        }
    }
}

fn copy_key(to: &mut Value, from: &Value, key: &str) {
    match from.get(key) {
        Some(value) => to[key] = value.clone(),
        None => {
            to.as_object_mut().map(|entry| entry.shift_remove(key));
        }
    }
}

fn compare(source: &Value, output: &Value, place: &mut String, differences: &mut Vec<(String, String)>) {
    if differences.len() >= REPORTED {
        return;
    }
    let length = place.len();
    match (source, output) {
        (Value::Object(before), Value::Object(after)) => {
            for (key, value) in before {
                if !place.is_empty() {
                    place.push('.');
                }
                place.push_str(key);
                match after.get(key) {
                    Some(other) => compare(value, other, place, differences),
                    None => differences.push((place.clone(), "is lost".to_owned())),
                }
                place.truncate(length);
            }
            for key in after.keys().filter(|key| !before.contains_key(*key)) {
                differences.push((place.clone(), format!("`{key}` was not in the source")));
            }
        }
        (Value::Array(before), Value::Array(after)) if before.len() == after.len() => {
            for (i, (value, other)) in before.iter().zip(after).enumerate() {
                write!(place, "[{i}]").expect("writing to memory does not fail");
                compare(value, other, place, differences);
                place.truncate(length);
            }
        }
        (before, after) if before == after => {}
        (Value::Array(before), Value::Array(after)) => {
            differences.push((place.clone(), format!("had {} entries, has {}", before.len(), after.len())));
        }
        _ => differences.push((place.clone(), "has another value than in the source".to_owned())),
    }
}

/// The BIN chunk begins with the source's; chunks nobody knows are still there.
fn check_binary(source: &Document, output: &Document, found: &mut Found) {
    if source.container != Container::Glb || output.container != Container::Glb {
        return;
    }
    let (before, after) = (source.bin.as_deref().unwrap_or_default(), output.bin.as_deref().unwrap_or_default());
    found.require(after.starts_with(before), Rule::NothingLost, "BIN", "does not begin with the source's bytes");
    let chunks = source.extra_chunks == output.extra_chunks;
    found.require(chunks, Rule::NothingLost, "chunks", "chunks of other types are not those of the source");
}
