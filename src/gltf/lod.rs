//! Levels of detail in a document: `MSFT_lod` groups in the one form that all readers agree on.
//!
//! ```text
//! source node (index, name, extras, transform, children, animation targets stay)      the "anchor"
//!  └─ appended child: the mesh with all that belongs to it, no transform,
//!       extensions.MSFT_lod.ids = [L1, L2, ...], extras.MSFT_screencoverage, extras.lodbake
//! L1, L2, ...: appended, no transform, a mesh each, in no scene, nobody's children
//! ```
//!
//! Where an animation drives the morph weights, the mesh sits one node further down: three.js makes the node with the
//! extension a `LOD` object, which has no weights to drive. The child then has only the extension and one child.
//!
//! Readers disagree on whether level nodes are siblings or children of the node with the extension and whether their
//! transforms count; without transforms the difference vanishes. Nothing that exists is renumbered; what moves is
//! written down in `follow` and `instancing`. Knows nothing of how levels are made.

use super::anchors::Anchors;
use super::carry;
use super::coverage::{Extent, Thresholds};
use super::document::Document;
use super::follow::{self, LevelNode, Moved};
use super::host;
use super::instancing::{self, Batches};
use super::json;
use super::level_mesh::{LevelMesh, LevelWriter, Role};
use super::notes::Notes;
use super::write::LevelProblem;
use crate::config::{EmitSettings, Profile};
use crate::mesh::LevelPrimitive;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

pub use super::coverage::switches;
pub use super::level_mesh::is_sealed;
pub use super::notes::Note;
pub use super::write::{NewBuffer, WriteError};

/// The extension.
pub const MSFT_LOD: &str = "MSFT_lod";

/// The levels of one mesh.
#[derive(Clone, Debug)]
pub struct MeshLevels {
    /// Index in `meshes`.
    pub mesh: usize,
    /// Radius of the mesh's bounding sphere, in its own units.
    pub radius: f64,
    /// Level 1, level 2, …: finest first. A level of which no triangle is left is not written.
    pub levels: Vec<MeshLevel>,
}

/// One level of a mesh.
#[derive(Clone, Debug)]
pub struct MeshLevel {
    /// One for each primitive of the mesh, in order.
    pub primitives: Vec<PrimitiveLevel>,
    /// Largest distance between the surfaces of source and level, in the mesh's units.
    pub error: f64,
    /// Whatever else a reader should find in `extras.lodbake.facts`.
    pub facts: Option<Value>,
}

/// One primitive at one level.
#[derive(Clone, Debug)]
pub enum PrimitiveLevel {
    /// Not simplified (points, lines): the source's primitive again, with the same accessors.
    AsSource,
    /// Simplified. Without indices the primitive is left out of the level. Indices into the source's vertices are
    /// those of its accessors (see [`super::scene::SourceMesh::source_indices`]).
    Level(Arc<LevelPrimitive>),
}

/// What was added to a document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Added {
    /// One for each level number that any mesh has: level 1 first.
    pub levels: Vec<AddedLevel>,
    /// Nodes that now have levels.
    pub groups: usize,
    /// Content of a buffer that was created or lengthened; it needs an address before the document is complete.
    pub buffer: Option<NewBuffer>,
    /// The same for the buffers of meshes that have one of their own.
    pub library: Vec<NewBuffer>,
    /// What was left out or done differently.
    pub notes: Vec<Note>,
}

/// Sums over all meshes for one level number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AddedLevel {
    /// Meshes that have this level.
    pub meshes: usize,
    /// Triangles of these meshes, each mesh counted once.
    pub triangles: usize,
    /// Bytes of binary data written for them; what an earlier (coarser) level wrote already is not counted again.
    pub bytes: usize,
}

impl Added {
    /// Did the document stay as it was?
    pub fn is_empty(&self) -> bool {
        self.groups == 0
    }
}

