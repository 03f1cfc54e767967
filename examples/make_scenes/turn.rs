//! Angles and rotations through `libm`, so that every machine writes the same bytes. Angles in degrees.

use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::PI;

/// Sine of an angle in degrees.
pub fn sin(degrees: f64) -> f64 {
    libm::sin(degrees * PI / 180.0)
}

/// Cosine of an angle in degrees.
pub fn cos(degrees: f64) -> f64 {
    libm::cos(degrees * PI / 180.0)
}

/// The direction at an angle around the y axis: 0° is +z, 90° is +x.
pub fn around(degrees: f64) -> DVec3 {
    DVec3::new(sin(degrees), 0.0, cos(degrees))
}

/// Quaternion of a rotation about a unit axis.
pub fn about(axis: DVec3, degrees: f64) -> DQuat {
    let (s, c) = (sin(degrees / 2.0), cos(degrees / 2.0));
    DQuat::from_xyzw(axis.x * s, axis.y * s, axis.z * s, c)
}

/// Matrix of a rotation about the x axis.
pub fn x(degrees: f64) -> DMat3 {
    let (s, c) = (sin(degrees), cos(degrees));
    DMat3::from_cols(DVec3::X, DVec3::new(0.0, c, s), DVec3::new(0.0, -s, c))
}

/// Matrix of a rotation about the y axis.
pub fn y(degrees: f64) -> DMat3 {
    let (s, c) = (sin(degrees), cos(degrees));
    DMat3::from_cols(DVec3::new(c, 0.0, -s), DVec3::Y, DVec3::new(s, 0.0, c))
}

/// Matrix of a rotation about the z axis.
pub fn z(degrees: f64) -> DMat3 {
    let (s, c) = (sin(degrees), cos(degrees));
    DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(-s, c, 0.0), DVec3::Z)
}

/// 0 below `low`, 1 above `high`, smooth between; falls instead if `low > high`.
pub fn step(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
