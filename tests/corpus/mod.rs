//! The folder of real assets that some tests run over. It is no part of the project: licences differ.

#![allow(clippy::print_stdout, dead_code)] // a test that skips must say so; not every test uses all of this

use std::path::{Path, PathBuf};

/// The corpus, if this machine has it. CI must have it.
pub fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("LODBAKE_CORPUS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder.canonicalize().expect("the folder is there"));
    }
    assert!(std::env::var_os("CI").is_none(), "CI needs the corpus: set LODBAKE_CORPUS");
    println!("SKIPPED: there is no corpus at `{}`; set LODBAKE_CORPUS", folder.display());
    None
}

/// All files below a folder with one of these extensions, in a stable order.
pub fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).expect("a readable folder") {
            let path = entry.expect("a readable entry").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// All glTF scenes below a folder, in a stable order.
pub fn scenes(folder: &Path) -> Vec<PathBuf> {
    files(folder, &["gltf", "glb"])
}
