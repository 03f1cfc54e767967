//! Identified scenes + settings → what has to be there before they can be written: sequences of distinct sub-meshes,
//! chains cut from them, and figures of how their levels look. Looks nothing up and computes nothing.
//!
//! A job is a pure function of bytes: its key holds the mesh hash, the settings that are used and the algorithm version,
//! and no path, name or scene. Where looks are concerned, it holds the content of materials and images.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::config::{self, ErrorUnit, LevelTarget, SceneSettings, SimplifySettings};
use crate::gltf::scene::SourceMesh;
use crate::identify::SubMesh;
use crate::key::{ContentHash, JobKey, Manifest, ManifestWriter, MeshParts, SequenceJob, key_of, write_chain};
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
    /// The recipes that `sequences` of the parts stand for; more than one where the best-looking is kept.
    pub recipes: Vec<Recipe>,
    /// Rounds of re-weighting by pictures that follow, with the recipe that looks best so far.
    pub rounds: usize,
    /// What its levels are judged by, where looks decide.
    pub judged: Option<MeshLook>,
}

/// One way to simplify.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// What a report calls it.
    pub name: String,
    /// What it is.
    pub settings: Settings,
}

/// What a mesh looks like: by name and place, since textures are loaded only where pictures are drawn.
#[derive(Clone, Debug)]
pub struct MeshLook {
    /// Number of the scene in its wave, whose materials are meant.
    pub scene: usize,
    /// Content of the materials and images of the mesh's parts, primitive by primitive.
    pub hash: ContentHash,
    /// Material of each primitive of the parts, in their order, as an index in the document's `materials`.
    pub materials: Arc<Vec<Option<usize>>>,
    /// Pixels on each side of the pictures.
    pub size: u32,
}

/// Figures of how the levels of a chain look.
#[derive(Clone, Debug)]
pub struct LookTask {
    /// The chain.
    pub chain: JobKey,
    /// What its mesh looks like.
    pub look: MeshLook,
}

/// One sub-mesh of a chain.
#[derive(Clone, Debug)]
pub struct PartTask {
    /// Content hash.
    pub hash: MeshHash,
    /// The sub-mesh.
    pub mesh: Arc<Mesh>,
    /// Its sequences, one for each recipe; none if it is left as it is.
    pub sequences: Vec<JobKey>,
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
    /// Figures of looks by key.
    pub looks: BTreeMap<JobKey, LookTask>,
}

/// What is planned for one mesh of a scene.
#[derive(Clone, Debug)]
pub enum MeshPlan {
    /// It has levels.
    Chain {
        /// The chain; its parts are the mesh's sub-meshes in order.
        chain: JobKey,
        /// Figures of how its levels look, where they are recorded.
        look: Option<JobKey>,
    },
    /// It has no levels, and why.
    Alone(&'static str),
}

impl Plan {
    /// Adds what one mesh needs. `is_sealed` = levels cannot refer to the source's vertices (they are compressed in a
    /// way that only whole primitives can be decoded from). `look` = what the mesh looks like, where that is asked for.
    pub fn add(
        &mut self,
        source: &SourceMesh,
        sub_meshes: &[SubMesh],
        is_sealed: bool,
        look: Option<&MeshLook>,
        settings: &SceneSettings,
    ) -> MeshPlan {
        match self.parts(source, sub_meshes, is_sealed, settings) {
            Ok(parts) => self.chain(parts, look, settings),
            Err(why) => MeshPlan::Alone(why),
        }
    }

    /// Adds the sequences that a mesh needs: its parts, or why it gets no levels.
    pub fn parts(
        &mut self,
        source: &SourceMesh,
        sub_meshes: &[SubMesh],
        is_sealed: bool,
        settings: &SceneSettings,
    ) -> Result<Vec<PartTask>, &'static str> {
        if sub_meshes.is_empty() {
            return Err("it has no triangles");
        }
        let recipes = recipes(&settings.simplify);
        let shareable = !is_sealed && placement(&settings.simplify) == Placement::Subset;
        let parts: Vec<PartTask> = sub_meshes
            .iter()
            .map(|sub| {
                let mesh = self.meshes.entry(sub.hash).or_insert_with(|| Arc::new(sub.mesh(source))).clone();
                let enough = settings.min_triangles <= mesh.triangles();
                let sequence = |recipe| self.sequence(sub.hash, &mesh, recipe);
                let sequences = if enough { recipes.iter().map(sequence).collect() } else { Vec::new() };
                PartTask { hash: sub.hash, mesh, sequences, shareable }
            })
            .collect();
        if parts.iter().all(|part| part.sequences.is_empty()) {
            return Err("every part of it has fewer triangles than `min_triangles`");
        }
        Ok(parts)
    }

