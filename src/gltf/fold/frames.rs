//! Where nodes stand, seen from the next node above them that something can move, and whether anybody could miss them.
//!
//! A node is a *handle* if anything knows or moves it: an animation, a skin, an extension, a camera, `extras`, and its name
//! unless names are but labels. Handles stay, and what hangs below one moves with it; all other nodes are transforms.

use super::Instance;
use crate::gltf::anchors::SourceGroups;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use crate::gltf::similarity;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// What a batch hangs from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Base {
    /// The roots of some scenes, as a number for [`Frames::scenes`].
    Scenes(usize),
    /// A handle.
    Node(usize),
}

/// Where nodes stand.
pub(super) struct Frames {
    names_are_labels: bool,
    /// As a fraction of the radius.
    tolerance: f64,
    parents: Vec<Option<usize>>,
    children: Vec<usize>,
    /// Handles, and nodes that draw something.
    needed: Vec<bool>,
    /// Animated, a joint, named by a pointer, or oddly placed.
    targets: BTreeSet<usize>,
    /// Nodes of levels that the source brings along.
    levels: BTreeSet<usize>,
    /// Meshes with morph targets.
    morphed: BTreeSet<usize>,
    /// What each node's own transform counts from; `None` if no scene shows it.
    bases: Vec<Option<Base>>,
    /// From there to the node's parent, where anything is between.
    between: BTreeMap<usize, DMat4>,
    scenes: Vec<Vec<usize>>,
}

impl Frames {
    pub(super) fn new(document: &Document, names_are_labels: bool, tolerance: f64) -> Result<Self, DocumentError> {
        let nodes = document.array("nodes")?;
        let mut parents = vec![None; nodes.len()];
        let mut children = vec![0; nodes.len()];
        for (parent, node) in nodes.iter().enumerate() {
            for child in list(node, "children") {
                parents[child] = Some(parent);
                children[parent] += 1;
            }
        }
        let mut frames = Self {
            names_are_labels,
            tolerance,
            parents,
            children,
            needed: Vec::new(),
            targets: targets(document)?,
            levels: SourceGroups::find(nodes).members,
            morphed: morphed(document)?,
            bases: vec![None; nodes.len()],
            between: BTreeMap::new(),
            scenes: Vec::new(),
        };
        let roots = frames.roots(document)?;
        let is_handle = |i: usize| frames.known(i, &nodes[i]).is_some();
        let handles: Vec<bool> = (0..nodes.len()).map(is_handle).collect();
        frames.needed =
            nodes.iter().zip(&handles).map(|(node, handle)| *handle || node.get("mesh").is_some()).collect();
        for (root, set) in roots {
            frames.bases[root] = Some(Base::Scenes(set));
            frames.walk(nodes, &handles, root);
        }
        Ok(frames)
    }

    /// Roots that scenes show, each with the number of its set of scenes.
    fn roots(&mut self, document: &Document) -> Result<Vec<(usize, usize)>, DocumentError> {
        let mut shown: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (scene, entry) in document.array("scenes")?.iter().enumerate() {
            for root in list(entry, "nodes") {
                if self.parents[root].is_some() {
                    // A scene shows it twice, below its parent and without: let it be.
                    self.targets.insert(root);
                } else {
                    let scenes = shown.entry(root).or_default();
                    if scenes.last() != Some(&scene) {
                        scenes.push(scene);
                    }
                }
            }
        }
        let mut sets: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        let mut number = |scenes: Vec<usize>| {
            let next = sets.len();
            *sets.entry(scenes).or_insert(next)
        };
        let roots = shown.into_iter().map(|(root, scenes)| (root, number(scenes))).collect();
        self.scenes = vec![Vec::new(); sets.len()];
        for (scenes, number) in sets {
            self.scenes[number] = scenes;
        }
        Ok(roots)
    }

    fn walk(&mut self, nodes: &[Value], handles: &[bool], root: usize) {
        let mut open = vec![root];
        while let Some(parent) = open.pop() {
            let below = list(&nodes[parent], "children");
            if below.is_empty() {
                continue;
            }
            let (base, frame) = if handles[parent] {
                (Some(Base::Node(parent)), None)
            } else {
                // What cannot be read moves nothing here, and nothing below it folds.
                let own = Local::read(&nodes[parent]).map_or(DMat4::NAN, |local| local.matrix());
                let above = self.between.get(&parent).copied().unwrap_or(DMat4::IDENTITY);
                (self.bases[parent], Some(above * own))
            };
            for child in below {
                self.bases[child] = base;
                self.between.extend(frame.map(|frame| (child, frame)));
                open.push(child);
            }
        }
    }

