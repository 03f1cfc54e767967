//! From the scenes' records to the whole record: order, sums and the list of distinct meshes.

use std::collections::{BTreeMap, BTreeSet};

use super::{DistinctMesh, FORMAT, MeshRecord, Problem, Report, SceneRecord, Status, Totals};
use crate::config::SceneSettings;
use crate::gltf::library;
use crate::mesh::hash::MeshHash;

impl Report {
    /// Puts the records of all scenes together, in whatever order they come.
    pub fn new(settings: SceneSettings, mut scenes: Vec<SceneRecord>, mut problems: Vec<Problem>) -> Self {
        scenes.sort_by(|a, b| a.path.cmp(&b.path));
        problems.sort();
        let meshes = distinct(&scenes);
        let totals = totals(&scenes, meshes.len());
        let tool = concat!("lodbake ", env!("CARGO_PKG_VERSION")).to_owned();
        Self { format: FORMAT, tool, settings, totals, problems, scenes, meshes }
    }
}

fn distinct(scenes: &[SceneRecord]) -> Vec<DistinctMesh> {
    let mut found: BTreeMap<MeshHash, (DistinctMesh, BTreeSet<usize>)> = BTreeMap::new();
    for (scene_index, scene) in scenes.iter().enumerate() {
        for mesh in &scene.meshes {
            for piece in &mesh.pieces {
                let (entry, users) = found.entry(piece.hash).or_insert_with(|| {
                    let (hash, triangles, vertices) = (piece.hash, piece.triangles, piece.vertices);
                    let entry = DistinctMesh { hash, triangles, vertices, uses: 0, instances: 0, scenes: 0 };
                    (entry, BTreeSet::new())
                });
                entry.uses += 1;
                entry.instances += mesh.instances;
                users.insert(scene_index);
            }
        }
    }
    found.into_values().map(|(entry, users)| DistinctMesh { scenes: users.len() as u64, ..entry }).collect()
}

fn totals(scenes: &[SceneRecord], distinct: usize) -> Totals {
    let with = |status| scenes.iter().filter(|scene| scene.status == status).count() as u64;
    let meshes = || scenes.iter().flat_map(|scene| &scene.meshes);
    let targets = meshes().flat_map(|mesh| &mesh.levels).map(|level| level.number).max().unwrap_or(0);
    let at = |number, weight: fn(&MeshRecord) -> u64| meshes().map(|m| triangles_at(m, number) * weight(m)).sum();
    Totals {
        files: scenes.len() as u64,
        baked: with(Status::Baked),
        copied: with(Status::Copied),
        failed: with(Status::Failed),
        skipped: with(Status::Skipped),
        meshes_found: meshes().map(|mesh| mesh.pieces.len() as u64).sum(),
        meshes_distinct: distinct as u64,
        instances: meshes().map(|mesh| mesh.instances).sum(),
        instances_found: meshes().filter(|mesh| mesh.instance_of.is_some()).count() as u64,
        instances_recovered: meshes().filter(|mesh| mesh.is_recovered()).count() as u64,
        triangles_drawn: (0..=targets).map(|number| at(number, |mesh| mesh.instances)).collect(),
        triangles_stored: (0..=targets).map(|number| at(number, |mesh| u64::from(!mesh.is_recovered()))).collect(),
        bytes_in: scenes.iter().map(|scene| scene.bytes_in).sum(),
        bytes_out: scenes.iter().map(|scene| scene.bytes_out).sum::<u64>() - repeated(scenes),
    }
}

/// Bytes of library files beyond the first scene that has them: each scene counts what it loads.
fn repeated(scenes: &[SceneRecord]) -> u64 {
    let mut known = BTreeSet::new();
    let outputs = scenes.iter().flat_map(|scene| &scene.outputs);
    let shared = outputs.filter(|o| o.path.strip_prefix(library::FOLDER).is_some_and(|rest| rest.starts_with('/')));
    shared.filter(|output| !known.insert(&output.path)).map(|output| output.bytes).sum()
}

/// Triangles of a mesh as shown for a target; 0 is the source.
fn triangles_at(mesh: &MeshRecord, number: u64) -> u64 {
    mesh.level_for(number).map_or(mesh.triangles, |level| level.triangles)
}
