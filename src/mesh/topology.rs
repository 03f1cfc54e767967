//! Who touches whom while a mesh is being simplified: vertices, wedges, faces, and the contraction of a pair.
//!
//! Positions and wedge values are in the unit frame of [`Layout`]. Knows no error metric; a contraction is done as told.

mod part;

use super::Mesh;
use super::layout::Layout;
use super::weld::{NONE, Weld, weld};
use crate::quadric::{dot, sub};
pub use part::{Merges, Part};

/// What lies across a face's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EdgeKind {
    /// One other face, same wedges at both ends.
    Interior,
    /// One other face; wedges differ in normals alone.
    Crease,
    /// One other face; wedges differ in texture coordinates, colour, primitive or another attribute.
    Seam,
    /// No other face, or more than one (non-manifold).
    Border,
}

/// The corner, or edge, after each one in a triangle.
pub const NEXT: [usize; 3] = [1, 2, 0];
/// The corner, or edge, before each one in a triangle.
pub const PREVIOUS: [usize; 3] = [2, 0, 1];

/// A triangle. Corner `i` is vertex `v[i]` with wedge `w[i]`; edge `i` runs from corner `i` to corner `NEXT[i]`.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Vertices; `v[0] == NONE` if the face is gone.
    pub v: [u32; 3],
    /// Wedges.
    pub w: [u32; 3],
}

impl Face {
    /// Whether it is still there.
    #[inline]
    pub fn is_alive(&self) -> bool {
        self.v[0] != NONE
    }

    /// Corner of `vertex`, if the face has it.
    #[inline]
    pub fn corner(&self, vertex: u32) -> Option<usize> {
        self.v.iter().position(|&v| v == vertex)
    }
}

/// One corner of one face.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corner(u32);

impl Corner {
    /// The face.
    #[inline]
    pub fn face(self) -> usize {
        (self.0 >> 2) as usize
    }

    /// Which of its corners, 0…2.
    #[inline]
    pub fn at(self) -> usize {
        (self.0 & 3) as usize
    }

    #[inline]
    fn new(face: usize, at: usize) -> Self {
        Self((face as u32) << 2 | at as u32)
    }
}

/// A few pairs of wedges, without an allocation.
#[derive(Clone, Copy, Debug, Default)]
pub struct WedgePairs {
    items: [[u32; 2]; Self::MOST],
    len: usize,
}

impl WedgePairs {
    /// An edge on which more wedges meet is left alone.
    pub const MOST: usize = 8;

    #[inline]
    fn push(&mut self, pair: [u32; 2]) -> bool {
        let fits = self.len < Self::MOST;
        if fits {
            self.items[self.len] = pair;
            self.len += 1;
        }
        fits
    }
}

impl std::ops::Deref for WedgePairs {
    type Target = [[u32; 2]];

    fn deref(&self) -> &Self::Target {
        &self.items[..self.len]
    }
}

/// Where the vertex that stays is now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// Where it was, bit for bit.
    #[default]
    Kept,
    /// Where the vertex that is gone was, bit for bit.
    Gone,
    /// Elsewhere.
    New,
}

/// A contraction that has been done: `gone` was merged into `kept`.
#[derive(Clone, Debug, Default)]
pub struct Contraction {
    /// Vertex that stays.
    pub kept: u32,
    /// Vertex that is gone.
    pub gone: u32,
    /// Where the new position lies along the edge from `kept` to `gone`, 0…1.
    pub t: f64,
    /// Whether that is one of the ends.
    pub place: Place,
    /// From where `kept` and `gone` were to where `kept` is now.
    pub moved: [[f64; 3]; 2],
    /// Wedges joined by a face on the edge: `[stays, gone]`.
    pub merged: Vec<[u32; 2]>,
    /// Wedges that `kept` had, then those that `gone` had.
    pub wedges: Vec<u32>,
    /// How many of them `kept` had.
    pub own_wedges: usize,
}

/// The surface.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Position of each vertex, unit frame.
    pub positions: Vec<[f64; 3]>,
    /// All faces; those that are gone stay in place.
    pub faces: Vec<Face>,
    /// Kind of each edge of each face: as it was at the start, or at the last [`Self::classify_edges`] of an end.
    pub kinds: Vec<[EdgeKind; 3]>,
    /// Wedge values, `columns` each, scaled as [`Layout`] says.
    pub values: Vec<f32>,
    /// Values of one wedge.
    pub columns: usize,
    /// Vertex of each wedge; of one that is gone, some vertex or [`NONE`].
    pub wedge_vertex: Vec<u32>,
    /// Number of faces alive.
    pub alive: usize,
    first_wedge: Vec<u32>,
    next_wedge: Vec<u32>,
    chart: Vec<u32>,
    ring_start: Vec<u32>,
    ring_len: Vec<u32>,
    ring_pool: Vec<Corner>,
    /// The other two vertices of the faces at a vertex while its edges are classified.
    spokes: Vec<[u32; 2]>,
}

