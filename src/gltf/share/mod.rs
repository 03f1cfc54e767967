//! Meshes that are another one moved, written as instances of it: their nodes show the other mesh, and their own bytes go.
//!
//! ```text
//! node N: mesh k               node N (index, name, extras, transform, children, animations stay)
//!                      ──▶      └─ appended child: mesh r, the transform that takes r to k
//! ```
//!
//! Accessors with the same content become one (`equal`). Without a transform N shows r itself. Where r looks different (materials, `extras`), k stays a mesh of its own over
//! r's accessors. No entry of any array goes or changes its index: a mesh, accessor or buffer view that lost its bytes
//! stands for r's. Does not know how it was found out that two meshes are alike.

pub(super) mod compact;
mod equal;
#[cfg(test)]
mod tests;

use super::anchors::SourceGroups;
use super::buffers::Buffers;
use super::decode::draco;
use super::document::Document;
use super::error::DocumentError;
use super::follow::{self, Moved};
use super::instancing::MOVE_WITH_MESH;
use super::json;
use super::notes::Notes;
use super::similarity::Similarity;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

pub use super::notes::Note;

/// A mesh that is another one, moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Copy {
    /// Index in `meshes`.
    pub mesh: usize,
    /// The mesh whose geometry it shows from now on; no copy itself.
    pub of: usize,
    /// Takes `of` to `mesh`.
    pub by: Similarity,
}

/// Extensions, or prefixes of them, that refer to no accessor, buffer view or mesh but in the ways that are known here.
const KNOWN: [&str; 16] = [
    "EXT_lights_",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_",
    "KHR_texture_",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "MSFT_screencoverage",
    "MSFT_texture_dds",
];

/// Extensions of a node that do not mind whether its mesh is on a child.
const KNOWN_ON_NODES: [&str; 3] = ["KHR_lights_", "KHR_node_", "KHR_xmp_json_ld"];

/// The extension of a primitive that lists materials.
pub(super) const VARIANTS: &str = "KHR_materials_variants";

/// What may be shared in a document.
pub struct Sharing<'d> {
    document: &'d Document,
    /// By mesh.
    nodes: Vec<Vec<usize>>,
    /// By mesh.
    eligible: Vec<bool>,
}

impl<'d> Sharing<'d> {
    /// Looks at all meshes and their nodes.
    pub fn new(document: &'d Document) -> Result<Self, DocumentError> {
        let meshes = document.array("meshes")?;
        let mut eligible: Vec<bool> = meshes.iter().map(is_plain).collect();
        let mut nodes = vec![Vec::new(); meshes.len()];
        let all = document.array("nodes")?;
        let groups = SourceGroups::find(all);
        for (i, node) in all.iter().enumerate() {
            let Some(mesh) = json::index(node, "mesh", format_args!("nodes[{i}]"))? else { continue };
            nodes[mesh].push(i);
            // Levels that the source brings along stay as they are.
            eligible[mesh] &= !groups.members.contains(&i);
        }
        if Self::unknown_extension(document).is_some() {
            eligible.fill(false);
        }
        Ok(Self { document, nodes, eligible })
    }

    /// An extension of the document that might mean geometry in a way that is not known here.
    pub fn unknown_extension(document: &Document) -> Option<&str> {
        let used = document.array("extensionsUsed").unwrap_or_default().iter().filter_map(Value::as_str);
        used.into_iter().find(|name| !KNOWN.iter().any(|known| name.starts_with(known)))
    }

    /// Can the mesh stand for others, or others for it?
    pub fn is_eligible(&self, mesh: usize) -> bool {
        self.eligible.get(mesh).copied().unwrap_or(false)
    }

    /// Nodes that show a mesh.
    pub fn nodes(&self, mesh: usize) -> &[usize] {
        self.nodes.get(mesh).map_or(&[], Vec::as_slice)
    }

