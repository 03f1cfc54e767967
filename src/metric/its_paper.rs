//! `its-paper`: the instanced-model paper's Algorithm 1 as it is written, for reproducing its tables.
//!
//! S. Tariq, A. U. Rahman, T. Azim, R. G. Khan, *Instanced model simplification using combined geometric and
//! appearance-related metric* (ITS), section 3. A pair is valid if it is an edge **and** shorter than a threshold; the
//! geometric error decides first, attributes are looked at only of pairs within the limit; then point clouds and the
//! unified error; the least pair collapses onto the end with the smaller quadric error. Metric `its` mends what the paper
//! names as weak; this one does not.
//!
//! Where the paper leaves gaps: planes and points are weighted by area, and the geometric error is the average distance, so
//! that the unified error has one unit (as in the evaluation thesis, section 2.1); the limit of the geometric error is the
//! threshold itself; an end to which the other one's attributes have no counterpart cannot stay, and triangles may not
//! turn over, as with every metric here. The threshold's steps are in [`crate::simplify`].

use super::clouds::Clouds;
use super::gaps::differences_at_end;
use super::parts::{Planes, average_distance, best_end, end_at};
use super::{CostUnit, ErrorMetric, Price, Staged};
use crate::mesh::layout::Layout;
use crate::mesh::topology::{Contraction, Topology};

/// The metric. Placement is always subset.
#[derive(Clone, Debug)]
pub struct ItsPaper {
    planes: Planes,
    clouds: Clouds,
}

impl ItsPaper {
    /// Prepares quadrics and clouds; `border` weighs the planes at borders and seams.
    pub fn new(surface: &Topology, layout: &Layout, wedge_primitive: &[u32], border: f64) -> Self {
        Self { planes: Planes::new(surface, border), clouds: Clouds::new(surface, layout, wedge_primitive) }
    }

    /// The end that stays, and the average distance there.
    fn end(&self, surface: &Topology, a: u32, b: u32) -> Option<(f64, bool)> {
        let q = self.planes.combined(a, b);
        let costs = [a, b].map(|end| q.eval(surface.positions[end as usize]));
        let (squares, keep_second) = best_end(surface, a, b, costs)?;
        Some((average_distance(squares, self.planes.area(a, b)), keep_second))
    }

    fn unified(&self, surface: &Topology, a: u32, b: u32, geometric: f64, keep_second: bool) -> Option<Price> {
        let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
        let differences = differences_at_end(&self.clouds, surface, kept, gone)?;
        let cost = self.clouds.unified(self.planes.area(a, b), geometric, &differences);
        Some(Price { cost, position: surface.positions[kept as usize], keep_second })
    }
}

impl Staged for ItsPaper {
    fn geometric_error(&self, surface: &Topology, a: u32, b: u32) -> Option<f64> {
        self.end(surface, a, b).map(|(geometric, _)| geometric)
    }
}

impl ErrorMetric for ItsPaper {
    const COST: CostUnit = CostUnit::Length;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (geometric, keep_second) = self.end(surface, a, b)?;
        self.unified(surface, a, b, geometric, keep_second)
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = end_at(surface, a, b, position)?;
        let squares = self.planes.combined(a, b).eval(position);
        self.unified(surface, a, b, average_distance(squares, self.planes.area(a, b)), keep_second)
    }

    fn contracted(&mut self, _surface: &mut Topology, done: &Contraction) {
        self.planes.merge(done);
        self.clouds.merge(done);
    }
}