    /// Adds the chain of a mesh of these parts.
    pub fn chain(&mut self, parts: Vec<PartTask>, look: Option<&MeshLook>, settings: &SceneSettings) -> MeshPlan {
        let judged = look.filter(|_| settings.looks_decide()).cloned();
        let rounds = if settings.simplify.has_rounds() && judged.is_some() { ROUNDS } else { 0 };
        let chain = &settings.chain;
        let key = key_of(&ChainManifest { parts: &parts, chain, rounds, judged: judged.as_ref() });
        let chain = || ChainTask {
            parts,
            settings: chain_settings(&settings.chain),
            recipes: recipes(&settings.simplify).iter().map(recipe).collect(),
            rounds,
            judged,
        };
        self.chains.entry(key).or_insert_with(chain);
        let look = look.filter(|_| settings.appearance.record).map(|look| {
            let task = LookTask { chain: key, look: look.clone() };
            let key = key_of(&LookManifest(&task));
            self.looks.entry(key).or_insert(task);
            key
        });
        MeshPlan::Chain { chain: key, look }
    }

    fn sequence(&mut self, hash: MeshHash, mesh: &Arc<Mesh>, recipe: &SimplifySettings) -> JobKey {
        let job = SequenceJob { mesh: hash, parts: MeshParts::of(mesh), simplify: recipe };
        let key = key_of(&job);
        let task = || SequenceTask { hash, mesh: mesh.clone(), settings: simplify_settings(recipe) };
        self.sequences.entry(key).or_insert_with(task);
        key
    }
}

/// What a chain depends on: its sequences, in order, and how they are cut.
struct ChainManifest<'a> {
    parts: &'a [PartTask],
    chain: &'a config::ChainSettings,
    rounds: usize,
    judged: Option<&'a MeshLook>,
}

impl Manifest for ChainManifest<'_> {
    fn write(&self, to: &mut dyn ManifestWriter) {
        to.integer("format_version", crate::key::FORMAT_VERSION.into());
        to.integer("algorithm_version", crate::key::ALGORITHM_VERSION.into());
        for (index, part) in self.parts.iter().enumerate() {
            to.open(&format!("part[{index}]"));
            if part.sequences.is_empty() {
                to.hash("as_source", &part.hash.0);
            }
            for key in &part.sequences {
                to.hash("sequence", &key.0);
            }
            to.flag("shareable", part.shareable);
            to.close();
        }
        write_chain(self.chain, to);
        if 0 < self.rounds {
            to.integer("rounds", self.rounds as u64);
        }
        if let Some(look) = self.judged {
            write_look(look, to);
        }
    }
}

/// What figures of looks depend on: the chain, and what its mesh looks like.
struct LookManifest<'a>(&'a LookTask);

impl Manifest for LookManifest<'_> {
    fn write(&self, to: &mut dyn ManifestWriter) {
        to.integer("format_version", crate::key::FORMAT_VERSION.into());
        to.hash("chain", &self.0.chain.0);
        write_look(&self.0.look, to);
    }
}

fn write_look(look: &MeshLook, to: &mut dyn ManifestWriter) {
    to.integer("look_version", crate::key::LOOK_VERSION.into());
    to.hash("look", &look.hash.0);
    to.integer("look_size", look.size.into());
}

/// Factors of the weights of normals and texture coordinates, the most useful first: which weights suit a mesh depends on
/// how clean its normals are and how busy its textures.
const FACTORS: [(f64, f64); 7] =
    [(1.0, 1.0), (6.0, 1.0), (1.0, 1.0 / 6.0), (20.0, 1.0), (1.0, 3.0), (1.0 / 6.0, 1.0), (6.0, 3.0)];

/// Rounds of effort `best`: after four, pictures hardly get better.
const ROUNDS: usize = 4;

