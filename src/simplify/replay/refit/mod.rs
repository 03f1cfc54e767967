//! Fits the vertices of a finished level to the source: where they are (`shape`), and their normals, which may part where
//! the level has become too coarse for one normal at a vertex (`normals`).
//!
//! Samples of the source's surface are carried over to the nearest faces of the level. Knows positions, values and which
//! vertex became which; no sequence, no metric.

mod normals;
mod shape;
mod surface;

use std::collections::BTreeMap;

use super::{CutPrimitive, Replay, Welded, find};
use crate::mesh::Mesh;
use crate::mesh::layout::{Field, FieldKind};
use crate::mesh::visible::visible;
use crate::quadric::{cross, dot, scale, sub};
use surface::{Placed, Surface};

/// What of a cut is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Positions, texture coordinates, colours.
    pub shape: bool,
    /// Normals; vertices part where their faces' normals are further apart than the angle that has this cosine.
    pub normals: Option<f64>,
    /// Vertices of open borders stay where they are.
    pub hold_borders: bool,
}

/// By how much each triangle of the source counts in a fit.
#[derive(Clone, Debug)]
pub struct Importance {
    /// Share of it that shows ([`visible`]), at least [`UNSEEN`].
    seen: Vec<f32>,
    /// How much it bends, so that outlines pass there: 1 where it is flat.
    bends: Vec<f32>,
}

/// Weight of what cannot be seen from outside.
const UNSEEN: f32 = 0.1;

impl Importance {
    /// Of the triangles of `mesh`, which `welded` was made from.
    pub fn new(mesh: &Mesh, welded: &Welded) -> Self {
        let weld = &welded.weld;
        let vertex = |primitive: usize, i: u32| {
            weld.wedge_vertex[weld.stored[weld.stored_start[primitive] + i as usize] as usize]
        };
        Self {
            seen: visible(mesh).into_iter().map(|share| share.max(UNSEEN)).collect(),
            bends: shape::bends(mesh, weld.vertices, vertex),
        }
    }
}

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
    at: [f32; 3],
    /// Shading normal, unit length; that of its face where the source has none.
    normal: [f32; 3],
    /// Normal of its face, unit length.
    flat: [f32; 3],
    /// Area that it stands for, by how much of it shows.
    area: f32,
    /// Stored vertices of its triangle.
    corners: [u32; 3],
    /// Which of [`POINTS`] it is in its triangle.
    point: u8,
    /// Vertices of the level that its corners became.
    near: [u32; 3],
    /// Primitive.
    primitive: u32,
    /// Number of its triangle among those of all primitives.
    triangle: u32,
}

impl Sample {
    /// Shares of its triangle's corners.
    fn shares(&self) -> [f64; 3] {
        POINTS[self.point as usize]
    }
}

const THIRD: f64 = 1.0 / 3.0;

/// Points of a triangle: the one that stands for all of it, and the three that each stand for a third.
const POINTS: [[f64; 3]; 4] = [
    [THIRD; 3],
    [2.0 * THIRD, 0.5 * THIRD, 0.5 * THIRD],
    [0.5 * THIRD, 2.0 * THIRD, 0.5 * THIRD],
    [0.5 * THIRD, 0.5 * THIRD, 2.0 * THIRD],
];

/// Samples of a face of the level that are enough, and that are plenty.
const ENOUGH: usize = 8;
const PLENTY: usize = 16;

/// What a fit has changed of a surface, to be taken back.
#[derive(Debug, Default)]
pub(super) struct Before {
    positions: Vec<(u32, [f32; 3])>,
    values: Vec<(usize, f32)>,
}

