//! What grows: round trees, cypresses, box balls, tulips. Crowns are coloured by their vertices, dark inside.

use crate::field;
use crate::noise;
use crate::random::Random;
use crate::raster::{blend, hex};
use crate::solid::{Ring, lathe, profile, spline, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};

/// Trunk and boughs of a round tree, about 2.4 m; bark along v.
pub fn trunk() -> Surface {
    let mut random = Random::new(31);
    let path = spline(
        &[[0.0, -0.15, 0.0], [0.02, 0.4, 0.01], [-0.05, 1.1, 0.04], [0.04, 1.8, -0.02], [0.0, 2.5, 0.03]]
            .map(DVec3::from_array),
        5,
    );
    let rings: Vec<Ring> = path
        .iter()
        .map(|p| {
            Ring::round(*p, 0.105 + 0.11 * (-(p.y - 0.3)).max(0.0) + 0.02 * noise::space(*p * 3.0, 5) - 0.022 * p.y)
        })
        .collect();
    let mut wood = tube(&rings, DVec3::Z, 18).textured(DVec2::new(1.0, 2.6), DVec2::ZERO);
    for k in 0..5 {
        let out = turn::around(72.0 * f64::from(k) + random.range(-15.0, 15.0));
        let start = DVec3::new(0.0, 1.5 + 0.14 * f64::from(k), 0.0);
        let bough = spline(&[start, start + out * 0.28 + DVec3::Y * 0.22, start + out * 0.75 + DVec3::Y * 0.75], 4);
        let rings: Vec<Ring> =
            bough.iter().enumerate().map(|(i, p)| Ring::round(*p, 0.05 - 0.0045 * i as f64)).collect();
        wood.join(&tube(&rings, DVec3::Z, 10).textured(DVec2::new(0.5, 1.0), DVec2::ZERO));
    }
    wood.shaded(60.0).with_tangents()
}

/// Leafy lumps: noise that makes a smooth ball look like foliage, about [-1, 1].
fn leaves(p: DVec3, scale: f64, seed: u32) -> f64 {
    let billow = |q: DVec3, s: u32| 1.0 - 2.0 * noise::space(q, s).abs() * 1.6;
    0.5 * billow(p * scale, seed) + 0.35 * billow(p * scale * 2.1, seed ^ 3) + 0.25 * billow(p * scale * 4.3, seed ^ 5)
}

/// Paints a crown grey-white, to be multiplied by the material's colour: dark below and in its hollows.
fn shadowed(crown: Surface, low: f64, high: f64, hollow: impl Fn(DVec3) -> f64) -> Surface {
    crown.painted(|p, n| {
        let height = ((p.y - low) / (high - low)).clamp(0.0, 1.0);
        let light = 0.3 + 0.36 * height + 0.2 * (0.5 + 0.5 * n.y) + 0.3 * hollow(p);
        let tint = 0.1 * noise::cloud(p * 2.2, 2, 77);
        [light + tint, light, light * (0.86 - tint)]
    })
}

/// The crown of a round tree: eight balls grown into one, about 3 m wide, its middle 3.1 m above the ground.
pub fn crown() -> Surface {
    let mut random = Random::new(33);
    let middle = DVec3::new(0.0, 3.1, 0.0);
    let mut balls = vec![(middle, 1.12)];
    for k in 0..7 {
        let out = turn::around(51.4 * f64::from(k) + random.range(-14.0, 14.0)) * random.range(0.62, 0.86);
        balls.push((middle + out + DVec3::Y * random.range(-0.45, 0.6), random.range(0.6, 0.82)));
    }
    balls.push((middle + DVec3::new(0.1, 0.85, -0.05), 0.72));
    let smooth = |p: DVec3| balls.iter().map(|(m, r)| (p - *m).length() - r).fold(9.0, |a, b| field::blend(a, b, 0.22));
    let span = DVec3::new(2.1, 2.1, 2.1);
    let crown = field::surface(middle - span, middle + span, 0.12, |p| smooth(p) - 0.1 * leaves(p, 2.3, 61));
    shadowed(crown.shaded(180.0), 1.9, 4.4, |p| leaves(p, 2.3, 61).clamp(-1.0, 1.0))
}

