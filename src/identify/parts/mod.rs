//! Connected parts that occur more than once in the meshes of one scene: a bolt that somebody merged into a machine 200 times.
//!
//! A part is what hangs together by equal positions, in all primitives of a mesh, so that no part tears a surface. Parts that look
//! alike are compared by `alike`; a group is worth it only if the bytes that go are more than those of the nodes that come.
//! Does no I/O and knows nothing of nodes but their number and price.

mod components;
#[cfg(test)]
mod tests;

use super::alike::{Kind, Match, Residual, find_parts};
use crate::gltf::scene::{SourceMesh, SourcePrimitive};
use crate::gltf::similarity::Similarity;
use crate::mesh::{Attribute, Primitive, index_bytes};
use components::components;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

pub use crate::gltf::split::Part;

/// Fewer equal parts than this stay where they are.
pub const FEWEST: usize = 4;

/// Parts of fewer triangles stay where they are: nodes for single quads and boxes would cost more to draw than they save.
pub const LEAST_TRIANGLES: usize = 32;

/// What a mesh of its own takes in a document: an entry, its accessors and their views, as measured with four attributes.
const MESH_BYTES: u64 = 1400;

/// What is asked for.
pub struct Search<'a> {
    /// A fraction of the radius of a part.
    pub tolerance: f64,
    /// The farthest kind.
    pub most: Kind,
    /// Number of what a primitive of a mesh looks like, parts of different numbers differ; or why it must stay whole.
    pub looks: &'a (dyn Fn(usize, usize) -> Result<usize, &'static str> + Sync),
    /// How many nodes show a mesh.
    pub shown: &'a (dyn Fn(usize) -> u64 + Sync),
    /// What one more node takes, with its levels.
    pub node_bytes: u64,
}

/// One occurrence of a part, which becomes an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence {
    /// Where it is.
    pub part: Part,
    /// What it takes.
    pub kind: Kind,
    /// Takes the part that stands for the group here.
    pub by: Similarity,
    /// What is left then, of the radius of the part.
    pub residual: Residual,
}

/// Parts that are one and the same, moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Stands for all: the first in the file, or the first that is a mesh of its own.
    pub of: Part,
    /// A mesh that will be nothing but `of`: it need not be written again.
    pub mesh: Option<usize>,
    /// What becomes an instance, `of` itself among them where it does.
    pub occurrences: Vec<Occurrence>,
    /// Bytes of one part: vertices and indices.
    pub bytes: u64,
    /// Nodes that show the instances: each of them for each node that shows its mesh.
    pub nodes: u64,
}

impl Group {
    /// Bytes of geometry before and after.
    pub fn cost(&self) -> (u64, u64) {
        (self.bytes * self.occurrences.len() as u64, if self.mesh.is_some() { 0 } else { self.bytes })
    }

    fn pays(&self, node_bytes: u64) -> bool {
        let (before, after) = self.cost();
        let mesh = if self.mesh.is_some() { 0 } else { MESH_BYTES };
        FEWEST <= self.occurrences.len() + usize::from(self.mesh.is_some())
            && after + mesh + self.nodes * node_bytes < before
    }
}

/// A part on its way to be compared.
struct Candidate {
    part: Part,
    /// Number of what its primitives look like, in their order.
    class: u64,
    bytes: u64,
    /// Its mesh has other parts, too.
    is_loose: bool,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Groups that are worth their nodes, in the order of the first parts.
    pub groups: Vec<Group>,
    /// Why other parts stay, of which there may be enough alike; and how many of them.
    pub stayed: BTreeMap<&'static str, usize>,
}

/// Why parts that are alike stay where they are.
const DEAR: &str = "their nodes would take more bytes than they save";

