//! An oak barrel: staves with bevelled gaps, heads set into a groove, iron hoops with rivets, a bung, a brass tap.

use crate::coats::{iron, wood};
use crate::gltf::{Document, Pose};
use crate::raster::hex;
use crate::solid::{Ring, ball, block, corners, hoop, lathe, tube};
use crate::surface::Surface;
use crate::turn;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

const STAVES: i64 = 18;
const HEIGHT: f64 = 0.9;

/// Outer radius at a height.
fn radius(y: f64) -> f64 {
    let t = (y / HEIGHT - 0.5) * 2.0;
    0.35 - 0.075 * t * t
}

/// The staves: outside, chamfered ends, and the inside above the heads.
fn staves() -> Surface {
    let columns = STAVES as usize * 5;
    let gap = |u: f64| {
        let inside = (u * STAVES as f64).fract();
        // Each stave is a little flatter than the barrel, with a rounded edge.
        let middle = (inside - 0.5).abs() * 2.0;
        0.0035 * (1.0 - middle * middle) - 0.006 * turn::step(0.75, 1.0, middle)
    };
    let rows = 20;
    let around = |u: f64, r: f64, y: f64| {
        turn::around(360.0 * (u * columns as f64).round() / columns as f64 % 360.0) * r + DVec3::Y * y
    };
    let outside = Surface::grid(columns, rows, |u, v| around(u, radius(v * HEIGHT) + gap(u), v * HEIGHT));
    let end = |y: f64, sign: f64| {
        Surface::grid(columns, 3, |u, v| {
            let r = radius(y) + gap(u);
            let (dr, dy) = [(0.0, 0.0), (-0.010, 0.004), (-0.026, 0.0), (-0.029, -0.05)][(v * 3.0).round() as usize];
            around(u, r + dr, y + sign * dy)
        })
        .textured(DVec2::new(1.0, 0.06), DVec2::new(0.0, 0.02))
    };
    Surface::joined([outside, end(HEIGHT, 1.0), end(0.0, -1.0).flipped()])
}

/// A round lid of boards at height `y`, in the staves' texture: the boards run along the picture's v.
fn head(y: f64) -> Surface {
    let outline = corners(&[
        [radius(y) - 0.02, -0.012],
        [radius(y) - 0.02, 0.008],
        [radius(y) - 0.03, 0.012],
        [0.12, 0.012],
        [0.0, 0.012],
    ]);
    let mut lid = lathe(&outline, 60);
    for (p, uv) in lid.positions.iter().zip(&mut lid.uvs) {
        *uv = DVec2::new(0.25 + p.x * 0.62, 0.5 + p.z * 0.62);
    }
    lid.moved(0.0, y, 0.0)
}

fn oak() -> Surface {
    let top = head(HEIGHT - 0.035);
    let bottom = head(HEIGHT - 0.035).mapped(|p| DVec3::new(p.x, HEIGHT - p.y, -p.z));
    let bung = lathe(&corners(&[[0.0, 0.0], [0.026, 0.0], [0.022, 0.03], [0.0, 0.032]]), 20)
        .textured(DVec2::new(0.04, 0.1), DVec2::new(0.11, 0.3))
        .turned(turn::x(90.0))
        .moved(0.0, HEIGHT / 2.0, 0.345);
    Surface::joined([staves(), top, bottom, bung]).shaded(40.0).with_tangents()
}

fn hoops() -> Surface {
    let mut metal = Surface::default();
    for (at, high) in [(0.045, 0.024), (0.2, 0.019), (0.31, 0.016), (0.59, 0.016), (0.70, 0.019), (0.855, 0.024)] {
        let r = radius(at) + 0.0045;
        let lean = (radius(at + 0.01) - radius(at - 0.01)) / 0.02;
        let band = hoop(r, [0.0045, high], 60)
            .textured(DVec2::new(16.0, 1.0), DVec2::ZERO)
            .mapped(|p| DVec3::new(p.x * (1.0 + lean * p.y / r), p.y + at, p.z * (1.0 + lean * p.y / r)));
        metal.join(&band);
        for side in [-1.0, 1.0] {
            let rivet = Surface::grid(10, 4, |u, v| {
                let (ring, rise) = (turn::cos(90.0 * v), turn::sin(90.0 * v));
                turn::around(360.0 * (u * 10.0).round() / 10.0 % 360.0) * ring * 0.008 + DVec3::Y * rise * 0.005
            });
            let angle = 200.0 + side * 2.6 + at * 40.0;
            let place = turn::around(angle) * (r + 0.0035) + DVec3::Y * at;
            metal.join(&rivet.turned(turn::y(angle) * turn::x(90.0)).moved(place.x, place.y, place.z));
        }
    }
    metal.shaded(35.0).with_tangents()
}

/// A tap low on the front.
fn tap() -> Surface {
    let spout: Vec<Ring> = [[0.0, 0.03], [0.0, 0.085], [-0.008, 0.105], [-0.03, 0.115], [-0.05, 0.116]]
        .iter()
        .zip([0.012, 0.012, 0.0125, 0.012, 0.0135])
        .map(|([y, z], r)| Ring::round(DVec3::new(0.0, *y, *z), r))
        .collect();
    let flange = hoop(0.014, [0.007, 0.005], 24).turned(turn::x(90.0)).moved(0.0, 0.0, 0.035);
    let stem = tube(&[0.0, 0.034].map(|y| Ring::round(DVec3::new(0.0, y, 0.07), 0.0065)), DVec3::Z, 14);
    let key = block(DVec3::new(0.028, 0.006, 0.005), 0.0045, 3, [1; 3]).moved(0.0, 0.038, 0.07);
    let knob = |x: f64| Surface { uvs: vec![DVec2::ZERO; 162], ..ball(2).scaled(0.0085) }.moved(x, 0.038, 0.07);
    Surface::joined([tube(&spout, DVec3::X, 20), flange, stem, key, knob(-0.03), knob(0.03)])
        .moved(0.0, 0.13, radius(0.13) - 0.03)
        .shaded(40.0)
}

/// The barrel's primitives, for scenes that show one.
pub fn parts(document: &mut Document) -> Vec<Value> {
    let oak_textures = document.coat("oak staves", &wood::staves(STAVES, wood::oak()));
    let iron_textures = document.coat("forged iron", &iron());
    let oak_material = document.coated("oak", oak_textures);
    let iron_material = document.coated("iron", iron_textures);
    let brass = document.plain("brass", hex(0xd8a846), 1.0, 0.28);
    let tap = Surface { uvs: Vec::new(), ..tap() };
    vec![document.part(&oak(), oak_material), document.part(&hoops(), iron_material), document.part(&tap, brass)]
}

/// The barrel alone.
pub fn scene() -> Document {
    let mut document = Document::default();
    let primitives = parts(&mut document);
    let mesh = document.push("meshes", json!({ "name": "barrel", "primitives": primitives }));
    let node = document.node("barrel", &Pose::default(), json!({ "mesh": mesh }));
    document.push("scenes", json!({ "name": "barrel", "nodes": [node] }));
    document
}
