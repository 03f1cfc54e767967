//! Textures: mip chains made in linear light, wrap modes, and trilinear sampling.
//!
//! A level holds four bytes a texel, colours in sRGB, as a graphics card does. Knows no files and no materials.

use super::srgb::Srgb;
use glam::{Vec2, Vec4};

/// What the bytes of a texture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Encoding {
    /// Red, green and blue in sRGB, alpha linear.
    Color,
    /// All four linear: normals, roughness.
    Data,
}

/// What lies beyond the edges, for one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again (glTF 10497).
    #[default]
    Repeat,
    /// The image mirrored, then again (33648).
    Mirror,
    /// The outermost texel (33071).
    Clamp,
}

impl Wrap {
    /// A texel number and the next one, inside `0..size`.
    #[inline]
    fn pair(self, at: i32, size: i32) -> (usize, usize) {
        if 0 <= at && at + 1 < size {
            return (at as usize, at as usize + 1);
        }
        (self.apply(at, size), self.apply(at + 1, size))
    }

    /// A texel number that may lie outside to one inside `0..size`.
    fn apply(self, at: i32, size: i32) -> usize {
        let inside = match self {
            Self::Clamp => at.clamp(0, size - 1),
            Self::Repeat if (0..size).contains(&at) => at,
            // Nearly all sizes are powers of two, and division is slow.
            Self::Repeat if size & (size - 1) == 0 => at & (size - 1),
            Self::Repeat => at.rem_euclid(size),
            Self::Mirror => {
                let at = at.rem_euclid(2 * size);
                if at < size { at } else { 2 * size - 1 - at }
            }
        };
        inside as usize
    }
}

/// Longest side of level 0. Larger images are halved on loading until they fit: in views of 512 pixels a whole
/// surface covers about 0.8 million pixels, so that finer texels would not be sampled.
pub const LONGEST_SIDE: u32 = 2048;

/// One level of the chain.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Level {
    width: i32,
    height: i32,
    /// Row after row from the top, as in the file.
    texels: Vec<[u8; 4]>,
}

/// An image with all its smaller versions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    encoding: Encoding,
    levels: Vec<Level>,
    /// Any texel that is not opaque?
    translucent: bool,
}

impl Texture {
    /// Makes the chain of an image: `width · height` texels, rows from the top. `None` if it has none, or not that
    /// many.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>, encoding: Encoding) -> Option<Self> {
        let fits = u64::from(width) * u64::from(height) == texels.len() as u64 && !texels.is_empty();
        if !fits || width > 1 << 16 || height > 1 << 16 {
            return None;
        }
        let translucent = texels.iter().any(|t| t[3] != 255);
        let mut level = Level { width: width as i32, height: height as i32, texels };
        while level.width.max(level.height) > LONGEST_SIDE as i32 {
            level = level.halved(encoding);
        }
        let mut levels = vec![level];
        while let Some(level) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            let next = level.halved(encoding);
            levels.push(next);
        }
        Some(Self { encoding, levels, translucent })
    }

    /// Width and height of the finest level that is kept, in texels.
    pub fn size(&self) -> [u32; 2] {
        [self.levels[0].width as u32, self.levels[0].height as u32]
    }

    /// Is any texel not opaque?
    pub fn is_translucent(&self) -> bool {
        self.translucent
    }

    /// What the bytes mean.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// The levels from the finest to one texel: width, height, texels in rows from the top.
    pub fn levels(&self) -> impl Iterator<Item = (u32, u32, &[[u8; 4]])> {
        self.levels.iter().map(|l| (l.width as u32, l.height as u32, l.texels.as_slice()))
    }

    /// The value at `uv` (origin at the top left, 1 = whole image), filtered for a pixel that spans `dx` and `dy` in
    /// the same unit. Trilinear; the level is chosen by the longer of the two spans. Linear light.
    #[inline]
    pub fn sample(&self, srgb: Srgb, uv: Vec2, dx: Vec2, dy: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let size = Vec2::new(self.levels[0].width as f32, self.levels[0].height as f32);
        let (dx, dy) = (dx * size, dy * size);
        let span = dx.length_squared().max(dy.length_squared());
        let last = (self.levels.len() - 1) as f32;
        // A span that is not finite takes the coarsest level: `clamp` would keep a NaN.
        let lambda = if span <= 1.0 { 0.0 } else { (0.5 * log2(span)).min(last) };
        let lambda = if lambda >= 0.0 { lambda } else { last };
        let fine = lambda as usize;
        let part = lambda - fine as f32;
        let a = self.bilinear(srgb, fine, uv, wrap);
        if part <= 0.0 {
            return a;
        }
        let b = self.bilinear(srgb, fine + 1, uv, wrap);
        a + (b - a) * part
    }

    #[inline]
    fn bilinear(&self, srgb: Srgb, level: usize, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let level = &self.levels[level.min(self.levels.len() - 1)];
        let (x, fx) = cell(uv.x, level.width);
        let (y, fy) = cell(uv.y, level.height);
        let (x0, x1) = wrap[0].pair(x, level.width);
        let (y0, y1) = wrap[1].pair(y, level.height);
        let (row0, row1) = (y0 * level.width as usize, y1 * level.width as usize);
        let texels = [row0 + x0, row0 + x1, row1 + x0, row1 + x1].map(|i| level.texels[i]);
        let mix = |[a, b, c, d]: [Vec4; 4]| {
            let top = a + (b - a) * fx;
            let bottom = c + (d - c) * fx;
            top + (bottom - top) * fy
        };
        // One question for four texels.
        match self.encoding {
            Encoding::Color => mix(texels.map(|texel| decode(srgb, Encoding::Color, texel))),
            Encoding::Data => mix(texels.map(|texel| decode(srgb, Encoding::Data, texel))),
        }
    }
}

