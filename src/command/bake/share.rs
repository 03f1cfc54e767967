//! Levels that are a budget of the whole scene: its meshes share it before their chains are planned.
//!
//! Sequences stay what they are, one for each distinct sub-mesh and independent of the scene. A share becomes a number of
//! triangles, and the chain of a mesh depends on that number and not on the scene that it came from.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

use super::wave::ReadScene;
use crate::allocate::{Counts, Instances, SceneMesh, ScenePart, SceneShares};
use crate::config::LevelTarget;
use crate::gltf::share::Note;
use crate::key::JobKey;
use crate::mesh::hash::MeshHash;
use crate::mesh::{Mesh, Primitive, index_bytes};
use crate::metric::CostUnit;
use crate::plan::{MeshPlan, PartTask, Plan, simplify_settings};
use crate::report::ShareRecord;
use crate::simplify::progressive::Progressive;
use crate::simplify::replay::{CutPrimitive, Replay, Welded};

/// A mesh whose chain is not planned yet: its parts, or why it gets none.
pub type Waiting = Result<Vec<PartTask>, &'static str>;

/// The sequences that budgets are shared by: of each part the first recipe's.
pub fn wanted(scenes: &[ReadScene]) -> BTreeSet<JobKey> {
    let parts = scenes.iter().flat_map(|scene| &scene.waiting).flatten().flatten();
    parts.filter_map(|part| part.sequences.first().copied()).collect()
}

/// Plans the chains of a scene that waits for its shares. `sequences` has all of [`wanted`].
pub fn plan(scene: &mut ReadScene, plan: &mut Plan, sequences: &BTreeMap<JobKey, Progressive>) {
    let waiting = std::mem::take(&mut scene.waiting);
    if waiting.is_empty() {
        return;
    }
    let levels = shares(scene, &waiting, sequences);
    let of_mesh = |mesh: usize| -> Vec<ShareRecord> {
        let share = |(number, shares): (usize, &Option<Vec<usize>>)| {
            let triangles = shares.as_ref()?[mesh] as u64;
            Some(ShareRecord { level: number as u64 + 1, triangles })
        };
        levels.iter().enumerate().filter_map(share).collect()
    };
    scene.shares = (waiting.iter().enumerate())
        .map(|(mesh, parts)| if parts.is_ok() { of_mesh(mesh) } else { Vec::new() })
        .collect();
    scene.plans = (waiting.into_iter().enumerate())
        .map(|(mesh, parts)| match parts {
            Ok(parts) => {
                let mut settings = scene.todo.settings.clone();
                for (level, shares) in settings.chain.levels.iter_mut().zip(&levels) {
                    if let Some(shares) = shares {
                        *level = LevelTarget::Triangles(u32::try_from(shares[mesh]).unwrap_or(u32::MAX));
                    }
                }
                plan.chain(parts, scene.look(mesh), &settings)
            }
            Err(why) => MeshPlan::Alone(why),
        })
        .collect();
}

/// For each level that is a budget, the triangles of each mesh.
fn shares(
    scene: &mut ReadScene,
    waiting: &[Waiting],
    sequences: &BTreeMap<JobKey, Progressive>,
) -> Vec<Option<Vec<usize>>> {
    let levels = &scene.todo.settings.chain.levels;
    let of_bytes = levels.iter().any(|level| matches!(level, LevelTarget::SceneBytes(_)));
    let (meshes, kind_of) = kinds(scene, waiting, of_bytes, sequences);
    let drawn: u64 = (scene.scene.meshes.iter().zip(&scene.uses))
        .map(|(source, uses)| source.triangles() as u64 * uses.instances)
        .sum();
    let (by_triangles, by_bytes) = (OnceCell::new(), OnceCell::new());
    let mut notes = Vec::new();
    let levels = (1..)
        .zip(&scene.todo.settings.chain.levels)
        .map(|(number, level)| {
            let (budget, counts, what) = match *level {
                LevelTarget::SceneRatio(ratio) => ((drawn as f64 * ratio) as u64, Counts::Triangles, "triangles"),
                LevelTarget::SceneTriangles(triangles) => (triangles, Counts::Triangles, "triangles"),
                LevelTarget::SceneBytes(bytes) => (bytes, Counts::Bytes, "bytes"),
                _ => return None,
            };
            let ranked = if counts == Counts::Bytes { &by_bytes } else { &by_triangles };
            let (by_kind, taken) = ranked.get_or_init(|| SceneShares::new(&meshes, counts)).share(budget);
            if budget < taken {
                let text = format!(
                    "level {number}: the scene keeps {taken} {what}, more than the {budget} asked for: nothing is left that may \
                     be contracted"
                );
                notes.push(Note { place: String::new(), text, count: 1 });
            }
            Some(kind_of.iter().map(|&kind| by_kind[kind]).collect())
        })
        .collect();
    scene.notes.extend(notes);
    levels
}

