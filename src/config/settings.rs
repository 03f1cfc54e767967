//! Settings of one scene, resolved: no key is absent any more. Three records, by what they change.
//!
//! Knows nothing of the file they come from. `key.rs` says which of them enter which key.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::choice::{
    Effort, ErrorUnit, Format, Instancing, Layout, Metric, NodeNames, Placement, Profile, Recover, Storage,
};
use super::defaults;

/// Everything that decides what becomes of one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneSettings {
    /// The scene is left out.
    pub skip: bool,
    /// Sub-meshes with fewer triangles are left alone.
    pub min_triangles: usize,
    /// What decides the contraction sequence of a sub-mesh.
    pub simplify: SimplifySettings,
    /// What decides the levels cut from that sequence.
    pub chain: ChainSettings,
    /// What decides how levels are written into a scene.
    pub emit: EmitSettings,
    /// How looks are measured.
    pub appearance: AppearanceSettings,
    /// Which repeated meshes become instances, and how these are written. Absent in records of earlier versions.
    #[serde(default)]
    pub instances: InstanceSettings,
    /// From where a scene is seen whose meshes share budgets. Absent in records of earlier versions.
    #[serde(default)]
    pub scene: ViewSettings,
}

/// From where a scene is seen. Nothing given: from anywhere, near every mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ViewSettings {
    /// Places in the scene's space.
    pub cameras: Vec<[f64; 3]>,
    /// Distances from the middle of the scene, in its units; each stands for places all round at that distance; more than 0.
    pub distances: Vec<f64>,
}

/// Which repeated meshes become instances, and how instances are written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct InstanceSettings {
    /// How far such meshes may be from the first.
    pub recover: Recover,
    /// What may be left between a mesh and the one rebuilt from the first: of positions as a fraction of the radius, of
    /// normals and tangents between unit vectors; more than 0.
    pub tolerance: f64,
    /// Connected parts of meshes that occur more than once become instances, too; never set without `recover`.
    pub split: bool,
    /// How instances are written.
    pub instancing: Instancing,
    /// Radius of a batch at most, in radii of its largest instance; more than 0.
    pub cell: f64,
    /// What the names of nodes are worth.
    pub names: NodeNames,
    /// Readers that do not know batches must refuse the file.
    pub required: bool,
}

impl Default for InstanceSettings {
    fn default() -> Self {
        Self {
            recover: Recover::None,
            tolerance: defaults::TOLERANCE,
            split: false,
            instancing: Instancing::Nodes,
            cell: defaults::CELL,
            names: NodeNames::Keep,
            required: true,
        }
    }
}

/// How looks are measured at bake time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AppearanceSettings {
    /// The looks of every level are measured and recorded.
    pub record: bool,
    /// Pixels on each side of the pictures.
    pub size: u32,
}

impl Default for AppearanceSettings {
    fn default() -> Self {
        Self { record: true, size: defaults::LOOK_SIZE }
    }
}

/// What decides the contraction sequence of a sub-mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimplifySettings {
    /// What the contraction of an edge costs.
    pub metric: Metric,
    /// How much work is spent.
    pub effort: Effort,
    /// Weights beside the geometric error, which has weight 1.
    pub weights: Weights,
    /// Where a vertex goes. Already `subset` where the storage is `shared`.
    pub placement: Placement,
    /// Vertices of open borders stay where they are.
    pub lock_border: bool,
    /// Recipes that metric `auto` tries, 1 or more.
    pub candidates: u32,
}

impl Default for SimplifySettings {
    fn default() -> Self {
        Self {
            metric: Metric::default(),
            effort: Effort::default(),
            weights: Weights::default(),
            placement: Placement::default(),
            lock_border: false,
            candidates: defaults::CANDIDATES,
        }
    }
}

/// Weights of the parts of the error, each 0 or more; 0 leaves the part out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Weights {
    /// Normals.
    pub normal: f64,
    /// Texture coordinates, each set.
    pub texcoord: f64,
    /// Vertex colours, each set.
    pub color: f64,
    /// Open borders.
    pub border: f64,
    /// Material and texture seams.
    pub seam: f64,
    /// Edges where normals part.
    pub crease: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            normal: defaults::NORMAL,
            texcoord: defaults::TEXCOORD,
            color: defaults::COLOR,
            border: defaults::BORDER,
            seam: defaults::SEAM,
            crease: defaults::CREASE,
        }
    }
}