#[inline]
fn decode(srgb: Srgb, encoding: Encoding, [r, g, b, a]: [u8; 4]) -> Vec4 {
    let data = |byte: u8| f32::from(byte) * (1.0 / 255.0);
    match encoding {
        Encoding::Color => Vec4::new(srgb.light(r), srgb.light(g), srgb.light(b), data(a)),
        Encoding::Data => Vec4::new(data(r), data(g), data(b), data(a)),
    }
}

fn encode(srgb: Srgb, encoding: Encoding, value: Vec4) -> [u8; 4] {
    let data = |x: f32| (x * 255.0 + 0.5) as u8;
    let [r, g, b, a] = value.to_array();
    match encoding {
        Encoding::Color => [srgb.byte(r), srgb.byte(g), srgb.byte(b), data(a)],
        Encoding::Data => [data(r), data(g), data(b), data(a)],
    }
}

/// The texel whose centre lies at or before a coordinate, and how far beyond it the coordinate is. Coordinates that
/// are absurdly far out, or no numbers, land on texel 0.
#[inline]
fn cell(coordinate: f32, size: i32) -> (i32, f32) {
    let at = coordinate * size as f32 - 0.5;
    // Beyond 2²³ a float has no fraction, and texel numbers would overflow.
    if !(at > -8.0e6 && at < 8.0e6) {
        return (0, 0.0);
    }
    let mut whole = at as i32;
    if (whole as f32) > at {
        whole -= 1;
    }
    (whole, at - whole as f32)
}

/// Logarithm to base 2 of a positive number, within 0.01: exponent and a parabola through the mantissa's ends. Level
/// choice needs no more, and only `+ - *` go into it.
#[inline]
fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as f32 - 127.0;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    exponent + (-1.0 / 3.0 * mantissa + 2.0) * mantissa - 5.0 / 3.0
}

impl Level {
    /// Half as wide and high (rounded down, at least 1), by the mean over the area that each new texel covers. Odd
    /// sizes have texels that fall to two new ones in part.
    fn halved(&self, encoding: Encoding) -> Self {
        let srgb = Srgb::new();
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let (columns, rows) = (shares(self.width, width), shares(self.height, height));
        let mut texels = Vec::with_capacity((width * height) as usize);
        for row in &rows {
            for column in &columns {
                let mut sum = Vec4::ZERO;
                for &(y, wy) in row {
                    let line = &self.texels[y * self.width as usize..];
                    for &(x, wx) in column {
                        sum += decode(srgb, encoding, line[x]) * (wx * wy);
                    }
                }
                texels.push(encode(srgb, encoding, sum));
            }
        }
        Self { width, height, texels }
    }
}

