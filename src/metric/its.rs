//! `its`: geometry and appearance in one quadric, memoryless; the default metric.
//!
//! Each vertex carries the plane quadrics of its faces and of the borders, seams and creases at it; each wedge carries
//! the quadrics of the linear attribute fields of its faces. A pair is priced by the least of their sum when every
//! attribute takes its best value (Schur complement), so the merged position *and* the merged attributes are solved,
//! never interpolated. Quadrics are rebuilt from the current surface after each contraction (effort `balanced`), or those
//! of the merged vertices are added up (effort `fast`).
//!
//! Papers: H. Hoppe, *New quadric metric for simplifying meshes with appearance attributes*, 1999, sections 4 and 5
//! (gradient form, wedges, memoryless); P. Lindstrom, G. Turk, *Fast and memory efficient polygonal simplification*,
//! 1998 (memoryless); the instanced-model paper (ITS, 2012), section 3.3 (one error over all attributes). Departures:
//! attribute weights in the price are small, the sum is not divided by area, seams are held by planes and not locked.

use super::{ErrorMetric, Placement, Price};
use crate::mesh::topology::{Contraction, EdgeKind, Face, Topology, WedgePairs};
use crate::mesh::weld::NONE;
use crate::quadric::{FieldQuadric, Quadric, cross, dot, lerp, scale, sub};

/// Weights of the planes that hold edges in place, against the weight of a face's own plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeWeights {
    /// Open borders.
    pub border: f64,
    /// Discontinuities of texture coordinates, colour or material.
    pub seam: f64,
    /// Discontinuities of the normal alone.
    pub crease: f64,
}

/// A face's own quadrics.
#[derive(Clone, Copy, Debug)]
struct FaceQuadric<const M: usize> {
    plane: Quadric,
    field: FieldQuadric<M>,
    /// Cross product of two edges: twice the area long.
    normal: [f64; 3],
    area: f64,
}

/// The metric, for wedges of exactly `M` values.
#[derive(Clone, Debug)]
pub struct Its<const M: usize> {
    edges: EdgeWeights,
    placement: Placement,
    /// Quadrics are rebuilt from the current surface; else those of merged vertices are added up.
    memoryless: bool,
    faces: Vec<FaceQuadric<M>>,
    /// By which the area of each face counts; none: all 1.
    weights: Vec<f64>,
    vertices: Vec<Quadric>,
    areas: Vec<f64>,
    wedges: Vec<FieldQuadric<M>>,
    neighbours: Vec<u32>,
}

impl<const M: usize> Its<M> {
    /// Prepares the quadrics of the whole surface, which must have exactly `M` columns.
    /// `weights`: by which the area of each face counts, or none.
    pub fn new(
        surface: &Topology,
        edges: EdgeWeights,
        placement: Placement,
        memoryless: bool,
        weights: Vec<f64>,
    ) -> Self {
        let weight = |face: usize| weights.get(face).copied().unwrap_or(1.0);
        assert!(surface.columns == M, "the metric is built for the surface's columns");
        let mut out = Self {
            edges,
            placement,
            memoryless,
            faces: (surface.faces.iter().enumerate()).map(|(i, face)| face_quadric(surface, face, weight(i))).collect(),
            weights,
            vertices: vec![Quadric::default(); surface.positions.len()],
            areas: vec![0.0; surface.positions.len()],
            wedges: vec![FieldQuadric::default(); surface.wedge_vertex.len()],
            neighbours: Vec::new(),
        };
        for vertex in 0..surface.positions.len() as u32 {
            out.gather(surface, vertex);
        }
        out
    }

    /// Sums the quadrics of the faces at `vertex` into the vertex and its wedges.
    #[inline]
    fn gather(&mut self, surface: &Topology, vertex: u32) {
        let mut sum = Quadric::default();
        let mut area = 0.0;
        for wedge in surface.wedges(vertex) {
            self.wedges[wedge as usize] = FieldQuadric::default();
        }
        for &id in surface.ring(vertex) {
            let face = &surface.faces[id as usize];
            let quadric = &self.faces[id as usize];
            let corner = face.corner(vertex).expect("a ring holds faces of its vertex");
            sum.add(&quadric.plane);
            area += quadric.area;
            self.wedges[face.w[corner] as usize].add(&quadric.field);
            for edge in [corner, (corner + 2) % 3] {
                let weight = match face.edges[edge] {
                    EdgeKind::Interior => continue,
                    EdgeKind::Crease => self.edges.crease,
                    EdgeKind::Seam => self.edges.seam,
                    EdgeKind::Border => self.edges.border,
                };
                add_edge_plane(surface, face, edge, quadric.normal, weight, &mut sum);
            }
        }
        self.vertices[vertex as usize] = sum;
        self.areas[vertex as usize] = area;
    }

