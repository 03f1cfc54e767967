//! Nodes that show the same mesh, folded into batches: `EXT_mesh_gpu_instancing` where lodbake is asked for it.
//!
//! ```text
//! P ─┬─ A: mesh k             P ─┬─ A: mesh k, at the middle of its cell,
//!    ├─ B: mesh k      ──▶       │     extensions.EXT_mesh_gpu_instancing: A, B, C from that middle
//!    └─ G ── C: mesh k           └─ …
//! ```
//!
//! A batch switches levels as one, so instances are cut into cells of bounded size (`cells`). Only nodes fold that nothing
//! else can know or move (`frames`); every other node stays as it is, and the answer tells why. The batch takes the index of
//! its first node; the other entries become empty, or go where they were the last ones, so that no other node changes its
//! index. Levels are none of its business: later stages see a source that declares its instances.

mod bytes;
mod cells;
mod frames;
#[cfg(test)]
mod tests;

use super::buffers::Buffers;
use super::document::Document;
use super::error::DocumentError;
use super::instancing::INSTANCING;
use super::json;
use super::share::Sharing;
use crate::config::{InstanceSettings, NodeNames};
use cells::Cell;
use frames::{Base, Frames};
use glam::DVec3;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Fewer nodes than this make no batch: it would take more bytes than they do, save hardly a draw call, and all of it would
/// have to switch levels at once.
pub const FEWEST: usize = 4;

/// What was folded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Folded {
    /// Batches written.
    pub batches: usize,
    /// Nodes that they draw.
    pub instances: usize,
    /// Why other nodes, whose meshes [`FEWEST`] nodes or more show, stay nodes; and how many of them.
    pub stayed: BTreeMap<&'static str, usize>,
}

/// Middle and radius of a mesh's bounding sphere, in its own units.
pub type Sphere = (DVec3, f64);

/// One node on its way into a batch.
#[derive(Clone, Debug)]
struct Instance {
    node: usize,
    translation: DVec3,
    rotation: [f32; 4],
    scale: [f32; 3],
    /// Where the middle of its mesh is.
    middle: DVec3,
}

impl Instance {
    /// Largest scale factor.
    fn size(&self) -> f64 {
        self.scale.iter().map(|s| f64::from(s.abs())).fold(0.0, f64::max)
    }
}

/// Folds what can be folded. `spheres`: one for each mesh, `None` where it has no triangles.
pub fn fold(
    document: &mut Document,
    buffers: &mut Buffers,
    spheres: &[Option<Sphere>],
    settings: &InstanceSettings,
) -> Result<Folded, DocumentError> {
    let mut folded = Folded::default();
    let candidates = candidates(document)?;
    if candidates.is_empty() {
        return Ok(folded);
    }
    if (0..buffers.len()).all(|i| buffers.bytes(i).is_none()) {
        folded.stayed.insert("the file has no bytes", candidates.len());
        return Ok(folded);
    }
    if Sharing::unknown_extension(document).is_some() {
        folded.stayed.insert("an extension of the file might name nodes", candidates.len());
        return Ok(folded);
    }
    let mut groups: BTreeMap<(usize, Base), Vec<Instance>> = BTreeMap::new();
    let frames = Frames::new(document, settings.names == NodeNames::Drop, settings.tolerance)?;
    let mut stayed: BTreeMap<&'static str, usize> = BTreeMap::new();
    let mut stays = |why, count| *stayed.entry(why).or_insert(0) += count;
    for &(node, mesh) in &candidates {
        let placed = match spheres.get(mesh).copied().flatten() {
            Some((middle, _)) => frames.place(document.array("nodes")?, (node, mesh), middle),
            None => Err("their mesh has no triangles"),
        };
        match placed {
            Ok((base, instance)) => groups.entry((mesh, base)).or_default().push(instance),
            Err(why) => stays(why, 1),
        }
    }
    let mut batches = Vec::new();
    for ((mesh, base), instances) in groups {
        let radius = spheres[mesh].map_or(0.0, |(_, radius)| radius);
        for cell in cells::cut(instances, radius, settings.cell) {
            if cell.instances.len() < FEWEST {
                stays("too few with their mesh are near them, below the same parent", cell.instances.len());
            } else {
                batches.push(Batch { mesh, base, cell });
            }
        }
    }
    folded.stayed = stayed;
    // In the order of the nodes whose places they take.
    batches.sort_by_key(|batch| batch.cell.instances[0].node);
    folded.batches = batches.len();
    folded.instances = batches.iter().map(|batch| batch.cell.instances.len()).sum();
    if !batches.is_empty() {
        let attributes = bytes::write(document, buffers, batches.iter().map(|batch| &batch.cell))?;
        write(document, &frames, &batches, &attributes)?;
        document.use_extension(INSTANCING, settings.required)?;
    }
    Ok(folded)
}

