//! Texture coordinates and colours of a level whose vertices have moved: those that, interpolated over its faces, come
//! closest to the samples' (least squares). As in `shape`, each face keeps what its samples ask and no sample.

use super::around::Around;
use super::samples::{Sample, mixed};
use super::shape::{PAIR, PAIRS};
use super::surface::Placed;
use super::{PULL, REACH, SWEEPS};
use crate::mesh::layout::Field;
use crate::mesh::{Attribute, Mesh};

/// Components of a value at most; fewer are followed by zeros.
const MOST: usize = 4;

/// A sample whose values are further from the face's than this share of the face's extent has another chart's.
const SAME_CHART: f64 = 0.25;

/// One field on its way to a fit.
pub(super) struct Values<'a> {
    pub(super) field: &'a Field,
    /// The field's attribute of each primitive.
    sources: Vec<Option<&'a Attribute>>,
    /// Of each wedge.
    pub(super) now: Vec<[f64; MOST]>,
    asked: Vec<Asked>,
}

/// What the samples on a face ask of the values of its corners: least squares.
#[derive(Clone, Copy, Debug, Default)]
struct Asked {
    /// Sums of products of shares, by pair of corners.
    matrix: [f32; 6],
    right: [[f32; MOST]; 3],
}

impl<'a> Values<'a> {
    /// Of a level of `faces` faces whose wedges have the values `now`; `None` where these have too many components.
    pub(super) fn new(mesh: &'a Mesh, field: &'a Field, faces: usize, now: Vec<[f64; MOST]>) -> Option<Self> {
        let of = |p: &'a crate::mesh::Primitive| p.attribute(&field.name).filter(|a| a.components == field.components);
        let sources = mesh.primitives.iter().map(of).collect();
        (field.components <= MOST).then(|| Self { field, sources, now, asked: vec![Asked::default(); faces] })
    }

    /// Adds a sample that lies on a face with these wedges.
    pub(super) fn add(&mut self, sample: &Sample, placed: &Placed, wedges: [u32; 3]) {
        let Some(source) = self.sources[sample.primitive as usize] else { return };
        let n = source.components;
        let corner = |i: u32| {
            let mut value = [0.0; MOST];
            value.iter_mut().zip(&source.values[i as usize * n..][..n]).for_each(|(to, &x)| *to = f64::from(x));
            value
        };
        let wanted = mixed(sample.corners.map(corner), sample.shares);
        let now = wedges.map(|wedge| self.now[wedge as usize]);
        let apart = |a: &[f64; MOST], b: &[f64; MOST]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let extent = apart(&now[1], &now[0]).max(apart(&now[2], &now[0]));
        let here = mixed(now, placed.shares);
        if apart(&here, &wanted) > SAME_CHART * SAME_CHART * extent {
            return;
        }
        let asked = &mut self.asked[placed.face as usize];
        for (to, [i, j]) in asked.matrix.iter_mut().zip(PAIRS) {
            *to += (sample.area * placed.shares[i] * placed.shares[j]) as f32;
        }
        for (to, share) in asked.right.iter_mut().zip(placed.shares) {
            for (i, to) in to.iter_mut().enumerate() {
                *to += (sample.area * share * (wanted[i] - here[i])) as f32;
            }
        }
    }

    /// The values that are best, by wedge; `wedge` tells that of each corner of each face.
    pub(super) fn solve(&self, wedge: impl Fn(u32) -> [u32; 3]) -> Vec<[f64; MOST]> {
        let around = Around::new(self.asked.len() as u32, self.now.len(), &wedge);
        let mut moves = vec![[0.0; MOST]; self.now.len()];
        let reach: Vec<[f64; MOST]> = (0..self.now.len())
            .map(|own| {
                let others = || around.of(own as u32).iter().flat_map(|corner| wedge(corner.face()));
                let apart =
                    |i: usize| others().map(move |other| (self.now[other as usize][i] - self.now[own][i]).abs());
                std::array::from_fn(|i| REACH * apart(i).fold(0.0, f64::max))
            })
            .collect();
        for _ in 0..SWEEPS {
            for own in 0..moves.len() {
                let (mut sum, mut right) = (0.0, [0.0; MOST]);
                for corner in around.of(own as u32) {
                    let (asked, wedges, at) = (&self.asked[corner.face() as usize], wedge(corner.face()), corner.at());
                    sum += f64::from(asked.matrix[PAIR[at][at]]);
                    right.iter_mut().zip(asked.right[at]).for_each(|(to, r)| *to += f64::from(r));
                    for other in [(at + 1) % 3, (at + 2) % 3] {
                        let share = f64::from(asked.matrix[PAIR[at][other]]);
                        let by = moves[wedges[other] as usize];
                        right.iter_mut().zip(by).for_each(|(to, by)| *to -= share * by);
                    }
                }
                if sum > 0.0 {
                    let best = right.map(|r| r / (sum * (1.0 + PULL)));
                    moves[own] = std::array::from_fn(|i| best[i].clamp(-reach[own][i], reach[own][i]));
                }
            }
        }
        self.now.iter().zip(moves).map(|(now, by)| std::array::from_fn(|i| now[i] + by[i])).collect()
    }
}
