//! Compressed inputs: `EXT_meshopt_compression`, `KHR_meshopt_compression` and `KHR_draco_mesh_compression`.
//!
//! From compressed bytes to the bytes or numbers they stand for; nothing about accessors or scenes.

pub mod draco;
pub mod filters;
pub mod meshopt;
