//! Wood: planks, barrel staves, bark.

use crate::noise;
use crate::raster::{Coat, Texel, blend, hex};
use crate::turn::step;
use glam::{DVec2, DVec3};

/// Colours of a kind of wood, from its dark pores to its light early wood.
#[derive(Clone, Copy)]
pub struct Kind {
    pores: DVec3,
    late: DVec3,
    early: DVec3,
}

/// Warm brown, as of a wine barrel.
pub fn oak() -> Kind {
    Kind { pores: hex(0x3a2212), late: hex(0x7d4f28), early: hex(0xb07a42) }
}

/// Pale yellow, as of a crate.
pub fn pine() -> Kind {
    Kind { pores: hex(0x8a5a2c), late: hex(0xb98044), early: hex(0xdeb677) }
}

/// The grain at a point; u runs along it. Height in texture widths.
fn grain(uv: DVec2, kind: Kind, seed: u32) -> Texel {
    let sway = noise::tiles(uv, [1, 4], 3, seed);
    let across = uv.y * 9.0 + 2.6 * sway;
    let ring = across - across.floor();
    // Dense late wood ends each year at a sharp line.
    let late = ring * ring * step(1.0, 0.9, ring);
    let fibre = noise::tiles(uv, [3, 90], 3, seed ^ 2);
    let pore = step(0.25, 0.6, noise::tile(uv, [9, 200], seed ^ 3)) * (0.4 + 0.6 * late);
    let wear = noise::tiles(uv, [2, 4], 4, seed ^ 4);
    let wood = blend(kind.early, kind.late, 0.2 + 0.8 * late + 0.7 * fibre + 0.6 * wear);
    Texel {
        color: blend(wood, kind.pores, 0.5 * pore + 0.35 * (-fibre).max(0.0)),
        height: 0.0014 * fibre - 0.0014 * pore - 0.0008 * late,
        rough: 0.62 + 0.14 * pore + 0.14 * late + 0.1 * wear,
        metal: 0.0,
    }
}

/// A sheet of wood to cut planks from.
pub fn planks(kind: Kind, seed: u32) -> Coat {
    Coat::paint([512, 512], |uv| grain(uv, kind, seed))
}

/// `count` upright staves side by side along u, each with a grain and a tint of its own.
pub fn staves(count: i64, kind: Kind) -> Coat {
    Coat::paint([1024, 512], |uv| {
        let x = uv.x * count as f64;
        let stave = x.floor() as i64 % count;
        let (tint, slide) = (noise::lattice(stave, 1, 71), noise::lattice(stave, 2, 71));
        let inside = x - x.floor();
        let own = DVec2::new((uv.y + slide).fract(), ((inside + stave as f64 * 3.0) / 10.0).fract());
        let mut texel = grain(own, kind, 72);
        let gap = step(0.045, 0.012, inside.min(1.0 - inside));
        let damp = step(0.72, 1.0, (uv.y - 0.5).abs() * 2.0 + 0.25 * noise::tiles(uv, [12, 4], 3, 73));
        texel.color = texel.color * (0.78 + 0.34 * tint) * (1.0 - 0.3 * damp);
        texel.color = blend(texel.color, hex(0x140b05), gap * 0.9);
        texel.height -= 0.004 * gap;
        texel.rough += 0.2 * gap;
        texel
    })
}

/// Bark with deep furrows along v.
pub fn bark() -> Coat {
    Coat::paint([256, 256], |uv| {
        let warp = noise::tiles(uv, [4, 4], 3, 81) * 0.07;
        let (near, next, id) = noise::cells(DVec2::new((uv.x + warp).rem_euclid(1.0), uv.y), [12, 4], 82);
        let ridge = step(0.0, 0.4, next - near);
        let fine = noise::tiles(uv, [32, 12], 3, 83);
        let color = blend(hex(0x2b1f18), blend(hex(0x6a5443), hex(0x86705a), id), ridge * 0.9 + 0.3 * fine);
        Texel { color, height: 0.03 * ridge + 0.008 * fine, rough: 0.95, metal: 0.0 }
    })
}