/// One mesh that gets levels.
struct Chain<'a> {
    radius: f64,
    /// Finest first, none empty.
    levels: Vec<&'a MeshLevel>,
}

/// The levels of one mesh in the document.
struct WrittenChain {
    /// Indices in `meshes`, finest first.
    meshes: Vec<usize>,
    triangles: Vec<usize>,
    targets: Vec<bool>,
}

/// Adds levels to every node that uses one of the meshes. On an error the document is left half done: drop it.
///
/// Nodes that take part in an `MSFT_lod` group of the source stay as they are, with a note; so do meshes that no node
/// uses.
pub fn add_levels(
    document: &mut Document,
    levels: &[MeshLevels],
    batches: &Batches,
    settings: &EmitSettings,
) -> Result<Added, WriteError> {
    add_levels_to(document, levels, &BTreeMap::new(), batches, settings)
}

/// As [`add_levels`], with buffers for the levels of some meshes: those that [`super::library`] made.
pub fn add_levels_to(
    document: &mut Document,
    levels: &[MeshLevels],
    homes: &BTreeMap<usize, usize>,
    batches: &Batches,
    settings: &EmitSettings,
) -> Result<Added, WriteError> {
    let mut writer = LevelWriter::new(document)?;
    let chains = chains(writer.document, levels, &mut writer.notes)?;
    let anchors = Anchors::find(writer.document, &chains.keys().copied().collect(), &mut writer.notes)?;
    let used: BTreeSet<usize> = anchors.nodes.iter().map(|&(_, mesh)| mesh).collect();
    let chains: BTreeMap<usize, Chain<'_>> = chains.into_iter().filter(|(mesh, _)| used.contains(mesh)).collect();
    let mut added = Added { groups: anchors.nodes.len(), ..Added::default() };
    if chains.is_empty() {
        added.notes = writer.notes.into_vec();
        return Ok(added);
    }
    // What has a buffer of its own asks for it with its coarsest level: nothing waits for that.
    let others = anchors.nodes.iter().filter(|(_, mesh)| !homes.contains_key(mesh)).map(|&(node, _)| node).collect();
    if let Some(buffer) = host::find(writer.document, &others)? {
        writer.streams.append_to(writer.document, buffer)?;
    }
    let mut made = BTreeMap::new();
    let others =
        chains.iter().filter(|(mesh, _)| !homes.contains_key(mesh)).map(|(&mesh, chain)| (mesh, chain)).collect();
    write_arrays(&mut writer, &others, &mut added.levels, &mut made)?;
    added.buffer = writer.close()?;
    let mut by_home: BTreeMap<usize, Chains<'_>> = BTreeMap::new();
    for (mesh, &home) in homes {
        if let Some(chain) = chains.get(mesh) {
            by_home.entry(home).or_default().insert(*mesh, chain);
        }
    }
    for (home, chains) in by_home {
        writer.turn_to(home)?;
        write_arrays(&mut writer, &chains, &mut added.levels, &mut made)?;
        added.library.extend(writer.close()?);
    }
    let LevelWriter { document, mut notes, .. } = writer;
    let written = append_meshes(document, made)?;
    let grouping = Grouping { chains: &chains, written: &written, batches, settings };
    let moved = grouping.write(document, &anchors, &mut notes)?;
    follow::follow(document, &moved, &mut notes)?;
    document.use_extension(MSFT_LOD, false).map_err(WriteError::from)?;
    added.notes = notes.into_vec();
    Ok(added)
}

