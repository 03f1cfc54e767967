//! `aps`: contractions in the order of a guaranteed bound on how far a texture moves over the surface.
//!
//! J. Cohen, M. Olano, D. Manocha, *Appearance-preserving simplification*, 1998; evaluation thesis, section 2.1.2. Source and
//! level share the texture: the deviation at a place of the texture is the distance between the two surface points there.
//! Each face carries a box of displacements to the source. A contraction lays the faces before and after over each other in
//! the texture; a new face's box is the union, over its cells, of the old face's box and the cell's own displacements,
//! added: a bound, not an estimate. The bound of a level is the longest displacement in any box so far.
//!
//! Where the source leaves gaps: the position is where plane quadrics are least, its place in the texture that along the edge; if
//! the texture forbids that, the ends. A seam may be off its line by a ten-thousandth of its length, for rounding: what that
//! uncovers is added by the local gradient. Faces without texture correspond by their corners, so that the bound is one on the
//! distance between surfaces there. Coordinates are stored in single precision: a hundred-thousandth of the radius is added
//! once anything has moved.

use super::domain::{Change, Domain};
use super::overlay::{Bounds, overlay};
use super::parts::{Planes, best_place, follow_edge, wedges_fit};
use super::{CostUnit, ErrorMetric, Placement, Price};
use crate::mesh::layout::Layout;
use crate::mesh::topology::{Contraction, Topology};
use crate::quadric::{dot, sub};

/// The metric.
#[derive(Clone, Debug)]
pub struct Aps {
    placement: Placement,
    domain: Domain,
    planes: Planes,
    /// Of each face: displacements from it to the source, at equal places of the texture.
    boxes: Vec<Bounds>,
    /// What the contraction that is under way will change.
    pending: Option<(Change, Vec<(u32, Bounds)>)>,
    largest: f64,
}

/// How far a seam may be off its line, as a share of its length.
const STRAIGHT: f64 = 1e-4;

/// For coordinates in single precision, unit frame.
const ROUNDING: f64 = 1e-5;

impl Aps {
    /// All boxes are empty at the start; `border` weighs the planes at borders and seams.
    pub fn new(
        surface: &Topology,
        layout: &Layout,
        wedge_primitive: &[u32],
        border: f64,
        placement: Placement,
    ) -> Self {
        Self {
            placement,
            domain: Domain::new(surface, layout, wedge_primitive, STRAIGHT),
            planes: Planes::new(surface, border),
            boxes: vec![Bounds::default(); surface.faces.len()],
            pending: None,
            largest: 0.0,
        }
    }

    /// The boxes of the faces that change; `None` if the texture does not allow it.
    fn boxes(&self, change: &Change) -> Option<Vec<(u32, Bounds)>> {
        let mut out: Vec<(u32, Bounds)> = Vec::new();
        for star in &change.stars {
            let mut boxes: Vec<Option<Bounds>> = vec![None; star.new.len()];
            let mut add = |at: usize, found: Bounds| boxes[at] = Some(boxes[at].map_or(found, |b| b.or(found)));
            if star.sign == 0 {
                corner_by_corner(star, |face| self.boxes[face as usize], &mut add);
            } else {
                let gradient =
                    star.old.iter().chain(&star.new).map(super::overlay::Patch::gradient).fold(0.0, f64::max);
                let slack = 2.0 * star.off * gradient;
                let whole = overlay(&star.old, &star.new, f64::from(star.sign), |new, old, cell| {
                    add(new, self.boxes[star.old[old].face as usize].plus(cell).wider(slack));
                });
                if !whole {
                    return None;
                }
            }
            let own = |face: u32| self.boxes[face as usize];
            out.extend(star.new.iter().zip(boxes).map(|(patch, found)| (patch.face, found.unwrap_or(own(patch.face)))));
        }
        Some(out)
    }

    fn evaluated(
        &self,
        surface: &Topology,
        a: u32,
        b: u32,
        position: [f64; 3],
    ) -> Option<(Change, Vec<(u32, Bounds)>)> {
        let change = self.domain.change(surface, a, b, position, way(surface, a, b, position))?;
        let boxes = self.boxes(&change)?;
        Some((change, boxes))
    }

