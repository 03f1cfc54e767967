//! `qem`: the plane quadric alone, accumulated; attributes are interpolated along the edge.
//!
//! M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, 1997; evaluation thesis, sections 2.1
//! and 2.2: area-weighted planes, optimal point, border planes.

use super::parts::{Planes, best_end, best_place, end_at, follow_edge};
use super::{ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, Topology};

/// The metric.
#[derive(Clone, Debug)]
pub struct Qem {
    placement: Placement,
    planes: Planes,
}

impl Qem {
    /// Prepares the quadrics of the whole surface; `border` weighs the planes at borders and seams.
    pub fn new(surface: &Topology, border: f64, placement: Placement) -> Self {
        Self { placement, planes: Planes::new(surface, border) }
    }
}

impl ErrorMetric for Qem {
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let q = self.planes.combined(a, b);
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        if self.placement == Placement::Subset {
            let (cost, keep_second) = best_end(surface, a, b, [q.eval(pa), q.eval(pb)])?;
            return Some(Price { cost: cost.max(0.0), position: if keep_second { pb } else { pa }, keep_second });
        }
        let (cost, position) = best_place(&q, pa, pb);
        Some(Price { cost, position, keep_second: false })
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = match self.placement {
            Placement::Subset => end_at(surface, a, b, position)?,
            Placement::Optimal => position == surface.positions[b as usize],
        };
        let cost = self.planes.combined(a, b).eval(position).max(0.0);
        Some(Price { cost, position, keep_second })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        self.planes.merge(done);
        follow_edge(surface, done, self.placement);
    }
}
