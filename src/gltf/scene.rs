//! A scene that was read: the lossless document beside its meshes as numbers.
//!
//! Types alone; `read` and `crate::obj` fill them. Later stages see nothing else of a source file.

use super::buffers::Buffers;
use super::dependencies::Dependency;
use super::document::Document;
use crate::mesh::Primitive;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Everything a later stage may ask of one source file.
#[derive(Debug)]
pub struct Scene {
    /// The file without loss.
    pub document: Document,
    /// The bytes its buffers stand for.
    pub buffers: Buffers,
    /// One for each entry of `meshes`, in order.
    pub meshes: Vec<SourceMesh>,
    /// External files the document refers to, sorted by address.
    pub dependencies: Vec<Dependency>,
    /// What was odd but could be read.
    pub warnings: Vec<Warning>,
}

/// One entry of `meshes`.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceMesh {
    /// Index in `meshes`.
    pub index: usize,
    /// `name`, if it has one.
    pub name: Option<String>,
    /// One for each entry of `primitives`, in order.
    pub primitives: Vec<SourcePrimitive>,
    /// For primitives that kept only a part of their accessors' vertices (because their triangles use fewer than
    /// half): which vertex of the source each vertex was. By index in `primitives`.
    pub vertex_maps: BTreeMap<usize, Vec<u32>>,
}

impl SourceMesh {
    /// The triangle primitives with their indices in `primitives`.
    pub fn triangle_primitives(&self) -> impl Iterator<Item = (usize, &Primitive)> {
        self.primitives.iter().enumerate().filter_map(|(i, p)| match p {
            SourcePrimitive::Triangles(primitive) => Some((i, primitive)),
            SourcePrimitive::PassThrough { .. } => None,
        })
    }

    /// Indices into the vertices of a primitive, as indices into the vertices of its accessors.
    pub fn source_indices<'a>(&self, primitive: usize, indices: &'a [u32]) -> Cow<'a, [u32]> {
        match self.vertex_maps.get(&primitive) {
            None => Cow::Borrowed(indices),
            Some(map) => indices.iter().map(|&i| map[i as usize]).collect(),
        }
    }

    /// Triangles of all primitives that have levels.
    pub fn triangles(&self) -> usize {
        self.triangle_primitives().map(|(_, p)| p.triangles()).sum()
    }
}

/// One entry of a mesh's `primitives`.
#[derive(Clone, Debug, PartialEq)]
pub enum SourcePrimitive {
    /// Triangles: a list, whatever the source's mode.
    Triangles(Primitive),
    /// Stays as it is at every level.
    PassThrough {
        /// Why it gets no levels: `lines`, `no POSITION`, …
        reason: String,
    },
}

/// Something odd that did not prevent reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// JSON place, as in [`super::document::DocumentError`].
    pub place: String,
    /// What is odd, in words.
    pub text: String,
}
