//! `[[budget]]`: limits on what scenes may cost and how their levels may look. As written, and resolved.
//!
//! Knows which facts there are and what a limit on them means; `budget` knows how large they are.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Globs;
use super::check::Document;
use super::error::{ConfigError, Place};
use super::file::OneOrMany;

/// Limits for the scenes that match. Where several entries limit the same fact of the same scene and level, the last
/// one counts. Each limit is a number (an error beyond it), or a table with `warn`, `error` and limits on growth.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct BudgetEntry {
    /// Glob, or list of globs, on the scene's path relative to the input folder. Default: all scenes.
    #[serde(rename = "match")]
    matching: Option<OneOrMany>,

    /// The levels that limits on meshes and on triangles of scenes hold for; 0 is the source. Default: all levels, and the
    /// source.
    #[schemars(inner(range(max = 32)), length(min = 1))]
    level: Option<Vec<u32>>,

    /// Triangles of a mesh, at each level.
    triangles: Option<LimitEntry>,

    /// Vertices of a mesh, at each level.
    vertices: Option<LimitEntry>,

    /// Image difference of a level from its source: d_RMS, luminance 0 to 255 over 24 views.
    d_rms: Option<LimitEntry>,

    /// Largest sampled distance between the surfaces of level and source, as a fraction of the mesh's radius.
    surface: Option<LimitEntry>,

    /// Levels of a mesh, without its source, at most.
    levels: Option<LimitEntry>,

    /// Levels of a mesh, without its source, at least. Meshes below `min_triangles` need none.
    min_levels: Option<LimitEntry>,

    /// Triangles of a scene with every instance.
    scene_triangles: Option<LimitEntry>,

    /// Triangles of a scene, each mesh once.
    distinct_triangles: Option<LimitEntry>,

    /// Vertices of a scene, each mesh once.
    scene_vertices: Option<LimitEntry>,

    /// Draw calls of a scene: primitives of each node's mesh.
    draw_calls: Option<LimitEntry>,

    /// Materials that the meshes of a scene use.
    materials: Option<LimitEntry>,

    /// Longest side of the largest texture of a scene, in texels.
    texture_size: Option<LimitEntry>,

    /// Bytes of all that is written for a scene: file, buffers and images beside it.
    file_bytes: Option<LimitEntry>,

    /// Bytes of a written scene and its buffers without images.
    geometry_bytes: Option<LimitEntry>,

    /// Bytes of all images of a scene, as they are stored.
    texture_bytes: Option<LimitEntry>,

    /// Meshes of a scene that repeat the geometry of an earlier one, instead of being instances of it.
    undeclared: Option<LimitEntry>,
}

/// A limit: a number, or a table.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
enum LimitEntry {
    /// Beyond it is an error.
    Error(#[schemars(range(min = 0))] f64),
    /// More than one limit.
    Table(LimitTable),
}

/// Limits on one fact.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LimitTable {
    /// Beyond it is a warning.
    #[schemars(range(min = 0))]
    warn: Option<f64>,

    /// Beyond it is an error: exit code 1.
    #[schemars(range(min = 0))]
    error: Option<f64>,

    /// Growth against the baseline, in percent.
    grow_percent: Option<GrowthEntry>,

    /// Growth against the baseline, in the fact's own unit.
    grow_by: Option<GrowthEntry>,
}

/// A limit on growth: a number, or a table.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
enum GrowthEntry {
    /// Beyond it is an error.
    Error(#[schemars(range(min = 0))] f64),
    /// Both limits.
    Table(GrowthTable),
}

/// Limits on growth.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GrowthTable {
    /// Beyond it is a warning.
    #[schemars(range(min = 0))]
    warn: Option<f64>,

    /// Beyond it is an error: exit code 1.
    #[schemars(range(min = 0))]
    error: Option<f64>,
}

