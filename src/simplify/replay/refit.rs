//! Fits the vertices of a finished level to the source: normals first of all, which may part where the level has become
//! too coarse for one normal at a vertex.
//!
//! Samples of the source's surface are carried over to the nearest faces of the level. Each face's corners then get the
//! normals that, interpolated, come closest to the samples' (least squares); at each wedge, corners whose normals agree
//! share one, the others part. A wedge that parts costs a vertex and no triangle.
//!
//! Knows positions, normals and which vertex became which; no sequence, no metric.

use std::collections::BTreeMap;

use super::{CutPrimitive, Replay, find};
use crate::mesh::weld::NONE;
use crate::quadric::{cross, dot, scale, sub};

/// One triangle of the level.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Vertices.
    v: [u32; 3],
    /// Local vertices of its primitive: what shares one normal now.
    local: [u32; 3],
    /// Primitive.
    primitive: u32,
}

/// A point of the source with what it stands for.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Where it is.
    at: [f64; 3],
    /// Shading normal, unit length.
    normal: [f64; 3],
    /// Normal of its face, unit length.
    flat: [f64; 3],
    /// Area that it stands for.
    weight: f64,
    /// Vertices of the level that its corners became.
    near: [u32; 3],
    /// Primitive.
    primitive: u32,
}

/// Normals of a level after the fit.
#[derive(Clone, Debug, Default)]
struct Fitted {
    /// For each corner of each face the number of its normal.
    corners: Vec<[u32; 3]>,
    /// Unit normals.
    normals: Vec<[f64; 3]>,
}

/// A sample on its face.
#[derive(Clone, Copy, Debug)]
struct Placed {
    face: u32,
    weights: [f64; 3],
}

/// What the samples of a face ask of its three normals: least squares.
#[derive(Clone, Copy, Debug, Default)]
struct System {
    /// Sums of products of weights, upper half row by row.
    matrix: [f64; 6],
    /// Sums of weighted normals.
    right: [[f64; 3]; 3],
    /// Sum of the samples' areas.
    area: f64,
}

/// Corners that share a normal: the sum of theirs by area, and where they are.
type Group = ([f64; 3], Vec<(u32, usize)>);

/// The level's surface.
struct Surface<'a> {
    faces: &'a [Face],
    positions: Vec<[f64; 3]>,
    flat: Vec<[f64; 3]>,
    start: Vec<u32>,
    ring: Vec<u32>,
}

/// A sample may lie on a face that is turned from its own by less than this: cosine of 72°.
const SAME_SIDE: f64 = 0.31;

/// Weight of the normal that a corner has, against that of all samples of its face.
const PULL: f64 = 0.025;

/// Longest walk over the level in search of the nearest face, in vertices.
const MOST_STEPS: usize = 8;

/// Samples of a face of the level that are enough, and that are plenty.
const ENOUGH: usize = 8;
const PLENTY: usize = 16;

const THIRD: f64 = 1.0 / 3.0;

