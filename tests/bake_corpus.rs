//! Bakes the whole corpus with the program itself and checks every output against its source: all rules hold, nothing
//! is lost, every level can be read again.

#![allow(clippy::print_stdout)] // how much was checked is said aloud

mod corpus;

use corpus::{corpus, scenes};
use lodbake::gltf::read::read;
use lodbake::gltf::scene::Scene;
use lodbake::gltf::{json, rules};
use std::path::Path;

/// Levels in both kinds of storage, in both containers.
fn pipeline(corpus: &Path, output: &str, layout: &str) -> String {
    format!(
        "input = {input:?}\n\
         output = '{output}'\n\
         layout = '{layout}'\n\
         appearance.size = 48\n\
         include = ['features/**/*.gl*', 'scenes/**/*.gl*']\n\
         lod = [{{ ratio = 0.5 }}, {{ ratio = 0.25 }}, {{ ratio = 0.1 }}]\n\
         [[override]]\n\
         match = 'features/**'\n\
         storage = 'shared'\n\
         [[override]]\n\
         match = ['**/KHR_t*/**', '**/uv1*/**', '**/skin*/**']\n\
         format = 'glb'\n",
        input = corpus.to_str().unwrap()
    )
}

/// The source of an output, which may have been in the other container.
fn source(corpus: &Path, output: &Path) -> Option<Scene> {
    let same = corpus.join(output);
    let candidates = [same.clone(), same.with_extension("gltf"), same.with_extension("glb")];
    read(candidates.iter().find(|path| path.is_file())?).ok()
}

/// Levels of a scene and their triangles: none may be empty, none larger than the level before it.
fn levels(scene: &Scene, place: &str) -> usize {
    let nodes = scene.document.array("nodes").unwrap();
    let mesh = |node: usize| &scene.meshes[json::index(&nodes[node], "mesh", place).unwrap().unwrap()];
    let mut count = 0;
    for (i, node) in nodes.iter().enumerate() {
        let Some(lod) = json::extension(node, "MSFT_lod") else { continue };
        // Where morph weights are animated the mesh is one node further down.
        let below = json::array(node, "children", place).unwrap().first().and_then(serde_json::Value::as_u64);
        let shown = if node.get("mesh").is_some() { i } else { below.unwrap() as usize };
        let mut before = mesh(shown).triangles();
        for id in json::array(lod, "ids", place).unwrap() {
            let now = mesh(id.as_u64().unwrap() as usize).triangles();
            assert!(now > 0 && now <= before, "{place}: nodes[{id}] has {now} triangles after {before}");
            before = now;
            count += 1;
        }
    }
    count
}

#[test]
fn every_bake_of_the_corpus_keeps_the_rules() {
    let Some(corpus) = corpus() else { return };
    let folder = tempfile::tempdir().unwrap();
    let bake = |output: &str, layout: &str| {
        let file = folder.path().join("pipeline.toml");
        std::fs::write(&file, pipeline(&corpus, output, layout)).unwrap();
        let run = assert_cmd::Command::cargo_bin("lodbake").unwrap().arg(&file).output().unwrap();
        String::from_utf8_lossy(&run.stderr).into_owned()
    };
    let told = bake("out", "self-contained");
    let output = folder.path().join("out");
    let (mut checked, mut total) = (0, 0);
    for path in scenes(&output) {
        let below = path.strip_prefix(&output).unwrap();
        let place = below.display().to_string();
        let before = source(&corpus, below).unwrap_or_else(|| panic!("{place} has no source"));
        let after = read(&path).unwrap_or_else(|error| panic!("{error}"));
        let violations = rules::check(&before.document, &after.document);
        assert!(violations.is_empty(), "{place}: {violations:#?}");
        checked += 1;
        total += levels(&after, &place);
    }
    println!("{checked} outputs, {total} levels");
    // Where the bytes are changes nothing of what is read.
    bake("parted", "library");
    let mut shared = 0;
    for path in scenes(&output) {
        let below = path.strip_prefix(&output).unwrap();
        let (one, other) = (read(&path).unwrap(), read(&folder.path().join("parted").join(below)).unwrap());
        let place = below.display();
        assert!(one.meshes == other.meshes, "{place}: other geometry");
        for (name, value) in one.document.json.as_object().unwrap() {
            if !["accessors", "buffers", "bufferViews", "images", "meshes"].contains(&name.as_str()) {
                assert_eq!(Some(value), other.document.json.get(name), "{place}: {name}");
            }
        }
        shared += other.dependencies.iter().filter(|file| file.uri.contains("lodbake-library/")).count();
    }
    println!("{shared} references to the library");
    assert!(shared > 200, "{shared}");
    assert!(checked > 100 && total > 1000, "{checked} outputs, {total} levels\n{told}");
}
