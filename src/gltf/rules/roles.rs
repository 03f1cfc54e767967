//! Rules that only show over all groups together: who else uses a level, which mesh plays which part, what is
//! declared.

use super::group::Group;
use super::{Found, Rule, array, index, indices};
use crate::gltf::document::Document;
use crate::gltf::json;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

pub(super) fn check(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    check_levels_are_alone(output, groups, found);
    check_meshes(source, output, groups, found);
    check_declared(source, output, groups, found);
    check_new_instances(source, output, groups, found);
}

fn check_levels_are_alone(output: &Document, groups: &[Group], found: &mut Found) {
    let mut owners: BTreeMap<usize, usize> = BTreeMap::new();
    for group in groups {
        for &level in &group.levels {
            if let Some(other) = owners.insert(level, group.child) {
                let text = format!("is a level of node {other} and of node {}", group.child);
                found.add(Rule::Roles, format_args!("nodes[{level}]"), text);
            }
        }
    }
    let mut unwanted = |place: String, list: Vec<usize>, what: &str| {
        for level in list.into_iter().filter(|node| owners.contains_key(node)) {
            found.add(Rule::Roles, &place, format!("node {level} is a level and {what}"));
        }
    };
    for (i, node) in array(output, "nodes").iter().enumerate() {
        unwanted(format!("nodes[{i}].children"), indices(node, "children"), "must be nobody's child");
    }
    for (i, scene) in array(output, "scenes").iter().enumerate() {
        unwanted(format!("scenes[{i}].nodes"), indices(scene, "nodes"), "must be in no scene");
    }
    for (i, skin) in array(output, "skins").iter().enumerate() {
        unwanted(format!("skins[{i}].joints"), indices(skin, "joints"), "must be no joint");
    }
}

/// Babylon.js drops the mesh of a coarse level when a finer one has arrived, for all who use it.
fn check_meshes(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    let nodes = array(output, "nodes");
    // Level number and source mesh for which each mesh stands.
    let mut roles: BTreeMap<usize, BTreeSet<(usize, usize)>> = BTreeMap::new();
    let mut members = BTreeSet::new();
    for group in groups {
        let of = index(&array(source, "nodes")[group.anchor], "mesh").unwrap_or(usize::MAX);
        for (number, member) in group.members().enumerate() {
            members.insert(member);
            if let Some(mesh) = index(&nodes[member], "mesh") {
                roles.entry(mesh).or_default().insert((number, of));
            }
        }
    }
    let ours: BTreeSet<usize> = roles.keys().copied().collect();
    let lower = source_levels(source);
    for (i, node) in nodes.iter().enumerate().filter(|(i, _)| !members.contains(i)) {
        if let Some(mesh) = index(node, "mesh").filter(|mesh| ours.contains(mesh)) {
            let number = if lower.contains(&i) { usize::MAX } else { 0 };
            roles.entry(mesh).or_default().insert((number, mesh));
        }
    }
    for (mesh, parts) in roles.iter().filter(|(_, parts)| parts.len() > 1) {
        found.add(Rule::Roles, format_args!("meshes[{mesh}]"), format!("plays several parts (level, mesh): {parts:?}"));
    }
}

/// Nodes that are lower levels of the source's own groups.
fn source_levels(source: &Document) -> BTreeSet<usize> {
    let nodes = array(source, "nodes");
    let groups = nodes.iter().filter_map(|node| json::extension(node, "MSFT_lod"));
    let mut open: Vec<usize> = groups.flat_map(|lod| indices(lod, "ids")).collect();
    let mut levels = BTreeSet::new();
    while let Some(node) = open.pop() {
        if node < nodes.len() && levels.insert(node) {
            open.extend(indices(&nodes[node], "children"));
        }
    }
    levels
}

fn check_declared(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    const LOD: &str = "MSFT_lod";
    if !groups.is_empty() {
        let used = output.lists_extension("extensionsUsed", LOD);
        found.require(used, Rule::Declared, "extensionsUsed", "lacks `MSFT_lod`");
    }
    let required = output.lists_extension("extensionsRequired", LOD);
    let before = source.lists_extension("extensionsRequired", LOD);
    found.require(required == before, Rule::Declared, "extensionsRequired", "`MSFT_lod` must not be required");
}

/// Instances that are not in the source: lodbake's own.
fn check_new_instances(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    const INSTANCING: &str = "EXT_mesh_gpu_instancing";
    let origins: BTreeMap<usize, usize> =
        groups.iter().flat_map(|group| group.members().map(|member| (member, group.anchor))).collect();
    let in_source = |node: usize| {
        let origin = origins.get(&node).copied().unwrap_or(node);
        array(source, "nodes").get(origin).is_some_and(|node| json::extension(node, INSTANCING).is_some())
    };
    for (i, node) in array(output, "nodes").iter().enumerate() {
        let Some(instances) = json::extension(node, INSTANCING).filter(|_| !in_source(i)) else { continue };
        let place = format!("nodes[{i}].extensions.{INSTANCING}");
        found.require(
            node.get("mesh").is_some(),
            Rule::Instances,
            &place,
            "instances of nothing: the node has no mesh",
        );
        let declared = output.lists_extension("extensionsUsed", INSTANCING);
        found.require(declared, Rule::InstancingDeclared, &place, "is not in `extensionsUsed`");
        for (name, kind) in [("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")] {
            let plain = is_plain(output, &instances["attributes"][name], kind);
            let text = format!("`{name}` is not a plain {kind} of floats in a buffer view of its own");
            found.require(plain, Rule::InstanceData, &place, text);
        }
    }
}

fn is_plain(output: &Document, accessor: &Value, kind: &str) -> bool {
    let Some(number) = json::integer(accessor).map(|i| i as usize) else { return false };
    let accessors = array(output, "accessors");
    let Some(accessor) = accessors.get(number) else { return false };
    let view = index(accessor, "bufferView");
    let alone = accessors.iter().filter(|other| index(other, "bufferView") == view).count() == 1;
    let packed = view.and_then(|v| array(output, "bufferViews").get(v)).is_some_and(|v| v.get("byteStride").is_none());
    accessor["componentType"] == 5126 && accessor["type"] == kind && accessor.get("sparse").is_none() && alone && packed
}
