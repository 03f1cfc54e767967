//! Where the vertices of a level are: moved to where the level lies closest to the samples (least squares: distance from
//! the samples' planes, and a little from the samples themselves). Each face keeps what its samples ask of its three corners,
//! and no sample.
//!
//! Contractions place a vertex by the surface of the moment; what many of them add up to is seen only here. Samples count by
//! the area that shows and by how much the surface bends there: it is at bends that outlines pass, and against anything
//! behind it an outline is what is seen first.

use super::samples::{Sample, mixed};
use super::surface::{Placed, Surface};
use super::{PULL, REACH, SWEEPS};
use crate::mesh::{Mesh, Primitive};
use crate::quadric::{cross, dot, inverse, sub};

/// Weight of the distance from a sample itself against that from its plane: vertices should not slide.
const POINT: f64 = 0.02;

/// A sample this far off, in edges of its face, counts half: it may belong to something that is gone.
const FAR: f64 = 0.3;

/// By how much a bend outweighs flatness: a sphere's curvature counts this much more than a plane's.
const BEND: f64 = 10.0;

/// Beyond this many times the curvature of the bounding sphere, it is an edge, however sharp.
const SHARPEST: f64 = 50.0;

/// How much each triangle of `mesh`, in order of all primitives, counts for outlines: 1 where it is flat.
/// `vertex` is the welded vertex of each stored one, by primitive; `vertices` their number.
pub(super) fn bends(mesh: &Mesh, vertices: usize, vertex: impl Fn(usize, u32) -> u32) -> Vec<f32> {
    let triangles = |p: usize| mesh.primitives[p].indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]);
    let corners =
        |p: usize, t: [u32; 3]| t.map(|i| Primitive::positions(&mesh.primitives[p])[i as usize].map(f64::from));
    let mut normals = vec![[0.0f64; 3]; vertices];
    for primitive in 0..mesh.primitives.len() {
        for t in triangles(primitive) {
            let p = corners(primitive, t);
            let across = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            for i in t {
                let normal = &mut normals[vertex(primitive, i) as usize];
                normal.iter_mut().zip(across).for_each(|(to, from)| *to += from);
            }
        }
    }
    for normal in &mut normals {
        *normal = super::unit(*normal).unwrap_or([0.0; 3]);
    }
    let radius = crate::mesh::layout::frame(&mesh.primitives).1;
    let mut out = Vec::with_capacity(mesh.triangles());
    for primitive in 0..mesh.primitives.len() {
        for t in triangles(primitive) {
            let p = corners(primitive, t);
            let n = t.map(|i| normals[vertex(primitive, i) as usize]);
            let turn = |i: usize| {
                let (turned, along) = (sub(n[i], n[(i + 1) % 3]), sub(p[i], p[(i + 1) % 3]));
                (dot(turned, turned) / dot(along, along).max(f64::MIN_POSITIVE)).sqrt() * radius
            };
            let curvature = (turn(0) + turn(1) + turn(2)) / 3.0;
            out.push((1.0 + BEND * curvature.min(SHARPEST)) as f32);
        }
    }
    out
}

/// What the samples on a face ask of the moves of its corners: least squares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moves {
    /// For each pair of corners ([`PAIR`]) the upper half, row by row, of a symmetric matrix.
    matrix: [[f32; 6]; 6],
    right: [[f32; 3]; 3],
}

/// Where a pair of corners stands in sums over pairs.
pub(super) const PAIR: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The pairs in that order.
pub(super) const PAIRS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

impl Moves {
    /// Adds a sample that lies on a face with corners `p`.
    pub(super) fn add(&mut self, sample: &Sample, placed: &Placed, p: [[f64; 3]; 3]) {
        let (n, shares) = (sample.flat, placed.shares);
        let off = sub(mixed(p, shares), sample.at);
        let longest = [1, 2].map(|i| sub(p[i], p[0])).map(|e| dot(e, e)).into_iter().fold(0.0, f64::max);
        let doubt = 1.0 + dot(off, off) / (FAR * FAR * longest).max(f64::MIN_POSITIVE);
        let weight = sample.area * sample.bend / doubt;
        let own = [
            weight * (n[0] * n[0] + POINT),
            weight * n[0] * n[1],
            weight * n[0] * n[2],
            weight * (n[1] * n[1] + POINT),
            weight * n[1] * n[2],
            weight * (n[2] * n[2] + POINT),
        ];
        for (to, [i, j]) in self.matrix.iter_mut().zip(PAIRS) {
            let share = shares[i] * shares[j];
            to.iter_mut().zip(own).for_each(|(to, own)| *to += (own * share) as f32);
        }
        let asked = times(own, off);
        for (to, share) in self.right.iter_mut().zip(shares) {
            to.iter_mut().zip(asked).for_each(|(to, asked)| *to -= (asked * share) as f32);
        }
    }
}

