//! A market stall with a striped awning, and pigeons.

use crate::random::Random;
use crate::raster::{Raster, blend, hex};
use crate::solid::{Ring, ball, block, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};

/// Cloth: white stripes and stripes to be dyed by the material's colour are one picture each.
pub fn stripes(dye: u32) -> Raster {
    Raster::paint([128, 64], |uv| {
        let stripe = step(0.485, 0.515, (uv.x * 2.0).fract()) - step(0.985, 1.0, (uv.x * 2.0).fract());
        let weave = crate::noise::tile(uv, [64, 32], 161) * 0.04;
        (blend(hex(dye), hex(0xf6efe0), stripe) + weave).extend(1.0).to_array()
    })
}

/// Posts, table and shelf; wood.
pub fn frame() -> Surface {
    let mut random = Random::new(41);
    let mut wood = Surface::default();
    let mut beam = |half: [f64; 3], at: [f64; 3]| {
        let cells = half.map(|h| ((h / 0.5) as usize).max(1));
        let slide = DVec2::new(random.unit(), random.unit());
        wood.join(
            &block(DVec3::from_array(half), 0.008, 1, cells)
                .textured(DVec2::splat(1.1), slide)
                .moved(at[0], at[1], at[2]),
        );
    };
    for x in [-1.0, 1.0] {
        beam([0.04, 1.1, 0.04], [x, 1.1, 0.55]);
        beam([0.04, 1.25, 0.04], [x, 1.25, -0.55]);
        beam([0.03, 0.03, 0.6], [x, 0.78, 0.0]);
    }
    for k in 0..7 {
        beam([1.08, 0.015, 0.075], [0.0, 0.85, -0.51 + 0.17 * f64::from(k)]);
    }
    for k in 0..4 {
        beam([1.0, 0.075, 0.012], [0.0, 0.2 + 0.165 * f64::from(k), 0.56]);
    }
    beam([1.05, 0.03, 0.03], [0.0, 2.18, 0.55]);
    beam([1.05, 0.03, 0.03], [0.0, 2.48, -0.55]);
    wood.shaded(50.0)
}

/// The awning: a sagging sheet of two sides with a scalloped hem in front.
pub fn awning() -> Surface {
    let sheet = |side: f64| {
        Surface::grid(40, 12, |u, v| {
            let (x, t) = ((u - 0.5) * 2.5, 1.0 - v);
            let hem = step(0.8, 0.86, t);
            let slope = t.min(0.83) / 0.83;
            let sag = 0.05 * (1.0 - (2.0 * u - 1.0) * (2.0 * u - 1.0)) * turn::sin(180.0 * slope);
            let scallop = 0.1 + 0.07 * libm::fabs(turn::sin(180.0 * u * 10.0));
            let y = 2.56 - 0.42 * slope - sag - scallop * hem * ((t - 0.83).max(0.0) / 0.17);
            DVec3::new(x, y + 0.006 * side, -0.72 + 1.6 * slope + 0.03 * hem * t + 0.004 * side * hem)
        })
    };
    let cloth = Surface::joined([sheet(1.0), sheet(-1.0).flipped()]).textured(DVec2::new(5.0, 1.0), DVec2::ZERO);
    cloth.shaded(50.0)
}

/// A pigeon that looks along +z, painted by its vertices; pecking if `down`.
pub fn pigeon() -> Surface {
    let rings = [
        ([0.0, 0.118, -0.2], 0.012, 0.006),
        ([0.0, 0.12, -0.15], 0.03, 0.011),
        ([0.0, 0.125, -0.09], 0.044, 0.034),
        ([0.0, 0.128, -0.03], 0.06, 0.058),
        ([0.0, 0.135, 0.03], 0.062, 0.066),
        ([0.0, 0.155, 0.075], 0.05, 0.056),
        ([0.0, 0.185, 0.098], 0.034, 0.038),
        ([0.0, 0.215, 0.106], 0.027, 0.03),
        ([0.0, 0.24, 0.118], 0.028, 0.029),
        ([0.0, 0.25, 0.138], 0.02, 0.02),
        ([0.0, 0.25, 0.15], 0.009, 0.009),
    ];
    let points: Vec<DVec3> = crate::solid::spline(&rings.map(|r| DVec3::from_array(r.0)), 3);
    let sizes: Vec<DVec2> = crate::solid::spline(&rings.map(|r| DVec2::new(r.1, r.2)), 3);
    let loft: Vec<Ring> = points.iter().zip(&sizes).map(|(p, s)| Ring { middle: *p, wide: s.x, high: s.y }).collect();
    let coat = |p: DVec3, _: DVec3| {
        let neck = step(0.15, 0.19, p.y) * step(0.245, 0.225, p.y);
        let sheen = blend(hex(0x3f6f63), hex(0x6d4a7d), 0.5 + 0.5 * turn::sin(p.y * 9000.0));
        let bar = step(0.012, 0.006, (p.z + 0.07).abs()).max(step(0.012, 0.006, (p.z + 0.11).abs()))
            * step(0.02, 0.03, p.x.abs());
        let grey = blend(hex(0x767d88), hex(0xb9c0c6), (p.y - 0.07) / 0.1);
        let tail = step(-0.15, -0.19, p.z);
        blend(blend(blend(grey, sheen, neck * 0.9), hex(0x3a3d44), bar), hex(0x4a4e57), tail).to_array()
    };
    let mut bird = tube(&loft, DVec3::Y, 20).shaded(70.0).painted(coat);
    let beak: Vec<Ring> = [[0.25, 0.148, 0.008], [0.243, 0.17, 0.002]]
        .iter()
        .map(|[y, z, r]| Ring::round(DVec3::new(0.0, *y, *z), *r))
        .collect();
    bird.join(&tube(&beak, DVec3::Y, 8).shaded(50.0).painted(|_, _| hex(0x5b5450).to_array()));
    for side in [-1.0, 1.0] {
        let leg = [[0.09_f64, 0.0], [0.045, 0.012], [0.0, 0.008], [0.002, 0.035]]
            .map(|[y, z]| Ring::round(DVec3::new(side * 0.028, y.max(0.004), z), 0.005));
        bird.join(&tube(&leg, DVec3::X, 6).shaded(60.0).painted(|_, _| hex(0xb5544a).to_array()));
        let eye = Surface { uvs: vec![DVec2::ZERO; 42], ..ball(1).scaled(0.005) }.moved(side * 0.025, 0.252, 0.128);
        bird.join(&eye.shaded(180.0).painted(|_, _| hex(0xd9772b).to_array()));
    }
    bird.uvs.clear();
    bird
}
