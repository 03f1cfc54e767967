//! Meshes of one scene that are the same but for the order of their data, a motion, a uniform scale or a mirror baked
//! into their vertices: instances that nobody declared.
//!
//! Near-linear: content hashes first; then shapes with the same form, labels and moments; then a guess from two places
//! that stand out (labels of connectivity and attributes, so that spheres, boxes and cylinders work, too), a least-squares
//! fit, and *verification by reconstruction*. What is not verified is no match. The first mesh in the order of the
//! file stands for its group. Does no I/O and knows nothing of nodes.

mod fit;
mod grid;
mod shape;
#[cfg(test)]
mod tests;
mod verify;

use super::SubMesh;
use crate::gltf::scene::{SourceMesh, SourcePrimitive};
use crate::gltf::similarity::Similarity;
use crate::mesh::Primitive;
use crate::mesh::hash::MeshHash;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use shape::{Shape, form};
use std::collections::BTreeMap;
use verify::verify;

pub use verify::Residual;

/// What it takes to make one mesh of the other, from least to most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The same numbers in the same order.
    Exact,
    /// The same numbers in another order.
    Reordered,
    /// A translation and a rotation.
    Rigid,
    /// A uniform scale, too.
    Similar,
    /// A reflection, too.
    Mirrored,
}

/// A mesh that is another one, moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Match {
    /// Index in `meshes`.
    pub mesh: usize,
    /// The mesh that stands for the group: the first in the file.
    pub of: usize,
    /// What it takes.
    pub kind: Kind,
    /// Takes `of` to `mesh`; its numbers are single precision, as readers have them.
    pub by: Similarity,
    /// What is left between them then.
    pub residual: Residual,
}

/// Moments of meshes that are alike differ by rounding alone.
const MOMENT_SLACK: f64 = 1e-3;

/// Refined guesses that are verified for each pair of meshes, at most.
const MOST_VERIFIED: usize = 16;

/// Turns and scales nearer to none than this are tried without.
const NEARLY_NONE: f64 = 1e-6;

/// All matches among the meshes that `eligible` takes, by mesh. `sub_meshes` is by mesh; `tolerance` is a fraction of the
/// radius.
pub fn find(
    meshes: &[SourceMesh],
    sub_meshes: &[Vec<SubMesh>],
    tolerance: f64,
    eligible: &dyn Fn(usize) -> bool,
) -> Vec<Match> {
    let mut found: BTreeMap<usize, Match> = BTreeMap::new();
    let mut first: BTreeMap<Vec<(&[usize], MeshHash)>, usize> = BTreeMap::new();
    let mut forms: BTreeMap<u64, Vec<(usize, Vec<&Primitive>)>> = BTreeMap::new();
    for source in meshes.iter().filter(|source| eligible(source.index)) {
        let Some(primitives) = triangles(source) else { continue };
        let content = sub_meshes[source.index].iter().map(|sub| (sub.primitives.as_slice(), sub.hash)).collect();
        let of = *first.entry(content).or_insert(source.index);
        if of == source.index {
            forms.entry(form(&primitives)).or_default().push((of, primitives));
        } else {
            let (mesh, by, residual) = (source.index, Similarity::IDENTITY, Residual::default());
            found.insert(mesh, Match { mesh, of, kind: Kind::Exact, by, residual });
        }
    }
    let buckets: Vec<Vec<(usize, Vec<&Primitive>)>> = forms.into_values().filter(|same| 1 < same.len()).collect();
    let moved: Vec<Match> = buckets.into_par_iter().flat_map_iter(|bucket| among(bucket, tolerance)).collect();
    let of_moved: BTreeMap<usize, Match> = moved.into_iter().map(|entry| (entry.mesh, entry)).collect();
    for entry in found.values_mut() {
        // A copy of a mesh that is itself a moved one: the same move of the first.
        if let Some(moved) = of_moved.get(&entry.of) {
            *entry = Match { mesh: entry.mesh, ..moved.clone() };
        }
    }
    found.extend(of_moved);
    found.into_values().collect()
}

/// All primitives, if all are triangles.
fn triangles(source: &SourceMesh) -> Option<Vec<&Primitive>> {
    let triangles = source.primitives.iter().map(|primitive| match primitive {
        SourcePrimitive::Triangles(primitive) => Some(primitive),
        SourcePrimitive::PassThrough { .. } => None,
    });
    triangles.collect::<Option<Vec<_>>>().filter(|all| !all.is_empty())
}

