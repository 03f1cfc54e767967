//! The surface of a level, on which points of the source find their places.

use rayon::prelude::*;

use super::{Face, Sample, unit};
use crate::quadric::{cross, dot, sub};

/// The level's surface.
pub(super) struct Surface<'a> {
    pub(super) faces: &'a [Face],
    pub(super) positions: Vec<[f64; 3]>,
    flat: Vec<[f64; 3]>,
    /// Middle and radius of each face: most faces are further off than the best one, which this tells soon.
    balls: Vec<[f64; 4]>,
    start: Vec<u32>,
    ring: Vec<u32>,
}

/// A sample on its face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) face: u32,
    /// Shares of the face's corners, which sum to 1.
    pub(super) weights: [f64; 3],
}

/// A sample may lie on a face that is turned from its own by less than this: cosine of 72°.
const SAME_SIDE: f64 = 0.31;

/// Longest walk over the level in search of the nearest face, in vertices.
const MOST_STEPS: usize = 8;

impl<'a> Surface<'a> {
    /// Of `faces` over `positions`.
    pub(super) fn new(faces: &'a [Face], positions: Vec<[f64; 3]>) -> Self {
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
        let mut out = Self { faces, positions, flat: Vec::new(), balls: Vec::new(), start, ring };
        out.turn();
        out
    }

    /// Brings what is known of the faces up to date with the positions.
    pub(super) fn turn(&mut self) {
        let corners = |face: &Face| face.v.map(|v| self.positions[v as usize]);
        let normal = |face: &Face| {
            let p = corners(face);
            unit(cross(sub(p[1], p[0]), sub(p[2], p[0]))).unwrap_or([0.0; 3])
        };
        let ball = |face: &Face| {
            let p = corners(face);
            let middle = [0, 1, 2].map(|axis| (p[0][axis] + p[1][axis] + p[2][axis]) / 3.0);
            let squared = p.map(|p| sub(p, middle)).map(|off| dot(off, off)).into_iter().fold(0.0, f64::max);
            [middle[0], middle[1], middle[2], squared.sqrt()]
        };
        self.flat = self.faces.iter().map(normal).collect();
        self.balls = self.faces.iter().map(ball).collect();
    }

    /// Where each sample is on the surface; `before` tells where it was before the vertices moved.
    pub(super) fn places(&self, samples: &[Sample], before: Option<&[Option<Placed>]>) -> Vec<Option<Placed>> {
        let place = |tried: &mut Vec<u32>, (number, sample): (usize, &Sample)| {
            let hint = before.and_then(|before| before[number]).map(|placed| self.faces[placed.face as usize].v);
            self.place(sample, hint.unwrap_or(sample.near), tried)
        };
        samples.par_iter().enumerate().map_init(Vec::new, place).collect()
    }

    /// The faces at a vertex.
    pub(super) fn ring(&self, vertex: u32) -> &[u32] {
        &self.ring[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }

    /// The face of the sample's primitive, turned like it, that is nearest to it on a walk downhill.
    /// The walk begins at the vertices `near`; `tried` is scratch room.
    fn place(&self, sample: &Sample, near: [u32; 3], tried: &mut Vec<u32>) -> Option<Placed> {
        let mut best: Option<(f64, Placed)> = None;
        // Distance of the best.
        let mut reach = f64::INFINITY;
        tried.clear();
        let (at, flat) = (sample.at.map(f64::from), sample.flat.map(f64::from));
        let mut ask = |vertex: u32, best: &mut Option<(f64, Placed)>| {
            for &face in self.ring(vertex) {
                if tried.contains(&face) {
                    continue;
                }
                tried.push(face);
                let own = &self.faces[face as usize];
                if own.primitive != sample.primitive || dot(self.flat[face as usize], flat) < SAME_SIDE {
                    continue;
                }
                let [x, y, z, radius] = self.balls[face as usize];
                let off = sub([x, y, z], at);
                let most = reach + radius;
                if dot(off, off) > most * most {
                    continue;
                }
                let (squared, weights) = nearest(at, own.v.map(|v| self.positions[v as usize]));
                if best.is_none_or(|(least, _)| squared < least) {
                    *best = Some((squared, Placed { face, weights }));
                    reach = squared.sqrt();
                }
            }
        };
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
