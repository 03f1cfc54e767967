//! How far apart two surfaces are: mean, root mean square and largest distance, in both directions, from samples.
//!
//! Samples lie evenly by area, at places that depend on the triangles alone; so the same pair gives the same figures
//! on any machine. Knows positions only. The largest distance of samples is a lower bound of the true (Hausdorff) one.

use rayon::prelude::*;

use super::Corners;
use crate::distance::Surface;
use crate::quadric::{cross, dot, sub};

/// Distances from one surface to another, object space units.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Distances {
    /// Arithmetic mean.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// The largest of the samples.
    pub max: f64,
}

/// Distances in both directions, object space units. Absent where one of the surfaces has no triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct SurfaceDistance {
    /// From the reference to the candidate: what is missing there counts here.
    pub forward: Distances,
    /// From the candidate to the reference: what it made up counts here.
    pub backward: Distances,
}

impl SurfaceDistance {
    /// The larger of both directions.
    pub fn max(&self) -> f64 {
        self.forward.max.max(self.backward.max)
    }

    /// Measures with `samples` points on each surface; `None` if one of them has no area to sample.
    pub fn measure(reference: &[Corners], candidate: &[Corners], samples: usize) -> Option<Self> {
        Some(Self {
            forward: distances(&sample(reference, samples)?, candidate),
            backward: distances(&sample(candidate, samples)?, reference),
        })
    }
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// Number of the triangle.
    pub(super) triangle: usize,
    /// Weights of its corners; their sum is 1.
    pub(super) weights: [f64; 3],
}

impl Sample {
    /// The point that it is on `corners`.
    pub(super) fn on<const N: usize>(&self, corners: &[[f64; N]; 3]) -> [f64; N] {
        std::array::from_fn(|i| (0..3).map(|c| self.weights[c] * corners[c][i]).sum())
    }
}

/// Fractions of the golden section's counterpart in two dimensions: successive multiples fill the square evenly.
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// `count` points, evenly by area. `None`: there is no area.
pub(super) fn samples_by_area(triangles: &[Corners], count: usize) -> Option<Vec<Sample>> {
    let mut sums = Vec::with_capacity(triangles.len());
    let mut total = 0.0;
    for t in triangles {
        let normal = cross(sub(t[1], t[0]), sub(t[2], t[0]));
        total += dot(normal, normal).sqrt();
        sums.push(total);
    }
    if total <= 0.0 || !total.is_finite() {
        return None;
    }
    let mut triangle = 0;
    let at = |i: usize| {
        let wanted = (i as f64 + 0.5) / count as f64 * total;
        while triangle + 1 < sums.len() && sums[triangle] <= wanted {
            triangle += 1;
        }
        let [mut u, mut v] = R2.map(|step| (0.5 + step * (i + 1) as f64).fract());
        if 1.0 < u + v {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Sample { triangle, weights: [1.0 - u - v, u, v] }
    };
    Some((0..count).map(at).collect())
}

fn sample(triangles: &[Corners], count: usize) -> Option<Vec<[f64; 3]>> {
    let samples = samples_by_area(triangles, count)?;
    Some(samples.iter().map(|sample| sample.on(&triangles[sample.triangle])).collect())
}

fn distances(points: &[[f64; 3]], triangles: &[Corners]) -> Distances {
    let surface = Surface::new(triangles);
    let squares: Vec<f64> = points.par_iter().map(|&p| surface.squared_distance_above(p, 0.0)).collect();
    Distances::of_squares(&squares)
}

impl Distances {
    /// Of squared distances; zero if there are none.
    pub(super) fn of_squares(squares: &[f64]) -> Self {
        if squares.is_empty() {
            return Self::default();
        }
        let count = squares.len() as f64;
        Self {
            mean: squares.iter().map(|square| square.sqrt()).sum::<f64>() / count,
            rms: (squares.iter().sum::<f64>() / count).sqrt(),
            max: squares.iter().copied().fold(0.0, f64::max).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(height: f64, side: f64) -> Vec<Corners> {
        let corner = |x: f64, y: f64| [x * side, y * side, height];
        let (a, b, c, d) = (corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0));
        vec![[a, b, c], [a, c, d]]
    }

    #[test]
    fn a_surface_is_at_no_distance_from_itself() {
        let found = SurfaceDistance::measure(&square(0.0, 1.0), &square(0.0, 1.0), 500).unwrap();
        assert!(found.max() < 1e-12, "{found:?}");
    }

    #[test]
    fn parallel_squares_are_as_far_apart_as_they_are() {
        let found = SurfaceDistance::measure(&square(0.0, 1.0), &square(0.25, 1.0), 500).unwrap();
        for one in [found.forward, found.backward] {
            assert_eq!([one.mean, one.rms, one.max], [0.25; 3]);
        }
    }

    #[test]
    fn what_is_missing_counts_forward_only() {
        let found = SurfaceDistance::measure(&square(0.0, 2.0), &square(0.0, 1.0), 4000).unwrap();
        assert!(found.backward.max < 1e-12);
        assert!((1.3..=2.0_f64.sqrt()).contains(&found.forward.max), "{found:?}");
        // A quarter of the area is at no distance.
        assert!((0.35..0.55).contains(&found.forward.mean), "{found:?}");
    }

    #[test]
    fn samples_lie_evenly_by_area() {
        let mut triangles = square(0.0, 1.0);
        triangles.extend(square(1.0, 3.0));
        let samples = samples_by_area(&triangles, 10_000).unwrap();
        let on_small = samples.iter().filter(|sample| sample.triangle < 2).count();
        assert!((990..=1010).contains(&on_small), "{on_small}");
        assert!(samples.iter().all(|s| s.weights.iter().all(|&w| (0.0..=1.0).contains(&w))));
        let mean: f64 = samples.iter().map(|s| s.weights[1]).sum::<f64>() / 10_000.0;
        assert!((mean - 1.0 / 3.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn nothing_has_no_distance() {
        assert_eq!(SurfaceDistance::measure(&[], &square(0.0, 1.0), 10), None);
        assert_eq!(SurfaceDistance::measure(&square(0.0, 1.0), &square(0.0, 0.0), 10), None);
    }
}
