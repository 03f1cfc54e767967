//! `its`: geometry and appearance in one quadric, memoryless; the default metric.
//!
//! Each vertex carries a quadric: the planes of its faces and of the borders, seams and creases at it, and how far the
//! attribute fields of its faces differ from their mean. Each wedge carries that mean: one linear field for each value,
//! with a weight. A pair is priced by the least of the sum when every attribute takes its best value, so the merged
//! position *and* the merged attributes are solved, never interpolated. Quadrics are rebuilt from the current surface
//! after each contraction (effort `balanced`), or those of the merged vertices are added up (effort `fast`).
//!
//! Two wedges with mean fields `f`, `g` of weights `v`, `w` merge into one with their weighted mean; the spread grows by
//! `v w / (v + w) · |f(p) − g(p)|²`: the Schur complement of Hoppe's quadric without its cancellation. All is kept around
//! the vertex's own position and in single precision.
//!
//! Papers: H. Hoppe, *New quadric metric for simplifying meshes with appearance attributes*, 1999, sections 4 and 5
//! (gradient form, wedges, memoryless); P. Lindstrom, G. Turk, *Fast and memory efficient polygonal simplification*,
//! 1998 (memoryless); the instanced-model paper (ITS, 2012), section 3.3 (one error over all attributes). Departures:
//! attribute weights in the price are small, the sum is not divided by area, seams are held by planes and not locked.

use glam::Vec4;

use super::{ErrorMetric, Parted, Placement, Price};
use crate::mesh::layout::MOST_COLUMNS;
use crate::mesh::topology::{Contraction, EdgeKind, NEXT, PREVIOUS, Part, Topology, WedgePairs};
use crate::mesh::weld::NONE;
use crate::quadric::{Form, cross, dot, dot3, lerp, scale, sub};

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

/// What a face gives to each of its vertices.
struct FaceTerms {
    form: Form,
    area: f32,
    /// Unit normal.
    unit: [f64; 3],
    /// Not too thin for gradients.
    has_fields: bool,
}

/// The metric.
#[derive(Clone, Debug)]
pub struct Its {
    edges: EdgeWeights,
    placement: Placement,
    /// Quadrics are rebuilt from the current surface; else those of merged vertices are added up.
    memoryless: bool,
    /// Values of a wedge.
    columns: usize,
    /// Of each vertex, around its position.
    forms: Vec<Form>,
    /// Mean fields of each wedge, `columns` each: gradient, and the value at the vertex.
    means: Vec<Vec4>,
    /// Their weights: areas.
    weights: Vec<f32>,
    /// Gradients of one face, on their way to its wedges.
    gradients: Vec<Vec4>,
    /// Vertices whose surroundings have changed since they were gathered; empty if not memoryless.
    stale: Vec<bool>,
    neighbours: Vec<u32>,
    /// By which the area of each face counts; none: all 1.
    importance: Vec<f32>,
}

impl Its {
    /// `importance`: by which the area of each face counts; none: all 1.
    pub fn new(edges: EdgeWeights, placement: Placement, memoryless: bool, importance: Vec<f32>) -> Self {
        Self {
            edges,
            placement,
            memoryless,
            columns: 0,
            forms: Vec::new(),
            means: Vec::new(),
            weights: Vec::new(),
            gradients: Vec::new(),
            stale: Vec::new(),
            neighbours: Vec::new(),
            importance,
        }
    }

    #[inline]
    fn mean(&self, wedge: u32) -> &[Vec4] {
        &self.means[wedge as usize * self.columns..][..self.columns]
    }

    #[inline]
    fn mean_mut(&mut self, wedge: u32) -> &mut [Vec4] {
        &mut self.means[wedge as usize * self.columns..][..self.columns]
    }

    /// Builds the quadrics and mean fields of all vertices, each face once.
    fn gather_all(&mut self, surface: &Topology) {
        for (id, face) in surface.faces.iter().enumerate().filter(|(_, face)| face.is_alive()) {
            let Some(terms) = self.face(surface, id) else { continue };
            for (at, next) in NEXT.into_iter().enumerate() {
                self.add_face(face.v[at], face.w[at], &terms);
                if let Some((across, weight)) = self.edge_plane(surface, id, at, &terms) {
                    self.forms[face.v[at] as usize].add_linear(across, weight);
                    self.forms[face.v[next] as usize].add_linear(across, weight);
                }
            }
        }
        for vertex in 0..surface.positions.len() as u32 {
            self.average(surface, vertex);
        }
    }