    fn at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        let keep_second = position == surface.positions[b as usize];
        if self.placement == Placement::Subset {
            let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
            if position != surface.positions[kept as usize] || !wedges_fit(surface, kept, gone) {
                return None;
            }
        }
        let (_, boxes) = self.evaluated(surface, a, b, position)?;
        let cost = boxes.iter().map(|(_, found)| found.longest()).fold(0.0, f64::max);
        Some(Price { cost, position, keep_second })
    }
}

/// How far along the edge a position is: 0 at `a` … 1 at `b`, exactly there alone.
pub(super) fn way(surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> f64 {
    let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
    if position == pa {
        return 0.0;
    }
    if position == pb {
        return 1.0;
    }
    let along = sub(pb, pa);
    (dot(sub(position, pa), along) / dot(along, along)).clamp(1e-3, 1.0 - 1e-3)
}

/// Displacements where faces correspond by their corners: those of a face that stays lie between those of its corners; what
/// is left of a face that vanishes is an edge of one that stays.
pub(super) fn corner_by_corner(
    star: &super::domain::Star,
    old_box: impl Fn(u32) -> Bounds,
    add: &mut impl FnMut(usize, Bounds),
) {
    // The corner that moved is where the merged vertex is now.
    let merged = star.new.iter().find_map(|new| {
        let old = star.old.iter().find(|old| old.face == new.face)?;
        (0..3).find(|&i| new.p[i] != old.p[i]).map(|i| new.p[i])
    });
    let Some(merged) = merged else { return };
    for (at, new) in star.new.iter().enumerate() {
        let Some(old) = star.old.iter().find(|old| old.face == new.face) else { continue };
        let moves = (0..3).map(|i| Bounds::of(sub(old.p[i], new.p[i]))).reduce(Bounds::or).unwrap_or_default();
        add(at, old_box(old.face).plus(moves.or(Bounds::default())));
    }
    for old in star.old.iter().filter(|old| star.new.iter().all(|new| new.face != old.face)) {
        for (at, new) in star.new.iter().enumerate() {
            // The corner that stays where it is, and so belongs to the edge that is left.
            let kept = old.p.iter().any(|p| new.p.contains(p) && *p != merged);
            if kept {
                let moves = old.p.iter().map(|&p| if new.p.contains(&p) { [0.0; 3] } else { sub(p, merged) });
                let moves = moves.map(Bounds::of).reduce(Bounds::or).unwrap_or_default();
                add(at, old_box(old.face).plus(moves.or(Bounds::default())));
            }
        }
    }
}

impl ErrorMetric for Aps {
    const COST: CostUnit = CostUnit::Length;
    const REFUSES_FOR_NOW: bool = true;

    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let inner = [a, b].map(|v| Domain::is_inner(surface, v));
        if self.placement == Placement::Optimal && inner == [true, true] {
            let (_, position) = best_place(&self.planes.combined(a, b), pa, pb);
            if let Some(price) = self.at(surface, a, b, position) {
                return Some(price);
            }
        }
        let (first, second) = (self.at(surface, a, b, pa), self.at(surface, a, b, pb));
        match (&first, &second) {
            (Some(x), Some(y)) if y.cost < x.cost => second,
            (None, _) => second,
            _ => first,
        }
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        self.at(surface, a, b, position)
    }

    fn contracting(&mut self, surface: &Topology, kept: u32, gone: u32, price: &Price) {
        self.pending = self.evaluated(surface, kept, gone, price.position);
    }

    fn bound(&self) -> Option<f64> {
        Some(if self.largest > 0.0 { self.largest + ROUNDING } else { self.largest })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        self.planes.merge(done);
        follow_edge(surface, done, self.placement);
        if let Some((change, boxes)) = self.pending.take() {
            self.domain.set(surface, &change.uvs, done);
            for (face, found) in boxes {
                self.boxes[face as usize] = found;
                self.largest = self.largest.max(found.longest());
            }
        }
        surface.classify_edges(done.kept);
    }
}
