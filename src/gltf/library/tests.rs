//! Documents whose geometry moves: what is read back, what the files hold, what stays and why.

use super::*;
use crate::config::EmitSettings;
use crate::gltf::fixture::{chain, own, shared, square};
use crate::gltf::instancing::Batches;
use crate::gltf::lod::add_levels_to;
use crate::gltf::package::{Files, Package};
use crate::gltf::read::{from_document, read_bytes};
use crate::gltf::{rules, uri};
use std::path::Path;

/// The square, and behind it a second mesh that is the first with another material, on a node of its own.
fn two() -> Document {
    let mut document = square();
    document.json["materials"] = json!([{ "name": "M" }, { "name": "N" }]);
    let mut mesh = document.json["meshes"][0].clone();
    mesh["primitives"][0]["material"] = json!(1);
    document.push("meshes", mesh).unwrap();
    document.push("nodes", json!({ "mesh": 1 })).unwrap();
    document.json["scenes"][0]["nodes"] = json!([0, 1]);
    document
}

struct Made {
    /// As it was before levels were added.
    opened: Document,
    files: Files,
    notes: Vec<String>,
}

fn make(source: &Document, levels: &[MeshLevels], partial: &[usize], way: &str) -> Made {
    let (mut document, base) = (source.clone(), Path::new(""));
    let mut buffers = Buffers::load(&document, base).unwrap();
    let partial = partial.iter().copied().collect();
    let library = Library::open(&mut document, &mut buffers, levels, &partial).unwrap();
    let notes = library.notes().iter().map(ToString::to_string).collect();
    let mut package = Package::new(document, &buffers, Vec::new(), source.container).unwrap();
    let opened = package.document.clone();
    let settings = EmitSettings::default();
    let added = add_levels_to(&mut package.document, levels, library.homes(), &Batches::new(), &settings).unwrap();
    let shared = library.close(&mut package.document, added.library, way).unwrap();
    let mut files = package.finish("out", added.buffer, &buffers).unwrap();
    files.library = shared;
    Made { opened, files, notes }
}

/// The scene that somebody reads who has the files.
fn read_back(files: &Files) -> crate::gltf::scene::Scene {
    let folder = tempfile::tempdir().unwrap();
    let deep = folder.path().join("deep");
    std::fs::create_dir_all(folder.path().join(FOLDER)).unwrap();
    std::fs::create_dir_all(&deep).unwrap();
    for file in &files.library {
        std::fs::write(folder.path().join(FOLDER).join(&file.name), &file.bytes).unwrap();
    }
    for (name, bytes) in &files.beside {
        std::fs::write(deep.join(name), bytes).unwrap();
    }
    read_bytes(&files.main, &deep).unwrap()
}

fn with_two_levels() -> Vec<MeshLevels> {
    let (first, second) = (own(0), shared());
    vec![chain(0, &first, &second), chain(1, &first, &second)]
}

/// What self-contained output of the same levels reads as.
fn self_contained(source: &Document, levels: &[MeshLevels]) -> crate::gltf::scene::Scene {
    let buffers = Buffers::load(source, Path::new("")).unwrap();
    let mut package = Package::new(source.clone(), &buffers, Vec::new(), source.container).unwrap();
    let (none, settings) = (BTreeMap::new(), EmitSettings::default());
    let added = add_levels_to(&mut package.document, levels, &none, &Batches::new(), &settings).unwrap();
    let files = package.finish("out", added.buffer, &buffers).unwrap();
    read_back(&files)
}

