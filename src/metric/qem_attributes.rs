//! `qem-attributes`: one quadric over position and attributes together, accumulated.
//!
//! M. Garland, P. Heckbert, *Simplifying surfaces with color and texture using quadric error metrics*, 1998: a vertex is a
//! point of R^(3+m), a face spans a plane there, the error is the squared distance from that plane. The merged position
//! and the merged attributes are solved together. H. Hoppe's quadric of 1999, which measures the attribute's error at the
//! point of the surface instead of across R^(3+m), is what metric `its` is derived from and is not repeated here.
//!
//! Where the source leaves a gap: it gives a vertex one attribute tuple. Here each wedge has a quadric of its own; those
//! that a contraction joins are added, the others are kept, and all share one position: attributes are eliminated wedge by
//! wedge (Schur complement), the sum is a quadric of the position alone. Borders and seams have planes in space (section
//! 5 of the paper of 1997). Attributes are scaled as the configuration says (`normal`, `texcoord`, `color`). Memory grows
//! with the square of the number of values, as the paper says of it.

use super::parts::{Classes, end_at, wedges_fit};
use super::{ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, EdgeKind, NEXT, Topology};
use crate::metric::its::EdgeWeights;
use crate::quadric::{Quadric, cross, dot, lerp, scale, sub};

/// The metric.
#[derive(Clone, Debug)]
pub struct QemAttributes {
    placement: Placement,
    /// Values of a wedge.
    columns: usize,
    /// Of each wedge, [`Self::stride`] numbers: the lower triangle row by row, the linear part, the constant.
    quadrics: Vec<f64>,
}

/// Most that the squared sine of a face's corner in R^(3+m) may be called zero: a thinner face has no plane.
const FLAT: f64 = 1e-20;

/// Pull of the attributes towards what they are, as a share of the trace: decides where nothing else does.
const PULL: f64 = 1e-9;

impl QemAttributes {
    /// Prepares the quadrics of the whole surface.
    pub fn new(surface: &Topology, edges: EdgeWeights, placement: Placement) -> Self {
        let columns = surface.columns;
        let mut out = Self { placement, columns, quadrics: Vec::new() };
        let stride = out.stride();
        out.quadrics = vec![0.0; surface.wedge_vertex.len() * stride];
        let mut quadric = vec![0.0; stride];
        for (id, face) in surface.faces.iter().enumerate() {
            let p = surface.corners(face);
            let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            let length = dot(normal, normal).sqrt();
            if length <= 0.0 {
                continue;
            }
            if out.face(surface, face.w, p, 0.5 * length, &mut quadric) {
                face.w.into_iter().for_each(|w| add(out.at_mut(w), &quadric));
            }
            let unit = scale(normal, 1.0 / length);
            for corner in 0..3 {
                let weight = match surface.kinds[id][corner] {
                    EdgeKind::Border => edges.border,
                    EdgeKind::Seam => edges.seam,
                    EdgeKind::Crease | EdgeKind::Interior => continue,
                };
                let across = cross(unit, sub(p[NEXT[corner]], p[corner]));
                let plane = Quadric::plane(across, -dot(across, p[corner]), weight);
                for end in [corner, NEXT[corner]] {
                    out.add_position(face.w[end], &plane);
                }
            }
        }
        out
    }

    fn size(&self) -> usize {
        3 + self.columns
    }

    fn stride(&self) -> usize {
        let n = self.size();
        n * (n + 1) / 2 + n + 1
    }

    fn at(&self, wedge: u32) -> &[f64] {
        &self.quadrics[wedge as usize * self.stride()..][..self.stride()]
    }

    fn at_mut(&mut self, wedge: u32) -> &mut [f64] {
        let stride = self.stride();
        &mut self.quadrics[wedge as usize * stride..][..stride]
    }

    /// Position and values of a wedge as one point.
    fn point(position: [f64; 3], values: &[f32]) -> Vec<f64> {
        position.into_iter().chain(values.iter().map(|&v| f64::from(v))).collect()
    }