fn chains<'a>(
    document: &Document,
    levels: &'a [MeshLevels],
    notes: &mut Notes,
) -> Result<BTreeMap<usize, Chain<'a>>, WriteError> {
    let meshes = document.array("meshes")?;
    let mut chains = BTreeMap::new();
    for entry in levels {
        let place = format!("meshes[{}]", entry.mesh);
        let fail = |place: String, problem| Err(WriteError::Level { place, problem });
        let Some(mesh) = meshes.get(entry.mesh) else {
            return fail(place, LevelProblem::NoMesh(meshes.len()));
        };
        if !is_length(entry.radius) {
            let value = entry.radius.to_string();
            return fail(place, LevelProblem::Length { name: "radius", value });
        }
        let count = json::array(mesh, "primitives", &place)?.len();
        for (i, level) in entry.levels.iter().enumerate() {
            let place = format!("{place}, level {}", i + 1);
            if level.primitives.len() != count {
                let level = level.primitives.len();
                return fail(place, LevelProblem::Primitives { level, mesh: count });
            }
            if !is_length(level.error) {
                let value = level.error.to_string();
                return fail(place, LevelProblem::Length { name: "error", value });
            }
        }
        let kept: Vec<&MeshLevel> = entry.levels.iter().filter(|level| level.is_simplified()).collect();
        if kept.len() < entry.levels.len() {
            notes.add(&place, "a level of which nothing is left is not written");
        }
        let chain = Chain { radius: entry.radius, levels: kept };
        if chains.insert(entry.mesh, chain).is_some() {
            return fail(place, LevelProblem::Twice);
        }
    }
    chains.retain(|_, chain| !chain.levels.is_empty());
    Ok(chains)
}

fn is_length(value: f64) -> bool {
    value.is_finite() && value >= 0.0
}

/// Would anything be written for them?
pub(super) fn has_levels(levels: &MeshLevels) -> bool {
    levels.levels.iter().any(MeshLevel::is_simplified)
}

impl MeshLevel {
    /// Is a triangle left, or anything that was never meant to be simplified?
    fn is_simplified(&self) -> bool {
        self.primitives.iter().any(|primitive| match primitive {
            PrimitiveLevel::AsSource => true,
            PrimitiveLevel::Level(level) => !level.indices.is_empty(),
        })
    }
}

/// Meshes of which the geometry goes to the same buffer.
type Chains<'a> = BTreeMap<usize, &'a Chain<'a>>;

/// Writes the arrays of chains: the coarsest level of every mesh first, then the next finer one, each rank one range of
/// bytes. That is the order in which Babylon.js asks for them.
fn write_arrays(
    writer: &mut LevelWriter<'_>,
    chains: &Chains<'_>,
    levels: &mut Vec<AddedLevel>,
    made: &mut BTreeMap<usize, Vec<LevelMesh>>,
) -> Result<(), WriteError> {
    let deepest = chains.values().map(|chain| chain.levels.len()).max().unwrap_or(0);
    levels.resize(deepest.max(levels.len()), AddedLevel::default());
    for rank in 1..=deepest {
        for (&mesh, chain) in chains.iter().filter(|(_, chain)| rank <= chain.levels.len()) {
            let at = chain.levels.len() - rank;
            let before = writer.streams.len();
            let level = writer.level(Role { mesh, number: at + 1 }, chain.levels[at])?;
            levels[at].meshes += 1;
            levels[at].triangles += level.triangles;
            levels[at].bytes += writer.streams.len() - before;
            made.entry(mesh).or_default().push(level);
        }
        writer.streams.end_section(writer.document)?;
    }
    Ok(())
}

/// Appends the meshes of all chains; their levels come coarsest first.
fn append_meshes(
    document: &mut Document,
    made: BTreeMap<usize, Vec<LevelMesh>>,
) -> Result<BTreeMap<usize, WrittenChain>, WriteError> {
    let mut written = BTreeMap::new();
    for (mesh, coarsest_first) in made {
        let mut chain = WrittenChain { meshes: Vec::new(), triangles: Vec::new(), targets: Vec::new() };
        for level in coarsest_first.into_iter().rev() {
            chain.meshes.push(document.push("meshes", level.entry)?);
            chain.triangles.push(level.triangles);
            chain.targets.push(level.targets);
        }
        written.insert(mesh, chain);
    }
    Ok(written)
}