/// For each of `to` new texels: the old ones it covers, with the share that each has in it.
fn shares(from: i32, to: i32) -> Vec<Vec<(usize, f32)>> {
    let (from, to) = (from as usize, to as usize);
    // In units of 1/to of an old texel, new texel i covers [i·from, (i+1)·from).
    let share = |i: usize| {
        let (low, high) = (i * from, (i + 1) * from);
        let covered = |old: usize| (high.min((old + 1) * to) - low.max(old * to)) as f32 / from as f32;
        (low / to..high.div_ceil(to)).map(|old| (old, covered(old))).collect()
    };
    (0..to).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 4] = [255, 0, 0, 255];
    const GREEN: [u8; 4] = [0, 255, 0, 255];
    const BLUE: [u8; 4] = [0, 0, 255, 255];
    const BLACK: [u8; 4] = [0, 0, 0, 255];

    fn quarters() -> Texture {
        Texture::new(2, 2, vec![RED, GREEN, BLUE, BLACK], Encoding::Color).unwrap()
    }

    fn point(texture: &Texture, u: f32, v: f32, wrap: Wrap) -> [f32; 4] {
        texture.sample(Srgb::new(), Vec2::new(u, v), Vec2::ZERO, Vec2::ZERO, [wrap; 2]).to_array()
    }

    #[test]
    fn the_origin_is_at_the_top_left() {
        let texture = quarters();
        assert_eq!(point(&texture, 0.25, 0.25, Wrap::Clamp), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(point(&texture, 0.75, 0.25, Wrap::Clamp), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(point(&texture, 0.25, 0.75, Wrap::Clamp), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(point(&texture, 0.5, 0.25, Wrap::Clamp), [0.5, 0.5, 0.0, 1.0]);
    }

    #[test]
    fn beyond_the_edges() {
        let texture = quarters();
        let [red, green] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]];
        for (u, repeat, mirror, clamp) in
            [(1.25, red, green, green), (1.75, green, red, green), (-0.25, green, red, red), (2.25, red, red, green)]
        {
            assert_eq!(point(&texture, u, 0.25, Wrap::Repeat), repeat, "{u}");
            assert_eq!(point(&texture, u, 0.25, Wrap::Mirror), mirror, "{u}");
            assert_eq!(point(&texture, u, 0.25, Wrap::Clamp), clamp, "{u}");
        }
        for (at, size, expected) in [(-1, 4, 3), (9, 4, 1), (-4, 3, 2), (7, 3, 1)] {
            assert_eq!(Wrap::Repeat.apply(at, size), expected);
        }
        for odd in [f32::NAN, f32::INFINITY, -1e30, 1e30] {
            assert!(point(&texture, odd, odd, Wrap::Repeat)[3] == 1.0);
        }
    }

    #[test]
    fn smaller_levels_are_the_mean_of_light() {
        let texture = quarters();
        let (width, height, texels) = texture.levels().last().unwrap();
        // A quarter of the light is sRGB 137.
        assert_eq!((width, height, texels), (1, 1, [[137, 137, 137, 255]].as_slice()));
        let far = Vec2::new(4.0, 0.0);
        let value = texture.sample(Srgb::new(), Vec2::new(0.1, 0.9), far, Vec2::ZERO, [Wrap::Repeat; 2]);
        assert!((value.x - 0.25).abs() < 0.002 && value.x == value.y);
        let data = Texture::new(2, 1, vec![[10, 0, 0, 0], [20, 0, 0, 0]], Encoding::Data).unwrap();
        assert_eq!(data.levels().last().unwrap().2, [[15, 0, 0, 0]]);
    }

    #[test]
    fn odd_sizes_keep_the_mean() {
        let texels: Vec<[u8; 4]> = (0..15).map(|i| [i * 16, 0, 0, 255]).collect();
        let texture = Texture::new(5, 3, texels, Encoding::Data).unwrap();
        let sizes: Vec<_> = texture.levels().map(|(w, h, _)| (w, h)).collect();
        assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
        let last = i32::from(texture.levels().last().unwrap().2[0][0]);
        assert!((last - 112).abs() <= 1, "{last}");
        let sum: f32 = shares(7, 3).iter().flatten().map(|(_, w)| w).sum();
        assert!((sum - 3.0).abs() < 1e-6);
    }

    #[test]
    fn large_images_are_halved() {
        let texture = Texture::new(4096, 2, vec![RED; 8192], Encoding::Color).unwrap();
        assert_eq!(texture.size(), [2048, 1]);
        assert!(Texture::new(2, 2, vec![RED; 3], Encoding::Color).is_none());
        assert!(Texture::new(0, 2, Vec::new(), Encoding::Color).is_none());
    }

    #[test]
    fn logarithm_is_near() {
        for i in 1..1000 {
            let x = 1.0 + i as f32 * 0.37;
            assert!((f64::from(log2(x)) - libm::log2(f64::from(x))).abs() < 0.01, "{x}");
        }
        assert!(log2(1.0) == 0.0 && (log2(4.0) - 2.0).abs() < 1e-6);
    }
}
