//! Parts that occur more than once in the meshes of a scene: finds them, and makes it the scene that has each once.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::recover::{Recovered, declare};
use crate::config::{InstanceSettings, Instancing, Recover};
use crate::gltf::document::DocumentError;
use crate::gltf::read::from_document;
use crate::gltf::scene::{Scene, SourcePrimitive};
use crate::gltf::share::Sharing;
use crate::gltf::split::{Repeated, Splitting, split};
use crate::identify::alike::{Kind, Residual};
use crate::identify::parts::{Found, Group, Search, find};
use crate::report::{PartRecord, PartsRecord};

/// What a node takes in a document, with a child that has the levels and three of these, as measured; without levels it takes 95.
const NODE_BYTES: u64 = 500;

/// What an instance of a batch takes: a translation, a rotation and a scale.
const INSTANCE_BYTES: u64 = 40;

/// Takes repeated parts out of the meshes of a scene in which no mesh is repeated any more.
pub(super) fn take_apart(out: Recovered, settings: &InstanceSettings, base: &Path) -> Result<Recovered, DocumentError> {
    // Told already: nothing is looked for in such a scene.
    if Sharing::unknown_extension(&out.scene.document).is_some() {
        return Ok(out);
    }
    let meshes = &out.scene.meshes;
    let is_read =
        |mesh: usize, primitive: usize| matches!(meshes[mesh].primitives[primitive], SourcePrimitive::Triangles(_));
    let splitting = Splitting::new(&out.scene.document, &is_read, Recover::Similar <= settings.recover)?;
    let node_bytes = if settings.instancing == Instancing::Gpu { INSTANCE_BYTES } else { NODE_BYTES };
    let search = Search {
        tolerance: settings.tolerance,
        most: farthest(settings.recover),
        looks: &|mesh, primitive| splitting.looks(mesh, primitive),
        shown: &|mesh| splitting.shown(mesh),
        node_bytes,
    };
    let Found { groups, stayed } = find(&out.scene.meshes, &search);
    let mut record = PartsRecord {
        groups: Vec::new(),
        nodes: 0,
        bytes_before: 0,
        bytes_after: 0,
        stayed: stayed.into_iter().map(|(why, count)| (why.to_owned(), count as u64)).collect(),
    };
    if groups.is_empty() {
        return Ok(Recovered { parts: Some(record), ..out });
    }
    let repeated: Vec<Repeated> = groups.iter().map(repeated).collect();
    let mut document = out.scene.document.clone();
    let done = split(&mut document, &out.scene.buffers, &repeated)?;
    let parts: u64 = groups.iter().map(|group| group.occurrences.len() as u64).sum();
    // Bytes that something else needs, too, do not go.
    if done.bytes.0 < done.bytes.1 + done.nodes as u64 * node_bytes {
        *record.stayed.entry("something else needs their bytes, too".to_owned()).or_insert(0) += parts;
        return Ok(Recovered { parts: Some(record), ..out });
    }
    record.groups = groups.iter().zip(&done.meshes).map(|(group, &mesh)| facts(group, mesh)).collect();
    (record.nodes, record.bytes_before, record.bytes_after) = (done.nodes as u64, done.bytes.0, done.bytes.1);
    let Recovered { scene: Scene { meshes, warnings, .. }, instances, mut notes, .. } = out;
    let scene = Scene { warnings, ..from_document(document, done.buffers, base)? };
    // What is left of meshes may be the same now; and equal accessors are kept once.
    let mut again = declare(scene, settings, base, meshes.len())?;
    again.instances.extend(instances);
    notes.append(&mut again.notes);
    Ok(Recovered { parts: Some(record), is_changed: true, notes, ..again })
}

fn farthest(recover: Recover) -> Kind {
    match recover {
        Recover::None | Recover::Exact => Kind::Reordered,
        Recover::Rigid => Kind::Rigid,
        Recover::Similar => Kind::Similar,
        Recover::Mirrored => Kind::Mirrored,
    }
}

fn repeated(group: &Group) -> Repeated {
    Repeated {
        of: group.of.clone(),
        mesh: group.mesh,
        occurrences: group.occurrences.iter().map(|o| (o.part.clone(), o.by)).collect(),
    }
}

fn facts(group: &Group, mesh: usize) -> PartRecord {
    let mut kinds = BTreeMap::new();
    let mut residual = Residual::default();
    for occurrence in &group.occurrences {
        *kinds.entry(occurrence.kind).or_insert(0) += 1;
        residual.position = residual.position.max(occurrence.residual.position);
        residual.normal = residual.normal.max(occurrence.residual.normal);
        residual.tangent = residual.tangent.max(occurrence.residual.tangent);
    }
    let from: BTreeSet<usize> = group.occurrences.iter().map(|o| o.part.mesh).collect();
    PartRecord {
        mesh: mesh as u64,
        triangles: group.of.count() as u64,
        instances: group.occurrences.len() as u64,
        meshes: from.into_iter().map(|mesh| mesh as u64).collect(),
        kinds,
        residual,
        nodes: group.nodes,
        bytes: group.bytes,
    }
}
