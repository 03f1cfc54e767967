//! Closed surfaces of distance fields (naive surface nets: one vertex for each cell that the surface crosses).
//!
//! S. F. Gibson, Constrained elastic surface nets, 1998; here without the relaxation, but each vertex is pulled onto
//! the surface along the gradient.

use crate::surface::Surface;
use glam::DVec3;
use std::collections::BTreeMap;

/// Union of two fields, rounded within `soft` of where they meet.
pub fn blend(a: f64, b: f64, soft: f64) -> f64 {
    let h = (soft - (a - b).abs()).max(0.0) / soft;
    a.min(b) - h * h * soft * 0.25
}

/// Distance to an ellipsoid (approximate away from its surface).
pub fn ellipsoid(p: DVec3, middle: DVec3, radii: DVec3) -> f64 {
    let q = p - middle;
    let (near, slope) = ((q / radii).length(), (q / (radii * radii)).length());
    if slope < 1e-9 { -radii.min_element() } else { near * (near - 1.0) / slope }
}

/// Distance to a cone with round ends: radius `ra` at `a`, `rb` at `b`.
pub fn limb(p: DVec3, [a, b]: [DVec3; 2], [ra, rb]: [f64; 2]) -> f64 {
    let (along, out) = (b - a, p - a);
    let length = along.length();
    let forth = out.dot(along) / length;
    let aside = (out.length_squared() - forth * forth).max(0.0).sqrt();
    // The side leans by the angle whose sine is `lean`; the nearest of the balls on the axis lies that much back.
    let lean = ((ra - rb) / length).clamp(-0.95, 0.95);
    let t = ((forth - aside * lean / (1.0 - lean * lean).sqrt()) / length).clamp(0.0, 1.0);
    (out - along * t).length() - (ra + (rb - ra) * t)
}

/// Direction in which the field grows fastest.
pub fn gradient(field: &impl Fn(DVec3) -> f64, p: DVec3, step: f64) -> DVec3 {
    let along = |d: DVec3| field(p + d * step) - field(p - d * step);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or(DVec3::Y)
}

/// The surface where `field` is 0, which must lie inside the box from `low` to `high`; `cell` is the edge of a cell.
/// The field must not change by more than twice the way: far from the surface, points are skipped.
pub fn surface(low: DVec3, high: DVec3, cell: f64, field: impl Fn(DVec3) -> f64) -> Surface {
    let size = ((high - low) / cell).ceil().as_i64vec3() + 1;
    let index = |x: i64, y: i64, z: i64| ((z * size.y + y) * size.x + x) as usize;
    let point = |x: i64, y: i64, z: i64| low + DVec3::new(x as f64, y as f64, z as f64) * cell;
    let mut values = Vec::with_capacity((size.x * size.y * size.z) as usize);
    for z in 0..size.z {
        for y in 0..size.y {
            let mut x = 0;
            while x < size.x {
                let value = field(point(x, y, z));
                let alike = 1 + (value.abs() / (2.0 * cell)) as i64;
                values.extend((x..size.x.min(x + alike)).map(|_| value));
                x += alike;
            }
        }
    }
    let mut net = Net { surface: Surface::default(), vertices: BTreeMap::new() };
    for z in 0..size.z - 1 {
        for y in 0..size.y - 1 {
            for x in 0..size.x - 1 {
                let corner = |k: i64| {
                    let (dx, dy, dz) = (x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
                    (point(dx, dy, dz), values[index(dx, dy, dz)])
                };
                if let Some(middle) = crossing(&corner) {
                    net.place(index(x, y, z), pulled(&field, middle, cell));
                }
            }
        }
    }
    let steps = [index(1, 0, 0), index(0, 1, 0), index(0, 0, 1)];
    for z in 1..size.z - 1 {
        for y in 1..size.y - 1 {
            for x in 1..size.x - 1 {
                let here = index(x, y, z);
                for axis in 0..3 {
                    let inside = [values[here] < 0.0, values[here + steps[axis]] < 0.0];
                    if inside[0] != inside[1] {
                        let (b, c) = (steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
                        let around = [here, here - b, here - b - c, here - c];
                        net.quad(around, inside[0]);
                    }
                }
            }
        }
    }
    net.surface
}

struct Net {
    surface: Surface,
    vertices: BTreeMap<usize, u32>,
}

impl Net {
    fn place(&mut self, cell: usize, at: DVec3) {
        self.vertices.insert(cell, self.surface.positions.len() as u32);
        self.surface.positions.push(at);
    }

    /// A quad of four cells, cut along its shorter diagonal.
    fn quad(&mut self, cells: [usize; 4], forwards: bool) {
        let mut q = cells.map(|cell| self.vertices[&cell]);
        if !forwards {
            q.swap(1, 3);
        }
        let gap = |a: usize, b: usize| {
            (self.surface.positions[q[a] as usize] - self.surface.positions[q[b] as usize]).length_squared()
        };
        let (first, second) = if gap(0, 2) <= gap(1, 3) {
            ([q[0], q[1], q[2]], [q[0], q[2], q[3]])
        } else {
            ([q[0], q[1], q[3]], [q[1], q[2], q[3]])
        };
        self.surface.triangle(first);
        self.surface.triangle(second);
    }
}

/// Mean of the points where the surface crosses the cell's edges; corner k has bit 0 for x, bit 1 for y, bit 2 for z.
fn crossing(corner: &impl Fn(i64) -> (DVec3, f64)) -> Option<DVec3> {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for k in 0..8 {
        for bit in [1, 2, 4] {
            if k & bit == 0 {
                let ((p, a), (q, b)) = (corner(k), corner(k | bit));
                if (a < 0.0) != (b < 0.0) {
                    sum += p + (q - p) * (a / (a - b));
                    count += 1.0;
                }
            }
        }
    }
    (count > 0.0).then(|| sum / count)
}

/// Two careful steps towards the surface, staying near the cell.
fn pulled(field: &impl Fn(DVec3) -> f64, start: DVec3, cell: f64) -> DVec3 {
    let mut p = start;
    for _ in 0..2 {
        let off = field(p).clamp(-0.4 * cell, 0.4 * cell);
        p -= gradient(field, p, cell * 0.25) * off;
    }
    p
}