/// A node that becomes a group.
struct Anchor {
    node: usize,
    mesh: usize,
    /// The copy that level 0 shows instead of `mesh`.
    repeated: Option<usize>,
    /// An animation drives its morph weights.
    driven: bool,
}

/// Turns nodes into groups.
struct Grouping<'a> {
    chains: &'a BTreeMap<usize, Chain<'a>>,
    written: &'a BTreeMap<usize, WrittenChain>,
    batches: &'a Batches,
    settings: &'a EmitSettings,
}

impl Grouping<'_> {
    fn write(&self, document: &mut Document, anchors: &Anchors, notes: &mut Notes) -> Result<Vec<Moved>, WriteError> {
        let mut repeated = BTreeMap::new();
        for &mesh in anchors.lower_levels.iter().filter(|mesh| self.chains.contains_key(mesh)) {
            let copy = document.array("meshes")?[mesh].clone();
            repeated.insert(mesh, document.push("meshes", copy)?);
            notes.add(format_args!("meshes[{mesh}]"), "the source uses this mesh as a lower level; it is repeated");
        }
        let mut names = Names::new(document, self.settings.profile);
        let driven = follow::nodes_with_driven_weights(document)?;
        let mut moved = Vec::new();
        for &(node, mesh) in &anchors.nodes {
            carry::note_staying(&document.array("nodes")?[node], node, notes);
            let anchor = Anchor { node, mesh, repeated: repeated.get(&mesh).copied(), driven: driven.contains(&node) };
            moved.push(self.group(document, &anchor, &mut names)?);
        }
        Ok(moved)
    }

    fn group(&self, document: &mut Document, anchor: &Anchor, names: &mut Option<Names>) -> Result<Moved, WriteError> {
        let written = &self.written[&anchor.mesh];
        let thresholds = self.thresholds(anchor.node, anchor.mesh);
        let nodes = document.array_mut("nodes")?;
        let child = nodes.len();
        let levels: Vec<LevelNode> = (written.meshes.iter().zip(&written.targets).enumerate())
            .map(|(i, (&mesh, &targets))| LevelNode { node: child + 1 + i, mesh, targets })
            .collect();
        let Value::Object(source) = &mut nodes[anchor.node] else { unreachable!("`Anchors::find` read its mesh") };
        let names = names.as_mut().map(|names| names.group(source, anchor.node, levels.len() + 1));
        let parts = Parts::take(source, child);
        let finest = parts.node(anchor.repeated.unwrap_or(anchor.mesh), true);
        let carrier = if anchor.driven { child + 1 + levels.len() } else { child };
        let (mut entry, below) = if anchor.driven {
            (Map::from_iter([("children".to_owned(), json!([carrier]))]), Some(finest))
        } else {
            (finest, None)
        };
        let ids: Vec<usize> = levels.iter().map(|level| level.node).collect();
        entry.entry("extensions").or_insert_with(|| json!({}))[MSFT_LOD] = json!({ "ids": ids });
        let facts = self.facts(anchor.mesh, &thresholds);
        entry.insert("extras".to_owned(), json!({ "MSFT_screencoverage": thresholds.coverage, "lodbake": facts }));
        let lower = levels.iter().map(|level| parts.node(level.mesh, level.targets));
        for (number, mut node) in std::iter::once(entry).chain(lower).enumerate() {
            if let Some(names) = &names {
                node.insert("name".to_owned(), json!(names[number]));
            }
            nodes.push(Value::Object(node));
        }
        nodes.extend(below.map(Value::Object));
        Ok(Moved { node: anchor.node, carrier, mesh: anchor.mesh, repeated: anchor.repeated, levels })
    }

    fn thresholds(&self, node: usize, mesh: usize) -> Thresholds {
        let chain = &self.chains[&mesh];
        let errors: Vec<f64> = chain.levels.iter().map(|level| level.error).collect();
        let extent = match self.batches.get(&node) {
            Some(batch) => batch.extent(chain.radius),
            None => Extent { radius: chain.radius, scale: 1.0, batch: false },
        };
        Thresholds::new(extent, &errors, self.settings)
    }

    /// `extras.lodbake`: for engines' own loops, exactly. Level k is at k − 1 of every list; lengths are in the units
    /// of the node.
    fn facts(&self, mesh: usize, thresholds: &Thresholds) -> Value {
        let chain = &self.chains[&mesh];
        let mut facts = Map::new();
        facts.insert("errors".to_owned(), json!(thresholds.errors));
        facts.insert("distances".to_owned(), json!(thresholds.distances));
        facts.insert("radius".to_owned(), json!(thresholds.radius));
        facts.insert("triangles".to_owned(), json!(self.written[&mesh].triangles));
        if self.settings.profile == Profile::Unreal {
            facts.insert("coverage".to_owned(), json!("start"));
        }
        if chain.levels.iter().any(|level| level.facts.is_some()) {
            let each: Vec<&Value> = chain.levels.iter().map(|l| l.facts.as_ref().unwrap_or(&Value::Null)).collect();
            facts.insert("facts".to_owned(), json!(each));
        }
        Value::Object(facts)
    }
}

