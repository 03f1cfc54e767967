//! Conversions on small documents, with files on disk where the source has some.

use super::*;
use crate::config::EmitSettings;
use crate::gltf::dependencies::dependencies;
use crate::gltf::fixture::{chain, own, shared, square};
use crate::gltf::instancing::Batches;
use crate::gltf::lod::add_levels;
use crate::gltf::rules;
use std::fs;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\nrest";

/// The square as a `.gltf` with files: a buffer, a second one, images of all kinds.
fn with_files(folder: &Path) -> Document {
    let mut document = square();
    document.container = Container::Gltf;
    fs::write(folder.join("a b.bin"), document.bin.take().unwrap()).unwrap();
    fs::write(folder.join("second.bin"), [1, 2, 3]).unwrap();
    fs::write(folder.join("t.png"), PNG).unwrap();
    fs::write(folder.join("odd.tga"), b"tga").unwrap();
    let length = document.json["buffers"][0]["byteLength"].clone();
    document.json["buffers"] =
        json!([{ "byteLength": length, "uri": "a%20b.bin" }, { "byteLength": 3, "uri": "second.bin" }]);
    document.json["images"] = json!([
        { "name": "t", "uri": "t.png" },
        { "uri": "odd.tga" },
        { "uri": "missing.png" },
        { "uri": data_uri(PNG), "mimeType": "image/jpeg" },
        { "uri": "http://x/y.png" },
    ]);
    document.json["extensions"] = json!({ "EXT_structural_metadata": { "schemaUri": "schema.json" } });
    document
}

fn files(source: &Document, base: &Path, container: Container) -> (Files, Vec<Note>) {
    let buffers = Buffers::load(source, base).unwrap();
    let mut package = Package::new(source.clone(), &buffers, dependencies(source, base), container).unwrap();
    let levels = [chain(0, &own(0), &shared())];
    let added = add_levels(&mut package.document, &levels, &Batches::new(), &EmitSettings::default()).unwrap();
    let notes = package.notes();
    (package.finish("out", added.buffer, &buffers).unwrap(), notes)
}

#[test]
fn a_gltf_with_files_becomes_one_glb() {
    let folder = tempfile::tempdir().unwrap();
    let source = with_files(folder.path());
    let (files, notes) = files(&source, folder.path(), Container::Glb);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(rules::check(&source, &output), []);
    assert_eq!(files.beside, []);
    let copied: Vec<&str> = files.copied.iter().map(|d| d.uri.as_str()).collect();
    assert_eq!(copied, ["missing.png", "odd.tga", "schema.json"]);
    assert_eq!(output.array("buffers").unwrap().len(), 2);
    assert_eq!(output.json["buffers"][1]["uri"], data_uri(&[1, 2, 3]));
    let image = |i: usize| -> (&Value, &[u8]) {
        let image = &output.json["images"][i];
        let view = &output.json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let number = |key: &str| view[key].as_u64().unwrap() as usize;
        let start = number("byteOffset");
        (image, &output.bin.as_deref().unwrap()[start..start + number("byteLength")])
    };
    for i in [0, 3] {
        assert_eq!((&image(i).0["mimeType"], image(i).1), (&json!("image/png"), PNG));
    }
    assert_eq!(output.json["images"][0]["name"], "t");
    for i in [1, 2, 4] {
        assert_eq!(output.json["images"][i], source.json["images"][i]);
    }
    assert_eq!(notes.len(), 2, "{notes:?}");
}

#[test]
fn a_glb_becomes_a_gltf_with_its_bytes_beside_it() {
    let mut source = square();
    source.extra_chunks = vec![(7, vec![1; 4])];
    source.json["images"] = json!([{ "bufferView": 2, "mimeType": "image/png" }, { "uri": "out.bin" }]);
    let (files, notes) = files(&source, Path::new(""), Container::Gltf);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(output.json["buffers"][0]["uri"], "out.2.bin", "`out.bin` is an image here");
    // The image lies in the same buffer: so do the levels.
    assert_eq!(output.array("buffers").unwrap().len(), 1);
    assert_eq!((files.beside.len(), files.beside[0].0.as_str()), (1, "out.2.bin"));
    assert!(files.beside[0].1.starts_with(source.bin.as_deref().unwrap()));
    assert_eq!(output.json["images"], source.json["images"]);
    assert_eq!(notes.len(), 1, "{notes:?}");
    source.extra_chunks.clear();
    assert_eq!(rules::check(&source, &output), []);
}

