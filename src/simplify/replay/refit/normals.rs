//! Normals of a level: each face's corners get those that, interpolated, come closest to the samples' (least squares); at
//! each wedge, corners whose normals agree share one, the others part. A wedge that parts costs a vertex and no triangle.

use super::surface::{Placed, Surface};
use super::{Sample, unit};
use crate::mesh::weld::NONE;
use crate::quadric::{dot, inverse, scale};

/// Normals of a level after the fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Fitted {
    /// For each corner of each face the number of its normal.
    pub(super) corners: Vec<[u32; 3]>,
    /// Unit normals.
    pub(super) normals: Vec<[f64; 3]>,
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

/// Weight of the normal that a corner has, against that of all samples of its face.
const PULL: f64 = 0.025;

impl Surface<'_> {
    /// Fits normals; corners of one local vertex share one while theirs are within the angle whose cosine is `same`.
    /// `normals` are those of the corners now.
    pub(super) fn normals(
        &self,
        samples: &[Sample],
        placed: &[Option<Placed>],
        normals: impl Fn(usize, usize) -> [f64; 3],
        same: f64,
    ) -> Fitted {
        let mut systems = vec![System::default(); self.faces.len()];
        for (sample, placed) in samples.iter().zip(placed) {
            let &Some(Placed { face, weights: w }) = placed else { continue };
            let (area, normal) = (f64::from(sample.area), sample.normal.map(f64::from));
            let system = &mut systems[face as usize];
            let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (to, (i, j)) in system.matrix.iter_mut().zip(pairs) {
                *to += area * w[i] * w[j];
            }
            for (to, w) in system.right.iter_mut().zip(w) {
                for (to, n) in to.iter_mut().zip(normal) {
                    *to += area * w * n;
                }
            }
            system.area += area;
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
        let mut matrix = self.matrix;
        for at in [0, 3, 5] {
            matrix[at] += pull;
        }
        let rows = (pull > 0.0).then(|| inverse(matrix)).flatten()?;
        let mut out = [[0.0; 3]; 3];
        for axis in 0..3 {
            let r = [0, 1, 2].map(|i| self.right[i][axis] + pull * now[i][axis]);
            for (normal, row) in out.iter_mut().zip(rows) {
                normal[axis] = dot(row, r);
            }
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Face;
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
        let narrow = |v: [f64; 3]| v.map(|x| x as f32);
        let sample = |at: [f64; 3]| Sample {
            at: narrow(at),
            normal: narrow(unit(normal(at)).unwrap()),
            flat,
            area: 0.0025,
            corners: [0; 3],
            point: 0,
            near,
            primitive: 0,
            triangle: 0,
        };
        grid.map(sample).collect()
    }

    fn fit(normal: impl Fn([f64; 3]) -> [f64; 3]) -> Fitted {
        let (faces, positions) = square();
        let (surface, samples) = (Surface::new(&faces, positions), samples(normal));
        surface.normals(&samples, &surface.places(&samples, None), |_, _| [0.0, 0.0, 1.0], 0.9)
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
}
