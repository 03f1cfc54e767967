//! `gaps`: average distance and point clouds of attributes in one error; joins parts that no edge connects.
//!
//! C. Erikson, D. Manocha, *GAPS: general and automatic polygonal simplification*, 1999; the instanced-model paper (ITS),
//! section 3.3 restates the unified error. The driver offers pairs of vertices closer than a threshold that doubles
//! whenever everything else costs more than it; the optimal place is that of the quadric; a merged vertex is projected on the
//! faces around it as they were before, side by side of each discontinuity, and takes the attributes found there.
//!
//! Where the source leaves gaps:
//! - *Area preservation.* The change ΔA of the area of the faces around the pair counts as `ΔA²` beside the quadric, which is
//!   an area times a squared distance as well: thin sheets that fall together and parts that vanish cost what they were.
//! - *Scale of attributes.* A difference of 1, times the configured weight, is a distance of one radius (`metric::clouds`).
//! - *Error limit.* The threshold itself is the limit: joining parts is tried where it moves them less than the next
//!   contraction would err.
//! - *Bound.* The largest unified error of all contractions so far. As in the paper it is an approximate bound, from
//!   averages: the distance at which levels may be switched, not a guarantee.
//! - *Subset placement.* Pairs without an edge are not joined: the source's vertices have no attributes for it.

use super::clouds::{Clouds, Differences};
use super::parts::{Classes, Planes, average_distance, best_place, wedges_fit};
use super::{CostUnit, ErrorMetric, Placement, Price};
use crate::mesh::layout::Layout;
use crate::mesh::topology::{Contraction, NEXT, PREVIOUS, Topology};
use crate::quadric::{cross, dot, nearest_on_triangle, sub};

/// The metric.
#[derive(Clone, Debug)]
pub struct Gaps {
    placement: Placement,
    planes: Planes,
    clouds: Clouds,
    /// Values of the wedges of the pair that is being contracted.
    pending: Vec<(u32, Vec<f32>)>,
    largest: f64,
}

impl Gaps {
    /// Prepares quadrics and clouds; `border` weighs the planes at borders and seams.
    pub fn new(
        surface: &Topology,
        layout: &Layout,
        wedge_primitive: &[u32],
        border: f64,
        placement: Placement,
    ) -> Self {
        let (planes, clouds) = (Planes::new(surface, border), Clouds::new(surface, layout, wedge_primitive));
        Self { placement, planes, clouds, pending: Vec::new(), largest: 0.0 }
    }