    pub(super) fn scenes(&self, set: usize) -> &[usize] {
        &self.scenes[set]
    }

    /// Why somebody may know or move the node.
    fn known(&self, index: usize, node: &Value) -> Option<&'static str> {
        let has = |key: &str| node.get(key).is_some();
        if self.levels.contains(&index) {
            Some("they belong to levels of the source")
        } else if has("skin") || has("weights") {
            Some("they are skinned or morphed")
        } else if self.targets.contains(&index) {
            Some("an animation, a skin or a pointer means them")
        } else if has("extensions") {
            Some("they have an extension")
        } else if has("extras") || has("camera") {
            Some("they have `extras` or a camera")
        } else if has("name") && !self.names_are_labels {
            Some("they have names, which `names = \"drop\"` would lose")
        } else {
            None
        }
    }

    /// The node as an instance of its mesh, whose middle is given; or why it stays.
    pub(super) fn place(
        &self,
        nodes: &[Value],
        (index, mesh): (usize, usize),
        middle: DVec3,
    ) -> Result<(Base, Instance), &'static str> {
        let node = &nodes[index];
        let base = self.bases[index].ok_or("no scene shows them")?;
        if self.morphed.contains(&mesh) {
            return Err("they are skinned or morphed");
        }
        if let Some(why) = self.known(index, node) {
            return Err(why);
        }
        if 0 < self.children[index] {
            return Err("they have children");
        }
        let local = Local::read(node).ok_or("their transforms cannot be read")?;
        let parts = match (self.between.get(&index), local) {
            (None, Local::Parts(parts)) => parts,
            (above, local) => {
                let matrix = above.copied().unwrap_or(DMat4::IDENTITY) * local.matrix();
                Parts::of(&matrix, self.tolerance)?
            }
        };
        parts.check()?;
        let instance = Instance {
            node: index,
            translation: parts.translation,
            rotation: parts.rotation.to_array().map(|v| v as f32),
            scale: parts.scale.to_array().map(|v| v as f32),
            middle: parts.translation + similarity::rotation(parts.rotation) * (parts.scale * middle),
        };
        Ok((base, instance))
    }

    /// `folded`, and all groups that hold nothing else, up to the next handle.
    pub(super) fn with_emptied_groups(&self, folded: BTreeSet<usize>) -> BTreeSet<usize> {
        let mut left = self.children.clone();
        let mut gone = folded.clone();
        for node in folded {
            let mut at = node;
            while let Some(parent) = self.parents[at] {
                left[parent] -= 1;
                if 0 < left[parent] || self.needed[parent] {
                    break;
                }
                gone.insert(parent);
                at = parent;
            }
        }
        gone
    }
}

/// A node's own transform.
enum Local {
    Parts(Parts),
    Matrix(DMat4),
}

#[derive(Clone, Copy)]
struct Parts {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

/// A quaternion in a file is a unit quaternion up to this, or it is none.
const UNIT: f64 = 1e-3;

impl Local {
    /// `None`: it is none, or not finite.
    fn read(node: &Value) -> Option<Self> {
        if node.get("matrix").is_some() {
            let matrix = DMat4::from_cols_array(&numbers::<16>(node, "matrix", [0.0; 16])?);
            // The bottom row of a transform.
            return (matrix.row(3) == DVec4::W).then_some(Self::Matrix(matrix));
        }
        let translation = DVec3::from_array(numbers(node, "translation", [0.0; 3])?);
        let rotation = DQuat::from_array(numbers(node, "rotation", [0.0, 0.0, 0.0, 1.0])?);
        let scale = DVec3::from_array(numbers(node, "scale", [1.0; 3])?);
        let is_unit = (rotation.length() - 1.0).abs() <= UNIT;
        is_unit.then_some(Self::Parts(Parts { translation, rotation, scale }))
    }

    fn matrix(&self) -> DMat4 {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Parts(Parts { translation, rotation, scale }) => {
                DMat4::from_scale_rotation_translation(*scale, similarity::rotation(*rotation), *translation)
            }
        }
    }
}

