//! Whoever pointed at a mesh that moved to a child follows it there, and drives every level like the finest.
//!
//! Two kinds of references mean "the mesh of this node" while they name the node: animation channels of weights, and
//! pointers into the parts that moved (`KHR_animation_pointer` and its kin). VRM and the physics extension name nodes
//! and meshes by number. Transforms, visibility, lights, cameras and joints stay where they were: on the anchor.
//! Knows nothing of geometry.

use super::document::Document;
use super::error::DocumentError;
use super::instancing::MOVE_WITH_MESH;
use super::json;
use super::notes::Notes;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// In the target of a channel.
const POINTER: &str = "/extensions/KHR_animation_pointer/pointer";

/// One lower level of a group.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelNode {
    pub(super) node: usize,
    pub(super) mesh: usize,
    /// Its mesh has the source's morph targets.
    pub(super) targets: bool,
}

/// One mesh that moved from a node to one below it.
#[derive(Clone, Debug)]
pub(super) struct Moved {
    /// Where it was: the anchor.
    pub(super) node: usize,
    /// Where it is now: the appended child, or the child of that one.
    pub(super) carrier: usize,
    pub(super) mesh: usize,
    /// The copy that the child uses instead of `mesh`, if it had to be repeated.
    pub(super) repeated: Option<usize>,
    pub(super) levels: Vec<LevelNode>,
}

impl Moved {
    /// Levels that weights can drive.
    fn with_targets(&self) -> Vec<usize> {
        self.levels.iter().filter(|level| level.targets).map(|level| level.node).collect()
    }

    fn all_levels(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.node).collect()
    }
}

/// Nodes whose morph weights an animation drives, by a channel or by a pointer.
pub(super) fn nodes_with_driven_weights(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let mut driven = BTreeSet::new();
    for animation in document.array("animations")? {
        let channels = animation.get("channels").and_then(Value::as_array);
        for target in channels.into_iter().flatten().filter_map(|channel| channel.get("target")) {
            if target["path"] == "weights" {
                driven.extend(target.get("node").and_then(json::integer).map(|node| node as usize));
            }
            let pointer = target.pointer(POINTER).and_then(Value::as_str);
            let below = pointer.and_then(|text| text.strip_prefix("/nodes/")?.split_once('/'));
            if let Some((node, rest)) = below
                && rest.split('/').next() == Some("weights")
            {
                driven.extend(node.parse::<usize>());
            }
        }
    }
    Ok(driven)
}

/// Mends all references in the document.
pub(super) fn follow(document: &mut Document, moved: &[Moved], notes: &mut Notes) -> Result<(), DocumentError> {
    let trail = Trail::new(moved);
    if document.json.get("animations").is_some() {
        for animation in document.array_mut("animations")? {
            trail.animation(animation);
        }
    }
    trail.vrm(&mut document.json);
    let Value::Object(root) = &mut document.json else { return Ok(()) };
    for (key, value) in root {
        trail.pointers(value, key == "extensions", (key, notes));
    }
    for node in document.array_mut("nodes")? {
        trail.colliders(node);
    }
    Ok(())
}

/// Who moved where.
struct Trail<'a> {
    nodes: BTreeMap<usize, &'a Moved>,
    /// For each source mesh: the other meshes that stand for it, and whether they have its morph targets.
    meshes: BTreeMap<usize, Vec<(usize, bool)>>,
}

/// A pointer into something that moved, taken apart.
struct Pointer<'p> {
    moved: &'p Moved,
    /// From the property on: `weights/0`.
    rest: String,
}

impl Pointer<'_> {
    fn to(&self, node: usize) -> Value {
        json!(format!("/nodes/{node}/{}", self.rest))
    }

    /// Level nodes that have what the pointer means.
    fn levels(&self) -> Vec<usize> {
        let weights = self.rest.split('/').next() == Some("weights");
        if weights { self.moved.with_targets() } else { self.moved.all_levels() }
    }
}

impl<'a> Trail<'a> {
    fn new(moved: &'a [Moved]) -> Self {
        let mut meshes: BTreeMap<usize, Vec<(usize, bool)>> = BTreeMap::new();
        for entry in moved {
            let others = meshes.entry(entry.mesh).or_default();
            if others.is_empty() {
                others.extend(entry.repeated.map(|mesh| (mesh, true)));
                others.extend(entry.levels.iter().map(|level| (level.mesh, level.targets)));
            }
        }
        Self { nodes: moved.iter().map(|entry| (entry.node, entry)).collect(), meshes }
    }

    /// Meshes that stand for `mesh` at lower levels; only those with its morph targets if `weights`.
    fn level_meshes(&self, mesh: usize, weights: bool) -> Vec<usize> {
        let others = self.meshes.get(&mesh).into_iter().flatten();
        others.filter(|&&(_, targets)| targets || !weights).map(|&(mesh, _)| mesh).collect()
    }

