//! Parts that occur more than once in the meshes of a scene, taken out of them and shown as instances.
//!
//! ```text
//! node N: mesh k = rest + 200 bolts        node N (all that is its own stays): mesh k = rest
//!                                   ──▶     ├─ appended child: mesh p (appended: one bolt), the transform to the first
//!                                           └─ … 200 children
//! ```
//!
//! A mesh keeps its place, its primitives, their materials and the order of what is left. Its accessors keep their places, too, and
//! hold fewer vertices; `share::compact` takes the bytes out. A primitive never loses all of its triangles: whoever plans sees to that.
//! `obstacle` tells what must stay whole. Does not know how it was found out that parts are alike.

mod domains;
mod obstacle;
mod plan;
#[cfg(test)]
mod tests;
mod write;

use super::buffers::Buffers;
use super::document::Document;
use super::error::DocumentError;
use super::similarity::Similarity;

pub use obstacle::Splitting;

/// Some triangles of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Index in `meshes`.
    pub mesh: usize,
    /// By primitive, ascending: its triangles that belong to the part, by their number in the list that was read, ascending.
    pub triangles: Vec<(usize, Vec<u32>)>,
}

impl Part {
    /// Triangles in all.
    pub fn count(&self) -> usize {
        self.triangles.iter().map(|(_, triangles)| triangles.len()).sum()
    }

    /// Its first triangle: no other part of the mesh has it.
    pub fn place(&self) -> (usize, u32) {
        self.triangles.first().map_or((0, 0), |(primitive, triangles)| (*primitive, triangles[0]))
    }
}

/// A part with the places where it is to be shown.
#[derive(Clone, Debug)]
pub struct Repeated {
    /// Gives the geometry.
    pub of: Part,
    /// A mesh that will be left with `of` alone; `None`: a new one is made.
    pub mesh: Option<usize>,
    /// What goes, and what takes `of` there.
    pub occurrences: Vec<(Part, Similarity)>,
}

/// What was done.
#[derive(Debug)]
pub struct Split {
    /// The document's buffers, without the bytes that nothing needs any more.
    pub buffers: Buffers,
    /// For each group the mesh that shows it.
    pub meshes: Vec<usize>,
    /// Nodes appended.
    pub nodes: usize,
    /// Bytes of all buffers, before and after.
    pub bytes: (u64, u64),
}

/// Takes the parts out of meshes that [`Splitting`] lets take apart, and shows them on nodes.
pub fn split(document: &mut Document, buffers: &Buffers, groups: &[Repeated]) -> Result<Split, DocumentError> {
    let plan = plan::Plan::new(document, buffers, groups)?;
    write::write(document, buffers, plan, groups)
}
