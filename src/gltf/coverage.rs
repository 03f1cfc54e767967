//! When a level may be shown: the share of the screen and the distance at which its error stays invisible.
//!
//! A level of error e (a length) at distance d covers e·H / (2 d tan(φ/2)) pixels on a screen H pixels high with the
//! vertical field of view φ. It may be shown once that is at most ε pixels, hence from the distance
//! d = e·H / (2 ε tan(φ/2)) on. There, the bounding sphere of radius r takes the share
//! c = r / (d tan(φ/2)) = 2 r ε / (e·H) of the screen's height: the field of view drops out. Knows no documents.

use crate::config::{EmitSettings, Profile};

/// What is on the screen: one object, or a batch of instances that switch together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// Radius of the bounding sphere: of the object, or of all instances.
    pub(super) radius: f64,
    /// Factor on the errors: the largest scale among the instances, 1 for a single object.
    pub(super) scale: f64,
    /// A batch switches when its *nearest* instance may, and that is up to a radius nearer than its centre.
    pub(super) batch: bool,
}

/// When each level may be shown, finest first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Thresholds {
    /// For `MSFT_screencoverage`: one number more than levels, strictly decreasing.
    pub(super) coverage: Vec<f64>,
    /// Distance from the centre from which on each level may be shown.
    pub(super) distances: Vec<f64>,
    /// Errors in the units of the distances.
    pub(super) errors: Vec<f64>,
    /// Radius of what switches, in the same units.
    pub(super) radius: f64,
}

/// Neighbours differ by 2⁻¹⁰ at least, so that they differ in single precision too.
const STEP: f64 = 1.0 - 1.0 / 1024.0;

/// A billionth of the screen is never seen; zero is reserved for "never culled".
const SMALLEST: f64 = 1e-9;

impl Thresholds {
    pub(super) fn new(extent: Extent, errors: &[f64], settings: &EmitSettings) -> Self {
        let tangent = libm::tan(settings.screen.fov.to_radians() / 2.0);
        let mut thresholds =
            Self { coverage: Vec::new(), distances: Vec::new(), errors: Vec::new(), radius: extent.radius };
        let mut worst: f64 = 0.0;
        for &error in errors {
            // A finer level never has to wait for a coarser one.
            worst = worst.max(error * extent.scale);
            let nearest = worst * settings.screen.height / (2.0 * settings.screen.pixels * tangent);
            let distance = if extent.batch { nearest + extent.radius } else { nearest };
            thresholds.errors.push(error * extent.scale);
            thresholds.distances.push(distance);
            thresholds.coverage.push(extent.radius / (distance * tangent));
        }
        for (slot, &given) in thresholds.coverage.iter_mut().zip(settings.coverage.iter().flatten()) {
            *slot = given;
        }
        thresholds.finish_coverage(settings.profile);
        thresholds
    }

    fn finish_coverage(&mut self, profile: Profile) {
        let mut above = f64::INFINITY;
        if profile == Profile::Unreal {
            // LOD 0 starts at the full screen, and each level where the one before it ends.
            self.coverage.insert(0, 1.0);
        }
        for share in &mut self.coverage {
            // NaN: nothing has no size, and neither may a number that was given be one.
            let number = if share.is_nan() { 1.0 } else { *share };
            *share = number.clamp(SMALLEST, 1.0).min(above * STEP);
            above = *share;
        }
        if profile != Profile::Unreal {
            self.coverage.push(0.0);
        }
    }
}

