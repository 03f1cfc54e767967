//! lodbake: the build tool for levels of detail.
//!
//! ```text
//! scan ──▶ index ──▶ read ──▶ identify ──▶ plan ──▶ work ──▶ emit ──▶ report
//! folder   stat     changed   unique      keys     look up,  scenes   facts,
//!          only     scenes    meshes +    per      simplify, with     budgets
//!                   only      instances   mesh     store     LODs
//! ```
//!
//! The modules stand in the order of the data flow; a module uses only those above it (`tests/layers.rs` checks).
//! `mesh` to `allocate` are pure: no I/O, no clock, no randomness; the same input gives the same bytes everywhere.

pub mod quadric;
pub mod mesh;
pub mod metric;
pub mod simplify;
pub mod distance;
pub mod compare;
pub mod allocate;
pub mod lod;
pub mod config;
pub mod scan;
pub mod gltf;
pub mod obj;
pub mod identify;
pub mod key;
pub mod appearance;
pub mod index;
pub mod plan;
pub mod cache;
pub mod progress;
pub mod work;
pub mod emit;
pub mod report;
pub mod budget;
pub mod difference;
pub mod evaluation;
pub mod page;
pub mod publish;
pub mod study;
pub mod reproduction;
pub mod command;
pub mod cli;