    /// The quadric of a face; false if it has no plane.
    fn face(&self, surface: &Topology, w: [u32; 3], p: [[f64; 3]; 3], area: f64, to: &mut [f64]) -> bool {
        let n = self.size();
        let [p, q, r] = [0, 1, 2].map(|i| Self::point(p[i], surface.value(w[i])));
        let mut e1: Vec<f64> = q.iter().zip(&p).map(|(q, p)| q - p).collect();
        let mut e2: Vec<f64> = r.iter().zip(&p).map(|(r, p)| r - p).collect();
        let (first, second) = (norm2(&e1), norm2(&e2));
        let shrink = 1.0 / first.sqrt();
        for x in &mut e1 {
            *x *= shrink;
        }
        let along = inner(&e1, &e2);
        e2.iter_mut().zip(&e1).for_each(|(x, e)| *x -= along * e);
        let height = norm2(&e2);
        if !(first > 0.0 && height > FLAT * second) {
            return false;
        }
        let shrink = 1.0 / height.sqrt();
        for x in &mut e2 {
            *x *= shrink;
        }
        let (p1, p2) = (inner(&p, &e1), inner(&p, &e2));
        let mut at = 0;
        for i in 0..n {
            for j in 0..=i {
                let identity = if i == j { 1.0 } else { 0.0 };
                to[at] = area * (identity - e1[i] * e1[j] - e2[i] * e2[j]);
                at += 1;
            }
        }
        for i in 0..n {
            to[at] = area * (p1 * e1[i] + p2 * e2[i] - p[i]);
            at += 1;
        }
        to[at] = area * (norm2(&p) - p1 * p1 - p2 * p2);
        true
    }

    /// Adds a quadric of the position alone.
    fn add_position(&mut self, wedge: u32, q: &Quadric) {
        let n = self.size();
        let linear = n * (n + 1) / 2;
        let [xx, xy, xz, yy, yz, zz, bx, by, bz, c] = q.0;
        let to = self.at_mut(wedge);
        for (to, from) in to.iter_mut().zip([xx, xy, yy, xz, yz, zz]) {
            *to += from;
        }
        for (to, from) in to[linear..].iter_mut().zip([bx, by, bz]) {
            *to += from;
        }
        to[linear + n] += c;
    }

    /// The value of one quadric at a point.
    fn eval(&self, q: &[f64], point: &[f64]) -> f64 {
        let n = self.size();
        let linear = n * (n + 1) / 2;
        let (mut sum, mut at) = (q[linear + n], 0);
        for i in 0..n {
            let mut row = 2.0 * q[linear + i] + q[at + i] * point[i];
            for j in 0..i {
                row += 2.0 * q[at + j] * point[j];
            }
            sum += row * point[i];
            at += i + 1;
        }
        sum
    }

