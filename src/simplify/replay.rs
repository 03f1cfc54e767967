//! Replays a recorded sequence up to a cut and hands out the surface there: positions, attributes, triangles.
//!
//! Attributes that the metric priced come from the record; the passive rest follows along the contracted edges:
//! tangents and morph displacements are blended, joint influences are joined and pruned, everything else (categories,
//! custom attributes) is taken from the nearer end.

pub mod refit;

use super::progressive::Progressive;
use crate::mesh::layout::{Field, FieldKind, Layout};
use crate::mesh::weld::{NONE, Weld, weld};
use crate::mesh::{Attribute, ComponentType, LevelOwnVertices, Mesh, Primitive};
use crate::quadric::{cross, dot, sub};

/// What all replays on one mesh share.
#[derive(Debug)]
pub struct Welded {
    /// Source position of each vertex.
    pub positions: Vec<[f32; 3]>,
    weld: Weld,
    fields: Vec<Field>,
    columns: usize,
}

impl Welded {
    /// Welds `mesh` as the simplifier does.
    pub fn new(mesh: &Mesh) -> Self {
        // Recorded values are unscaled.
        let layout = Layout::unscaled(mesh);
        let weld = weld(mesh, &layout);
        let mut positions = vec![[0.0; 3]; weld.vertices];
        for wedge in 0..weld.wedge_vertex.len() {
            let source = &mesh.primitives[weld.wedge_primitive[wedge] as usize];
            positions[weld.wedge_vertex[wedge] as usize] = source.positions()[weld.wedge_source[wedge] as usize];
        }
        Self { positions, weld, columns: layout.columns, fields: layout.fields }
    }

    /// Vertices of all triangles of `mesh`, without those that have two corners at one vertex.
    pub fn triangles(&self, mesh: &Mesh) -> Vec<[u32; 3]> {
        let of = |w: [u32; 3]| w.map(|w| self.weld.wedge_vertex[w as usize]);
        (0..mesh.primitives.len())
            .flat_map(|index| self.wedges(mesh, index).map(of))
            .filter(|&v| is_triangle(v))
            .collect()
    }

    /// Wedges of the triangles of one primitive.
    fn wedges<'a>(&'a self, mesh: &'a Mesh, index: usize) -> impl Iterator<Item = [u32; 3]> + 'a {
        let stored = &self.weld.stored[self.weld.stored_start[index]..];
        mesh.primitives[index].indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| stored[t[i] as usize]))
    }
}

fn is_triangle(v: [u32; 3]) -> bool {
    v[0] != v[1] && v[1] != v[2] && v[2] != v[0]
}

/// A surface on its way down the sequence.
#[derive(Debug)]
pub struct Replay<'a> {
    mesh: &'a Mesh,
    sequence: &'a Progressive,
    welded: &'a Welded,
    steps: usize,
    vertex_up: Vec<u32>,
    wedge_up: Vec<u32>,
    wedge_vertex: Vec<u32>,
    positions: Vec<[f32; 3]>,
    values: Vec<f32>,
    passive: Passive,
    /// Wedges of the triangles of each primitive that were left at the last cut.
    left: Vec<Vec<[u32; 3]>>,
    /// What the last fit has changed.
    before: refit::Before,
}

/// One primitive at a cut.
#[derive(Clone, Debug, Default)]
pub struct CutPrimitive {
    /// Wedge of each local vertex.
    pub wedges: Vec<u32>,
    /// Triangle list over local vertices.
    pub indices: Vec<u32>,
    /// Normal of each local vertex, if they were fitted ([`Replay::refit`]).
    pub normals: Option<Vec<[f32; 3]>>,
}