/// What decides the levels of a mesh, given the contraction sequences of its sub-meshes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChainSettings {
    /// Finest first; never empty.
    pub levels: Vec<LevelTarget>,
    /// Where the vertices of the levels are kept.
    pub storage: Storage,
    /// Triangles and vertices are ordered for the GPU's caches.
    pub vertex_cache: bool,
}

/// How coarse one level is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LevelTarget {
    /// Share of the mesh's triangles, between 0 and 1, exclusive.
    Ratio(f64),
    /// Number of triangles of the mesh, 1 or more.
    Triangles(u32),
    /// Largest distance between the surfaces.
    Error {
        /// More than 0.
        limit: f64,
        /// What `limit` is measured in.
        unit: ErrorUnit,
    },
    /// Largest distance between the surfaces as it is seen on a screen.
    Pixels {
        /// The distance on the screen, in pixels; more than 0.
        limit: f64,
        /// Height of the mesh's bounding sphere on that screen, in pixels; more than 0.
        size: f64,
    },
    /// Image difference from the source, d_RMS: root mean square of luminance (0…255) over 24 views.
    Appearance(f64),
    /// Share of the triangles that all nodes of the scene draw, between 0 and 1, exclusive.
    #[serde(rename = "scene_ratio")]
    SceneRatio(f64),
    /// Triangles that all nodes of the scene draw, 1 or more.
    #[serde(rename = "scene_triangles")]
    SceneTriangles(u64),
    /// Bytes of vertices and indices of a scene's distinct meshes, 1 or more.
    #[serde(rename = "scene_bytes")]
    SceneBytes(u64),
}

impl LevelTarget {
    /// Whether pictures have to be drawn to find the level.
    pub fn is_looked_at(&self) -> bool {
        matches!(self, Self::Appearance(_))
    }

    /// Whether it is a budget that all meshes of a scene share.
    pub fn is_of_scene(&self) -> bool {
        matches!(self, Self::SceneRatio(_) | Self::SceneTriangles(_) | Self::SceneBytes(_))
    }
}

impl Metric {
    /// Whether the weights of normals, texture coordinates and colours count.
    pub fn sees_attributes(self) -> bool {
        matches!(self, Self::Its | Self::Auto | Self::QemAttributes | Self::Gaps | Self::ItsPaper)
    }

    /// Whether it can put a vertex anywhere but onto one of the ends.
    pub fn moves_vertices(self) -> bool {
        !matches!(self, Self::ItsPaper | Self::Tmpm)
    }
}

impl SimplifySettings {
    /// Whether rounds of re-weighting by pictures follow: the other metrics have nothing to weight.
    pub fn has_rounds(&self) -> bool {
        self.effort == Effort::Best && matches!(self.metric, Metric::Its | Metric::Auto)
    }

    /// Whether several recipes are tried.
    pub fn has_choice(&self) -> bool {
        self.metric == Metric::Auto || self.has_rounds()
    }
}

impl SceneSettings {
    /// Whether any level is a budget that all meshes of a scene share.
    pub fn shares_a_budget(&self) -> bool {
        self.chain.levels.iter().any(LevelTarget::is_of_scene)
    }

    /// Whether looks decide any byte of the outputs.
    pub fn looks_decide(&self) -> bool {
        self.simplify.has_choice() || self.chain.levels.iter().any(LevelTarget::is_looked_at)
    }
}

/// What decides how levels are written into a scene, given their bytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EmitSettings {
    /// File format of the output.
    pub format: Format,
    /// Where the geometry of meshes with levels is kept. Absent in records of earlier versions.
    #[serde(default)]
    pub layout: Layout,
    /// The reader that the output is written for.
    pub profile: Profile,
    /// Where a level's error must not be seen.
    pub screen: Screen,
    /// One for each level, strictly descending, more than 0, at most 1: the share of the viewport's height below which
    /// the level is shown. `None`: computed from the level's error and `screen`.
    pub coverage: Option<Vec<f64>>,
}

/// A level may be shown once its error covers at most `pixels` of a screen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Screen {
    /// Allowed error, in pixels; more than 0.
    pub pixels: f64,
    /// Height of the screen, in pixels; 1 or more.
    pub height: f64,
    /// Vertical field of view, in degrees; between 0 and 180, exclusive.
    pub fov: f64,
}

impl Default for Screen {
    fn default() -> Self {
        Self { pixels: defaults::PIXELS, height: defaults::SCREEN_HEIGHT, fov: defaults::FIELD_OF_VIEW }
    }
}
