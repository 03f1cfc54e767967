//! Gives crude levels to every readable scene of the corpus, writes it in every format, reads it again: every rule
//! holds, nothing is lost, and every level has the geometry that went in. The files stay in the folder `LODBAKE_KEEP`
//! if that is set, for other tools to look at.
#![expect(clippy::print_stdout, reason = "how much was checked is said aloud")]

mod corpus;

use corpus::{corpus, scenes};
use lodbake::config::{EmitSettings, Profile};
use lodbake::emit::{Content, Emission, Emitted, OutputFolder};
use lodbake::gltf::document::{Container, Document};
use lodbake::gltf::instancing;
use lodbake::gltf::json;
use lodbake::gltf::lod::{Added, MeshLevel, MeshLevels, PrimitiveLevel, add_levels};
use lodbake::gltf::package::Package;
use lodbake::gltf::scene::{Scene, SourceMesh, SourcePrimitive};
use lodbake::gltf::{read, rules};
use lodbake::mesh::{Attribute, ComponentType, LevelOwnVertices, LevelPrimitive, LevelVertices, Primitive};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const DRACO: &str = "KHR_draco_mesh_compression";

/// Keeps the first half of the triangles at level 1, the first quarter at level 2.
fn levels(scene: &Scene, shared: bool) -> Vec<MeshLevels> {
    let with_triangles = scene.meshes.iter().filter(|mesh| mesh.triangles() > 0);
    with_triangles.map(|mesh| mesh_levels(&scene.document, mesh, shared)).collect()
}

fn mesh_levels(document: &Document, mesh: &SourceMesh, shared: bool) -> MeshLevels {
    let level = |divisor: usize| {
        let primitives = mesh.primitives.iter().enumerate().map(|(i, primitive)| match primitive {
            SourcePrimitive::PassThrough { .. } => PrimitiveLevel::AsSource,
            SourcePrimitive::Triangles(primitive) => {
                let json = &document.json["meshes"][mesh.index]["primitives"][i];
                let shared = shared && json::extension(json, DRACO).is_none();
                PrimitiveLevel::Level(Arc::new(first_triangles(mesh, i, primitive, (divisor, shared))))
            }
        });
        MeshLevel { primitives: primitives.collect(), error: 0.01 * divisor as f64, facts: None }
    };
    MeshLevels { mesh: mesh.index, radius: 1.0, levels: vec![level(2), level(4)] }
}

fn first_triangles(
    mesh: &SourceMesh,
    number: usize,
    primitive: &Primitive,
    (divisor, shared): (usize, bool),
) -> LevelPrimitive {
    let kept = &primitive.indices[..primitive.triangles().div_ceil(divisor) * 3];
    if shared {
        let indices = mesh.source_indices(number, kept).into_owned();
        return LevelPrimitive { indices, vertices: LevelVertices::Source };
    }
    let mut places = BTreeMap::new();
    let mut order = Vec::new();
    let mut place = |&old: &u32| {
        *places.entry(old).or_insert_with(|| {
            order.push(old as usize);
            order.len() as u32 - 1
        })
    };
    let indices = kept.iter().map(&mut place).collect();
    let pick = |attribute: &Attribute| {
        let rows: Vec<&[f32]> = attribute.values.chunks_exact(attribute.components).collect();
        let values = order.iter().flat_map(|&old| rows[old].iter().copied()).collect();
        Attribute { values, ..attribute.clone() }
    };
    let attributes = primitive.attributes.iter().map(pick).collect();
    let targets = primitive.targets.iter().map(|target| target.iter().map(pick).collect()).collect();
    let own = LevelOwnVertices { count: order.len(), attributes, targets };
    LevelPrimitive { indices, vertices: LevelVertices::Own(own) }
}

/// Scene, its levels, and where it was written.
struct Written {
    scene: Scene,
    levels: Vec<MeshLevels>,
    added: Added,
    target: PathBuf,
    emitted: Emitted,
}

