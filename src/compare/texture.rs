//! How far a texture moved over the surface (*texture deviation*, Cohen, Olano and Manocha 1998) and how much the
//! surface stretches it (*texture stretch*, Sander et al. 2001), where two surfaces share a texture domain.
//!
//! Sampled: the deviation is that of the samples, not a bound. Where several places of the reference have the same
//! texture coordinates (a mirrored half, a tiled wall) the nearest one counts.

use rayon::prelude::*;

use super::surface::{Distances, samples_by_area};
use super::{Corners, Soup};
use crate::quadric::{dot, sub};

/// Deviation of a texture, object space units.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct TextureDeviation {
    /// Distances between points with equal texture coordinates.
    pub distances: Distances,
    /// Share of the samples, 0…1, for which the reference has no such texture coordinates.
    pub unmatched: f64,
}

/// Stretch of a texture over a surface: 1 is the least there can be.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct TextureStretch {
    /// Root mean square over directions and area.
    pub l2: f64,
    /// The largest of any triangle in any direction.
    pub max: f64,
    /// Share of the area, 0…1, over triangles without area in the texture. They are left out of both figures.
    pub collapsed: f64,
}

type Uv = [[f64; 2]; 3];

impl TextureDeviation {
    /// From the candidate to the reference. `None` where one of them has no textured triangle.
    pub fn measure(reference: &Soup, candidate: &Soup, samples: usize) -> Option<Self> {
        let domain = Domain::new(reference)?;
        let (corners, uvs): (Vec<Corners>, Vec<(u32, Uv)>) = textured(candidate).unzip();
        let samples = samples_by_area(&corners, samples)?;
        let nearest = |sample: &super::surface::Sample| {
            let (material, uv) = &uvs[sample.triangle];
            domain.squared_distance(*material, sample.on(uv), sample.on(&corners[sample.triangle]))
        };
        let squares: Vec<Option<f64>> = samples.par_iter().map(nearest).collect();
        let matched: Vec<f64> = squares.iter().flatten().copied().collect();
        let unmatched = (squares.len() - matched.len()) as f64 / squares.len() as f64;
        Some(Self { distances: Distances::of_squares(&matched), unmatched })
    }
}

impl TextureStretch {
    /// Of one surface. `None` where no triangle has an area in a texture.
    pub fn measure(soup: &Soup) -> Option<Self> {
        let (mut squares, mut max, mut area, mut texture, mut collapsed) = (0.0, 0.0_f64, 0.0, 0.0, 0.0);
        for (corners, (_, uv)) in textured(soup) {
            let (surface, twice) = (area_of(&corners), twice_area(&uv));
            if twice.abs() <= f64::MIN_POSITIVE || !(surface / twice).is_finite() {
                collapsed += surface;
                continue;
            }
            let along = |k: usize, sign: f64| -> [f64; 3] {
                let weight = |i: usize| sign * (uv[(i + 1) % 3][k] - uv[(i + 2) % 3][k]);
                std::array::from_fn(|axis| (0..3).map(|i| corners[i][axis] * weight(i)).sum::<f64>() / twice)
            };
            let (by_s, by_t) = (along(1, 1.0), along(0, -1.0));
            let (a, b, c) = (dot(by_s, by_s), dot(by_s, by_t), dot(by_t, by_t));
            squares += f64::midpoint(a, c) * surface;
            max = max.max(((a + c + ((a - c) * (a - c) + 4.0 * b * b).sqrt()) / 2.0).sqrt());
            area += surface;
            texture += twice.abs() / 2.0;
        }
        if area <= 0.0 {
            return None;
        }
        // A texture laid out without any stretch has this many units of length for one of its own.
        let ideal = (area / texture).sqrt();
        let l2 = (squares / area).sqrt() / ideal;
        Some(Self { l2, max: max / ideal, collapsed: collapsed / (area + collapsed) })
    }
}

