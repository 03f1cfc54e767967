//! Procedural materials: each function paints one tiling [`Coat`](crate::raster::Coat). Knows no geometry.

pub mod ceramic;
pub mod stone;
pub mod wood;

use crate::noise;
use crate::raster::{Coat, Texel, blend, hex};
use glam::DVec2;

/// Forged iron: dark, dented, with rust in the hollows.
pub fn iron() -> Coat {
    Coat::paint([256, 256], |uv| {
        let dents = noise::cells(uv, [14, 14], 31).0;
        let grain = noise::tiles(uv, [16, 16], 4, 32);
        let rust = crate::turn::step(0.12, 0.42, noise::tiles(uv, [4, 4], 5, 33));
        let color = blend(hex(0x4a4b50), hex(0x6b6c72), 0.5 + grain);
        Texel {
            color: blend(color, blend(hex(0x5a3420), hex(0x8c4f27), 0.5 + 1.2 * grain), rust * 0.75),
            height: 0.010 * (dents * dents).min(0.5) + 0.002 * grain,
            rough: 0.46 + 0.2 * grain + 0.35 * rust,
            metal: 1.0 - 0.8 * rust,
        }
    })
}

/// Twisted rope; u around, v along.
pub fn rope() -> Coat {
    Coat::paint([128, 256], |uv| {
        let strand = (uv.x * 2.0 + uv.y * 4.0).fract() * 2.0 - 1.0;
        let round = (1.0 - strand * strand).max(0.0).sqrt();
        let fibre = noise::tile(DVec2::new(uv.x + 2.0 * uv.y, uv.y).fract(), [24, 6], 41);
        Texel {
            color: blend(hex(0x6b4c2a), hex(0xd0ad74), round * 0.85 + 0.25 * fibre),
            height: 0.09 * round + 0.01 * fibre,
            rough: 0.92,
            metal: 0.0,
        }
    })
}

/// Bound leather: wrinkled, to be tinted by the material's factor.
pub fn leather() -> Coat {
    Coat::paint([256, 256], |uv| {
        let warp = DVec2::new(noise::tiles(uv, [6, 6], 3, 51), noise::tiles(uv, [6, 6], 3, 52)) * 0.04;
        let (near, next, _) = noise::cells((uv + warp).fract_gl(), [30, 30], 53);
        let crack = crate::turn::step(0.22, 0.0, next - near);
        let wear = noise::tiles(uv, [3, 3], 4, 54);
        let shade = 0.82 + 0.28 * wear - 0.22 * crack;
        Texel {
            color: glam::DVec3::splat(shade.clamp(0.0, 1.0)),
            height: -0.004 * crack,
            rough: 0.55 + 0.25 * crack + 0.15 * wear,
            metal: 0.0,
        }
    })
}
