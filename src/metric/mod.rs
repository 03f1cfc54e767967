//! What it costs to contract a pair of vertices: one metric, one file, its paper in the header.
//!
//! A metric reads the surface, keeps state of its own and writes the wedge values of a merged vertex. It never
//! changes topology, and it does not know in which order pairs are taken.

pub mod aps;
mod clouds;
mod domain;
pub mod gaps;
pub mod ias;
pub mod its;
pub mod its_paper;
pub mod naive;
mod overlay;
mod parts;
pub mod qem;
pub mod qem_attributes;
pub mod tmpm;

use serde::{Deserialize, Serialize};

use crate::mesh::topology::{Contraction, Part, Topology};

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

/// What the costs of a metric are, in the unit frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostUnit {
    /// Squared distances times areas: the fourth power of a length.
    SquareTimesArea,
    /// A length.
    Length,
}

/// Prices contractions and follows them.
pub trait ErrorMetric {
    /// What its costs are.
    const COST: CostUnit = CostUnit::SquareTimesArea;

    /// A refusal may end when anything beside the pair changes: the pair is tried again then, as illegal ones are.
    const REFUSES_FOR_NOW: bool = false;

    /// Parts that no edge connects may be joined: the driver offers pairs that are near each other.
    const JOINS: bool = false;

    /// The pair `a`, `b` is about to be priced for good: brings up to date what was put off.
    fn prepare(&mut self, _surface: &Topology, _a: u32, _b: u32) {}

    /// Pairs of these vertices will be priced soon. Reads what that needs, all at once: a machine waits for many places in
    /// memory no longer than for one. Changes nothing.
    fn touch(&self, _surface: &Topology, _vertices: impl Iterator<Item = u32>) {}

    /// What contracting `a` and `b` costs; `None` = refused.
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price>;

    /// What contracting them costs if the vertex must go to `position`; `None` = refused.
    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price>;

    /// The contraction is about to be done: notes what the surface will no longer tell.
    fn contracting(&mut self, _surface: &Topology, _kept: u32, _gone: u32, _price: &Price) {}

    /// How far the surface is at most from the source after the last contraction, unit frame, in the sense of the metric's
    /// paper; `None` = the metric makes no such statement. Never falls.
    fn bound(&self) -> Option<f64> {
        None
    }

    /// The contraction has been done in `surface`: set the values of the wedges of the vertex that stays, and fold
    /// the state.
    fn contracted(&mut self, surface: &mut Topology, done: &Contraction);
}

/// A metric that knows how far a pair would move the surface before it looks at attributes.
pub trait Staged: ErrorMetric {
    /// The geometric error alone, a length in the unit frame; `None` = refused.
    fn geometric_error(&self, surface: &Topology, a: u32, b: u32) -> Option<f64>;
}

/// A metric that can work on parts of a surface, side by side, and begin again on what they leave.
pub trait Parted: ErrorMetric + Sync + Sized {
    /// Builds the state from the surface as it is. Comes before all else.
    fn begin(&mut self, surface: &Topology);

    /// The metric for a part of the surface, which has yet to begin.
    fn part(&self, part: &Part) -> Self;
}
