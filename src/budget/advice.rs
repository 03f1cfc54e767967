//! What would bring a fact back within its limit, from what the record tells: the largest part is named, and where a
//! setting would do it, the setting.

use super::{figure, mesh_name};
use crate::config::{Fact, LevelTarget};
use crate::progress::quantity::{bytes, count};
use crate::report::{ImageRecord, MeshRecord, SceneRecord, Stop};

/// For a fact of a whole scene.
pub fn scene(scene: &SceneRecord, fact: Fact, bound: f64) -> String {
    let most = |weight: fn(&MeshRecord) -> u64| scene.meshes.iter().max_by_key(|mesh| weight(mesh));
    let costs = scene.costs.clone().unwrap_or_default();
    match fact {
        Fact::SceneTriangles => most(|mesh| mesh.triangles * mesh.instances).map_or_else(String::new, |mesh| {
            let (name, each, times) = (mesh_name(mesh), count(mesh.triangles), count(mesh.instances));
            format!("`{name}` takes the most ({each} × {times} instances): a coarser source, or fewer instances")
        }),
        Fact::DistinctTriangles => most(|mesh| mesh.triangles)
            .map_or_else(String::new, |mesh| format!("`{}` has the most: {}", mesh_name(mesh), count(mesh.triangles))),
        Fact::SceneVertices => most(|mesh| mesh.vertices)
            .map_or_else(String::new, |mesh| format!("`{}` has the most: {}", mesh_name(mesh), count(mesh.vertices))),
        Fact::DrawCalls => most(|mesh| mesh.draw_calls).map_or_else(String::new, |mesh| {
            let (name, calls) = (mesh_name(mesh), count(mesh.draw_calls));
            format!("`{name}` takes {calls}: join parts with the same material, or use `EXT_mesh_gpu_instancing`")
        }),
        Fact::Materials => "join materials that differ by their textures alone in an atlas".to_owned(),
        Fact::TextureSize => largest(&costs.images, |image| image.width.max(image.height).unwrap_or(0).into())
            .map_or_else(String::new, |(name, image)| {
                let side = |side: Option<u32>| side.map_or_else(|| "?".to_owned(), |side| side.to_string());
                format!("resize {name} ({}×{})", side(image.width), side(image.height))
            }),
        Fact::TextureBytes => largest(&costs.images, |image| image.bytes).map_or_else(String::new, |(name, image)| {
            format!("{name} is the largest ({}): resize or compress it", bytes(image.bytes))
        }),
        Fact::FileBytes | Fact::GeometryBytes => {
            let textures: u64 = costs.images.iter().map(|image| image.bytes).sum();
            let levels: u64 = scene.meshes.iter().flat_map(|mesh| &mesh.levels).map(|level| level.bytes).sum();
            let [geometry, textures, levels] = [costs.geometry_bytes, textures, levels].map(bytes);
            format!(
                "geometry is {geometry}, of which levels about {levels}, textures are {textures}; fewer levels, or `storage = \"shared\"`, make levels smaller"
            )
        }
        Fact::Undeclared => {
            let copy = scene.meshes.iter().find_map(|mesh| Some((mesh, mesh.copy_of?)));
            copy.map_or_else(String::new, |(mesh, of)| {
                let original = scene.meshes.iter().find(|other| other.index == of).map_or_else(String::new, mesh_name);
                format!(
                    "`{}` repeats `{original}`: `recover = \"exact\"` in `[instances]` makes instances of such meshes",
                    mesh_name(mesh)
                )
            })
        }
        _ => general(fact, bound),
    }
}

/// For a fact of a mesh without level.
pub fn mesh(mesh: &MeshRecord, fact: Fact, bound: f64) -> String {
    match fact {
        Fact::MinLevels => match mesh.notes.first() {
            Some(note) => note.clone(),
            None => {
                "targets that would repeat the level before have no level of their own: ask for coarser ones".to_owned()
            }
        },
        _ => general(fact, bound),
    }
}

/// For a fact of a level, or of the source (0).
pub fn level(mesh: &MeshRecord, level: u64, fact: Fact, bound: f64) -> String {
    let Some(record) = mesh.levels.iter().find(|record| record.number == level) else {
        return match fact {
            Fact::Triangles | Fact::Vertices => {
                "this is the source: make it coarser where it is modelled, or name the levels that the limit holds for, \
                 e.g. `level = [1, 2]`"
                    .to_owned()
            }
            _ => general(fact, bound),
        };
    };
    match fact {
        Fact::Triangles | Fact::Vertices if record.stop == Stop::NoLegalPair => {
            "nothing was left that may be contracted: look for open borders, seams and many small pieces".to_owned()
        }
        Fact::Triangles => {
            // Rounded down, so that it is reached.
            let enough = libm::floor(1000.0 * bound / mesh.triangles.max(1) as f64) / 1000.0;
            match record.target {
                LevelTarget::Ratio(ratio) if 0.0 < enough && enough < ratio => {
                    format!("`ratio = {enough}` instead of {ratio} for level {level} would reach it")
                }
                _ if 1.0 <= bound => format!("`triangles = {}` for level {level} would reach it", libm::floor(bound)),
                _ => "ask for fewer triangles".to_owned(),
            }
        }
        Fact::Vertices => "ask for fewer triangles; seams and hard edges double vertices".to_owned(),
        Fact::DRms | Fact::Surface => {
            let target = match record.target {
                LevelTarget::Ratio(ratio) => format!("a higher ratio than {ratio}"),
                LevelTarget::Triangles(triangles) => format!("more than {} triangles", count(triangles.into())),
                LevelTarget::Error { limit, .. } => format!("an error below {limit}"),
                LevelTarget::Pixels { limit, .. } => format!("fewer pixels than {limit}"),
                LevelTarget::Appearance(limit) => format!("an appearance below {limit}"),
                LevelTarget::SceneRatio(ratio) => format!("a higher scene_ratio than {ratio}"),
                LevelTarget::SceneTriangles(triangles) => format!("more than {} scene_triangles", count(triangles)),
                LevelTarget::SceneBytes(bytes) => format!("more than {} scene_bytes", count(bytes)),
            };
            let exact = if fact == Fact::DRms { ", a level by `appearance`" } else { "" };
            format!("ask for {target} at level {level}{exact}, or try `effort = \"best\"`")
        }
        _ => general(fact, bound),
    }
}

fn general(fact: Fact, bound: f64) -> String {
    format!("it may be {} {}", figure(fact, bound), fact.title())
}

fn largest(images: &[ImageRecord], weight: impl Fn(&ImageRecord) -> u64) -> Option<(String, &ImageRecord)> {
    let (index, image) = images.iter().enumerate().max_by_key(|(_, image)| weight(image))?;
    let name = image.name.as_ref().map_or_else(|| format!("`images[{index}]`"), |name| format!("`{name}`"));
    Some((name, image))
}
