//! Makes the sample scenes. `cargo run --example make_scenes` rewrites `scenes/`; the same bytes on every machine.
//!
//! ```text
//! random, noise, turn ──▶ surface, solid, field ──▶ coats (textures) ──▶ props, plaza, figure ──▶ gltf ──▶ scenes/
//! ```

#![expect(clippy::disallowed_methods, reason = "every vector normalised here is the program's own and has a length")]

mod coats;
mod field;
mod figure;
mod gltf;
mod noise;
mod plaza;
mod props;
mod random;
mod raster;
mod solid;
mod surface;
mod turn;

use std::path::{Path, PathBuf};

/// One file of `scenes/`.
pub struct File {
    path: String,
    bytes: Vec<u8>,
}

impl File {
    /// `path` is relative to `scenes/`, with forward slashes.
    pub fn new(path: &str, bytes: Vec<u8>) -> Self {
        Self { path: path.to_owned(), bytes }
    }
}

/// Every file that the program makes.
fn files() -> Vec<File> {
    let mut files = props::files();
    files.extend(plaza::files());
    files.extend(figure::files());
    files
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn main() -> std::io::Result<()> {
    for file in files() {
        let path = folder().join(&file.path);
        std::fs::create_dir_all(path.parent().expect("a joined path has a parent"))?;
        std::fs::write(path, &file.bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Files below a folder, relative to it, with forward slashes; notes for people left out.
    fn found(folder: &Path, prefix: &str, into: &mut BTreeSet<String>) {
        for entry in std::fs::read_dir(folder).expect("the scenes are committed") {
            let entry = entry.expect("a folder that was just opened can be read");
            let path = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                found(&entry.path(), &format!("{path}/"), into);
            } else if !path.ends_with("README.md") {
                into.insert(path);
            }
        }
    }

    #[test]
    fn committed_scenes_are_what_the_program_makes() {
        let mut committed = BTreeSet::new();
        found(&folder(), "", &mut committed);
        let made = files();
        assert_eq!(committed, made.iter().map(|f| f.path.clone()).collect(), "run `cargo run --example make_scenes`");
        let bytes: usize = made.iter().map(|f| f.bytes.len()).sum();
        assert!(bytes < 10_000_000, "{bytes} bytes are more than a clone should carry");
        for file in made {
            let bytes = std::fs::read(folder().join(&file.path)).expect("listed above");
            assert!(bytes == file.bytes, "{} differs: run `cargo run --example make_scenes`", file.path);
        }
    }
}