impl Topology {
    /// Builds the surface of `mesh`. Triangles with two corners at one vertex are left out.
    pub fn new(mesh: &Mesh, layout: &Layout) -> (Self, Weld) {
        let weld = weld(mesh, layout);
        let wedges = weld.wedge_vertex.len();
        let mut positions = vec![[0.0; 3]; weld.vertices];
        let mut values = vec![0.0; wedges * layout.columns];
        for wedge in 0..wedges {
            let primitive = weld.wedge_primitive[wedge] as usize;
            let stored = weld.wedge_source[wedge] as usize;
            let source = &mesh.primitives[primitive];
            positions[weld.wedge_vertex[wedge] as usize] = layout.to_frame(source.positions()[stored]);
        }
        for field in &layout.fields {
            for (index, primitive) in mesh.primitives.iter().enumerate() {
                let scale = field.scale[index];
                let Some(attribute) = primitive.attribute(&field.name).filter(|_| scale > 0.0) else { continue };
                for wedge in (0..wedges).filter(|&w| weld.wedge_primitive[w] as usize == index) {
                    let from = weld.wedge_source[wedge] as usize * field.components;
                    let to = wedge * layout.columns + field.offset;
                    for c in 0..field.components {
                        values[to + c] = (f64::from(attribute.values[from + c]) * scale) as f32;
                    }
                }
            }
        }
        let faces = faces(mesh, &weld);
        let mut topology = Self {
            positions,
            kinds: vec![[EdgeKind::Border; 3]; faces.len()],
            faces,
            values,
            columns: layout.columns,
            wedge_vertex: weld.wedge_vertex.clone(),
            alive: 0,
            first_wedge: vec![NONE; weld.vertices],
            next_wedge: vec![NONE; wedges],
            chart: weld.wedge_chart.clone(),
            ring_start: Vec::new(),
            ring_len: Vec::new(),
            ring_pool: Vec::new(),
            spokes: Vec::new(),
        };
        topology.alive = topology.faces.len();
        topology.link_wedges();
        topology.link_rings();
        topology.classify_all();
        (topology, weld)
    }

    /// Sets the lists of wedges of all vertices, in order.
    fn link_wedges(&mut self) {
        self.first_wedge.fill(NONE);
        for wedge in (0..self.wedge_vertex.len()).rev().filter(|&wedge| self.wedge_vertex[wedge] != NONE) {
            let vertex = self.wedge_vertex[wedge] as usize;
            self.next_wedge[wedge] = self.first_wedge[vertex];
            self.first_wedge[vertex] = wedge as u32;
        }
    }

    /// Sets the rings of all vertices: corners in the order of the faces.
    fn link_rings(&mut self) {
        let vertices = self.positions.len();
        let mut len = vec![0u32; vertices];
        for face in self.faces.iter().filter(|face| face.is_alive()) {
            for v in face.v {
                len[v as usize] += 1;
            }
        }
        let mut start = Vec::with_capacity(vertices);
        let mut total = 0;
        for &n in &len {
            start.push(total);
            total += n;
        }
        let mut fill = start.clone();
        // Contractions append merged rings behind.
        let mut pool = Vec::with_capacity(total as usize + total as usize / 4);
        pool.resize(total as usize, Corner::default());
        for (index, face) in self.faces.iter().enumerate().filter(|(_, face)| face.is_alive()) {
            for (at, v) in face.v.into_iter().enumerate() {
                pool[fill[v as usize] as usize] = Corner::new(index, at);
                fill[v as usize] += 1;
            }
        }
        (self.ring_start, self.ring_len, self.ring_pool) = (start, len, pool);
    }

    /// Moves all rings together, so that the pool has room again.
    fn compact_rings(&mut self) {
        let mut pool = Vec::with_capacity(self.ring_pool.capacity());
        for (start, len) in self.ring_start.iter_mut().zip(&self.ring_len) {
            let from = *start as usize;
            *start = pool.len() as u32;
            pool.extend_from_slice(&self.ring_pool[from..from + *len as usize]);
        }
        self.ring_pool = pool;
    }