/// Screen coverage and switching distance of each level of a single object, finest first: what `add_levels` writes for
/// it. `errors` and `radius` are lengths in the mesh's units.
pub fn switches(radius: f64, errors: &[f64], settings: &EmitSettings) -> Vec<(f64, f64)> {
    let thresholds = Thresholds::new(Extent { radius, scale: 1.0, batch: false }, errors, settings);
    // Where a number says at which size its level starts, the first one is level 0's.
    let finest = usize::from(settings.profile == Profile::Unreal);
    thresholds.coverage.into_iter().skip(finest).zip(thresholds.distances).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(radius: f64) -> Extent {
        Extent { radius, scale: 1.0, batch: false }
    }

    fn strictly_decreasing(values: &[f64]) -> bool {
        values.windows(2).all(|w| (w[1] as f32) < w[0] as f32)
    }

    #[test]
    fn coverage_is_the_published_formula() {
        let thresholds = Thresholds::new(object(2.0), &[0.01, 0.1], &EmitSettings::default());
        let expected = |error: f64| 2.0 * 2.0 * 1.0 / (error * 1080.0);
        assert!((thresholds.coverage[0] - expected(0.01)).abs() < 1e-12);
        assert!((thresholds.coverage[1] - expected(0.1)).abs() < 1e-12);
        assert_eq!(thresholds.coverage[2], 0.0);
        // At its distance the error covers one pixel.
        let pixels = 0.01 * 1080.0 / (2.0 * thresholds.distances[0] * libm::tan(30_f64.to_radians()));
        assert!((pixels - 1.0).abs() < 1e-12);
    }

    #[test]
    fn always_strictly_decreasing_and_never_culled() {
        let hard: [&[f64]; 6] =
            [&[0.0, 0.0, 0.0], &[1.0, 1.0, 1.0], &[3.0, 2.0, 1.0], &[1e-30, 1e-29], &[1e30, 1e30, 1e300], &[]];
        for errors in hard {
            for radius in [0.0, 1e-6, 1.0, 1e9] {
                for profile in [Profile::Web, Profile::Unreal] {
                    let settings = EmitSettings { profile, ..EmitSettings::default() };
                    let coverage = Thresholds::new(object(radius), errors, &settings).coverage;
                    assert_eq!(coverage.len(), errors.len() + 1);
                    assert!(strictly_decreasing(&coverage), "{errors:?} {radius} {coverage:?}");
                    assert!(coverage.iter().all(|c| (0.0..=1.0).contains(c)));
                    assert_eq!(coverage.last() == Some(&0.0), profile != Profile::Unreal);
                }
            }
        }
    }

    #[test]
    fn distances_never_decrease() {
        let thresholds = Thresholds::new(object(1.0), &[0.2, 0.1, 0.3], &EmitSettings::default());
        assert!(thresholds.distances.windows(2).all(|w| w[0] <= w[1]));
        assert_eq!(thresholds.errors, [0.2, 0.1, 0.3]);
    }

    #[test]
    fn explicit_coverage_wins_where_given() {
        let settings = EmitSettings { coverage: Some(vec![0.5, f64::NAN]), ..EmitSettings::default() };
        let thresholds = Thresholds::new(object(1.0), &[0.01, 0.02, 0.04], &settings);
        assert_eq!(thresholds.coverage[0], 0.5);
        assert!(strictly_decreasing(&thresholds.coverage), "{:?}", thresholds.coverage);
    }

    #[test]
    fn unreal_is_shifted_by_one_level() {
        let web = Thresholds::new(object(1.0), &[0.01, 0.02], &EmitSettings::default()).coverage;
        let settings = EmitSettings { profile: Profile::Unreal, ..EmitSettings::default() };
        let unreal = Thresholds::new(object(1.0), &[0.01, 0.02], &settings).coverage;
        assert_eq!(unreal, [1.0, web[0], web[1]]);
        let shown = switches(1.0, &[0.01, 0.02], &settings);
        assert_eq!(shown.iter().map(|(coverage, _)| *coverage).collect::<Vec<_>>(), web[..2]);
    }

    #[test]
    fn a_batch_waits_for_its_nearest_instance() {
        let batch = Extent { radius: 50.0, scale: 2.0, batch: true };
        let thresholds = Thresholds::new(batch, &[0.01], &EmitSettings::default());
        let single = Thresholds::new(object(1.0), &[0.02], &EmitSettings::default());
        assert!((thresholds.distances[0] - single.distances[0] - 50.0).abs() < 1e-9);
        assert_eq!(thresholds.errors, [0.02]);
        let tangent = libm::tan(30_f64.to_radians());
        assert!((thresholds.coverage[0] - (50.0 / (thresholds.distances[0] * tangent)).min(1.0)).abs() < 1e-12);
    }
}
