//! A file, or one level of it, ready to be drawn and measured.

use std::path::{Path, PathBuf};

use super::Facts;
use crate::appearance::assemble;
use crate::appearance::drawable::Drawable;
use crate::compare::{Soup, TextureStretch};
use crate::gltf::dependencies::DependencyKind;
use crate::gltf::document::DocumentError;
use crate::gltf::error::ReadError;
use crate::obj;

/// Something to be compared.
#[derive(Debug)]
pub struct Subject {
    /// As it was given.
    pub name: String,
    /// The level that is shown; 0 is the finest.
    pub level: usize,
    /// Its triangles.
    pub drawable: Drawable,
    bytes: u64,
}

/// A subject cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum SubjectError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The nodes make no sense.
    #[error("failed to read `{path}`: {cause}")]
    Nodes {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        cause: DocumentError,
    },
    /// There is nothing to see.
    #[error("`{0}` has no triangle in its default scene")]
    Empty(String),
}

impl SubjectError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Read(error) => error.hint(),
            Self::Nodes { cause, .. } => cause.hint(),
            Self::Empty(_) => None,
        }
    }
}

/// Path and level of `FILE` or `FILE@LEVEL`. A file that has an `@` in its own name wins.
fn parse(written: &str) -> (&Path, usize) {
    let level = written.rsplit_once('@').filter(|_| !Path::new(written).exists());
    match level.and_then(|(path, level)| Some((path, level.parse().ok()?))) {
        Some((path, level)) => (Path::new(path), level),
        None => (Path::new(written), 0),
    }
}

impl Subject {
    /// Reads `FILE` or `FILE@LEVEL`: level k of every `MSFT_lod` group of its default scene, the coarsest where there
    /// are fewer.
    pub fn load(written: &str) -> Result<Self, SubjectError> {
        let (path, level) = parse(written);
        let scene = obj::read_any(path)?;
        let looks = assemble::looks(&scene, path.parent().unwrap_or(Path::new("")));
        let drawable = assemble::scene(&scene, looks, level)
            .map_err(|cause| SubjectError::Nodes { path: path.to_owned(), cause })?;
        if drawable.triangles() == 0 {
            return Err(SubjectError::Empty(written.to_owned()));
        }
        let buffers = scene.dependencies.iter().filter(|d| d.kind == DependencyKind::Buffer).map(|d| d.path.as_path());
        // What cannot be asked for its size any more counts nothing.
        let sizes = std::iter::once(path).chain(buffers).filter_map(|path| path.metadata().ok()).map(|meta| meta.len());
        Ok(Self { name: written.to_owned(), level, drawable, bytes: sizes.sum() })
    }

    /// `soup` is its own.
    pub(super) fn facts(&self, soup: &Soup) -> Facts {
        let notes = self.drawable.looks.notes.iter().map(|note| format!("{}: {}", note.place, note.text));
        Facts {
            name: self.name.clone(),
            level: self.level as u64,
            triangles: self.drawable.triangles(),
            triangles_stored: self.drawable.parts.iter().map(|part| part.triangles() as u64).sum(),
            vertices: self.drawable.parts.iter().map(|part| part.positions.len() as u64).sum(),
            bytes: self.bytes,
            stretch: TextureStretch::measure(soup),
            notes: notes.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_the_number_behind_the_last_at() {
        assert_eq!(parse("a/lamp.glb"), (Path::new("a/lamp.glb"), 0));
        assert_eq!(parse("a/lamp.glb@3"), (Path::new("a/lamp.glb"), 3));
        assert_eq!(parse("a@2/lamp.glb"), (Path::new("a@2/lamp.glb"), 0));
        assert_eq!(parse("lamp@2.glb@1"), (Path::new("lamp@2.glb"), 1));
    }

    #[test]
    fn a_file_with_an_at_in_its_name_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp@2");
        std::fs::write(&path, "").unwrap();
        assert_eq!(parse(path.to_str().unwrap()), (path.as_path(), 0));
    }
}