/// A cypress, 4.6 m: a flame of upright lumps.
pub fn cypress() -> Surface {
    let outline = profile(
        &[[0.0, 0.1], [0.3, 0.16], [0.52, 0.7], [0.56, 1.5], [0.44, 2.7], [0.24, 3.8], [0.08, 4.45], [0.0, 4.62]],
        6,
    );
    let tree = lathe(&outline, 40).mapped(|p| {
        let out = DVec3::new(p.x, 0.15 * p.y.min(0.4), p.z).normalize_or_zero();
        let narrow = DVec3::new(p.x, p.y * 0.42, p.z);
        p + out * 0.11 * leaves(narrow, 4.2, 63) * step(4.6, 4.2, p.y)
    });
    let mut tree = shadowed(tree.shaded(180.0), 0.0, 4.6, |p| leaves(DVec3::new(p.x, p.y * 0.42, p.z), 4.2, 63));
    tree.uvs.clear();
    tree
}

/// A clipped ball of box, radius about 0.34, resting on y = 0.
pub fn bush() -> Surface {
    let ball = crate::solid::ball(4).mapped(|d| (d * (0.34 + 0.03 * leaves(d, 3.4, 65))) + DVec3::Y * 0.26);
    shadowed(ball.shaded(180.0), -0.1, 0.6, |p| leaves((p - DVec3::Y * 0.26) / 0.34, 3.4, 65))
}

/// Stems and leaves of a clump of seven tulips; the petals are [`petals`].
pub fn stems() -> Surface {
    let mut green = Surface::default();
    for (at, height, turned) in clump() {
        let top = at + DVec3::new(0.02 * turn::sin(turned), height, 0.02 * turn::cos(turned));
        let rings: Vec<Ring> =
            spline(&[at, (at + top) * 0.5 + DVec3::X * 0.006, top], 2).iter().map(|p| Ring::round(*p, 0.006)).collect();
        green.join(&tube(&rings, DVec3::Z, 6));
        for side in [0.0, 150.0] {
            let blade = Surface::grid(2, 6, |u, v| {
                let width = 0.024 * (1.0 - v) * (0.35 + 2.4 * v) + 0.001;
                let bend = 0.13 * v * v;
                DVec3::new(
                    (u - 0.5) * 2.0 * width,
                    height * (0.75 * v - 0.2 * v * v),
                    bend + 0.01 - 0.012 * (1.0 - (2.0 * u - 1.0).abs()),
                )
            });
            // Both sides are meshed, so that the leaf is a closed sheet.
            let blade = blade.turned(turn::y(turned + side)).moved(at.x, at.y, at.z);
            green.join(&blade);
            green.join(&blade.clone().flipped());
        }
    }
    let mut green = green.shaded(70.0).painted(|p, _| blend(hex(0x2f5a2a), hex(0x86ad4c), p.y / 0.3).to_array());
    green.uvs.clear();
    green
}

fn clump() -> Vec<(DVec3, f64, f64)> {
    let mut random = Random::new(35);
    (0..7)
        .map(|k| {
            let at = turn::around(51.4 * f64::from(k)) * if k == 0 { 0.02 } else { random.range(0.1, 0.17) };
            (at, random.range(0.25, 0.36), random.range(0.0, 360.0))
        })
        .collect()
}

/// The flowers of the clump: cups of six petals, white, to be multiplied by the material's colour.
pub fn petals() -> Surface {
    let mut all = Surface::default();
    for (at, height, turned) in clump() {
        let top = at + DVec3::new(0.02 * turn::sin(turned), height, 0.02 * turn::cos(turned));
        let outline = profile(
            &[
                [0.0, 0.0],
                [0.024, 0.006],
                [0.036, 0.03],
                [0.03, 0.06],
                [0.026, 0.075],
                [0.022, 0.06],
                [0.02, 0.02],
                [0.0, 0.014],
            ],
            2,
        );
        let cup = lathe(&outline, 18).mapped(|p| {
            let lobe = libm::cos(3.0 * libm::atan2(p.x, p.z));
            let high = step(0.03, 0.075, p.y);
            DVec3::new(p.x * (1.0 + 0.1 * lobe * high), p.y + 0.016 * lobe * high, p.z * (1.0 + 0.1 * lobe * high))
        });
        all.join(&cup.turned(turn::y(turned)).moved(top.x, top.y - 0.004, top.z));
    }
    let mut all = all.shaded(70.0);
    all.uvs.clear();
    all
}
