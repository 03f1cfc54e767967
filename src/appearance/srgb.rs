//! Between light and the 8-bit numbers of an image: the sRGB transfer function as tables, and luminance.
//!
//! Tables are made once with `libm`, so that every machine has the same ones.

use std::sync::LazyLock;

/// Entries of the first guess from light to a byte.
const GUESSES: usize = 4096;

struct Tables {
    /// Light of each byte, 0…1.
    light: [f32; 256],
    /// `least[i]`: the least light that rounds to byte `i`; one more than there are bytes, the last is out of reach.
    least: [f32; 257],
    /// For light `i / (GUESSES - 1)`: a byte that is right or one too low.
    guess: Vec<u8>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let mut least = [f32::INFINITY; 257];
    least[0] = f32::NEG_INFINITY;
    for (i, at) in least.iter_mut().enumerate().take(256).skip(1) {
        *at = decode((i as f64 - 0.5) / 255.0) as f32;
    }
    let light = std::array::from_fn(|i| decode(i as f64 / 255.0) as f32);
    let byte_of = |value: f32| (least[1..256].partition_point(|l| *l <= value)) as u8;
    let guess = (0..GUESSES).map(|i| byte_of(i as f32 / (GUESSES - 1) as f32)).collect();
    Tables { light, least, guess }
});

/// IEC 61966-2-1: encoded value 0…1 to light 0…1.
fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// A borrowed view of the tables: look them up once outside a loop.
#[derive(Clone, Copy)]
pub struct Srgb(&'static Tables);

impl Srgb {
    /// The tables, made on first use.
    pub fn new() -> Self {
        Self(&TABLES)
    }

    /// Light of an encoded byte, 0…1.
    #[inline]
    pub fn light(self, byte: u8) -> f32 {
        self.0.light[byte as usize]
    }

    /// The least light of each byte, and behind it one that is out of reach.
    #[cfg(feature = "render")]
    pub(super) fn least(self) -> &'static [f32; 257] {
        &self.0.least
    }

    /// The nearest byte of some light; below 0 is 0, above 1 is 255, NaN is 0.
    #[inline]
    pub fn byte(self, light: f32) -> u8 {
        let clamped = if light > 0.0 { light.min(1.0) } else { 0.0 };
        let mut byte = self.0.guess[(clamped * (GUESSES - 1) as f32) as usize];
        while self.0.least[byte as usize + 1] <= clamped {
            byte += 1;
        }
        byte
    }
}

impl Default for Srgb {
    fn default() -> Self {
        Self::new()
    }
}

/// Luminance of an encoded colour in ten-thousandths, 0…2550000: the weights of ITU-R BT.709 on the encoded channels
/// ("luma"), which is what an image file holds and what earlier work measured. An integer, so that sums are exact.
#[inline]
pub fn luminance(rgb: [u8; 3]) -> i32 {
    2126 * i32::from(rgb[0]) + 7152 * i32::from(rgb[1]) + 722 * i32::from(rgb[2])
}

/// What [`luminance`] gives for one step of 0…255.
pub const LUMINANCE_UNIT: f64 = 10000.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_light() {
        let srgb = Srgb::new();
        for byte in 0..=255 {
            assert_eq!(srgb.byte(srgb.light(byte)), byte);
        }
        assert_eq!((srgb.byte(-1.0), srgb.byte(2.0), srgb.byte(f32::NAN), srgb.byte(0.0)), (0, 255, 0, 0));
    }

    #[test]
    fn light_rounds_to_the_nearest_byte() {
        let srgb = Srgb::new();
        for i in 0..=100_000 {
            let light = i as f32 / 100_000.0;
            let x = f64::from(light);
            let encoded = if x <= 0.0031308 { x * 12.92 } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
            let off = (f64::from(srgb.byte(light)) - encoded * 255.0).abs();
            assert!(off < 0.501, "{light}: {off}");
        }
    }

    #[test]
    fn white_is_255() {
        assert_eq!(f64::from(luminance([255; 3])) / LUMINANCE_UNIT, 255.0);
        assert_eq!(luminance([0; 3]), 0);
    }
}