#[test]
fn meshes_that_differ_by_their_material_share_one_file_and_read_as_before() {
    let (source, levels) = (two(), with_two_levels());
    let made = make(&source, &levels, &[], "%2E%2E/");
    assert_eq!(made.notes, [""; 0]);
    assert_eq!((made.files.library.len(), made.files.beside.len()), (1, 0));
    let output = Document::parse(&made.files.main).unwrap();
    assert_eq!(rules::check(&made.opened, &output), []);
    let scene = read_back(&made.files);
    let expected = self_contained(&source, &levels);
    assert_eq!(scene.meshes, expected.meshes);
    assert_eq!(scene.document.json["nodes"], expected.document.json["nodes"]);
    // Named by its bytes; the address is one that Babylon.js takes too.
    let file = &made.files.library[0];
    let name = format!("{}.bin", &blake3::hash(&file.bytes).to_hex()[..32]);
    let address = format!("%2E%2E/lodbake-library/{name}");
    assert_eq!((&file.name, uri::form(&address)), (&name, uri::Form::Relative));
    // Nobody needs the third accessor, which is left to the scene.
    let buffers = output.json["buffers"].clone();
    assert_eq!(buffers[1], json!({ "uri": address, "byteLength": file.bytes.len() }));
    assert!(buffers[0]["byteLength"].as_u64().unwrap() < 60, "{buffers}");
    // Indices, positions; then the coarsest level, which has indices alone, then the finer one.
    assert_eq!(file.bytes.len(), 12 + 48 + 8 + 8 + 36);
}

#[test]
fn the_file_depends_on_the_mesh_alone() {
    let levels = with_two_levels();
    let alone = make(&square(), &levels[..1], &[], "");
    // Interleaved with something else, attributes in another order, another name, in a `.gltf`, beside another mesh.
    let mut other = two();
    let bytes = other.bin.take().unwrap();
    let mut wide = Vec::new();
    for position in bytes[..48].chunks_exact(12) {
        wide.extend_from_slice(position);
        wide.extend_from_slice(&[9; 8]);
    }
    wide.extend_from_slice(&bytes[48..]);
    other.container = Container::Gltf;
    other.json["buffers"] = json!([{ "byteLength": wide.len(), "uri": data_uri(&wide) }]);
    other.json["bufferViews"] = json!([
        { "buffer": 0, "byteLength": 80, "byteStride": 20 },
        { "buffer": 0, "byteOffset": 80, "byteLength": 12 },
        { "buffer": 0, "byteOffset": 92, "byteLength": 48 },
    ]);
    other.json["accessors"][0]["name"] = json!("positions");
    let made = make(&other, &levels, &[], "../../");
    assert_eq!(made.files.library, alone.files.library);
    let output = Document::parse(&made.files.main).unwrap();
    assert_eq!(output.json["accessors"][0]["name"], "positions");
    assert_eq!(made.files.beside, []);
    // Another mesh is another file.
    let third = own(0);
    let changed = make(&square(), &[chain(0, &third, &third)], &[], "");
    assert_ne!(changed.files.library, alone.files.library);
}

#[test]
fn what_others_need_stays_for_them() {
    // The second mesh has the same positions and other triangles; an animation has the positions, too.
    let mut document = two();
    let mut bin = document.bin.take().unwrap().to_vec();
    bin.extend([0u16, 1, 2].into_iter().flat_map(u16::to_le_bytes));
    bin.extend([0, 0]);
    document.json["buffers"][0]["byteLength"] = json!(bin.len());
    document.bin = Some(Arc::from(bin));
    document.push("bufferViews", json!({ "buffer": 0, "byteOffset": 108, "byteLength": 6 })).unwrap();
    document
        .push("accessors", json!({ "bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR" }))
        .unwrap();
    document.json["meshes"][1]["primitives"][0]["indices"] = json!(3);
    let levels = vec![chain(0, &own(0), &shared()), chain(1, &own(0), &shared())];
    let made = make(&document, &levels, &[], "%2E%2E/");
    assert_eq!(made.files.library.len(), 2, "each holds all of its mesh");
    let (scene, expected) = (read_back(&made.files), self_contained(&document, &levels));
    assert_eq!(scene.meshes, expected.meshes);
    let attribute =
        |mesh: usize| scene.document.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"].clone();
    assert_ne!(attribute(0), attribute(1));
    // The animation's accessor still reads as before.
    document.json["animations"] = json!([{
        "samplers": [{ "input": 2, "output": 0 }], "channels": [{ "sampler": 0, "target": { "node": 0, "path": "scale" } }],
    }]);
    let made = make(&document, &levels, &[], "%2E%2E/");
    let scene = read_back(&made.files);
    let views = Views::new(&scene.document, &scene.buffers).unwrap();
    let positions = Accessor::parse(&scene.document, 0, "").unwrap();
    assert_eq!(positions.packed(&views).unwrap().len(), 48);
    let view = &scene.document.json["bufferViews"]
        [scene.document.json["accessors"][0]["bufferView"].as_u64().unwrap() as usize];
    assert_eq!(view["buffer"], 0);
    assert_eq!(scene.meshes, expected.meshes);
}