    /// The geometric quadric of the pair, and the whole one with attributes at their best.
    #[inline]
    fn combined(&self, surface: &Topology, a: u32, b: u32) -> Option<(Quadric, Quadric)> {
        let mut plane = self.vertices[a as usize];
        plane.add(&self.vertices[b as usize]);
        let mut whole = plane;
        if M == 0 {
            return Some((plane, whole));
        }
        let (wa, wb) = (surface.first_wedge(a), surface.first_wedge(b));
        if surface.next_wedge(wa) == NONE && surface.next_wedge(wb) == NONE {
            let mut field = self.wedges[wa as usize];
            field.add(&self.wedges[wb as usize]);
            field.reduce_into(&mut whole);
            return Some((plane, whole));
        }
        let pairs = surface.joined_wedges(a, b)?;
        let mut done = [false; WedgePairs::MOST];
        for first in 0..pairs.len() {
            if !done[first] {
                self.class_sum(&pairs, first, &mut done).reduce_into(&mut whole);
            }
        }
        for (vertex, side) in [(a, 0), (b, 1)] {
            for wedge in surface.wedges(vertex) {
                if !pairs.iter().any(|p| p[side] == wedge) {
                    self.wedges[wedge as usize].reduce_into(&mut whole);
                }
            }
        }
        Some((plane, whole))
    }

    /// Sum over all wedges that pair `first` joins, directly or through later pairs; marks those pairs as done.
    fn class_sum(&self, pairs: &WedgePairs, first: usize, done: &mut [bool; WedgePairs::MOST]) -> FieldQuadric<M> {
        let mut class = [false; WedgePairs::MOST];
        let mut sum = FieldQuadric::default();
        let mut next = Some(first);
        while let Some(at) = next {
            for side in [0, 1] {
                let wedge = pairs[at][side];
                if !pairs.iter().zip(class).any(|(p, inside)| inside && p[side] == wedge) {
                    sum.add(&self.wedges[wedge as usize]);
                }
            }
            (class[at], done[at]) = (true, true);
            next = (0..pairs.len()).find(|&i| {
                let touches = |p: &[u32; 2]| p[0] == pairs[i][0] || p[1] == pairs[i][1];
                !done[i] && pairs.iter().zip(class).any(|(p, inside)| inside && touches(p))
            });
        }
        sum
    }

    #[inline]
    fn price_optimal(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (plane, whole) = self.combined(surface, a, b)?;
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let middle = lerp(pa, pb, 0.5);
        let mut best = (whole.eval(middle), middle);
        let solved = whole.minimum(middle).filter(|&p| near(p, pa, pb));
        for p in [Some(pa), Some(pb), solved].into_iter().flatten() {
            let cost = whole.eval(p);
            if cost < best.0 {
                best = (cost, p);
            }
        }
        Some(self.finish(a, b, &plane, best.0, best.1))
    }

    #[inline]
    fn finish(&self, a: u32, b: u32, plane: &Quadric, cost: f64, position: [f64; 3]) -> Price {
        let area = self.areas[a as usize] + self.areas[b as usize];
        let geometric = plane.eval(position).max(0.0);
        let error = if area > 0.0 { (geometric / area).sqrt() } else { 0.0 };
        Price { cost: cost.max(0.0), error, position, keep_second: false }
    }

    /// Cost of merging `gone` into `kept` with everything at `kept` as it is; `None` if a wedge of `gone` has no one
    /// wedge at `kept` to merge with.
    fn subset_cost(&self, surface: &Topology, kept: u32, gone: u32) -> Option<(f64, Quadric)> {
        let pairs = surface.joined_wedges(kept, gone)?;
        let position = surface.positions[kept as usize];
        let mut plane = self.vertices[kept as usize];
        plane.add(&self.vertices[gone as usize]);
        let mut cost = plane.eval(position);
        for wedge in surface.wedges(gone) {
            let mut partners = pairs.iter().filter(|p| p[1] == wedge);
            let partner = partners.next()?[0];
            if partners.next().is_some() {
                return None;
            }
            cost += self.wedges[wedge as usize].eval_fixed(position, surface.value(partner));
        }
        for wedge in surface.wedges(kept) {
            cost += self.wedges[wedge as usize].eval_fixed(position, surface.value(wedge));
        }
        Some((cost, plane))
    }

