//! Structural similarity of two pictures. Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, *Image quality assessment: from
//! error visibility to structural similarity*, 2004: windows of 11×11 with Gaussian weights of σ = 1.5, on luminance.
//!
//! The mean is over the pixels that either picture covers: an empty background, which is equal by nature, would
//! praise any level of a thin object.

use super::metric::luminances;
use super::render::Picture;
use super::srgb::LUMINANCE_UNIT;

/// Half the width of a window, without its middle.
const REACH: usize = 5;

/// Constants of the paper: (0.01 · 255)² and (0.03 · 255)².
const C1: f32 = 6.5025;
const C2: f32 = 58.5225;

/// Mean similarity of two pictures of one size over the pixels that either covers; exactly 1 for equal ones.
pub fn between(a: &Picture, b: &Picture) -> f64 {
    if a.pixels == b.pixels {
        return 1.0;
    }
    let size = a.size as usize;
    let scaled = |p: &Picture| -> Vec<f32> {
        luminances(p).into_iter().map(|y| (f64::from(y) / LUMINANCE_UNIT) as f32).collect()
    };
    let (x, y) = (scaled(a), scaled(b));
    let weights = weights();
    let blurred = |at: &dyn Fn(usize) -> f32| blur(&(0..x.len()).map(at).collect::<Vec<_>>(), size, &weights);
    let (mean_x, mean_y) = (blurred(&|i| x[i]), blurred(&|i| y[i]));
    // Squares of what lies off the middle grey: smaller numbers, less rounding.
    let off = |v: f32| v - 128.0;
    let (xx, yy) = (blurred(&|i| off(x[i]) * off(x[i])), blurred(&|i| off(y[i]) * off(y[i])));
    let xy = blurred(&|i| off(x[i]) * off(y[i]));
    let (mut sum, mut count) = (0.0f64, 0u64);
    for i in 0..x.len() {
        if a.pixels[i][3] == 0 && b.pixels[i][3] == 0 {
            continue;
        }
        let (mx, my) = (mean_x[i], mean_y[i]);
        let vx = xx[i] - off(mx) * off(mx);
        let vy = yy[i] - off(my) * off(my);
        let cov = xy[i] - off(mx) * off(my);
        let value = (2.0 * mx * my + C1) * (2.0 * cov + C2) / ((mx * mx + my * my + C1) * (vx + vy + C2));
        sum += f64::from(value);
        count += 1;
    }
    if count == 0 { 1.0 } else { sum / count as f64 }
}

fn weights() -> [f32; 2 * REACH + 1] {
    let raw: [f64; 2 * REACH + 1] = std::array::from_fn(|i| {
        let d = i as f64 - REACH as f64;
        libm::exp(-d * d / (2.0 * 1.5 * 1.5))
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| (w / sum) as f32)
}

/// Rows, then columns. Beyond the border the picture's last pixels go on: the background, where the whole object is in
/// the frame.
fn blur(values: &[f32], size: usize, weights: &[f32; 2 * REACH + 1]) -> Vec<f32> {
    let mut rows = Vec::with_capacity(values.len());
    let mut padded = vec![0.0; size + 2 * REACH];
    for row in values.chunks_exact(size) {
        padded[REACH..REACH + size].copy_from_slice(row);
        padded[..REACH].fill(row[0]);
        padded[REACH + size..].fill(row[size - 1]);
        rows.extend((0..size).map(|i| {
            let window = &padded[i..=i + 2 * REACH];
            window.iter().zip(weights).map(|(v, w)| v * w).sum::<f32>()
        }));
    }
    let mut out = vec![0.0; values.len()];
    for (y, line) in out.chunks_exact_mut(size).enumerate() {
        for (k, w) in weights.iter().enumerate() {
            let from = (y + k).saturating_sub(REACH).min(size - 1) * size;
            for (sum, v) in line.iter_mut().zip(&rows[from..from + size]) {
                *sum += v * w;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(gray: impl Fn(usize, usize) -> u8) -> Picture {
        let pixels = (0..1024).map(|i| {
            let g = gray(i % 32, i / 32);
            [g, g, g, 255]
        });
        Picture { size: 32, pixels: pixels.collect(), faces: Vec::new() }
    }

    #[test]
    fn equal_is_one_and_flat_pictures_follow_the_formula() {
        let a = picture(|x, y| (x * 7 + y * 3) as u8);
        assert_eq!(between(&a, &a), 1.0);
        // Without structure only the means count.
        let (p, q) = (picture(|_, _| 100), picture(|_, _| 110));
        let expected = f64::from((2.0 * 100.0 * 110.0 + C1) / (100.0 * 100.0 + 110.0 * 110.0 + C1));
        assert!((between(&p, &q) - expected).abs() < 1e-4);
    }

    #[test]
    fn opposite_structure_is_worse_than_a_shift() {
        let a = picture(|x, _| if x % 4 < 2 { 80 } else { 170 });
        let shifted = picture(|x, _| if x % 4 < 2 { 90 } else { 180 });
        let opposite = picture(|x, _| if x % 4 < 2 { 170 } else { 80 });
        assert!(between(&a, &shifted) > 0.95);
        assert!(between(&a, &opposite) < -0.8);
    }
}
