//! `ias`: the average distance from the planes for each triangle saved, so that sequences of many sub-meshes can be merged.
//!
//! T. Azim, E. Cheslack-Postava, P. Levis, *Instance-aware simplification of 3D polygonal meshes*, 2015 (IAS): the quadric
//! error, a sub-mesh is simplified once and every instance refers to it. Over a whole scene the error of a contraction grows
//! with the largest scale among the instances, and what it saves with their number:
//! [`crate::allocate::Allocation::of_instances`] merges sequences of this metric so. Attributes follow the edge.
//!
//! Where the source leaves gaps: the error is a length (average distance), as only a length can be scaled by an instance's
//! transform and compared between sub-meshes of different density; a contraction that saves no triangle counts as one.

use super::parts::{Planes, average_distance, best_end, best_place, end_at, follow_edge};
use super::{CostUnit, ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, Topology};

/// The metric.
#[derive(Clone, Debug)]
pub struct Ias {
    placement: Placement,
    planes: Planes,
}

impl Ias {
    /// Prepares the quadrics of the whole surface; `border` weighs the planes at borders and seams.
    pub fn new(surface: &Topology, border: f64, placement: Placement) -> Self {
        Self { placement, planes: Planes::new(surface, border) }
    }

    fn cost(&self, surface: &Topology, a: u32, b: u32, squares: f64) -> f64 {
        let saved = surface.ring(a).iter().filter(|corner| surface.faces[corner.face()].corner(b).is_some()).count();
        average_distance(squares, self.planes.area(a, b)) / saved.max(1) as f64
    }
}

impl ErrorMetric for Ias {
    const COST: CostUnit = CostUnit::Length;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let q = self.planes.combined(a, b);
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let (squares, position, keep_second) = if self.placement == Placement::Subset {
            let (squares, keep_second) = best_end(surface, a, b, [q.eval(pa), q.eval(pb)])?;
            (squares, if keep_second { pb } else { pa }, keep_second)
        } else {
            let (squares, position) = best_place(&q, pa, pb);
            (squares, position, false)
        };
        Some(Price { cost: self.cost(surface, a, b, squares), position, keep_second })
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = match self.placement {
            Placement::Subset => end_at(surface, a, b, position)?,
            Placement::Optimal => position == surface.positions[b as usize],
        };
        let squares = self.planes.combined(a, b).eval(position);
        Some(Price { cost: self.cost(surface, a, b, squares), position, keep_second })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        self.planes.merge(done);
        follow_edge(surface, done, self.placement);
    }
}