impl Replay<'_> {
    /// Fits the normals of a cut to the source; vertices of `cuts` part where their faces' normals are further apart than
    /// the angle whose cosine is `same`.
    pub fn refit(&mut self, cuts: &mut [CutPrimitive], same: f64) {
        let sources = &self.mesh.primitives;
        let now: Vec<Option<Vec<[f32; 3]>>> = sources
            .iter()
            .zip(&*cuts)
            .map(|(source, cut)| source.attribute("NORMAL").map(|_| self.normals(cut)))
            .collect();
        if now.iter().all(Option::is_none) {
            return;
        }
        let mut faces = Vec::new();
        for ((primitive, cut), _) in (0..).zip(&*cuts).zip(&now).filter(|(_, now)| now.is_some()) {
            for t in cut.indices.chunks_exact(3) {
                let local = [t[0], t[1], t[2]];
                let v = local.map(|i| self.wedge_vertex[cut.wedges[i as usize] as usize]);
                faces.push(Face { v, local, primitive });
            }
        }
        let samples = self.samples(faces.len());
        let surface = Surface::new(&faces, self.positions.iter().map(|p| p.map(f64::from)).collect());
        let corner_normal = |face: usize, at: usize| {
            let Face { local, primitive, .. } = faces[face];
            let normals = now[primitive as usize].as_ref().expect("only primitives with normals have faces here");
            normals[local[at] as usize].map(f64::from)
        };
        let fitted = surface.normals(&samples, corner_normal, same);
        let mut face = 0;
        for (cut, now) in cuts.iter_mut().zip(&now) {
            if now.is_none() {
                continue;
            }
            let mut numbers: BTreeMap<(u32, u32), u32> = BTreeMap::new();
            let (mut wedges, mut normals) = (Vec::new(), Vec::new());
            for (at, index) in cut.indices.iter_mut().enumerate() {
                let normal = fitted.corners[face + at / 3][at % 3];
                let number = *numbers.entry((*index, normal)).or_insert_with(|| {
                    wedges.push(cut.wedges[*index as usize]);
                    normals.push(fitted.normals[normal as usize].map(|x| x as f32));
                    wedges.len() as u32 - 1
                });
                *index = number;
            }
            face += cut.indices.len() / 3;
            (cut.wedges, cut.normals) = (wedges, Some(normals));
        }
    }

    /// Samples of the source for a level of `faces` faces.
    fn samples(&mut self, faces: usize) -> Vec<Sample> {
        let total: usize = self.mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
        let step = (total / (PLENTY * faces).max(1)).max(1);
        let points: &[[f64; 3]] = if total < ENOUGH * faces {
            &[
                [2.0 * THIRD, 0.5 * THIRD, 0.5 * THIRD],
                [0.5 * THIRD, 2.0 * THIRD, 0.5 * THIRD],
                [0.5 * THIRD, 0.5 * THIRD, 2.0 * THIRD],
            ]
        } else {
            &[[THIRD; 3]]
        };
        let mut out = Vec::new();
        for (primitive, source) in (0..).zip(&self.mesh.primitives) {
            let Some(normals) = source.attribute("NORMAL").filter(|a| a.components == 3) else { continue };
            let start = self.welded.weld.stored_start[primitive as usize];
            for t in source.indices.chunks_exact(3).step_by(step) {
                let p = [0, 1, 2].map(|i| source.positions()[t[i] as usize].map(f64::from));
                let across = cross(sub(p[1], p[0]), sub(p[2], p[0]));
                let area = dot(across, across).sqrt() / 2.0;
                let Some(flat) = unit(across) else { continue };
                let n = [0, 1, 2].map(|i| {
                    let at = t[i] as usize * 3;
                    [0, 1, 2].map(|axis| f64::from(normals.values[at + axis]))
                });
                let near = [0, 1, 2].map(|i| {
                    let wedge = self.welded.weld.stored[start + t[i] as usize];
                    find(&mut self.vertex_up, self.welded.weld.wedge_vertex[wedge as usize])
                });
                for w in points {
                    let mix = |v: &[[f64; 3]; 3]| [0, 1, 2].map(|i| v[0][i] * w[0] + v[1][i] * w[1] + v[2][i] * w[2]);
                    let Some(normal) = unit(mix(&n)) else { continue };
                    let weight = area / points.len() as f64;
                    out.push(Sample { at: mix(&p), normal, flat, weight, near, primitive });
                }
            }
        }
        out
    }
}

impl<'a> Surface<'a> {
    /// Of `faces` over `positions`.
    fn new(faces: &'a [Face], positions: Vec<[f64; 3]>) -> Self {
        let mut start = vec![0u32; positions.len() + 2];
        for &v in faces.iter().flat_map(|face| &face.v) {
            start[v as usize + 2] += 1;
        }
        for at in 2..start.len() {
            start[at] += start[at - 1];
        }
        let mut ring = vec![0; faces.len() * 3];
        for (index, face) in faces.iter().enumerate() {
            for &v in &face.v {
                let at = &mut start[v as usize + 1];
                ring[*at as usize] = index as u32;
                *at += 1;
            }
        }
        let flat = faces
            .iter()
            .map(|face| {
                let p = face.v.map(|v| positions[v as usize]);
                unit(cross(sub(p[1], p[0]), sub(p[2], p[0]))).unwrap_or([0.0; 3])
            })
            .collect();
        Self { faces, positions, flat, start, ring }
    }

