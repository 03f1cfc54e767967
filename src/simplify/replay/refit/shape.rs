//! Where the vertices of a level are, and with them their texture coordinates and colours: moved to where the level lies
//! closest to the samples (least squares: distance from the samples' planes, and a little from the samples themselves).
//!
//! Contractions place a vertex by the surface of the moment; what many of them add up to is seen only here. Samples count by
//! the area that shows and by how much the surface bends there: it is at bends that outlines pass, and against anything
//! behind it an outline is what is seen first.

use super::Sample;
use super::surface::{Placed, Surface};
use crate::mesh::layout::Field;
use crate::mesh::{Mesh, Primitive};
use crate::quadric::{cross, dot, inverse, sub};

/// Weight of the distance from a sample itself against that from its plane: vertices should not slide.
const POINT: f64 = 0.02;

/// Weight of where a vertex was, or what it had, against that of all samples around it.
const PULL: f64 = 0.05;

/// A sample this far off, in edges of its face, counts half: it may belong to something that is gone.
const FAR: f64 = 0.3;

/// Sweeps over all vertices, each solved with its neighbours held.
const SWEEPS: usize = 8;

/// Furthest that anything goes from where it was, in differences to its neighbours: where samples say next to nothing of a
/// vertex, least squares say anything.
const REACH: f64 = 0.5;

/// A sample whose values are further from the face's than this share of the face's extent has another chart's.
const SAME_CHART: f64 = 0.25;

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

/// A sample as its face sees it.
struct Spot {
    sample: u32,
    shares: [f64; 3],
    weight: f64,
}

/// Samples by face.
struct Spots {
    start: Vec<u32>,
    spots: Vec<Spot>,
}

impl Spots {
    /// `keep` gives the weight of a sample on its face, or refuses it.
    fn new(faces: usize, placed: &[Option<Placed>], keep: impl Fn(usize, &Placed) -> Option<f64>) -> Self {
        let mut list: Vec<(u32, Spot)> = Vec::with_capacity(placed.len());
        for (sample, on) in placed.iter().enumerate() {
            let Some(on) = on else { continue };
            if let Some(weight) = keep(sample, on) {
                list.push((on.face, Spot { sample: sample as u32, shares: on.weights, weight }));
            }
        }
        // Stable: samples of a face stay in their order.
        list.sort_by_key(|(face, _)| *face);
        let mut start = vec![0u32; faces + 1];
        for (face, _) in &list {
            start[*face as usize + 1] += 1;
        }
        for at in 1..start.len() {
            start[at] += start[at - 1];
        }
        Self { start, spots: list.into_iter().map(|(_, spot)| spot).collect() }
    }

    fn on(&self, face: u32) -> &[Spot] {
        &self.spots[self.start[face as usize] as usize..self.start[face as usize + 1] as usize]
    }
}

