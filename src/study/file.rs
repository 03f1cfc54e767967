//! `study.toml` as it is written: the keys, their documentation, ranges and defaults. Editors get their schema from
//! these types, and mistakes are found by that same schema.
//!
//! Knows nothing of files and what the settings do; `resolve` settles them.

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

use crate::config::Renderer;
use crate::config::file::{OneOrMany, SimplifyTable, schema_of};

/// Measurements of each algorithm on each mesh and target. 20 give the t-interval 19 degrees of freedom, as in the
/// evaluation that this tool follows.
pub const REPETITIONS: u32 = 20;

/// Width and height of each view, in pixels: those of the image metric.
pub const SIZE: u32 = 512;

/// Longest run of a command, in seconds.
pub const TIMEOUT: f64 = 600.0;

/// A lodbake study: meshes, algorithms and targets, each combination measured. Paths are relative to this file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "lodbake study")]
pub(super) struct StudyFile {
    /// Scene file or glob (`*` stays within a folder, `**` crosses folders), or a list of them. Required.
    pub meshes: OneOrMany,

    /// Folder for the tables, the page and the levels. Required.
    #[schemars(length(min = 1))]
    pub output: String,

    /// Targets: shares of the triangles that are left; between 0 and 1, exclusive.
    #[schemars(length(min = 1, max = 64), inner(range(min = 0, max = 1)))]
    pub ratios: Option<Vec<f64>>,

    /// Targets: numbers of triangles that are left; 1 or more.
    #[schemars(length(min = 1, max = 64), inner(range(min = 1)))]
    pub triangles: Option<Vec<u32>>,

    /// Image differences (`d_RMS`, 0 to 255) for which the triangles needed are told, interpolated between the targets
    /// that were measured. Default: none.
    #[schemars(length(min = 1, max = 64), inner(range(min = 0, max = 255)), extend("default" = []))]
    pub appearance: Option<Vec<f64>>,

    /// Timed runs of each algorithm on each mesh and target, after one that is not timed; 1 or more. Default: 20.
    #[schemars(range(min = 1, max = 10000), extend("default" = REPETITIONS))]
    pub repetitions: Option<u32>,

    /// Longest run of a command, in seconds; more than 0. Default: 600.
    #[schemars(extend("exclusiveMinimum" = 0, "default" = TIMEOUT))]
    pub timeout: Option<f64>,

    /// Width and height of each of the 24 views, in pixels. Fewer are faster to draw, and give other figures. Default: 512.
    #[schemars(range(min = 16, max = 4096), extend("default" = SIZE))]
    pub size: Option<u32>,

    /// What draws the views: `auto` (a graphics card where there is one), `gpu` or `cpu` (the reference). Default: `auto`.
    pub renderer: Option<Renderer>,

    /// Name of the algorithm that the others are compared with. Default: the first.
    #[schemars(length(min = 1))]
    pub baseline: Option<String>,

    /// The algorithms. Required.
    #[schemars(length(min = 1, max = 64))]
    pub algorithm: Vec<AlgorithmEntry>,
}

/// One algorithm: lodbake's own has `simplify`, a competitor has `command`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["simplify"] }, { "required": ["command"] }]))]
pub(super) struct AlgorithmEntry {
    /// How tables call it. Required.
    #[schemars(length(min = 1))]
    pub name: String,

    /// lodbake itself, with settings as in `[simplify]` of a pipeline; `{}` for the defaults.
    pub simplify: Option<SimplifyTable>,

    /// A program and its arguments, as one string with spaces between them or as a list; run without a shell in the
    /// folder of this file. `{in}` is the source, `{out}` the GLB to write, `{ratio}` and `{triangles}` what is asked for.
    pub command: Option<OneOrMany>,

    /// Name of another algorithm: this one is asked for the number of triangles that the other reached.
    #[schemars(length(min = 1))]
    pub matched: Option<String>,

    /// As the key of the same name above.
    #[schemars(range(min = 1, max = 10000))]
    pub repetitions: Option<u32>,

    /// As the key of the same name above.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub timeout: Option<f64>,
}

/// The JSON schema of `study.toml`.
pub fn schema() -> Value {
    schema_of::<StudyFile>()
}
