//! Street furniture: lamp, bench, bollard, chain, bunting.

use crate::raster::hex;
use crate::solid::{Ring, block, corners, hoop, lathe, profile, spline, tube};
use crate::surface::Surface;
use crate::turn;
use glam::{DVec2, DVec3};

/// Distance of two neighbouring lamps, from post to post; bunting spans it.
pub const LAMP_GAP: f64 = 6.89;

fn bare(mut surface: Surface) -> Surface {
    surface.uvs.clear();
    surface
}

/// Cast-iron post of 3.3 m with a scrolled bracket ring and the frame of its lantern.
pub fn lamp_post() -> Surface {
    let foot = corners(&[[0.0, 0.0], [0.2, 0.0], [0.2, 0.06], [0.17, 0.1], [0.17, 0.16]]);
    let post = profile(
        &[
            [0.15, 0.17],
            [0.13, 0.3],
            [0.1, 0.5],
            [0.085, 0.62],
            [0.11, 0.66],
            [0.085, 0.7],
            [0.06, 0.8],
            [0.052, 1.5],
            [0.046, 2.3],
            [0.07, 2.36],
            [0.07, 2.42],
            [0.045, 2.46],
            [0.045, 2.7],
            [0.09, 2.78],
            [0.13, 2.8],
        ],
        3,
    );
    let outline: Vec<DVec2> = foot.into_iter().chain(post).chain(corners(&[[0.13, 2.83], [0.0, 2.83]])).collect();
    // Twelve flutes on the shaft, between 0.8 and 2.3 m.
    let shaft = lathe(&outline, 36).mapped(|p| {
        let flute =
            libm::cos(12.0 * libm::atan2(p.x, p.z)) * 0.07 * turn::step(0.72, 0.9, p.y) * turn::step(2.36, 2.2, p.y);
        DVec3::new(p.x * (1.0 + flute), p.y, p.z * (1.0 + flute))
    });
    let mut iron = shaft;
    for k in 0..6 {
        let out = turn::around(60.0 * f64::from(k) + 30.0);
        let bar = [0.118, 0.2]
            .iter()
            .zip([2.82, 3.22])
            .map(|(r, y)| Ring::round(out * *r + DVec3::Y * y, 0.011))
            .collect::<Vec<_>>();
        iron.join(&tube(&bar, out, 8));
    }
    let roof = corners(&[
        [0.0, 3.2],
        [0.24, 3.2],
        [0.25, 3.215],
        [0.24, 3.235],
        [0.15, 3.33],
        [0.08, 3.37],
        [0.05, 3.42],
        [0.03, 3.44],
        [0.045, 3.47],
        [0.03, 3.5],
        [0.0, 3.56],
    ]);
    iron.join(&lathe(&roof, 24));
    for side in [-1.0, 1.0] {
        let arm = spline(
            &[[0.04, 2.2], [0.16, 2.24], [0.26, 2.33], [0.3, 2.42], [0.26, 2.47], [0.22, 2.43], [0.24, 2.4]]
                .map(|[x, y]| DVec3::new(x * side, y, 0.0)),
            4,
        );
        iron.join(&tube(&arm.iter().map(|p| Ring::round(*p, 0.013)).collect::<Vec<_>>(), DVec3::Z, 8));
    }
    bare(iron.shaded(40.0))
}

/// The lantern's glass, six panes.
pub fn lamp_glass() -> Surface {
    bare(lathe(&corners(&[[0.0, 2.84], [0.108, 2.84], [0.188, 3.2], [0.0, 3.2]]), 6).turned(turn::y(30.0)).shaded(30.0))
}

/// Slats of a bench, 1.7 m long, facing +z; the seat is 0.45 m high.
pub fn bench_slats() -> Surface {
    let mut wood = Surface::default();
    let slat = |y: f64, z: f64, tilt: f64, k: f64| {
        block(DVec3::new(0.85, 0.016, 0.042), 0.009, 2, [3, 1, 1])
            .textured(DVec2::splat(1.4), DVec2::new(0.13 * k, 0.29 * k))
            .turned(turn::x(tilt))
            .moved(0.0, y, z)
    };
    for k in 0..5 {
        let z = 0.22 - 0.095 * f64::from(k);
        let y = 0.45 - 0.018 * turn::sin(180.0 * f64::from(k) / 4.0);
        wood.join(&slat(y, z, 0.0, f64::from(k)));
    }
    for k in 0..4 {
        let t = f64::from(k);
        wood.join(&slat(0.53 + 0.1 * t, -0.245 - 0.036 * t, 76.0 + 3.0 * t, t + 5.0));
    }
    wood.shaded(50.0)
}