/// How a scene is written.
#[derive(Clone, Copy)]
struct Manner {
    /// `None`: as the source.
    container: Option<Container>,
    shared: bool,
    profile: Profile,
}

fn write(path: &Path, corpus: &Path, output: &Path, manner: Manner) -> Option<Written> {
    // What cannot be read is the reader's to refuse; `tests/read_corpus.rs` knows which.
    let scene = read::read(path).ok()?;
    let levels = levels(&scene, manner.shared);
    let container = manner.container.unwrap_or(scene.document.container);
    let batches = instancing::batches(&scene.document, &scene.buffers).unwrap();
    let package = Package::new(scene.document.clone(), &scene.buffers, scene.dependencies.clone(), container);
    let mut package = match package {
        Ok(package) => package,
        Err(error) => {
            assert_eq!(error.to_string(), "buffers[0]: has no data, and in a GLB it must have some");
            return None;
        }
    };
    let settings = EmitSettings { profile: manner.profile, ..EmitSettings::default() };
    let added = add_levels(&mut package.document, &levels, &batches, &settings)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let extension = if container == Container::Glb { "glb" } else { "gltf" };
    let target = output.join(path.strip_prefix(corpus).unwrap()).with_extension(extension);
    let content = if added.is_empty() && !package.is_converted() {
        Content::AsSource { copied: scene.dependencies.clone() }
    } else {
        let stem = target.file_stem().unwrap().to_str().unwrap().to_owned();
        Content::Files(package.finish(&stem, added.buffer.clone(), &scene.buffers).unwrap())
    };
    let emission = Emission { source: path, target: &target, content: &content };
    let emitted = OutputFolder::new(output).emit(&emission).unwrap();
    Some(Written { scene, levels, added, target, emitted })
}

/// Corner by corner, what a level shows.
fn corners(primitive: &Primitive, name: &str) -> Option<Vec<f32>> {
    let attribute = primitive.attribute(name)?;
    let corner = |&i: &u32| {
        let start = i as usize * attribute.components;
        attribute.values[start..start + attribute.components].iter().copied()
    };
    Some(primitive.indices.iter().flat_map(corner).collect())
}

/// Largest difference that rounding to the storage format may make.
fn tolerance(attribute: &Attribute) -> f32 {
    match (attribute.format.component, attribute.format.normalized) {
        (ComponentType::F32, _) => 1e-5,
        (ComponentType::U8 | ComponentType::I8, true) => 1.5 / 127.0,
        (_, true) => 1.5 / 32767.0,
        _ => 0.0,
    }
}

/// Normals and tangents are made unit vectors, which some sources' are not: what counts is where they point.
fn directions(values: &[f32], components: usize) -> Vec<f32> {
    let direction = |vector: &[f32]| {
        let length = vector[..3].iter().map(|c| c * c).sum::<f32>().sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        [vector[0] * scale, vector[1] * scale, vector[2] * scale]
    };
    values.chunks_exact(components).flat_map(direction).collect()
}

fn compare_geometry(expected: &Primitive, kept: usize, found: &Primitive, place: &str) {
    let expected = Primitive { indices: expected.indices[..kept * 3].to_vec(), ..expected.clone() };
    assert_eq!(found.indices.len(), expected.indices.len(), "{place}");
    assert_eq!(found.targets.len(), expected.targets.len(), "{place}");
    for attribute in &expected.attributes {
        let name = attribute.name.as_str();
        let (before, after) = (corners(&expected, name).unwrap(), corners(found, name));
        let after = after.unwrap_or_else(|| panic!("{place}: no {name}"));
        let (before, after, tolerance) = if matches!(name, "NORMAL" | "TANGENT") {
            let turned = |values: &[f32]| directions(values, attribute.components);
            (turned(&before), turned(&after), tolerance(attribute).max(0.02))
        } else {
            (before, after, tolerance(attribute))
        };
        let worst = before.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= tolerance, "{place}: {name} differs by {worst}");
    }
}

