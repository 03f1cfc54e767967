//! Points of the source, a batch at a time: nothing of them is kept from one batch to the next.

use super::{Importance, unit};
use crate::mesh::Mesh;
use crate::quadric::{cross, dot, sub};
use crate::simplify::replay::Welded;

/// A point of the source with what it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Where it is.
    pub(super) at: [f64; 3],
    /// Shading normal, unit length; that of its face where the source has none.
    pub(super) normal: [f64; 3],
    /// Normal of its face, unit length.
    pub(super) flat: [f64; 3],
    /// Area that it stands for, by how much of it shows.
    pub(super) area: f64,
    /// How much the source bends there.
    pub(super) bend: f64,
    /// Stored vertices of its triangle.
    pub(super) corners: [u32; 3],
    /// Shares of its triangle's corners.
    pub(super) shares: [f64; 3],
    /// Vertices of the level that its corners became.
    pub(super) near: [u32; 3],
    /// Primitive.
    pub(super) primitive: u32,
}

const THIRD: f64 = 1.0 / 3.0;

/// The point that stands for all of a triangle that is smaller than the faces around it: two of its corners have become one.
const ONE: [[f64; 3]; 1] = [[THIRD; 3]];

/// Points that each stand for a third of a triangle that is still a face.
const THREE: [[f64; 3]; 3] = [
    [2.0 * THIRD, 0.5 * THIRD, 0.5 * THIRD],
    [0.5 * THIRD, 2.0 * THIRD, 0.5 * THIRD],
    [0.5 * THIRD, 0.5 * THIRD, 2.0 * THIRD],
];

/// Triangles of the source for a face of the level that are plenty.
const PLENTY: usize = 16;

/// Samples of a batch, about.
const BATCH: usize = 1 << 13;

/// The samples of a source for one level.
pub(super) struct Samples<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) welded: &'a Welded,
    pub(super) importance: &'a Importance,
    /// What each vertex of the source has become.
    pub(super) roots: &'a [u32],
    /// Faces of the level.
    pub(super) faces: usize,
}

impl Samples<'_> {
    /// Hands out all samples, batch by batch, with the number of the first one of each batch; the same ones each time.
    pub(super) fn visit(&self, mut each: impl FnMut(usize, &[Sample])) {
        let total = self.mesh.triangles();
        let step = (total / (PLENTY * self.faces).max(1)).max(1);
        let mut batch: Vec<Sample> = Vec::with_capacity(BATCH + THREE.len());
        let (mut before, mut first) = (0, 0);
        for (primitive, source) in (0..).zip(&self.mesh.primitives) {
            let normals = source.attribute("NORMAL").filter(|a| a.components == 3);
            let positions = source.positions();
            let stored = &self.welded.weld.stored[self.welded.weld.stored_start[primitive as usize]..];
            for (number, t) in source.indices.chunks_exact(3).enumerate().step_by(step) {
                let corners = [t[0], t[1], t[2]];
                let p = corners.map(|i| positions[i as usize].map(f64::from));
                let across = cross(sub(p[1], p[0]), sub(p[2], p[0]));
                let Some(flat) = unit(across) else { continue };
                let triangle = first + number;
                let area = dot(across, across).sqrt() / 2.0 * f64::from(self.importance.seen[triangle]);
                let n = corners.map(|i| {
                    normals.map_or(flat, |a| [0, 1, 2].map(|axis| f64::from(a.values[i as usize * 3 + axis])))
                });
                let near = corners.map(|i| {
                    let wedge = stored[i as usize] as usize;
                    self.roots[self.welded.weld.wedge_vertex[wedge] as usize]
                });
                let is_face = near[0] != near[1] && near[1] != near[2] && near[2] != near[0];
                let points: &[[f64; 3]] = if is_face { &THREE } else { &ONE };
                for &shares in points {
                    let Some(normal) = unit(mixed(n, shares)) else { continue };
                    batch.push(Sample {
                        at: mixed(p, shares),
                        normal,
                        flat,
                        area: area / points.len() as f64,
                        bend: f64::from(self.importance.bends[triangle]),
                        corners,
                        shares,
                        near,
                        primitive,
                    });
                }
                if BATCH <= batch.len() {
                    each(before, &batch);
                    before += batch.len();
                    batch.clear();
                }
            }
            first += source.indices.len() / 3;
        }
        if !batch.is_empty() {
            each(before, &batch);
        }
    }
}

/// Weighted sum of the corners.
pub(super) fn mixed<const N: usize>(corners: [[f64; N]; 3], shares: [f64; 3]) -> [f64; N] {
    std::array::from_fn(|i| corners[0][i] * shares[0] + corners[1][i] * shares[1] + corners[2][i] * shares[2])
}