/// Matches among meshes of the same form, in the order of the file.
fn among(bucket: Vec<(usize, Vec<&Primitive>)>, tolerance: f64) -> Vec<Match> {
    let shapes: Vec<(usize, Shape<'_>)> = bucket
        .into_par_iter()
        .filter_map(|(mesh, primitives)| Some((mesh, Shape::new(primitives, tolerance)?)))
        .collect();
    let mut groups: BTreeMap<u64, Vec<(usize, Shape<'_>)>> = BTreeMap::new();
    for (mesh, shape) in shapes {
        groups.entry(shape.signature).or_default().push((mesh, shape));
    }
    let mut matches = Vec::new();
    for group in groups.into_values() {
        let mut open: Vec<&(usize, Shape<'_>)> = group.iter().collect();
        while let [(of, from), rest @ ..] = open.as_slice() {
            let related: Vec<Option<(Kind, Similarity, Residual)>> =
                rest.par_iter().map(|(_, to)| relate(from, to, tolerance)).collect();
            let mut left = Vec::new();
            for (entry, related) in rest.iter().zip(related) {
                match related {
                    Some((kind, by, residual)) => matches.push(Match { mesh: entry.0, of: *of, kind, by, residual }),
                    None => left.push(*entry),
                }
            }
            open = left;
        }
    }
    matches
}

/// What takes `from` to `to`, if anything does.
fn relate(from: &Shape<'_>, to: &Shape<'_>, tolerance: f64) -> Option<(Kind, Similarity, Residual)> {
    let near = |a: f64, b: f64| (a - b).abs() <= MOMENT_SLACK * a.abs().max(b.abs());
    if !std::iter::zip(from.moments, to.moments).all(|(a, b)| near(a, b)) || !same_distances(from, to) {
        return None;
    }
    if let Some(residual) = verify(from, to, &Similarity::IDENTITY, tolerance) {
        // Other numbers, however near, are more than another order.
        let kind = if residual == Residual::default() { Kind::Reordered } else { Kind::Rigid };
        return Some((kind, Similarity::IDENTITY, residual));
    }
    [false, true].into_iter().find_map(|mirror| {
        if from.corners == to.corners {
            let pairs: Vec<(DVec3, DVec3)> =
                (0..from.corners.len()).map(|i| (from.position(i), to.position(i))).collect();
            let settled = fit::fit(&pairs, mirror).and_then(|by| settle(from, to, &by, tolerance));
            if settled.is_some() {
                return settled;
            }
        }
        let refined = fit::guesses(from, to, mirror).filter_map(|guess| fit::refine(from, to, &guess));
        refined.take(MOST_VERIFIED).find_map(|by| settle(from, to, &by, tolerance))
    })
}

/// Labels with their distances from the middle agree, one by one.
fn same_distances(from: &Shape<'_>, to: &Shape<'_>) -> bool {
    let scale = to.spread / from.spread;
    from.order.len() == to.order.len()
        && std::iter::zip(&from.order, &to.order).all(|(&a, &b)| {
            let (a, b) = (&from.places[a as usize], &to.places[b as usize]);
            a.label == b.label && (scale * a.distance - b.distance).abs() <= 8.0 * to.reach
        })
}

/// Verifies the numbers that are written; where a simpler move does as well, that one.
fn settle(from: &Shape<'_>, to: &Shape<'_>, by: &Similarity, tolerance: f64) -> Option<(Kind, Similarity, Residual)> {
    let read = |by: Similarity| by.as_read(from.middle, to.middle);
    let checked = |by: Similarity| verify(from, to, &by, tolerance).map(|residual| (by, residual));
    let turn = DVec3::new(by.rotation.x, by.rotation.y, by.rotation.z).length();
    let rotation = if turn <= NEARLY_NONE { DQuat::IDENTITY } else { by.rotation };
    let scale = if (by.scale - 1.0).abs() <= NEARLY_NONE { 1.0 } else { by.scale };
    let plain = checked(read(*by));
    let simpler = Similarity { scale, rotation, ..*by };
    let simple = if simpler == *by { None } else { checked(read(simpler)) };
    let (by, residual) = match (simple, plain) {
        (Some(simple), Some(plain)) if simple.1.worst() <= (2.0 * plain.1.worst()).max(NEARLY_NONE) => simple,
        (simple, plain) => plain.or(simple)?,
    };
    let kind = match (by.mirror, by.scale == 1.0) {
        (true, _) => Kind::Mirrored,
        (false, true) => Kind::Rigid,
        (false, false) => Kind::Similar,
    };
    Some((kind, by, residual))
}