impl Parts {
    /// Takes a matrix apart, if that can be undone: what the parts make of a point of the mesh is off by at most `tolerance` of
    /// its radius and the scale.
    fn of(matrix: &DMat4, tolerance: f64) -> Result<Self, &'static str> {
        let columns = [0, 1, 2].map(|i| matrix.col(i).truncate());
        let scale = DVec3::from_array(columns.map(DVec3::length));
        if !matrix.is_finite() {
            return Err("their transforms cannot be read");
        }
        if scale.min_element() == 0.0 {
            return Err(FLAT);
        }
        if columns[0].cross(columns[1]).dot(columns[2]) < 0.0 {
            return Err(MIRRORED);
        }
        let axes = DMat3::from_cols(columns[0] / scale.x, columns[1] / scale.y, columns[2] / scale.z);
        let rotation = similarity::rotation(DQuat::from_mat3(&axes));
        let read = DMat3::from_quat(similarity::rotation(single(rotation)));
        let off: f64 = (0..3).map(|i| (read.col(i) * f64::from(scale[i] as f32)).distance(columns[i])).sum();
        if tolerance * scale.max_element() < off {
            return Err("their transforms are sheared");
        }
        Ok(Self { translation: matrix.col(3).truncate(), rotation, scale })
    }

    /// Can the numbers be written, and do they keep the mesh's shape and side?
    fn check(&self) -> Result<(), &'static str> {
        let scale = self.scale.to_array().map(|v| v as f32);
        if !self.translation.is_finite() || scale.iter().any(|s| !s.is_finite()) {
            Err("their transforms cannot be read")
        } else if scale.contains(&0.0) {
            Err(FLAT)
        } else if scale.iter().filter(|s| **s < 0.0).count() % 2 == 1 {
            Err(MIRRORED)
        } else {
            Ok(())
        }
    }
}

const FLAT: &str = "their transforms are flat";
const MIRRORED: &str = "their transforms mirror";

fn single(q: DQuat) -> DQuat {
    DQuat::from_array(q.to_array().map(|v| f64::from(v as f32)))
}

/// `default` where the node has no such member; `None` where it is no list of that many finite numbers.
fn numbers<const N: usize>(node: &Value, key: &str, default: [f64; N]) -> Option<[f64; N]> {
    let Some(value) = node.get(key) else { return Some(default) };
    let numbers: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    numbers.try_into().ok().filter(|all: &[f64; N]| all.iter().all(|v| v.is_finite()))
}

fn list(value: &Value, key: &str) -> Vec<usize> {
    let items = value.get(key).and_then(Value::as_array);
    items.into_iter().flatten().filter_map(|i| Some(json::integer(i)? as usize)).collect()
}

fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key).and_then(json::integer).map(|i| i as usize)
}

fn morphed(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let is_morphed = |mesh: &Value| {
        let mut primitives = mesh.get("primitives").and_then(Value::as_array).into_iter().flatten();
        primitives.any(|primitive| primitive.get("targets").is_some())
    };
    let meshes = document.array("meshes")?.iter().enumerate();
    Ok(meshes.filter(|(_, mesh)| is_morphed(mesh)).map(|(i, _)| i).collect())
}

/// Nodes that animations, skins and pointers mean.
fn targets(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let mut found = BTreeSet::new();
    for animation in document.array("animations")? {
        let channels = animation.get("channels").and_then(Value::as_array);
        found.extend(channels.into_iter().flatten().filter_map(|channel| index(channel.get("target")?, "node")));
        pointers(animation, &mut found);
    }
    for skin in document.array("skins")? {
        found.extend(list(skin, "joints"));
        found.extend(index(skin, "skeleton"));
    }
    document.json.get("extensions").into_iter().for_each(|extensions| pointers(extensions, &mut found));
    Ok(found)
}

/// Nodes in texts such as `/nodes/3/translation`.
fn pointers(value: &Value, found: &mut BTreeSet<usize>) {
    match value {
        Value::String(text) => {
            let number = text.strip_prefix("/nodes/").map(|rest| rest.split('/').next().unwrap_or(rest));
            found.extend(number.and_then(|number| number.parse::<usize>().ok()));
        }
        Value::Array(items) => items.iter().for_each(|item| pointers(item, found)),
        Value::Object(entries) => entries.values().for_each(|entry| pointers(entry, found)),
        _ => {}
    }
}