    /// `/nodes/N/weights/0` where N is an anchor and `weights` left it.
    fn pointer(&self, text: &str) -> Option<Pointer<'_>> {
        let (index, rest) = text.strip_prefix("/nodes/")?.split_once('/')?;
        let moved = self.nodes.get(&index.parse().ok()?)?;
        let mut steps = rest.split('/');
        let left = match steps.next()? {
            "mesh" | "skin" | "weights" => true,
            "extensions" => steps.next().is_some_and(|name| MOVE_WITH_MESH.contains(&name)),
            _ => false,
        };
        left.then(|| Pointer { moved, rest: rest.to_owned() })
    }

    /// Channels keep their places; repeated ones are appended and share the sampler.
    fn animation(&self, animation: &mut Value) {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { return };
        let mut repeated = Vec::new();
        for channel in channels.iter_mut() {
            self.weights_channel(channel, &mut repeated);
            self.pointer_channel(channel, &mut repeated);
        }
        channels.append(&mut repeated);
    }

    fn weights_channel(&self, channel: &mut Value, repeated: &mut Vec<Value>) {
        let Some(target) = channel.get("target").filter(|t| t["path"] == "weights") else { return };
        let node = target.get("node").and_then(json::integer);
        let Some(moved) = node.and_then(|node| self.nodes.get(&(node as usize))) else { return };
        for level in moved.with_targets() {
            let mut copy = channel.clone();
            copy["target"]["node"] = json!(level);
            repeated.push(copy);
        }
        channel["target"]["node"] = json!(moved.carrier);
    }

    fn pointer_channel(&self, channel: &mut Value, repeated: &mut Vec<Value>) {
        let Some(target) = channel.get("target") else { return };
        let Some(text) = target.pointer(POINTER).and_then(Value::as_str).map(str::to_owned) else { return };
        let mut others = Vec::new();
        if let Some(pointer) = self.pointer(&text) {
            others.extend(pointer.levels().into_iter().map(|node| pointer.to(node)));
        } else if let Some((mesh, rest)) = text.strip_prefix("/meshes/").and_then(|t| t.split_once('/')) {
            // Default weights of a mesh: its levels have their own.
            if let (Ok(mesh), Some("weights")) = (mesh.parse(), rest.split('/').next()) {
                let levels = self.level_meshes(mesh, true);
                others.extend(levels.into_iter().map(|mesh| json!(format!("/meshes/{mesh}/{rest}"))));
            }
        }
        for other in others {
            let mut copy = channel.clone();
            if let Some(place) = copy["target"].pointer_mut(POINTER) {
                *place = other;
            }
            repeated.push(copy);
        }
    }

    /// Rewrites every pointer inside extensions. Only animation channels can be repeated for the levels.
    fn pointers(&self, value: &mut Value, inside: bool, (root, notes): (&str, &mut Notes)) {
        match value {
            Value::String(text) if inside => {
                if let Some(pointer) = self.pointer(text) {
                    let target = pointer.to(pointer.moved.carrier);
                    if root != "animations" {
                        notes
                            .add(root, "a pointer follows its mesh to the added child and does not drive lower levels");
                    }
                    *value = target;
                } else if text.starts_with("/nodes/{") {
                    notes.add(root, "a pointer with a variable node cannot follow meshes to added children");
                }
            }
            Value::Array(items) => items.iter_mut().for_each(|item| self.pointers(item, inside, (root, notes))),
            Value::Object(entries) => {
                for (key, entry) in entries {
                    self.pointers(entry, inside || key == "extensions", (root, notes));
                }
            }
            _ => {}
        }
    }

    /// VRM 1.0 names nodes, VRM 0 names meshes; both mean the mesh and its morph targets.
    fn vrm(&self, root: &mut Value) {
        let Some(extensions) = root.get_mut("extensions") else { return };
        if let Some(vrm) = extensions.get_mut("VRMC_vrm") {
            for kind in ["preset", "custom"] {
                let named = vrm.get_mut("expressions").and_then(|e| e.get_mut(kind)).and_then(Value::as_object_mut);
                for expression in named.into_iter().flat_map(|named| named.values_mut()) {
                    self.repeat(expression.get_mut("morphTargetBinds"), "node", true);
                }
            }
            self.repeat(vrm.pointer_mut("/firstPerson/meshAnnotations"), "node", false);
        }
        if let Some(vrm) = extensions.get_mut("VRM") {
            let groups = vrm.pointer_mut("/blendShapeMaster/blendShapeGroups").and_then(Value::as_array_mut);
            for group in groups.into_iter().flatten() {
                self.repeat(group.get_mut("binds"), "mesh", true);
            }
            self.repeat(vrm.pointer_mut("/firstPerson/meshAnnotations"), "mesh", false);
        }
    }

    /// Entries of `list` that name an anchor (or a mesh) under `key` go to where it moved and are repeated for the
    /// levels, behind the existing entries.
    fn repeat(&self, list: Option<&mut Value>, key: &str, weights: bool) {
        let Some(list) = list.and_then(Value::as_array_mut) else { return };
        let mut repeated = Vec::new();
        for entry in list.iter_mut() {
            let Some(index) = entry.get(key).and_then(json::integer).map(|i| i as usize) else { continue };
            let others = if key == "mesh" {
                self.level_meshes(index, weights)
            } else if let Some(moved) = self.nodes.get(&index) {
                entry[key] = json!(moved.carrier);
                if weights { moved.with_targets() } else { moved.all_levels() }
            } else {
                continue;
            };
            for other in others {
                let mut copy = entry.clone();
                copy[key] = json!(other);
                repeated.push(copy);
            }
        }
        list.append(&mut repeated);
    }

    /// A collider's `geometry.node` is the node whose mesh gives the shape.
    fn colliders(&self, node: &mut Value) {
        for kind in ["collider", "trigger"] {
            let place = format!("/extensions/KHR_physics_rigid_bodies/{kind}/geometry/node");
            let Some(shape) = node.pointer_mut(&place) else { continue };
            let moved = json::integer(shape).and_then(|index| self.nodes.get(&(index as usize)));
            if let Some(moved) = moved {
                *shape = json!(moved.carrier);
            }
        }
    }
}
