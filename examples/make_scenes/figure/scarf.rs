//! A knitted scarf: a collar around the neck and a hanging end with a fringe.

use super::body::quantised;
use super::skeleton::{JOINTS, Joint};
use crate::noise;
use crate::raster::{Coat, Texel, blend, hex};
use crate::solid::{Ring, spline, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};

/// Knit stitches in two colours; u across the stitches, v along the scarf.
pub fn knit() -> Coat {
    Coat::paint([256, 256], |uv| {
        let (x, y) = (uv.x * 12.0, uv.y * 16.0);
        let column = x - x.floor() - 0.5;
        // Each stitch is a V: its two legs lean against each other.
        let leg = y + column.abs() * 1.3;
        let row = leg - leg.floor() - 0.5;
        let round = (1.0 - 3.2 * row * row).max(0.0)
            * (1.0 - (column.abs() * 2.0 - 0.5) * (column.abs() * 2.0 - 0.5) * 2.4).max(0.0);
        let stripe = step(0.4, 0.6, (leg.floor() / 8.0).fract() * 2.0);
        let wool = noise::tiles(uv, [40, 40], 2, 171);
        let dye = blend(hex(0x1f6f78), hex(0xf0e2c2), stripe);
        Texel { color: dye * (0.62 + 0.42 * round + 0.2 * wool), height: 0.012 * round, rough: 0.95, metal: 0.0 }
    })
}

fn collar() -> Surface {
    let rings: Vec<Ring> = (0..=40)
        .map(|k| {
            let angle = 360.0 * f64::from(k % 40) / 40.0;
            let fold = 0.004 * turn::sin(angle * 3.0 + 40.0);
            let out = turn::around(angle) * DVec3::new(0.118, 0.0, 0.112);
            let low = 0.648 - 0.018 * turn::cos(angle);
            Ring { middle: out + DVec3::Y * (low + fold), wide: 0.036, high: 0.044 }
        })
        .collect();
    ring_of(&rings, 14)
}

/// A closed ring of sections: a tube without caps whose last ring is its first.
fn ring_of(rings: &[Ring], sides: usize) -> Surface {
    let last = rings.len() - 1;
    let mut surface = Surface::default();
    for (k, ring) in rings.iter().enumerate() {
        let ahead = (rings[(k + 1) % last].middle - rings[(k + last - 1) % last].middle).normalize();
        let across = ahead.cross(DVec3::Y).normalize();
        for side in 0..=sides {
            let angle = 360.0 * (side % sides) as f64 / sides as f64;
            let p = ring.middle + across * (ring.wide * turn::sin(angle)) + DVec3::Y * (ring.high * turn::cos(angle));
            surface.positions.push(p);
            surface.uvs.push(DVec2::new(side as f64 / sides as f64, 3.0 * k as f64 / last as f64));
        }
    }
    surface.fill_grid(sides, last);
    surface
}

/// The end that hangs over the chest, with seven strands of fringe.
fn end() -> Surface {
    let path = spline(
        &[[0.05, 0.64, 0.118], [0.075, 0.62, 0.148], [0.088, 0.56, 0.17], [0.095, 0.48, 0.182], [0.1, 0.42, 0.182]]
            .map(DVec3::from_array),
        5,
    );
    let rings: Vec<Ring> = path.iter().map(|p| Ring { middle: *p, wide: 0.043, high: 0.011 }).collect();
    let mut cloth = tube(&rings, DVec3::new(0.25, 0.0, 1.0), 16).textured(DVec2::new(1.0, 1.1), DVec2::ZERO);
    let foot = path[path.len() - 1];
    for k in -3..=3 {
        let x = f64::from(k) * 0.0125;
        let strand = [0.0, -0.018, -0.042]
            .map(|y| Ring::round(foot + DVec3::new(x * (1.0 - y * 3.0), y, -x * 0.25), 0.0062 + y * 0.05));
        cloth.join(&tube(&strand, DVec3::Z, 6).textured(DVec2::new(0.1, 0.2), DVec2::ZERO));
    }
    cloth
}

/// Collar and end, shaded, with tangents.
pub fn scarf() -> Surface {
    Surface::joined([collar(), end()]).shaded(70.0).with_tangents()
}

/// The collar follows neck and chest; the end swings on joints of its own.
pub fn weights(p: DVec3) -> ([u8; 4], [u8; 4]) {
    let mut pull = [0.0; JOINTS.len()];
    let hanging = step(0.118, 0.15, p.z) * step(0.655, 0.6, p.y) * step(-0.01, 0.04, p.x);
    let low = step(0.58, 0.48, p.y);
    pull[Joint::Neck as usize] = 0.5 * (1.0 - hanging);
    pull[Joint::Chest as usize] = 0.5 * (1.0 - hanging);
    pull[Joint::Scarf1 as usize] = hanging * (1.0 - low);
    pull[Joint::Scarf2 as usize] = hanging * low;
    quantised(&pull)
}
