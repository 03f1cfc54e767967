//! `qem`: the plane quadric alone, accumulated; attributes are interpolated along the edge.
//!
//! M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, 1997; evaluation thesis, sections 2.1
//! and 2.2: area-weighted planes, optimal point, border planes.

use super::{ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, EdgeKind, Topology};
use crate::quadric::{Quadric, cross, dot, lerp, scale, sub};

/// The metric.
#[derive(Clone, Debug)]
pub struct Qem {
    placement: Placement,
    quadrics: Vec<Quadric>,
}

impl Qem {
    /// Prepares the quadrics of the whole surface; `border` weighs the planes at borders and seams.
    pub fn new(surface: &Topology, border: f64, placement: Placement) -> Self {
        let mut quadrics = vec![Quadric::default(); surface.positions.len()];
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
        Self { placement, quadrics }
    }

    fn combined(&self, a: u32, b: u32) -> Quadric {
        let mut q = self.quadrics[a as usize];
        q.add(&self.quadrics[b as usize]);
        q
    }

    fn price_subset(surface: &Topology, a: u32, b: u32, q: &Quadric) -> Option<Price> {
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let (first, second) = (q.eval(pa), q.eval(pb));
        let first_fits = wedges_fit(surface, a, b);
        let keep_second = wedges_fit(surface, b, a) && (second < first || !first_fits);
        if keep_second {
            return Some(Price { cost: second.max(0.0), position: pb, keep_second });
        }
        first_fits.then_some(Price { cost: first.max(0.0), position: pa, keep_second })
    }
}

impl ErrorMetric for Qem {
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let q = self.combined(a, b);
        if self.placement == Placement::Subset {
            return Self::price_subset(surface, a, b, &q);
        }
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let middle = lerp(pa, pb, 0.5);
        let mut best = (q.eval(middle), middle);
        for p in [Some(pa), Some(pb), q.minimum(middle)].into_iter().flatten() {
            let cost = q.eval(p);
            if cost < best.0 {
                best = (cost, p);
            }
        }
        Some(Price { cost: best.0.max(0.0), position: best.1, keep_second: false })
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = position == surface.positions[b as usize];
        if self.placement == Placement::Subset {
            let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
            if position != surface.positions[kept as usize] || !wedges_fit(surface, kept, gone) {
                return None;
            }
        }
        let cost = self.combined(a, b).eval(position).max(0.0);
        Some(Price { cost, position, keep_second })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        let kept = done.kept as usize;
        self.quadrics[kept] = self.combined(done.kept, done.gone);
        if self.placement == Placement::Optimal {
            for &[stays, goes] in &done.merged {
                for column in 0..surface.columns {
                    let other = surface.value(goes)[column];
                    let value = &mut surface.value_mut(stays)[column];
                    *value += (other - *value) * done.t as f32;
                }
            }
        }
    }
}

/// Every wedge of `gone` merges with exactly one wedge of `kept`, so that nothing but source vertices is left.
fn wedges_fit(surface: &Topology, kept: u32, gone: u32) -> bool {
    let Some(pairs) = surface.joined_wedges(kept, gone) else { return false };
    surface.wedges(gone).all(|wedge| pairs.iter().filter(|p| p[1] == wedge).count() == 1)
}