impl<'a> Replay<'a> {
    /// The surface before the first step. `sequence` must have been recorded on `mesh`.
    pub fn new(mesh: &'a Mesh, welded: &'a Welded, sequence: &'a Progressive) -> Self {
        let weld = &welded.weld;
        let (wedges, columns) = (weld.wedge_vertex.len(), welded.columns);
        let mut values = vec![0.0; wedges * columns];
        for field in &welded.fields {
            let of = |p: &'a Primitive| p.attribute(&field.name).filter(|a| a.components == field.components);
            let sources: Vec<Option<&Attribute>> = mesh.primitives.iter().map(of).collect();
            for wedge in 0..wedges {
                let Some(attribute) = sources[weld.wedge_primitive[wedge] as usize] else { continue };
                let from = weld.wedge_source[wedge] as usize * field.components;
                values[wedge * columns + field.offset..][..field.components]
                    .copy_from_slice(&attribute.values[from..from + field.components]);
            }
        }
        Self {
            mesh,
            sequence,
            welded,
            passive: Passive::new(mesh, &welded.fields, weld),
            steps: 0,
            vertex_up: (0..weld.vertices as u32).collect(),
            wedge_up: (0..wedges as u32).collect(),
            wedge_vertex: weld.wedge_vertex.clone(),
            positions: welded.positions.clone(),
            values,
            before: refit::Before::default(),
            left: (0..mesh.primitives.len()).map(|index| welded.wedges(mesh, index).collect()).collect(),
        }
    }

    /// Goes on until `steps` steps are done; never back.
    pub fn advance(&mut self, steps: usize) {
        self.take_back();
        let columns = self.sequence.columns as usize;
        for index in self.steps..steps.min(self.sequence.steps.len()) {
            let step = &self.sequence.steps[index];
            let start = index.checked_sub(1).map(|last| self.sequence.steps[last]).unwrap_or_default();
            for &[stays, goes] in &self.sequence.merges[start.merges_end as usize..step.merges_end as usize] {
                // A wedge of the vertex that stays can be joined to another one of it through a wedge of the other.
                let across = self.wedge_vertex[goes as usize] == step.gone;
                self.passive.merge(stays as usize, goes as usize, if across { step.t } else { 0.5 });
                self.wedge_up[goes as usize] = stays;
            }
            for at in start.set_end as usize..step.set_end as usize {
                let wedge = self.sequence.set_wedges[at] as usize;
                self.wedge_vertex[wedge] = step.kept;
                let from = &self.sequence.set_values[at * columns..][..columns];
                self.values[wedge * columns..][..columns].copy_from_slice(from);
            }
            self.vertex_up[step.gone as usize] = step.kept;
            self.positions[step.kept as usize] = step.position;
        }
        self.steps = self.steps.max(steps.min(self.sequence.steps.len()));
    }

    /// What a source vertex has become.
    pub fn root(&self, mut vertex: u32) -> u32 {
        while self.vertex_up[vertex as usize] != vertex {
            vertex = self.vertex_up[vertex as usize];
        }
        vertex
    }

    /// Positions of vertices that are still there, object space.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The triangles of a cut, as vertices.
    pub fn triangles(&self, cut: &CutPrimitive) -> impl Iterator<Item = [u32; 3]> {
        let vertex = |i: u32| self.wedge_vertex[cut.wedges[i as usize] as usize];
        cut.indices.chunks_exact(3).map(move |t| [0, 1, 2].map(|i| vertex(t[i])))
    }

    /// Position of a wedge that is still there, object space.
    pub fn wedge_position(&self, wedge: u32) -> [f32; 3] {
        self.positions[self.wedge_vertex[wedge as usize] as usize]
    }

    /// The stored source vertex whose categories `wedge` has.
    pub fn origin(&self, wedge: u32) -> u32 {
        self.passive.origin[wedge as usize]
    }

    /// The triangles of each primitive that are left, in source order.
    pub fn primitives(&mut self) -> Vec<CutPrimitive> {
        let mut local = vec![NONE; self.wedge_up.len()];
        let mut out = Vec::with_capacity(self.left.len());
        for left in &mut self.left {
            let mut cut = CutPrimitive::default();
            left.retain_mut(|w| {
                *w = w.map(|w| find(&mut self.wedge_up, w));
                is_triangle(w.map(|w| self.wedge_vertex[w as usize]))
            });
            for &wedge in left.iter().flatten() {
                let at = &mut local[wedge as usize];
                if *at == NONE {
                    *at = cut.wedges.len() as u32;
                    cut.wedges.push(wedge);
                }
                cut.indices.push(*at);
            }
            for &wedge in &cut.wedges {
                local[wedge as usize] = NONE;
            }
            out.push(cut);
        }
        out
    }

