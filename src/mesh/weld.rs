//! Vertices and wedges: which stored vertices of a mesh are the same place, and which are the same attribute tuple.
//!
//! A *vertex* is one bit-exact position over all primitives. A *wedge* is one attribute tuple at a vertex, of one
//! primitive. Tangents ride along and never tell two wedges apart.

use super::layout::{FieldKind, Layout};
use super::{Attribute, Mesh, Primitive};

/// No vertex, no wedge, no face.
pub const NONE: u32 = u32::MAX;

/// The result of welding.
#[derive(Clone, Debug, Default)]
pub struct Weld {
    /// Number of vertices.
    pub vertices: usize,
    /// Vertex of each wedge.
    pub wedge_vertex: Vec<u32>,
    /// Primitive of each wedge.
    pub wedge_primitive: Vec<u32>,
    /// The stored vertex (of its primitive) that the wedge was made from: the first of its kind.
    pub wedge_source: Vec<u32>,
    /// For each wedge the first wedge at the same vertex that differs from it in normals alone.
    pub wedge_chart: Vec<u32>,
    /// Wedge of each stored vertex, primitive after primitive; [`NONE`] if no triangle uses it.
    pub stored: Vec<u32>,
    /// First entry of each primitive in `stored`.
    pub stored_start: Vec<usize>,
}

/// Normals closer than this are the same (largest component difference).
const SAME_NORMAL: f32 = 1e-4;
/// Texture coordinates closer than this are the same.
const SAME_TEXCOORD: f32 = 1e-5;
/// Colours closer than this are the same: half a step of 8 bits.
const SAME_COLOR: f32 = 0.5 / 255.0;

/// Welds the used vertices of `mesh`. Numbers follow the order of first use in the stored order.
pub fn weld(mesh: &Mesh, layout: &Layout) -> Weld {
    let mut out = Weld::default();
    let total = mesh.vertices();
    out.stored.resize(total, NONE);
    let mut table = Table::with_capacity(total);
    let mut positions: Vec<[u32; 3]> = Vec::with_capacity(total);
    // Wedges of a vertex form a list through `next`, in the order in which they were found.
    let mut first: Vec<u32> = Vec::with_capacity(total);
    let mut next: Vec<u32> = Vec::with_capacity(total);
    let mut start = 0;
    for (index, primitive) in mesh.primitives.iter().enumerate() {
        out.stored_start.push(start);
        let columns = Columns::new(primitive, layout);
        let used = used_vertices(primitive);
        for (stored, position) in primitive.positions().iter().enumerate() {
            if !used[stored] {
                continue;
            }
            // `+ 0.0` makes −0 and 0 one position.
            let bits = position.map(|x| (x + 0.0).to_bits());
            let vertex = table.find_or_insert(bits, &mut positions);
            if vertex as usize == first.len() {
                first.push(NONE);
            }
            let (mut at, mut last, mut chart) = (first[vertex as usize], NONE, NONE);
            while at != NONE {
                if out.wedge_primitive[at as usize] == index as u32 {
                    let other = out.wedge_source[at as usize] as usize;
                    if columns.same_chart(stored, other) {
                        if columns.same_normal(stored, other) {
                            break;
                        }
                        if chart == NONE {
                            chart = out.wedge_chart[at as usize];
                        }
                    }
                }
                last = at;
                at = next[at as usize];
            }
            if at == NONE {
                at = out.wedge_vertex.len() as u32;
                out.wedge_vertex.push(vertex);
                out.wedge_primitive.push(index as u32);
                out.wedge_source.push(stored as u32);
                out.wedge_chart.push(if chart == NONE { at } else { chart });
                next.push(NONE);
                match last {
                    NONE => first[vertex as usize] = at,
                    _ => next[last as usize] = at,
                }
            }
            out.stored[start + stored] = at;
        }
        start += primitive.count;
    }
    out.vertices = positions.len();
    out
}

