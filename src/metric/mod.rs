//! What it costs to contract a pair of vertices: one metric, one file, its paper in the header.
//!
//! A metric reads the surface, keeps state of its own and writes the wedge values of a merged vertex. It never
//! changes topology, and it does not know in which order pairs are taken.

pub mod its;
pub mod qem;

use serde::{Deserialize, Serialize};

use crate::mesh::topology::{Contraction, Topology};

/// Where the merged vertex goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Placement {
    /// Wherever the error is least; attributes follow.
    Optimal,
    /// Onto one of the two ends, whose attributes stay as they are: levels can share the source's vertices.
    Subset,
}

/// The price of a contraction.
#[derive(Clone, Copy, Debug)]
pub struct Price {
    /// Ranks pairs; metrics are not comparable with each other. Not negative.
    pub cost: f64,
    /// Where the vertex that stays goes, unit frame.
    pub position: [f64; 3],
    /// The second vertex of the pair stays, not the first (matters for [`Placement::Subset`] alone).
    pub keep_second: bool,
}

/// Prices contractions and follows them.
pub trait ErrorMetric {
    /// The pair `a`, `b` is about to be priced for good: brings up to date what was put off.
    fn prepare(&mut self, _surface: &Topology, _a: u32, _b: u32) {}

    /// Pairs of these vertices will be priced soon. Reads what that needs, all at once: a machine waits for many places in
    /// memory no longer than for one. Changes nothing.
    fn touch(&self, _surface: &Topology, _vertices: impl Iterator<Item = u32>) {}

    /// What contracting `a` and `b` costs; `None` = refused.
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price>;

    /// What contracting them costs if the vertex must go to `position`; `None` = refused.
    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price>;

    /// The contraction has been done in `surface`: set the values of the wedges of the vertex that stays, and fold
    /// the state.
    fn contracted(&mut self, surface: &mut Topology, done: &Contraction);
}
