//! Ceramic: terracotta, and the painted glaze of the vase.

use crate::noise;
use crate::raster::{Coat, Texel, blend, hex};
use crate::turn::step;
use glam::DVec2;
use std::f64::consts::TAU;

/// Fired clay with turning marks along u and pale bloom.
pub fn terracotta() -> Coat {
    Coat::paint([512, 512], |uv| {
        let rings = noise::tile(uv, [3, 60], 131);
        let cloud = noise::tiles(uv, [4, 4], 5, 132);
        let bloom = step(0.1, 0.4, noise::tiles(uv, [5, 3], 4, 133));
        let fine = noise::tiles(uv, [60, 60], 2, 134);
        let clay = blend(hex(0x9a4a2a), hex(0xcf7b4c), 0.55 + 0.8 * cloud + 0.12 * rings + 0.2 * fine);
        Texel {
            color: blend(clay, hex(0xdcb79a), 0.45 * bloom),
            height: 0.0016 * rings + 0.0012 * fine,
            rough: 0.86 + 0.1 * bloom,
            metal: 0.0,
        }
    })
}

/// Ink at a distance (in units of the drawing) from a line of half width `half`.
fn stroke(distance: f64, half: f64) -> f64 {
    step(half + 0.0035, half - 0.0035, distance.abs())
}

/// A band of meanders; `x` and `y` in [0, 1) of one meander.
fn meander(x: f64, y: f64) -> f64 {
    // One meander on a grid of 6 × 6, top row first.
    const ROWS: [&[u8; 6]; 6] = [b"######", b"#.....", b"#.####", b"#.#.##", b"#...#.", b"####.#"];
    let row = ROWS[((y * 6.0) as usize).min(5)];
    if row[((x * 6.0) as usize).min(5)] == b'#' { 1.0 } else { 0.0 }
}

/// A ring of `count` pointed petals that stand on v = `foot` and reach up to `tip` (v grows downwards).
fn petals(uv: DVec2, count: f64, foot: f64, tip: f64) -> f64 {
    let t = ((foot - uv.y) / (foot - tip)).clamp(0.0, 1.2);
    let x = ((uv.x * count).fract() - 0.5).abs();
    let width = 0.49 * (1.0 - t * t).max(0.0).sqrt() * (1.0 - 0.25 * t);
    let outline = step(0.055, 0.03, (x - width).abs());
    let wash = step(0.0, 0.06, width * 0.62 - x) * (1.0 - 0.55 * t);
    if t <= 0.0 || t > 1.05 { 0.0 } else { outline.max(0.62 * wash) }
}

/// A flower of eight petals about the origin, of radius 1.
fn rosette(p: DVec2) -> f64 {
    let (r, angle) = (p.length(), libm::atan2(p.y, p.x) / TAU);
    let lobe = 0.72 + 0.28 * libm::cos(TAU * 8.0 * angle).abs().sqrt();
    let petal = step(0.05, -0.02, r - lobe) * (0.45 + 0.4 * step(0.35, 0.95, r));
    let rim = step(0.09, 0.04, (r - lobe).abs());
    let heart = step(0.31, 0.25, r);
    let ring = step(0.06, 0.02, (r - 0.36).abs());
    (petal * (1.0 - ring) + rim).min(1.0) * (1.0 - heart) + heart * 0.95
}

/// Waving stem, leaves and flowers around the belly: `x` counts waves, `y` in [-1, 1] across the band.
fn vine(x: f64, y: f64) -> f64 {
    let wave = 0.42 * libm::sin(TAU * x);
    let stem = step(0.075, 0.03, (y - wave).abs());
    let mut ink = stem * 0.9;
    for (k, side) in [(0.25, -1.0), (0.75, 1.0)] {
        let dx = (x - k + 0.5).rem_euclid(1.0) - 0.5;
        let flower = rosette(DVec2::new(dx * 4.4, (y - side * 0.36) * 1.75));
        ink = ink.max(flower);
    }
    for leaf in 0..8 {
        let k = (f64::from(leaf) + 0.5) / 8.0;
        let side = if leaf % 2 == 0 { 1.0 } else { -1.0 };
        let dx = ((x - k + 0.5).rem_euclid(1.0) - 0.5) * 2.4;
        let dy = y - 0.42 * libm::sin(TAU * k) - side * 0.2;
        let (along, across) = (dx * 0.5 + dy * side * 0.86, dx * 0.86 - dy * side * 0.5);
        let width = 0.095 * (1.0 - (along / 0.25) * (along / 0.25)).max(0.0);
        ink = ink.max(0.8 * step(0.0, 0.03, width - across.abs()));
    }
    ink
}

/// Strength of the blue at a point of the vase: v from the lip (0) to the foot (1).
fn drawing(uv: DVec2) -> f64 {
    let v = uv.y;
    let lines = [0.022, 0.125, 0.137, 0.262, 0.270, 0.345, 0.353, 0.715, 0.727, 0.925, 0.937, 0.968];
    let mut ink = lines.iter().map(|at| stroke(v - at, 0.0022)).fold(0.0, f64::max);
    ink = ink.max(stroke(v - 0.01, 0.006));
    if (0.278..0.337).contains(&v) {
        ink = ink.max(meander((uv.x * 28.0).fract(), (v - 0.278) / 0.059));
    }
    ink = ink.max(petals(DVec2::new(uv.x, v), 16.0, 0.122, 0.032));
    if (0.145..0.258).contains(&v) {
        let y = (v - 0.2015) / 0.0565;
        let dots = DVec2::new(((uv.x * 20.0).fract() - 0.5) * 2.0, y);
        ink = ink.max(step(0.34, 0.26, dots.length())).max(step(0.08, 0.04, (dots.length() - 0.55).abs()) * 0.8);
    }
    if (0.365..0.705).contains(&v) {
        ink = ink.max(vine(uv.x * 5.0, (v - 0.535) / 0.17));
    }
    ink.max(petals(DVec2::new(uv.x, v), 20.0, 0.92, 0.735))
}

/// White glaze painted in cobalt blue, once broken and mended with gold. v runs from the lip to the foot; the last
/// 2 % of v are plain (inside and foot).
pub fn glaze() -> Coat {
    Coat::paint([1024, 1024], |uv| {
        let brush = DVec2::new(noise::tiles(uv, [24, 24], 2, 141), noise::tiles(uv, [24, 24], 2, 142)) * 0.0035;
        let p = DVec2::new((uv.x + brush.x).rem_euclid(1.0), uv.y + brush.y);
        let ink = drawing(p) * (0.86 + 0.5 * noise::tiles(uv, [18, 18], 4, 143));
        let body = blend(hex(0xe9e4d8), hex(0xf7f4ec), 0.6 + noise::tiles(uv, [5, 5], 4, 144));
        let blue = blend(hex(0x3c62b4), hex(0x12246b), ink);
        let painted = blend(body, blue, ink * 1.1);
        let bend = DVec2::new(noise::tiles(uv, [6, 6], 4, 145), noise::tiles(uv, [6, 6], 4, 146)) * 0.09;
        let broken = DVec2::new((uv.x + bend.x).rem_euclid(1.0), (uv.y + bend.y).rem_euclid(1.0));
        let (near, next, _) = noise::cells(broken, [4, 3], 147);
        let width = 0.022 + 0.02 * noise::tiles(uv, [12, 12], 2, 148);
        let gold = step(width + 0.012, width, next - near) * step(0.985, 0.97, uv.y);
        Texel {
            color: blend(painted, hex(0xe8b84a), gold),
            height: 0.0022 * gold,
            rough: 0.16 + 0.14 * gold,
            metal: gold,
        }
    })
}