    /// Builds the quadric of `vertex` and the mean fields of its wedges from the faces as they are.
    fn gather(&mut self, surface: &Topology, vertex: u32) {
        self.forms[vertex as usize] = Form::default();
        for wedge in surface.wedges(vertex) {
            self.mean_mut(wedge).fill(Vec4::ZERO);
            self.weights[wedge as usize] = 0.0;
        }
        for &corner in surface.ring(vertex) {
            let Some(terms) = self.face(surface, corner.face()) else { continue };
            self.add_face(vertex, surface.faces[corner.face()].w[corner.at()], &terms);
            for edge in [corner.at(), PREVIOUS[corner.at()]] {
                if let Some((across, weight)) = self.edge_plane(surface, corner.face(), edge, &terms) {
                    self.forms[vertex as usize].add_linear(across, weight);
                }
            }
        }
        self.average(surface, vertex);
        if self.memoryless {
            self.stale[vertex as usize] = false;
        }
    }

    /// Adds a face to one of its vertices.
    #[inline]
    fn add_face(&mut self, vertex: u32, wedge: u32, terms: &FaceTerms) {
        self.forms[vertex as usize].add(&terms.form);
        if terms.has_fields {
            self.weights[wedge as usize] += terms.area;
            for (mean, gradient) in self.means[wedge as usize * self.columns..].iter_mut().zip(&self.gradients) {
                *mean += *gradient;
            }
        }
    }

    /// Sums to means: the spread of the fields around their mean is what is left in the vertex's quadric.
    #[inline]
    fn average(&mut self, surface: &Topology, vertex: u32) {
        let mut form = self.forms[vertex as usize];
        for wedge in surface.wedges(vertex) {
            let weight = self.weights[wedge as usize];
            let inverse = if weight > 0.0 { 1.0 / weight } else { 0.0 };
            let values = surface.value(wedge);
            for (mean, &value) in self.means[wedge as usize * self.columns..].iter_mut().zip(values) {
                *mean *= inverse;
                form.add_linear(*mean, -weight);
                // All fields of the wedge agree here.
                mean.w = value;
            }
        }
        self.forms[vertex as usize] = form;
    }

    /// What a face gives to each of its vertices; its gradients, by area, go to `self.gradients`. `None`: no area.
    #[inline]
    fn face(&mut self, surface: &Topology, id: usize) -> Option<FaceTerms> {
        let face = &surface.faces[id];
        let here = surface.positions[face.v[0] as usize];
        let e1 = sub(surface.positions[face.v[1] as usize], here);
        let e2 = sub(surface.positions[face.v[2] as usize], here);
        let normal = cross(e1, e2);
        let squared = dot(normal, normal);
        let inverse = 1.0 / squared;
        if !inverse.is_finite() {
            return None;
        }
        let length = squared.sqrt();
        let area = (0.5 * length) as f32 * self.importance.get(id).copied().unwrap_or(1.0);
        let unit = scale(normal, 1.0 / length);
        let mut form = Form::default();
        // The plane, by area. It goes through all three vertices, and so do the fields through their values.
        form.add_linear(narrow(unit), area);
        // A face thinner than this has next to no area, and its gradients are noise.
        let has_fields = dot(e1, e1).max(dot(e2, e2)) * inverse < THINNEST;
        if has_fields {
            // Dual basis of the edges in the face's plane: gradient = d1·b1 + d2·b2.
            let b1 = narrow(scale(cross(e2, normal), inverse));
            let b2 = narrow(scale(cross(normal, e1), inverse));
            let (area1, area2) = (b1 * area, b2 * area);
            let [s0, s1, s2] = face.w.map(|w| surface.value(w));
            let mut sums = [0.0f32; 3];
            for (((gradient, &s0), &s1), &s2) in self.gradients.iter_mut().zip(s0).zip(s1).zip(s2) {
                let (d1, d2) = (s1 - s0, s2 - s0);
                sums[0] += d1 * d1;
                sums[1] += d1 * d2;
                sums[2] += d2 * d2;
                *gradient = area1 * d1 + area2 * d2;
            }
            form.add_plane_form(b1, b2, sums, area);
        }
        Some(FaceTerms { form, area, unit, has_fields })
    }