    /// The quadric of the position when the attributes take their best values.
    fn eliminated(&self, q: &[f64]) -> Quadric {
        let (n, m) = (self.size(), self.columns);
        let linear = n * (n + 1) / 2;
        let entry = |i: usize, j: usize| q[i * (i + 1) / 2 + j];
        let mut out =
            Quadric([q[0], q[1], q[3], q[2], q[4], q[5], q[linear], q[linear + 1], q[linear + 2], q[linear + n]]);
        let Some(factor) = self.factor(q) else { return out };
        // Columns of B and of the linear part, solved: L z = rhs, and what is taken away are scalar products of the z.
        let column = |k: usize| -> Vec<f64> {
            let right = (0..m).map(|i| if k < 3 { entry(3 + i, k) } else { q[linear + 3 + i] }).collect();
            forward(&factor, right)
        };
        let z = [column(0), column(1), column(2), column(3)];
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2), (0, 3), (1, 3), (2, 3), (3, 3)];
        for (to, (i, j)) in out.0.iter_mut().zip(pairs) {
            *to -= inner(&z[i], &z[j]);
        }
        out
    }

    /// The best attributes at a position; `None` if the quadric says nothing of them.
    fn best_values(&self, q: &[f64], position: [f64; 3], now: &[f32]) -> Option<Vec<f64>> {
        let (n, m) = (self.size(), self.columns);
        let linear = n * (n + 1) / 2;
        let factor = self.factor(q)?;
        let pull = self.pull(q);
        let right = (0..m).map(|i| {
            let row = (3 + i) * (4 + i) / 2;
            let b: f64 = (0..3).map(|k| q[row + k] * position[k]).sum();
            pull * f64::from(now[i]) - b - q[linear + 3 + i]
        });
        Some(backward(&factor, forward(&factor, right.collect())))
    }

    fn pull(&self, q: &[f64]) -> f64 {
        let trace: f64 = (3..self.size()).map(|i| q[i * (i + 1) / 2 + i]).sum();
        PULL * trace / self.columns as f64
    }

    /// Cholesky factor of the attributes' block, lower triangle row by row; `None` if there is none.
    fn factor(&self, q: &[f64]) -> Option<Vec<f64>> {
        let m = self.columns;
        if m == 0 {
            return None;
        }
        let pull = self.pull(q);
        let mut l = vec![0.0; m * (m + 1) / 2];
        for i in 0..m {
            let row = (3 + i) * (4 + i) / 2 + 3;
            for j in 0..=i {
                let mut sum = q[row + j];
                for k in 0..j {
                    sum -= l[i * (i + 1) / 2 + k] * l[j * (j + 1) / 2 + k];
                }
                if i == j {
                    sum += pull;
                    if sum.is_nan() || sum <= 0.0 {
                        return None;
                    }
                    l[i * (i + 1) / 2 + i] = sum.sqrt();
                } else {
                    l[i * (i + 1) / 2 + j] = sum / l[j * (j + 1) / 2 + j];
                }
            }
        }
        Some(l)
    }

    /// The quadric of a pair with every attribute at its best.
    fn pair(&self, surface: &Topology, a: u32, b: u32) -> Option<Quadric> {
        let classes = Classes::new(surface, a, b)?;
        let mut out = Quadric::default();
        let mut sum = vec![0.0; self.stride()];
        for class in 0..classes.count {
            sum.fill(0.0);
            classes.of(class).for_each(|wedge| add(&mut sum, self.at(wedge)));
            out.add(&self.eliminated(&sum));
        }
        Some(out)
    }

    /// Cost of merging `gone` into `kept` with everything at `kept` as it is; `None` if a wedge of `gone` has no one wedge
    /// at `kept` to merge with.
    fn subset_cost(&self, surface: &Topology, kept: u32, gone: u32) -> Option<f64> {
        if !wedges_fit(surface, kept, gone) {
            return None;
        }
        let pairs = surface.joined_wedges(kept, gone)?;
        let position = surface.positions[kept as usize];
        let mut cost = 0.0;
        for wedge in surface.wedges(gone) {
            let partner = pairs.iter().find(|p| p[1] == wedge)?[0];
            cost += self.eval(self.at(wedge), &Self::point(position, surface.value(partner)));
        }
        for wedge in surface.wedges(kept) {
            cost += self.eval(self.at(wedge), &Self::point(position, surface.value(wedge)));
        }
        Some(cost.max(0.0))
    }
}