impl Surface<'_> {
    /// Moves the vertices, but for those of borders where these are held; `bends` as [`bends`] gives them.
    pub(super) fn fit_positions(
        &mut self,
        samples: &[Sample],
        placed: &[Option<Placed>],
        bends: &[f32],
        hold_borders: bool,
    ) {
        let spots = Spots::new(self.faces.len(), placed, |number, on| {
            let sample = &samples[number];
            let p = self.faces[on.face as usize].v.map(|v| self.positions[v as usize]);
            let off = sub(mixed(p, on.weights), sample.at.map(f64::from));
            let longest = [1, 2].map(|i| sub(p[i], p[0])).map(|e| dot(e, e)).into_iter().fold(0.0, f64::max);
            let doubt = 1.0 + dot(off, off) / (FAR * FAR * longest).max(f64::MIN_POSITIVE);
            Some(f64::from(sample.area * bends[sample.triangle as usize]) / doubt)
        });
        let start = self.positions.clone();
        let is_held = if hold_borders { self.on_borders() } else { vec![false; start.len()] };
        let mut vertices: Vec<u32> = self.faces.iter().flat_map(|face| face.v).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.retain(|&v| !is_held[v as usize]);
        let longest = |vertex: u32| {
            let ends = self.ring(vertex).iter().flat_map(|&face| self.faces[face as usize].v);
            let squares = ends.map(|end| sub(start[end as usize], start[vertex as usize])).map(|edge| dot(edge, edge));
            squares.fold(0.0, f64::max).sqrt()
        };
        let reach: Vec<f64> = vertices.iter().map(|&vertex| REACH * longest(vertex)).collect();
        for _ in 0..SWEEPS {
            for (&vertex, &reach) in vertices.iter().zip(&reach) {
                self.settle(vertex, start[vertex as usize], reach, samples, &spots);
            }
        }
        self.turn();
    }

    /// Moves one vertex to where it is best while the others are where they are, but not out of `reach` of its `start`.
    fn settle(&mut self, vertex: u32, start: [f64; 3], reach: f64, samples: &[Sample], spots: &Spots) {
        let (mut matrix, mut right, mut sum) = ([0.0f64; 6], [0.0f64; 3], 0.0);
        for &face in self.ring(vertex) {
            let v = self.faces[face as usize].v;
            let at = v.iter().position(|&other| other == vertex).expect("the ring's faces have the vertex");
            let p = v.map(|v| self.positions[v as usize]);
            for spot in spots.on(face) {
                let sample = &samples[spot.sample as usize];
                let n = sample.flat.map(f64::from);
                let off = sub(mixed(p, spot.shares), sample.at.map(f64::from));
                let distance = dot(n, off);
                let share = spot.shares[at];
                let weight = spot.weight * share * share;
                sum += weight;
                matrix[0] += weight * (n[0] * n[0] + POINT);
                matrix[1] += weight * n[0] * n[1];
                matrix[2] += weight * n[0] * n[2];
                matrix[3] += weight * (n[1] * n[1] + POINT);
                matrix[4] += weight * n[1] * n[2];
                matrix[5] += weight * (n[2] * n[2] + POINT);
                for axis in 0..3 {
                    right[axis] -= spot.weight * share * (n[axis] * distance + POINT * off[axis]);
                }
            }
        }
        let pull = PULL * sum;
        if pull <= 0.0 {
            return;
        }
        for at in [0, 3, 5] {
            matrix[at] += pull;
        }
        let Some(rows) = inverse(matrix) else { return };
        let position = &mut self.positions[vertex as usize];
        let right = [0, 1, 2].map(|axis| right[axis] + pull * (start[axis] - position[axis]));
        for (to, row) in position.iter_mut().zip(rows) {
            *to += dot(row, right);
        }
        let off = sub(*position, start);
        let distance = dot(off, off).sqrt();
        if reach < distance {
            *position = [0, 1, 2].map(|axis| start[axis] + off[axis] * (reach / distance));
        }
    }

    /// Fits the values of one field, which `wedge` tells for each corner of each face by number, to those of the samples,
    /// which `wanted` tells.
    pub(super) fn fit_values<const N: usize>(
        &self,
        placed: &[Option<Placed>],
        samples: &[Sample],
        wedge: impl Fn(u32, usize) -> u32,
        values: &mut [[f64; N]],
        wanted: impl Fn(&Sample) -> Option<[f64; N]>,
    ) {
        let wanted: Vec<Option<[f64; N]>> = samples.iter().map(wanted).collect();
        let corners = |face: u32, values: &[[f64; N]]| [0, 1, 2].map(|at| values[wedge(face, at) as usize]);
        let spots = Spots::new(self.faces.len(), placed, |number, on| {
            let wanted = wanted[number].as_ref()?;
            let now = corners(on.face, values);
            let apart = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            let extent = apart(&now[1], &now[0]).max(apart(&now[2], &now[0]));
            let is_near = apart(&mixed(now, on.weights), wanted) <= SAME_CHART * SAME_CHART * extent;
            is_near.then_some(f64::from(samples[number].area))
        });
        let mut around: Vec<Vec<(u32, usize)>> = vec![Vec::new(); values.len()];
        for face in 0..self.faces.len() as u32 {
            (0..3).for_each(|at| around[wedge(face, at) as usize].push((face, at)));
        }
        let start = values.to_vec();
        let reach: Vec<[f64; N]> = (around.iter().zip(&start))
            .map(|(around, own)| {
                let others = || around.iter().flat_map(|&(face, _)| corners(face, &start));
                std::array::from_fn(|i| REACH * others().map(|other| (other[i] - own[i]).abs()).fold(0.0, f64::max))
            })
            .collect();
        for _ in 0..SWEEPS {
            for (own, around) in around.iter().enumerate() {
                let (mut sum, mut right) = (0.0, [0.0; N]);
                for &(face, at) in around {
                    let now = corners(face, values);
                    for spot in spots.on(face) {
                        let share = spot.weight * spot.shares[at];
                        sum += share * spot.shares[at];
                        let (now, wanted) = (mixed(now, spot.shares), wanted[spot.sample as usize]);
                        let wanted = wanted.expect("samples without a value have no spot");
                        (0..N).for_each(|i| right[i] += share * (wanted[i] - now[i]));
                    }
                }
                let pull = PULL * sum;
                if pull > 0.0 {
                    for i in 0..N {
                        let (start, reach) = (start[own][i], reach[own][i]);
                        let value = values[own][i] + (right[i] + pull * (start - values[own][i])) / (sum + pull);
                        values[own][i] = value.clamp(start - reach, start + reach);
                    }
                }
            }
        }
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

/// Weighted sum of the corners.
fn mixed<const N: usize>(corners: [[f64; N]; 3], shares: [f64; 3]) -> [f64; N] {
    std::array::from_fn(|i| corners[0][i] * shares[0] + corners[1][i] * shares[1] + corners[2][i] * shares[2])
}

/// The values of `field` at a sample.
pub(super) fn value_at<const N: usize>(mesh: &Mesh, field: &Field, sample: &Sample) -> Option<[f64; N]> {
    let primitive = &mesh.primitives[sample.primitive as usize];
    let attribute = primitive.attribute(&field.name).filter(|a| a.components == N)?;
    let corner = |i: u32| std::array::from_fn(|c| f64::from(attribute.values[i as usize * N + c]));
    Some(mixed(sample.corners.map(corner), sample.shares()))
}
