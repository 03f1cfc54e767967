//! Who touches whom while a mesh is being simplified: vertices, wedges, faces, and the contraction of a pair.
//!
//! Positions and wedge values are in the unit frame of [`Layout`]. Knows no error metric; a contraction is done as told.

use super::Mesh;
use super::layout::Layout;
use super::weld::{NONE, Weld, weld};
use crate::quadric::{dot, sub};

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

/// A triangle. Corner `i` is vertex `v[i]` with wedge `w[i]`; edge `i` runs from corner `i` to corner `(i + 1) % 3`.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Vertices; `v[0] == NONE` if the face is gone.
    pub v: [u32; 3],
    /// Wedges.
    pub w: [u32; 3],
    /// Kind of each edge.
    pub edges: [EdgeKind; 3],
}

impl Face {
    /// Still part of the surface.
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
    /// Wedges joined by a face on the edge: `[stays, gone]`.
    pub merged: Vec<[u32; 2]>,
    /// Number of faces that vanished.
    pub dead_faces: usize,
}

/// The surface.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Position of each vertex, unit frame.
    pub positions: Vec<[f64; 3]>,
    /// All faces; those that are gone stay in place.
    pub faces: Vec<Face>,
    /// Wedge values, `columns` each, scaled as [`Layout`] says.
    pub values: Vec<f64>,
    /// Values of one wedge.
    pub columns: usize,
    /// Vertex of each wedge.
    pub wedge_vertex: Vec<u32>,
    /// Number of faces alive.
    pub alive: usize,
    first_wedge: Vec<u32>,
    next_wedge: Vec<u32>,
    chart: Vec<u32>,
    ring_start: Vec<u32>,
    ring_len: Vec<u32>,
    ring_pool: Vec<u32>,
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
                        values[to + c] = f64::from(attribute.values[from + c]) * scale;
                    }
                }
            }
        }
        let mut topology = Self {
            positions,
            faces: faces(mesh, &weld),
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
        };
        topology.alive = topology.faces.len();
        topology.link_wedges();
        topology.link_rings();
        for vertex in 0..weld.vertices as u32 {
            topology.classify_edges(vertex);
        }
        (topology, weld)
    }

    /// Gives each wedge `columns` values: further ones are zero, surplus ones are dropped.
    pub fn resize_columns(&mut self, columns: usize) {
        let wedges = self.wedge_vertex.len();
        let mut values = vec![0.0; wedges * columns];
        let common = columns.min(self.columns);
        for wedge in 0..wedges {
            values[wedge * columns..][..common].copy_from_slice(&self.values[wedge * self.columns..][..common]);
        }
        (self.values, self.columns) = (values, columns);
    }

    fn link_wedges(&mut self) {
        for wedge in (0..self.wedge_vertex.len()).rev() {
            let vertex = self.wedge_vertex[wedge] as usize;
            self.next_wedge[wedge] = self.first_wedge[vertex];
            self.first_wedge[vertex] = wedge as u32;
        }
    }

    fn link_rings(&mut self) {
        let vertices = self.positions.len();
        let mut len = vec![0u32; vertices];
        for face in &self.faces {
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
        // Contractions append merged rings behind; twice the room avoids most growing.
        let mut pool = Vec::with_capacity(total as usize * 2);
        pool.resize(total as usize, 0);
        for (index, face) in self.faces.iter().enumerate() {
            for v in face.v {
                pool[fill[v as usize] as usize] = index as u32;
                fill[v as usize] += 1;
            }
        }
        (self.ring_start, self.ring_len, self.ring_pool) = (start, len, pool);
    }

    /// Faces at `vertex`.
    #[inline]
    pub fn ring(&self, vertex: u32) -> &[u32] {
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
    pub fn value(&self, wedge: u32) -> &[f64] {
        &self.values[wedge as usize * self.columns..][..self.columns]
    }

    /// Values of `wedge`, to be written.
    #[inline]
    pub fn value_mut(&mut self, wedge: u32) -> &mut [f64] {
        &mut self.values[wedge as usize * self.columns..][..self.columns]
    }

    /// Corner positions of a face.
    #[inline]
    pub fn corners(&self, face: &Face) -> [[f64; 3]; 3] {
        face.v.map(|v| self.positions[v as usize])
    }

    /// Calls `f` with every vertex that shares a face with `vertex`, once each.
    #[inline]
    pub fn neighbours(&self, vertex: u32, out: &mut Vec<u32>) {
        out.clear();
        for &face in self.ring(vertex) {
            for v in self.faces[face as usize].v {
                if v != vertex && !out.contains(&v) {
                    out.push(v);
                }
            }
        }
    }

    /// Wedge pairs `[at a, at b]` of the faces on the edge `a b`, each once; `None` if there are more than
    /// [`WedgePairs::MOST`].
    #[inline]
    pub fn joined_wedges(&self, a: u32, b: u32) -> Option<WedgePairs> {
        let mut out = WedgePairs::default();
        for &face in self.ring(b) {
            let face = &self.faces[face as usize];
            if let Some(i) = face.corner(a) {
                let j = face.corner(b).expect("a ring holds faces of its vertex");
                let pair = [face.w[i], face.w[j]];
                if !out.contains(&pair) && !out.push(pair) {
                    return None;
                }
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
        self.merge_wedges(kept, gone, &mut done.merged);
        done.dead_faces = self.merge_rings(kept, gone);
        self.alive -= done.dead_faces;
        self.positions[kept as usize] = position;
        self.classify_edges(kept);
    }

    /// Joins the wedges that the faces on the edge connect; the others of `gone` move over to `kept`.
    fn merge_wedges(&mut self, kept: u32, gone: u32, merged: &mut Vec<[u32; 2]>) {
        merged.clear();
        let pairs = self.joined_wedges(kept, gone).unwrap_or_default();
        for &[a, b] in pairs.iter() {
            let (stays, goes) = (root(merged, a), root(merged, b));
            if stays != goes {
                merged.push([stays, goes]);
                let (a, b) = (self.chart_of(stays), self.chart_of(goes));
                self.chart[a.max(b) as usize] = a.min(b);
            }
        }
        for vertex in [kept, gone] {
            let start = self.ring_start[vertex as usize] as usize;
            for at in start..start + self.ring_len[vertex as usize] as usize {
                for w in &mut self.faces[self.ring_pool[at] as usize].w {
                    *w = root(merged, *w);
                }
            }
        }
        self.relink_wedges(kept, gone, merged);
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

    fn chart_of(&self, wedge: u32) -> u32 {
        let mut chart = self.chart[wedge as usize];
        while self.chart[chart as usize] != chart {
            chart = self.chart[chart as usize];
        }
        chart
    }

    /// Moves the faces of `gone` to `kept`, drops those on the edge; returns how many.
    fn merge_rings(&mut self, kept: u32, gone: u32) -> usize {
        let start = self.ring_pool.len() as u32;
        let mut dead = 0;
        for vertex in [kept, gone] {
            let (from, len) = (self.ring_start[vertex as usize], self.ring_len[vertex as usize]);
            for at in from..from + len {
                let id = self.ring_pool[at as usize];
                let face = &mut self.faces[id as usize];
                if !face.is_alive() {
                    continue;
                }
                if vertex == kept && face.corner(gone).is_some() {
                    let third = face.v.iter().copied().find(|&v| v != kept && v != gone);
                    face.v[0] = NONE;
                    dead += 1;
                    if let Some(third) = third {
                        self.remove_from_ring(third, id);
                    }
                    continue;
                }
                for v in &mut face.v {
                    if *v == gone {
                        *v = kept;
                    }
                }
                self.ring_pool.push(id);
            }
        }
        self.ring_start[kept as usize] = start;
        self.ring_len[kept as usize] = self.ring_pool.len() as u32 - start;
        self.ring_len[gone as usize] = 0;
        dead
    }

    fn remove_from_ring(&mut self, vertex: u32, face: u32) {
        let start = self.ring_start[vertex as usize] as usize;
        let len = self.ring_len[vertex as usize] as usize;
        let ring = &mut self.ring_pool[start..start + len];
        if let Some(at) = ring.iter().position(|&f| f == face) {
            ring.copy_within(at + 1.., at);
            self.ring_len[vertex as usize] -= 1;
        }
    }

    /// Sets the kind of every edge at `vertex`, in all its faces.
    fn classify_edges(&mut self, vertex: u32) {
        let start = self.ring_start[vertex as usize] as usize;
        for at in start..start + self.ring_len[vertex as usize] as usize {
            let id = self.ring_pool[at];
            let corner = self.faces[id as usize].corner(vertex).expect("a ring holds faces of its vertex");
            for (edge, other) in [(corner, (corner + 1) % 3), ((corner + 2) % 3, (corner + 2) % 3)] {
                let kind = self.edge_kind(id, vertex, corner, other);
                self.faces[id as usize].edges[edge] = kind;
            }
        }
    }

    fn edge_kind(&self, id: u32, vertex: u32, corner: usize, other: usize) -> EdgeKind {
        let face = &self.faces[id as usize];
        let end = face.v[other];
        let mut across = NONE;
        for &f in self.ring(vertex) {
            if f != id && self.faces[f as usize].v.contains(&end) {
                if across != NONE {
                    return EdgeKind::Border;
                }
                across = f;
            }
        }
        if across == NONE {
            return EdgeKind::Border;
        }
        let opposite = &self.faces[across as usize];
        let at = |v: u32| opposite.w[opposite.corner(v).expect("the face has both ends")];
        let (a, b) = ([face.w[corner], at(vertex)], [face.w[other], at(end)]);
        if a[0] == a[1] && b[0] == b[1] {
            return EdgeKind::Interior;
        }
        let same_chart = |[x, y]: [u32; 2]| x == y || self.chart_of(x) == self.chart_of(y);
        if same_chart(a) && same_chart(b) { EdgeKind::Crease } else { EdgeKind::Seam }
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
            is_face.then_some(Face { v, w, edges: [EdgeKind::Border; 3] })
        })
    })
}

/// Of values for each triangle of the mesh, those of the surface's faces.
pub fn of_faces<T: Copy>(mesh: &Mesh, weld: &Weld, values: &[T]) -> Vec<T> {
    triangles(mesh, weld).zip(values).filter_map(|(face, value)| face.map(|_| *value)).collect()
}
