//! Solids from curves: lathes, tubes, rounded blocks, balls. Not shaded yet.

use crate::surface::Surface;
use crate::turn;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// A Catmull-Rom curve through `points`, `steps` pieces between two of them.
pub fn spline<V>(points: &[V], steps: usize) -> Vec<V>
where
    V: Copy + std::ops::Add<Output = V> + std::ops::Sub<Output = V> + std::ops::Mul<f64, Output = V>,
{
    let last = points.len() - 1;
    let mut curve = Vec::new();
    for i in 0..last {
        let (a, b, c, d) = (points[i.max(1) - 1], points[i], points[i + 1], points[(i + 2).min(last)]);
        let (leave, arrive) = ((c - a) * 0.5, (d - b) * 0.5);
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            let square = (c - b) * 3.0 - leave * 2.0 - arrive;
            let cube = (b - c) * 2.0 + leave + arrive;
            curve.push(b + leave * t + square * (t * t) + cube * (t * t * t));
        }
    }
    curve.push(points[last]);
    curve
}

/// A smooth profile for [`lathe`] through (radius, height) pairs.
pub fn profile(points: &[[f64; 2]], steps: usize) -> Vec<DVec2> {
    spline(&points.iter().map(|p| DVec2::from_array(*p)).collect::<Vec<_>>(), steps)
        .into_iter()
        .map(|p| DVec2::new(p.x.max(0.0), p.y))
        .collect()
}

/// (radius, height) pairs joined by straight lines.
pub fn corners(points: &[[f64; 2]]) -> Vec<DVec2> {
    points.iter().map(|p| DVec2::from_array(*p)).collect()
}

/// A surface of revolution about the y axis. The profile, (radius, height), runs so that the outside is on its right
/// when it goes up; it is closed if it starts and ends on the axis. The seam is at +z; u goes once around, v by the
/// length of the profile.
pub fn lathe(profile: &[DVec2], columns: usize) -> Surface {
    let mut along = vec![0.0];
    for pair in profile.windows(2) {
        along.push(along[along.len() - 1] + (pair[1] - pair[0]).length());
    }
    let total = along[along.len() - 1];
    let mut surface = Surface::default();
    for (p, length) in profile.iter().zip(&along) {
        for column in 0..=columns {
            let direction = turn::around(360.0 * (column % columns) as f64 / columns as f64);
            surface.positions.push(direction * p.x + DVec3::Y * p.y);
            surface.uvs.push(DVec2::new(column as f64 / columns as f64, 1.0 - length / total));
        }
    }
    surface.fill_grid(columns, profile.len() - 1);
    surface
}

/// One ring of a [`tube`].
#[derive(Clone, Copy)]
pub struct Ring {
    /// Its middle.
    pub middle: DVec3,
    /// Half its width.
    pub wide: f64,
    /// Half its height.
    pub high: f64,
}

impl Ring {
    /// A round one.
    pub fn round(middle: DVec3, radius: f64) -> Self {
        Self { middle, wide: radius, high: radius }
    }
}

/// A tube with flat caps through `rings`; a last or first ring of radius 0 closes it to a point. `up` is the side
/// that keeps to the ring's height. u goes around, v along its length, both in [0, 1].
pub fn tube(rings: &[Ring], up: DVec3, sides: usize) -> Surface {
    let last = rings.len() - 1;
    let mut loops: Vec<Vec<DVec3>> = Vec::new();
    let mut side = up;
    for (i, ring) in rings.iter().enumerate() {
        let ahead = (rings[(i + 1).min(last)].middle - rings[i.max(1) - 1].middle).normalize_or(DVec3::Z);
        side = (side - ahead * ahead.dot(side)).normalize_or(ahead.any_orthonormal_vector());
        let across = ahead.cross(side);
        let at = |k: usize| {
            let angle = 360.0 * (k % sides) as f64 / sides as f64;
            ring.middle + across * (ring.wide * turn::sin(angle)) + side * (ring.high * turn::cos(angle))
        };
        loops.push((0..=sides).map(at).collect());
    }
    let mut along = vec![0.0];
    for pair in rings.windows(2) {
        along.push(along[along.len() - 1] + (pair[1].middle - pair[0].middle).length());
    }
    let total = along[last];
    let flat = |ring: &Ring| vec![ring.middle; sides + 1];
    loops.insert(0, flat(&rings[0]));
    along.insert(0, 0.0);
    loops.push(flat(&rings[last]));
    along.push(total);
    let mut surface = Surface::default();
    for (points, length) in loops.iter().zip(&along) {
        for (k, p) in points.iter().enumerate() {
            surface.positions.push(*p);
            surface.uvs.push(DVec2::new(k as f64 / sides as f64, 1.0 - length / total));
        }
    }
    surface.fill_grid(sides, loops.len() - 1);
    surface
}

/// A ring-shaped tube about the y axis: radius of the ring, then half width (radial) and half height of its section.
pub fn hoop(radius: f64, section: [f64; 2], columns: usize) -> Surface {
    let [wide, high] = section;
    // Corners of the section are cut at 45°, so that the metal has an edge to catch the light.
    let (w, h) = (wide * 0.6, high * 0.75);
    let outline = corners(&[
        [radius - w, -high],
        [radius + w, -high],
        [radius + wide, -h],
        [radius + wide, h],
        [radius + w, high],
        [radius - w, high],
        [radius - wide, h],
        [radius - wide, -h],
        [radius - w, -high],
    ]);
    lathe(&outline, columns)
}