fn times(m: [f64; 6], v: [f64; 3]) -> [f64; 3] {
    [
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[2] * v[0] + m[4] * v[1] + m[5] * v[2],
    ]
}

impl Surface<'_> {
    /// Moves the vertices as the samples of their faces ask, but for those of borders where these are held.
    pub(super) fn fit_positions(&mut self, asked: &[Moves], hold_borders: bool) {
        let is_held = if hold_borders { self.on_borders() } else { vec![false; self.positions.len()] };
        let vertices: Vec<u32> = self.vertices().into_iter().filter(|&v| !is_held[v as usize]).collect();
        let longest = |vertex: u32| {
            let here = self.positions[vertex as usize];
            let edges =
                self.ring(vertex).iter().flat_map(|corner| self.corners(corner.face())).map(|end| sub(end, here));
            edges.map(|edge| dot(edge, edge)).fold(0.0, f64::max).sqrt()
        };
        let reach: Vec<f64> = vertices.iter().map(|&vertex| REACH * longest(vertex)).collect();
        let mut moves = vec![[0.0; 3]; self.positions.len()];
        for _ in 0..SWEEPS {
            for (&vertex, &reach) in vertices.iter().zip(&reach) {
                if let Some(by) = self.best_move(vertex, asked, &moves) {
                    let distance = dot(by, by).sqrt();
                    let short = if reach < distance { reach / distance } else { 1.0 };
                    moves[vertex as usize] = by.map(|x| x * short);
                }
            }
        }
        for (position, by) in self.positions.iter_mut().zip(moves) {
            position.iter_mut().zip(by).for_each(|(x, by)| *x += by);
        }
        self.turn();
    }

    /// The move of one vertex that is best while the others move as they do.
    fn best_move(&self, vertex: u32, asked: &[Moves], moves: &[[f64; 3]]) -> Option<[f64; 3]> {
        let (mut matrix, mut right) = ([0.0f64; 6], [0.0f64; 3]);
        for corner in self.ring(vertex) {
            let (v, asked) = (self.faces[corner.face() as usize].v, &asked[corner.face() as usize]);
            let at = corner.at();
            matrix.iter_mut().zip(asked.matrix[PAIR[at][at]]).for_each(|(to, m)| *to += f64::from(m));
            right.iter_mut().zip(asked.right[at]).for_each(|(to, r)| *to += f64::from(r));
            for other in [(at + 1) % 3, (at + 2) % 3] {
                let pushed = times(asked.matrix[PAIR[at][other]].map(f64::from), moves[v[other] as usize]);
                right.iter_mut().zip(pushed).for_each(|(to, by)| *to -= by);
            }
        }
        // The trace of a sample's matrix is its weight, and a little for each axis.
        let pull = PULL * (matrix[0] + matrix[3] + matrix[5]) / (1.0 + 3.0 * POINT);
        for at in [0, 3, 5] {
            matrix[at] += pull;
        }
        let rows = (pull > 0.0).then(|| inverse(matrix)).flatten()?;
        Some(rows.map(|row| dot(row, right)))
    }

    /// All vertices that faces have, in order.
    pub(super) fn vertices(&self) -> Vec<u32> {
        (0..self.positions.len() as u32).filter(|&vertex| !self.ring(vertex).is_empty()).collect()
    }

    /// For each vertex whether it is at an edge of one face only.
    fn on_borders(&self) -> Vec<bool> {
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(self.faces.len() * 3);
        for v in self.faces.iter().map(|face| face.v) {
            edges.extend([[v[0], v[1]], [v[1], v[2]], [v[2], v[0]]].map(|[a, b]| [a.min(b), a.max(b)]));
        }
        edges.sort_unstable();
        let mut out = vec![false; self.positions.len()];
        for same in edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1) {
            same[0].iter().for_each(|&v| out[v as usize] = true);
        }
        out
    }
}
