//! One group of levels: its anchor, its child, its level nodes, and the rules that can be seen on them alone.

use super::drives::{Drive, Drives};
use super::{Found, Rule, array, index, indices};
use crate::gltf::document::Document;
use crate::gltf::json;
use serde_json::Value;
use std::collections::BTreeMap;

/// What no node below an anchor may have.
const TRANSFORM_KEYS: [&str; 5] = ["translation", "rotation", "scale", "matrix", "children"];

/// What leaves an anchor together with its mesh.
pub(super) const MESH_KEYS: [&str; 3] = ["mesh", "skin", "weights"];
pub(super) const MESH_EXTENSIONS: [&str; 2] = ["EXT_mesh_gpu_instancing", "EXT_instance_features"];

/// A group that the output has and the source has not.
pub(super) struct Group {
    /// A node of the source.
    pub(super) anchor: usize,
    /// Carries the extension.
    pub(super) child: usize,
    /// Shows level 0: the child, or the only child of that one where morph weights are animated.
    pub(super) carrier: usize,
    /// Finest first.
    pub(super) levels: Vec<usize>,
}

impl Group {
    /// Groups on appended nodes, in the order of their children.
    pub(super) fn find_all(source: &Document, output: &Document, found: &mut Found) -> Vec<Self> {
        let nodes = array(output, "nodes");
        let old = array(source, "nodes").len();
        let mut parents = vec![Vec::new(); nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            for child in indices(node, "children") {
                if let Some(list) = parents.get_mut(child) {
                    list.push(i);
                }
            }
        }
        let mut groups: Vec<Self> = Vec::new();
        let mut children: BTreeMap<usize, usize> = BTreeMap::new();
        for child in old..nodes.len() {
            let Some(lod) = json::extension(&nodes[child], "MSFT_lod") else { continue };
            let place = format!("nodes[{child}]");
            let [anchor] = parents[child][..] else {
                found.add(
                    Rule::Transforms,
                    place,
                    format!("has {} parents instead of an anchor", parents[child].len()),
                );
                continue;
            };
            if anchor >= old {
                found.add(Rule::Transforms, place, format!("its anchor {anchor} is not a node of the source"));
                continue;
            }
            if let Some(other) = children.insert(anchor, child) {
                found.add(Rule::OwnAnchor, &place, format!("shares its anchor {anchor} with node {other}"));
            }
            let levels = indices(lod, "ids");
            let sound = !levels.is_empty() && levels.iter().all(|&level| level >= old && level < nodes.len());
            found.require(sound, Rule::Roles, &place, "`MSFT_lod.ids` are not appended nodes");
            if sound {
                let carrier = match indices(&nodes[child], "children")[..] {
                    [below] if below >= old && below < nodes.len() && index(&nodes[child], "mesh").is_none() => below,
                    _ => child,
                };
                groups.push(Self { anchor, child, carrier, levels });
            }
        }
        groups
    }

    pub(super) fn check(&self, source: &Document, output: &Document, drives: &Drives<'_>, found: &mut Found) {
        self.check_anchor(source, output, found);
        self.check_transforms(output, found);
        self.check_coverage(output, found);
        self.check_followers(output, found);
        self.check_drives(output, drives, found);
        self.check_materials(output, found);
    }

    /// The nodes with meshes: level 0 first.
    pub(super) fn members(&self) -> impl Iterator<Item = usize> {
        std::iter::once(self.carrier).chain(self.levels.iter().copied())
    }

    fn check_anchor(&self, source: &Document, output: &Document, found: &mut Found) {
        let place = format!("nodes[{}]", self.anchor);
        let (before, after) = (&array(source, "nodes")[self.anchor], &array(output, "nodes")[self.anchor]);
        found.require(before.get("mesh").is_some(), Rule::Transforms, &place, "is an anchor but never had a mesh");
        for key in MESH_KEYS {
            found.require(after.get(key).is_none(), Rule::Follow, &place, format!("`{key}` is still on the anchor"));
        }
        for name in MESH_EXTENSIONS {
            let gone = after.get("extensions").is_none_or(|e| e.get(name).is_none());
            found.require(gone, Rule::Instances, &place, format!("`{name}` is still on the anchor"));
        }
    }

    fn check_transforms(&self, output: &Document, found: &mut Found) {
        for member in self.members() {
            let (place, node) = (format!("nodes[{member}]"), &array(output, "nodes")[member]);
            for key in TRANSFORM_KEYS {
                let text = format!("`{key}` belongs to the anchor");
                found.require(node.get(key).is_none(), Rule::Transforms, &place, text);
            }
            found.require(index(node, "mesh").is_some(), Rule::Roles, &place, "a level without a mesh");
        }
        if self.carrier == self.child {
            return;
        }
        let (place, node) = (format!("nodes[{}]", self.child), &array(output, "nodes")[self.child]);
        for key in TRANSFORM_KEYS.iter().filter(|&&key| key != "children") {
            let text = format!("`{key}` belongs to the anchor");
            found.require(node.get(key).is_none(), Rule::Transforms, &place, text);
        }
        for key in MESH_KEYS {
            let text = format!("`{key}` belongs to the node below it");
            found.require(node.get(key).is_none(), Rule::Follow, &place, text);
        }
        let below = &array(output, "nodes")[self.carrier];
        let strays = below.get("extras").is_some() || extension(below, "MSFT_lod").is_some();
        found.require(!strays, Rule::Roles, format_args!("nodes[{}]", self.carrier), "says something of levels itself");
    }

