//! The record of what a pipeline's outputs are: every fact, for people, programs and later comparisons.
//!
//! It tells the state of the outputs, not the story of one run: no times, no thread counts, no cache hits and no
//! absolute paths, so that the same inputs give the same record on any machine, after a cold run, a warm one or one
//! that had nothing to do. (The story is in the events of `progress`.) Knows nothing of how the facts came about.

mod assemble;
pub mod inspection;
mod json;
mod table;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use json::{FILE_NAME, ReportError, Written, from_bytes, read, schema, to_json, write};
pub use table::{columns, percent, summary_table};

use crate::compare::SurfaceDistance;
use crate::config::{LevelTarget, SceneSettings};
use crate::identify::alike::{Kind, Residual};
use crate::mesh::hash::MeshHash;

/// Version of the record. A reader refuses a greater one; added fields do not raise it, changed meanings do.
pub const FORMAT: u32 = 1;

/// `report.json`. Scenes, meshes and problems are sorted; paths are relative, with `/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of this record.
    pub format: u32,
    /// Program and version that wrote the outputs, e.g. `lodbake 0.1.0`.
    pub tool: String,
    /// Settings of every scene that does not list its own.
    pub settings: SceneSettings,
    /// Sums over all scenes.
    pub totals: Totals,
    /// What went wrong or is odd, by scene.
    pub problems: Vec<Problem>,
    /// One for each scene file found, by path.
    pub scenes: Vec<SceneRecord>,
    /// Distinct sub-meshes of all scenes, by hash.
    pub meshes: Vec<DistinctMesh>,
}

/// Sums over all scenes. Failed scenes count in `files`, `failed` and `bytes_in` only.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Totals {
    /// Scene files found.
    pub files: u64,
    /// Scenes with levels.
    pub baked: u64,
    /// Scenes written without levels, since they hold nothing to bake.
    pub copied: u64,
    /// Scenes that could not be baked.
    pub failed: u64,
    /// Scenes left out by a setting.
    pub skipped: u64,
    /// Sub-meshes declared in all scenes.
    pub meshes_found: u64,
    /// Distinct ones among them.
    pub meshes_distinct: u64,
    /// Nodes with a mesh in all scenes.
    pub instances: u64,
    /// Meshes that were found to be instances of others of their file.
    #[serde(default)]
    pub instances_found: u64,
    /// Those among them that the outputs have as instances.
    #[serde(default)]
    pub instances_recovered: u64,
    /// Triangles drawn when every instance shows its level for the target `k`; `[0]` is the source. An instance
    /// without a level for that target shows the one before.
    pub triangles_drawn: Vec<u64>,
    /// The same with every mesh of a file counted once, however many nodes show it; recovered instances are no meshes.
    pub triangles_stored: Vec<u64>,
    /// Bytes of the source files: scenes and their buffers, not images.
    pub bytes_in: u64,
    /// Bytes of the outputs: scenes and their buffers, not images; a file of the library once.
    pub bytes_out: u64,
}

/// How far a scene got.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Written with levels.
    Baked,
    /// Written without levels, since it holds nothing to bake.
    Copied,
    /// Could not be baked; `problems` says why.
    Failed,
    /// Left out by a setting.
    Skipped,
}

/// One scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneRecord {
    /// Relative to its input folder.
    pub path: String,
    /// How far it got.
    pub status: Status,
    /// Its settings, where an override makes them differ from the report's.
    pub settings: Option<SceneSettings>,
    /// Bytes of the file and its buffers, not of images.
    pub bytes_in: u64,
    /// Bytes of `outputs` without images, those that it shares with other scenes included; 0 if there are none.
    pub bytes_out: u64,
    /// Files written for it, relative to the output folder: those that it shares with others, its buffers, and the scene last.
    pub outputs: Vec<OutputRecord>,
    /// One for each mesh of the file, in its order.
    pub meshes: Vec<MeshRecord>,
    /// What it takes to load and draw it. Absent where nothing was read, and in records of earlier versions.
    #[serde(default)]
    pub costs: Option<SceneCosts>,
    /// Nodes that became batches of instances. Absent where that is not asked for.
    #[serde(default)]
    pub batches: Option<BatchesRecord>,
    /// Parts that occur more than once and were taken out of meshes. Absent where that is not asked for.
    #[serde(default)]
    pub parts: Option<PartsRecord>,
}

/// Connected parts of meshes that occur more than once in the file, and became instances.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartsRecord {
    /// Each of them, once.
    pub groups: Vec<PartRecord>,
    /// Nodes added for them.
    pub nodes: u64,
    /// Bytes of all buffers before they were taken out, and after.
    pub bytes_before: u64,
    /// See `bytes_before`.
    pub bytes_after: u64,
    /// How many other parts stay where they are, although enough of them have equally many triangles, by the reason.
    pub stayed: BTreeMap<String, u64>,
}