/// Two cast-iron ends with arm rests.
pub fn bench_ends() -> Surface {
    let mut iron = Surface::default();
    let rail = |points: &[[f64; 2]], r: f64| {
        let path = spline(&points.iter().map(|[z, y]| DVec3::new(0.0, *y, *z)).collect::<Vec<_>>(), 4);
        let rings: Vec<Ring> = path.iter().map(|p| Ring { middle: *p, wide: r, high: r * 1.5 }).collect();
        tube(&rings, DVec3::X, 10)
    };
    for x in [-0.68, 0.68] {
        let front = rail(
            &[
                [0.27, 0.0],
                [0.23, 0.1],
                [0.25, 0.26],
                [0.2, 0.4],
                [0.0, 0.405],
                [-0.2, 0.41],
                [-0.255, 0.52],
                [-0.36, 0.86],
            ],
            0.017,
        );
        let back = rail(&[[-0.3, 0.0], [-0.25, 0.14], [-0.17, 0.28], [-0.18, 0.41]], 0.017);
        let arm = rail(&[[0.21, 0.4], [0.27, 0.53], [0.25, 0.63], [0.13, 0.66], [-0.05, 0.645], [-0.3, 0.67]], 0.015);
        let curl = rail(&[[-0.2, 0.3], [-0.08, 0.34], [0.0, 0.27], [-0.03, 0.2], [-0.09, 0.22], [-0.07, 0.27]], 0.012);
        iron.join(&Surface::joined([front, back, arm, curl]).moved(x, 0.0, 0.0));
    }
    bare(iron.shaded(50.0))
}

/// A bollard of 0.8 m with a ball on top.
pub fn bollard() -> Surface {
    let foot = corners(&[[0.0, 0.0], [0.11, 0.0], [0.11, 0.05], [0.095, 0.07]]);
    let shaft = profile(
        &[
            [0.075, 0.075],
            [0.066, 0.3],
            [0.058, 0.55],
            [0.08, 0.58],
            [0.08, 0.61],
            [0.05, 0.63],
            [0.04, 0.65],
            [0.075, 0.7],
            [0.078, 0.75],
            [0.05, 0.79],
            [0.0, 0.805],
        ],
        4,
    );
    let mut iron = lathe(&foot.into_iter().chain(shaft).collect::<Vec<_>>(), 32);
    for side in [-1.0, 1.0] {
        iron.join(&hoop(0.022, [0.006, 0.006], 16).turned(turn::x(90.0)).moved(side * 0.088, 0.595, 0.0));
    }
    bare(iron.shaded(40.0))
}

/// A chain of `length` along x, hanging between two bollards' rings, from links that stand crosswise.
pub fn chain(length: f64) -> Surface {
    let links = 22;
    let half = length / 2.0 - 0.09;
    let at = |t: f64| DVec3::new(half * t, 0.585 - 0.2 * (1.0 - t * t), 0.0);
    let mut iron = Surface::default();
    for k in 0..links {
        let t = (f64::from(k) + 0.5) / f64::from(links) * 2.0 - 1.0;
        let ahead = (at(t + 0.01) - at(t - 0.01)).normalize();
        let tilt = libm::atan2(ahead.y, ahead.x).to_degrees();
        let stretch = half / f64::from(links) * 1.36;
        let link = hoop(0.018, [0.0058, 0.0058], 14)
            .mapped(|p| DVec3::new(p.x + p.x.signum() * (stretch - 0.018), p.y, p.z))
            .turned(turn::x(if k % 2 == 0 { 0.0 } else { 90.0 }))
            .turned(turn::z(tilt));
        let p = at(t);
        iron.join(&link.moved(p.x, p.y, p.z));
    }
    bare(iron.shaded(70.0))
}

/// A cord with thirteen flags between two lamps, along x, at 2.62 m; colours at its vertices.
pub fn bunting() -> Surface {
    const DYES: [u32; 5] = [0xd8433a, 0xf0b23c, 0x3d7fa8, 0xf3ead6, 0x4f9a6b];
    let half = LAMP_GAP / 2.0 - 0.05;
    let at = |t: f64| DVec3::new(half * t, 2.62 - 0.55 * (1.0 - t * t), 0.0);
    let cord: Vec<Ring> = (0..=32).map(|k| Ring::round(at(f64::from(k) / 16.0 - 1.0), 0.007)).collect();
    let mut all = tube(&cord, DVec3::Y, 6).shaded(60.0).painted(|_, _| hex(0xe9e0cc).to_array());
    for k in 0..13 {
        let t = (f64::from(k) + 0.5) / 13.0 * 2.0 - 1.0;
        let hang = at(t);
        let sheet = |side: f64| {
            Surface::grid(6, 8, |u, v| {
                let (x, drop) = ((u - 0.5) * 0.3 * v, 0.36 * (1.0 - v));
                let wave = 0.035 * turn::sin(300.0 * (1.0 - v) + 90.0 * f64::from(k)) * (1.0 - v);
                DVec3::new(x + hang.x, hang.y - drop - 0.004, wave + side * 0.0015)
            })
        };
        let flag = Surface::joined([sheet(1.0), sheet(-1.0).flipped()]).shaded(60.0);
        all.join(&flag.painted(|_, _| hex(DYES[k as usize % DYES.len()]).to_array()));
    }
    bare(all)
}
