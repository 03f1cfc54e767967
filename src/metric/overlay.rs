//! Triangles before and after a contraction, laid over each other in the texture: on each common cell both are linear, so
//! what lies between them is largest at a corner of a cell.
//!
//! J. Cohen, M. Olano, D. Manocha, *Appearance-preserving simplification*, 1998, section 5. Knows triangles, not meshes.

use crate::quadric::sub;

/// A triangle in space and in the texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// Number of the face.
    pub face: u32,
    /// Corners in space.
    pub p: [[f64; 3]; 3],
    /// Corners in the texture.
    pub uv: [[f64; 2]; 3],
}

/// An axis-aligned box of displacements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

/// A face of the texture thinner than this (twice its area against the square of its longest edge) has no area there.
const THIN: f64 = 1e-7;

/// A cell smaller than this share of its triangle is rounding.
const SPECK: f64 = 1e-13;

/// By how much the cells of a triangle may miss its area.
const UNCOVERED: f64 = 1e-3;

impl Bounds {
    /// Nothing but that displacement.
    pub fn of(d: [f64; 3]) -> Self {
        Self { low: d, high: d }
    }

    /// The least box round both.
    pub fn or(self, other: Self) -> Self {
        let least = |k: usize| self.low[k].min(other.low[k]);
        let most = |k: usize| self.high[k].max(other.high[k]);
        Self { low: [0, 1, 2].map(least), high: [0, 1, 2].map(most) }
    }

    /// All sums of one of each.
    pub fn plus(self, other: Self) -> Self {
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        Self { low: sum(self.low, other.low), high: sum(self.high, other.high) }
    }

    /// Wider by `by` on each side.
    pub fn wider(self, by: f64) -> Self {
        Self { low: self.low.map(|x| x - by), high: self.high.map(|x| x + by) }
    }

    /// The longest displacement in it.
    pub fn longest(&self) -> f64 {
        (0..3).map(|k| self.low[k].abs().max(self.high[k].abs())).map(|x| x * x).sum::<f64>().sqrt()
    }
}

/// Twice the signed area.
pub(super) fn twice(t: &[[f64; 2]; 3]) -> f64 {
    (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[2][0] - t[0][0]) * (t[1][1] - t[0][1])
}

/// −1 or 1: how a triangle lies in the texture; 0 if it has no area there.
pub(super) fn orientation(t: &[[f64; 2]; 3]) -> i8 {
    let edge = |i: usize| {
        let (p, q) = (t[i], t[(i + 1) % 3]);
        (q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1])
    };
    let area = twice(t);
    let longest = edge(0).max(edge(1)).max(edge(2));
    if area.abs() <= THIN * longest || !area.is_finite() { 0 } else { area.signum() as i8 }
}

impl Patch {
    /// Shares of the corners at a place of the texture.
    fn shares(&self, at: [f64; 2]) -> [f64; 3] {
        let whole = twice(&self.uv);
        let first = twice(&[at, self.uv[1], self.uv[2]]) / whole;
        let second = twice(&[self.uv[0], at, self.uv[2]]) / whole;
        [first, second, 1.0 - first - second]
    }

    /// The point of the surface at a place of the texture.
    fn point(&self, at: [f64; 2]) -> [f64; 3] {
        let shares = self.shares(at);
        [0, 1, 2].map(|k| (0..3).map(|i| shares[i] * self.p[i][k]).sum())
    }

    /// By how much space changes at most along a unit of the texture.
    pub fn gradient(&self) -> f64 {
        let whole = twice(&self.uv).abs();
        let edge = |i: usize| {
            let (p, q) = (self.uv[i], self.uv[(i + 1) % 3]);
            ((q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1])).sqrt()
        };
        let length = |i: usize| {
            let along = sub(self.p[(i + 1) % 3], self.p[i]);
            crate::quadric::dot(along, along).sqrt()
        };
        // The change across a corner's opposite edge is at most the longest edge over the least height.
        let (longest, widest) = (length(0).max(length(1)).max(length(2)), edge(0).max(edge(1)).max(edge(2)));
        2.0 * longest * widest / whole
    }
}