/// What a limit is about. The order is that of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fact {
    /// Triangles of a mesh at a level.
    Triangles,
    /// Vertices of a mesh at a level.
    Vertices,
    /// Image difference of a level from its source.
    DRms,
    /// Largest sampled distance between level and source, of the mesh's radius.
    Surface,
    /// Levels of a mesh, at most.
    Levels,
    /// Levels of a mesh, at least.
    MinLevels,
    /// Triangles of a scene with every instance.
    SceneTriangles,
    /// Triangles of a scene, each mesh once.
    DistinctTriangles,
    /// Vertices of a scene, each mesh once.
    SceneVertices,
    /// Draw calls of a scene.
    DrawCalls,
    /// Materials of a scene.
    Materials,
    /// Longest side of the largest texture, in texels.
    TextureSize,
    /// Bytes of all that is written.
    FileBytes,
    /// Bytes of scene and buffers without images.
    GeometryBytes,
    /// Bytes of all images.
    TextureBytes,
    /// Meshes that repeat an earlier one.
    Undeclared,
}

impl Fact {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Triangles,
        Self::Vertices,
        Self::DRms,
        Self::Surface,
        Self::Levels,
        Self::MinLevels,
        Self::SceneTriangles,
        Self::DistinctTriangles,
        Self::SceneVertices,
        Self::DrawCalls,
        Self::Materials,
        Self::TextureSize,
        Self::FileBytes,
        Self::GeometryBytes,
        Self::TextureBytes,
        Self::Undeclared,
    ];

    /// Its key in `[[budget]]`.
    pub fn key(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Vertices => "vertices",
            Self::DRms => "d_rms",
            Self::Surface => "surface",
            Self::Levels => "levels",
            Self::MinLevels => "min_levels",
            Self::SceneTriangles => "scene_triangles",
            Self::DistinctTriangles => "distinct_triangles",
            Self::SceneVertices => "scene_vertices",
            Self::DrawCalls => "draw_calls",
            Self::Materials => "materials",
            Self::TextureSize => "texture_size",
            Self::FileBytes => "file_bytes",
            Self::GeometryBytes => "geometry_bytes",
            Self::TextureBytes => "texture_bytes",
            Self::Undeclared => "undeclared",
        }
    }

    /// What it is, for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Vertices => "vertices",
            Self::DRms => "image difference (d_RMS)",
            Self::Surface => "distance from the source",
            Self::Levels | Self::MinLevels => "levels",
            Self::SceneTriangles => "triangles of the scene, with every instance",
            Self::DistinctTriangles => "triangles of the scene, each mesh once",
            Self::SceneVertices => "vertices of the scene",
            Self::DrawCalls => "draw calls",
            Self::Materials => "materials",
            Self::TextureSize => "texels along the largest texture",
            Self::FileBytes => "bytes of the files",
            Self::GeometryBytes => "bytes of geometry",
            Self::TextureBytes => "bytes of textures",
            Self::Undeclared => "repeated meshes",
        }
    }

    /// Whether fewer are worse.
    pub fn is_least(self) -> bool {
        self == Self::MinLevels
    }
}

/// Where a warning and where an error begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Beyond it is a warning.
    pub warn: Option<f64>,
    /// Beyond it is an error.
    pub error: Option<f64>,
}

impl Bounds {
    fn error(error: f64) -> Self {
        Self { warn: None, error: Some(error) }
    }

    /// Whether there is any.
    pub fn is_some(&self) -> bool {
        self.warn.is_some() || self.error.is_some()
    }
}

/// All limits on one fact.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What it is about.
    pub fact: Fact,
    /// The fact itself.
    pub at: Bounds,
    /// Growth against the baseline in percent.
    pub grow_percent: Bounds,
    /// Growth against the baseline in the fact's unit.
    pub grow_by: Bounds,
    /// Where it stands in `pipeline.toml`, from 1.
    pub line: usize,
}

/// One `[[budget]]`.
#[derive(Clone, Debug)]
pub struct Budget {
    globs: Option<Globs>,
    levels: Option<Vec<u32>>,
    limits: Vec<Limit>,
}

impl Budget {
    /// Whether it holds for a scene, by its path below the input folder.
    pub fn matches(&self, relative: &str) -> bool {
        self.globs.as_ref().is_none_or(|globs| globs.matches(relative))
    }

