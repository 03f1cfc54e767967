//! What several metrics are made of: plane quadrics with areas, classes of wedges that a contraction joins, and values
//! that follow the edge.
//!
//! Knows no metric. Plane quadrics: M. Garland, P. Heckbert, 1997, weighted by area.

use super::Placement;
use crate::mesh::topology::{Contraction, EdgeKind, Topology};
use crate::quadric::{Quadric, cross, dot, lerp, scale, sub};

/// A plane quadric and an area for each vertex; both add up as vertices merge.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    /// Area-weighted squared distances to the planes of the faces and borders that came to a vertex.
    pub quadrics: Vec<Quadric>,
    /// A third of the area of each face that came to a vertex.
    pub areas: Vec<f64>,
}

impl Planes {
    /// Of the whole surface; `border` weighs the planes at borders and seams.
    pub fn new(surface: &Topology, border: f64) -> Self {
        let mut quadrics = vec![Quadric::default(); surface.positions.len()];
        let mut areas = vec![0.0; surface.positions.len()];
        for (face, kinds) in surface.faces.iter().zip(&surface.kinds) {
            let p = surface.corners(face);
            let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            let length = dot(normal, normal).sqrt();
            if length <= 0.0 {
                continue;
            }
            let unit = scale(normal, 1.0 / length);
            let plane = Quadric::plane(unit, -dot(unit, p[0]), 0.5 * length);
            for (corner, &v) in face.v.iter().enumerate() {
                quadrics[v as usize].add(&plane);
                areas[v as usize] += 0.5 * length / 3.0;
                if matches!(kinds[corner], EdgeKind::Border | EdgeKind::Seam) {
                    let end = face.v[(corner + 1) % 3];
                    let across = cross(unit, sub(p[(corner + 1) % 3], p[corner]));
                    // |across| is the edge's length, so the weight is its square.
                    let edge = Quadric::plane(across, -dot(across, p[corner]), border);
                    quadrics[v as usize].add(&edge);
                    quadrics[end as usize].add(&edge);
                }
            }
        }
        Self { quadrics, areas }
    }

    /// The quadric of a pair.
    pub fn combined(&self, a: u32, b: u32) -> Quadric {
        let mut q = self.quadrics[a as usize];
        q.add(&self.quadrics[b as usize]);
        q
    }

    /// The area of a pair.
    pub fn area(&self, a: u32, b: u32) -> f64 {
        self.areas[a as usize] + self.areas[b as usize]
    }

    /// Folds what `gone` had into `kept`.
    pub fn merge(&mut self, done: &Contraction) {
        self.quadrics[done.kept as usize] = self.combined(done.kept, done.gone);
        self.areas[done.kept as usize] = self.area(done.kept, done.gone);
    }
}

/// Average distance from the planes of a quadric over an area: a length, evaluation thesis section 2.1. `squares` is the
/// quadric's value.
pub(super) fn average_distance(squares: f64, area: f64) -> f64 {
    if area > 0.0 { (squares.max(0.0) / area).sqrt() } else { 0.0 }
}

/// The best place for a pair and the quadric's value there: where it is least, or an end, or the middle.
pub(super) fn best_place(q: &Quadric, pa: [f64; 3], pb: [f64; 3]) -> (f64, [f64; 3]) {
    let middle = lerp(pa, pb, 0.5);
    let mut best = (q.eval(middle), middle);
    for p in [Some(pa), Some(pb), q.minimum(middle)].into_iter().flatten() {
        let cost = q.eval(p);
        if cost < best.0 {
            best = (cost, p);
        }
    }
    (best.0.max(0.0), best.1)
}

/// Every wedge of `gone` merges with exactly one wedge of `kept`, so that nothing but source vertices is left.
pub(super) fn wedges_fit(surface: &Topology, kept: u32, gone: u32) -> bool {
    let Some(pairs) = surface.joined_wedges(kept, gone) else { return false };
    surface.wedges(gone).all(|wedge| pairs.iter().filter(|p| p[1] == wedge).count() == 1)
}