fn textured(soup: &Soup) -> impl Iterator<Item = (Corners, (u32, Uv))> + '_ {
    let all = soup.corners.iter().zip(&soup.uvs).zip(&soup.materials);
    all.filter_map(|((corners, uv), &material)| Some((*corners, (material, (*uv)?))))
}

fn area_of(t: &Corners) -> f64 {
    let (u, v) = (sub(t[1], t[0]), sub(t[2], t[0]));
    let normal = crate::quadric::cross(u, v);
    dot(normal, normal).sqrt() / 2.0
}

fn twice_area(t: &Uv) -> f64 {
    (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[2][0] - t[0][0]) * (t[1][1] - t[0][1])
}

/// The reference's triangles by their place in the texture: a grid over all texture coordinates.
struct Domain {
    triangles: Vec<(u32, Uv, Corners)>,
    low: [f64; 2],
    cell: [f64; 2],
    side: usize,
    /// Where the list of each cell starts in `members`; one entry more than there are cells.
    starts: Vec<u32>,
    members: Vec<u32>,
}

/// Beyond the border of a triangle by this share of its size a point still counts as on it: levels have rounded
/// coordinates.
const SLACK: f64 = 1e-3;

impl Domain {
    fn new(soup: &Soup) -> Option<Self> {
        let triangles: Vec<(u32, Uv, Corners)> =
            textured(soup).map(|(corners, (material, uv))| (material, uv, corners)).collect();
        let finite = triangles.iter().flat_map(|(_, uv, _)| uv).filter(|uv| uv.iter().all(|c| c.is_finite()));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for uv in finite {
            for k in 0..2 {
                low[k] = low[k].min(uv[k]);
                high[k] = high[k].max(uv[k]);
            }
        }
        if !low[0].is_finite() {
            return None;
        }
        let side = ((triangles.len() as f64).sqrt() as usize).clamp(1, 2048);
        let cell = [0, 1].map(|k| ((high[k] - low[k]) / side as f64).max(f64::MIN_POSITIVE));
        let mut domain = Self { triangles, low, cell, side, starts: Vec::new(), members: Vec::new() };
        domain.fill();
        Some(domain)
    }

    fn fill(&mut self) {
        let mut counts = vec![0_u32; self.side * self.side + 1];
        for (_, uv, _) in &self.triangles {
            self.cells(uv).for_each(|cell| counts[cell + 1] += 1);
        }
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        let mut next = counts.clone();
        let mut members = vec![0; *counts.last().unwrap_or(&0) as usize];
        for (number, (_, uv, _)) in self.triangles.iter().enumerate() {
            for cell in self.cells(uv) {
                members[next[cell] as usize] = number as u32;
                next[cell] += 1;
            }
        }
        (self.starts, self.members) = (counts, members);
    }

    fn column(&self, k: usize, value: f64) -> usize {
        (((value - self.low[k]) / self.cell[k]).max(0.0) as usize).min(self.side - 1)
    }

    /// Cells that the box round a triangle touches, slack included.
    fn cells(&self, uv: &Uv) -> impl Iterator<Item = usize> + use<> {
        let [(x0, x1), (y0, y1)] = [0, 1].map(|k| {
            let values = uv.map(|corner| corner[k]);
            let (low, high) =
                (values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(f64::MIN, f64::max));
            let slack = (high - low) * SLACK;
            (self.column(k, low - slack), self.column(k, high + slack))
        });
        let side = self.side;
        (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * side + x))
    }

    /// To the nearest point of the reference with these texture coordinates.
    fn squared_distance(&self, material: u32, uv: [f64; 2], point: [f64; 3]) -> Option<f64> {
        let cell = self.column(1, uv[1]) * self.side + self.column(0, uv[0]);
        let members = &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        let mut best: Option<f64> = None;
        for &number in members {
            let (own, corners_uv, corners) = &self.triangles[number as usize];
            if *own != material {
                continue;
            }
            let Some(weights) = weights_at(corners_uv, uv) else { continue };
            let at: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| weights[i] * corners[i][k]).sum());
            let off = sub(at, point);
            let square = dot(off, off);
            best = Some(best.map_or(square, |best| best.min(square)));
        }
        best
    }
}

