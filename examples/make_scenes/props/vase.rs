//! A porcelain vase: a lathe with a texture seam, tangents, and gold where it was mended.

use crate::coats::ceramic;
use crate::gltf::{Document, Pose};
use crate::solid::{lathe, profile, spline};
use crate::surface::Surface;
use glam::DVec2;
use serde_json::json;

/// Rows of the outside, (radius, height), from the foot to the lip.
const OUTSIDE: [[f64; 2]; 12] = [
    [0.074, 0.0],
    [0.078, 0.006],
    [0.070, 0.022],
    [0.088, 0.070],
    [0.128, 0.145],
    [0.150, 0.225],
    [0.143, 0.300],
    [0.104, 0.358],
    [0.064, 0.392],
    [0.055, 0.425],
    [0.064, 0.462],
    [0.088, 0.488],
];

/// The glazed solid: outside, rounded lip, inside, foot. Watertight.
pub fn body() -> Surface {
    let outside = profile(&OUTSIDE, 4);
    let wall = 0.007;
    let mut inside: Vec<DVec2> = outside
        .iter()
        .rev()
        .filter(|p| p.y > 0.03)
        .step_by(2)
        .map(|p| DVec2::new((p.x - wall).max(0.012), p.y))
        .collect();
    let lip = [outside[outside.len() - 1], DVec2::new(0.0865, 0.4925), DVec2::new(0.083, 0.4915), inside[0]];
    let foot = [DVec2::new(0.0, 0.008), DVec2::new(0.058, 0.008), DVec2::new(0.064, 0.0), outside[0]];
    inside.extend([DVec2::new(0.04, 0.024), DVec2::new(0.0, 0.022)]);
    // Only the outside is painted; the rest takes the plain strip at the lower edge of the picture.
    let plain = |surface: Surface| surface.textured(DVec2::new(1.0, 0.012), DVec2::new(0.0, 0.987));
    Surface::joined([
        lathe(&outside, 88),
        plain(lathe(&spline(&lip, 3), 88)),
        plain(lathe(&inside, 88)),
        plain(lathe(&foot, 88)),
    ])
    .shaded(50.0)
    .with_tangents()
}

/// The vase alone.
pub fn scene() -> Document {
    let mut document = Document::default();
    let textures = document.coat("cobalt and gold", &ceramic::glaze());
    let glaze = document.coated("glaze", textures);
    let part = document.part(&body(), glaze);
    let mesh = document.push("meshes", json!({ "name": "vase", "primitives": [part] }));
    let node = document.node("vase", &Pose::default(), json!({ "mesh": mesh }));
    document.push("scenes", json!({ "name": "vase", "nodes": [node] }));
    document
}
