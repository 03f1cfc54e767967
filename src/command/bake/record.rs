//! What a report says of one scene, made where the scene is baked and remembered by the index.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::recover::Instance;
use super::wave::ReadScene;
use crate::appearance::images::ImageFacts;
use crate::gltf::fold::Folded;
use crate::gltf::scene::{Scene, SourceMesh};
use crate::identify::SubMesh;
use crate::identify::alike::Match;
use crate::lod::{Chain, ChainLevel};
use crate::mesh::hash::MeshHash;
use crate::mesh::{Level, LevelVertices};
use crate::plan::MeshPlan;
use crate::report::{
    BatchesRecord, ImageRecord, InstanceRecord, LevelRecord, MeshRecord, PieceLevel, PieceRecord, Problem, SceneCosts,
    SceneRecord, Severity, Status,
};
use crate::scan::SceneFile;
use crate::work::{Baked, LevelLook};

/// The record of a scene with its problems.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneFacts {
    pub record: SceneRecord,
    pub problems: Vec<Problem>,
}

/// First byte of remembered facts; another one means another shape of [`SceneFacts`].
const VERSION: u8 = 9;

/// For the index.
pub fn to_bytes(facts: &SceneFacts) -> Vec<u8> {
    postcard::to_extend(facts, vec![VERSION]).expect("facts are plain data")
}

/// From the index; `None` if they are of another version.
pub fn from_bytes(bytes: &[u8]) -> Option<SceneFacts> {
    let (&version, rest) = bytes.split_first()?;
    if version != VERSION {
        return None;
    }
    postcard::from_bytes(rest).ok()
}

impl SceneFacts {
    fn without_output(file: &SceneFile, status: Status, problems: Vec<Problem>) -> Self {
        let record = SceneRecord {
            path: file.relative.clone(),
            status,
            settings: None,
            bytes_in: file.stat.size,
            bytes_out: 0,
            outputs: Vec::new(),
            meshes: Vec::new(),
            costs: None,
            batches: None,
            parts: None,
        };
        Self { record, problems }
    }

    /// Of a scene that a setting leaves out.
    pub fn skipped(file: &SceneFile) -> Self {
        Self::without_output(file, Status::Skipped, Vec::new())
    }

    /// Of a scene that could not be baked.
    pub fn failed(file: &SceneFile, problem: Problem) -> Self {
        Self::without_output(file, Status::Failed, vec![problem])
    }
}

/// A warning at a place of a scene.
pub fn warning(scene: &str, place: &str, cause: &str) -> Problem {
    Problem {
        scene: Some(scene.to_owned()),
        severity: Severity::Warning,
        place: place.to_owned(),
        cause: cause.to_owned(),
        hint: None,
    }
}

/// The records of all meshes of a scene. `switches` tells screen coverage and distance of the levels of a mesh from its
/// radius and the levels' errors.
pub fn meshes(scene: &ReadScene, baked: &Baked, switches: impl Fn(f64, &[f64]) -> Vec<(f64, f64)>) -> Vec<MeshRecord> {
    let copies = copies(scene);
    let record = |source: &SourceMesh| {
        let radius = scene.radii[source.index];
        let (chain, looks, notes) = match &scene.plans[source.index] {
            MeshPlan::Chain { chain, look } => {
                let looks = look.as_ref().and_then(|key| baked.looks.get(key)).map(|looks| looks.as_slice());
                (baked.chains.get(chain).map(|chain| &**chain), looks.unwrap_or_default(), Vec::new())
            }
            MeshPlan::Alone(why) => (None, &[][..], vec![format!("no levels: {why}")]),
        };
        MeshRecord {
            index: source.index as u64,
            name: source.name.clone(),
            instances: scene.uses[source.index].instances,
            draw_calls: (scene.uses[source.index].nodes * source.primitives.len()) as u64,
            copy_of: copies[source.index],
            instance_of: scene.instances.get(&source.index).map(instance),
            triangles: source.triangles() as u64,
            vertices: source.triangle_primitives().map(|(_, p)| p.count as u64).sum(),
            radius,
            pieces: pieces(scene, source, chain),
            levels: chain.map_or_else(Vec::new, |chain| {
                let errors: Vec<f64> = chain.levels.iter().map(|level| level.error).collect();
                let switches = switches(radius, &errors);
                let levels = chain.levels.iter().zip(switches).enumerate();
                levels.map(|(i, (level, at))| level_record(scene, level, looks.get(i), radius, at)).collect()
            }),
            shares: scene.shares.get(source.index).cloned().unwrap_or_default(),
            notes,
        }
    };
    scene.scene.meshes.iter().map(record).collect()
}

fn instance(instance: &Instance) -> InstanceRecord {
    let Match { mesh: _, of, kind, by, residual } = &instance.found;
    InstanceRecord {
        mesh: *of as u64,
        kind: *kind,
        scale: by.scale,
        residual: *residual,
        kept: instance.kept.map(str::to_owned),
    }
}