    /// Corners at `vertex`.
    #[inline]
    pub fn ring(&self, vertex: u32) -> &[Corner] {
        let start = self.ring_start[vertex as usize] as usize;
        &self.ring_pool[start..start + self.ring_len[vertex as usize] as usize]
    }

    /// First wedge at `vertex`, or [`NONE`].
    #[inline]
    pub fn first_wedge(&self, vertex: u32) -> u32 {
        self.first_wedge[vertex as usize]
    }

    /// The wedge after `wedge` at the same vertex, or [`NONE`].
    #[inline]
    pub fn next_wedge(&self, wedge: u32) -> u32 {
        self.next_wedge[wedge as usize]
    }

    /// Wedges at `vertex`.
    #[inline]
    pub fn wedges(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        let mut at = self.first_wedge(vertex);
        std::iter::from_fn(move || {
            let wedge = at;
            (wedge != NONE).then(|| {
                at = self.next_wedge(wedge);
                wedge
            })
        })
    }

    /// Values of `wedge`.
    #[inline]
    pub fn value(&self, wedge: u32) -> &[f32] {
        &self.values[wedge as usize * self.columns..][..self.columns]
    }

    /// Values of `wedge`, to be written.
    #[inline]
    pub fn value_mut(&mut self, wedge: u32) -> &mut [f32] {
        &mut self.values[wedge as usize * self.columns..][..self.columns]
    }

    /// Corner positions of a face.
    #[inline]
    pub fn corners(&self, face: &Face) -> [[f64; 3]; 3] {
        face.v.map(|v| self.positions[v as usize])
    }

    /// Writes every vertex that shares a face with `vertex` to `out`, once each.
    #[inline]
    pub fn neighbours(&self, vertex: u32, out: &mut Vec<u32>) {
        out.clear();
        for corner in self.ring(vertex) {
            let face = &self.faces[corner.face()];
            for v in [face.v[NEXT[corner.at()]], face.v[PREVIOUS[corner.at()]]] {
                if !out.contains(&v) {
                    out.push(v);
                }
            }
        }
    }