    fn check_coverage(&self, output: &Document, found: &mut Found) {
        let place = format!("nodes[{}].extras", self.child);
        let extras = &array(output, "nodes")[self.child]["extras"];
        let coverage: Vec<f64> = numbers(&extras["MSFT_screencoverage"]);
        // Readers for which a number is where its level starts get 1 first instead of 0 last.
        let by_start = extras["lodbake"]["coverage"] == "start";
        let ends = if by_start { coverage.first() == Some(&1.0) } else { coverage.last() == Some(&0.0) };
        let length = coverage.len() == self.levels.len() + 1;
        found.require(
            length,
            Rule::Coverage,
            &place,
            format!("{} levels but coverage {coverage:?}", self.levels.len()),
        );
        found.require(ends, Rule::Coverage, &place, format!("coverage {coverage:?} does not end in 0"));
        let falls = coverage.windows(2).all(|w| (w[1] as f32) < w[0] as f32);
        let range = coverage.iter().all(|c| (0.0..=1.0).contains(c));
        found.require(
            falls && range,
            Rule::Coverage,
            &place,
            format!("coverage {coverage:?} is not falling within [0, 1]"),
        );
        for list in ["errors", "distances", "triangles"] {
            let length = extras["lodbake"][list].as_array().map(Vec::len);
            let text = format!("`lodbake.{list}` is not one number for each level");
            found.require(length == Some(self.levels.len()), Rule::Coverage, &place, text);
        }
        let distances = numbers(&extras["lodbake"]["distances"]);
        let grows = distances.windows(2).all(|w| w[0] <= w[1]);
        found.require(grows, Rule::Coverage, &place, "`lodbake.distances` do not grow");
    }

    fn check_followers(&self, output: &Document, found: &mut Found) {
        let nodes = array(output, "nodes");
        let child = &nodes[self.carrier];
        for &level in &self.levels {
            let (place, node) = (format!("nodes[{level}]"), &nodes[level]);
            let same_skin = node.get("skin") == child.get("skin");
            found.require(same_skin, Rule::Follow, &place, "has another skin than level 0");
            let weights = if has_targets(output, node) { child.get("weights") } else { None };
            found.require(node.get("weights") == weights, Rule::Follow, &place, "has other weights than level 0");
            for name in MESH_EXTENSIONS {
                let same = extension(node, name) == extension(child, name);
                found.require(same, Rule::Instances, &place, format!("`{name}` differs from level 0"));
            }
            let strays = node.get("extras").is_some() || extension(node, "MSFT_lod").is_some();
            found.require(!strays, Rule::Roles, &place, "a level says something of levels itself");
        }
    }

    /// Channels move the anchor; what drives the child's weights drives every level's, by the same sampler.
    fn check_drives(&self, output: &Document, drives: &Drives<'_>, found: &mut Found) {
        let nodes = array(output, "nodes");
        for drive in drives.of(self.anchor) {
            let text = "drives the anchor, the mesh is below it";
            found.require(!drive.is_of_mesh(), Rule::Follow, drive.place(), text);
        }
        for member in self.members() {
            for drive in drives.of(member) {
                let text = "moves a level instead of the anchor";
                found.require(drive.goes_with_mesh(), Rule::Transforms, drive.place(), text);
            }
        }
        for drive in drives.of(self.carrier) {
            let found_by_engines = !drive.property.starts_with("weights") || self.carrier != self.child;
            let text = "drives weights of a node with levels, which three.js does not find";
            found.require(found_by_engines, Rule::Follow, drive.place(), text);
            for &level in &self.levels {
                let wanted = !drive.property.starts_with("weights") || has_targets(output, &nodes[level]);
                let twin = |other: &Drive<'_>| {
                    (other.animation, other.property, other.sampler) == (drive.animation, drive.property, drive.sampler)
                };
                let driven = drives.of(level).iter().any(twin);
                let text = format!("drives level 0 but not node {level}");
                found.require(driven || !wanted, Rule::Follow, drive.place(), text);
            }
        }
    }

    /// Each primitive of a level is one of level 0, in order: the same material with the same variants.
    fn check_materials(&self, output: &Document, found: &mut Found) {
        let (nodes, meshes) = (array(output, "nodes"), array(output, "meshes"));
        let primitives = |node: usize| -> Vec<&Value> {
            let mesh = index(&nodes[node], "mesh").and_then(|mesh| meshes.get(mesh));
            mesh.and_then(|m| m["primitives"].as_array()).into_iter().flatten().collect()
        };
        let look = |p: &Value| (p.get("material").cloned(), extension(p, "KHR_materials_variants").cloned());
        for &level in &self.levels {
            let mut finest = primitives(self.carrier).into_iter();
            let all = primitives(level).into_iter().all(|p| finest.any(|f| look(f) == look(p)));
            let text = "a level's primitive has a material or variants that level 0 has not";
            found.require(all, Rule::Follow, format_args!("nodes[{level}].mesh"), text);
            found.require(!primitives(level).is_empty(), Rule::Roles, format_args!("nodes[{level}].mesh"), "is empty");
        }
    }
}

fn has_targets(output: &Document, node: &Value) -> bool {
    let mesh = index(node, "mesh").and_then(|mesh| array(output, "meshes").get(mesh));
    let first = mesh.and_then(|m| m["primitives"].get(0));
    first.and_then(|p| p["targets"].as_array()).is_some_and(|targets| !targets.is_empty())
}

fn extension<'v>(value: &'v Value, name: &str) -> Option<&'v Value> {
    value.get("extensions")?.get(name)
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}
