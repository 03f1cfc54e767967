//! Stone: fountain, columns, paving, kerbs, urns, and the ground they stand on.

use crate::noise;
use crate::raster::{blend, hex};
use crate::solid::{Ring, block, corners, lathe, profile, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::{DVec2, DVec3};

/// Radius of the paved circle.
pub const PAVED: f64 = 9.6;
/// Radius of the whole ground.
pub const GROUND: f64 = 17.5;

/// Basin, stem, two bowls and a finial; marble.
pub fn fountain() -> Surface {
    let marble = |s: Surface, u: f64, v: f64| s.textured(DVec2::new(u, v), DVec2::ZERO);
    let basin = corners(&[
        [2.45, 0.0],
        [2.45, 0.1],
        [2.4, 0.14],
        [2.3, 0.16],
        [2.3, 0.44],
        [2.36, 0.48],
        [2.44, 0.5],
        [2.48, 0.55],
        [2.46, 0.6],
        [2.4, 0.62],
        [2.15, 0.62],
        [2.09, 0.6],
        [2.07, 0.55],
        [2.1, 0.5],
        [2.1, 0.12],
        [1.9, 0.1],
        [0.0, 0.1],
    ]);
    let stem = profile(
        &[
            [0.62, 0.1],
            [0.6, 0.16],
            [0.42, 0.24],
            [0.28, 0.4],
            [0.24, 0.7],
            [0.3, 0.95],
            [0.22, 1.05],
            [0.3, 1.12],
            [0.75, 1.24],
            [1.12, 1.42],
            [1.2, 1.5],
            [1.18, 1.54],
            [1.1, 1.5],
            [0.7, 1.36],
            [0.24, 1.3],
        ],
        3,
    );
    let upper = profile(
        &[
            [0.24, 1.3],
            [0.2, 1.4],
            [0.14, 1.6],
            [0.13, 1.8],
            [0.2, 1.94],
            [0.15, 2.0],
            [0.22, 2.06],
            [0.5, 2.15],
            [0.66, 2.28],
            [0.66, 2.33],
            [0.6, 2.3],
            [0.36, 2.2],
            [0.13, 2.17],
            [0.1, 2.3],
            [0.14, 2.42],
            [0.08, 2.5],
            [0.1, 2.6],
            [0.13, 2.66],
            [0.1, 2.74],
            [0.03, 2.8],
            [0.0, 2.86],
        ],
        3,
    );
    let fluted = |s: Surface| {
        s.mapped(|p| {
            let under = step(1.06, 1.18, p.y) * step(1.46, 1.38, p.y) + step(2.04, 2.1, p.y) * step(2.3, 2.22, p.y);
            let lobe = 1.0 + 0.025 * under * libm::cos(16.0 * libm::atan2(p.x, p.z));
            DVec3::new(p.x * lobe, p.y, p.z * lobe)
        })
    };
    Surface::joined([
        marble(lathe(&basin, 64), 8.0, 3.0),
        marble(fluted(lathe(&stem, 48)), 3.0, 2.0),
        marble(fluted(lathe(&upper, 48)), 2.0, 2.0),
    ])
    .shaded(42.0)
}

/// Water in the basin and the bowls, and the jets between them.
pub fn water() -> Surface {
    let disc = |r: f64, y: f64, rows: usize| {
        Surface::grid(48, rows, |u, v| {
            let (out, far) = (turn::around(360.0 * (u * 48.0).round() / 48.0 % 360.0), r * v);
            out * far + DVec3::Y * (y + 0.012 * turn::sin(far * 1300.0) * step(0.05, 0.5, far) * step(r, r - 0.25, far))
        })
        .flipped()
    };
    let mut all = Surface::joined([disc(2.12, 0.47, 12), disc(1.12, 1.49, 6), disc(0.6, 2.3, 3)]);
    for (count, r, y, out, down) in [(12, 1.16, 1.5, 0.5, 1.05), (8, 0.63, 2.32, 0.28, 0.85)] {
        for k in 0..count {
            let way = turn::around(360.0 * f64::from(k) / f64::from(count) + 10.0);
            let rings: Vec<Ring> = (0..=8)
                .map(|i| {
                    let t = f64::from(i) / 8.0;
                    let rise = 0.1 * t * (1.0 - t) * 4.0;
                    Ring::round(way * (r + out * t) + DVec3::Y * (y + rise - down * t * t), 0.022 + 0.012 * t)
                })
                .collect();
            all.join(&tube(&rings, DVec3::Y, 8));
        }
    }
    let mut all = all.shaded(60.0);
    all.uvs.clear();
    all
}

/// A fluted column of 3.4 m: twenty flutes, a round base, a square top.
pub fn column() -> Surface {
    let outline: Vec<DVec2> = corners(&[
        [0.36, 0.14],
        [0.37, 0.18],
        [0.36, 0.22],
        [0.32, 0.23],
        [0.32, 0.26],
        [0.34, 0.29],
        [0.32, 0.32],
        [0.28, 0.34],
    ])
    .into_iter()
    .chain((0..=14).map(|k| {
        let t = f64::from(k) / 14.0;
        // Entasis: the shaft swells a little below its middle.
        DVec2::new(0.265 - 0.045 * t * t, 0.38 + 2.6 * t)
    }))
    .chain(corners(&[
        [0.235, 3.01],
        [0.25, 3.03],
        [0.235, 3.05],
        [0.24, 3.08],
        [0.3, 3.16],
        [0.33, 3.2],
        [0.33, 3.22],
        [0.0, 3.22],
    ]))
    .collect();
    let shaft = lathe(&outline, 80).mapped(|p| {
        let hollow = libm::cos(20.0 * libm::atan2(p.x, p.z)).abs();
        let on = step(0.36, 0.46, p.y) * step(2.99, 2.9, p.y);
        let cut = 1.0 - 0.075 * on * (1.0 - hollow * hollow);
        DVec3::new(p.x * cut, p.y, p.z * cut)
    });
    let plinth = block(DVec3::new(0.38, 0.08, 0.38), 0.015, 1, [1; 3]).moved(0.0, 0.07, 0.0);
    let abacus = block(DVec3::new(0.36, 0.07, 0.36), 0.012, 1, [1; 3]).moved(0.0, 3.28, 0.0);
    Surface::joined([
        shaft.textured(DVec2::new(2.0, 3.0), DVec2::ZERO),
        plinth.textured(DVec2::splat(0.8), DVec2::ZERO),
        abacus.textured(DVec2::splat(0.8), DVec2::ZERO),
    ])
    .shaded(40.0)
}

/// A bent beam over two columns that stand `degrees` apart at `radius`; its ends meet the neighbours'.
pub fn beam(radius: f64, degrees: f64) -> Surface {
    let section = [
        [-0.3, 0.0],
        [0.3, 0.0],
        [0.3, 0.16],
        [0.34, 0.18],
        [0.34, 0.4],
        [0.44, 0.46],
        [0.44, 0.56],
        [-0.44, 0.56],
        [-0.44, 0.46],
        [-0.34, 0.4],
        [-0.34, 0.18],
        [-0.3, 0.16],
    ];
    let columns = 10;
    let at = |u: f64, k: usize| {
        let [out, up] = section[k % section.len()];
        turn::around((u - 0.5) * degrees) * (radius + out) + DVec3::Y * (3.35 + up) - DVec3::Z * radius
    };
    let sides = section.len();
    let around = Surface::grid(columns, sides, |u, v| at(u, (v * sides as f64).round() as usize))
        .textured(DVec2::new(1.6, 2.5), DVec2::ZERO);
    let cap = |u: f64| {
        Surface::grid(1, 5, |x, v| {
            let row = (v * 5.0).round() as usize;
            at(u, if x < 0.5 { 12 - row - 1 } else { row })
        })
    };
    let ends = [cap(1.0).flipped(), cap(0.0)].map(|s| s.textured(DVec2::new(0.5, 0.4), DVec2::ZERO));
    let mut all = around.flipped();
    all.join(&ends[0]);
    all.join(&ends[1]);
    all.flipped().shaded(35.0)
}

/// A paving stone, 0.88 m × 0.58 m, worn and bevelled; `seed` gives each its dents.
pub fn paving(seed: u32) -> Surface {
    let stone = block(DVec3::new(0.44, 0.07, 0.29), 0.022, 2, [7, 1, 5]).mapped(|p| {
        let worn = 0.012 * noise::cloud(p * 5.0, 3, seed) * step(0.0, 0.05, p.y);
        let edge = 0.018 * noise::cloud(p * 4.0, 2, seed ^ 9);
        DVec3::new(p.x * (1.0 + edge), p.y + worn, p.z * (1.0 + edge))
    });
    let slide = DVec2::new(noise::lattice(1, 0, seed), noise::lattice(2, 0, seed));
    stone.textured(DVec2::splat(0.9), slide).shaded(40.0).with_tangents()
}

/// A kerb stone, 1 m long, bent to the paved circle's edge; x along it.
pub fn kerb() -> Surface {
    let stone = block(DVec3::new(0.49, 0.13, 0.1), 0.025, 2, [10, 1, 1]);
    let bent =
        stone.mapped(|p| DVec3::new(p.x, p.y + 0.01 * noise::cloud(p * 5.0, 2, 7), p.z - p.x * p.x / (2.0 * PAVED)));
    bent.textured(DVec2::splat(0.9), DVec2::ZERO).shaded(40.0).with_tangents()
}

/// An urn on a foot, 0.75 m high.
pub fn urn() -> Surface {
    let outline: Vec<DVec2> = corners(&[[0.0, 0.0], [0.2, 0.0], [0.2, 0.06], [0.17, 0.08]])
        .into_iter()
        .chain(profile(
            &[
                [0.1, 0.12],
                [0.075, 0.2],
                [0.12, 0.25],
                [0.24, 0.36],
                [0.3, 0.5],
                [0.29, 0.62],
                [0.33, 0.69],
                [0.36, 0.72],
                [0.35, 0.75],
                [0.3, 0.73],
                [0.27, 0.66],
            ],
            4,
        ))
        .chain(corners(&[[0.0, 0.64]]))
        .collect();
    lathe(&outline, 48)
        .mapped(|p| {
            let lobe =
                1.0 + 0.035 * step(0.25, 0.3, p.y) * step(0.52, 0.44, p.y) * libm::cos(14.0 * libm::atan2(p.x, p.z));
            DVec3::new(p.x * lobe, p.y, p.z * lobe)
        })
        .textured(DVec2::new(2.0, 1.5), DVec2::ZERO)
        .shaded(42.0)
}

/// The bed under the paving: gravel.
pub fn bed() -> Surface {
    let mut disc = lathe(&corners(&[[PAVED, 0.0], [PAVED * 0.66, 0.0], [PAVED * 0.33, 0.0], [0.0, 0.0]]), 64);
    for (p, uv) in disc.positions.iter().zip(&mut disc.uvs) {
        *uv = DVec2::new(p.x, p.z) * 0.5;
    }
    disc.shaded(180.0).with_tangents()
}

/// How much of a point is path rather than lawn: four straight paths lead to the paving.
pub fn path(p: DVec3) -> f64 {
    let wobble = 0.25 * noise::cloud(p * 0.9, 3, 71);
    step(1.45, 1.15, p.x.abs().min(p.z.abs()) + wobble)
}

/// Height of the lawn.
pub fn lawn(p: DVec3) -> f64 {
    let r = DVec2::new(p.x, p.z).length();
    let mound = 0.25 * step(10.5, 14.0, r) * (1.0 - path(p)) * (0.6 + noise::cloud(p * 0.35, 2, 72));
    0.02 + mound - 0.05 * path(p)
}

/// Lawn and paths as a ring, with the earth's cut edge and underside: a round model on a table.
pub fn ground() -> Surface {
    let (columns, rows) = (128, 24);
    let out = |u: f64| turn::around(360.0 * (u * f64::from(columns)).round() / f64::from(columns) % 360.0);
    let top = Surface::grid(columns as usize, rows, |u, v| {
        let p = out(u) * (GROUND + (PAVED - 0.1 - GROUND) * v);
        p + DVec3::Y * (lawn(p) - 0.3 * step(0.03, 0.0, v) * 0.3)
    });
    let rim = Surface::grid(columns as usize, 8, |u, v| {
        let edge = out(u) * GROUND;
        let low = -1.1 + 0.12 * noise::cloud(edge * 0.5, 2, 73);
        let t = 1.0 - v;
        let bulge = 0.16 * noise::cloud(edge * 0.7 + DVec3::Y * t * 3.0, 3, 74) * step(0.0, 0.15, t) - 0.5 * t * t;
        out(u) * (GROUND + bulge) + DVec3::Y * ((lawn(edge) - 0.09) * v + low * t)
    });
    let under = Surface::grid(columns as usize, 1, |u, v| {
        let edge = out(u) * GROUND;
        let low = -1.1 + 0.12 * noise::cloud(edge * 0.5, 2, 73);
        let bulge = 0.16 * noise::cloud(edge * 0.7 + DVec3::Y * 3.0, 3, 74) - 0.5;
        if v > 0.5 { out(u) * (GROUND + bulge) + DVec3::Y * low } else { DVec3::Y * -1.1 }
    });
    let mut all = Surface::joined([top, rim, under]).shaded(50.0).painted(|p, n| earth(p, n).to_array());
    all.uvs.clear();
    all
}

fn earth(p: DVec3, n: DVec3) -> DVec3 {
    if n.y < 0.6 && DVec2::new(p.x, p.z).length() > GROUND - 1.0 {
        let layer = noise::cloud(DVec3::new(p.x * 0.4, p.y * 6.0, p.z * 0.4), 3, 75);
        return blend(hex(0x4a3524), hex(0x9a7a54), 0.45 + 1.1 * layer) * (0.75 + 0.25 * step(-1.0, 0.0, p.y));
    }
    let blades = noise::cloud(p * 3.0, 3, 76);
    let patch = noise::cloud(p * 0.5, 3, 77);
    let grass = blend(hex(0x4f7a2d), hex(0x9cb85a), 0.45 + 0.55 * blades + 0.6 * patch);
    let sand = blend(hex(0xb59b74), hex(0xe0caa0), 0.5 + 0.8 * blades);
    blend(grass, sand, path(p))
}
