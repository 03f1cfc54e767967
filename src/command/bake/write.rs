//! From a scene and its levels to the files of its output, and what is remembered of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::record::{self, SceneFacts};
use super::survey::Todo;
use super::wave::{Failure, ReadScene};
use crate::config::{Format, Layout, Profile};
use crate::emit::{Content, Emission, Emitted, EmittedFile, OutputFolder};
use crate::gltf::dependencies::dependencies;
use crate::gltf::document::Container;
use crate::gltf::instancing;
use crate::gltf::library::Library;
use crate::gltf::lod::{MeshLevel, MeshLevels, PrimitiveLevel, WriteError, add_levels_to, switches};
use crate::gltf::package::Package;
use crate::gltf::scene::{Scene, SourceMesh};
use crate::index::{self, Seen};
use crate::key::JobKey;
use crate::lod::Chain;
use crate::mesh::hash::MeshHash;
use crate::mesh::{Level, LevelPrimitive, LevelVertices};
use crate::obj::is_obj;
use crate::plan::MeshPlan;
use crate::report::{OutputRecord, Problem, SceneRecord, Status};
use crate::work::Baked;

/// What was written for a scene.
pub struct Written {
    pub todo: Todo,
    pub facts: SceneFacts,
    pub bake: index::Bake,
    pub new_files: u64,
}

/// Where a scene goes: below `root`, at its own place, with the extension of its container.
pub fn target(root: &Path, relative: &str, format: Format) -> PathBuf {
    let path = root.join(relative);
    match format {
        Format::Source if is_obj(&path) => path.with_extension("glb"),
        Format::Source => path,
        Format::Glb => path.with_extension("glb"),
        Format::Gltf => path.with_extension("gltf"),
    }
}

/// One folder up, in an address. Babylon.js refuses addresses with two dots; with their codes, which mean the same, browsers go up all
/// the same. Programs that are no browsers may know the dots alone.
fn up(profile: Profile) -> &'static str {
    match profile {
        Profile::Web | Profile::BabylonStream => "%2E%2E/",
        Profile::Core | Profile::Unity | Profile::Unreal | Profile::Godot => "../",
    }
}

/// Writes a scene with its levels.
pub fn write_scene(scene: ReadScene, baked: &Baked, output: &OutputFolder, root: &Path) -> Result<Written, Failure> {
    let settings = &scene.todo.settings.emit.clone();
    let relative = scene.todo.file.relative.clone();
    let levels = levels(&scene, &baked.chains);
    let is_changed = scene.is_changed || is_obj(&scene.todo.file.path);
    let mut notes = scene.notes.clone();
    let mut record = SceneRecord {
        path: relative.clone(),
        status: Status::Baked,
        settings: None,
        bytes_in: scene.bytes,
        bytes_out: 0,
        outputs: Vec::new(),
        meshes: record::meshes(&scene, baked, |radius, errors| switches(radius, errors, settings)),
        costs: None,
        batches: scene.folded.as_ref().map(record::batches),
        parts: scene.parts.clone(),
    };
    let mut costs = record::costs(&scene.scene, &record.meshes, &scene.images);
    let unknown_images = (0..).zip(&scene.images).filter(|(_, image)| 0 < image.bytes && image.size.is_none());
    let unknown_images: Vec<String> = unknown_images.map(|(index, _): (usize, _)| format!("images[{index}]")).collect();
    let embedded: u64 = scene.images.iter().map(|image| image.embedded).sum();
    let target = target(root, &relative, settings.format);
    let stem = target.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let container = match settings.format {
        Format::Source => scene.scene.document.container,
        Format::Glb => Container::Glb,
        Format::Gltf => Container::Gltf,
    };
    let mut hashes: Vec<MeshHash> = scene.sub_meshes.iter().flatten().map(|sub| sub.hash).collect();
    let mut known = BTreeSet::new();
    hashes.retain(|hash| known.insert(*hash));
    let partial: BTreeSet<usize> =
        scene.scene.meshes.iter().filter(|mesh| !mesh.vertex_maps.is_empty()).map(|mesh| mesh.index).collect();
    let ReadScene {
        todo,
        dependencies: scene_dependencies,
        scene: Scene { mut document, mut buffers, dependencies: mut beside, warnings, .. },
        seen,
        ..
    } = scene;
    let refused = |error: WriteError| Failure {
        file: Box::new(todo.file.clone()),
        cause: format!("failed to write levels into `{relative}`: {error}"),
        hint: error.hint().map(str::to_owned),
    };
    let batches = instancing::batches(&document, &buffers).map_err(|error| refused(error.into()))?;
    let library = match settings.layout {
        Layout::SelfContained => Library::default(),
        Layout::Library => {
            Library::open(&mut document, &mut buffers, &levels, &partial).map_err(|error| refused(error.into()))?
        }
    };
    if !library.homes().is_empty() {
        // A buffer that lost bytes is no file any more.
        beside = dependencies(&document, todo.file.path.parent().unwrap_or(Path::new("")));
    }
    let mut package = Package::new(document, &buffers, beside.clone(), container).map_err(refused)?;
    let added = add_levels_to(&mut package.document, &levels, library.homes(), &batches, settings).map_err(refused)?;
    notes.extend(library.notes());
    notes.extend(package.notes());
    notes.extend(added.notes);
    if added.groups == 0 {
        record.status = Status::Copied;
    }
    let content = if added.groups == 0 && !package.is_converted() && !is_changed {
        Content::AsSource { copied: beside }
    } else {
        let way = up(settings.profile).repeat(relative.matches('/').count());
        let shared =
            library.close(&mut package.document, added.library, &way).map_err(|error| refused(error.into()))?;
        let mut files = package.finish(&stem, added.buffer, &buffers).map_err(refused)?;
        files.library = shared;
        Content::Files(files)
    };
    let emission = Emission { source: &todo.file.path, target: &target, content: &content };
    let emitted = output.emit(&emission).map_err(|error| Failure {
        file: Box::new(todo.file.clone()),
        cause: error.to_string(),
        hint: error.hint().map(str::to_owned),
    })?;
    let mut problems: Vec<Problem> = warnings.iter().map(|w| record::warning(&relative, &w.place, &w.text)).collect();
    problems.extend(notes.iter().map(|note| record::warning(&relative, &note.place, &note.text)));
    if todo.settings.appearance.record {
        problems.extend(unknown_images.iter().map(|place| {
            record::warning(
                &relative,
                place,
                "the image is neither PNG, JPEG, WebP nor KTX2; looks are measured without it",
            )
        }));
    }
    let missing =
        |uri: &String| record::warning(&relative, "", &format!("`{uri}` is not there, nor beside the output"));
    problems.extend(emitted.missing.iter().map(missing));
    let outputs = outputs(&emitted, output).map_err(|error| Failure {
        file: Box::new(todo.file.clone()),
        cause: format!("failed to read back what was written: {error}"),
        hint: None,
    })?;
    record.outputs = outputs
        .iter()
        .map(|o| OutputRecord { path: o.relative.clone(), bytes: o.seen.stat.size, hash: o.seen.content.to_string() })
        .collect();
    record.bytes_out = record.outputs.iter().filter(|o| is_geometry(&o.path)).map(|o| o.bytes).sum();
    costs.geometry_bytes = record.bytes_out.saturating_sub(embedded);
    record.costs = Some(costs);
    let bake =
        index::Bake { scene: seen, dependencies: scene_dependencies, meshes: hashes, outputs, facts: Vec::new() };
    let new_files = emitted.files.iter().filter(|f| f.written).count() as u64;
    Ok(Written { todo, facts: SceneFacts { record, problems }, bake, new_files })
}