    /// The vertices of `cut` with all attributes and morph targets of primitive `index`, in the source's formats.
    pub fn vertices(&self, index: usize, cut: &CutPrimitive) -> LevelOwnVertices {
        let primitive = &self.mesh.primitives[index];
        let fitted = || cut.normals.clone().unwrap_or_else(|| self.normals(cut));
        let normals = primitive.attribute("NORMAL").map(|_| fitted());
        let attribute = |source: &Attribute| {
            let mut values = Vec::with_capacity(cut.wedges.len() * source.components);
            match self.welded.fields.iter().find(|f| f.name == source.name && f.components == source.components) {
                _ if source.name == "POSITION" => {
                    values.extend(cut.wedges.iter().flat_map(|&w| self.wedge_position(w)));
                }
                Some(field) if field.kind == FieldKind::Normal => {
                    values.extend(normals.iter().flatten().flatten());
                }
                Some(field) => {
                    for &wedge in &cut.wedges {
                        let at = wedge as usize * self.sequence.columns as usize + field.offset;
                        values.extend_from_slice(&self.values[at..at + field.components]);
                    }
                    if field.kind == FieldKind::Color {
                        for value in &mut values {
                            *value = clamp_color(*value, source);
                        }
                    }
                }
                None => self.passive.write(primitive, index, source, cut, &mut values),
            }
            if source.name == "TANGENT" && source.components == 4 {
                orthogonalise(&mut values, normals.as_deref());
            }
            Attribute { values, ..source.clone_shape() }
        };
        LevelOwnVertices {
            count: cut.wedges.len(),
            attributes: primitive.attributes.iter().map(attribute).collect(),
            targets: self.passive.targets(primitive, index, cut),
        }
    }

    /// Unit normals; where the solved one vanishes, the normal of the wedge's triangles in the level.
    fn normals(&self, cut: &CutPrimitive) -> Vec<[f32; 3]> {
        let field = self.welded.fields.iter().find(|f| f.kind == FieldKind::Normal).expect("the primitive has normals");
        let mut flat = vec![[0.0f64; 3]; 0];
        let mut out = Vec::with_capacity(cut.wedges.len());
        for (local, &wedge) in cut.wedges.iter().enumerate() {
            let at = wedge as usize * self.sequence.columns as usize + field.offset;
            let n = [0, 1, 2].map(|i| f64::from(self.values[at + i]));
            out.push(unit(n).unwrap_or_else(|| {
                if flat.is_empty() {
                    flat = self.face_normals(cut);
                }
                unit(flat[local]).unwrap_or([0.0, 0.0, 1.0])
            }));
        }
        out
    }

    fn face_normals(&self, cut: &CutPrimitive) -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0f64; 3]; cut.wedges.len()];
        for t in cut.indices.chunks_exact(3) {
            let p = [0, 1, 2].map(|i| self.wedge_position(cut.wedges[t[i] as usize]).map(f64::from));
            let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            for &corner in t {
                for i in 0..3 {
                    sums[corner as usize][i] += n[i];
                }
            }
        }
        sums
    }
}

impl Attribute {
    /// Name, components and format without values.
    fn clone_shape(&self) -> Self {
        Self { name: self.name.clone(), components: self.components, format: self.format, values: Vec::new() }
    }
}

/// Colours outside the unit range are meant only in float attributes that had such values, and never negative.
fn clamp_color(value: f32, source: &Attribute) -> f32 {
    let most = if source.format.component == ComponentType::F32 {
        source.values.iter().copied().fold(1.0, f32::max)
    } else {
        1.0
    };
    value.clamp(0.0, most)
}

fn find(up: &mut [u32], mut at: u32) -> u32 {
    while up[at as usize] != at {
        let next = up[up[at as usize] as usize];
        up[at as usize] = next;
        at = next;
    }
    at
}

fn unit(n: [f64; 3]) -> Option<[f32; 3]> {
    let length = dot(n, n).sqrt();
    (length > 1e-9).then(|| n.map(|x| (x / length) as f32))
}

