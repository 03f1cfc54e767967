//! Fits the vertices of a finished level to the source: where they are (`shape`), their texture coordinates and colours
//! (`values`), and their normals, which may part where the level has become too coarse for one normal at a vertex
//! (`normals`).
//!
//! Samples of the source's surface are carried over to the nearest faces of the level, a batch at a time; what they ask is
//! summed up face by face. Knows positions, values and which vertex became which; no sequence, no metric.

mod around;
mod normals;
mod samples;
mod shape;
mod share;
mod surface;
mod values;

use super::{CutPrimitive, Replay, Welded, find};
use crate::mesh::Mesh;
use crate::mesh::layout::FieldKind;
use crate::mesh::visible::visible;
use crate::mesh::weld::NONE;
use crate::quadric::{dot, scale};
use normals::System;
use samples::{Sample, Samples};
use shape::Moves;
use surface::{Placed, Surface};
use values::Values;

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

/// Weight of where a vertex was, or what it had, against that of all samples around it.
const PULL: f64 = 0.05;

/// Sweeps over all vertices, each solved with its neighbours held.
const SWEEPS: usize = 8;

/// Furthest that anything goes from where it was, in differences to its neighbours: where samples say next to nothing of a
/// vertex, least squares say anything.
const REACH: f64 = 0.5;

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
        let roots: Vec<u32> = (0..self.vertex_up.len() as u32).map(|v| find(&mut self.vertex_up, v)).collect();
        let samples = Samples { mesh: self.mesh, welded: self.welded, importance, roots: &roots, faces: faces.len() };
        let mut surface = Surface::new(&faces, self.positions.iter().map(|p| p.map(f64::from)).collect());
        // Faces of all samples: where to look after the vertices have moved.
        let mut seen: Vec<u32> = Vec::new();
        let mut placed: Vec<Placed> = Vec::new();
        if fit.shape {
            let mut asked = vec![Moves::default(); faces.len()];
            samples.visit(|_, batch| {
                placed.clear();
                placed.resize(batch.len(), Placed::NOWHERE);
                surface.place_all(batch, &mut placed);
                for (sample, placed) in batch.iter().zip(&placed).filter(|(_, placed)| placed.face != NONE) {
                    asked[placed.face as usize].add(sample, placed, surface.corners(placed.face));
                }
                seen.extend(placed.iter().map(|placed| placed.face));
            });
            surface.fit_positions(&asked, fit.hold_borders);
        }
        let (wedges, first) = wedges(cuts);
        let wedges_of = |face: u32| {
            let Face { local, primitive, .. } = faces[face as usize];
            local.map(|local| first[primitive as usize] + local)
        };
        let fields = self.welded.fields.iter().filter(|field| fit.shape && field.kind != FieldKind::Normal);
        let mut values: Vec<Values> = fields
            .filter_map(|field| {
                let row = |&wedge: &u32| {
                    let row = &self.values[wedge as usize * self.welded.columns + field.offset..][..field.components];
                    std::array::from_fn(|i| row.get(i).map_or(0.0, |&x| f64::from(x)))
                };
                Values::new(self.mesh, field, faces.len(), wedges.iter().map(row).collect())
            })
            .collect();
        let mut normals = vec![System::default(); if fit.normals.is_some() { faces.len() } else { 0 }];
        // Else no sample need be placed again.
        let has_more = !values.is_empty() || !normals.is_empty();
        let mut add = |first: usize, batch: &[Sample]| {
            placed.clear();
            let hint = |i: usize| Placed { face: seen.get(first + i).copied().unwrap_or(NONE), ..Placed::NOWHERE };
            placed.extend((0..batch.len()).map(hint));
            surface.place_all(batch, &mut placed);
            for (sample, placed) in batch.iter().zip(&placed).filter(|(_, placed)| placed.face != NONE) {
                let wedges = wedges_of(placed.face);
                for values in &mut values {
                    values.add(sample, placed, wedges);
                }
                if let Some(system) = normals.get_mut(placed.face as usize) {
                    system.add(sample, placed);
                }
            }
        };
        if has_more {
            samples.visit(&mut add);
        }
        let solved: Vec<_> = values.iter().map(|values| (values.field, values.solve(wedges_of))).collect();
        for (field, solved) in solved {
            for (&wedge, solved) in wedges.iter().zip(solved) {
                let at = wedge as usize * self.welded.columns + field.offset;
                for (at, value) in (at..at + field.components).zip(solved) {
                    self.before.values.push((at, self.values[at]));
                    self.values[at] = value as f32;
                }
            }
        }
        if fit.shape {
            self.move_vertices(&surface);
        }
        if let Some(same) = fit.normals {
            self.fit_normals(&surface, cuts, &normals, same);
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
        for vertex in surface.vertices() {
            let to = &mut self.positions[vertex as usize];
            self.before.positions.push((vertex, *to));
            *to = surface.positions[vertex as usize].map(|x| x as f32);
        }
    }

    fn fit_normals(&self, surface: &Surface, cuts: &mut [CutPrimitive], asked: &[System], same: f64) {
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
        let fitted = surface.normals(asked, corner_normal, same);
        let mut face = 0;
        for (cut, now) in cuts.iter_mut().zip(&now) {
            let faces = cut.indices.len() / 3;
            if now.is_some() {
                let mut parted = Parted::new(cut.wedges.len());
                let (mut wedges, mut normals) = (Vec::new(), Vec::new());
                for (at, index) in cut.indices.iter_mut().enumerate() {
                    let normal = fitted.corners[face + at / 3][at % 3];
                    let number = parted.number(*index, normal);
                    if number as usize == wedges.len() {
                        wedges.push(cut.wedges[*index as usize]);
                        normals.push(fitted.normals[normal as usize].map(|x| x as f32));
                    }
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
}

/// The wedges of all primitives, and the place of each primitive's first one.
fn wedges(cuts: &[CutPrimitive]) -> (Vec<u32>, Vec<u32>) {
    let first = cuts.iter().scan(0, |sum, cut| {
        let first = *sum;
        *sum += cut.wedges.len() as u32;
        Some(first)
    });
    (cuts.iter().flat_map(|cut| &cut.wedges).copied().collect(), first.collect())
}

/// Numbers for local vertices of which some part.
struct Parted {
    /// The first entry of each vertex.
    first: Vec<u32>,
    /// Normal and the next entry of the same vertex; an entry's place is its number.
    entries: Vec<[u32; 2]>,
}

impl Parted {
    fn new(vertices: usize) -> Self {
        Self { first: vec![NONE; vertices], entries: Vec::with_capacity(vertices) }
    }

    /// The number of `vertex` with that normal; new ones come in order.
    fn number(&mut self, vertex: u32, normal: u32) -> u32 {
        let mut at = self.first[vertex as usize];
        while at != NONE && self.entries[at as usize][0] != normal {
            at = self.entries[at as usize][1];
        }
        if at == NONE {
            at = self.entries.len() as u32;
            self.entries.push([normal, self.first[vertex as usize]]);
            self.first[vertex as usize] = at;
        }
        at
    }
}

fn unit(n: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(n, n).sqrt();
    (length > 1e-30).then(|| scale(n, 1.0 / length))
}