/// A block with rounded edges about the origin. `half`: half lengths; `round`: radius of the edges, in `steps` pieces;
/// `cells`: pieces of the flat part of each side, so that the block can be bent. Each side has its own chart of
/// texture coordinates, in metres, u along the side's longer edge.
pub fn block(half: DVec3, round: f64, steps: usize, cells: [usize; 3]) -> Surface {
    let mut all = Surface::default();
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let (rows, columns) = (stations(half[b], round, steps, cells[b]), stations(half[a], round, steps, cells[a]));
        let mut side = Surface::default();
        for &q in &rows {
            for &p in &columns {
                let mut cube = DVec3::ZERO;
                (cube[axis], cube[a], cube[b]) = (sign * half[axis], p, q);
                let inner = cube.clamp(-half + DVec3::splat(round), half - DVec3::splat(round));
                side.positions.push(inner + (cube - inner).normalize_or_zero() * round);
                let long = if half[b] > half[a] { DVec2::new(q, sign * p) } else { DVec2::new(sign * p, -q) };
                side.uvs.push(long);
            }
        }
        side.fill_grid(columns.len() - 1, rows.len() - 1);
        all.join(&if sign > 0.0 { side } else { side.flipped() });
    }
    all
}

/// Coordinates of the grid lines over one side of a [`block`]: spread so that the rounding has equal angles.
fn stations(half: f64, round: f64, steps: usize, cells: usize) -> Vec<f64> {
    let flat = half - round;
    let bend: Vec<f64> = (0..=steps)
        .map(|k| round * turn::sin(45.0 * k as f64 / steps as f64) / turn::cos(45.0 * k as f64 / steps as f64))
        .collect();
    let mut lines: Vec<f64> = bend.iter().rev().map(|b| -flat - b).collect();
    lines.extend((1..cells).map(|k| -flat + 2.0 * flat * k as f64 / cells as f64));
    lines.extend(bend.iter().map(|b| flat + b));
    lines
}

/// A ball of radius 1 from an icosahedron whose triangles are halved `times` times. No texture coordinates.
pub fn ball(times: usize) -> Surface {
    let g = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut all = Surface::default();
    for s in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
        let (p, q) = (s[0], s[1] * g);
        all.positions
            .extend([DVec3::new(p, q, 0.0), DVec3::new(0.0, p, q), DVec3::new(q, 0.0, p)].map(DVec3::normalize));
    }
    let edge = (all.positions[0] - all.positions[3]).length() * 1.01;
    let near = |a: usize, b: usize| (all.positions[a] - all.positions[b]).length() < edge;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let [x, y, z] = [a, b, c].map(|i| all.positions[i]);
                    let outwards = (y - x).cross(z - x).dot(x) > 0.0;
                    all.triangles.push(if outwards { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    for _ in 0..times {
        all = halved(&all);
    }
    all
}

fn halved(surface: &Surface) -> Surface {
    let mut fine = Surface { positions: surface.positions.clone(), ..Surface::default() };
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for t in &surface.triangles {
        let m = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                fine.positions.push((surface.positions[a as usize] + surface.positions[b as usize]).normalize());
                (fine.positions.len() - 1) as u32
            })
        });
        fine.triangles.extend([[t[0], m[0], m[2]], [t[1], m[1], m[0]], [t[2], m[2], m[1]], m]);
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::place;

    /// Asserts that every edge has one triangle on each side and that the triangles face outwards.
    fn assert_solid(name: &str, surface: &Surface) {
        let mut edges: BTreeMap<[[i64; 3]; 2], i32> = BTreeMap::new();
        let mut volume = 0.0;
        for t in &surface.triangles {
            let corners = t.map(|i| surface.positions[i as usize]);
            volume += corners[0].dot(corners[1].cross(corners[2]));
            for k in 0..3 {
                let [a, b] = [place(corners[k]), place(corners[(k + 1) % 3])];
                *edges.entry(if a < b { [a, b] } else { [b, a] }).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|balance| *balance == 0), "{name} is open");
        assert!(volume > 0.0, "{name} is inside out");
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        assert_solid("lathe", &lathe(&corners(&[[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.0, 1.0]]), 12));
        let rings = [0.0, 1.0, 2.0].map(|z| Ring::round(DVec3::new(z * 0.2, 0.0, z), 0.3));
        assert_solid("tube", &tube(&rings, DVec3::Y, 8));
        assert_solid("hoop", &hoop(1.0, [0.1, 0.1], 16));
        assert_solid("block", &block(DVec3::new(1.0, 0.5, 0.2), 0.05, 2, [4, 2, 1]));
        assert_solid("ball", &ball(2));
        let field = |p: DVec3| (p - DVec3::splat(0.01)).length() - 0.8;
        assert_solid("field", &crate::field::surface(DVec3::splat(-1.0), DVec3::ONE, 0.13, field));
    }
}