/// Weights of the corners at a point of the texture; `None` outside.
fn weights_at(uv: &Uv, at: [f64; 2]) -> Option<[f64; 3]> {
    let twice = twice_area(uv);
    let part = |i: usize| {
        let (p, q) = (uv[(i + 1) % 3], uv[(i + 2) % 3]);
        ((q[0] - p[0]) * (at[1] - p[1]) - (at[0] - p[0]) * (q[1] - p[1])) / twice
    };
    let weights = [part(0), part(1), part(2)];
    // NaN and infinities of triangles without area are outside, too.
    weights.iter().all(|weight| (-SLACK..=1.0 + SLACK).contains(weight)).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit square, its texture shifted by `shift` along x and scaled by `scale`.
    fn square(shift: f64, scale: [f64; 2]) -> Soup {
        let (a, b, c, d) = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
        let corners = vec![[a, b, c], [a, c, d]];
        let uv = |p: [f64; 3]| [(p[0] - shift) * scale[0], p[1] * scale[1]];
        let uvs = corners.iter().map(|t| Some(t.map(uv))).collect();
        Soup { corners, uvs, materials: vec![0, 0] }
    }

    #[test]
    fn a_texture_deviates_from_itself_by_nothing() {
        let found = TextureDeviation::measure(&square(0.0, [1.0; 2]), &square(0.0, [1.0; 2]), 300).unwrap();
        assert!(found.distances.max < 1e-12 && found.unmatched == 0.0, "{found:?}");
    }

    #[test]
    fn a_shifted_texture_deviates_by_the_shift() {
        let found = TextureDeviation::measure(&square(0.0, [1.0; 2]), &square(-0.25, [1.0; 2]), 4000).unwrap();
        assert!((found.distances.mean - 0.25).abs() < 1e-9 && (found.distances.max - 0.25).abs() < 1e-9, "{found:?}");
        assert!((found.unmatched - 0.25).abs() < 0.01, "a quarter lies outside: {found:?}");
    }

    #[test]
    fn another_material_is_another_domain() {
        let mut other = square(0.0, [1.0; 2]);
        other.materials = vec![1, 1];
        let found = TextureDeviation::measure(&square(0.0, [1.0; 2]), &other, 100).unwrap();
        assert_eq!(found.unmatched, 1.0);
    }

    #[test]
    fn stretch_is_one_at_best_whatever_the_scale() {
        for scale in [0.1, 1.0, 7.0] {
            let found = TextureStretch::measure(&square(0.0, [scale; 2])).unwrap();
            assert!((found.l2 - 1.0).abs() < 1e-12 && (found.max - 1.0).abs() < 1e-12, "{found:?}");
        }
        // Twice as fine in one direction: singular values ½ and 1 over an ideal of √½.
        let found = TextureStretch::measure(&square(0.0, [2.0, 1.0])).unwrap();
        assert!((found.l2 - (1.25_f64 / 2.0 * 2.0).sqrt()).abs() < 1e-12, "{found:?}");
        assert!((found.max - 2.0_f64.sqrt()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn collapsed_triangles_are_counted_apart() {
        let mut soup = square(0.0, [1.0; 2]);
        soup.uvs[1] = Some([[0.5, 0.5]; 3]);
        let found = TextureStretch::measure(&soup).unwrap();
        assert!((found.collapsed - 0.5).abs() < 1e-12 && (found.l2 - 1.0).abs() < 1e-12, "{found:?}");
        soup.uvs = vec![None, None];
        assert_eq!(TextureStretch::measure(&soup), None);
    }
}
