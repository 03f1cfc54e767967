//! Which corners of a level share a normal: those at one vertex that agree, the two that agree best first.

use super::normals::{Fitted, System};
use super::surface::Surface;
use super::unit;
use crate::mesh::weld::NONE;
use crate::quadric::{dot, scale};

/// The corners at one vertex, in groups. Kept between vertices, so that none needs memory of its own.
#[derive(Default)]
struct Groups {
    /// Face and corner of each.
    corners: Vec<(u32, usize)>,
    /// Group of each, named by its first corner.
    group: Vec<usize>,
    /// Sums of the normals of each group by area; `None` if it was joined to another one.
    sums: Vec<Option<[f64; 3]>>,
    /// Cosine between each two groups, row by row.
    cosines: Vec<f64>,
}

impl Groups {
    fn clear(&mut self) {
        self.corners.clear();
        self.group.clear();
        self.sums.clear();
    }

    /// Adds a corner as a group of its own.
    fn push(&mut self, corner: (u32, usize), normal: [f64; 3]) {
        self.group.push(self.corners.len());
        self.corners.push(corner);
        self.sums.push(Some(normal));
    }

    /// Cosines between group `i` and those before it.
    fn compare(&mut self, i: usize) {
        let Some(a) = self.sums[i] else { return };
        let squared = dot(a, a);
        for j in 0..i {
            let cosine = self.sums[j].map_or(f64::NEG_INFINITY, |b| dot(a, b) / (squared * dot(b, b)).sqrt());
            self.cosines[i * self.sums.len() + j] = cosine;
        }
    }

    /// Joins the two groups that agree best until none agree any more.
    fn join(&mut self, same: f64) {
        let n = self.sums.len();
        self.cosines.clear();
        self.cosines.resize(n * n, f64::NEG_INFINITY);
        (1..n).for_each(|i| self.compare(i));
        loop {
            let mut best = (same, None);
            for i in 1..n {
                for (j, &cosine) in self.cosines[i * n..][..i].iter().enumerate() {
                    if best.0 < cosine {
                        best = (cosine, Some((i, j)));
                    }
                }
            }
            let Some((i, j)) = best.1 else { return };
            let gone = self.sums[i].take().unwrap_or_default();
            self.sums[j] = self.sums[j].map(|sum| [0, 1, 2].map(|axis| sum[axis] + gone[axis]));
            self.group.iter_mut().filter(|group| **group == i).for_each(|group| *group = j);
            self.cosines[i * n..][..n].fill(f64::NEG_INFINITY);
            (i + 1..n).for_each(|other| self.cosines[other * n + i] = f64::NEG_INFINITY);
            self.compare(j);
            let Some(joined) = self.sums[j] else { return };
            for other in j + 1..n {
                if let Some(a) = self.sums[other] {
                    self.cosines[other * n + j] = dot(a, joined) / (dot(a, a) * dot(joined, joined)).sqrt();
                }
            }
        }
    }
}

impl Surface<'_> {
    /// Corners of one local vertex that agree share the mean of their normals.
    pub(super) fn share(
        &self,
        fit: &[[[f64; 3]; 3]],
        systems: &[System],
        normals: impl Fn(usize, usize) -> [f64; 3],
        same: f64,
    ) -> Fitted {
        let mut out = Fitted { corners: vec![[NONE; 3]; self.faces.len()], normals: Vec::new() };
        let mut groups = Groups::default();
        for face in 0..self.faces.len() {
            for at in 0..3 {
                if out.corners[face][at] != NONE {
                    continue;
                }
                let own = &self.faces[face];
                groups.clear();
                for other in self.ring(own.v[at]).iter().map(|corner| corner.face()) {
                    let there = &self.faces[other as usize];
                    for (corner, &normal) in fit[other as usize].iter().enumerate() {
                        if there.primitive == own.primitive && there.local[corner] == own.local[at] {
                            let normal = unit(normal).unwrap_or_else(|| normals(other as usize, corner));
                            // A corner that no sample speaks for follows the others.
                            let weight = systems[other as usize].area.max(1e-30);
                            groups.push((other, corner), scale(normal, weight));
                        }
                    }
                }
                groups.join(same);
                for (group, sum) in groups.sums.iter().enumerate() {
                    let Some(sum) = sum else { continue };
                    let number = out.normals.len() as u32;
                    let (first, corner) = groups.corners[group];
                    out.normals.push(unit(*sum).unwrap_or_else(|| normals(first as usize, corner)));
                    for (&(face, corner), _) in groups.corners.iter().zip(&groups.group).filter(|(_, at)| **at == group)
                    {
                        out.corners[face as usize][corner] = number;
                    }
                }
            }
        }
        out
    }
}
