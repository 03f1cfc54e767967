//! The facts that can be limited, taken from a record, and how they are told.

use crate::config::Fact;
use crate::progress::quantity::{bytes, count, number};
use crate::report::{MeshRecord, SceneRecord, percent};

/// Facts of a scene, each with its level where it has one: those with a level are told for the source and `levels`
/// more. What the record does not tell is left out.
pub fn scene_facts(scene: &SceneRecord, levels: u64) -> Vec<(Fact, Option<u64>, f64)> {
    let drawn = |level: u64, weight: fn(&MeshRecord) -> u64| -> u64 {
        let at = |mesh: &MeshRecord| match level {
            0 => mesh.triangles,
            _ => mesh.level_for(level).map_or(mesh.triangles, |level| level.triangles),
        };
        scene.meshes.iter().map(|mesh| at(mesh) * weight(mesh)).sum()
    };
    let mut facts = Vec::new();
    for level in 0..=levels {
        facts.push((Fact::SceneTriangles, Some(level), drawn(level, |mesh| mesh.instances) as f64));
        facts.push((Fact::DistinctTriangles, Some(level), drawn(level, |_| 1) as f64));
    }
    let mut plain = |fact, value: u64| facts.push((fact, None, value as f64));
    plain(Fact::SceneVertices, scene.meshes.iter().map(|mesh| mesh.vertices).sum());
    plain(Fact::FileBytes, scene.file_bytes());
    plain(Fact::Undeclared, scene.meshes.iter().filter(|mesh| mesh.copy_of.is_some()).count() as u64);
    if let Some(costs) = &scene.costs {
        plain(Fact::DrawCalls, costs.draw_calls);
        plain(Fact::Materials, costs.materials);
        plain(Fact::GeometryBytes, costs.geometry_bytes);
        plain(Fact::TextureBytes, costs.images.iter().map(|image| image.bytes).sum());
        let sides = costs.images.iter().filter_map(|image| image.width.max(image.height));
        plain(Fact::TextureSize, sides.max().unwrap_or(0).into());
    }
    facts
}

/// Facts of a mesh that have no level.
pub fn mesh_facts(mesh: &MeshRecord) -> impl Iterator<Item = (Fact, f64)> {
    let levels = mesh.levels.len() as f64;
    [(Fact::Levels, levels), (Fact::MinLevels, levels)].into_iter()
}

/// Facts of a mesh at its source (0) and its levels, by their numbers.
pub fn level_facts(mesh: &MeshRecord) -> impl Iterator<Item = (u64, Fact, f64)> {
    let source = [(0, Fact::Triangles, mesh.triangles as f64), (0, Fact::Vertices, mesh.vertices as f64)];
    let levels = mesh.levels.iter().flat_map(|level| {
        let surface = level.surface.filter(|_| 0.0 < mesh.radius).map(|surface| surface.max() / mesh.radius);
        let facts = [
            (Fact::Triangles, Some(level.triangles as f64)),
            (Fact::Vertices, Some(level.vertices as f64)),
            (Fact::DRms, level.d_rms),
            (Fact::Surface, surface),
        ];
        facts.into_iter().filter_map(|(fact, value)| Some((level.number, fact, value?)))
    });
    source.into_iter().chain(levels)
}

/// With its unit: `34,210 triangles`, `1.20 MB of geometry`, `d_RMS 8.31`.
pub fn amount(fact: Fact, value: f64) -> String {
    let bare = figure(fact, value);
    let one = value == 1.0;
    match fact {
        Fact::Triangles => format!("{bare} {}", if one { "triangle" } else { "triangles" }),
        Fact::Vertices => format!("{bare} {}", if one { "vertex" } else { "vertices" }),
        Fact::DRms => format!("d_RMS {bare}"),
        Fact::Surface => format!("{bare} of its radius away from the source"),
        Fact::Levels | Fact::MinLevels => format!("{bare} {}", if one { "level" } else { "levels" }),
        Fact::SceneTriangles => format!("{bare} triangles with every instance"),
        Fact::DistinctTriangles => format!("{bare} triangles, each mesh once"),
        Fact::SceneVertices => format!("{bare} vertices in all"),
        Fact::DrawCalls => format!("{bare} {}", if one { "draw call" } else { "draw calls" }),
        Fact::Materials => format!("{bare} {}", if one { "material" } else { "materials" }),
        Fact::TextureSize => format!("a texture of {bare} texels"),
        Fact::FileBytes => format!("{bare} of files"),
        Fact::GeometryBytes => format!("{bare} of geometry"),
        Fact::TextureBytes => format!("{bare} of textures"),
        Fact::Undeclared => format!("{bare} {}", if one { "repeated mesh" } else { "repeated meshes" }),
    }
}

/// The figure alone, in the form of its fact.
pub fn figure(fact: Fact, value: f64) -> String {
    match fact {
        Fact::DRms => number(value),
        Fact::Surface => percent(value),
        Fact::FileBytes | Fact::GeometryBytes | Fact::TextureBytes => bytes(value as u64),
        _ => count(value as u64),
    }
}
