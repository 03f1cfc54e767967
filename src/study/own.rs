//! lodbake's own run of a study: read a scene, bake one level of every mesh, give the bytes of the GLB. No cache, no
//! report, one thread.

use std::path::Path;
use std::sync::Arc;

use crate::appearance::assemble;
use crate::config::{ChainSettings, LevelTarget, SceneSettings, Storage};
use crate::gltf::document::Container;
use crate::gltf::error::{DocumentError, ReadError};
use crate::gltf::instancing;
use crate::gltf::lod::{MeshLevel, MeshLevels, PrimitiveLevel, add_levels};
use crate::gltf::package::Package;
use crate::gltf::scene::{Scene, SourceMesh};
use crate::gltf::write::WriteError;
use crate::identify::{SubMesh, materials, sub_meshes};
use crate::key::ContentHash;
use crate::mesh::layout::frame;
use crate::obj;
use crate::plan::{MeshLook, MeshPlan, Plan};
use crate::work::chains;

/// Why there is no level.
#[derive(Debug, thiserror::Error)]
pub enum OwnError {
    /// The scene cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The levels cannot be written into it.
    #[error("failed to write the level: {0}")]
    Write(#[from] WriteError),
    /// The document names something that is not there.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// No mesh got a level.
    #[error("no level was made: {0}")]
    None(String),
}

/// The scene with one level of `ratio` for every mesh (between 0 and 1, exclusive), as a GLB.
pub fn bake(file: &Path, settings: &SceneSettings, ratio: f64) -> Result<Vec<u8>, OwnError> {
    if 1.0 <= ratio {
        return Err(OwnError::None("as many triangles are asked for as the source has".to_owned()));
    }
    let mut settings = settings.clone();
    let levels = vec![LevelTarget::Ratio(ratio)];
    settings.chain = ChainSettings { levels, storage: Storage::Compact, ..settings.chain };
    let scene = obj::read_any(file)?;
    let levels = levels_of(file, &scene, &settings)?;
    let Scene { document, buffers, dependencies, .. } = scene;
    let batches = instancing::batches(&document, &buffers)?;
    let mut package = Package::new(document, &buffers, dependencies, Container::Glb)?;
    let added = add_levels(&mut package.document, &levels, &batches, &settings.emit)?;
    Ok(package.finish("level", added.buffer, &buffers)?.main)
}

fn levels_of(file: &Path, scene: &Scene, settings: &SceneSettings) -> Result<Vec<MeshLevels>, OwnError> {
    let subs: Vec<Vec<SubMesh>> = scene.meshes.iter().map(sub_meshes).collect();
    let mut plan = Plan::default();
    let meshes = scene.meshes.iter().zip(&subs);
    let plans: Vec<MeshPlan> = meshes
        .map(|(mesh, subs)| {
            let look = settings.looks_decide().then(|| look_of(scene, mesh, subs, settings));
            // Levels with vertices of their own can be added to any source.
            plan.add(mesh, subs, true, look.as_ref(), settings)
        })
        .collect();
    let base = file.parent().unwrap_or(Path::new(""));
    let load = |_| assemble::looks(scene, base);
    let chains = chains(&plan, &load);
    let mut out = Vec::new();
    let mut reason = "no pair of vertices can be contracted";
    for ((source, subs), plan) in scene.meshes.iter().zip(&subs).zip(&plans) {
        let key = match plan {
            MeshPlan::Chain { chain, .. } => chain,
            MeshPlan::Alone(cause) => {
                reason = cause;
                continue;
            }
        };
        let levels: Vec<MeshLevel> = chains[key]
            .levels
            .iter()
            .map(|level| {
                let mut primitives = vec![PrimitiveLevel::AsSource; source.primitives.len()];
                for (sub, part) in subs.iter().zip(&level.parts) {
                    for (&index, primitive) in sub.primitives.iter().zip(part.iter().flat_map(|p| &p.primitives)) {
                        primitives[index] = PrimitiveLevel::Level(Arc::new(primitive.clone()));
                    }
                }
                let facts = level.bound.map(|bound| serde_json::json!({ "bound": bound }));
                MeshLevel { primitives, error: level.error, facts }
            })
            .collect();
        if !levels.is_empty() {
            let radius = frame(source.triangle_primitives().map(|(_, primitive)| primitive)).1;
            out.push(MeshLevels { mesh: source.index, radius, levels });
        }
    }
    if out.is_empty() { Err(OwnError::None(reason.to_owned())) } else { Ok(out) }
}

/// What a mesh looks like, for metrics that look. Nothing is kept, so the numbers of materials stand for what they show.
fn look_of(scene: &Scene, mesh: &SourceMesh, subs: &[SubMesh], settings: &SceneSettings) -> MeshLook {
    let materials = materials(&scene.document, mesh.index, subs);
    let hash = ContentHash(*blake3::hash(format!("{materials:?}").as_bytes()).as_bytes());
    MeshLook { scene: 0, hash, materials: Arc::new(materials), size: settings.appearance.size }
}
