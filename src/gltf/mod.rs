//! glTF in and out: the only room that knows the format and its compression crates.
//!
//! `document` holds a file without loss; `buffers`, `accessor` and `decode` turn its bytes into numbers; `read` puts
//! a whole scene together.

pub mod accessor;
pub mod buffers;
pub mod decode;
pub mod dependencies;
pub mod document;
pub mod error;
pub mod json;
pub mod primitive;
pub mod read;
pub mod scene;
pub mod structure;
pub mod triangles;
pub mod uri;
pub mod views;