    fn ring(&self, vertex: u32) -> &[u32] {
        &self.ring[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }

    /// The face of the sample's primitive, turned like it, that is nearest to it on a walk downhill.
    fn place(&self, sample: &Sample) -> Option<Placed> {
        let mut best: Option<(f64, Placed)> = None;
        let mut tried: Vec<u32> = Vec::with_capacity(32);
        let mut ask = |vertex: u32, best: &mut Option<(f64, Placed)>| {
            for &face in self.ring(vertex) {
                if tried.contains(&face) {
                    continue;
                }
                tried.push(face);
                let own = &self.faces[face as usize];
                if own.primitive != sample.primitive || dot(self.flat[face as usize], sample.flat) < SAME_SIDE {
                    continue;
                }
                let (squared, weights) = nearest(sample.at, own.v.map(|v| self.positions[v as usize]));
                if best.is_none_or(|(least, _)| squared < least) {
                    *best = Some((squared, Placed { face, weights }));
                }
            }
        };
        let near = sample.near;
        ask(near[0], &mut best);
        if near[1] != near[0] {
            ask(near[1], &mut best);
        }
        if near[2] != near[0] && near[2] != near[1] {
            ask(near[2], &mut best);
        }
        for _ in 0..MOST_STEPS {
            let Some((least, placed)) = best else { break };
            for v in self.faces[placed.face as usize].v {
                ask(v, &mut best);
            }
            if best.is_some_and(|(now, _)| least <= now) {
                break;
            }
        }
        best.map(|(_, placed)| placed)
    }

    /// Fits normals; corners of one local vertex share one while theirs are within the angle whose cosine is `same`.
    /// `normals` are those of the corners now.
    fn normals(&self, samples: &[Sample], normals: impl Fn(usize, usize) -> [f64; 3], same: f64) -> Fitted {
        let mut systems = vec![System::default(); self.faces.len()];
        for sample in samples {
            let Some(Placed { face, weights: w }) = self.place(sample) else { continue };
            let system = &mut systems[face as usize];
            let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (to, (i, j)) in system.matrix.iter_mut().zip(pairs) {
                *to += sample.weight * w[i] * w[j];
            }
            for (to, w) in system.right.iter_mut().zip(w) {
                for (to, n) in to.iter_mut().zip(sample.normal) {
                    *to += sample.weight * w * n;
                }
            }
            system.area += sample.weight;
        }
        let fit: Vec<[[f64; 3]; 3]> = systems
            .iter()
            .enumerate()
            .map(|(face, system)| {
                let now = [0, 1, 2].map(|at| normals(face, at));
                system.solve(now).unwrap_or(now)
            })
            .collect();
        self.share(&fit, &systems, normals, same)
    }

    /// Corners of one local vertex that agree share the mean of their normals.
    fn share(
        &self,
        fit: &[[[f64; 3]; 3]],
        systems: &[System],
        normals: impl Fn(usize, usize) -> [f64; 3],
        same: f64,
    ) -> Fitted {
        let mut out = Fitted { corners: vec![[NONE; 3]; self.faces.len()], normals: Vec::new() };
        let mut groups: Vec<Group> = Vec::new();
        for face in 0..self.faces.len() {
            for at in 0..3 {
                if out.corners[face][at] != NONE {
                    continue;
                }
                let own = &self.faces[face];
                groups.clear();
                for &other in self.ring(own.v[at]) {
                    let there = &self.faces[other as usize];
                    for (corner, &normal) in fit[other as usize].iter().enumerate() {
                        if there.primitive == own.primitive && there.local[corner] == own.local[at] {
                            let normal = unit(normal).unwrap_or_else(|| normals(other as usize, corner));
                            // A corner that no sample speaks for follows the others.
                            let weight = systems[other as usize].area.max(1e-30);
                            groups.push((scale(normal, weight), vec![(other, corner)]));
                        }
                    }
                }
                join(&mut groups, same);
                for (sum, members) in &groups {
                    let number = out.normals.len() as u32;
                    let (first, corner) = members[0];
                    out.normals.push(unit(*sum).unwrap_or_else(|| normals(first as usize, corner)));
                    for &(face, corner) in members {
                        out.corners[face as usize][corner] = number;
                    }
                }
            }
        }
        out
    }
}

/// Joins the two groups that agree best until none agree any more.
fn join(groups: &mut Vec<Group>, same: f64) {
    loop {
        let mut best = (same, None);
        for i in 0..groups.len() {
            for j in 0..i {
                let (a, b) = (groups[i].0, groups[j].0);
                let cosine = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
                if best.0 < cosine {
                    best = (cosine, Some((i, j)));
                }
            }
        }
        let Some((i, j)) = best.1 else { return };
        let (sum, members) = groups.remove(i);
        let to = &mut groups[j];
        to.0 = [0, 1, 2].map(|axis| to.0[axis] + sum[axis]);
        to.1.extend(members);
    }
}

impl System {
    /// The three normals, pulled towards those of now; `None` without samples.
    fn solve(&self, now: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
        let pull = self.area * PULL;
        if pull <= 0.0 {
            return None;
        }
        let m = &self.matrix;
        let (xx, xy, xz, yy, yz, zz) = (m[0] + pull, m[1], m[2], m[3] + pull, m[4], m[5] + pull);
        let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let inverse = 1.0 / (xx * cx + xy * cy + xz * cz);
        if !inverse.is_finite() {
            return None;
        }
        let (dy, dyz, dz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let mut out = [[0.0; 3]; 3];
        for axis in 0..3 {
            let r = [0, 1, 2].map(|i| self.right[i][axis] + pull * now[i][axis]);
            out[0][axis] = (cx * r[0] + cy * r[1] + cz * r[2]) * inverse;
            out[1][axis] = (cy * r[0] + dy * r[1] + dyz * r[2]) * inverse;
            out[2][axis] = (cz * r[0] + dyz * r[1] + dz * r[2]) * inverse;
        }
        Some(out)
    }
}

fn unit(n: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(n, n).sqrt();
    (length > 1e-30).then(|| scale(n, 1.0 / length))
}

/// Squared distance from `p` to a triangle, and the shares of its corners at the nearest point (C. Ericson, *Real-Time
/// Collision Detection*, 2005, section 5.1.5).
fn nearest(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> (f64, [f64; 3]) {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let weights = shares(p, [a, b, c], ab, ac, ap);
    let at = [0, 1, 2].map(|i| a[i] * weights[0] + b[i] * weights[1] + c[i] * weights[2]);
    let off = sub(p, at);
    (dot(off, off), weights)
}

fn shares(p: [f64; 3], [_, b, c]: [[f64; 3]; 3], ab: [f64; 3], ac: [f64; 3], ap: [f64; 3]) -> [f64; 3] {
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if 0.0 <= d3 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && 0.0 <= d1 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if 0.0 <= d6 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && 0.0 <= d2 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && 0.0 <= d4 - d3 && 0.0 <= d5 - d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    if sum <= 0.0 || sum.is_nan() {
        return [1.0, 0.0, 0.0];
    }
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles in z = 0 over one primitive.
    fn square() -> (Vec<Face>, Vec<[f64; 3]>) {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let face = |v: [u32; 3]| Face { v, local: v, primitive: 0 };
        (vec![face([0, 1, 2]), face([0, 2, 3])], positions)
    }

    fn samples(normal: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Sample> {
        let grid = (0..20)
            .flat_map(|i| (0..20).map(move |j| [(f64::from(i) + 0.5) / 20.0, (f64::from(j) + 0.25) / 20.0, 0.0]));
        let flat = [0.0, 0.0, 1.0];
        let near = [0, 2, 2];
        grid.map(|at| Sample { at, normal: unit(normal(at)).unwrap(), flat, weight: 0.0025, near, primitive: 0 })
            .collect()
    }

    fn fit(normal: impl Fn([f64; 3]) -> [f64; 3]) -> Fitted {
        let (faces, positions) = square();
        Surface::new(&faces, positions).normals(&samples(normal), |_, _| [0.0, 0.0, 1.0], 0.9)
    }

    #[test]
    fn normals_that_agree_stay_one() {
        let fitted = fit(|p| [0.2 * p[0], 0.1 * p[1], 1.0]);
        assert_eq!(fitted.normals.len(), 4);
        // Corner 2 of the first face and corner 1 of the second are one vertex.
        assert_eq!(fitted.corners[0][2], fitted.corners[1][1]);
        let n = fitted.normals[fitted.corners[0][2] as usize];
        let want = unit([0.2, 0.1, 1.0]).unwrap();
        assert!(dot(n, want) > 0.999, "{n:?}");
    }

    #[test]
    fn normals_part_where_faces_disagree() {
        let fitted = fit(|p| if p[1] < p[0] { [0.6, 0.0, 0.8] } else { [-0.6, 0.0, 0.8] });
        assert_eq!(fitted.normals.len(), 6);
        for (face, x) in [(0, 0.6), (1, -0.6)] {
            for corner in fitted.corners[face] {
                assert!((fitted.normals[corner as usize][0] - x).abs() < 0.1, "{fitted:?}");
            }
        }
    }

    #[test]
    fn the_nearest_point_is_no_further_than_any_other() {
        let triangle = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.5, 1.5, 0.0]];
        for i in 0..343 {
            let p = [i % 7, i / 7 % 7, i / 49].map(|x| f64::from(x) * 0.6 - 1.5);
            let (squared, weights) = nearest(p, triangle);
            assert!(weights.iter().all(|&w| (-1e-12..=1.0 + 1e-12).contains(&w)), "{weights:?}");
            for (a, b) in (0..=20).flat_map(|a| (0..=20 - a).map(move |b| (a, b))) {
                let w = [a, b, 20 - a - b].map(|x| f64::from(x) / 20.0);
                let q = [0, 1, 2].map(|axis| (0..3).map(|corner| triangle[corner][axis] * w[corner]).sum::<f64>());
                let off = sub(p, q);
                assert!(squared <= dot(off, off) + 1e-12, "{p:?}");
            }
        }
    }
}