/// Looks for groups in all meshes of a scene.
pub fn find(meshes: &[SourceMesh], search: &Search<'_>) -> Found {
    let mut found = Found::default();
    let candidates = candidates(meshes, search, &mut found.stayed);
    let copies: Vec<(u64, Vec<Primitive>)> =
        candidates.par_iter().map(|c| (c.class, copied(&meshes[c.part.mesh], &c.part))).collect();
    let matches = find_parts(&copies, search.tolerance, search.most);
    drop(copies);
    let mut of_first: BTreeMap<usize, Vec<Match>> = BTreeMap::new();
    for found in matches {
        of_first.entry(found.of).or_default().push(found);
    }
    for (first, matches) in of_first {
        let is_loose = candidates[first].is_loose || matches.iter().any(|found| candidates[found.mesh].is_loose);
        if is_loose && FEWEST <= matches.len() + 1 {
            found.groups.push(group(&candidates, first, &matches, search));
        }
    }
    let mut dear = 0;
    let mut only_worth = |groups: &mut Vec<Group>| {
        groups.retain(|group| {
            let pays = group.pays(search.node_bytes);
            dear += if pays { 0 } else { group.occurrences.len() };
            pays
        });
    };
    only_worth(&mut found.groups);
    leave_something(meshes, &mut found.groups);
    for group in &mut found.groups {
        group.nodes = group.occurrences.iter().map(|o| (search.shown)(o.part.mesh)).sum();
    }
    only_worth(&mut found.groups);
    if 0 < dear {
        found.stayed.insert(DEAR, dear);
    }
    found
}