    /// Why a copy cannot be written as an instance.
    pub fn obstacle(&self, copy: &Copy) -> Option<&'static str> {
        if copy.by == Similarity::IDENTITY { None } else { self.fixed(copy.mesh) }
    }

    /// Why a mesh cannot be shown by a node of its own below those that show it.
    pub fn fixed(&self, mesh: usize) -> Option<&'static str> {
        let shown = self.nodes.get(mesh)?;
        let mesh = &self.document.array("meshes").ok()?[mesh];
        let primitives = mesh.get("primitives").and_then(Value::as_array).into_iter().flatten();
        if primitives.into_iter().any(|primitive| primitive.get("targets").is_some()) {
            return Some("its morph targets would have to be moved");
        }
        let nodes = self.document.array("nodes").ok()?;
        shown.iter().find_map(|&node| {
            let node = &nodes[node];
            let extensions = node.get("extensions").and_then(Value::as_object);
            let mut names = extensions.into_iter().flat_map(Map::keys);
            if node.get("skin").is_some() {
                Some("a skin ignores the transforms of nodes")
            } else if names.any(|name| MOVE_WITH_MESH.contains(&name.as_str())) {
                Some("its node draws instances already")
            } else if extensions.into_iter().flat_map(Map::keys).any(|name| !is_known_on_nodes(name)) {
                Some("its node has an extension that might mean the mesh")
            } else {
                None
            }
        })
    }
}

fn is_known_on_nodes(name: &str) -> bool {
    KNOWN_ON_NODES.iter().any(|known| name.starts_with(known))
}

/// Only members that are known to mean geometry, looks, or nothing.
fn is_plain(mesh: &Value) -> bool {
    let only = |value: &Value, known: &[&str]| {
        value.as_object().is_some_and(|members| members.keys().all(|key| known.contains(&key.as_str())))
    };
    let primitives = mesh.get("primitives").and_then(Value::as_array);
    only(mesh, &["name", "primitives", "weights", "extras"])
        && primitives.is_some_and(|all| {
            all.iter().all(|primitive| {
                let known = ["attributes", "indices", "targets", "mode", "material", "extras", "extensions"];
                let extensions = primitive.get("extensions");
                only(primitive, &known) && extensions.is_none_or(|e| only(e, &[draco::EXTENSION, VARIANTS]))
            })
        })
}

/// What was done.
#[derive(Debug)]
pub struct Shared {
    /// The document's buffers, without the bytes that nothing needs any more.
    pub buffers: Buffers,
    /// `false`: there was nothing to share, the document is as it was.
    pub is_changed: bool,
    /// What was done differently.
    pub notes: Vec<Note>,
}

/// Writes `copies` (without an obstacle) as instances, and keeps equal accessors once.
pub fn share(document: &mut Document, buffers: &Buffers, copies: &[Copy]) -> Result<Shared, DocumentError> {
    let source = document.array("meshes")?.to_vec();
    let mut retired = Retired::default();
    let mut shown = BTreeMap::new();
    for copy in copies {
        let (own, other) = (&source[copy.mesh], &source[copy.of]);
        let mut entry = own.clone();
        let primitives = entry.get_mut("primitives").and_then(Value::as_array_mut);
        let others = other.get("primitives").and_then(Value::as_array);
        for (primitive, other) in std::iter::zip(primitives.into_iter().flatten(), others.into_iter().flatten()) {
            retired.note(primitive, other);
            take_geometry(primitive, other);
        }
        shown.insert(copy.mesh, (if looks_alike(&entry, other) { copy.of } else { copy.mesh }, copy.by));
        document.array_mut("meshes")?[copy.mesh] = entry;
    }
    let moved = show(document, &shown)?;
    let mut notes = Notes::default();
    follow::follow(document, &moved, &mut notes)?;
    let merged = equal::merge(document, buffers)?;
    let is_changed = !copies.is_empty() || !merged.is_empty();
    retired.accessors.extend(merged);
    let touched = retired.settle(document)?;
    let buffers = compact::compact(document, buffers, &touched)?;
    Ok(Shared { buffers, is_changed, notes: notes.into_vec() })
}

/// Members that say where a primitive's geometry is.
const GEOMETRY: [&str; 4] = ["attributes", "indices", "targets", "mode"];

