//! A pine crate of apples: bevelled boards in one mesh with iron corners and rope, apples as nodes that share a mesh.

use crate::coats::{self, wood};
use crate::gltf::{Document, Pose};
use crate::noise;
use crate::random::Random;
use crate::raster::{blend, hex};
use crate::solid::{Ring, ball, block, lathe, profile, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

const HALF: DVec3 = DVec3::new(0.28, 0.17, 0.2);

/// A board of the given half lengths, its grain shifted at random.
fn board(random: &mut Random, half: [f64; 3], at: [f64; 3]) -> Surface {
    let cells = half.map(|h| ((h / 0.15) as usize).max(1));
    let warp = [random.range(-0.5, 0.5), random.range(-0.5, 0.5), random.range(-0.02, 0.02)];
    block(DVec3::from_array(half), 0.005, 1, cells)
        .textured(DVec2::splat(1.9), DVec2::new(random.unit(), random.unit()))
        .turned(turn::x(warp[0]) * turn::y(warp[1] * 0.4))
        .moved(at[0], at[1], at[2] + warp[2] * 0.05)
}

fn boards() -> Surface {
    let mut random = Random::new(21);
    let mut all = Surface::default();
    let (x, y, z) = (HALF.x, HALF.y, HALF.z);
    for row in 0..3 {
        let height = 0.055 + f64::from(row) * 0.115;
        for side in [-1.0, 1.0] {
            all.join(&board(&mut random, [x, 0.048, 0.009], [0.0, height, side * z]));
            all.join(&board(&mut random, [0.009, 0.048, z - 0.012], [side * (x - 0.012), height, 0.0]));
        }
    }
    for (sx, sz) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        all.join(&board(&mut random, [0.02, y, 0.02], [sx * (x - 0.043), y, sz * (z - 0.031)]));
    }
    for column in 0..5 {
        let across = (f64::from(column) - 2.0) * 0.105;
        all.join(&board(&mut random, [0.047, 0.008, z - 0.012], [across, 0.02, 0.0]));
    }
    all.shaded(50.0)
}

/// Straps around the four upright edges, each with six rivets.
fn straps() -> Surface {
    let mut all = Surface::default();
    for (turned, long, deep) in
        [(0.0, HALF.x, HALF.z), (90.0, HALF.z, HALF.x), (180.0, HALF.x, HALF.z), (270.0, HALF.z, HALF.x)]
    {
        for (height, side) in [0.055, 0.285].into_iter().flat_map(|h| [(h, -1.0), (h, 1.0)]) {
            let mut strap = block(DVec3::new(0.045, 0.02, 0.002), 0.0018, 1, [1; 3]).moved(0.0, 0.0, 0.0);
            for rivet in [-0.022, 0.022] {
                let head =
                    ball(1).mapped(|p| DVec3::new(p.x * 0.006 + rivet, p.y * 0.006, p.z.max(-0.2) * 0.0045 + 0.002));
                let uvs = head.positions.iter().map(|p| DVec2::new(p.x, p.y)).collect();
                strap.join(&Surface { uvs, ..head });
            }
            let out = deep + if turned % 180.0 == 0.0 { 0.011 } else { 0.0 };
            let strap = strap.textured(DVec2::splat(5.0), DVec2::new(height, side * 0.3));
            all.join(&strap.moved(side * (long - 0.033), height, out).turned(turn::y(turned)));
        }
    }
    all.shaded(45.0).with_tangents()
}

/// A handle at each end.
fn handles() -> Surface {
    let mut all = Surface::default();
    for side in [1.0, -1.0] {
        let path: Vec<DVec3> = crate::solid::spline(
            &[
                [0.26, 0.11],
                [0.262, 0.075],
                [0.292, 0.066],
                [0.306, 0.04],
                [0.311, 0.0],
                [0.306, -0.04],
                [0.292, -0.066],
                [0.262, -0.075],
                [0.26, -0.11],
            ]
            .map(|[x, z]| DVec3::new(x * side, 0.17 - 6.0 * (x - 0.26) * (x - 0.26) - 0.3 * (x - 0.26), z * side)),
            4,
        );
        let rings: Vec<Ring> =
            path.iter().map(|p| Ring::round(*p + DVec3::new(0.02 * side, 0.0, 0.0), 0.011)).collect();
        all.join(&tube(&rings, DVec3::Y, 14).textured(DVec2::new(1.0, 6.0), DVec2::ZERO));
    }
    all.shaded(60.0).with_tangents()
}

