//! Identified scenes + settings → what has to be there before they can be written: sequences of distinct sub-meshes,
//! and chains cut from them. Looks nothing up and computes nothing.
//!
//! A job is a pure function of bytes: its key holds the mesh hash, the settings that are used and the algorithm version,
//! and no path, name or scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::config::{self, ErrorUnit, LevelTarget, SceneSettings, SimplifySettings};
use crate::gltf::scene::SourceMesh;
use crate::identify::SubMesh;
use crate::key::{JobKey, Manifest, ManifestWriter, MeshParts, SequenceJob, key_of, write_chain};
use crate::lod::{ChainSettings, Storage, Target};
use crate::mesh::Mesh;
use crate::mesh::hash::MeshHash;
use crate::mesh::layout::AttributeScale;
use crate::metric::Placement;
use crate::metric::its::EdgeWeights;
use crate::simplify::{MetricKind, Settings};

/// A distinct sub-mesh to be simplified with one recipe.
#[derive(Clone, Debug)]
pub struct SequenceTask {
    /// Content hash of the sub-mesh.
    pub hash: MeshHash,
    /// The sub-mesh.
    pub mesh: Arc<Mesh>,
    /// The recipe.
    pub settings: Settings,
}

/// A chain to be cut for a mesh.
#[derive(Clone, Debug)]
pub struct ChainTask {
    /// The mesh's sub-meshes in order.
    pub parts: Vec<PartTask>,
    /// Targets and storage.
    pub settings: ChainSettings,
}

/// One sub-mesh of a chain.
#[derive(Clone, Debug)]
pub struct PartTask {
    /// Content hash.
    pub hash: MeshHash,
    /// The sub-mesh.
    pub mesh: Arc<Mesh>,
    /// Its sequence; `None` if it is left as it is.
    pub sequence: Option<JobKey>,
    /// Levels may refer to the source's vertices.
    pub shareable: bool,
}

/// Everything that a set of scenes needs, each thing once.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Distinct sub-meshes.
    pub meshes: BTreeMap<MeshHash, Arc<Mesh>>,
    /// Sequences by key.
    pub sequences: BTreeMap<JobKey, SequenceTask>,
    /// Chains by key.
    pub chains: BTreeMap<JobKey, ChainTask>,
}

/// What is planned for one mesh of a scene.
#[derive(Clone, Debug)]
pub enum MeshPlan {
    /// Its levels are in this chain; parts are the mesh's sub-meshes in order.
    Chain(JobKey),
    /// It has no levels, and why.
    Alone(&'static str),
}

impl Plan {
    /// Adds what one mesh needs. `is_sealed` = levels cannot refer to the source's vertices (they are compressed in a
    /// way that only whole primitives can be decoded from).
    pub fn add(
        &mut self,
        source: &SourceMesh,
        sub_meshes: &[SubMesh],
        is_sealed: bool,
        settings: &SceneSettings,
    ) -> MeshPlan {
        if sub_meshes.is_empty() {
            return MeshPlan::Alone("it has no triangles");
        }
        let recipe = recipe(settings);
        let shareable = !is_sealed && recipe.placement == Placement::Subset;
        let parts: Vec<PartTask> = sub_meshes
            .iter()
            .map(|sub| {
                let mesh = self.meshes.entry(sub.hash).or_insert_with(|| Arc::new(sub.mesh(source))).clone();
                let enough = settings.min_triangles <= mesh.triangles();
                let sequence = enough.then(|| self.sequence(sub.hash, &mesh, settings, recipe));
                PartTask { hash: sub.hash, mesh, sequence, shareable }
            })
            .collect();
        if parts.iter().all(|part| part.sequence.is_none()) {
            return MeshPlan::Alone("every part of it has fewer triangles than `min_triangles`");
        }
        let key = key_of(&ChainManifest { parts: &parts, chain: &settings.chain });
        let chain = || ChainTask { parts, settings: chain_settings(&settings.chain) };
        self.chains.entry(key).or_insert_with(chain);
        MeshPlan::Chain(key)
    }

    fn sequence(&mut self, hash: MeshHash, mesh: &Arc<Mesh>, settings: &SceneSettings, recipe: Settings) -> JobKey {
        let job = SequenceJob { mesh: hash, parts: MeshParts::of(mesh), simplify: &settings.simplify };
        let key = key_of(&job);
        let task = || SequenceTask { hash, mesh: mesh.clone(), settings: recipe };
        self.sequences.entry(key).or_insert_with(task);
        key
    }
}

/// What a chain depends on: its sequences, in order, and how they are cut.
struct ChainManifest<'a> {
    parts: &'a [PartTask],
    chain: &'a config::ChainSettings,
}

impl Manifest for ChainManifest<'_> {
    fn write(&self, to: &mut dyn ManifestWriter) {
        to.integer("format_version", crate::key::FORMAT_VERSION.into());
        to.integer("algorithm_version", crate::key::ALGORITHM_VERSION.into());
        for (index, part) in self.parts.iter().enumerate() {
            to.open(&format!("part[{index}]"));
            match &part.sequence {
                Some(key) => to.hash("sequence", &key.0),
                None => to.hash("as_source", &part.hash.0),
            }
            to.flag("shareable", part.shareable);
            to.close();
        }
        write_chain(self.chain, to);
    }
}

fn recipe(settings: &SceneSettings) -> Settings {
    let SimplifySettings { metric, effort, weights, placement, lock_border } = &settings.simplify;
    Settings {
        metric: match metric {
            config::Metric::Its => MetricKind::Its,
            config::Metric::Qem => MetricKind::Qem,
        },
        placement: match placement {
            config::Placement::Auto | config::Placement::Optimal => Placement::Optimal,
            config::Placement::Subset => Placement::Subset,
        },
        attributes: AttributeScale { normal: weights.normal, texcoord: weights.texcoord, color: weights.color },
        edges: EdgeWeights { border: weights.border, seam: weights.seam, crease: weights.crease },
        lock_border: *lock_border,
        memoryless: *effort == config::Effort::Balanced,
    }
}

fn chain_settings(chain: &config::ChainSettings) -> ChainSettings {
    let target = |level: &LevelTarget| match *level {
        LevelTarget::Ratio(ratio) => Target::Ratio(ratio),
        LevelTarget::Triangles(triangles) => Target::Triangles(triangles as usize),
        LevelTarget::Error { limit, unit: ErrorUnit::Radius } => Target::ErrorOfRadius(limit),
        LevelTarget::Error { limit, unit: ErrorUnit::Object } => Target::Error(limit),
    };
    ChainSettings {
        targets: chain.levels.iter().map(target).collect(),
        storage: match chain.storage {
            config::Storage::Smallest => Storage::Smallest,
            config::Storage::Compact => Storage::Compact,
            config::Storage::Shared => Storage::Shared,
        },
        vertex_cache: chain.vertex_cache,
    }
}
