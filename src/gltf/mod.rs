//! glTF in and out: the only room that knows the format and its compression crates.
//!
//! `document` holds a file without loss; `buffers`, `accessor` and `decode` turn its bytes into numbers; `read` puts
//! a whole scene together. `lod` appends levels to a document (`write` the binary data, `level_mesh` the meshes,
//! `follow` whoever pointed at them), `package` makes files of it, and `rules` checks them.
//! `library` keeps geometry in files that scenes share. `share` writes instances that were found, `split` takes repeated parts out of
//! meshes, `fold` makes batches of nodes that show the same mesh.

pub mod accessor;
mod anchors;
pub mod buffers;
mod carry;
mod coverage;
pub mod decode;
pub mod dependencies;
pub mod document;
mod encode;
pub mod error;
#[cfg(test)]
mod fixture;
pub mod fold;
mod follow;
mod host;
pub mod instancing;
pub mod json;
mod level_mesh;
pub mod library;
pub mod lod;
mod notes;
pub mod package;
pub mod places;
pub mod primitive;
pub mod read;
pub mod rules;
pub mod scene;
pub mod share;
pub mod similarity;
pub mod split;
pub mod structure;
pub mod triangles;
pub mod uri;
pub mod views;
pub mod write;