/// The recipes to try: one, but for metric `auto` and effort `best`. Each is a set of settings that users could write
/// themselves, so that it shares its results with them.
fn recipes(settings: &SimplifySettings) -> Vec<SimplifySettings> {
    let has_choice = settings.has_choice();
    let mut settings = settings.clone();
    if settings.effort == config::Effort::Best {
        // Rounds come later, on top of what `balanced` makes.
        settings.effort = config::Effort::Balanced;
    }
    if !has_choice {
        return vec![settings];
    }
    let candidates = settings.candidates as usize;
    let its = FACTORS.iter().map(|&(normal, texcoord)| {
        let mut recipe = SimplifySettings { metric: config::Metric::Its, ..settings.clone() };
        recipe.weights.normal *= normal;
        recipe.weights.texcoord *= texcoord;
        recipe
    });
    let qem = SimplifySettings { metric: config::Metric::Qem, ..settings };
    its.chain(std::iter::once(qem)).take(candidates).collect()
}

fn recipe(settings: &SimplifySettings) -> Recipe {
    Recipe { name: recipe_name(settings), settings: simplify_settings(settings) }
}

/// `its normal 0.018 texcoord 0.3`: what a report calls the winner.
fn recipe_name(recipe: &SimplifySettings) -> String {
    if recipe.metric != config::Metric::Its {
        return recipe.metric.name().to_owned();
    }
    // The weights of the portfolio are products: six digits tell them apart and leave out the noise.
    let digits = |weight: f64| format!("{weight:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
    format!("its normal {} texcoord {}", digits(recipe.weights.normal), digits(recipe.weights.texcoord))
}

fn placement(settings: &SimplifySettings) -> Placement {
    match settings.placement {
        config::Placement::Auto | config::Placement::Optimal => Placement::Optimal,
        config::Placement::Subset => Placement::Subset,
    }
}

/// What the simplifier is told.
pub(crate) fn simplify_settings(settings: &SimplifySettings) -> Settings {
    let SimplifySettings { metric, effort, weights, placement: _, lock_border, candidates: _ } = settings;
    // Metrics that do not see attributes carry them: by the scale they are rounded, which must not depend on what is not in
    // their key.
    let seen = if metric.sees_attributes() { *weights } else { config::Weights::default() };
    Settings {
        metric: match metric {
            // `recipes` has put others in the place of `auto`.
            config::Metric::Its | config::Metric::Auto => MetricKind::Its,
            config::Metric::Qem => MetricKind::Qem,
            config::Metric::QemAttributes => MetricKind::QemAttributes,
            config::Metric::Gaps => MetricKind::Gaps,
            config::Metric::ItsPaper => MetricKind::ItsPaper,
            config::Metric::Ias => MetricKind::Ias,
            config::Metric::Aps => MetricKind::Aps,
            config::Metric::Tmpm => MetricKind::Tmpm,
            config::Metric::Naive => MetricKind::Naive,
        },
        placement: placement(settings),
        attributes: AttributeScale { normal: seen.normal, texcoord: seen.texcoord, color: seen.color },
        edges: EdgeWeights { border: weights.border, seam: weights.seam, crease: weights.crease },
        lock_border: *lock_border,
        memoryless: *effort != config::Effort::Fast,
        by_visibility: *effort != config::Effort::Fast,
    }
}

fn chain_settings(chain: &config::ChainSettings) -> ChainSettings {
    let target = |level: &LevelTarget| match *level {
        LevelTarget::Ratio(ratio) => Target::Ratio(ratio),
        LevelTarget::Triangles(triangles) => Target::Triangles(triangles as usize),
        LevelTarget::Error { limit, unit: ErrorUnit::Radius } => Target::ErrorOfRadius(limit),
        LevelTarget::Error { limit, unit: ErrorUnit::Object } => Target::Error(limit),
        // The sphere's diameter is `size` pixels high.
        LevelTarget::Pixels { limit, size } => Target::ErrorOfMesh(2.0 * limit / size),
        LevelTarget::Appearance(limit) => Target::Appearance(limit),
        // A budget that was not shared out asks nothing of a mesh: where it is shared, each mesh's number stands here.
        LevelTarget::SceneRatio(_) | LevelTarget::SceneTriangles(_) | LevelTarget::SceneBytes(_) => Target::Ratio(1.0),
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
