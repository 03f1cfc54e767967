//! Normals of a level: each face's corners get those that, interpolated, come closest to the samples' (least squares); at
//! each wedge, corners whose normals agree share one (`share`), the others part. A wedge that parts costs a vertex and no
//! triangle.

use super::samples::Sample;
use super::shape::PAIRS;
use super::surface::{Placed, Surface};
use crate::quadric::{dot, inverse};

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
pub(super) struct System {
    /// Sums of products of weights, upper half row by row.
    matrix: [f64; 6],
    /// Sums of weighted normals.
    right: [[f64; 3]; 3],
    /// Sum of the samples' areas.
    pub(super) area: f64,
}

/// Weight of the normal that a corner has, against that of all samples of its face.
const PULL: f64 = 0.025;

impl Surface<'_> {
    /// Normals from what the samples of each face ask; corners of one local vertex share one while theirs are within the
    /// angle whose cosine is `same`. `normals` are those of the corners now.
    pub(super) fn normals(&self, asked: &[System], normals: impl Fn(usize, usize) -> [f64; 3], same: f64) -> Fitted {
        let solve = |(face, system): (usize, &System)| {
            let now = [0, 1, 2].map(|at| normals(face, at));
            system.solve(now).unwrap_or(now)
        };
        let fit: Vec<[[f64; 3]; 3]> = asked.iter().enumerate().map(solve).collect();
        self.share(&fit, asked, normals, same)
    }
}

impl System {
    /// Adds a sample that lies on the face.
    pub(super) fn add(&mut self, sample: &Sample, placed: &Placed) {
        let (area, shares) = (sample.area, placed.shares);
        for (to, [i, j]) in self.matrix.iter_mut().zip(PAIRS) {
            *to += area * shares[i] * shares[j];
        }
        for (to, share) in self.right.iter_mut().zip(shares) {
            to.iter_mut().zip(sample.normal).for_each(|(to, n)| *to += area * share * n);
        }
        self.area += area;
    }

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
    use super::super::{Face, unit};
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
        let sample = |at: [f64; 3]| Sample {
            at,
            normal: unit(normal(at)).unwrap(),
            flat: [0.0, 0.0, 1.0],
            area: 0.0025,
            bend: 1.0,
            corners: [0; 3],
            shares: [0.5, 0.25, 0.25],
            near: [0, 2, 2],
            primitive: 0,
        };
        grid.map(sample).collect()
    }

    fn fit(normal: impl Fn([f64; 3]) -> [f64; 3]) -> Fitted {
        let (faces, positions) = square();
        let (surface, samples) = (Surface::new(&faces, positions), samples(normal));
        let mut placed = vec![Placed::NOWHERE; samples.len()];
        surface.place_all(&samples, &mut placed);
        let mut asked = vec![System::default(); 2];
        samples.iter().zip(&placed).for_each(|(sample, placed)| asked[placed.face as usize].add(sample, placed));
        surface.normals(&asked, |_, _| [0.0, 0.0, 1.0], 0.9)
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
