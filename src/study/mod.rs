//! The evaluation as a tool: meshes × algorithms × targets, measured again and again and compared by tests.
//!
//! Knows nothing of arguments and terminals.

pub mod statistics;