/// Gives `primitive` the geometry of `other`; materials, variants and `extras` stay.
fn take_geometry(primitive: &mut Value, other: &Value) {
    let Some(members) = primitive.as_object_mut() else { return };
    for key in GEOMETRY {
        match other.get(key) {
            Some(value) => members.insert(key.to_owned(), value.clone()),
            None => members.shift_remove(key),
        };
    }
    let packed = other.get("extensions").and_then(|e| e.get(draco::EXTENSION));
    let mut extensions = members.shift_remove("extensions").unwrap_or_else(|| json!({}));
    if let Some(extensions) = extensions.as_object_mut() {
        extensions.shift_remove(draco::EXTENSION);
        extensions.extend(packed.map(|packed| (draco::EXTENSION.to_owned(), packed.clone())));
    }
    if extensions.as_object().is_some_and(|e| !e.is_empty()) {
        members.insert("extensions".to_owned(), extensions);
    }
}

/// Does it not matter which of the two a node shows? Names do not count.
fn looks_alike(one: &Value, other: &Value) -> bool {
    let keys = |value: &Value| -> BTreeMap<String, Value> {
        let members = value.as_object().into_iter().flatten();
        members.filter(|(key, _)| *key != "name").map(|(key, value)| (key.clone(), value.clone())).collect()
    };
    keys(one) == keys(other)
}

/// Nodes show what stands for their meshes now; answers which meshes moved to a child.
fn show(document: &mut Document, shown: &BTreeMap<usize, (usize, Similarity)>) -> Result<Vec<Moved>, DocumentError> {
    if document.array("nodes")?.is_empty() {
        return Ok(Vec::new());
    }
    let nodes = document.array_mut("nodes")?;
    let mut moved = Vec::new();
    for node in 0..nodes.len() {
        let mesh = nodes[node].get("mesh").and_then(json::integer).map(|mesh| mesh as usize);
        let Some((mesh, &(other, by))) = mesh.and_then(|mesh| Some((mesh, shown.get(&mesh)?))) else { continue };
        if by == Similarity::IDENTITY {
            nodes[node]["mesh"] = json!(other);
            continue;
        }
        let carrier = nodes.len();
        let mut child = Map::from_iter([("mesh".to_owned(), json!(other))]);
        child.extend(by.node());
        nodes.push(Value::Object(child));
        let Some(members) = nodes[node].as_object_mut() else { continue };
        members.shift_remove("mesh");
        members.shift_remove("weights");
        if let Some(children) = members.entry("children").or_insert_with(|| json!([])).as_array_mut() {
            children.push(json!(carrier));
        }
        moved.push(Moved { node, carrier, mesh, repeated: None, levels: Vec::new() });
    }
    Ok(moved)
}

/// What copies used before, and what they use instead.
#[derive(Default)]
pub(super) struct Retired {
    pub(super) accessors: BTreeMap<usize, usize>,
    views: BTreeMap<usize, usize>,
}

impl Retired {
    fn note(&mut self, primitive: &Value, other: &Value) {
        let stand_in = attribute(other, "POSITION");
        let mut note = |old: Option<usize>, new: Option<usize>| {
            if let (Some(old), Some(new)) = (old, new.or(stand_in))
                && old != new
            {
                self.accessors.insert(old, new);
            }
        };
        note(index(primitive, "indices"), index(other, "indices"));
        for name in names(primitive.get("attributes")) {
            note(attribute(primitive, name), attribute(other, name));
        }
        let targets = |value: &'_ Value| value.get("targets").and_then(Value::as_array).cloned().unwrap_or_default();
        for (target, other) in std::iter::zip(targets(primitive), targets(other)) {
            for name in names(Some(&target)) {
                note(index(&target, name), index(&other, name));
            }
        }
        let packed = |value| index(json::extension(value, draco::EXTENSION)?, "bufferView");
        if let (Some(old), Some(new)) = (packed(primitive), packed(other)) {
            self.views.insert(old, new);
        }
    }