impl ErrorMetric for QemAttributes {
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        if self.placement == Placement::Subset {
            let (first, second) = (self.subset_cost(surface, a, b), self.subset_cost(surface, b, a));
            let keep_second = second.is_some_and(|y| first.is_none_or(|x| y < x));
            let cost = if keep_second { second? } else { first? };
            return Some(Price { cost, position: if keep_second { pb } else { pa }, keep_second });
        }
        let whole = self.pair(surface, a, b)?;
        let middle = lerp(pa, pb, 0.5);
        let along = sub(pb, pa);
        let mut best = (whole.eval(middle), middle);
        let solved = whole.minimum(middle).filter(|x| {
            let off = sub(*x, middle);
            dot(off, off) <= FARTHEST * FARTHEST * dot(along, along)
        });
        for p in [Some(pa), Some(pb), solved].into_iter().flatten() {
            let cost = whole.eval(p);
            if cost < best.0 {
                best = (cost, p);
            }
        }
        Some(Price { cost: best.0.max(0.0), position: best.1, keep_second: false })
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        if self.placement == Placement::Subset {
            let keep_second = end_at(surface, a, b, position)?;
            let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
            return Some(Price { cost: self.subset_cost(surface, kept, gone)?, position, keep_second });
        }
        let cost = self.pair(surface, a, b)?.eval(position).max(0.0);
        Some(Price { cost, position, keep_second: false })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        let stride = self.stride();
        for &[stays, goes] in &done.merged {
            for k in 0..stride {
                self.quadrics[stays as usize * stride + k] += self.quadrics[goes as usize * stride + k];
            }
        }
        if self.placement == Placement::Subset {
            return;
        }
        let position = surface.positions[done.kept as usize];
        let wedges: Vec<u32> = surface.wedges(done.kept).collect();
        for wedge in wedges {
            if let Some(values) = self.best_values(self.at(wedge), position, surface.value(wedge)) {
                surface.value_mut(wedge).iter_mut().zip(values).for_each(|(to, value)| *to = value as f32);
            }
        }
    }
}

/// A solution further from the edge's middle than this many edge lengths comes from a nearly flat quadric.
const FARTHEST: f64 = 8.0;

fn add(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm2(a: &[f64]) -> f64 {
    inner(a, a)
}

/// Solves `L z = right`.
fn forward(l: &[f64], mut right: Vec<f64>) -> Vec<f64> {
    for i in 0..right.len() {
        let row = i * (i + 1) / 2;
        let known: f64 = (0..i).map(|k| l[row + k] * right[k]).sum();
        right[i] = (right[i] - known) / l[row + i];
    }
    right
}

/// Solves `Lᵀ x = right`.
fn backward(l: &[f64], mut right: Vec<f64>) -> Vec<f64> {
    for i in (0..right.len()).rev() {
        let known: f64 = (i + 1..right.len()).map(|k| l[k * (k + 1) / 2 + i] * right[k]).sum();
        right[i] = (right[i] - known) / l[i * (i + 1) / 2 + i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A face over one value: (0,0,0;0), (1,0,0;2), (0,1,0;0).
    fn slope() -> (QemAttributes, Vec<f64>) {
        let metric = QemAttributes { placement: Placement::Optimal, columns: 1, quadrics: Vec::new() };
        let mut q = vec![0.0; metric.stride()];
        let (e1, e2) = ([1.0, 0.0, 0.0, 2.0].map(|x: f64| x / 5.0f64.sqrt()), [0.0, 1.0, 0.0, 0.0]);
        let mut at = 0;
        for i in 0..4 {
            for j in 0..=i {
                q[at] = if i == j { 1.0 } else { 0.0 } - e1[i] * e1[j] - e2[i] * e2[j];
                at += 1;
            }
        }
        (metric, q)
    }

    #[test]
    fn the_error_is_the_distance_from_the_plane_of_all_values() {
        let (metric, q) = slope();
        assert!(metric.eval(&q, &[0.5, 0.25, 0.0, 1.0]).abs() < 1e-12, "on the plane");
        assert!((metric.eval(&q, &[0.5, 0.25, 0.0, 2.0]) - 0.2).abs() < 1e-12, "1 off in the value, across the slope");
        assert!((metric.eval(&q, &[0.5, 0.25, 3.0, 1.0]) - 9.0).abs() < 1e-12, "3 off in space");
    }

    #[test]
    fn eliminated_attributes_are_at_their_best() {
        let (metric, q) = slope();
        let position = [0.5, 0.25, 2.0];
        let value = metric.best_values(&q, position, &[0.0]).expect("regular");
        assert!((value[0] - 1.0).abs() < 1e-6, "{value:?}");
        let cost = metric.eval(&q, &[0.5, 0.25, 2.0, value[0]]);
        assert!((metric.eliminated(&q).eval(position) - cost).abs() < 1e-6);
    }
}