/// Names for nodes of groups where a reader tells levels by them: `Tree_LOD0`, `Tree_LOD1`, …
struct Names {
    taken: BTreeSet<String>,
}

impl Names {
    /// `None`: this reader wants no names.
    fn new(document: &Document, profile: Profile) -> Option<Self> {
        let nodes = document.array("nodes").unwrap_or_default();
        let names = nodes.iter().filter_map(|node| node.get("name")?.as_str());
        (profile == Profile::Godot).then(|| Self { taken: names.map(str::to_owned).collect() })
    }

    /// One name for each member, of which none exists yet.
    fn group(&mut self, anchor: &Map<String, Value>, index: usize, members: usize) -> Vec<String> {
        let base = anchor.get("name").and_then(Value::as_str).map_or_else(|| format!("node{index}"), str::to_owned);
        let mut tail = String::new();
        for attempt in 2_usize.. {
            let names: Vec<String> = (0..members).map(|level| format!("{base}{tail}_LOD{level}")).collect();
            if !names.iter().any(|name| self.taken.contains(name)) {
                self.taken.extend(names.iter().cloned());
                return names;
            }
            tail = format!("_{attempt}");
        }
        unreachable!("there are more numbers than nodes")
    }
}

/// What leaves the anchor together with its mesh.
struct Parts {
    skin: Option<Value>,
    weights: Option<Value>,
    extensions: Map<String, Value>,
}

impl Parts {
    /// Takes them out of `anchor`, which gets `child` instead.
    fn take(anchor: &mut Map<String, Value>, child: usize) -> Self {
        anchor.shift_remove("mesh");
        let parts = Self {
            skin: anchor.shift_remove("skin"),
            weights: anchor.shift_remove("weights"),
            extensions: instancing::take_moving(anchor),
        };
        // `Anchors::find` made sure that it is an array where it exists.
        if let Value::Array(children) = anchor.entry("children").or_insert_with(|| json!([])) {
            children.push(json!(child));
        }
        parts
    }

    /// A node without transform that shows `mesh` the way the anchor did.
    fn node(&self, mesh: usize, targets: bool) -> Map<String, Value> {
        let mut node = Map::new();
        node.insert("mesh".to_owned(), json!(mesh));
        if let Some(skin) = &self.skin {
            node.insert("skin".to_owned(), skin.clone());
        }
        if let Some(weights) = self.weights.as_ref().filter(|_| targets) {
            node.insert("weights".to_owned(), weights.clone());
        }
        if !self.extensions.is_empty() {
            node.insert("extensions".to_owned(), Value::Object(self.extensions.clone()));
        }
        node
    }
}

#[cfg(test)]
mod tests;