/// Nodes with their meshes, where enough nodes show a mesh.
fn candidates(document: &Document) -> Result<Vec<(usize, usize)>, DocumentError> {
    let mut shown = Vec::new();
    let mut counts = vec![0_usize; document.array("meshes")?.len()];
    for (i, node) in document.array("nodes")?.iter().enumerate() {
        // What draws instances already is a batch of its own.
        if json::extension(node, INSTANCING).is_none()
            && let Some(mesh) = json::index(node, "mesh", format_args!("nodes[{i}]"))?
        {
            counts[mesh] += 1;
            shown.push((i, mesh));
        }
    }
    shown.retain(|&(_, mesh)| FEWEST <= counts[mesh]);
    Ok(shown)
}

/// One batch to be written.
struct Batch {
    mesh: usize,
    base: Base,
    cell: Cell,
}

/// Batches take the indices of their first nodes; all other folded nodes go, and groups that only held such nodes.
fn write(
    document: &mut Document,
    frames: &Frames,
    batches: &[Batch],
    attributes: &[[usize; 3]],
) -> Result<(), DocumentError> {
    let folded = batches.iter().flat_map(|batch| batch.cell.instances.iter().map(|instance| instance.node));
    let gone = frames.with_emptied_groups(folded.collect());
    unlink(document, &gone)?;
    let nodes = document.array_mut("nodes")?;
    for &node in &gone {
        nodes[node] = json!({});
    }
    let mut arrived: BTreeMap<Base, Vec<usize>> = BTreeMap::new();
    for (batch, [translation, rotation, scale]) in batches.iter().zip(attributes) {
        let place = batch.cell.instances[0].node;
        let attributes = json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale });
        nodes[place] = json!({ "mesh": batch.mesh, "extensions": { INSTANCING: { "attributes": attributes } } });
        if batch.cell.middle != [0.0; 3] {
            nodes[place]["translation"] = numbers(&batch.cell.middle);
        }
        arrived.entry(batch.base).or_default().push(place);
    }
    let kept: BTreeSet<usize> = arrived.values().flatten().copied().collect();
    while nodes.len().checked_sub(1).is_some_and(|last| gone.contains(&last) && !kept.contains(&last)) {
        nodes.pop();
    }
    for (base, places) in arrived {
        match base {
            Base::Node(node) => link(&mut document.array_mut("nodes")?[node], "children", &places),
            Base::Scenes(set) => {
                for &scene in frames.scenes(set) {
                    link(&mut document.array_mut("scenes")?[scene], "nodes", &places);
                }
            }
        }
    }
    Ok(())
}

fn link(parent: &mut Value, key: &str, places: &[usize]) {
    let list = parent.as_object_mut().map(|parent| parent.entry(key).or_insert_with(|| json!([])));
    if let Some(list) = list.and_then(Value::as_array_mut) {
        list.extend(places.iter().map(|place| json!(place)));
    }
}

/// Takes nodes out of the lists of their parents. Lists without entries are not valid, and go.
fn unlink(document: &mut Document, gone: &BTreeSet<usize>) -> Result<(), DocumentError> {
    for (array, key) in [("nodes", "children"), ("scenes", "nodes")] {
        for entry in document.array_mut(array)? {
            let Some(list) = entry.get_mut(key).and_then(Value::as_array_mut) else { continue };
            let before = list.len();
            list.retain(|child| json::integer(child).is_none_or(|child| !gone.contains(&(child as usize))));
            let is_emptied = list.is_empty() && before != 0;
            if let Some(entry) = entry.as_object_mut().filter(|_| is_emptied) {
                entry.shift_remove(key);
            }
        }
    }
    Ok(())
}

/// As short as single precision can be read back.
fn numbers(values: &[f32]) -> Value {
    values.iter().map(|v| json!(v.to_string().parse::<f64>().unwrap_or_else(|_| f64::from(*v)))).collect()
}