/// Parts of which enough others have the same form.
fn candidates(
    meshes: &[SourceMesh],
    search: &Search<'_>,
    stayed: &mut BTreeMap<&'static str, usize>,
) -> Vec<Candidate> {
    let parts_of = |mesh: &SourceMesh| if 0 < (search.shown)(mesh.index) { components(mesh) } else { Vec::new() };
    let parts: Vec<Vec<Part>> = meshes.par_iter().map(parts_of).collect();
    let mut classes: BTreeMap<Vec<usize>, u64> = BTreeMap::new();
    // By class and triangles: how many, and whether one of them is but a part of its mesh.
    let mut peers: BTreeMap<(u64, Vec<usize>), (usize, bool)> = BTreeMap::new();
    let mut refused: BTreeMap<(&'static str, usize, Vec<usize>), usize> = BTreeMap::new();
    let mut formed = Vec::new();
    for part in parts.iter().flatten().filter(|part| LEAST_TRIANGLES <= part.count()) {
        let form: Vec<usize> = part.triangles.iter().map(|(_, triangles)| triangles.len()).collect();
        let looks: Result<Vec<usize>, &'static str> =
            part.triangles.iter().map(|(primitive, _)| (search.looks)(part.mesh, *primitive)).collect();
        match looks {
            Err(why) => *refused.entry((why, part.mesh, form)).or_insert(0) += 1,
            Ok(looks) => {
                let next = classes.len() as u64;
                let class = *classes.entry(looks).or_insert(next);
                let is_loose = 1 < parts[part.mesh].len();
                let (count, any) = peers.entry((class, form.clone())).or_insert((0, false));
                *count += 1;
                *any |= is_loose;
                formed.push((part, class, form, is_loose));
            }
        }
    }
    for ((why, _, _), count) in refused.into_iter().filter(|(_, count)| FEWEST <= *count) {
        *stayed.entry(why).or_insert(0) += count;
    }
    formed.retain(|(_, class, form, _)| {
        let (count, any) = peers[&(*class, form.clone())];
        any && FEWEST <= count
    });
    let candidate = |(part, class, _, is_loose): (&Part, u64, Vec<usize>, bool)| Candidate {
        part: part.clone(),
        class,
        bytes: bytes(&meshes[part.mesh], part),
        is_loose,
    };
    let candidates = formed.into_iter().map(candidate);
    // Whatever the others are, such a part alone would cost more than it saves.
    let is_worth = |c: &Candidate| (search.shown)(c.part.mesh) * search.node_bytes < c.bytes;
    let (mut worth, dear): (Vec<_>, Vec<_>) = candidates.partition(is_worth);
    if !dear.is_empty() {
        stayed.insert(TINY, dear.len());
    }
    // Meshes of one part come first: such a mesh stands for its group and need not be written again.
    worth.sort_by_key(|candidate| candidate.is_loose);
    worth
}

/// Why small parts stay where they are, alike or not.
const TINY: &str = "they are smaller than the nodes that would show them";

fn group(candidates: &[Candidate], first: usize, matches: &[Match], search: &Search<'_>) -> Group {
    let part = |number: usize| candidates[number].part.clone();
    let (by, residual) = (Similarity::IDENTITY, Residual::default());
    let own = Occurrence { part: part(first), kind: Kind::Exact, by, residual };
    let other = |found: &Match| {
        let Match { mesh, of: _, kind, by, residual } = *found;
        Occurrence { part: part(mesh), kind, by, residual }
    };
    let occurrences: Vec<Occurrence> = std::iter::once(own).chain(matches.iter().map(other)).collect();
    let nodes = occurrences.iter().map(|o| (search.shown)(o.part.mesh)).sum();
    Group { of: part(first), mesh: None, occurrences, bytes: candidates[first].bytes, nodes }
}

/// A primitive cannot be without triangles, so where all would go the first part stays. A mesh that is nothing but that part then
/// stands for its group.
fn leave_something(meshes: &[SourceMesh], groups: &mut [Group]) {
    // By mesh and primitive: triangles that go.
    let mut going: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut of_mesh: BTreeMap<usize, Vec<&Part>> = BTreeMap::new();
    for occurrence in groups.iter().flat_map(|group| &group.occurrences) {
        for (primitive, triangles) in &occurrence.part.triangles {
            *going.entry((occurrence.part.mesh, *primitive)).or_insert(0) += triangles.len();
        }
        of_mesh.entry(occurrence.part.mesh).or_default().push(&occurrence.part);
    }
    let mut staying: BTreeSet<(usize, (usize, u32))> = BTreeSet::new();
    let mut alone: BTreeSet<(usize, (usize, u32))> = BTreeSet::new();
    for (mesh, mut parts) in of_mesh {
        let source = &meshes[mesh];
        parts.sort_unstable_by_key(|part| part.place());
        let triangles: Vec<(usize, usize)> = source.triangle_primitives().map(|(i, p)| (i, p.triangles())).collect();
        let goes = |going: &BTreeMap<(usize, usize), usize>, i, count| going.get(&(mesh, i)) == Some(&count);
        let all_go =
            source.primitives.len() == triangles.len() && triangles.iter().all(|&(i, count)| goes(&going, i, count));
        let mut stay = BTreeSet::new();
        for &(i, count) in &triangles {
            let first = parts.iter().find(|part| part.triangles.iter().any(|(p, _)| *p == i));
            let Some(part) = first.filter(|_| goes(&going, i, count)) else { continue };
            stay.insert((mesh, part.place()));
            for (primitive, triangles) in &part.triangles {
                going.entry((mesh, *primitive)).and_modify(|count| *count -= triangles.len());
            }
        }
        if all_go && stay.len() == 1 {
            alone.extend(&stay);
        }
        staying.extend(stay);
    }
    let place = |part: &Part| (part.mesh, part.place());
    for group in groups {
        group.mesh = alone.contains(&place(&group.of)).then_some(group.of.mesh);
        group.occurrences.retain(|occurrence| !staying.contains(&place(&occurrence.part)));
    }
}

/// Vertices and indices of a part, as they are written.
fn bytes(mesh: &SourceMesh, part: &Part) -> u64 {
    let of = |(primitive, triangles): &(usize, Vec<u32>)| {
        let SourcePrimitive::Triangles(source) = &mesh.primitives[*primitive] else { return 0 };
        let vertices = used(source, triangles).len();
        vertices * source.row_bytes() + triangles.len() * 3 * index_bytes(vertices)
    };
    part.triangles.iter().map(of).sum::<usize>() as u64
}

/// Vertices of some triangles, ascending.
fn used(source: &Primitive, triangles: &[u32]) -> Vec<u32> {
    let corners = triangles.iter().flat_map(|&t| &source.indices[t as usize * 3..][..3]);
    let mut used: Vec<u32> = corners.copied().collect();
    used.sort_unstable();
    used.dedup();
    used
}

/// The numbers of a part.
fn copied(mesh: &SourceMesh, part: &Part) -> Vec<Primitive> {
    let copy = |(primitive, triangles): &(usize, Vec<u32>)| {
        let SourcePrimitive::Triangles(source) = &mesh.primitives[*primitive] else { return Primitive::default() };
        let used = used(source, triangles);
        let rows = |a: &Attribute| {
            let values = used.iter().flat_map(|&v| &a.values[v as usize * a.components..][..a.components]);
            Attribute {
                name: a.name.clone(),
                components: a.components,
                format: a.format,
                values: values.copied().collect(),
            }
        };
        let corners = triangles.iter().flat_map(|&t| &source.indices[t as usize * 3..][..3]);
        let place = |v: &u32| used.partition_point(|u| u < v) as u32;
        Primitive {
            count: used.len(),
            attributes: source.attributes.iter().map(rows).collect(),
            targets: Vec::new(),
            indices: corners.map(place).collect(),
        }
    };
    part.triangles.iter().map(copy).collect()
}
