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
pub(super) mod tests;
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

/// Parts with which a part is compared in vain, at most: a scene of nothing but near-misses takes no quadratic time.
const MOST_IN_VAIN: u32 = 256;

/// A mesh or a part by its number, and what it is made of.
type Thing<'p> = (usize, Vec<&'p Primitive>);

/// What counts as alike.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// Fraction of the radius.
    tolerance: f64,
    /// The farthest kind.
    most: Kind,
    /// See [`MOST_IN_VAIN`].
    in_vain: u32,
    /// What single precision rounds positions by is no difference.
    rounds: bool,
}

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
    let mut forms: BTreeMap<u64, Vec<Thing<'_>>> = BTreeMap::new();
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
    let buckets: Vec<Vec<Thing<'_>>> = forms.into_values().filter(|same| 1 < same.len()).collect();
    let search = Search { tolerance, most: Kind::Mirrored, in_vain: u32::MAX, rounds: false };
    let moved: Vec<Match> = buckets.into_par_iter().flat_map_iter(|bucket| among(bucket, search)).collect();
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

/// All matches among things of any number of primitives each, by their numbers, of kinds up to `most`. Only things of the same
/// class are compared. They stand anywhere in the space of what they are parts of, so what single precision rounds positions
/// by there is no difference (up to a four thousandth of their radius).
pub fn find_parts(parts: &[(u64, Vec<Primitive>)], tolerance: f64, most: Kind) -> Vec<Match> {
    let mut forms: BTreeMap<(u64, u64), Vec<Thing<'_>>> = BTreeMap::new();
    for (number, (class, primitives)) in parts.iter().enumerate() {
        let primitives: Vec<&Primitive> = primitives.iter().collect();
        forms.entry((*class, form(&primitives))).or_default().push((number, primitives));
    }
    let search = Search { tolerance, most, in_vain: MOST_IN_VAIN, rounds: true };
    let buckets: Vec<Vec<Thing<'_>>> = forms.into_values().filter(|same| 1 < same.len()).collect();
    let mut found: Vec<Match> = buckets.into_par_iter().flat_map_iter(|bucket| among(bucket, search)).collect();
    found.sort_unstable_by_key(|entry| entry.mesh);
    found
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
fn among(bucket: Vec<Thing<'_>>, search: Search) -> Vec<Match> {
    let shapes: Vec<(usize, Shape<'_>)> = bucket
        .into_par_iter()
        .filter_map(|(mesh, primitives)| Some((mesh, Shape::new(primitives, search.tolerance, search.rounds)?)))
        .collect();
    let mut groups: BTreeMap<u64, Vec<(usize, Shape<'_>)>> = BTreeMap::new();
    for (mesh, shape) in shapes {
        groups.entry(shape.signature).or_default().push((mesh, shape));
    }
    groups.into_values().flat_map(|group| in_group(&group, search)).collect()
}

/// Of several shapes with the same labels the first one that is left stands for all that are like it.
fn in_group(group: &[(usize, Shape<'_>)], search: Search) -> Vec<Match> {
    let mut matches = Vec::new();
    // By the first moment: only a window round its own can be like a shape.
    let mut open: Vec<usize> = (0..group.len()).collect();
    let moment = |i: usize| group[i].1.moments[0];
    open.sort_by(|&a, &b| moment(a).total_cmp(&moment(b)).then(a.cmp(&b)));
    let mut is_left = vec![true; group.len()];
    let mut in_vain = vec![0u32; group.len()];
    for first in 0..group.len() {
        if !is_left[first] {
            continue;
        }
        is_left[first] = false;
        let (of, from) = &group[first];
        let low = open.partition_point(|&i| moment(i) < moment(first) * (1.0 - 2.0 * MOMENT_SLACK));
        let high = open.partition_point(|&i| moment(i) <= moment(first) * (1.0 + 2.0 * MOMENT_SLACK));
        let mut window: Vec<usize> =
            open[low..high].iter().copied().filter(|&i| is_left[i] && same_moments(from, &group[i].1)).collect();
        window.sort_unstable();
        let related: Vec<Option<(Kind, Similarity, Residual)>> =
            window.par_iter().map(|&i| relate(from, &group[i].1, search)).collect();
        for (i, related) in window.into_iter().zip(related) {
            if let Some((kind, by, residual)) = related {
                matches.push(Match { mesh: group[i].0, of: *of, kind, by, residual });
                is_left[i] = false;
            } else {
                in_vain[i] = in_vain[i].saturating_add(1);
                is_left[i] = in_vain[i] < search.in_vain;
            }
        }
        // Those that are done with would be passed over again and again.
        if open.len() > 64 && open[low..high].iter().filter(|&&i| is_left[i]).count() * 2 < high - low {
            open.retain(|&i| is_left[i]);
        }
    }
    matches
}

/// Moments of shapes that are alike are the same but for rounding.
fn same_moments(from: &Shape<'_>, to: &Shape<'_>) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= MOMENT_SLACK * a.abs().max(b.abs());
    std::iter::zip(from.moments, to.moments).all(|(a, b)| near(a, b))
}

/// What takes `from` to `to`, if anything does.
fn relate(from: &Shape<'_>, to: &Shape<'_>, search: Search) -> Option<(Kind, Similarity, Residual)> {
    if !same_distances(from, to) {
        return None;
    }
    if let Some(residual) = verify(from, to, &Similarity::IDENTITY, search.tolerance) {
        // Other numbers, however near, are more than another order.
        let kind = if residual == Residual::default() { Kind::Reordered } else { Kind::Rigid };
        return (kind <= search.most).then_some((kind, Similarity::IDENTITY, residual));
    }
    // What is nearly of the same size is, where no scale is asked for.
    let sized = |by: Similarity| if search.most < Kind::Similar { Similarity { scale: 1.0, ..by } } else { by };
    let ways = if search.most < Kind::Mirrored { &[false][..] } else { &[false, true] };
    ways.iter().find_map(|&mirror| {
        if from.corners == to.corners {
            let pairs: Vec<(DVec3, DVec3)> =
                (0..from.corners.len()).map(|i| (from.position(i), to.position(i))).collect();
            let settled = fit::fit(&pairs, mirror).and_then(|by| settle(from, to, &sized(by), search.tolerance));
            if settled.is_some() {
                return settled;
            }
        }
        let refined = fit::guesses(from, to, mirror).filter_map(|guess| fit::refine(from, to, &guess));
        refined.take(MOST_VERIFIED).find_map(|by| settle(from, to, &sized(by), search.tolerance))
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