#[test]
fn levels_of_a_gltf_go_into_a_file_with_a_name_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let mut source = with_files(folder.path());
    source.json["images"] = json!([{ "uri": "OUT.lod.bin" }]);
    let (files, _) = files(&source, folder.path(), Container::Gltf);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(rules::check(&source, &output), []);
    assert_eq!(files.beside[0].0, "out.2.lod.bin");
    assert_eq!(output.json["buffers"][2]["uri"], "out.2.lod.bin");
    assert_eq!(files.copied.len(), 4, "{:?}", files.copied);
}

#[test]
fn levels_lie_behind_the_bytes_of_a_buffer_that_others_need() {
    let folder = tempfile::tempdir().unwrap();
    let mut source = square();
    source.container = Container::Gltf;
    let bytes = source.bin.take().unwrap();
    std::fs::write(folder.path().join("a.bin"), &bytes).unwrap();
    source.json["buffers"][0]["uri"] = json!("a.bin");
    // A second mesh in the same buffer, which gets no levels.
    let mesh = source.json["meshes"][0].clone();
    source.json["meshes"].as_array_mut().unwrap().push(mesh);
    source.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1 }));
    let (files, _) = files(&source, folder.path(), Container::Gltf);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(rules::check(&source, &output), []);
    assert_eq!(output.array("buffers").unwrap().len(), 1);
    assert_eq!((files.beside[0].0.as_str(), files.copied.len()), ("out.lod.bin", 0));
    assert!(files.beside[0].1.starts_with(&bytes) && bytes.len() < files.beside[0].1.len());
    assert_eq!(output.json["buffers"][0]["byteLength"], files.beside[0].1.len());
}

#[test]
fn names_are_addresses() {
    let source = square();
    let buffers = Buffers::load(&source, Path::new("")).unwrap();
    let package = Package::new(source, &buffers, Vec::new(), Container::Gltf).unwrap();
    let files = package.finish("a b#é", None, &buffers).unwrap();
    assert_eq!(files.beside[0].0, "a b#é.bin");
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(output.json["buffers"][0]["uri"], "a%20b%23%C3%A9.bin");
}

#[test]
fn a_first_buffer_without_data_leaves_no_room_for_a_bin_chunk() {
    let mut source = square();
    source.container = Container::Gltf;
    let bytes = source.bin.take().unwrap();
    source.json["buffers"] = json!([
        { "byteLength": 9, "extensions": { "EXT_meshopt_compression": { "fallback": true } } },
        { "byteLength": bytes.len(), "uri": data_uri(&bytes) },
    ]);
    for view in source.json["bufferViews"].as_array_mut().unwrap() {
        view["buffer"] = json!(1);
    }
    let (files, _) = files(&source, Path::new(""), Container::Glb);
    let output = Document::parse(&files.main).unwrap();
    assert_eq!(rules::check(&source, &output), []);
    assert_eq!(output.bin, None);
    assert_eq!(output.json["buffers"][0], source.json["buffers"][0]);
    assert_eq!(files.beside.len(), 1);
    source.json["buffers"][0].as_object_mut().unwrap().shift_remove("extensions");
    let buffers = Buffers::load(&source, Path::new("")).unwrap();
    let refused = Package::new(source, &buffers, Vec::new(), Container::Glb).unwrap_err().to_string();
    assert_eq!(refused, "buffers[0]: has no data, and in a GLB it must have some");
}

#[test]
fn images_are_told_by_their_first_bytes() {
    assert_eq!(image_kind(PNG), Some("image/png"));
    assert_eq!(image_kind(b"\xFF\xD8\xFF\xE0"), Some("image/jpeg"));
    assert_eq!(image_kind(b"RIFF....WEBPVP8 "), Some("image/webp"));
    assert_eq!(image_kind(b"\xABKTX 20\xBB\r\n\x1a\n"), Some("image/ktx2"));
    assert_eq!(image_kind(b"....ftypavif"), Some("image/avif"));
    assert_eq!(image_kind(b"GIF89a"), None);
    assert_eq!(image_kind(b""), None);
}