/// A connected part that occurs more than once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PartRecord {
    /// Index of the mesh that shows it: behind those of the source, or one of the source that is left with this part alone.
    pub mesh: u64,
    /// Its triangles.
    pub triangles: u64,
    /// How often it was taken out of meshes.
    pub instances: u64,
    /// Indices of these meshes.
    pub meshes: Vec<u64>,
    /// What it takes to make them of the one that is left, and how often.
    pub kinds: BTreeMap<Kind, u64>,
    /// The largest difference that is left, positions as a fraction of the radius of the part.
    pub residual: Residual,
    /// Nodes that show it: for each instance one below every node that shows its mesh.
    pub nodes: u64,
    /// Bytes of one: vertices and indices.
    pub bytes: u64,
}

/// Nodes that show the same mesh, written as batches of `EXT_mesh_gpu_instancing`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BatchesRecord {
    /// Batches written.
    pub batches: u64,
    /// Nodes of the source that they draw.
    pub instances: u64,
    /// How many nodes stay nodes although others show the same mesh, by the reason.
    pub stayed: BTreeMap<String, u64>,
}

/// What it takes to load and draw a scene, beside its triangles.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SceneCosts {
    /// Draw calls when every node of the file is seen: primitives of each node's mesh. A node with
    /// `EXT_mesh_gpu_instancing` draws all its instances at once.
    pub draw_calls: u64,
    /// Materials that its meshes use.
    pub materials: u64,
    /// Bytes of the written scene and its buffers, shared ones included, without the images inside them.
    pub geometry_bytes: u64,
    /// One for each entry of `images`.
    pub images: Vec<ImageRecord>,
}

/// One image of a scene file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ImageRecord {
    /// Its name, else the name of its file.
    pub name: Option<String>,
    /// Length of the image file, wherever it is kept.
    pub bytes: u64,
    /// In texels; absent for formats that are not known.
    pub width: Option<u32>,
    /// In texels; absent for formats that are not known.
    pub height: Option<u32>,
}

impl SceneRecord {
    /// Bytes of all that was written for the scene: file, buffers and images beside it.
    pub fn file_bytes(&self) -> u64 {
        self.outputs.iter().map(|output| output.bytes).sum()
    }
}

/// One output file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct OutputRecord {
    /// Relative to the output folder.
    pub path: String,
    /// Length in bytes.
    pub bytes: u64,
    /// BLAKE3 of the content, 64 hexadecimal digits.
    pub hash: String,
}

/// One mesh of a scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeshRecord {
    /// Index in the file's `meshes`.
    pub index: u64,
    /// Its name in the file.
    pub name: Option<String>,
    /// Nodes that show it, in any scene of the file.
    pub instances: u64,
    /// Draw calls of all its nodes.
    #[serde(default)]
    pub draw_calls: u64,
    /// Index of an earlier mesh of the file with the same geometry in bytes of its own: instances that the file does not
    /// declare.
    #[serde(default)]
    pub copy_of: Option<u64>,
    /// An earlier mesh that it is an instance of, though the file does not say so. Looked for where `[instances]` asks for it.
    #[serde(default)]
    pub instance_of: Option<InstanceRecord>,
    /// Triangles of the source.
    pub triangles: u64,
    /// Vertices of the source.
    pub vertices: u64,
    /// Radius of the bounding sphere, in units of the mesh's own space.
    pub radius: f64,
    /// The sub-meshes it is made of.
    pub pieces: Vec<PieceRecord>,
    /// Its levels, finest first, without the source; empty if it is left alone.
    pub levels: Vec<LevelRecord>,
    /// What it gets of the levels that are budgets of the scene. Absent in records of earlier versions.
    #[serde(default)]
    pub shares: Vec<ShareRecord>,
    /// What a person should know, e.g. why there are no levels, or an extension that levels do not carry.
    pub notes: Vec<String>,
}

/// A mesh that is another one of its file but for the order of its data, a motion, a uniform scale or a mirror.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InstanceRecord {
    /// Index of that mesh: the first of the group.
    pub mesh: u64,
    /// What it takes to make one of the other.
    pub kind: Kind,
    /// From that mesh to this one.
    pub scale: f64,
    /// What is left between this mesh and the one rebuilt from that mesh.
    pub residual: Residual,
    /// Why the output has it as a mesh with bytes of its own all the same. Absent where it shows that mesh's.
    pub kept: Option<String>,
}