    fn price_subset(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let first = self.subset_cost(surface, a, b);
        let second = self.subset_cost(surface, b, a);
        let keep_second = match (&first, &second) {
            (Some(x), Some(y)) => y.0 < x.0,
            (None, _) => true,
            _ => false,
        };
        let (cost, plane) = if keep_second { second? } else { first? };
        let kept = if keep_second { b } else { a };
        let price = self.finish(a, b, &plane, cost, surface.positions[kept as usize]);
        Some(Price { keep_second, ..price })
    }
}

impl<const M: usize> ErrorMetric for Its<M> {
    #[inline]
    fn price(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        match self.placement {
            Placement::Optimal => self.price_optimal(surface, a, b),
            Placement::Subset => self.price_subset(surface, a, b),
        }
    }

    fn price_at(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> Option<Price> {
        if self.placement == Placement::Subset {
            let keep_second = position == surface.positions[b as usize];
            let (kept, gone) = if keep_second { (b, a) } else { (a, b) };
            if position != surface.positions[kept as usize] {
                return None;
            }
            let (cost, plane) = self.subset_cost(surface, kept, gone)?;
            return Some(Price { keep_second, ..self.finish(a, b, &plane, cost, position) });
        }
        let (plane, whole) = self.combined(surface, a, b)?;
        Some(self.finish(a, b, &plane, whole.eval(position), position))
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        let kept = done.kept;
        for &[stays, goes] in &done.merged {
            let gone = self.wedges[goes as usize];
            self.wedges[stays as usize].add(&gone);
        }
        if self.placement == Placement::Optimal && M > 0 {
            let position = surface.positions[kept as usize];
            let mut wedge = surface.first_wedge(kept);
            while wedge != NONE {
                if let Some(values) = self.wedges[wedge as usize].solve(position) {
                    surface.value_mut(wedge).copy_from_slice(&values);
                }
                wedge = surface.next_wedge(wedge);
            }
        }
        if !self.memoryless {
            let gone = self.vertices[done.gone as usize];
            self.vertices[kept as usize].add(&gone);
            self.areas[kept as usize] += self.areas[done.gone as usize];
            return;
        }
        for &id in surface.ring(kept) {
            let weight = self.weights.get(id as usize).copied().unwrap_or(1.0);
            self.faces[id as usize] = face_quadric(surface, &surface.faces[id as usize], weight);
        }
        let mut neighbours = std::mem::take(&mut self.neighbours);
        surface.neighbours(kept, &mut neighbours);
        self.gather(surface, kept);
        for &vertex in &neighbours {
            self.gather(surface, vertex);
        }
        self.neighbours = neighbours;
    }
}

/// A solution further from the edge's middle than this many edge lengths comes from a nearly flat quadric.
const FARTHEST: f64 = 8.0;

#[inline]
fn near(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> bool {
    let along = sub(b, a);
    let off = sub(p, lerp(a, b, 0.5));
    dot(off, off) <= FARTHEST * FARTHEST * dot(along, along)
}

#[inline]
fn face_quadric<const M: usize>(surface: &Topology, face: &Face, weight: f64) -> FaceQuadric<M> {
    let p = surface.corners(face);
    let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
    let length = dot(normal, normal).sqrt();
    let area = 0.5 * length * weight;
    let plane = if length > 0.0 {
        let unit = scale(normal, 1.0 / length);
        Quadric::plane(unit, -dot(unit, p[0]), area)
    } else {
        Quadric::default()
    };
    let field = FieldQuadric::triangle(&p, face.w.map(|w| surface.value(w)), normal, area);
    FaceQuadric { plane, field, normal, area }
}

/// Adds the plane through an edge, perpendicular to its face, weighted by the squared length of the edge.
fn add_edge_plane(s: &Topology, face: &Face, edge: usize, normal: [f64; 3], weight: f64, to: &mut Quadric) {
    let a = s.positions[face.v[edge] as usize];
    let along = sub(s.positions[face.v[(edge + 1) % 3] as usize], a);
    let across = cross(normal, along);
    let squared = dot(across, across);
    if weight > 0.0 && squared > 0.0 {
        to.add_plane(across, -dot(across, a), weight * dot(along, along) / squared);
    }
}
