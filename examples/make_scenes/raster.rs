//! Pictures computed texel by texel, and their encoding. A [`Coat`] is the set of pictures of one material.

use glam::{DVec2, DVec3};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// Width × height texels, row by row from the top; values in [0, 1], as stored (colours in sRGB).
pub struct Raster {
    width: usize,
    height: usize,
    texels: Vec<[f64; 4]>,
}

impl Raster {
    /// `texel` is asked at the middle of each texel; v grows downwards.
    pub fn paint(size: [usize; 2], texel: impl Fn(DVec2) -> [f64; 4]) -> Self {
        let [width, height] = size;
        let at = |i: usize| {
            DVec2::new(((i % width) as f64 + 0.5) / width as f64, ((i / width) as f64 + 0.5) / height as f64)
        };
        Self { width, height, texels: (0..width * height).map(|i| texel(at(i))).collect() }
    }

    fn bytes(&self, channels: usize) -> Vec<u8> {
        let byte = |c: &f64| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        self.texels.iter().flat_map(|t| t[..channels].iter().map(byte)).collect()
    }

    /// As JPEG, without alpha.
    pub fn jpeg(&self, quality: u8) -> Vec<u8> {
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(&mut file, quality)
            .write_image(&self.bytes(3), self.width as u32, self.height as u32, ExtendedColorType::Rgb8)
            .expect("the buffer has the size that is stated");
        file
    }

    /// As PNG, with alpha.
    pub fn png(&self) -> Vec<u8> {
        let mut file = Vec::new();
        PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive)
            .write_image(&self.bytes(4), self.width as u32, self.height as u32, ExtendedColorType::Rgba8)
            .expect("the buffer has the size that is stated");
        file
    }
}

/// What a material is at one point.
#[derive(Clone, Copy)]
pub struct Texel {
    /// sRGB.
    pub color: DVec3,
    /// Height above the surface, in texture widths.
    pub height: f64,
    /// 0 mirror, 1 chalk.
    pub rough: f64,
    /// 0 or 1.
    pub metal: f64,
}

/// Colour, normal and occlusion-roughness-metal pictures of one material.
pub struct Coat {
    /// sRGB.
    pub color: Raster,
    /// Tangent-space normals, +y up.
    pub normal: Raster,
    /// Red: occlusion (1, unused), green: roughness, blue: metal.
    pub rough: Raster,
}

impl Coat {
    /// Paints a tiling material; the roughness picture has half the size.
    pub fn paint(size: [usize; 2], texel: impl Fn(DVec2) -> Texel) -> Self {
        let [width, height] = size;
        let at = |x: usize, y: usize| DVec2::new((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
        let texels: Vec<Texel> = (0..width * height).map(|i| texel(at(i % width, i / width))).collect();
        let get = |x: usize, y: usize| texels[(y % height) * width + x % width];
        let index = |uv: DVec2| ((uv.x * width as f64) as usize, (uv.y * height as f64) as usize);
        let normal = |uv: DVec2| {
            let (x, y) = index(uv);
            let across = get(x + 1, y).height - get(x + width - 1, y).height;
            let down = get(x, y + 1).height - get(x, y + height - 1).height;
            let half = width as f64 / 2.0;
            let n = DVec3::new(-across * half, down * half, 1.0).normalize() * 0.5 + 0.5;
            [n.x, n.y, n.z, 1.0]
        };
        let rough = |uv: DVec2| {
            let (x, y) = index(uv);
            let quad = [get(x, y), get(x + width - 1, y), get(x, y + height - 1), get(x + width - 1, y + height - 1)];
            let mean = |part: fn(&Texel) -> f64| quad.iter().map(part).sum::<f64>() / 4.0;
            [1.0, mean(|t| t.rough), mean(|t| t.metal), 1.0]
        };
        Self {
            color: Raster::paint(size, |uv| {
                let (x, y) = index(uv);
                get(x, y).color.extend(1.0).to_array()
            }),
            normal: Raster::paint(size, normal),
            rough: Raster::paint([width / 2, height / 2], rough),
        }
    }
}

/// Between two sRGB colours.
pub fn blend(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    a + (b - a) * t.clamp(0.0, 1.0)
}

/// An sRGB colour written as in a style sheet, `0xrrggbb`.
pub fn hex(rgb: u32) -> DVec3 {
    DVec3::new(f64::from(rgb >> 16 & 255), f64::from(rgb >> 8 & 255), f64::from(rgb & 255)) / 255.0
}
