//! Noise in the plane and in space. The plane's is periodic, so that textures tile without a seam.

use glam::{DVec2, DVec3};

/// Integer hash of a lattice point (the finaliser of MurmurHash3 over its coordinates).
fn hash(x: i64, y: i64, z: i64, seed: u32) -> u32 {
    let mut h = seed ^ 0x9e37_79b9;
    for part in [x as u32, y as u32, z as u32] {
        h ^= part.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
        h = h.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// A number in [0, 1) that belongs to a lattice point.
pub fn lattice(x: i64, y: i64, seed: u32) -> f64 {
    f64::from(hash(x, y, 0, seed)) / 4_294_967_296.0
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Dot product with one of the twelve edge directions of a cube (Perlin, Improving Noise, 2002).
fn slope(h: u32, x: f64, y: f64, z: f64) -> f64 {
    let (a, b) = match (h >> 4) % 3 {
        0 => (x, y),
        1 => (x, z),
        _ => (y, z),
    };
    (if h & 1 == 0 { a } else { -a }) + (if h & 2 == 0 { b } else { -b })
}

/// Gradient noise in space, about [-1, 1].
pub fn space(p: DVec3, seed: u32) -> f64 {
    let (fx, fy, fz) = (p.x.floor(), p.y.floor(), p.z.floor());
    let (x, y, z) = (p.x - fx, p.y - fy, p.z - fz);
    let (ix, iy, iz) = (fx as i64, fy as i64, fz as i64);
    let corner = |dx: i64, dy: i64, dz: i64| {
        slope(hash(ix + dx, iy + dy, iz + dz, seed), x - dx as f64, y - dy as f64, z - dz as f64)
    };
    let (u, v, w) = (fade(x), fade(y), fade(z));
    let row = |dy: i64, dz: i64| mix(corner(0, dy, dz), corner(1, dy, dz), u);
    mix(mix(row(0, 0), row(1, 0), v), mix(row(0, 1), row(1, 1), v), w)
}

/// `octaves` layers of [`space`], each of twice the frequency and half the height.
pub fn cloud(p: DVec3, octaves: u32, seed: u32) -> f64 {
    let (mut sum, mut scale, mut height) = (0.0, 1.0, 0.5);
    for octave in 0..octaves {
        sum += height * space(p * scale, seed.wrapping_add(octave * 101));
        scale *= 2.0;
        height *= 0.5;
    }
    sum
}

/// Gradient noise in the plane with `cells` lattice cells over the unit square, periodic, about [-1, 1].
pub fn tile(uv: DVec2, cells: [i64; 2], seed: u32) -> f64 {
    let (px, py) = (uv.x * cells[0] as f64, uv.y * cells[1] as f64);
    let (fx, fy) = (px.floor(), py.floor());
    let (x, y) = (px - fx, py - fy);
    let corner = |dx: i64, dy: i64| {
        let (cx, cy) = ((fx as i64 + dx).rem_euclid(cells[0]), (fy as i64 + dy).rem_euclid(cells[1]));
        let h = hash(cx, cy, 7, seed);
        let (gx, gy) = ((h & 0xffff) as f64 / 32768.0 - 1.0, (h >> 16) as f64 / 32768.0 - 1.0);
        1.4 * (gx * (x - dx as f64) + gy * (y - dy as f64))
    };
    let (u, v) = (fade(x), fade(y));
    mix(mix(corner(0, 0), corner(1, 0), u), mix(corner(0, 1), corner(1, 1), u), v)
}

/// `octaves` layers of [`tile`].
pub fn tiles(uv: DVec2, cells: [i64; 2], octaves: u32, seed: u32) -> f64 {
    let (mut sum, mut height) = (0.0, 0.5);
    for octave in 0..octaves {
        sum += height * tile(uv, [cells[0] << octave, cells[1] << octave], seed.wrapping_add(octave * 101));
        height *= 0.5;
    }
    sum
}

/// Cell noise: the distances to the nearest and the second nearest of one jittered point per cell, and a number in
/// [0, 1) that belongs to the nearest. Periodic over the unit square; distances in cells.
pub fn cells(uv: DVec2, count: [i64; 2], seed: u32) -> (f64, f64, f64) {
    let (px, py) = (uv.x * count[0] as f64, uv.y * count[1] as f64);
    let (fx, fy) = (px.floor() as i64, py.floor() as i64);
    let (mut near, mut next, mut id) = (9.0_f64, 9.0_f64, 0.0);
    for cy in fy - 1..=fy + 1 {
        for cx in fx - 1..=fx + 1 {
            let (wx, wy) = (cx.rem_euclid(count[0]), cy.rem_euclid(count[1]));
            let (jx, jy) = (lattice(wx, wy, seed), lattice(wx, wy, seed ^ 0x55aa));
            let (dx, dy) = (cx as f64 + jx - px, cy as f64 + jy - py);
            let distance = (dx * dx + dy * dy).sqrt();
            if distance < near {
                (next, near, id) = (near, distance, lattice(wx, wy, seed ^ 0x1234));
            } else if distance < next {
                next = distance;
            }
        }
    }
    (near, next, id)
}