/// The cheaper end of a pair to which the wedges of the other one fit, and whether that is the second; `None` if neither.
pub(super) fn best_end(surface: &Topology, a: u32, b: u32, costs: [f64; 2]) -> Option<(f64, bool)> {
    let first_fits = wedges_fit(surface, a, b);
    if wedges_fit(surface, b, a) && (costs[1] < costs[0] || !first_fits) {
        return Some((costs[1], true));
    }
    first_fits.then_some((costs[0], false))
}

/// Which end stays where the vertex must go to `position`; `None` if subset placement forbids it.
pub(super) fn end_at(surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<bool> {
    let keep_second = position == surface.positions[b as usize];
    let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
    (position == surface.positions[kept as usize] && wedges_fit(surface, kept, gone)).then_some(keep_second)
}

/// Values of joined wedges follow the edge: those at the merged vertex lie between the two as its position does.
pub(super) fn follow_edge(surface: &mut Topology, done: &Contraction, placement: Placement) {
    if placement == Placement::Subset {
        return;
    }
    for &[stays, goes] in &done.merged {
        for column in 0..surface.columns {
            let other = surface.value(goes)[column];
            let value = &mut surface.value_mut(stays)[column];
            *value += (other - *value) * done.t as f32;
        }
    }
}

/// The wedges of a pair in classes: those that the contraction would join, directly or through each other, are one.
#[derive(Clone, Debug, Default)]
pub(super) struct Classes {
    /// Wedge, whether it is at the second vertex, and its class.
    pub wedges: Vec<(u32, bool, usize)>,
    /// Number of classes.
    pub count: usize,
}

impl Classes {
    /// Of the pair `a`, `b`; `None` if more wedges meet on the edge than can be joined.
    pub fn new(surface: &Topology, a: u32, b: u32) -> Option<Self> {
        let pairs = surface.joined_wedges(a, b)?;
        let mut wedges: Vec<(u32, bool, usize)> = surface
            .wedges(a)
            .map(|w| (w, false))
            .chain(surface.wedges(b).map(|w| (w, true)))
            .map(|(w, s)| (w, s, 0))
            .collect();
        for (number, wedge) in wedges.iter_mut().enumerate() {
            wedge.2 = number;
        }
        for &[first, second] in pairs.iter() {
            let class = |wedges: &[(u32, bool, usize)], of: u32| wedges.iter().find(|w| w.0 == of).map(|w| w.2);
            let (Some(x), Some(y)) = (class(&wedges, first), class(&wedges, second)) else { continue };
            let (low, high) = (x.min(y), x.max(y));
            wedges.iter_mut().filter(|w| w.2 == high).for_each(|w| w.2 = low);
        }
        let mut out = Self { wedges, count: 0 };
        out.number();
        Some(out)
    }

    /// Numbers the classes by their first wedge, without gaps.
    fn number(&mut self) {
        let mut known: Vec<usize> = Vec::new();
        for wedge in &mut self.wedges {
            let at = known.iter().position(|&class| class == wedge.2).unwrap_or_else(|| {
                known.push(wedge.2);
                known.len() - 1
            });
            wedge.2 = at;
        }
        self.count = known.len();
    }

    /// Joins the classes of all wedges that are `alike`.
    pub fn join(&mut self, alike: impl Fn(u32, u32) -> bool) {
        for second in 1..self.wedges.len() {
            for first in 0..second {
                let (x, y) = (self.wedges[first], self.wedges[second]);
                if x.2 != y.2 && alike(x.0, y.0) {
                    self.wedges.iter_mut().filter(|w| w.2 == y.2).for_each(|w| w.2 = x.2);
                }
            }
        }
        self.number();
    }

    /// Wedges of one class.
    pub fn of(&self, class: usize) -> impl Iterator<Item = u32> + '_ {
        self.wedges.iter().filter(move |w| w.2 == class).map(|w| w.0)
    }

    /// Class of a wedge of the pair.
    pub fn class(&self, wedge: u32) -> Option<usize> {
        self.wedges.iter().find(|w| w.0 == wedge).map(|w| w.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_average_distance_is_a_length() {
        // All planes 2 away, area 3: the sum of area × square is 12.
        assert!((average_distance(12.0, 3.0) - 2.0).abs() < 1e-15);
        assert_eq!(average_distance(-1e-30, 3.0), 0.0);
        assert_eq!(average_distance(1.0, 0.0), 0.0);
    }
}