    /// The plane through an edge that is not inside the surface, perpendicular to the face, weighted by the squared
    /// length of the edge.
    #[inline]
    fn edge_plane(&self, surface: &Topology, id: usize, edge: usize, terms: &FaceTerms) -> Option<(Vec4, f32)> {
        let weight = match surface.kinds[id][edge] {
            EdgeKind::Interior => return None,
            EdgeKind::Crease => self.edges.crease,
            EdgeKind::Seam => self.edges.seam,
            EdgeKind::Border => self.edges.border,
        };
        let v = &surface.faces[id].v;
        let along = sub(surface.positions[v[NEXT[edge]] as usize], surface.positions[v[edge] as usize]);
        // As long as the edge.
        (weight > 0.0).then(|| (narrow(cross(terms.unit, along)), weight as f32))
    }

    /// The quadric of a pair with every attribute at its best, around the position of `a`.
    #[inline]
    fn pair(&self, surface: &Topology, a: u32, b: u32) -> Option<Form> {
        let along = sub(surface.positions[b as usize], surface.positions[a as usize]);
        let back = along.map(|x| -x as f32);
        let mut form = self.forms[b as usize].moved(back);
        form.add(&self.forms[a as usize]);
        if self.columns == 0 {
            return Some(form);
        }
        let (wa, wb) = (surface.first_wedge(a), surface.first_wedge(b));
        if surface.next_wedge(wa) == NONE && surface.next_wedge(wb) == NONE {
            self.add_spread(wa, wb, back, &mut form);
            return Some(form);
        }
        let pairs = surface.joined_wedges(a, b)?;
        if let [[wa, wb]] = pairs[..] {
            self.add_spread(wa, wb, back, &mut form);
        } else {
            self.add_classes(&pairs, back, &mut form);
        }
        Some(form)
    }

    /// Adds what merging wedge `wb`, whose vertex is `-back` away, into `wa` adds to the spread.
    #[inline]
    fn add_spread(&self, wa: u32, wb: u32, back: [f32; 3], form: &mut Form) {
        let (va, vb) = (self.weights[wa as usize], self.weights[wb as usize]);
        let sum = va + vb;
        if sum <= 0.0 {
            return;
        }
        let weight = va * vb / sum;
        // A copy, which stays in registers.
        let mut sum = *form;
        for (&f, &g) in self.mean(wa).iter().zip(self.mean(wb)) {
            let mut apart = f - g;
            apart.w -= dot3(g, back);
            sum.add_linear(apart, weight);
        }
        *form = sum;
    }

    /// As [`Self::add_spread`] for all classes of wedges that `pairs` join, directly or through each other.
    fn add_classes(&self, pairs: &WedgePairs, back: [f32; 3], form: &mut Form) {
        let mut done = [false; WedgePairs::MOST];
        for first in 0..pairs.len() {
            if done[first] {
                continue;
            }
            let mut class = [false; WedgePairs::MOST];
            let mut mean = [Vec4::ZERO; MOST_COLUMNS];
            let mut weight = 0.0f32;
            let mut next = Some(first);
            while let Some(at) = next {
                for side in [0, 1] {
                    let wedge = pairs[at][side];
                    if !pairs.iter().zip(class).any(|(p, inside)| inside && p[side] == wedge) {
                        let shift = if side == 0 { [0.0; 3] } else { back };
                        weight = self.add_to_class(wedge, shift, &mut mean, weight, form);
                    }
                }
                (class[at], done[at]) = (true, true);
                next = (0..pairs.len()).find(|&i| {
                    let touches = |p: &[u32; 2]| p[0] == pairs[i][0] || p[1] == pairs[i][1];
                    !done[i] && pairs.iter().zip(class).any(|(p, inside)| inside && touches(p))
                });
            }
        }
    }