/// A sub-mesh in its place in a mesh: the smallest group of primitives that share border vertices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PieceRecord {
    /// Content hash, 64 hexadecimal digits.
    #[schemars(with = "String")]
    pub hash: MeshHash,
    /// Indices in the mesh's `primitives`.
    pub primitives: Vec<u64>,
    /// Triangles of the source.
    pub triangles: u64,
    /// Vertices of the source.
    pub vertices: u64,
    /// Its part of each level of the mesh; empty if it is left alone.
    pub levels: Vec<PieceLevel>,
}

/// A sub-mesh at one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PieceLevel {
    /// Triangles left.
    pub triangles: u64,
    /// Largest distance between the surfaces of source and level, in units of the mesh's own space.
    pub error: f64,
}

/// One level of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LevelRecord {
    /// Number of the target, from 1. A target that would repeat the level before it has no level.
    pub number: u64,
    /// What was asked for.
    pub target: LevelTarget,
    /// Triangles of all pieces.
    pub triangles: u64,
    /// Vertices that the level uses, its own or the source's.
    pub vertices: u64,
    /// Bytes that the level adds to the output's buffers.
    pub bytes: u64,
    /// Largest distance between the surfaces of source and level, in units of the mesh's own space.
    pub error: f64,
    /// `error` as a fraction of the mesh's `radius`.
    pub error_of_radius: f64,
    /// Share of the viewport's height, covered by the bounding sphere, below which the level may be shown; 0 to 1.
    pub coverage: f64,
    /// Distance from which the level may be shown, in units of the mesh's own space.
    pub distance: f64,
    /// Why it is not coarser.
    pub stop: Stop,
    /// The recipe that made it, where several were tried.
    #[serde(default)]
    pub recipe: Option<String>,
    /// Image difference from the source: root mean square of luminance differences (0 to 255) over 24 views of the mesh
    /// alone. Absent where looks are not recorded.
    #[serde(default)]
    pub d_rms: Option<f64>,
    /// The same of the view that differs most.
    #[serde(default)]
    pub worst_view: Option<f64>,
    /// Share of the pixels covered by level or source that only one of them covers, 0 to 1.
    #[serde(default)]
    pub silhouette: Option<f64>,
    /// Sampled distances between source and level, in units of the mesh's own space.
    #[serde(default)]
    pub surface: Option<SurfaceDistance>,
}

/// What a mesh gets of a level that all meshes of its scene share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ShareRecord {
    /// Number of the target, from 1.
    pub level: u64,
    /// Triangles that it keeps, in one instance. Where these are all that it has, or as many as at the level before, it has no
    /// level for this target.
    pub triangles: u64,
}

/// Why a level has the triangles it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// The number of triangles asked for.
    Target,
    /// The error limit asked for.
    ErrorLimit,
    /// The image difference asked for.
    LookLimit,
    /// No edge was left that may be contracted.
    NoLegalPair,
}

impl From<crate::lod::Stop> for Stop {
    fn from(stop: crate::lod::Stop) -> Self {
        match stop {
            crate::lod::Stop::Target => Self::Target,
            crate::lod::Stop::ErrorLimit => Self::ErrorLimit,
            crate::lod::Stop::LookLimit => Self::LookLimit,
            crate::lod::Stop::NoLegalPair => Self::NoLegalPair,
        }
    }
}

impl MeshRecord {
    /// Does the output have it as an instance of another mesh?
    pub fn is_recovered(&self) -> bool {
        self.instance_of.as_ref().is_some_and(|instance| instance.kept.is_none())
    }

    /// What is shown for a target (from 1): its level, or the level before if it has none; `None` is the source.
    pub fn level_for(&self, number: u64) -> Option<&LevelRecord> {
        self.levels.iter().take_while(|level| level.number <= number).last()
    }
}

/// One distinct sub-mesh of all scenes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DistinctMesh {
    /// Content hash, 64 hexadecimal digits.
    #[schemars(with = "String")]
    pub hash: MeshHash,
    /// Triangles.
    pub triangles: u64,
    /// Vertices.
    pub vertices: u64,
    /// Times it is declared, in all files.
    pub uses: u64,
    /// Nodes that show it, in all files.
    pub instances: u64,
    /// Files that declare it.
    pub scenes: u64,
}

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The scene was not baked.
    Error,
    /// The scene was baked all the same.
    Warning,
}

/// Something that went wrong or is odd.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Problem {
    /// Scene file, relative to its input folder; none if it is not one scene's.
    pub scene: Option<String>,
    /// How bad it is.
    pub severity: Severity,
    /// Place in the file, e.g. `meshes[2].primitives[0]`; empty for the whole file.
    pub place: String,
    /// What is wrong.
    pub cause: String,
    /// What to do about it.
    pub hint: Option<String>,
}

#[cfg(test)]
mod tests;
