//! A part of a surface as a surface of its own, and what was done to it done to the whole.

use super::Topology;
use crate::mesh::weld::NONE;

/// Some faces of a surface, with what is known of their vertices and wedges. A contraction of two vertices all of whose
/// faces are in the part means the same in both.
#[derive(Clone, Debug)]
pub struct Part {
    /// The part.
    pub surface: Topology,
    /// Number in the whole of each of its vertices.
    pub vertices: Vec<u32>,
    /// Number in the whole of each of its wedges.
    pub wedges: Vec<u32>,
    /// Number in the whole of each of its faces.
    pub faces: Vec<u32>,
}

/// Numbers in a part, by numbers in the whole.
struct Numbers {
    of: Vec<u32>,
    all: Vec<u32>,
}

impl Numbers {
    fn new(count: usize) -> Self {
        Self { of: vec![NONE; count], all: Vec::new() }
    }

    fn number(&mut self, whole: u32) -> u32 {
        let at = &mut self.of[whole as usize];
        if *at == NONE {
            *at = self.all.len() as u32;
            self.all.push(whole);
        }
        *at
    }
}

impl Topology {
    /// The part that consists of `faces`, which must be alive and in order.
    pub fn part(&self, faces: Vec<u32>) -> Part {
        let mut vertices = Numbers::new(self.positions.len());
        let mut wedges = Numbers::new(self.wedge_vertex.len());
        let own = |face: u32| self.faces[face as usize];
        let mut local: Vec<super::Face> = Vec::with_capacity(faces.len());
        for &face in &faces {
            let face = own(face);
            local.push(super::Face { v: face.v.map(|v| vertices.number(v)), w: face.w });
        }
        // All wedges of a vertex, in the order of its list: also those that no face of the part has.
        let (mut first_wedge, mut next_wedge) = (Vec::with_capacity(vertices.all.len()), Vec::new());
        let mut wedge_vertex = Vec::new();
        for (number, &vertex) in (0..).zip(&vertices.all) {
            let mut first = NONE;
            for wedge in self.wedges(vertex) {
                let wedge = wedges.number(wedge);
                if first == NONE {
                    first = wedge;
                } else {
                    next_wedge[wedge as usize - 1] = wedge;
                }
                next_wedge.push(NONE);
                wedge_vertex.push(number);
            }
            first_wedge.push(first);
        }
        for face in &mut local {
            face.w = face.w.map(|w| wedges.of[w as usize]);
        }
        let mut charts = Numbers::new(self.wedge_vertex.len());
        let mut chart_wedges: Vec<u32> = Vec::new();
        let chart = (0..).zip(&wedges.all).map(|(number, &wedge)| {
            let chart = charts.number(self.chart_of(wedge)) as usize;
            if chart == chart_wedges.len() {
                chart_wedges.push(number);
            }
            chart_wedges[chart]
        });
        let chart = chart.collect();
        let mut surface = Self {
            positions: vertices.all.iter().map(|&v| self.positions[v as usize]).collect(),
            kinds: faces.iter().map(|&face| self.kinds[face as usize]).collect(),
            alive: local.len(),
            faces: local,
            values: wedges.all.iter().flat_map(|&w| self.value(w)).copied().collect(),
            columns: self.columns,
            wedge_vertex,
            first_wedge,
            next_wedge,
            chart,
            ring_start: Vec::new(),
            ring_len: Vec::new(),
            ring_pool: Vec::new(),
            spokes: Vec::new(),
        };
        surface.link_rings();
        Part { surface, vertices: vertices.all, wedges: wedges.all, faces }
    }

    /// Does what `merges` holds, all at once.
    pub fn settle(&mut self, mut merges: Merges) {
        let (vertices, wedges) = (&mut merges.vertices, &mut merges.wedges);
        for face in self.faces.iter_mut().filter(|face| face.is_alive()) {
            let v = face.v.map(|v| root(vertices, v));
            if v[0] == v[1] || v[1] == v[2] || v[2] == v[0] {
                face.v[0] = NONE;
                self.alive -= 1;
            } else {
                *face = super::Face { v, w: face.w.map(|w| root(wedges, w)) };
            }
        }
        for (wedge, vertex) in (0..).zip(&mut self.wedge_vertex) {
            if *vertex != NONE {
                *vertex = if wedges[wedge as usize] == wedge { root(vertices, *vertex) } else { NONE };
            }
        }
        self.link_wedges();
        self.link_rings();
        self.classify_all();
    }
}

/// Contractions that are done all at once ([`Topology::settle`]): what each vertex and each wedge of a surface becomes.
#[derive(Debug)]
pub struct Merges {
    vertices: Vec<u32>,
    wedges: Vec<u32>,
}

impl Merges {
    /// None yet.
    pub fn new(surface: &Topology) -> Self {
        let own = |count: usize| (0..count as u32).collect();
        Self { vertices: own(surface.positions.len()), wedges: own(surface.wedge_vertex.len()) }
    }

    /// `gone` becomes `kept`, and the second one of each pair of `wedges` the first. Rings and faces stay as they are for now.
    pub fn add(&mut self, surface: &mut Topology, kept: u32, gone: u32, position: [f64; 3], wedges: &[[u32; 2]]) {
        self.vertices[gone as usize] = kept;
        surface.positions[kept as usize] = position;
        for &[stays, goes] in wedges {
            self.wedges[goes as usize] = stays;
            surface.join_charts(stays, goes);
        }
    }
}

/// What `of` has become in the end.
fn root(became: &mut [u32], mut of: u32) -> u32 {
    while became[of as usize] != of {
        let above = became[became[of as usize] as usize];
        became[of as usize] = above;
        of = above;
    }
    of
}