/// An apple with its stem, painted by vertex colours.
fn apple() -> Surface {
    let outline = profile(
        &[
            [0.0, -0.68],
            [0.16, -0.78],
            [0.36, -0.80],
            [0.72, -0.52],
            [0.98, 0.08],
            [0.90, 0.58],
            [0.55, 0.84],
            [0.26, 0.78],
            [0.08, 0.6],
            [0.0, 0.55],
        ],
        3,
    );
    let flesh = lathe(&outline, 32).mapped(|p| {
        // Five lobes at the foot.
        let lobes = libm::cos(5.0 * libm::atan2(p.x, p.z)) * 0.03 * step(0.3, -0.8, p.y);
        p * (1.0 + lobes)
    });
    let mut skin = flesh.shaded(180.0).painted(|p, _| {
        let angle = libm::atan2(p.x, p.z);
        let streak = noise::space(DVec3::new(libm::sin(angle) * 9.0, p.y * 0.9, libm::cos(angle) * 9.0), 3);
        let blush = step(-0.55, 0.5, p.x * 0.6 + p.y * 0.25 + 0.25 * streak + 0.35 * noise::space(p * 1.5, 4));
        let hollow = step(0.34, 0.1, DVec2::new(p.x, p.z).length()) * step(0.3, 0.6, p.y.abs());
        let color = blend(hex(0xe8b53e), blend(hex(0xcf3a22), hex(0x9c1420), 0.5 + streak), blush);
        blend(color, hex(0x7d7a2c), 0.75 * hollow).to_array()
    });
    let rings = [[0.0, 0.5, 0.05], [0.03, 0.7, 0.035], [0.08, 0.9, 0.035], [0.16, 1.05, 0.05]];
    let stem = tube(&rings.map(|[x, y, r]| Ring::round(DVec3::new(x, y, 0.0), r)), DVec3::Z, 8);
    skin.join(&stem.shaded(50.0).painted(|_, _| hex(0x4d3620).to_array()));
    skin.uvs.clear();
    skin.scaled(0.046)
}

fn straw() -> Surface {
    let mut bed = Surface::grid(40, 28, |u, v| {
        let p = DVec3::new((u - 0.5) * 0.52, 0.0, (0.5 - v) * 0.36);
        p + DVec3::Y * (0.2 + 0.02 * noise::cloud(DVec3::new(p.x * 60.0, 0.0, p.z * 25.0), 3, 31))
    })
    .shaded(180.0)
    .painted(|p, _| {
        blend(hex(0x6b4a1c), hex(0xe0be74), 0.4 + 1.4 * noise::cloud(DVec3::new(p.x * 70.0, 1.0, p.z * 30.0), 3, 32))
            .to_array()
    });
    bed.uvs.clear();
    bed
}

/// The crate's primitives, without apples, for scenes that show one.
pub fn parts(document: &mut Document) -> Vec<Value> {
    let pine = document.picture("pine boards", wood::planks(wood::pine(), 61).color.jpeg(85));
    let pine = document.textured("pine", pine, 0.75);
    let metal = document.coat("strap iron", &coats::iron());
    let hemp = document.coat("hemp rope", &coats::rope());
    let [metal, hemp] = [("iron", metal), ("rope", hemp)].map(|(name, coat)| document.coated(name, coat));
    let bed = document.plain("straw", DVec3::ONE, 0.0, 0.95);
    vec![
        document.part(&boards(), pine),
        document.part(&straps(), metal),
        document.part(&handles(), hemp),
        document.part(&straw(), bed),
    ]
}

/// A mesh of one apple.
pub fn apple_mesh(document: &mut Document) -> usize {
    let skin = document.plain("apple", DVec3::ONE, 0.0, 0.35);
    let part = document.part(&apple(), skin);
    document.push("meshes", json!({ "name": "apple", "primitives": [part] }))
}

/// Where the apples lie in the crate: two layers, each apple turned at random.
pub fn apples() -> Vec<Pose> {
    let mut random = Random::new(23);
    let mut poses = Vec::new();
    for (layer, columns, rows) in [(0, 5, 4), (1, 4, 3)] {
        for k in 0..columns * rows {
            let (column, row) = (f64::from(k % columns), f64::from(k / columns));
            let jitter = [random.range(-0.008, 0.008), random.range(-0.006, 0.006), random.range(-0.008, 0.008)];
            let shift = if k / columns % 2 == 0 { -0.012 } else { 0.012 };
            let at = DVec3::new(
                (column - f64::from(columns - 1) / 2.0) * 0.097 + shift + jitter[0],
                0.235 + f64::from(layer) * 0.062 + jitter[1],
                (row - f64::from(rows - 1) / 2.0) * 0.087 + jitter[2],
            );
            let tilt = turn::about(turn::around(random.range(0.0, 360.0)), random.range(0.0, 75.0));
            let turn = turn::about(DVec3::Y, random.range(0.0, 360.0)) * tilt;
            poses.push(Pose { at, turn, scale: DVec3::splat(random.range(0.92, 1.06)) });
        }
    }
    poses
}

/// The crate with its apples, and three that fell out.
pub fn scene() -> Document {
    let mut document = Document::default();
    let primitives = parts(&mut document);
    let mesh = document.push("meshes", json!({ "name": "crate", "primitives": primitives }));
    let apple = apple_mesh(&mut document);
    let mut nodes = vec![document.node("crate", &Pose::default(), json!({ "mesh": mesh }))];
    let mut poses = apples();
    for (x, z, tilt) in [(0.2, 0.32, 70.0), (0.11, 0.37, 20.0), (-0.24, 0.3, 110.0)] {
        let turn = turn::about(DVec3::X, tilt) * turn::about(DVec3::Y, tilt * 3.0);
        poses.push(Pose { at: DVec3::new(x, 0.041, z), turn, scale: DVec3::ONE });
    }
    for (k, pose) in poses.iter().enumerate() {
        nodes.push(document.node(&format!("apple {}", k + 1), pose, json!({ "mesh": apple })));
    }
    document.push("scenes", json!({ "name": "apple crate", "nodes": nodes }));
    document
}