/// What is there now, as the index keeps it. A file that two scenes copy is listed for both.
fn outputs(emitted: &Emitted, folder: &OutputFolder) -> std::io::Result<Vec<index::Output>> {
    let output =
        |file: &EmittedFile| Ok(index::Output { relative: folder.relative(&file.path), seen: Seen::read(&file.path)? });
    emitted.files.iter().map(output).collect()
}

/// Scenes and buffers, not images.
fn is_geometry(path: &str) -> bool {
    let path = Path::new(path);
    path.extension().is_some_and(|e| ["glb", "gltf", "bin"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// One sub-mesh at one level, shared by the meshes that have it; empty if it stays as the source.
type SharedPart = Vec<Arc<LevelPrimitive>>;

/// A level primitive whose indices into the source's vertices are those of the source's accessors: where triangles use
/// only a part of them, that part was read and simplified.
fn in_source(source: &SourceMesh, index: usize, level: &Arc<LevelPrimitive>) -> Arc<LevelPrimitive> {
    if matches!(level.vertices, LevelVertices::Own(_)) || !source.vertex_maps.contains_key(&index) {
        return level.clone();
    }
    let indices = source.source_indices(index, &level.indices).into_owned();
    Arc::new(LevelPrimitive { indices, vertices: LevelVertices::Source })
}

/// The levels of every mesh that has a chain, put together from its sub-meshes.
fn levels(scene: &ReadScene, chains: &BTreeMap<JobKey, Arc<Chain>>) -> Vec<MeshLevels> {
    let mut shared: BTreeMap<(JobKey, usize), Vec<SharedPart>> = BTreeMap::new();
    let mut out = Vec::new();
    for source in &scene.scene.meshes {
        let MeshPlan::Chain { chain: key, .. } = &scene.plans[source.index] else { continue };
        let chain = &chains[key];
        let subs = &scene.sub_meshes[source.index];
        let levels = chain.levels.iter().enumerate().map(|(number, level)| {
            // Meshes with the same chain share its primitives, and so their bytes in the output.
            let parts = shared.entry((*key, number)).or_insert_with(|| {
                let arcs = |part: &Level| part.primitives.iter().map(|p| Arc::new(p.clone())).collect();
                let part = |part: &Option<Level>| part.as_ref().map_or_else(Vec::new, arcs);
                level.parts.iter().map(part).collect()
            });
            let mut primitives = vec![PrimitiveLevel::AsSource; source.primitives.len()];
            for (sub, part) in subs.iter().zip(parts.iter()) {
                for (&index, primitive) in sub.primitives.iter().zip(part) {
                    primitives[index] = PrimitiveLevel::Level(in_source(source, index, primitive));
                }
            }
            let facts = level.bound.map(|bound| serde_json::json!({ "bound": bound }));
            MeshLevel { primitives, error: level.error, facts }
        });
        out.push(MeshLevels { mesh: source.index, radius: scene.radii[source.index], levels: levels.collect() });
    }
    out
}
