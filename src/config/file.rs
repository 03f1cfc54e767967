//! `pipeline.toml` as it is written: the keys, their documentation, ranges and defaults. The JSON schema for editors is
//! made from these types, and `check.rs` finds unknown keys and values out of range by that same schema.
//!
//! Knows nothing of paths, globs or how settings combine.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

use super::budget::BudgetEntry;
use super::choice::{
    Effort, ErrorUnit, Format, Instancing, Layout, Metric, NodeNames, Placement, Profile, Recover, Storage,
};
use super::defaults;

/// A string or a list of strings.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum OneOrMany {
    /// One.
    One(#[schemars(length(min = 1))] String),
    /// Several.
    Many(#[schemars(inner(length(min = 1)))] Vec<String>),
}

impl OneOrMany {
    pub(crate) fn into_vec(self) -> Vec<String> {
        match self {
            Self::One(one) => vec![one],
            Self::Many(many) => many,
        }
    }
}

/// A lodbake pipeline: which scenes are baked, how, and where to. Paths are relative to this file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "lodbake pipeline")]
pub(super) struct PipelineFile {
    /// Folder with the scenes, or a list of folders. Required. Several folders are laid over each other in `output`.
    pub input: OneOrMany,

    /// Folder for the baked scenes, which mirrors the input. Required. It is never scanned for scenes.
    #[schemars(length(min = 1))]
    pub output: String,

    /// Globs of the files that are scenes, on the path relative to the input folder with `/` as separator: `*` stays
    /// within a folder, `**` crosses folders, upper and lower case are the same. Default: all glTF and OBJ files.
    #[schemars(extend("default" = defaults::INCLUDE))]
    pub include: Option<OneOrMany>,

    /// Globs of files and folders to leave out, as `include`. Default: none.
    #[schemars(extend("default" = []))]
    pub exclude: Option<OneOrMany>,

    /// Leave out what `.gitignore` and `.ignore` files name. Default: false.
    #[schemars(extend("default" = false))]
    pub ignore_files: Option<bool>,

    /// Follow symbolic links. Loops are reported and survived. Default: true.
    #[schemars(extend("default" = true))]
    pub follow_links: Option<bool>,

    /// Folder of the cache; safe to delete at any time. The environment variable `LODBAKE_CACHE` overrides it.
    /// Default: `.lodbake` beside this file.
    #[schemars(length(min = 1), extend("default" = defaults::CACHE))]
    pub cache: Option<String>,

    /// Number of meshes simplified at the same time; 0 means one for each core. Default: 0.
    #[schemars(range(max = 4096), extend("default" = 0))]
    pub jobs: Option<u32>,

    /// File format of the outputs. Default: source.
    #[schemars(extend("default" = Format::default()))]
    pub format: Option<Format>,

    /// Where the vertices of the levels are kept. Default: smallest.
    #[schemars(extend("default" = Storage::default()))]
    pub storage: Option<Storage>,

    /// Whether scenes share the files that hold the geometry of meshes with levels. Default: self-contained.
    #[schemars(extend("default" = Layout::default()))]
    pub layout: Option<Layout>,

    /// The reader that the outputs are written for. Default: web.
    #[schemars(extend("default" = Profile::default()))]
    pub profile: Option<Profile>,

    /// Order the triangles and vertices of the levels for the GPU's caches. Default: true.
    #[schemars(extend("default" = true))]
    pub vertex_cache: Option<bool>,

    /// When a level is good enough to be shown.
    pub screen: Option<ScreenTable>,

    /// How meshes are simplified.
    pub simplify: Option<SimplifyTable>,

    /// How looks are measured.
    pub appearance: Option<AppearanceTable>,

    /// Which repeated meshes become instances, and how these are written.
    pub instances: Option<InstancesTable>,

    /// From where scenes are seen, for levels by `scene_ratio`, `scene_triangles` and `scene_bytes`.
    pub scene: Option<SceneTable>,

    /// The levels, finest first. Default: ratios 0.5, 0.25 and 0.1.
    #[schemars(length(min = 1, max = 32))]
    pub lod: Option<Vec<LodEntry>>,

    /// Other settings for some of the scenes; later entries win, key by key.
    #[serde(rename = "override")]
    pub overrides: Option<Vec<OverrideEntry>>,

    /// Limits that `lodbake check` holds scenes against; of several for the same fact, the last one counts.
    pub budget: Option<Vec<BudgetEntry>>,

    /// A report that growth is measured against, as a rule kept under version control. Default: none.
    #[schemars(length(min = 1))]
    pub baseline: Option<String>,
}

/// When a level is good enough to be shown: its error, seen on this screen, covers at most `pixels`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ScreenTable {
    /// Allowed error on the screen, in pixels; more than 0. Default: 1.
    #[schemars(extend("exclusiveMinimum" = 0, "default" = defaults::PIXELS))]
    pub pixels: Option<f64>,

    /// Height of the screen, in pixels; 1 or more. Default: 1080.
    #[schemars(range(min = 1), extend("default" = defaults::SCREEN_HEIGHT))]
    pub height: Option<f64>,

    /// Vertical field of view, in degrees; between 0 and 180. Default: 60.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180, "default" = defaults::FIELD_OF_VIEW))]
    pub fov: Option<f64>,
}