/// The meshes that share, and which of them each mesh of the scene is: those of the same parts have the same chain, so they get
/// the same share.
fn kinds<'a>(
    scene: &ReadScene,
    waiting: &[Waiting],
    of_bytes: bool,
    sequences: &'a BTreeMap<JobKey, Progressive>,
) -> (Vec<SceneMesh<'a>>, Vec<usize>) {
    let unit = simplify_settings(&scene.todo.settings.simplify).metric.cost_unit();
    let mut kinds: BTreeMap<Vec<MeshHash>, usize> = BTreeMap::new();
    let mut stored: BTreeSet<Vec<MeshHash>> = BTreeSet::new();
    let mut meshes: Vec<SceneMesh> = Vec::new();
    let mut kind_of = Vec::new();
    for (index, parts) in waiting.iter().enumerate() {
        let hashes: Vec<MeshHash> = scene.sub_meshes[index].iter().map(|sub| sub.hash).collect();
        let instances = scene.uses[index].instances as usize;
        let next = meshes.len();
        let kind = if let Ok(parts) = parts {
            let kind = *kinds.entry(hashes).or_insert(next);
            if kind == next {
                meshes.push(shared(parts, unit, of_bytes, sequences));
            }
            kind
        } else {
            let source = &scene.scene.meshes[index];
            let is_new = 0 < instances && stored.insert(hashes);
            let bytes = if is_new { source.triangle_primitives().map(|(_, p)| bytes(p)).sum() } else { 0 };
            meshes.push(SceneMesh { fixed: source.triangles(), ..left_alone(bytes, unit) });
            next
        };
        let shown = &mut meshes[kind].instances;
        shown.count += instances;
        shown.largest_scale = shown.largest_scale.max(scene.scales[index]);
        kind_of.push(kind);
    }
    (meshes, kind_of)
}

/// A mesh that is not shown yet.
fn shared<'a>(
    parts: &[PartTask],
    unit: CostUnit,
    of_bytes: bool,
    sequences: &'a BTreeMap<JobKey, Progressive>,
) -> SceneMesh<'a> {
    let fixed = || parts.iter().filter(|part| part.sequences.is_empty());
    let part = |part: &PartTask| {
        let sequence = &sequences[part.sequences.first()?];
        let bytes = if of_bytes { bytes_of_levels(&part.mesh, sequence) } else { Vec::new() };
        Some(ScenePart { sequence, bytes })
    };
    SceneMesh {
        parts: parts.iter().filter_map(part).collect(),
        fixed: fixed().map(|part| part.mesh.triangles()).sum(),
        ..left_alone(fixed().flat_map(|part| &part.mesh.primitives).map(bytes).sum(), unit)
    }
}

/// Bytes of some levels of a part, each of three quarters of the triangles of the one before it: the vertices that its triangles use,
/// each as long as the source keeps it, and three indices a triangle.
fn bytes_of_levels(mesh: &Mesh, sequence: &Progressive) -> Vec<(usize, u64)> {
    let welded = Welded::new(mesh);
    let mut replay = Replay::new(mesh, &welded, sequence);
    let mut levels: Vec<(usize, u64)> = Vec::new();
    let mut steps = 0;
    loop {
        replay.advance(steps);
        let cuts = replay.primitives();
        let cut = |(primitive, cut): (&Primitive, &CutPrimitive)| size(primitive, cut.wedges.len(), cut.indices.len());
        let bytes: u64 = mesh.primitives.iter().zip(&cuts).map(cut).sum();
        let least = levels.last().map_or(u64::MAX, |(_, bytes)| *bytes);
        levels.push((steps, bytes.min(least)));
        if steps == sequence.steps.len() {
            return levels;
        }
        steps = sequence.cut_at(sequence.triangles_after(steps) * 3 / 4).max(steps + 1);
    }
}

fn left_alone<'a>(fixed_bytes: u64, unit: CostUnit) -> SceneMesh<'a> {
    let instances = Instances { count: 0, largest_scale: 0.0 };
    SceneMesh { parts: Vec::new(), fixed: 0, fixed_bytes, unit, instances }
}

/// Of a primitive as the source keeps it, without compression.
fn bytes(primitive: &Primitive) -> u64 {
    size(primitive, primitive.count, primitive.indices.len())
}

/// Of so many vertices and indices of a primitive.
fn size(primitive: &Primitive, vertices: usize, indices: usize) -> u64 {
    (vertices * primitive.row_bytes() + indices * index_bytes(vertices)) as u64
}