impl Replay<'_> {
    /// Fits a cut to the source. What it moves goes back where it was at the next [`Self::advance`].
    pub fn refit(&mut self, cuts: &mut [CutPrimitive], importance: &Importance, fit: Fit) {
        self.take_back();
        let faces = self.faces(cuts);
        let samples = self.samples(faces.len(), importance);
        let mut surface = Surface::new(&faces, self.positions.iter().map(|p| p.map(f64::from)).collect());
        let mut placed = surface.places(&samples, None);
        if fit.shape {
            surface.fit_positions(&samples, &placed, &importance.bends, fit.hold_borders);
            placed = surface.places(&samples, Some(&placed));
            for field in self.welded.fields.clone().iter().filter(|field| field.kind != FieldKind::Normal) {
                match field.components {
                    1 => self.fit_values::<1>(&surface, cuts, field, &samples, &placed),
                    2 => self.fit_values::<2>(&surface, cuts, field, &samples, &placed),
                    3 => self.fit_values::<3>(&surface, cuts, field, &samples, &placed),
                    4 => self.fit_values::<4>(&surface, cuts, field, &samples, &placed),
                    _ => {}
                }
            }
            self.move_vertices(&surface);
        }
        if let Some(same) = fit.normals {
            self.fit_normals(&surface, cuts, &samples, &placed, same);
        }
    }

    /// Takes back what a fit has changed.
    pub(super) fn take_back(&mut self) {
        let before = std::mem::take(&mut self.before);
        for (vertex, position) in before.positions {
            self.positions[vertex as usize] = position;
        }
        for (at, value) in before.values.into_iter().rev() {
            self.values[at] = value;
        }
    }

    fn move_vertices(&mut self, surface: &Surface) {
        let mut vertices: Vec<u32> = surface.faces.iter().flat_map(|face| face.v).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for vertex in vertices {
            let to = &mut self.positions[vertex as usize];
            self.before.positions.push((vertex, *to));
            *to = surface.positions[vertex as usize].map(|x| x as f32);
        }
    }

    fn fit_values<const N: usize>(
        &mut self,
        surface: &Surface,
        cuts: &[CutPrimitive],
        field: &Field,
        samples: &[Sample],
        placed: &[Option<Placed>],
    ) {
        // Wedges by number, those of all primitives.
        let mut first = vec![0u32];
        for cut in cuts {
            first.push(first[first.len() - 1] + cut.wedges.len() as u32);
        }
        let columns = self.welded.columns;
        let places: Vec<usize> =
            cuts.iter().flat_map(|cut| &cut.wedges).map(|&wedge| wedge as usize * columns + field.offset).collect();
        let mut values: Vec<[f64; N]> =
            places.iter().map(|&at| std::array::from_fn(|i| f64::from(self.values[at + i]))).collect();
        let wedge = |face: u32, at: usize| {
            let Face { local, primitive, .. } = surface.faces[face as usize];
            first[primitive as usize] + local[at]
        };
        let mesh = self.mesh;
        surface.fit_values(placed, samples, wedge, &mut values, |sample| shape::value_at(mesh, field, sample));
        for (at, values) in places.into_iter().zip(values) {
            for (at, value) in (at..).zip(values) {
                self.before.values.push((at, self.values[at]));
                self.values[at] = value as f32;
            }
        }
    }

    fn fit_normals(
        &mut self,
        surface: &Surface,
        cuts: &mut [CutPrimitive],
        samples: &[Sample],
        placed: &[Option<Placed>],
        same: f64,
    ) {
        let now: Vec<Option<Vec<[f32; 3]>>> = (self.mesh.primitives.iter().zip(&*cuts))
            .map(|(source, cut)| source.attribute("NORMAL").map(|_| self.normals(cut)))
            .collect();
        if now.iter().all(Option::is_none) {
            return;
        }
        let corner_normal = |face: usize, at: usize| {
            let Face { local, primitive, .. } = surface.faces[face];
            let normals = now[primitive as usize].as_ref();
            normals.map_or([0.0, 0.0, 1.0], |normals| normals[local[at] as usize].map(f64::from))
        };
        let fitted = surface.normals(samples, placed, corner_normal, same);
        let mut face = 0;
        for (cut, now) in cuts.iter_mut().zip(&now) {
            let faces = cut.indices.len() / 3;
            if now.is_some() {
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
                (cut.wedges, cut.normals) = (wedges, Some(normals));
            }
            face += faces;
        }
    }

    /// The triangles of all primitives, in order.
    fn faces(&self, cuts: &[CutPrimitive]) -> Vec<Face> {
        let mut faces = Vec::new();
        for (primitive, cut) in (0..).zip(cuts) {
            for t in cut.indices.chunks_exact(3) {
                let local = [t[0], t[1], t[2]];
                let v = local.map(|i| self.wedge_vertex[cut.wedges[i as usize] as usize]);
                faces.push(Face { v, local, primitive });
            }
        }
        faces
    }

    /// Samples of the source for a level of `faces` faces.
    fn samples(&mut self, faces: usize, importance: &Importance) -> Vec<Sample> {
        let total = self.mesh.triangles();
        let step = (total / (PLENTY * faces).max(1)).max(1);
        let points = if total < ENOUGH * faces { 1..4 } else { 0..1 };
        let mut out = Vec::with_capacity(total / step * points.len());
        let mut first = 0;
        for (primitive, source) in (0..).zip(&self.mesh.primitives) {
            let normals = source.attribute("NORMAL").filter(|a| a.components == 3);
            let start = self.welded.weld.stored_start[primitive as usize];
            for (number, t) in source.indices.chunks_exact(3).enumerate().step_by(step) {
                let corners = [t[0], t[1], t[2]];
                let p = corners.map(|i| source.positions()[i as usize].map(f64::from));
                let across = cross(sub(p[1], p[0]), sub(p[2], p[0]));
                let Some(flat) = unit(across) else { continue };
                let triangle = first + number;
                let area = dot(across, across).sqrt() / 2.0 * f64::from(importance.seen[triangle]);
                let n = corners.map(|i| {
                    normals.map_or(flat, |a| [0, 1, 2].map(|axis| f64::from(a.values[i as usize * 3 + axis])))
                });
                let near = corners.map(|i| {
                    let wedge = self.welded.weld.stored[start + i as usize];
                    find(&mut self.vertex_up, self.welded.weld.wedge_vertex[wedge as usize])
                });
                for point in points.clone() {
                    let w = POINTS[point];
                    let mix = |v: &[[f64; 3]; 3]| [0, 1, 2].map(|i| v[0][i] * w[0] + v[1][i] * w[1] + v[2][i] * w[2]);
                    let Some(normal) = unit(mix(&n)) else { continue };
                    let narrow = |v: [f64; 3]| v.map(|x| x as f32);
                    out.push(Sample {
                        at: narrow(mix(&p)),
                        normal: narrow(normal),
                        flat: narrow(flat),
                        area: (area / points.len() as f64) as f32,
                        corners,
                        point: point as u8,
                        near,
                        primitive,
                        triangle: triangle as u32,
                    });
                }
            }
            first += source.indices.len() / 3;
        }
        out
    }
}

fn unit(n: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(n, n).sqrt();
    (length > 1e-30).then(|| scale(n, 1.0 / length))
}