    /// Merges one more wedge into a class's mean; returns the class's new weight.
    fn add_to_class(&self, wedge: u32, shift: [f32; 3], mean: &mut [Vec4], weight: f32, form: &mut Form) -> f32 {
        let own = self.weights[wedge as usize];
        let sum = weight + own;
        if sum <= 0.0 {
            return weight;
        }
        for (mean, &field) in mean.iter_mut().zip(self.mean(wedge)) {
            let mut field = field;
            field.w += dot3(field, shift);
            form.add_linear(field - *mean, weight * own / sum);
            *mean += (field - *mean) * (own / sum);
        }
        sum
    }

    #[inline]
    fn price_optimal(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let whole = self.pair(surface, a, b)?.widen();
        let (pa, pb) = (surface.positions[a as usize], surface.positions[b as usize]);
        let along = sub(pb, pa);
        let middle = scale(along, 0.5);
        // The solution is the least there is, but for the pull towards the middle, which decides nothing else.
        if let Some(x) = whole.minimum(middle)
            && near(x, along)
        {
            let position = [pa[0] + x[0], pa[1] + x[1], pa[2] + x[2]];
            return Some(Price { cost: whole.eval(x).max(0.0), position, keep_second: false });
        }
        let mut best = (whole.eval(middle), lerp(pa, pb, 0.5));
        for (x, position) in [([0.0; 3], pa), (along, pb)] {
            let cost = whole.eval(x);
            if cost < best.0 {
                best = (cost, position);
            }
        }
        Some(Price { cost: best.0.max(0.0), position: best.1, keep_second: false })
    }

    /// Cost of merging `gone` into `kept` with everything at `kept` as it is; `None` if a wedge of `gone` has no one
    /// wedge at `kept` to merge with.
    fn subset_cost(&self, surface: &Topology, kept: u32, gone: u32) -> Option<f64> {
        let pairs = surface.joined_wedges(kept, gone)?;
        let along = sub(surface.positions[kept as usize], surface.positions[gone as usize]);
        let mut cost = self.forms[gone as usize].widen().eval(along) + self.forms[kept as usize].widen().eval([0.0; 3]);
        for wedge in surface.wedges(gone) {
            let mut partners = pairs.iter().filter(|p| p[1] == wedge);
            let partner = partners.next()?[0];
            if partners.next().is_some() {
                return None;
            }
            cost += self.off(wedge, along, surface.value(partner));
        }
        for wedge in surface.wedges(kept) {
            cost += self.off(wedge, [0.0; 3], surface.value(wedge));
        }
        Some(cost.max(0.0))
    }

    /// Weighted squared distance of a wedge's mean fields from `values`, at `x` from its vertex.
    fn off(&self, wedge: u32, x: [f64; 3], values: &[f32]) -> f64 {
        let x = x.map(|x| x as f32);
        let apart = self.mean(wedge).iter().zip(values).map(|(&mean, value)| dot3(mean, x) + (mean.w - value));
        f64::from(self.weights[wedge as usize]) * apart.map(|d| f64::from(d) * f64::from(d)).sum::<f64>()
    }

    fn price_subset(&self, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let (first, second) = (self.subset_cost(surface, a, b), self.subset_cost(surface, b, a));
        let keep_second = match (first, second) {
            (Some(x), Some(y)) => y < x,
            (None, _) => true,
            _ => false,
        };
        let cost = if keep_second { second? } else { first? };
        let kept = if keep_second { b } else { a };
        Some(Price { cost, position: surface.positions[kept as usize], keep_second })
    }