    /// Accessors that nothing uses any more become copies of those that stand for them. Answers the buffer views that
    /// lost a user, each with one that can stand for it.
    pub(super) fn settle(&self, document: &mut Document) -> Result<BTreeMap<usize, usize>, DocumentError> {
        let used = used_accessors(document)?;
        let used_views = packed_views(document)?;
        let unused = |(old, _): &(&usize, &usize)| !used_views.contains(old);
        let mut touched: BTreeMap<usize, usize> =
            self.views.iter().filter(unused).map(|(&old, &new)| (old, new)).collect();
        let accessors = document.array_mut("accessors")?;
        for (&old, &new) in self.accessors.iter().filter(|(old, _)| !used.contains(old)) {
            // What stands for it may itself have been merged.
            let next = |new: &usize| self.accessors.get(new).copied().filter(|_| !used.contains(new));
            let new = std::iter::successors(Some(new), next).last().unwrap_or(new);
            let mut entry = accessors[new].clone();
            let view = |accessor: &Value| index(accessor, "bufferView");
            if let (Some(old), Some(new)) = (view(&accessors[old]), view(&entry)) {
                touched.entry(old).or_insert(new);
            }
            for key in ["name", "extras"] {
                match (accessors[old].get(key), entry.as_object_mut()) {
                    (Some(kept), Some(entry)) => drop(entry.insert(key.to_owned(), kept.clone())),
                    (None, Some(entry)) => drop(entry.shift_remove(key)),
                    _ => {}
                }
            }
            accessors[old] = entry;
        }
        Ok(touched)
    }
}

pub(super) fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key).and_then(json::integer).map(|index| index as usize)
}

fn attribute(primitive: &Value, name: &str) -> Option<usize> {
    index(primitive.get("attributes")?, name)
}

pub(super) fn names(object: Option<&Value>) -> impl Iterator<Item = &str> {
    object.and_then(Value::as_object).into_iter().flat_map(|o| o.keys().map(String::as_str))
}

fn primitives(document: &Document) -> Result<impl Iterator<Item = &Value>, DocumentError> {
    let meshes = document.array("meshes")?.iter();
    Ok(meshes.filter_map(|mesh| mesh.get("primitives")?.as_array()).flatten())
}

/// Accessors that anything refers to.
pub(super) fn used_accessors(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let mut used = other_accessors(document)?;
    for primitive in primitives(document)? {
        used.extend(index(primitive, "indices"));
        let attributes = primitive.get("attributes");
        used.extend(names(attributes).filter_map(|name| index(attributes?, name)));
    }
    Ok(used)
}

/// Accessors of morph targets, skins, animations and instances.
pub(super) fn other_accessors(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let mut used = BTreeSet::new();
    for primitive in primitives(document)? {
        for target in primitive.get("targets").and_then(Value::as_array).into_iter().flatten() {
            used.extend(names(Some(target)).filter_map(|name| index(target, name)));
        }
    }
    used.extend(accessors_beside_meshes(document)?);
    Ok(used)
}

/// Accessors that anything but a mesh refers to.
pub(super) fn accessors_beside_meshes(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let mut used = BTreeSet::new();
    used.extend(document.array("skins")?.iter().filter_map(|skin| index(skin, "inverseBindMatrices")));
    for animation in document.array("animations")? {
        for sampler in animation.get("samplers").and_then(Value::as_array).into_iter().flatten() {
            used.extend(["input", "output"].iter().filter_map(|key| index(sampler, key)));
        }
    }
    for node in document.array("nodes")? {
        let instances = json::extension(node, super::instancing::INSTANCING).and_then(|e| e.get("attributes"));
        used.extend(names(instances).filter_map(|name| index(instances?, name)));
    }
    Ok(used)
}

/// Buffer views that compressed primitives refer to.
fn packed_views(document: &Document) -> Result<BTreeSet<usize>, DocumentError> {
    let packed = |primitive| index(json::extension(primitive, draco::EXTENSION)?, "bufferView");
    Ok(primitives(document)?.filter_map(packed).collect())
}