/// Corners of the part of `t` that lies in `by`; both must turn the way that `sign` says.
fn clip(t: &[[f64; 2]; 3], by: &[[f64; 2]; 3], sign: f64, out: &mut Vec<[f64; 2]>, spare: &mut Vec<[f64; 2]>) {
    out.clear();
    out.extend(t);
    for i in 0..3 {
        let (p, q) = (by[i], by[(i + 1) % 3]);
        let inside = |x: [f64; 2]| sign * twice(&[p, q, x]);
        spare.clear();
        for k in 0..out.len() {
            let (from, to) = (out[k], out[(k + 1) % out.len()]);
            let (a, b) = (inside(from), inside(to));
            if a >= 0.0 {
                spare.push(from);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                let s = a / (a - b);
                spare.push([from[0] + (to[0] - from[0]) * s, from[1] + (to[1] - from[1]) * s]);
            }
        }
        std::mem::swap(out, spare);
        if out.len() < 3 {
            out.clear();
            return;
        }
    }
}

/// Whether the boxes round two triangles touch.
fn near(a: &[[f64; 2]; 3], b: &[[f64; 2]; 3]) -> bool {
    (0..2).all(|k| {
        let range = |t: &[[f64; 2]; 3]| (t[0][k].min(t[1][k]).min(t[2][k]), t[0][k].max(t[1][k]).max(t[2][k]));
        let ((a, b), (c, d)) = (range(a), range(b));
        a <= d && c <= b
    })
}

/// For each new patch the displacements to the old surface, each cell by itself: `visit(new, old, box)` for the cells of new
/// patch `new` that lie in old patch `old`, the box holding `old − new` all over the cell. All patches must turn the way that
/// `sign` says. False if the new patches do not cover what the old ones did, once.
pub(super) fn overlay(old: &[Patch], new: &[Patch], sign: f64, mut visit: impl FnMut(usize, usize, Bounds)) -> bool {
    let (mut polygon, mut spare) = (Vec::with_capacity(9), Vec::with_capacity(9));
    for (number, patch) in new.iter().enumerate() {
        let whole = twice(&patch.uv).abs();
        let mut covered = 0.0;
        for (under, before) in old.iter().enumerate() {
            if !near(&patch.uv, &before.uv) {
                continue;
            }
            clip(&patch.uv, &before.uv, sign, &mut polygon, &mut spare);
            let fan = polygon.windows(2).skip(1).map(|w| twice(&[polygon[0], w[0], w[1]]).abs());
            let area: f64 = fan.sum();
            if area <= SPECK * whole {
                continue;
            }
            covered += area;
            let displacement = |&at: &[f64; 2]| Bounds::of(sub(before.point(at), patch.point(at)));
            if let Some(cell) = polygon.iter().map(displacement).reduce(Bounds::or) {
                visit(number, under, cell);
            }
        }
        if (covered - whole).abs() > UNCOVERED * whole {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(p: [[f64; 3]; 3]) -> Patch {
        Patch { face: 0, p, uv: p.map(|p| [p[0], p[1]]) }
    }

    #[test]
    fn a_pyramid_differs_from_its_base_by_its_height() {
        // Four sides over a square, against the square in two halves.
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let top = [0.5, 0.5, 2.0];
        let old: Vec<Patch> = (0..4).map(|i| patch([corners[i], corners[(i + 1) % 4], top])).collect();
        let new = [patch([corners[0], corners[1], corners[2]]), patch([corners[0], corners[2], corners[3]])];
        let mut boxes = [Bounds::default(); 2];
        assert!(overlay(&old, &new, 1.0, |new, _, cell| boxes[new] = boxes[new].or(cell)));
        for found in boxes {
            assert!((found.longest() - 2.0).abs() < 1e-12, "{found:?}");
        }
        assert!(!overlay(&old[..3], &new, 1.0, |_, _, _| {}), "a side is missing");
        let doubled: Vec<Patch> = old.iter().chain(&old).copied().collect();
        assert!(!overlay(&doubled, &new, 1.0, |_, _, _| {}), "covered twice");
    }

    #[test]
    fn boxes_add_up() {
        let cell = Bounds::of([1.0, -2.0, 0.0]).or(Bounds::of([0.0, 1.0, 0.0])).plus(Bounds::of([0.0, 0.0, 2.0]));
        assert!((cell.longest() - 3.0).abs() < 1e-12);
        assert!((Bounds::default().wider(1.0).longest() - 3.0f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_gradient_bounds_what_a_step_in_the_texture_does_in_space() {
        let t = Patch {
            face: 0,
            p: [[0.0; 3], [2.0, 0.0, 1.0], [0.5, 3.0, 0.0]],
            uv: [[0.0, 0.0], [0.5, 0.1], [0.0, 0.4]],
        };
        let (a, b) = (t.point([0.1, 0.1]), t.point([0.1, 0.2]));
        let off = sub(a, b);
        assert!(crate::quadric::dot(off, off).sqrt() <= 0.1 * t.gradient());
    }
}
