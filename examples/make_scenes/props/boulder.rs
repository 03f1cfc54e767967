//! A mossy boulder: an icosahedron displaced by noise; colour, moss and occlusion live in its vertex colours alone.

use crate::gltf::{Document, Pose};
use crate::noise;
use crate::raster::{blend, hex};
use crate::solid::ball;
use crate::surface::Surface;
use crate::turn::step;
use glam::DVec3;
use serde_json::json;

/// How far the rock reaches in a direction, and how deep that point lies in a crack (0…1).
fn reach(d: DVec3, seed: u32) -> (f64, f64) {
    // Broken faces: the rock is cut by planes, softened where two of them meet.
    let mut cut = 1.25_f64;
    for k in 0..14 {
        let n = DVec3::new(
            noise::lattice(k, 1, seed) - 0.5,
            noise::lattice(k, 2, seed) - 0.5,
            noise::lattice(k, 3, seed) - 0.5,
        )
        .normalize();
        let facing = n.dot(d);
        if facing > 0.2 {
            let far = (0.78 + 0.3 * noise::lattice(k, 4, seed)) / facing;
            let soft = (0.5 + 0.5 * (far - cut) / 0.05).clamp(0.0, 1.0);
            cut = far + (cut - far) * soft - 0.05 * soft * (1.0 - soft);
        }
    }
    let broad = noise::cloud(d * 1.7, 3, seed ^ 7);
    let ridge = 1.0 - noise::cloud(d * 2.1 + DVec3::splat(broad), 3, seed ^ 8).abs() * 4.2;
    let crack = step(0.72, 1.0, ridge);
    let grain = noise::cloud(d * 11.0, 3, seed ^ 9);
    (cut + 0.12 * broad - 0.045 * crack + 0.014 * grain, crack)
}

/// A rock of about radius 1, sunk a little into the ground; `detail` halvings of an icosahedron.
pub fn rock(seed: u32, detail: usize) -> Surface {
    let squash = DVec3::new(1.12, 0.78, 0.95);
    let shape = ball(detail).mapped(|d| {
        let p = d * reach(d, seed).0 * squash;
        DVec3::new(p.x, (p.y + 0.55).max(-0.02) + 0.03 * (p.y + 0.55).min(0.0), p.z)
    });
    shape.shaded(180.0).painted(|p, n| {
        let d = ((p - DVec3::Y * 0.55) / squash).normalize_or(DVec3::Y);
        let (far, crack) = reach(d, seed);
        let hollow = ((far - 1.0) * 1.6 + 0.5).clamp(0.0, 1.0);
        let speck = noise::cloud(p * 9.0, 3, seed + 20);
        let stone = blend(hex(0x6f6a66), hex(0xa49a8c), 0.5 + 0.55 * speck + 0.5 * noise::cloud(p * 2.0, 3, seed + 21));
        let lichen = step(0.16, 0.26, noise::cloud(p * 5.5, 4, seed + 22)) * step(0.9, 0.2, n.y);
        let moss = step(0.5, 0.7, n.y + 0.9 * noise::cloud(p * 3.4, 4, seed + 23) + 0.25 * crack);
        let green = blend(hex(0x3d5220), hex(0x8fa03f), 0.45 + 1.2 * noise::cloud(p * 12.0, 2, seed + 24));
        let color = blend(blend(stone, hex(0xc9a24b), 0.7 * lichen), green, moss);
        let shade = (0.5 + 0.5 * hollow) * (1.0 - 0.5 * crack) * step(-0.12, 0.3, p.y + 0.1 * n.y);
        (color * (0.25 + 0.75 * shade)).to_array()
    })
}

/// A boulder with two smaller stones; the small ones are one mesh.
pub fn scene() -> Document {
    let mut document = Document::default();
    let stone = document.plain("stone", DVec3::ONE, 0.0, 0.9);
    let part = document.part(&rock(1, 5), stone);
    let boulder = document.push("meshes", json!({ "name": "boulder", "primitives": [part] }));
    let part = document.part(&rock(5, 4), stone);
    let small = document.push("meshes", json!({ "name": "stone", "primitives": [part] }));
    let mut nodes = vec![document.node("boulder", &Pose::default(), json!({ "mesh": boulder }))];
    for (k, (x, z, size, turned)) in
        [(1.22, 0.62, 0.34, 40.0), (-0.95, 0.95, 0.22, 200.0), (1.0, 1.12, 0.16, 120.0)].into_iter().enumerate()
    {
        let pose =
            Pose { at: DVec3::new(x, -0.02, z), turn: crate::turn::about(DVec3::Y, turned), scale: DVec3::splat(size) };
        nodes.push(document.node(&format!("stone {}", k + 1), &pose, json!({ "mesh": small })));
    }
    document.push("scenes", json!({ "name": "boulder", "nodes": nodes }));
    document
}
