//! Stone: marble, paving, plaster.

use crate::noise;
use crate::raster::{Coat, Texel, blend, hex};
use crate::turn::step;
use glam::DVec2;

/// White marble with grey veins.
pub fn marble() -> Coat {
    Coat::paint([512, 512], |uv| {
        let warp = DVec2::new(noise::tiles(uv, [3, 3], 4, 91), noise::tiles(uv, [3, 3], 4, 92));
        let vein = |cells: i64, seed: u32| {
            let bent = DVec2::new((uv.x + 0.25 * warp.x).rem_euclid(1.0), (uv.y + 0.25 * warp.y).rem_euclid(1.0));
            1.0 - step(0.0, 0.09, noise::tile(bent, [cells, cells], seed).abs())
        };
        let veins = (0.8 * vein(3, 93) * (0.5 + warp.x).clamp(0.0, 1.0) + 0.35 * vein(7, 94)).min(1.0);
        let cloud = noise::tiles(uv, [4, 4], 4, 95);
        let base = blend(hex(0xd9d2c6), hex(0xf6f2ea), 0.6 + 0.9 * cloud);
        Texel { color: blend(base, hex(0x8d8a8c), 0.7 * veins), height: 0.0, rough: 0.32 + 0.1 * veins, metal: 0.0 }
    })
}

/// Hewn sandstone: warm, pitted.
pub fn sandstone() -> Coat {
    Coat::paint([256, 256], |uv| {
        let broad = noise::tiles(uv, [3, 5], 4, 101);
        let fine = noise::tiles(uv, [40, 40], 3, 102);
        let pits =
            step(0.34, 0.12, noise::cells(uv, [26, 26], 103).0) * step(-0.05, 0.25, noise::tiles(uv, [5, 5], 3, 104));
        let color = blend(hex(0xb99a6f), hex(0xe2cda3), 0.5 + 0.9 * broad + 0.35 * fine);
        Texel {
            color: blend(color, hex(0x8a6c48), 0.7 * pits),
            height: 0.006 * fine + 0.012 * broad - 0.008 * pits,
            rough: 0.9,
            metal: 0.0,
        }
    })
}

/// Grey granite with dark and light grains.
pub fn granite() -> Coat {
    Coat::paint([256, 256], |uv| {
        let (near, next, id) = noise::cells(uv, [70, 70], 111);
        let cloud = noise::tiles(uv, [4, 4], 5, 112);
        let grain = if id < 0.2 {
            hex(0x55525a)
        } else if id > 0.72 {
            hex(0xc9c2bb)
        } else {
            hex(0x97918c)
        };
        let color = blend(hex(0x8e8883), grain, 0.55) * (0.98 + 0.5 * cloud);
        let edge = (next - near).min(0.3);
        Texel { color, height: 0.004 * cloud + 0.0018 * edge, rough: 0.72 + 0.3 * cloud, metal: 0.0 }
    })
}

/// Dry earth between stones.
pub fn gravel() -> Coat {
    Coat::paint([256, 256], |uv| {
        let (near, _, id) = noise::cells(uv, [60, 60], 121);
        let bump = (1.0 - near * 1.3).max(0.0);
        let cloud = noise::tiles(uv, [5, 5], 5, 122);
        let color =
            blend(hex(0x5d4f40), blend(hex(0x9a8a74), hex(0xb9aa93), id), 0.3 + 0.7 * bump) * (1.0 + 0.4 * cloud);
        Texel { color, height: 0.006 * bump, rough: 0.97, metal: 0.0 }
    })
}