/// How meshes are simplified. Weights are relative to the geometric error, which has weight 1; 0 leaves a part out.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SimplifyTable {
    /// What the contraction of an edge costs. Default: its.
    #[schemars(extend("default" = Metric::default()))]
    pub metric: Option<Metric>,

    /// Number of recipes that metric `auto` and effort `best` try for each mesh: more take longer and look better. Default: 3.
    #[schemars(range(min = 1, max = 8), extend("default" = defaults::CANDIDATES))]
    pub candidates: Option<u32>,

    /// How much work is spent on each mesh. Default: balanced.
    #[schemars(extend("default" = Effort::default()))]
    pub effort: Option<Effort>,

    /// Weight of normals; 0 or more. Default: 0.003.
    #[schemars(range(min = 0), extend("default" = defaults::NORMAL))]
    pub normal: Option<f64>,

    /// Weight of texture coordinates, all sets; 0 or more. Default: 0.3.
    #[schemars(range(min = 0), extend("default" = defaults::TEXCOORD))]
    pub texcoord: Option<f64>,

    /// Weight of vertex colours, all sets; 0 or more. Default: 0.1.
    #[schemars(range(min = 0), extend("default" = defaults::COLOR))]
    pub color: Option<f64>,

    /// Weight of open borders; 0 or more. Default: 1.
    #[schemars(range(min = 0), extend("default" = defaults::BORDER))]
    pub border: Option<f64>,

    /// Weight of material and texture seams; 0 or more. Default: 0.3.
    #[schemars(range(min = 0), extend("default" = defaults::SEAM))]
    pub seam: Option<f64>,

    /// Weight of creases, edges where normals part; 0 or more. Default: 0.04.
    #[schemars(range(min = 0), extend("default" = defaults::CREASE))]
    pub crease: Option<f64>,

    /// Where a vertex goes when an edge is contracted. Default: auto.
    #[schemars(extend("default" = Placement::default()))]
    pub placement: Option<Placement>,

    /// Sub-meshes with fewer triangles are left alone. Default: 64.
    #[schemars(extend("default" = defaults::MIN_TRIANGLES))]
    pub min_triangles: Option<u32>,

    /// Keep every vertex of an open border where it is, for pieces that must fit to others. Default: false.
    #[schemars(extend("default" = false))]
    pub lock_border: Option<bool>,
}

/// How looks are measured when scenes are baked: 24 views of each mesh and level, compared with the source.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AppearanceTable {
    /// Measure the looks of every level and record them in the report. Default: true.
    #[schemars(extend("default" = true))]
    pub record: Option<bool>,

    /// Pixels on each side of the pictures. Default: 64; 128 where looks decide levels (`metric = "auto"`,
    /// `effort = "best"`, levels by `appearance`).
    #[schemars(range(min = 32, max = 2048), extend("default" = defaults::LOOK_SIZE))]
    pub size: Option<u32>,
}

