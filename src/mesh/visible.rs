//! How much of each triangle can be seen from outside its mesh: what lies in a pocket may be coarser than what shows.
//!
//! A depth buffer from each of a few directions all around, without perspective. Triangles that face away are neither seen
//! nor do they hide anything, as with materials of one side; so a leaf is seen from both, and walls that are seen through
//! from behind hide no room. Knows positions only. Same operations in the same order everywhere: no result depends on
//! the machine.

use rayon::prelude::*;

use super::Mesh;
use super::weld::NONE;
use crate::mesh::layout::frame;
use crate::quadric::{cross, dot, sub};

/// Directions, spread evenly.
const VIEWS: usize = 14;

/// Views that are drawn side by side.
const AT_ONCE: usize = 2;

/// Pixels a side: a pocket narrower than a hundredth of the mesh is no pocket.
const SIZE: i32 = 192;

/// For each triangle of all primitives, in order: the share of it, 0…1, that nothing stands before, as the mean over its
/// corners of what is seen of the faces around them.
pub fn visible(mesh: &Mesh) -> Vec<f32> {
    let (points, faces) = welded(mesh);
    let (center, radius) = frame(&mesh.primitives);
    // Seen and expected pixels around each point.
    let mut sums = vec![[0.0f32; 2]; points.len()];
    let mut seen = vec![0u32; faces.len()];
    let mut expected = vec![0.0f32; faces.len()];
    // The sphere fits with a pixel to spare.
    let to_pixels = (f64::from(SIZE) * 0.5 - 1.0) / radius;
    let view = |direction: &[f64; 3]| {
        let (right, up) = across(*direction);
        let place = |point: &[f64; 3]| {
            let off = sub(*point, center);
            let half = f64::from(SIZE) * 0.5;
            let (x, y) = (dot(off, right) * to_pixels + half, dot(off, up) * to_pixels + half);
            [x as f32, y as f32, (-dot(off, *direction) * to_pixels) as f32]
        };
        let placed: Vec<[f32; 3]> = points.iter().map(place).collect();
        let mut buffer = vec![(f32::INFINITY, NONE); (SIZE * SIZE) as usize];
        let areas = (0..).zip(&faces).map(|(number, face)| draw(face.map(|v| placed[v as usize]), number, &mut buffer));
        (areas.collect::<Vec<f32>>(), buffer)
    };
    // A few at a time, for the memory; summed in their order, for the same bits with any number of threads.
    for directions in directions().collect::<Vec<_>>().chunks(AT_ONCE) {
        let views: Vec<_> = directions.par_iter().with_max_len(1).map(view).collect();
        for (areas, buffer) in views {
            expected.iter_mut().zip(areas).for_each(|(sum, area)| *sum += area);
            for &(_, face) in buffer.iter().filter(|pixel| pixel.1 != NONE) {
                seen[face as usize] += 1;
            }
        }
    }
    for ((face, seen), expected) in faces.iter().zip(seen).zip(expected) {
        for &v in face {
            let sum = &mut sums[v as usize];
            sum[0] += seen as f32;
            sum[1] += expected;
        }
    }
    let share = |v: u32| {
        let [seen, expected] = sums[v as usize];
        if expected > 0.0 { (seen / expected).min(1.0) } else { 0.0 }
    };
    faces.iter().map(|&[a, b, c]| (share(a) + share(b) + share(c)) / 3.0).collect()
}

/// Distinct positions, and the triangles over them.
fn welded(mesh: &Mesh) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let weld = super::weld::positions(mesh);
    let mut points = vec![[0.0; 3]; weld.count];
    let mut faces = Vec::with_capacity(mesh.triangles());
    let mut start = 0;
    for primitive in &mesh.primitives {
        for (stored, position) in primitive.positions().iter().enumerate() {
            points[weld.vertex[start + stored] as usize] = position.map(f64::from);
        }
        let of = |i: u32| weld.vertex[start + i as usize];
        faces.extend(primitive.indices.chunks_exact(3).map(|t| [of(t[0]), of(t[1]), of(t[2])]));
        start += primitive.count;
    }
    (points, faces)
}

