//! Eyes, nose, mouth and brows: separate closed shapes laid on the fur, each with its place for every morph target.

use super::{body, skeleton};
use crate::raster::hex;
use crate::solid::{Ring, ball, spline, tube};
use crate::surface::Surface;
use crate::turn::{self, step};
use glam::DVec3;

/// Where the eyes sit, for the left one.
const EYE: DVec3 = DVec3::new(0.094, 0.872, 0.0);
const EYE_SIZE: DVec3 = DVec3::new(0.034, 0.047, 0.018);

/// How much of each expression is shown, in [0, 1].
#[derive(Clone, Copy, Default)]
pub struct Mood {
    /// Eyes closed.
    pub blink: f64,
    /// Corners of the mouth up, eyes a little narrowed.
    pub smile: f64,
}

/// The point of the fur behind (x, y), seen from the front.
fn on_fur(x: f64, y: f64) -> DVec3 {
    let shapes = skeleton::shapes();
    let mut p = DVec3::new(x, y, 0.42);
    for _ in 0..60 {
        p.z -= 0.7 * body::distance(&shapes, p);
    }
    p
}

/// The whole face in a mood, shaded; the same triangles in every mood.
pub fn face(mood: Mood) -> Surface {
    let mut all = nose();
    all.join(&mouth(mood.smile));
    for side in [-1.0, 1.0] {
        all.join(&eye(side, mood));
        all.join(&brow(side, mood));
    }
    all
}

fn painted(surface: Surface, rgb: u32) -> Surface {
    let mut surface = surface.shaded(180.0).painted(|_, _| hex(rgb).to_array());
    surface.uvs.clear();
    surface
}

fn nose() -> Surface {
    let middle = DVec3::new(0.0, 0.803, 0.306);
    let nose = ball(2).mapped(|d| {
        let wide = 1.0 + 0.35 * step(-0.6, 0.7, d.y);
        middle + DVec3::new(d.x * 0.024 * wide, d.y * 0.02, d.z * 0.02)
    });
    painted(nose, 0x1d1414)
}

/// An eye: a dark lens on the fur, a warm rim low in it, two lights. Closed, it is a curved line.
fn eye(side: f64, mood: Mood) -> Surface {
    let seat = on_fur(EYE.x, EYE.y);
    let open = 1.0 - 0.9 * mood.blink - 0.22 * mood.smile * (1.0 - mood.blink);
    let facing = turn::y(side * 21.0) * turn::x(-4.0);
    let lens = |radius: f64, rise: f64| {
        ball(2).mapped(|d| {
            let mut q = d * EYE_SIZE * radius;
            q.y = q.y * open - 0.012 * mood.blink * (1.0 - (q.x / EYE_SIZE.x) * (q.x / EYE_SIZE.x));
            q.y += 0.008 * mood.smile * (1.0 - mood.blink) * (1.0 - (q.x / EYE_SIZE.x) * (q.x / EYE_SIZE.x));
            DVec3::new(side * seat.x, seat.y, seat.z - 0.004) + facing * (q + DVec3::Z * rise)
        })
    };
    let eye = lens(1.0, 0.0).shaded(180.0);
    let mut all = eye.painted(|p, _| {
        let low = step(0.0, -0.03, p.y - seat.y);
        crate::raster::blend(hex(0x160d0c), hex(0x7a4218), 0.85 * low).to_array()
    });
    for (dx, dy, size) in [(0.011, 0.018, 0.0095), (-0.009, -0.016, 0.0052)] {
        let shine = ball(1).mapped(|d| {
            let q = DVec3::new(dx, dy * open, 0.0155 + 0.002 * open) + d * DVec3::new(size, size * open, 0.004);
            let hide = DVec3::Z * (-0.02 * mood.blink);
            DVec3::new(side * seat.x, seat.y, seat.z - 0.004) + facing * (q + hide)
        });
        all.join(&painted(shine, 0xffffff));
    }
    all.uvs.clear();
    all
}

fn brow(side: f64, mood: Mood) -> Surface {
    let path: Vec<DVec3> = (0..=6)
        .map(|k| {
            let t = f64::from(k) / 6.0;
            let x = 0.06 + 0.055 * t;
            let y = 0.947 + 0.012 * turn::sin(180.0 * t) + 0.008 * (1.0 - t) + 0.012 * mood.smile - 0.006 * mood.blink;
            let p = on_fur(x, y);
            DVec3::new(side * p.x, p.y, p.z + 0.001)
        })
        .collect();
    let rings: Vec<Ring> = path
        .iter()
        .enumerate()
        .map(|(k, p)| Ring::round(*p, 0.0065 * turn::sin(20.0 + 140.0 * k as f64 / 6.0)))
        .collect();
    painted(tube(&rings, DVec3::Z, 8), 0x5a2c14)
}

/// A line below the nose and two arcs that rise with the smile.
fn mouth(smile: f64) -> Surface {
    let mut all = Surface::default();
    let at = |x: f64, y: f64| on_fur(x, y) + DVec3::Z * 0.0006;
    let stem: Vec<Ring> = [0.786, 0.776, 0.766, 0.758].iter().map(|y| Ring::round(at(0.0, *y), 0.0034)).collect();
    all.join(&tube(&stem, DVec3::X, 8));
    for side in [-1.0, 1.0] {
        let arc: Vec<DVec3> = (0..=8)
            .map(|k| {
                let t = f64::from(k) / 8.0;
                let x = (0.044 + 0.02 * smile) * t;
                let y = 0.757 - 0.012 * turn::sin(180.0 * (t * 0.9)) + (0.004 + 0.022 * smile) * t * t;
                at(side * x, y)
            })
            .collect();
        let rings: Vec<Ring> =
            spline(&arc, 1).iter().enumerate().map(|(k, p)| Ring::round(*p, 0.0036 - 0.0002 * k as f64)).collect();
        all.join(&tube(&rings, DVec3::Z, 8));
    }
    painted(all, 0x241310)
}