    /// Its limit on a fact, at a level of a mesh (0 is the source) or `None` for facts without level. Where no levels are
    /// named, scenes are held against it as their source, the most that they can cost.
    pub fn limit(&self, fact: Fact, level: Option<u64>) -> Option<&Limit> {
        let limit = self.limits.iter().find(|limit| limit.fact == fact)?;
        let holds = match (&self.levels, level) {
            (_, None) => true,
            (Some(levels), Some(level)) => levels.iter().any(|&l| u64::from(l) == level),
            (None, Some(level)) => level == 0 || !matches!(fact, Fact::SceneTriangles | Fact::DistinctTriangles),
        };
        holds.then_some(limit)
    }

    /// All of its limits.
    pub fn limits(&self) -> &[Limit] {
        &self.limits
    }
}

/// From the file.
pub(super) fn resolve(document: &Document<'_>, place: &Place, entry: BudgetEntry) -> Result<Budget, ConfigError> {
    let globs = entry.matching.clone().map(|m| super::resolve::globs(document, &place.key("match"), m.into_vec()));
    let given = |fact| match fact {
        Fact::Triangles => &entry.triangles,
        Fact::Vertices => &entry.vertices,
        Fact::DRms => &entry.d_rms,
        Fact::Surface => &entry.surface,
        Fact::Levels => &entry.levels,
        Fact::MinLevels => &entry.min_levels,
        Fact::SceneTriangles => &entry.scene_triangles,
        Fact::DistinctTriangles => &entry.distinct_triangles,
        Fact::SceneVertices => &entry.scene_vertices,
        Fact::DrawCalls => &entry.draw_calls,
        Fact::Materials => &entry.materials,
        Fact::TextureSize => &entry.texture_size,
        Fact::FileBytes => &entry.file_bytes,
        Fact::GeometryBytes => &entry.geometry_bytes,
        Fact::TextureBytes => &entry.texture_bytes,
        Fact::Undeclared => &entry.undeclared,
    };
    let mut limits = Vec::new();
    for fact in Fact::ALL {
        if let Some(entry) = given(fact) {
            limits.push(limit(document, &place.key(fact.key()), fact, entry)?);
        }
    }
    if limits.is_empty() {
        let keys: Vec<String> = Fact::ALL.iter().map(|fact| format!("`{}`", fact.key())).collect();
        return Err(document.invalid(place, format!("limits nothing: it needs one or more of {}", keys.join(", "))));
    }
    Ok(Budget { globs: globs.transpose()?, levels: entry.level, limits })
}

fn limit(document: &Document<'_>, place: &Place, fact: Fact, entry: &LimitEntry) -> Result<Limit, ConfigError> {
    let table = match entry {
        LimitEntry::Error(error) => LimitTable { warn: None, error: Some(*error), grow_percent: None, grow_by: None },
        LimitEntry::Table(table) => table.clone(),
    };
    let growth = |entry: Option<GrowthEntry>| match entry {
        None => Bounds::default(),
        Some(GrowthEntry::Error(error)) => Bounds::error(error),
        Some(GrowthEntry::Table(GrowthTable { warn, error })) => Bounds { warn, error },
    };
    let at = Bounds { warn: table.warn, error: table.error };
    let (grow_percent, grow_by) = (growth(table.grow_percent), growth(table.grow_by));
    if !at.is_some() && !grow_percent.is_some() && !grow_by.is_some() {
        return Err(document.invalid(place, "has no limit: give `warn`, `error`, `grow_percent` or `grow_by`"));
    }
    if fact.is_least() && (grow_percent.is_some() || grow_by.is_some()) {
        return Err(document.invalid(place, "is a least number and cannot have a limit on growth"));
    }
    let parts = [(place.clone(), at), (place.key("grow_percent"), grow_percent), (place.key("grow_by"), grow_by)];
    for (place, bounds) in parts {
        if let (Some(warn), Some(error)) = (bounds.warn, bounds.error)
            && (if fact.is_least() { warn < error } else { error < warn })
        {
            let words = format!("has warn {warn} beyond error {error}: the warning would never come");
            return Err(document.invalid(&place, words));
        }
    }
    Ok(Limit { fact, at, grow_percent, grow_by, line: document.line_of(place) })
}