/// Makes tangents unit vectors perpendicular to the normals, handedness ±1.
fn orthogonalise(tangents: &mut [f32], normals: Option<&[[f32; 3]]>) {
    for (index, tangent) in tangents.chunks_exact_mut(4).enumerate() {
        let mut t = [0, 1, 2].map(|i| f64::from(tangent[i]));
        if let Some(normals) = normals {
            let n = normals[index].map(f64::from);
            let along = dot(t, n);
            t = [0, 1, 2].map(|i| t[i] - n[i] * along);
            if dot(t, t) <= 1e-12 {
                // Any direction in the plane is as good as another.
                let axis = if n[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
                t = cross(axis, n);
            }
        }
        let t = unit(t).unwrap_or([1.0, 0.0, 0.0]);
        tangent[..3].copy_from_slice(&t);
        tangent[3] = if tangent[3] < 0.0 { -1.0 } else { 1.0 };
    }
}

/// Attributes that take no part in the price.
#[derive(Debug)]
struct Passive {
    /// Stored vertex whose categories a wedge has.
    origin: Vec<u32>,
    /// Blended columns of each wedge.
    blend: Vec<f32>,
    /// Names of the blended attributes by primitive: `(morph target or none, name, first column, components)`.
    columns: Vec<Vec<BlendColumn>>,
    width: usize,
    /// Joints and weights of each wedge; empty if no primitive is skinned.
    influences: Vec<Vec<(u32, f32)>>,
    /// Most influences of a stored vertex, for each wedge's primitive.
    most_influences: Vec<usize>,
    wedge_primitive: Vec<u32>,
}

#[derive(Debug)]
struct BlendColumn {
    target: Option<usize>,
    name: String,
    offset: usize,
    components: usize,
}

impl Passive {
    fn new(mesh: &Mesh, fields: &[Field], weld: &Weld) -> Self {
        let mut columns = Vec::new();
        let mut width = 0;
        for primitive in &mesh.primitives {
            let mut own = Vec::new();
            let mut offset = 0;
            let base = primitive.attributes.iter().filter(|a| is_blended(a, fields)).map(|a| (None, a));
            let targets =
                primitive.targets.iter().enumerate().flat_map(|(t, set)| set.iter().map(move |a| (Some(t), a)));
            for (target, a) in base.chain(targets) {
                own.push(BlendColumn { target, name: a.name.clone(), offset, components: a.components });
                offset += a.components;
            }
            width = width.max(offset);
            columns.push(own);
        }
        let wedges = weld.wedge_vertex.len();
        let mut out = Self {
            origin: weld.wedge_source.clone(),
            blend: vec![0.0; wedges * width],
            columns,
            width,
            influences: Vec::new(),
            most_influences: mesh.primitives.iter().map(|p| influence_sets(p).count() * 4).collect(),
            wedge_primitive: weld.wedge_primitive.clone(),
        };
        for wedge in 0..wedges {
            let index = weld.wedge_primitive[wedge] as usize;
            let (primitive, stored) = (&mesh.primitives[index], weld.wedge_source[wedge] as usize);
            for column in &out.columns[index] {
                let n = column.components;
                let from = &blended(primitive, column).values[stored * n..][..n];
                out.blend[wedge * width + column.offset..][..n].copy_from_slice(from);
            }
        }
        if out.most_influences.iter().any(|&most| most > 0) {
            out.influences = (0..wedges)
                .map(|w| influences(&mesh.primitives[weld.wedge_primitive[w] as usize], weld.wedge_source[w] as usize))
                .collect();
        }
        out
    }

    fn merge(&mut self, stays: usize, goes: usize, t: f32) {
        for column in 0..self.width {
            let other = self.blend[goes * self.width + column];
            let value = &mut self.blend[stays * self.width + column];
            *value += (other - *value) * t;
        }
        if 0.5 < t {
            self.origin[stays] = self.origin[goes];
        }
        if !self.influences.is_empty() {
            let most = self.most_influences[self.wedge_primitive[stays] as usize];
            let joined = join_influences(&self.influences[stays], &self.influences[goes], t, most);
            self.influences[stays] = joined;
        }
    }

    fn write(&self, primitive: &Primitive, index: usize, source: &Attribute, cut: &CutPrimitive, to: &mut Vec<f32>) {
        let own = self.columns[index].iter().find(|c| c.target.is_none() && c.name == source.name);
        if let Some(column) = own {
            self.write_blend(column, cut, to);
            return;
        }
        let set = influence_sets(primitive)
            .find(|(joints, weights)| joints.name == source.name || weights.name == source.name);
        if let Some((joints, weights)) = set {
            let number: usize = joints.name["JOINTS_".len()..].parse().unwrap_or(0);
            let want_weights = weights.name == source.name;
            for &wedge in &cut.wedges {
                let influences = &self.influences[wedge as usize];
                for slot in number * 4..number * 4 + 4 {
                    let (joint, weight) = influences.get(slot).copied().unwrap_or((0, 0.0));
                    to.push(if want_weights { weight } else { joint as f32 });
                }
            }
            return;
        }
        let n = source.components;
        for &wedge in &cut.wedges {
            let from = self.origin[wedge as usize] as usize * n;
            to.extend_from_slice(&source.values[from..from + n]);
        }
    }

    fn write_blend(&self, column: &BlendColumn, cut: &CutPrimitive, to: &mut Vec<f32>) {
        for &wedge in &cut.wedges {
            let at = wedge as usize * self.width + column.offset;
            to.extend_from_slice(&self.blend[at..at + column.components]);
        }
    }

    fn targets(&self, primitive: &Primitive, index: usize, cut: &CutPrimitive) -> Vec<Vec<Attribute>> {
        let mut out: Vec<Vec<Attribute>> = vec![Vec::new(); primitive.targets.len()];
        for column in &self.columns[index] {
            let Some(target) = column.target else { continue };
            let mut values = Vec::with_capacity(cut.wedges.len() * column.components);
            self.write_blend(column, cut, &mut values);
            out[target].push(Attribute { values, ..blended(primitive, column).clone_shape() });
        }
        out
    }
}

/// Tangents, and priced kinds that found no room among the priced columns.
fn is_blended(attribute: &Attribute, fields: &[Field]) -> bool {
    let name = attribute.name.as_str();
    let priced = fields.iter().any(|f| f.name == name && f.components == attribute.components);
    name == "TANGENT" || (!priced && (name == "NORMAL" || name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")))
}

fn blended<'a>(primitive: &'a Primitive, column: &BlendColumn) -> &'a Attribute {
    let set = column.target.map_or(&primitive.attributes, |t| &primitive.targets[t]);
    set.iter().find(|a| a.name == column.name).expect("columns are made from these attributes")
}

/// Pairs of `JOINTS_n` and `WEIGHTS_n`, in order of n, as long as they are complete.
fn influence_sets(primitive: &Primitive) -> impl Iterator<Item = (&Attribute, &Attribute)> {
    (0..)
        .map(|n| (primitive.attribute(&format!("JOINTS_{n}")), primitive.attribute(&format!("WEIGHTS_{n}"))))
        .map_while(|(joints, weights)| joints.zip(weights))
        .take_while(|(joints, weights)| joints.components == 4 && weights.components == 4)
}

fn influences(primitive: &Primitive, stored: usize) -> Vec<(u32, f32)> {
    let mut out = Vec::new();
    for (joints, weights) in influence_sets(primitive) {
        for slot in stored * 4..stored * 4 + 4 {
            out.push((joints.values[slot] as u32, weights.values[slot]));
        }
    }
    out
}

/// Weighted union, at most `most` influences, the heaviest first, summing to 1.
fn join_influences(a: &[(u32, f32)], b: &[(u32, f32)], t: f32, most: usize) -> Vec<(u32, f32)> {
    let mut out: Vec<(u32, f32)> = Vec::with_capacity(a.len() + b.len());
    for (set, share) in [(a, 1.0 - t), (b, t)] {
        for &(joint, weight) in set {
            let weight = weight * share;
            match out.iter_mut().find(|known| known.0 == joint) {
                _ if weight <= 0.0 => {}
                Some(known) => known.1 += weight,
                None => out.push((joint, weight)),
            }
        }
    }
    out.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
    out.truncate(most);
    let sum: f32 = out.iter().map(|known| known.1).sum();
    if 0.0 < sum {
        for known in &mut out {
            known.1 /= sum;
        }
    }
    out
}