#[test]
fn meshes_that_cannot_move_stay_whole() {
    let levels = with_two_levels();
    let stays = |change: &dyn Fn(&mut Document), partial: &[usize]| {
        let mut document = square();
        change(&mut document);
        let made = make(&document, &levels[..1], partial, "");
        assert_eq!((made.files.library.len(), made.notes.len()), (0, 1), "{:?}", made.notes);
        let output = Document::parse(&made.files.main).unwrap();
        assert_eq!(rules::check(&document, &output), []);
        made.notes[0].clone()
    };
    let words = "so its geometry stays in the scene's own files";
    assert_eq!(stays(&|_| {}, &[0]), format!("meshes[0]: it uses a small part of its vertex arrays, {words}"));
    let sparse = |document: &mut Document| {
        document.json["accessors"][0]["sparse"] = json!({
            "count": 1,
            "indices": { "bufferView": 1, "componentType": 5123 },
            "values": { "bufferView": 2 },
        });
    };
    assert_eq!(stays(&sparse, &[]), format!("meshes[0]: it has sparse arrays, {words}"));
    let unknown = |document: &mut Document| document.json["extensionsUsed"] = json!(["VENDOR_geometry"]);
    let text = "`VENDOR_geometry` might refer to geometry, so all of it stays in the scene's own files";
    assert_eq!(stays(&unknown, &[]), format!("extensionsUsed: {text}"));
}

#[test]
fn meshes_without_levels_stay_where_they_are() {
    let source = two();
    let first = with_two_levels().swap_remove(0);
    // Nobody shows the first mesh.
    let mut hidden = source.clone();
    hidden.json["nodes"][0].as_object_mut().unwrap().shift_remove("mesh");
    let made = make(&hidden, std::slice::from_ref(&first), &[], "");
    assert_eq!((made.files.library.len(), made.files.main), (0, hidden.to_glb_bytes().unwrap()));
    // The second has none, and shares the arrays of the first.
    let made = make(&source, std::slice::from_ref(&first), &[], "%2E%2E/");
    let output = Document::parse(&made.files.main).unwrap();
    assert_eq!(output.bin.as_deref().unwrap()[..108], source.bin.as_deref().unwrap()[..]);
    assert_eq!(read_back(&made.files).meshes, self_contained(&source, &[first]).meshes);
}

#[test]
fn a_buffer_of_which_nothing_is_left_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = square();
    let bytes = document.bin.take().unwrap();
    document.container = Container::Gltf;
    std::fs::write(folder.path().join("a.bin"), &bytes[..60]).unwrap();
    document.json["buffers"] = json!([{ "byteLength": 60, "uri": "a.bin" }]);
    document.json["accessors"].as_array_mut().unwrap().truncate(2);
    document.json["bufferViews"].as_array_mut().unwrap().truncate(2);
    let mut scene = {
        let buffers = Buffers::load(&document, folder.path()).unwrap();
        from_document(document, buffers, folder.path()).unwrap()
    };
    let levels = with_two_levels();
    Library::open(&mut scene.document, &mut scene.buffers, &levels[..1], &BTreeSet::new()).unwrap();
    assert_eq!(scene.document.json["buffers"][0], json!({ "byteLength": 4, "uri": data_uri(&[0; 4]) }));
}
