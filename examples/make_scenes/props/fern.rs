//! A fern in a terracotta pot: fronds are bent strips with an alpha mask, seen from both sides.

use crate::coats::ceramic;
use crate::gltf::{Document, Pose};
use crate::noise;
use crate::random::Random;
use crate::raster::{Raster, blend, hex};
use crate::solid::{corners, lathe, spline};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};
use serde_json::json;

/// One frond, its foot at the lower edge: leaflets left and right of a stem. Alpha cuts it out.
fn picture() -> Raster {
    Raster::paint([256, 512], |uv| {
        let (x, t) = ((uv.x - 0.5).abs() * 2.0, 1.0 - uv.y);
        let reach = (1.0 - t).sqrt() * (t * 9.0).min(1.0) * 0.96;
        // Leaflets lean towards the tip.
        let along = (t - 0.10 * x) * 19.0;
        let inside = (along - along.floor() - 0.5) * 2.0;
        let leaflet = along.floor();
        let length = reach * (0.9 + 0.1 * noise::lattice(leaflet as i64, i64::from(uv.x > 0.5), 7));
        let width = 0.94 * (1.0 - (x / length.max(1e-6)) * (x / length.max(1e-6))).max(0.0).sqrt();
        let blade = if x < length && inside.abs() < width && t > 0.07 { 1.0 } else { 0.0 };
        let stem = if x < 0.035 * (1.15 - t) { 1.0 } else { 0.0 };
        let vein = step(0.16, 0.04, inside.abs()) * 0.5;
        let young = blend(hex(0x2f6b2b), hex(0x7fb347), 0.75 * t + 0.2 * x + 0.3 * noise::tiles(uv, [6, 6], 3, 8));
        let green = blend(young, hex(0xa9cf6a), vein);
        let color = blend(green * (0.72 + 0.35 * x), hex(0x6d7d35), stem * 0.8);
        color.extend(if blade > 0.5 || stem > 0.5 { 1.0 } else { 0.0 }).to_array()
    })
}

/// A strip that rises, bends over and hangs: `lean` is the angle from upright at its foot, in degrees.
fn frond(random: &mut Random, lean: f64, length: f64) -> Surface {
    let bend = random.range(70.0, 105.0);
    let sway = random.range(-12.0, 12.0);
    let (columns, rows) = (4, 14);
    let mut spine = vec![DVec3::ZERO];
    for row in 0..rows {
        let t = f64::from(row) / f64::from(rows);
        let angle = lean + bend * t * t.sqrt();
        let ahead = DVec3::new(turn::sin(sway * t), turn::cos(angle), turn::sin(angle));
        spine.push(spine[spine.len() - 1] + ahead.normalize() * length / f64::from(rows));
    }
    let half = length * 0.17;
    let strip = Surface::grid(columns, rows as usize, |u, v| {
        let row = (v * f64::from(rows)).round() as usize;
        let x = (u - 0.5) * 2.0;
        // Half a gutter: the sides hang below the stem.
        spine[row] + DVec3::new(x * half, -0.25 * half * x.abs() * (0.4 + v), 0.0)
    });
    strip.turned(turn::y(random.range(0.0, 360.0)))
}

fn fronds() -> Surface {
    let mut random = Random::new(11);
    let mut all = Surface::default();
    for k in 0..46 {
        let outer = f64::from(k) / 46.0;
        let lean = 6.0 + 52.0 * outer + random.range(-6.0, 6.0);
        let length = 0.34 + 0.2 * outer + random.range(-0.06, 0.06);
        let foot = turn::around(random.range(0.0, 360.0)) * (0.05 * outer);
        all.join(&frond(&mut random, lean, length).moved(foot.x, 0.0, foot.z));
    }
    all.moved(0.0, 0.245, 0.0).shaded(180.0)
}

fn pot() -> Surface {
    let outside = corners(&[
        [0.0, 0.012],
        [0.088, 0.012],
        [0.092, 0.016],
        [0.118, 0.19],
        [0.134, 0.192],
        [0.138, 0.197],
        [0.142, 0.252],
        [0.138, 0.258],
        [0.128, 0.258],
        [0.124, 0.252],
        [0.116, 0.2],
        [0.0, 0.2],
    ]);
    let saucer = corners(&[
        [0.0, 0.0],
        [0.125, 0.0],
        [0.13, 0.004],
        [0.152, 0.03],
        [0.15, 0.034],
        [0.146, 0.034],
        [0.124, 0.01],
        [0.0, 0.01],
    ]);
    let tiled = |s: Surface, v: f64| s.textured(DVec2::new(3.0, v), DVec2::ZERO);
    Surface::joined([tiled(lathe(&dense(&outside), 64), 2.4), tiled(lathe(&dense(&saucer), 64), 1.2)])
        .shaded(38.0)
        .with_tangents()
}

/// Long pieces of a profile cut into shorter ones, so that rows are about as high as columns are wide.
fn dense(outline: &[DVec2]) -> Vec<DVec2> {
    let mut fine = vec![outline[0]];
    for pair in outline.windows(2) {
        let pieces = ((pair[1] - pair[0]).length() / 0.02).ceil().max(1.0);
        fine.extend((1..=pieces as usize).map(|k| pair[0] + (pair[1] - pair[0]) * (k as f64 / pieces)));
    }
    fine
}

fn soil() -> Surface {
    let outline = spline(
        &[DVec2::new(0.122, 0.215), DVec2::new(0.08, 0.236), DVec2::new(0.03, 0.243), DVec2::new(0.0, 0.244)],
        4,
    );
    let mound = lathe(&outline, 48).mapped(|p| p + DVec3::Y * 0.011 * noise::cloud(p * 60.0, 2, 9));
    let mut mound = mound
        .shaded(180.0)
        .painted(|p, _| blend(hex(0x2a1c12), hex(0x5b4430), 0.45 + 1.6 * noise::cloud(p * 75.0, 2, 10)).to_array());
    mound.uvs.clear();
    mound
}

/// Pot, soil and fern, one mesh of three materials.
pub fn scene() -> Document {
    let mut document = Document::default();
    let clay = document.coat("terracotta", &ceramic::terracotta());
    let clay = document.coated("terracotta", clay);
    let earth = document.plain("soil", DVec3::ONE, 0.0, 1.0);
    let leaf = document.picture("fern frond", picture().png());
    let green = document.push(
        "materials",
        json!({
            "name": "frond",
            "alphaMode": "MASK",
            "alphaCutoff": 0.5,
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": leaf }, "metallicFactor": 0.0, "roughnessFactor": 0.7,
            },
        }),
    );
    let primitives = [document.part(&pot(), clay), document.part(&soil(), earth), document.part(&fronds(), green)];
    let mesh = document.push("meshes", json!({ "name": "potted fern", "primitives": primitives }));
    let node = document.node("potted fern", &Pose::default(), json!({ "mesh": mesh }));
    document.push("scenes", json!({ "name": "fern", "nodes": [node] }));
    document
}