    /// Adds up the quadrics and means of the merged vertices around the new position, which is `done.moved` away from
    /// where they were.
    fn merge(&mut self, surface: &mut Topology, done: &Contraction) {
        let [by_kept, by_gone] = done.moved.map(|by| by.map(|x| x as f32));
        let mut form = self.forms[done.kept as usize].moved(by_kept);
        form.add(&self.forms[done.gone as usize].moved(by_gone));
        let (own, came) = done.wedges.split_at(done.own_wedges);
        for (wedges, by) in [(own, by_kept), (came, by_gone)] {
            for &wedge in wedges {
                for mean in self.mean_mut(wedge) {
                    mean.w += dot3(*mean, by);
                }
            }
        }
        for &[stays, goes] in &done.merged {
            let (own, other) = (self.weights[stays as usize], self.weights[goes as usize]);
            let sum = own + other;
            if sum <= 0.0 {
                continue;
            }
            let (share, weight) = (other / sum, own * other / sum);
            for column in 0..self.columns {
                let mean = self.means[stays as usize * self.columns + column];
                let apart = self.means[goes as usize * self.columns + column] - mean;
                form.add_linear(apart, weight);
                self.means[stays as usize * self.columns + column] = mean + apart * share;
            }
            self.weights[stays as usize] = sum;
        }
        self.forms[done.kept as usize] = form;
        if self.placement == Placement::Optimal {
            let mut wedge = surface.first_wedge(done.kept);
            while wedge != NONE {
                if self.weights[wedge as usize] > 0.0 {
                    for (value, mean) in surface.value_mut(wedge).iter_mut().zip(self.mean(wedge)) {
                        *value = mean.w;
                    }
                }
                wedge = surface.next_wedge(wedge);
            }
        }
    }
}

impl ErrorMetric for Its {
    #[inline]
    fn prepare(&mut self, surface: &Topology, a: u32, b: u32) {
        if self.memoryless {
            for vertex in [a, b] {
                if self.stale[vertex as usize] {
                    self.gather(surface, vertex);
                }
            }
        }
    }

    #[inline]
    fn touch(&self, surface: &Topology, vertices: impl Iterator<Item = u32>) {
        let mut sum = 0.0;
        for vertex in vertices {
            let at = (surface.first_wedge(vertex) as usize).wrapping_mul(self.columns);
            let ends = [self.means.get(at), self.means.get((at + self.columns).wrapping_sub(1))];
            sum += self.forms[vertex as usize].constant() + ends.into_iter().flatten().map(|mean| mean.w).sum::<f32>();
        }
        std::hint::black_box(sum);
    }

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
            return Some(Price { cost: self.subset_cost(surface, kept, gone)?, position, keep_second });
        }
        let x = sub(position, surface.positions[a as usize]);
        let cost = self.pair(surface, a, b)?.widen().eval(x).max(0.0);
        Some(Price { cost, position, keep_second: false })
    }

    fn contracted(&mut self, surface: &mut Topology, done: &Contraction) {
        self.merge(surface, done);
        if self.memoryless {
            surface.classify_edges(done.kept);
            self.gather(surface, done.kept);
            // The others around have lost or changed two of their faces: enough to price them again, but not at once.
            surface.neighbours(done.kept, &mut self.neighbours);
            for &vertex in &self.neighbours {
                self.stale[vertex as usize] = true;
            }
        }
    }
}

impl Parted for Its {
    fn begin(&mut self, surface: &Topology) {
        let wedges = surface.wedge_vertex.len();
        self.columns = surface.columns;
        self.forms = vec![Form::default(); surface.positions.len()];
        self.means = vec![Vec4::ZERO; wedges * surface.columns];
        self.weights = vec![0.0; wedges];
        self.gradients = vec![Vec4::ZERO; surface.columns];
        self.stale = vec![false; if self.memoryless { surface.positions.len() } else { 0 }];
        self.gather_all(surface);
    }

    fn part(&self, part: &Part) -> Self {
        let importance = if self.importance.is_empty() {
            Vec::new()
        } else {
            part.faces.iter().map(|&face| self.importance[face as usize]).collect()
        };
        Self::new(self.edges, self.placement, self.memoryless, importance)
    }
}

/// Most that `longest edge² / |cross product|²`, the square of 1 / height, may be: a millionth of the radius.
const THINNEST: f64 = 1e12;

/// A solution further from the edge's middle than this many edge lengths comes from a nearly flat quadric.
const FARTHEST: f64 = 8.0;

/// Whether `x`, from one end of an edge, is anywhere near it.
#[inline]
fn near(x: [f64; 3], along: [f64; 3]) -> bool {
    let off = sub(x, scale(along, 0.5));
    dot(off, off) <= FARTHEST * FARTHEST * dot(along, along)
}

#[inline]
fn narrow(v: [f64; 3]) -> Vec4 {
    Vec4::new(v[0] as f32, v[1] as f32, v[2] as f32, 0.0)
}