    /// The corners at `b` and at `a` of the faces on the edge `a b`.
    #[inline]
    fn on_edge(&self, a: u32, b: u32) -> impl Iterator<Item = (Corner, usize)> + '_ {
        self.ring(b).iter().filter_map(move |&corner| {
            let face = &self.faces[corner.face()];
            let (next, previous) = (NEXT[corner.at()], PREVIOUS[corner.at()]);
            let other = if face.v[next] == a { next } else { previous };
            (face.v[other] == a).then_some((corner, other))
        })
    }

    /// Whether a face has both vertices.
    #[inline]
    pub fn are_joined(&self, a: u32, b: u32) -> bool {
        self.on_edge(a, b).next().is_some()
    }

    /// Wedge pairs `[at a, at b]` of the faces on the edge `a b`, each once; `None` if there are more than
    /// [`WedgePairs::MOST`].
    #[inline]
    pub fn joined_wedges(&self, a: u32, b: u32) -> Option<WedgePairs> {
        let mut out = WedgePairs::default();
        for (corner, other) in self.on_edge(a, b) {
            let face = &self.faces[corner.face()];
            let pair = [face.w[other], face.w[corner.at()]];
            if !out.contains(&pair) && !out.push(pair) {
                return None;
            }
        }
        Some(out)
    }

    /// Merges `gone` into `kept` and moves it to `position`. Wedge values are left to the caller.
    pub fn contract(&mut self, kept: u32, gone: u32, position: [f64; 3], done: &mut Contraction) {
        let (a, b) = (self.positions[kept as usize], self.positions[gone as usize]);
        let along = sub(b, a);
        let squared = dot(along, along);
        done.t = if squared > 0.0 { (dot(sub(position, a), along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (done.kept, done.gone) = (kept, gone);
        done.place = match position {
            p if p == a => Place::Kept,
            p if p == b => Place::Gone,
            _ => Place::New,
        };
        done.moved = [sub(position, a), sub(position, b)];
        self.merge_wedges(kept, gone, done);
        self.alive -= self.merge_rings(kept, gone);
        self.positions[kept as usize] = position;
    }

    /// Joins the wedges that the faces on the edge connect; the others of `gone` move over to `kept`.
    fn merge_wedges(&mut self, kept: u32, gone: u32, done: &mut Contraction) {
        done.merged.clear();
        done.wedges.clear();
        done.wedges.extend(self.wedges(kept));
        done.own_wedges = done.wedges.len();
        done.wedges.extend(self.wedges(gone));
        let pairs = self.joined_wedges(kept, gone).unwrap_or_default();
        for &[a, b] in pairs.iter() {
            let (stays, goes) = (root(&done.merged, a), root(&done.merged, b));
            if stays != goes {
                done.merged.push([stays, goes]);
                self.join_charts(stays, goes);
            }
        }
        for vertex in [kept, gone] {
            let start = self.ring_start[vertex as usize] as usize;
            for at in start..start + self.ring_len[vertex as usize] as usize {
                let corner = self.ring_pool[at];
                let wedge = &mut self.faces[corner.face()].w[corner.at()];
                *wedge = root(&done.merged, *wedge);
            }
        }
        self.relink_wedges(kept, gone, &done.merged);
    }

    /// One list at `kept` of the wedges of both that are left, in the order kept, gone.
    fn relink_wedges(&mut self, kept: u32, gone: u32, merged: &[[u32; 2]]) {
        let (mut head, mut tail) = (NONE, NONE);
        for vertex in [kept, gone] {
            let mut w = self.first_wedge[vertex as usize];
            while w != NONE {
                let next = self.next_wedge[w as usize];
                if !merged.iter().any(|m| m[1] == w) {
                    self.wedge_vertex[w as usize] = kept;
                    self.next_wedge[w as usize] = NONE;
                    if tail == NONE {
                        head = w;
                    } else {
                        self.next_wedge[tail as usize] = w;
                    }
                    tail = w;
                }
                w = next;
            }
            self.first_wedge[vertex as usize] = NONE;
        }
        self.first_wedge[kept as usize] = head;
    }

    /// Whether two wedges differ in their normals at most, or were joined with such.
    pub fn same_chart(&self, a: u32, b: u32) -> bool {
        a == b || self.chart_of(a) == self.chart_of(b)
    }

    fn join_charts(&mut self, one: u32, other: u32) {
        let (a, b) = (self.chart_of(one), self.chart_of(other));
        self.chart[a.max(b) as usize] = a.min(b);
    }

    fn chart_of(&self, wedge: u32) -> u32 {
        let mut chart = self.chart[wedge as usize];
        while self.chart[chart as usize] != chart {
            chart = self.chart[chart as usize];
        }
        chart
    }

    /// Moves the faces of `gone` to `kept`, drops those on the edge; returns how many.
    fn merge_rings(&mut self, kept: u32, gone: u32) -> usize {
        let both = self.ring_len[kept as usize] + self.ring_len[gone as usize];
        if self.ring_pool.capacity() - self.ring_pool.len() < both as usize {
            self.compact_rings();
        }
        let start = self.ring_pool.len() as u32;
        let mut dead = 0;
        for (vertex, other) in [(kept, gone), (gone, kept)] {
            let (from, len) = (self.ring_start[vertex as usize], self.ring_len[vertex as usize]);
            for at in from..from + len {
                let corner = self.ring_pool[at as usize];
                let (next, previous) = (NEXT[corner.at()], PREVIOUS[corner.at()]);
                let face = &mut self.faces[corner.face()];
                if !face.is_alive() {
                    // Dropped a moment ago, from the other side.
                } else if face.v[next] == other || face.v[previous] == other {
                    let third = if face.v[next] == other { previous } else { next };
                    let vertex = face.v[third];
                    face.v[0] = NONE;
                    dead += 1;
                    self.remove_from_ring(vertex, Corner::new(corner.face(), third));
                } else {
                    face.v[corner.at()] = kept;
                    self.ring_pool.push(corner);
                }
            }
        }
        self.ring_start[kept as usize] = start;
        self.ring_len[kept as usize] = self.ring_pool.len() as u32 - start;
        self.ring_len[gone as usize] = 0;
        dead
    }

    fn remove_from_ring(&mut self, vertex: u32, corner: Corner) {
        let start = self.ring_start[vertex as usize] as usize;
        let len = self.ring_len[vertex as usize] as usize;
        let ring = &mut self.ring_pool[start..start + len];
        if let Some(at) = ring.iter().position(|&c| c == corner) {
            ring.copy_within(at + 1.., at);
            self.ring_len[vertex as usize] -= 1;
        }
    }

    /// Sets the kind of every edge.
    fn classify_all(&mut self) {
        self.kinds.fill([EdgeKind::Border; 3]);
        for index in 0..self.faces.len() {
            let face = self.faces[index];
            if !face.is_alive() {
                continue;
            }
            for (edge, next) in NEXT.into_iter().enumerate() {
                let (vertex, end) = (face.v[edge], face.v[next]);
                let (mut faces, mut across) = (0, Corner::default());
                for &corner in self.ring(vertex) {
                    let other = &self.faces[corner.face()].v;
                    if other[NEXT[corner.at()]] == end || other[PREVIOUS[corner.at()]] == end {
                        faces += 1;
                        across = if corner.face() == index { across } else { corner };
                    }
                }
                // The first of two faces does it for both.
                if faces == 2 && index < across.face() {
                    let kind = self.kind_between(Corner::new(index, edge), across, end);
                    let is_next = self.faces[across.face()].v[NEXT[across.at()]] == end;
                    self.kinds[index][edge] = kind;
                    self.kinds[across.face()][if is_next { across.at() } else { PREVIOUS[across.at()] }] = kind;
                }
            }
        }
    }

    /// Sets the kind of every edge at `vertex`, in all its faces.
    pub fn classify_edges(&mut self, vertex: u32) {
        let mut spokes = std::mem::take(&mut self.spokes);
        spokes.clear();
        spokes.extend(self.ring(vertex).iter().map(|corner| {
            let face = &self.faces[corner.face()];
            [face.v[NEXT[corner.at()]], face.v[PREVIOUS[corner.at()]]]
        }));
        for (index, &ends) in spokes.iter().enumerate() {
            let corner = self.ring(vertex)[index];
            for (end, edge) in ends.into_iter().zip([corner.at(), PREVIOUS[corner.at()]]) {
                // This face is one of them.
                let faces = spokes.iter().filter(|other| other[0] == end || other[1] == end).count();
                let kind = if faces == 2 {
                    let other = |(i, other): (usize, &[u32; 2])| (i != index && other.contains(&end)).then_some(i);
                    let across = spokes.iter().enumerate().find_map(other).expect("the other of two");
                    self.kind_between(corner, self.ring(vertex)[across], end)
                } else {
                    EdgeKind::Border
                };
                self.kinds[corner.face()][edge] = kind;
            }
        }
        self.spokes = spokes;
    }

    /// Kind of the edge between two corners at one vertex and the vertex `end`.
    fn kind_between(&self, corner: Corner, across: Corner, end: u32) -> EdgeKind {
        let ends = |corner: Corner| {
            let face = &self.faces[corner.face()];
            let next = NEXT[corner.at()];
            let at_end = if face.v[next] == end { next } else { PREVIOUS[corner.at()] };
            [face.w[corner.at()], face.w[at_end]]
        };
        let ([a, b], [c, d]) = (ends(corner), ends(across));
        if a == c && b == d {
            return EdgeKind::Interior;
        }
        if self.same_chart(a, c) && self.same_chart(b, d) { EdgeKind::Crease } else { EdgeKind::Seam }
    }
}

/// The wedge that `wedge` was merged into, over chains of merges `[stays, gone]`.
#[inline]
fn root(merged: &[[u32; 2]], mut wedge: u32) -> u32 {
    while let Some(up) = merged.iter().find(|m| m[1] == wedge) {
        wedge = up[0];
    }
    wedge
}

fn faces(mesh: &Mesh, weld: &Weld) -> Vec<Face> {
    triangles(mesh, weld).flatten().collect()
}

/// Every triangle of the mesh; `None` for those without three distinct vertices, which are no faces.
fn triangles<'a>(mesh: &'a Mesh, weld: &'a Weld) -> impl Iterator<Item = Option<Face>> + 'a {
    mesh.primitives.iter().enumerate().flat_map(move |(index, primitive)| {
        let start = weld.stored_start[index];
        primitive.indices.chunks_exact(3).map(move |t| {
            let w = [0, 1, 2].map(|i| weld.stored[start + t[i] as usize]);
            let v = w.map(|w| weld.wedge_vertex[w as usize]);
            let is_face = v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
            is_face.then_some(Face { v, w })
        })
    })
}

/// Of values for each triangle of the mesh, those of the surface's faces.
pub fn of_faces<T: Copy>(mesh: &Mesh, weld: &Weld, values: &[T]) -> Vec<T> {
    triangles(mesh, weld).zip(values).filter_map(|(face, value)| face.map(|_| *value)).collect()
}