    /// The geometric error at `position`: average distance, the change of area included.
    fn geometric(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> f64 {
        let change = area_change(surface, a, b, position);
        let squares = self.planes.combined(a, b).eval(position).max(0.0) + change * change;
        average_distance(squares, self.planes.area(a, b))
    }

    fn optimal(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let classes = Classes::new(surface, a, b)?;
        let mut differences = Differences::default();
        for class in 0..classes.count {
            let values = projected(surface, [a, b], &classes, class, position);
            classes.of(class).for_each(|wedge| self.clouds.differ(wedge, &values, &mut differences));
        }
        let geometric = self.geometric(surface, a, b, position);
        let cost = self.clouds.unified(self.planes.area(a, b), geometric, &differences);
        Some(Price { cost, position, keep_second: false })
    }

    /// Merging `gone` into `kept` with everything at `kept` as it is.
    fn subset(&self, surface: &Topology, kept: u32, gone: u32) -> Option<f64> {
        if !wedges_fit(surface, kept, gone) {
            return None;
        }
        let differences = differences_at_end(&self.clouds, surface, kept, gone)?;
        let geometric = self.geometric(surface, kept, gone, surface.positions[kept as usize]);
        Some(self.clouds.unified(self.planes.area(kept, gone), geometric, &differences))
    }
}

/// What the clouds of two vertices differ from the values of `kept`, into which the wedges of `gone` merge.
pub(super) fn differences_at_end(clouds: &Clouds, surface: &Topology, kept: u32, gone: u32) -> Option<Differences> {
    let pairs = surface.joined_wedges(kept, gone)?;
    let mut differences = Differences::default();
    for wedge in surface.wedges(gone) {
        let partner = pairs.iter().find(|p| p[1] == wedge)?[0];
        clouds.differ(wedge, surface.value(partner), &mut differences);
    }
    surface.wedges(kept).for_each(|wedge| clouds.differ(wedge, surface.value(wedge), &mut differences));
    Some(differences)
}

/// By how much the area of the faces around the pair changes.
fn area_change(surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> f64 {
    let twice = |p: [[f64; 3]; 3]| {
        let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        dot(normal, normal).sqrt()
    };
    let mut change = 0.0;
    for (vertex, other) in [(a, b), (b, a)] {
        for corner in surface.ring(vertex) {
            let face = &surface.faces[corner.face()];
            let mut p = surface.corners(face);
            let before = twice(p);
            if [NEXT, PREVIOUS].iter().any(|step| face.v[step[corner.at()]] == other) {
                // It is in both rings.
                change -= if vertex == a { before } else { 0.0 };
                continue;
            }
            p[corner.at()] = position;
            change += twice(p) - before;
        }
    }
    0.5 * change
}

/// Values at `position` projected on the faces of one class around the pair, as they are.
fn projected(surface: &Topology, pair: [u32; 2], classes: &Classes, class: usize, position: [f64; 3]) -> Vec<f32> {
    let mut best: Option<(f64, usize, [f64; 3])> = None;
    for vertex in pair {
        for corner in surface.ring(vertex) {
            let face = &surface.faces[corner.face()];
            if classes.class(face.w[corner.at()]) != Some(class) {
                continue;
            }
            let (squared, shares) = nearest_on_triangle(position, surface.corners(face));
            if best.is_none_or(|(least, ..)| squared < least) {
                best = Some((squared, corner.face(), shares));
            }
        }
    }
    let Some((_, face, shares)) = best else {
        // No face is left there: nothing to project on, and nothing that is seen.
        return classes.of(class).next().map(|wedge| surface.value(wedge).to_vec()).unwrap_or_default();
    };
    let of = surface.faces[face].w.map(|wedge| surface.value(wedge));
    (0..surface.columns).map(|c| (0..3).map(|i| shares[i] * f64::from(of[i][c])).sum::<f64>() as f32).collect()
}

impl ErrorMetric for Gaps {
    const COST: CostUnit = CostUnit::Length;
    const JOINS: bool = true;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        if self.placement == Placement::Subset {
            let (first, second) = (self.subset(surface, a, b), self.subset(surface, b, a));
            let keep_second = second.is_some_and(|y| first.is_none_or(|x| y < x));
            let cost = if keep_second { second? } else { first? };
            return Some(Price { cost, position: if keep_second { pb } else { pa }, keep_second });
        }
        self.optimal(surface, a, b, best_place(&self.planes.combined(a, b), pa, pb).1)
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        if self.placement == Placement::Optimal {
            return self.optimal(surface, a, b, position);
        }
        let keep_second = position == surface.positions[b as usize];
        let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
        if position != surface.positions[kept as usize] {
            return None;
        }
        Some(Price { cost: self.subset(surface, kept, gone)?, position, keep_second })
    }

    fn contracting(&mut self, surface: &Topology, kept: u32, gone: u32, price: &Price) {
        self.largest = self.largest.max(price.cost);
        self.pending.clear();
        if self.placement == Placement::Optimal
            && let Some(classes) = Classes::new(surface, kept, gone)
        {
            for class in 0..classes.count {
                let values = projected(surface, [kept, gone], &classes, class, price.position);
                self.pending.extend(classes.of(class).map(|wedge| (wedge, values.clone())));
            }
        }
    }

    fn bound(&self) -> Option<f64> {
        Some(self.largest)
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        self.planes.merge(done);
        self.clouds.merge(done);
        let gone = |wedge: u32| done.merged.iter().any(|merged| merged[1] == wedge);
        for (wedge, values) in self.pending.drain(..).filter(|(wedge, _)| !gone(*wedge)) {
            surface.value_mut(wedge).copy_from_slice(&values);
        }
    }
}