/// What became of nodes that show the same mesh.
pub fn batches(folded: &Folded) -> BatchesRecord {
    BatchesRecord {
        batches: folded.batches as u64,
        instances: folded.instances as u64,
        stayed: folded.stayed.iter().map(|(why, count)| ((*why).to_owned(), *count as u64)).collect(),
    }
}

/// For each mesh, an earlier one with the same geometry that is kept in other bytes. Meshes that differ by their
/// materials alone share accessors, and so they are no copies.
fn copies(scene: &ReadScene) -> Vec<Option<u64>> {
    let document = scene.scene.document.array("meshes").unwrap_or_default();
    let accessors = |index: usize| -> Vec<(&Value, &Value)> {
        let primitives = document[index].get("primitives").and_then(Value::as_array);
        primitives.into_iter().flatten().map(|p| (&p["attributes"], &p["indices"])).collect()
    };
    let mut first: BTreeMap<Vec<MeshHash>, usize> = BTreeMap::new();
    let copy = |(index, subs): (usize, &Vec<SubMesh>)| {
        let hashes: Vec<MeshHash> = subs.iter().map(|sub| sub.hash).collect();
        if hashes.is_empty() {
            return None;
        }
        let earlier = *first.entry(hashes).or_insert(index);
        (earlier != index && accessors(earlier) != accessors(index)).then_some(earlier as u64)
    };
    scene.sub_meshes.iter().enumerate().map(copy).collect()
}

/// What it takes to load and draw a scene; its bytes are known once it is written.
pub fn costs(scene: &Scene, meshes: &[MeshRecord], images: &[ImageFacts]) -> SceneCosts {
    let document = scene.document.array("meshes").unwrap_or_default();
    let primitives = document.iter().filter_map(|mesh| mesh.get("primitives")?.as_array()).flatten();
    let materials: BTreeSet<Option<u64>> = primitives.map(|p| p.get("material").and_then(Value::as_u64)).collect();
    let image = |facts: &ImageFacts| ImageRecord {
        name: facts.name.clone(),
        bytes: facts.bytes,
        width: facts.size.map(|size| size[0]),
        height: facts.size.map(|size| size[1]),
    };
    SceneCosts {
        draw_calls: meshes.iter().map(|mesh| mesh.draw_calls).sum(),
        materials: materials.len() as u64,
        geometry_bytes: 0,
        images: images.iter().map(image).collect(),
    }
}

fn pieces(scene: &ReadScene, source: &SourceMesh, chain: Option<&Chain>) -> Vec<PieceRecord> {
    let subs = scene.sub_meshes[source.index].iter().enumerate();
    subs.map(|(part, sub)| {
        let members = || source.triangle_primitives().filter(|(index, _)| sub.primitives.contains(index));
        PieceRecord {
            hash: sub.hash,
            primitives: sub.primitives.iter().map(|&p| p as u64).collect(),
            triangles: members().map(|(_, p)| p.triangles() as u64).sum(),
            vertices: members().map(|(_, p)| p.count as u64).sum(),
            levels: chain.map_or_else(Vec::new, |chain| piece_levels(chain, part)),
        }
    })
    .collect()
}

fn level_record(
    scene: &ReadScene,
    level: &ChainLevel,
    look: Option<&LevelLook>,
    radius: f64,
    (coverage, distance): (f64, f64),
) -> LevelRecord {
    LevelRecord {
        number: level.target as u64 + 1,
        target: scene.todo.settings.chain.levels[level.target],
        triangles: level.triangles as u64,
        vertices: level.parts.iter().flatten().map(vertices).sum(),
        bytes: level.parts.iter().flatten().map(|part| part.bytes() as u64).sum(),
        error: level.error,
        error_of_radius: if 0.0 < radius { level.error / radius } else { 0.0 },
        coverage,
        distance,
        stop: level.stop.into(),
        recipe: level.recipe.clone(),
        d_rms: look.map(|look| look.d_rms),
        worst_view: look.map(|look| look.worst_view),
        silhouette: look.map(|look| look.silhouette),
        surface: look.and_then(|look| look.surface),
    }
}

fn piece_levels(chain: &Chain, part: usize) -> Vec<PieceLevel> {
    let levels = chain.levels.iter();
    levels
        .filter_map(|level| {
            let piece = level.parts[part].as_ref()?;
            Some(PieceLevel { triangles: piece.triangles() as u64, error: piece.error })
        })
        .collect()
}

/// Vertices that a level uses, its own or the source's.
fn vertices(level: &Level) -> u64 {
    let count = |p: &crate::mesh::LevelPrimitive| match &p.vertices {
        LevelVertices::Own(own) => own.count,
        LevelVertices::Source => {
            let mut used = p.indices.clone();
            used.sort_unstable();
            used.dedup();
            used.len()
        }
    };
    level.primitives.iter().map(count).sum::<usize>() as u64
}