/// Instances. Those that nobody declared: meshes of a scene that are another one of it, reordered, moved, scaled or mirrored; their
/// nodes then show the first one, and their bytes go: level 0 is the source's within the tolerance. And how instances are written.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct InstancesTable {
    /// Which of them become instances; the rest is told in the report. Default: none, and none is looked for.
    #[schemars(extend("default" = Recover::default()))]
    pub recover: Option<Recover>,

    /// Largest distance that may be left to the mesh as it was: of positions as a fraction of its radius, of the tips of normals
    /// and tangents; more than 0, at most 0.01. Default: 0.00001.
    #[schemars(range(max = 0.01), extend("exclusiveMinimum" = 0, "default" = defaults::TOLERANCE))]
    pub tolerance: Option<f64>,

    /// Connected parts that occur more than once in meshes become instances, too: a bolt that was merged into a machine 200 times.
    /// Only where `recover` is at least "rigid", and where the bytes that go are more than those of the nodes that come.
    /// Default: false.
    #[schemars(extend("default" = false))]
    pub split: Option<bool>,

    /// How nodes that show the same mesh are written. Default: nodes.
    #[schemars(extend("default" = Instancing::default()))]
    pub instancing: Option<Instancing>,

    /// Radius of a batch at most, in radii of its largest instance; more than 0. Larger ones take fewer draw calls and show more
    /// triangles, since a batch switches levels as one. Default: 32.
    #[schemars(extend("exclusiveMinimum" = 0, "default" = defaults::CELL))]
    pub cell: Option<f64>,

    /// Whether nodes with names may become part of a batch, which loses their names. Default: keep.
    #[schemars(extend("default" = NodeNames::default()))]
    pub names: Option<NodeNames>,

    /// Batches are a required extension: readers that do not know it refuse the file, instead of showing one instance of each
    /// batch. Default: true.
    #[schemars(extend("default" = true))]
    pub required: Option<bool>,
}

/// From where scenes are seen, where their meshes share budgets: an error counts as large as it appears from there. Without any
/// place, errors count as large as they are in the scene.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    /// Places of cameras, `[x, y, z]` in the scene's space. Default: none.
    #[schemars(length(max = 1000), extend("default" = []))]
    pub cameras: Option<Vec<[f64; 3]>>,

    /// Distances of cameras from the middle of the scene, in its units; each stands for cameras all round; more than 0. Default:
    /// none.
    #[schemars(length(max = 32), extend("default" = [], "items" = { "type": "number", "exclusiveMinimum": 0 }))]
    pub distances: Option<Vec<f64>>,
}

/// One level: exactly one of `ratio`, `triangles`, `error`, `pixels`, `appearance`, `scene_ratio`, `scene_triangles` and
/// `scene_bytes` says how coarse it is.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["ratio"] }, { "required": ["triangles"] }, { "required": ["error"] }, { "required": ["pixels"] }, { "required": ["appearance"] }, { "required": ["scene_ratio"] }, { "required": ["scene_triangles"] }, { "required": ["scene_bytes"] }]))]
pub(super) struct LodEntry {
    /// Share of each mesh's triangles that is left; between 0 and 1, exclusive.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub ratio: Option<f64>,

    /// Number of triangles that is left of each mesh; 1 or more.
    #[schemars(range(min = 1))]
    pub triangles: Option<u32>,

    /// Largest distance between the surfaces of level and source; more than 0, in `unit`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub error: Option<f64>,

    /// Unit of `error`. Default: radius, a fraction of the bounding radius.
    #[schemars(extend("default" = ErrorUnit::default()))]
    pub unit: Option<ErrorUnit>,