fn check(written: &Written) -> usize {
    let place = written.target.display().to_string();
    let output = read::read(&written.target).unwrap_or_else(|error| panic!("{error}"));
    let violations = rules::check(&written.scene.document, &output.document);
    assert!(violations.is_empty(), "{place}: {violations:#?}");
    let last = written.emitted.files.last().unwrap();
    assert_eq!((&last.path, last.bytes), (&written.target, std::fs::metadata(&written.target).unwrap().len()));
    let mut checked = 0;
    let nodes = output.document.array("nodes").unwrap();
    for (i, node) in written.scene.document.array("nodes").unwrap().iter().enumerate() {
        let Some(mesh) = json::index(node, "mesh", "").unwrap() else { continue };
        let group = nodes[i]["children"].as_array().and_then(|c| nodes.get(c.last()?.as_u64()? as usize));
        let Some(lod) = group.and_then(|child| json::extension(child, "MSFT_lod")) else { continue };
        for (number, id) in lod["ids"].as_array().unwrap().iter().enumerate() {
            let level = nodes[id.as_u64().unwrap() as usize]["mesh"].as_u64().unwrap() as usize;
            let found = &output.meshes[level].primitives;
            for (p, primitive) in written.scene.meshes[mesh].primitives.iter().enumerate() {
                let place = format!("{place}: meshes[{mesh}].primitives[{p}], level {}", number + 1);
                match (primitive, &found[p]) {
                    (SourcePrimitive::Triangles(expected), SourcePrimitive::Triangles(found)) => {
                        let kept = expected.triangles().div_ceil(2 << number);
                        compare_geometry(expected, kept, found, &place);
                    }
                    (SourcePrimitive::PassThrough { .. }, SourcePrimitive::PassThrough { .. }) => {}
                    _ => panic!("{place}: another kind of primitive"),
                }
                checked += 1;
            }
        }
    }
    assert_eq!(checked > 0, !written.added.is_empty(), "{place}");
    assert_eq!(written.added.is_empty(), written.levels.is_empty() || nodes_use_none(written), "{place}");
    checked
}

/// Scenes may bring meshes that no node uses.
fn nodes_use_none(written: &Written) -> bool {
    let nodes = written.scene.document.array("nodes").unwrap();
    !nodes.iter().any(|node| {
        let mesh = node.get("mesh").and_then(json::integer);
        written.levels.iter().any(|levels| mesh == Some(levels.mesh as u64))
    })
}

fn run(name: &str, manner: Manner) {
    let Some(corpus) = corpus() else { return };
    let temporary = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("LODBAKE_KEEP").map(|folder| Path::new(&folder).join(name));
    let output = kept.unwrap_or_else(|| temporary.path().to_owned());
    let (mut written, mut groups, mut checked) = (0, 0, 0);
    for path in ["quality", "scenes", "features"].iter().flat_map(|name| scenes(&corpus.join(name))) {
        let Some(result) = write(&path, &corpus, &output, manner) else { continue };
        written += 1;
        groups += result.added.groups;
        checked += check(&result);
        // The same again: nothing is touched.
        let again = write(&path, &corpus, &output, manner).unwrap();
        assert!(again.emitted.files.iter().all(|file| !file.written), "{:?}", again.emitted);
    }
    println!("{written} scenes, {groups} groups, {checked} level primitives");
    assert!(written > 100 && groups > 100 && checked > 500);
}

#[test]
fn own_vertices_in_the_source_format() {
    run("own", Manner { container: None, shared: false, profile: Profile::Web });
}

#[test]
fn shared_vertices_in_the_source_format() {
    run("shared", Manner { container: None, shared: true, profile: Profile::Godot });
}

#[test]
fn everything_as_glb() {
    run("glb", Manner { container: Some(Container::Glb), shared: false, profile: Profile::Unity });
}

#[test]
fn everything_as_gltf() {
    run("gltf", Manner { container: Some(Container::Gltf), shared: true, profile: Profile::Unreal });
}
