//! What each kind of result depends on. Every setting is named here once, or left out for a stated reason.

use serde::{Deserialize, Serialize};

use super::{ALGORITHM_VERSION, EMIT_VERSION, FORMAT_VERSION, Manifest, ManifestWriter, SHARE_VERSION};
use crate::config::{
    ChainSettings, EmitSettings, InstanceSettings, Instancing, Layout, LevelTarget, Metric, Recover, SceneSettings,
    Screen, SimplifySettings, ViewSettings, Weights,
};
use crate::mesh::Mesh;
use crate::mesh::hash::MeshHash;

/// Which kinds of attributes a mesh has: the weight of one that it does not have is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshParts {
    /// `NORMAL`
    pub normals: bool,
    /// Any `TEXCOORD_n`
    pub texcoords: bool,
    /// Any `COLOR_n`
    pub colors: bool,
}

impl MeshParts {
    /// Every kind, for keys that stand for many meshes.
    pub const ALL: Self = Self { normals: true, texcoords: true, colors: true };

    /// What any primitive of the mesh has.
    pub fn of(mesh: &Mesh) -> Self {
        let any = |prefix: &str| {
            mesh.primitives.iter().any(|primitive| primitive.attributes.iter().any(|a| a.name.starts_with(prefix)))
        };
        Self { normals: any("NORMAL"), texcoords: any("TEXCOORD_"), colors: any("COLOR_") }
    }
}

/// What the contraction sequence of a sub-mesh depends on.
#[derive(Clone, Copy, Debug)]
pub struct SequenceJob<'a> {
    /// The sub-mesh.
    pub mesh: MeshHash,
    /// What it has.
    pub parts: MeshParts,
    /// How it is simplified.
    pub simplify: &'a SimplifySettings,
}

impl Manifest for SequenceJob<'_> {
    fn write(&self, to: &mut dyn ManifestWriter) {
        to.integer("format_version", FORMAT_VERSION.into());
        to.integer("algorithm_version", ALGORITHM_VERSION.into());
        to.hash("mesh", &self.mesh.0);
        to.group("simplify", |to| write_simplify(self.simplify, self.parts, to));
    }
}

/// All settings that an output depends on; with the contents that it is made from, it decides every byte.
impl Manifest for SceneSettings {
    fn write(&self, to: &mut dyn ManifestWriter) {
        // `skip` decides whether there is an output at all.
        let Self { skip: _, min_triangles, simplify, chain, emit, appearance, instances, scene } = self;
        to.integer("format_version", FORMAT_VERSION.into());
        to.integer("algorithm_version", ALGORITHM_VERSION.into());
        to.integer("emit_version", EMIT_VERSION.into());
        to.group("simplify", |to| {
            to.integer("min_triangles", *min_triangles as u64);
            write_simplify(simplify, MeshParts::ALL, to);
        });
        write_chain(chain, to);
        write_emit(emit, to);
        // Decides facts of the report, and levels where looks do.
        to.flag("record_looks", appearance.record);
        if appearance.record || self.looks_decide() {
            to.integer("look_size", appearance.size.into());
        }
        write_instances(instances, to);
        if self.shares_a_budget() {
            to.integer("share_version", SHARE_VERSION.into());
            write_views(scene, to);
        }
    }
}

fn write_simplify(settings: &SimplifySettings, parts: MeshParts, to: &mut dyn ManifestWriter) {
    let SimplifySettings { metric, effort, weights, placement, lock_border, candidates } = settings;
    let Weights { normal, texcoord, color, border, seam, crease } = *weights;
    to.text("metric", metric.name());
    to.text("effort", effort.name());
    let sees_attributes = metric.sees_attributes();
    let attributes =
        [("normal", normal, parts.normals), ("texcoord", texcoord, parts.texcoords), ("color", color, parts.colors)];
    for (name, weight, _) in attributes.into_iter().filter(|(.., present)| sees_attributes && *present) {
        to.number(name, weight);
    }
    match metric {
        Metric::Its | Metric::Auto => {
            to.number("border", border);
            to.number("seam", seam);
            to.number("crease", crease);
        }
        Metric::QemAttributes => {
            to.number("border", border);
            to.number("seam", seam);
        }
        // One weight for both.
        Metric::Qem | Metric::Gaps | Metric::ItsPaper | Metric::Ias | Metric::Aps => to.number("border", border),
        // See lengths and textures alone.
        Metric::Naive | Metric::Tmpm => {}
    }
    if *metric == Metric::Auto {
        to.integer("candidates", (*candidates).into());
    }
    to.text("placement", placement.name());
    to.flag("lock_border", *lock_border);
}

/// The settings that decide how sequences are cut.
pub fn write_chain(settings: &ChainSettings, to: &mut dyn ManifestWriter) {
    let ChainSettings { levels, storage, vertex_cache } = settings;
    to.text("storage", storage.name());
    to.flag("vertex_cache", *vertex_cache);
    for (i, level) in levels.iter().enumerate() {
        to.group(&format!("lod[{i}]"), |to| match *level {
            LevelTarget::Ratio(ratio) => to.number("ratio", ratio),
            LevelTarget::Triangles(triangles) => to.integer("triangles", triangles.into()),
            LevelTarget::Error { limit, unit } => {
                to.number("error", limit);
                to.text("unit", unit.name());
            }
            LevelTarget::Pixels { limit, size } => {
                to.number("pixels", limit);
                to.number("size", size);
            }
            LevelTarget::Appearance(limit) => to.number("appearance", limit),
            LevelTarget::SceneRatio(ratio) => to.number("scene_ratio", ratio),
            LevelTarget::SceneTriangles(triangles) => to.integer("scene_triangles", triangles),
            LevelTarget::SceneBytes(bytes) => to.integer("scene_bytes", bytes),
        });
    }
}

fn write_views(settings: &ViewSettings, to: &mut dyn ManifestWriter) {
    let ViewSettings { cameras, distances } = settings;
    for (i, camera) in cameras.iter().enumerate() {
        to.group(&format!("scene.cameras[{i}]"), |to| {
            for (name, &value) in ["x", "y", "z"].iter().zip(camera) {
                to.number(name, value);
            }
        });
    }
    for (i, &distance) in distances.iter().enumerate() {
        to.number(&format!("scene.distances[{i}]"), distance);
    }
}

fn write_instances(settings: &InstanceSettings, to: &mut dyn ManifestWriter) {
    let InstanceSettings { recover, tolerance, split, instancing, cell, names, required } = *settings;
    if recover == Recover::None && instancing == Instancing::Nodes {
        return;
    }
    to.group("instances", |to| {
        if recover != Recover::None {
            to.text("recover", recover.name());
        }
        to.number("tolerance", tolerance);
        if split {
            to.flag("split", split);
        }
        if instancing == Instancing::Gpu {
            to.text("instancing", instancing.name());
            to.number("cell", cell);
            to.text("names", names.name());
            to.flag("required", required);
        }
    });
}

fn write_emit(settings: &EmitSettings, to: &mut dyn ManifestWriter) {
    let EmitSettings { format, layout, profile, screen, coverage } = settings;
    let Screen { pixels, height, fov } = *screen;
    to.text("format", format.name());
    if *layout != Layout::SelfContained {
        to.text("layout", layout.name());
    }
    to.text("profile", profile.name());
    to.group("screen", |to| {
        to.number("pixels", pixels);
        to.number("height", height);
        to.number("fov", fov);
    });
    for (i, coverage) in coverage.iter().flatten().enumerate() {
        to.group(&format!("lod[{i}]"), |to| to.number("coverage", *coverage));
    }
}
