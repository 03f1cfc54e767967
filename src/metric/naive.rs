//! `naive`: the shortest edge first, contracted to its middle; the baseline that the others are held against.
//!
//! Evaluation thesis, section 2.1.1 and figure 2.3, where it stands beside the quadric error. The cost is the length of
//! the edge, so it knows nothing of shape: borders shrink and corners go. Attributes follow the edge. With subset
//! placement, which the source does not have, the first vertex stays, or the second where only that one can.

use super::parts::{best_end, end_at, follow_edge};
use super::{CostUnit, ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, Topology};
use crate::quadric::{dot, lerp, sub};

/// The metric.
#[derive(Clone, Copy, Debug)]
pub struct Naive {
    placement: Placement,
}

impl Naive {
    /// It keeps no state.
    pub fn new(placement: Placement) -> Self {
        Self { placement }
    }
}

fn length(surface: &Topology, a: u32, b: u32) -> f64 {
    let along = sub(surface.positions[b as usize], surface.positions[a as usize]);
    dot(along, along).sqrt()
}

impl ErrorMetric for Naive {
    const COST: CostUnit = CostUnit::Length;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let cost = length(surface, a, b);
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        if self.placement == Placement::Subset {
            let (cost, keep_second) = best_end(surface, a, b, [cost; 2])?;
            return Some(Price { cost, position: if keep_second { pb } else { pa }, keep_second });
        }
        Some(Price { cost, position: lerp(pa, pb, 0.5), keep_second: false })
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = match self.placement {
            Placement::Subset => end_at(surface, a, b, position)?,
            Placement::Optimal => false,
        };
        Some(Price { cost: length(surface, a, b), position, keep_second })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        follow_edge(surface, done, self.placement);
    }
}