    /// Largest distance between the surfaces as seen on a screen, in pixels, where the mesh is `size` pixels high; more
    /// than 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub pixels: Option<f64>,

    /// Height of the mesh's bounding sphere on the screen that `pixels` means, in pixels; more than 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub size: Option<f64>,

    /// Largest image difference from the source (d_RMS, luminance 0 to 255 over 24 views); more than 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub appearance: Option<f64>,

    /// Share of the triangles that all nodes of a scene draw; its meshes share them so that the scene loses least; between 0
    /// and 1, exclusive.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub scene_ratio: Option<f64>,

    /// Number of triangles that all nodes of a scene draw, shared as with `scene_ratio`; 1 or more.
    #[schemars(range(min = 1))]
    pub scene_triangles: Option<u64>,

    /// Bytes of vertices and indices of all distinct meshes of a scene, each counted once, shared as with `scene_ratio`; 1 or
    /// more. Estimated from counts: bytes of a vertex as the source keeps it, three indices a triangle, no compression.
    #[schemars(range(min = 1))]
    pub scene_bytes: Option<u64>,

    /// Share of the viewport's height taken by the bounding sphere below which this level is shown; more than 0, at
    /// most 1. Give it for all levels or for none. Default: computed from the level's error and `[screen]`.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0))]
    pub coverage: Option<f64>,
}

/// Other settings for the scenes that match.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct OverrideEntry {
    /// Glob, or list of globs, on the scene's path relative to the input folder, as in `include`. Required.
    #[serde(rename = "match")]
    pub matching: OneOrMany,

    /// Leave these scenes out. Default: false.
    #[schemars(extend("default" = false))]
    pub skip: Option<bool>,

    /// As the key of the same name above.
    pub format: Option<Format>,

    /// As the key of the same name above.
    pub storage: Option<Storage>,

    /// As the key of the same name above.
    pub layout: Option<Layout>,

    /// As the key of the same name above.
    pub profile: Option<Profile>,

    /// As the key of the same name above.
    pub vertex_cache: Option<bool>,

    /// As `[screen]`; keys that are not given keep their value.
    pub screen: Option<ScreenTable>,

    /// As `[simplify]`; keys that are not given keep their value.
    pub simplify: Option<SimplifyTable>,

    /// As `[appearance]`; keys that are not given keep their value.
    pub appearance: Option<AppearanceTable>,

    /// As `[instances]`; keys that are not given keep their value.
    pub instances: Option<InstancesTable>,

    /// As `[scene]`; keys that are not given keep their value.
    pub scene: Option<SceneTable>,

    /// As `[[lod]]`; replaces the whole list.
    #[schemars(length(min = 1, max = 32))]
    pub lod: Option<Vec<LodEntry>>,
}

/// The JSON schema of `pipeline.toml`, for editors and for the checks of this room.
pub fn schema() -> Value {
    schema_of::<PipelineFile>()
}

/// The JSON schema of a configuration file.
pub(crate) fn schema_of<T: JsonSchema>() -> Value {
    let mut schema = schemars::schema_for!(T).to_value();
    drop_null(&mut schema);
    schema
}

/// `Option` becomes "or null" in a schema, but TOML has no null: an absent key says it.
fn drop_null(schema: &mut Value) {
    if let Some(object) = schema.as_object_mut() {
        if let Some(Value::Array(types)) = object.get_mut("type") {
            types.retain(|t| t != "null");
            if let [only] = types.as_slice() {
                let only = only.clone();
                object.insert("type".to_owned(), only);
            }
        }
        if let Some(Value::Array(cases)) = object.get_mut("anyOf") {
            cases.retain(|case| case.get("type").is_none_or(|t| t != "null"));
            if let [only] = cases.as_slice() {
                let only = only.as_object().cloned().unwrap_or_default();
                object.shift_remove("anyOf");
                object.extend(only);
            }
        }
        object.values_mut().for_each(drop_null);
    } else if let Some(list) = schema.as_array_mut() {
        list.iter_mut().for_each(drop_null);
    }
}