/// Evenly spread unit vectors: a Fibonacci lattice (Á. González, *Measurement of areas on a sphere using Fibonacci and
/// latitude-longitude lattices*, 2010).
fn directions() -> impl Iterator<Item = [f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    (0..VIEWS).map(move |i| {
        let y = 1.0 - (2.0 * i as f64 + 1.0) / VIEWS as f64;
        let r = (1.0 - y * y).sqrt();
        let (sin, cos) = libm::sincos(golden * i as f64);
        [r * cos, y, r * sin]
    })
}

/// Two unit vectors across a unit vector.
fn across(direction: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let axis = if direction[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    let right = cross(axis, direction);
    let length = dot(right, right).sqrt();
    let right = right.map(|x| x / length);
    (right, cross(direction, right))
}

/// The least integer not below a number. Processors without SSE 4.1 have no instruction for that, and a call takes as long
/// as all else that is done for a small triangle.
#[inline]
fn ceil(x: f32) -> i32 {
    let whole = x as i32;
    whole + i32::from((whole as f32) < x)
}

/// The greatest integer not above a number.
#[inline]
fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}

/// Draws a triangle; returns its area in pixels, 0 if it faces away.
#[inline]
fn draw([a, b, c]: [[f32; 3]; 3], number: u32, buffer: &mut [(f32, u32)]) -> f32 {
    let (abx, aby, acx, acy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
    let twice = abx * acy - aby * acx;
    // Also for numbers that are not finite.
    if twice <= 0.0 || !twice.is_finite() {
        return 0.0;
    }
    let range = |p: f32, q: f32, r: f32| {
        let (low, high) = (p.min(q).min(r), p.max(q).max(r));
        // Centres of pixels are at halves.
        (ceil(low - 0.5).max(0), floor(high - 0.5).min(SIZE - 1))
    };
    let ((x0, x1), (y0, y1)) = (range(a[0], b[0], c[0]), range(a[1], b[1], c[1]));
    if x0 <= x1 && y0 <= y1 {
        let inverse = 1.0 / twice;
        let (abz, acz) = (b[2] - a[2], c[2] - a[2]);
        for y in y0..=y1 {
            let py = y as f32 + 0.5 - a[1];
            for x in x0..=x1 {
                let px = x as f32 + 0.5 - a[0];
                let (v, w) = ((px * acy - py * acx) * inverse, (py * abx - px * aby) * inverse);
                if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
                    let depth = a[2] + v * abz + w * acz;
                    let pixel = &mut buffer[(y * SIZE + x) as usize];
                    if depth < pixel.0 {
                        *pixel = (depth, number);
                    }
                }
            }
        }
    }
    twice * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Attribute, Format, Primitive};

    /// A closed box around the origin, turned outwards.
    fn cube(half: f32) -> Primitive {
        let corner = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { half } else { -half });
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let values = (0..8).flat_map(corner).collect();
        Primitive {
            count: 8,
            attributes: vec![Attribute { name: "POSITION".to_owned(), components: 3, format: Format::F32, values }],
            indices: quads.iter().flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).collect(),
            targets: Vec::new(),
        }
    }

    #[test]
    fn a_box_in_a_box_is_hidden() {
        let seen = visible(&Mesh { primitives: vec![cube(1.0), cube(0.5)] });
        assert!(seen[..12].iter().all(|&share| share > 0.9), "{seen:?}");
        assert!(seen[12..].iter().all(|&share| share == 0.0), "{seen:?}");
    }

    #[test]
    fn a_box_from_within_hides_nothing() {
        let mut room = cube(1.0);
        room.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
        let seen = visible(&Mesh { primitives: vec![room, cube(0.25)] });
        // The floor behind the box is not all to be seen; what is in the room is.
        assert!(seen[..12].iter().all(|&share| share > 0.8), "{seen:?}");
        assert!(seen[12..].iter().all(|&share| share > 0.9), "{seen:?}");
    }
}
