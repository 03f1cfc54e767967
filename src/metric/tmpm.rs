//! `tmpm`: half-edge contractions in the order of the deviation that each adds to the texture; chart borders stay.
//!
//! P. Sander, J. Snyder, S. Gortler, H. Hoppe, *Texture mapping progressive meshes*, 2001; evaluation thesis, section 2.1.3. One
//! parametrisation serves every level, so that vertices keep their places in it: one end of an edge stays as it is. The
//! price is the deviation between the surfaces just before and after, not accumulated (the paper's section on
//! simplification, after Lindstrom and Turk's memoryless strategy); [`super::aps`] accumulates. Stretch, L2 and L∞, is measured
//! on the levels (`compare::texture`; `lodbake evaluate` tells it).
//!
//! Where the source leaves gaps, or starts from an atlas of its own: the mesh's texture coordinates are the atlas. Its charts'
//! borders are not straightened by moving them in the texture, which would need the pictures to be drawn again; they are
//! taken for straight where a vertex is off the line between its neighbours by at most a fiftieth of its length, and what
//! that moves counts as deviation. Corners, where a border turns by more or several meet, stay for good.

use super::aps::{corner_by_corner, way};
use super::domain::{Domain, Star};
use super::overlay::{Bounds, Patch, overlay, twice};
use super::parts::wedges_fit;
use super::{CostUnit, ErrorMetric, Price};
use crate::mesh::layout::Layout;
use crate::mesh::topology::{Contraction, Topology};
use crate::quadric::{cross, dot, sub};

/// The metric. Placement is always subset.
#[derive(Clone, Debug)]
pub struct Tmpm {
    domain: Domain,
}

/// How far a chart's border may be off its line, as a share of its length.
const STRAIGHT: f64 = 0.02;

impl Tmpm {
    /// Of the first set of texture coordinates.
    pub fn new(surface: &Topology, layout: &Layout, wedge_primitive: &[u32]) -> Self {
        Self { domain: Domain::new(surface, layout, wedge_primitive, STRAIGHT) }
    }

    fn at(&self, surface: &Topology, a: u32, b: u32, keep_second: bool) -> Option<Price> {
        let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
        if !wedges_fit(surface, kept, gone) {
            return None;
        }
        let position = surface.positions[kept as usize];
        let change = self.domain.change(surface, a, b, position, way(surface, a, b, position))?;
        let cost = change.stars.iter().map(deviation).try_fold(0.0, |most, found| Some(f64::max(most, found?)))?;
        Some(Price { cost, position, keep_second })
    }
}

/// The longest displacement between the surfaces before and after, at equal places of the texture; `None`: they do not cover
/// the same part of it.
fn deviation(star: &Star) -> Option<f64> {
    let mut most = 0.0f64;
    if star.sign == 0 {
        corner_by_corner(star, |_| Bounds::default(), &mut |_, found| most = most.max(found.longest()));
        return Some(most);
    }
    let whole = overlay(&star.old, &star.new, f64::from(star.sign), |_, _, cell| most = most.max(cell.longest()));
    // Along a border that is not quite straight a sliver is lost or won.
    (whole || star.off > 0.0).then(|| most + star.off * scale(&star.old))
}

/// Length in space of a unit of the texture, in the mean over some faces.
fn scale(patches: &[Patch]) -> f64 {
    let (mut space, mut texture) = (0.0, 0.0);
    for patch in patches {
        let normal = cross(sub(patch.p[1], patch.p[0]), sub(patch.p[2], patch.p[0]));
        space += dot(normal, normal).sqrt();
        texture += twice(&patch.uv).abs();
    }
    if texture > 0.0 { (space / texture).sqrt() } else { 0.0 }
}

impl ErrorMetric for Tmpm {
    const COST: CostUnit = CostUnit::Length;
    const REFUSES_FOR_NOW: bool = true;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (first, second) = (self.at(surface, a, b, false), self.at(surface, a, b, true));
        match (&first, &second) {
            (Some(x), Some(y)) if y.cost < x.cost => second,
            (None, _) => second,
            _ => first,
        }
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = position == surface.positions[b as usize];
        let kept = if keep_second { b } else { a };
        (position == surface.positions[kept as usize]).then(|| self.at(surface, a, b, keep_second))?
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        surface.classify_edges(done.kept);
    }
}