/// Which stored vertices are at the same place.
pub(super) struct Places {
    /// Distinct places.
    pub count: usize,
    /// Place of each stored vertex, primitive after primitive.
    pub vertex: Vec<u32>,
}

/// Welds all vertices of `mesh` by position alone.
pub(super) fn positions(mesh: &Mesh) -> Places {
    let mut table = Table::with_capacity(mesh.vertices());
    let mut distinct = Vec::with_capacity(mesh.vertices());
    let stored = mesh.primitives.iter().flat_map(Primitive::positions);
    let vertex = stored.map(|p| table.find_or_insert(p.map(|x| (x + 0.0).to_bits()), &mut distinct)).collect();
    Places { count: distinct.len(), vertex }
}

fn used_vertices(primitive: &Primitive) -> Vec<bool> {
    let mut used = vec![false; primitive.count];
    for &i in &primitive.indices {
        used[i as usize] = true;
    }
    used
}

/// The attributes of a primitive, sorted by how they are compared.
struct Columns<'a> {
    normals: Vec<&'a Attribute>,
    charts: Vec<(&'a Attribute, f32)>,
}

impl<'a> Columns<'a> {
    fn new(primitive: &'a Primitive, layout: &Layout) -> Self {
        let mut out = Self { normals: Vec::new(), charts: Vec::new() };
        for attribute in &primitive.attributes {
            let field = layout.fields.iter().find(|f| f.name == attribute.name);
            match field.map(|f| f.kind) {
                Some(FieldKind::Normal) => out.normals.push(attribute),
                Some(FieldKind::Texcoord) => out.charts.push((attribute, SAME_TEXCOORD)),
                Some(FieldKind::Color) => out.charts.push((attribute, SAME_COLOR)),
                // Joints, weights, custom values: parts that touch but move apart must not share a wedge.
                None if attribute.name != "POSITION" && attribute.name != "TANGENT" => {
                    out.charts.push((attribute, 0.0));
                }
                None => {}
            }
        }
        for attribute in primitive.targets.iter().flatten() {
            if attribute.name == "POSITION" {
                out.charts.push((attribute, 0.0));
            }
        }
        out
    }

    fn same_normal(&self, a: usize, b: usize) -> bool {
        self.normals.iter().all(|n| close(n, a, b, SAME_NORMAL))
    }

    fn same_chart(&self, a: usize, b: usize) -> bool {
        self.charts.iter().all(|(attribute, tolerance)| close(attribute, a, b, *tolerance))
    }
}

fn close(attribute: &Attribute, a: usize, b: usize, tolerance: f32) -> bool {
    let n = attribute.components;
    let (a, b) = (&attribute.values[a * n..][..n], &attribute.values[b * n..][..n]);
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= tolerance)
}

/// Open addressing over position bits: the fastest way to weld, and its order does not reach the result.
struct Table {
    slots: Vec<u32>,
    mask: usize,
}

impl Table {
    fn with_capacity(count: usize) -> Self {
        let size = (count * 2).next_power_of_two().max(16);
        Self { slots: vec![NONE; size], mask: size - 1 }
    }

    fn find_or_insert(&mut self, bits: [u32; 3], positions: &mut Vec<[u32; 3]>) -> u32 {
        let mut hash = u64::from(bits[0]).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        hash = (hash ^ (hash >> 29) ^ u64::from(bits[1])).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        hash = (hash ^ (hash >> 32) ^ u64::from(bits[2])).wrapping_mul(0x94D0_49BB_1331_11EB);
        let mut slot = (hash ^ (hash >> 31)) as usize & self.mask;
        loop {
            match self.slots[slot] {
                NONE => {
                    let vertex = positions.len() as u32;
                    self.slots[slot] = vertex;
                    positions.push(bits);
                    return vertex;
                }
                vertex if positions[vertex as usize] == bits => return vertex,
                _ => slot = (slot + 1) & self.mask,
            }
        }
    }
}
