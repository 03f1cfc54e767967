//! The similarity that takes one set of points to another, and guesses at it from two places that stand out.

use super::shape::{LOOSE, Place, Shape};
use crate::gltf::similarity::{self, Similarity};
use glam::{DMat3, DQuat, DVec3};

/// Guesses that are looked at, at most: beyond that a shape is so regular that one of the first would have fitted.
const MOST_GUESSES: usize = 4096;

/// Places of a shape that each guess is tried on before all are.
const PROBES: usize = 24;

/// The similarity with the least squared distance from the first to the second of all pairs (Horn 1987, unit
/// quaternions; the scale is the ratio of the spreads, as there). `None` without extent.
pub(super) fn fit(pairs: &[(DVec3, DVec3)], mirror: bool) -> Option<Similarity> {
    let reflect = |p: DVec3| if mirror { DVec3::new(-p.x, p.y, p.z) } else { p };
    let count = pairs.len() as f64;
    let from_middle = pairs.iter().map(|&(p, _)| reflect(p)).sum::<DVec3>() / count;
    let to_middle = pairs.iter().map(|&(_, q)| q).sum::<DVec3>() / count;
    let (mut from_size, mut to_size) = (0.0, 0.0);
    let mut s = [[0.0; 3]; 3];
    for &(p, q) in pairs {
        let (p, q) = (reflect(p) - from_middle, q - to_middle);
        from_size += p.length_squared();
        to_size += q.length_squared();
        for (row, a) in s.iter_mut().zip(p.to_array()) {
            for (sum, b) in row.iter_mut().zip(q.to_array()) {
                *sum += a * b;
            }
        }
    }
    if !(0.0 < from_size && 0.0 < to_size) {
        return None;
    }
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
    let matrix = [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let [w, x, y, z] = greatest_eigenvector(matrix);
    let rotation = upright(similarity::rotation(DQuat::from_xyzw(x, y, z, w)));
    let scale = (to_size / from_size).sqrt();
    let translation = to_middle - rotation * (scale * from_middle);
    Some(Similarity { scale, mirror, rotation, translation })
}

/// Of the two quaternions of a rotation the one with w ≥ 0.
fn upright(q: DQuat) -> DQuat {
    if q.w < 0.0 { -q } else { q }
}

/// Of a symmetric matrix, by cyclic Jacobi rotations: they use + − × ÷ √ alone, so the bits are the same everywhere.
fn greatest_eigenvector(mut m: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors = [[0.0; 4]; 4];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..32 {
        let off: f64 = (0..4).flat_map(|i| (i + 1..4).map(move |j| (i, j))).map(|(i, j)| m[i][j] * m[i][j]).sum();
        if off == 0.0 {
            break;
        }
        for p in 0..3 {
            for q in p + 1..4 {
                if m[p][q] == 0.0 {
                    continue;
                }
                let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
                let sign = if theta < 0.0 { -1.0 } else { 1.0 };
                let t = sign / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut m {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let rows = (m[p], m[q]);
                for (k, (a, b)) in std::iter::zip(rows.0, rows.1).enumerate() {
                    (m[p][k], m[q][k]) = (c * a - s * b, s * a + c * b);
                }
                for row in &mut vectors {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
    }
    let mut best = 0;
    for i in 1..4 {
        if m[best][best] < m[i][i] {
            best = i;
        }
    }
    vectors.map(|row| row[best])
}

/// Places with one label at one distance from the middle, as a range of [`Shape::order`].
fn shells(shape: &Shape<'_>) -> Vec<std::ops::Range<usize>> {
    let place = |i: usize| &shape.places[shape.order[i] as usize];
    let mut shells = Vec::new();
    let mut start = 0;
    for i in 1..=shape.order.len() {
        let apart = i == shape.order.len()
            || place(i).label != place(i - 1).label
            || place(i).distance - place(i - 1).distance > 8.0 * shape.reach;
        if apart {
            shells.push(start..i);
            start = i;
        }
    }
    shells
}

/// Two places that, with the middle, fix how the shape stands; rare ones, so that few places of another can be meant.
fn frame<'s>(shape: &'s Shape<'_>) -> Option<[&'s Place; 2]> {
    let mut shells = shells(shape);
    shells.sort_by_key(|shell| (shell.len(), shell.start));
    let places = |shell: &std::ops::Range<usize>| shape.order[shell.clone()].iter().map(|&i| &shape.places[i as usize]);
    let far = |p: &&Place| 0.25 * shape.spread <= p.distance;
    let first = shells.iter().find_map(|shell| places(shell).find(far))?;
    let a = (first.position - shape.middle) / first.distance;
    let angle = |p: &Place| a.cross((p.position - shape.middle) / p.distance).length();
    let mut best: Option<(f64, &Place)> = None;
    for shell in &shells {
        for place in places(shell).filter(far) {
            if best.is_none_or(|(most, _)| most < angle(place)) {
                best = Some((angle(place), place));
            }
        }
        // A right angle is best, but a rare place at a fair angle is better than a common one.
        if best.is_some_and(|(most, _)| 0.5 < most) {
            break;
        }
    }
    best.filter(|(most, _)| 1e-3 < *most).map(|(_, second)| [first, second])
}

/// Orthonormal, by two directions, if they are two.
fn basis(a: DVec3, b: DVec3) -> Option<DMat3> {
    let x = a.try_normalize()?;
    let z = x.cross(b).try_normalize()?;
    Some(DMat3::from_cols(x, z.cross(x), z))
}

/// Similarities that might take `from` to `to`, near enough to tell which place is which.
pub(super) fn guesses<'s>(
    from: &'s Shape<'_>,
    to: &'s Shape<'_>,
    mirror: bool,
) -> impl Iterator<Item = Similarity> + 's {
    let scale = to.spread / from.spread;
    let reflect = move |p: DVec3| if mirror { DVec3::new(-p.x, p.y, p.z) } else { p };
    let pairs = frame(from).into_iter().flat_map(move |[a, b]| {
        let slack = 8.0 * to.reach;
        let apart = scale * a.position.distance(b.position);
        let matching = move |wanted: &Place| alike(to, wanted, scale, slack);
        let seconds: Vec<&Place> = matching(b).collect();
        matching(a).flat_map(move |c| {
            let fitting: Vec<&Place> =
                seconds.iter().copied().filter(|d| (c.position.distance(d.position) - apart).abs() <= slack).collect();
            fitting.into_iter().map(move |d| (a, b, c, d))
        })
    });
    pairs.take(MOST_GUESSES).filter_map(move |(a, b, c, d)| {
        let middle = reflect(from.middle);
        let (a, b) = (reflect(a.position) - middle, reflect(b.position) - middle);
        let turn = basis(c.position - to.middle, d.position - to.middle)? * basis(a, b)?.transpose();
        let rotation = similarity::rotation(DQuat::from_mat3(&turn));
        let translation = to.middle - rotation * (scale * middle);
        let guess = Similarity { scale, mirror, rotation, translation };
        probe(from, to, &guess).then_some(guess)
    })
}

/// Places of `shape` with the label and distance that `wanted` would have there.
fn alike<'s>(
    shape: &'s Shape<'_>,
    wanted: &Place,
    scale: f64,
    slack: f64,
) -> impl Iterator<Item = &'s Place> + use<'s> {
    let (label, distance) = (wanted.label, scale * wanted.distance);
    let place = |i: u32| &shape.places[i as usize];
    let start = shape.order.partition_point(|&i| {
        place(i).label < label || (place(i).label == label && place(i).distance < distance - slack)
    });
    let rest = shape.order[start..].iter().map(|&i| &shape.places[i as usize]);
    rest.take_while(move |p| p.label == label && p.distance <= distance + slack)
}

fn probe(from: &Shape<'_>, to: &Shape<'_>, guess: &Similarity) -> bool {
    let step = from.order.len().div_ceil(PROBES);
    from.order.iter().step_by(step).all(|&i| find(from, to, guess, i).is_some())
}

/// Which place of `to` is `place` of `from`?
fn find(from: &Shape<'_>, to: &Shape<'_>, guess: &Similarity, place: u32) -> Option<u32> {
    let place = &from.places[place as usize];
    to.place_near(guess.point(place.position), LOOSE * to.reach, Some(place.label))
}

/// A guess made exact by all places.
pub(super) fn refine(from: &Shape<'_>, to: &Shape<'_>, guess: &Similarity) -> Option<Similarity> {
    let mut pairs = Vec::with_capacity(from.places.len());
    for i in 0..from.places.len() as u32 {
        let other = find(from, to, guess, i)?;
        pairs.push((from.places[i as usize].position, to.places[other as usize].position));
    }
    fit(&pairs, guess.mirror)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_gives_back_what_was_done() {
        let points: Vec<DVec3> =
            (0..20).map(|i| DVec3::new(f64::from(i % 3), f64::from(i * i % 7), f64::from(i % 5))).collect();
        for mirror in [false, true] {
            for q in [[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], [0.5, -0.5, 0.5, 0.5], [0.1, 0.7, -0.2, 0.3]] {
                let rotation = similarity::rotation(DQuat::from_array(q));
                let meant = Similarity { scale: 2.5, mirror, rotation, translation: DVec3::new(9.0, -3.0, 0.5) };
                let pairs: Vec<(DVec3, DVec3)> = points.iter().map(|&p| (p, meant.point(p))).collect();
                let found = fit(&pairs, mirror).unwrap();
                let off = points.iter().map(|&p| found.point(p).distance(meant.point(p))).fold(0.0, f64::max);
                assert!(off < 1e-12, "{found:?} {meant:?}");
            }
        }
        assert!(fit(&[(DVec3::X, DVec3::Y), (DVec3::X, DVec3::Y)], false).is_none());
    }
}
