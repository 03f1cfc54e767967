//! Where cameras stand: the 24 views of the image metric, other sets for use inside a loop, and the projection.

use glam::{DMat4, DVec3};

/// What all cameras look at: a sphere, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Its centre.
    pub center: DVec3,
    /// Its radius, above 0.
    pub radius: f64,
}

/// The 24 vertices of a rhombicuboctahedron as unit vectors: all orders and signs of (±1, ±1, ±(1+√2)). P. Lindstrom,
/// G. Turk, *Image-driven simplification*, 2000. Reports use these views.
pub fn rhombicuboctahedron() -> Vec<DVec3> {
    let long = 1.0 + 2f64.sqrt();
    let signs = |i: usize, bit: usize| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
    let vertex = |i: usize| {
        let mut at = [1.0; 3];
        at[i / 8] = long;
        DVec3::new(at[0] * signs(i, 0), at[1] * signs(i, 1), at[2] * signs(i, 2)).normalize_or_zero()
    };
    (0..24).map(vertex).collect()
}

/// `count` directions spread evenly over the sphere, none of them one of the 24 for any count up to 1000: for use
/// inside a loop that must not be tuned to the metric's own views. (R. Swinbank, R. J. Purser, *Fibonacci grids*,
/// 2006.)
pub fn fibonacci(count: usize) -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let radius = (1.0 - y * y).sqrt();
        let angle = golden * i as f64 + 0.3;
        DVec3::new(radius * libm::cos(angle), y, radius * libm::sin(angle))
    };
    (0..count).map(direction).collect()
}

/// Vertical and horizontal field of view: 45°, as its half's sine and tangent.
const HALF_FIELD_SIN: f64 = 0.382_683_432_365_089_8;
const HALF_FIELD_TAN: f64 = 0.414_213_562_373_095;

/// Room between the sphere and the border of the picture.
const MARGIN: f64 = 1.02;

/// A camera that sees the whole frame, upright, in perspective, in a square picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Its place, world space; the light is there too.
    pub eye: DVec3,
    /// World space to clip space: x and y are −w…w in the picture (x to the right, y up), z is between 0 and w as in
    /// WebGPU, w is the distance in front of the camera.
    pub clip: DMat4,
    /// Nothing is nearer than this: distance in front of the camera, above 0.
    pub near: f64,
}

impl Camera {
    /// The camera that sees `frame` from `direction` (a unit vector).
    pub fn new(frame: Frame, direction: DVec3) -> Self {
        let distance = frame.radius * MARGIN / HALF_FIELD_SIN;
        let eye = frame.center + direction * distance;
        let back = direction;
        let up = if back.y.abs() > 0.999 { DVec3::Z } else { DVec3::Y };
        let right = up.cross(back).normalize_or_zero();
        let up = back.cross(right);
        let row = |axis: DVec3, scale: f64| [axis * scale, DVec3::splat(-axis.dot(eye) * scale)];
        let [x, tx] = row(right, 1.0 / HALF_FIELD_TAN);
        let [y, ty] = row(up, 1.0 / HALF_FIELD_TAN);
        let [w, tw] = row(-back, 1.0);
        // Depth from 0 at `near` to w at `far`, for hardware; levels may stick out of the sphere a little.
        let (near, far) = (distance - frame.radius * 1.5, distance + frame.radius * 1.5);
        let (scale, shift) = (far / (far - near), -far * near / (far - near));
        let clip = DMat4::from_cols_array(&[
            x.x,
            y.x,
            w.x * scale,
            w.x, //
            x.y,
            y.y,
            w.y * scale,
            w.y, //
            x.z,
            y.z,
            w.z * scale,
            w.z, //
            tx.x,
            ty.x,
            tw.x * scale + shift,
            tw.x,
        ]);
        // Levels may stick out of the sphere; far less than this is for a float's exponent.
        Self { eye, clip, near: near / 1024.0 }
    }

    /// One camera for each direction.
    pub fn all(frame: Frame, directions: &[DVec3]) -> Vec<Self> {
        directions.iter().map(|direction| Self::new(frame, *direction)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn key(v: DVec3) -> [i64; 3] {
        v.to_array().map(|x| (x * 1e9).round() as i64)
    }

    #[test]
    fn the_24_views_are_symmetric() {
        let views = rhombicuboctahedron();
        let set: BTreeSet<_> = views.iter().map(|v| key(*v)).collect();
        assert_eq!(set.len(), 24);
        for v in &views {
            assert!((v.length() - 1.0).abs() < 1e-15);
            for turned in [DVec3::new(v.y, v.z, v.x), DVec3::new(v.y, v.x, v.z), -*v, DVec3::new(-v.x, v.y, v.z)] {
                assert!(set.contains(&key(turned)), "{turned}");
            }
        }
        let nearest = |v: &DVec3| views.iter().map(|w| (*w - *v).length()).filter(|d| *d > 0.0).fold(9.0, f64::min);
        // All edges are equally long.
        assert!(views.iter().all(|v| (nearest(v) - nearest(&views[0])).abs() < 1e-12));
    }

    #[test]
    fn fibonacci_views_are_even_and_not_the_24() {
        for count in [1, 2, 20, 40, 100] {
            let views = fibonacci(count);
            assert_eq!(views.len(), count);
            let sum: DVec3 = views.iter().sum();
            assert!(count < 20 || sum.length() / (count as f64) < 0.1, "{sum}");
        }
        let ours: BTreeSet<_> = rhombicuboctahedron().into_iter().map(key).collect();
        assert!((1..=1000).all(|count| fibonacci(count).into_iter().all(|v| !ours.contains(&key(v)))));
    }

    #[test]
    fn the_sphere_fits_and_stands_upright() {
        let frame = Frame { center: DVec3::new(1e6, -20.0, 3.0), radius: 0.25 };
        for direction in rhombicuboctahedron().into_iter().chain([DVec3::Y, -DVec3::Y, DVec3::Z]) {
            let camera = Camera::new(frame, direction);
            let middle = camera.clip * frame.center.extend(1.0);
            assert!((middle.x / middle.w).abs() < 1e-6 && (middle.y / middle.w).abs() < 1e-6);
            assert!(middle.w > frame.radius);
            for at in fibonacci(500) {
                let p = camera.clip * (frame.center + at * frame.radius).extend(1.0);
                assert!(p.w > 0.0 && p.x.abs() < p.w && p.y.abs() < p.w && 0.0 < p.z && p.z < p.w);
            }
            if direction.y.abs() < 0.99 {
                let above = camera.clip * (frame.center + DVec3::Y * 0.1).extend(1.0);
                assert!(above.y > 0.0);
            }
        }
    }
}
