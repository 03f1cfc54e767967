//! The statistics of a study: means with their intervals, tests on paired differences, ratios, rank correlation.
//!
//! Pure: numbers in, numbers out. Knows nothing of meshes, clocks or files. Sums go in the order of the samples.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, StudentsT};

/// Probability that an interval of this room covers the true mean.
pub const CONFIDENCE: f64 = 0.95;

/// What is known of a quantity from repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Number of measurements, 1 or more.
    pub n: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation (divisor n − 1) and the ends of the 95 % t-interval of the mean; absent for a single
    /// measurement.
    pub spread: Option<Spread>,
}

/// How far measurements scatter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spread {
    /// Sample standard deviation, divisor n − 1.
    pub sd: f64,
    /// Lower end of the 95 % t-interval of the mean.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Summary {
    /// `None` if there is nothing, or something that is not a number.
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let n = values.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let spread = (1 < n).then(|| {
            let sd = (squares / (n - 1) as f64).sqrt();
            let half = t_quantile(0.5 + CONFIDENCE / 2.0, n - 1) * sd / (n as f64).sqrt();
            Spread { sd, low: mean - half, high: mean + half }
        });
        Some(Self { n, mean, spread })
    }

    /// Half the width of the interval; absent for a single measurement.
    pub fn half_width(&self) -> Option<f64> {
        self.spread.map(|spread| (spread.high - spread.low) / 2.0)
    }
}

/// The value that a t-distributed variable stays below with probability `p` (0…1, exclusive); `freedom` is 1 or more.
pub fn t_quantile(p: f64, freedom: usize) -> f64 {
    let distribution = t_distribution(freedom);
    // The crate's inverse is off by 1e-4 at a million degrees of freedom; its probabilities are not.
    let newton = |t: f64, _| t - (distribution.cdf(t) - p) / distribution.pdf(t);
    (0..3).fold(distribution.inverse_cdf(p), newton)
}

/// Probability of a value as far from 0 as `t`, or farther, on either side.
fn two_sided(t: f64, freedom: usize) -> f64 {
    (2.0 * t_distribution(freedom).cdf(-t.abs())).min(1.0)
}

fn t_distribution(freedom: usize) -> StudentsT {
    StudentsT::new(0.0, 1.0, freedom.max(1) as f64).expect("the scale and the degrees of freedom are above 0")
}

/// A t-test on paired differences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PairedTest {
    /// Number of pairs, 2 or more.
    pub n: usize,
    /// Mean of first − second.
    pub difference: f64,
    /// Lower end of the 95 % interval of the difference.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Probability of a difference this large if there were none: two-sided.
    pub p: f64,
}

/// Compares two series of measurements that were taken in pairs. `None` if they differ in length, or are shorter than
/// 2, or hold something that is not a number.
pub fn paired_test(first: &[f64], second: &[f64]) -> Option<PairedTest> {
    if first.len() != second.len() {
        return None;
    }
    let differences: Vec<f64> = first.iter().zip(second).map(|(a, b)| a - b).collect();
    let Summary { n, mean, spread } = Summary::of(&differences)?;
    let Spread { sd, low, high } = spread?;
    let p = if 0.0 < sd {
        two_sided(mean * (n as f64).sqrt() / sd, n - 1)
    } else {
        // All differences are the same: certain, or no difference at all.
        f64::from(u8::from(mean == 0.0))
    };
    Some(PairedTest { n, difference: mean, low, high, p })
}

/// How many times as large one series is as another, pair by pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RatioTest {
    /// Number of pairs, 1 or more.
    pub n: usize,
    /// Geometric mean of first ÷ second.
    pub ratio: f64,
    /// The 95 % interval of the ratio, and the two-sided probability of a ratio this far from 1 if it were 1; from a
    /// paired t-test on logarithms. Absent for a single pair.
    pub test: Option<RatioSpread>,
}

/// How sure a [`RatioTest`] is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RatioSpread {
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Two-sided.
    pub p: f64,
}

/// Compares two series of positive measurements that were taken in pairs. `None` if they differ in length, are empty,
/// or hold something that is not a positive number.
pub fn ratio_test(first: &[f64], second: &[f64]) -> Option<RatioTest> {
    let logs = |values: &[f64]| -> Option<Vec<f64>> {
        values.iter().map(|&v| (0.0 < v && v.is_finite()).then(|| libm::log(v))).collect()
    };
    let (first, second) = (logs(first)?, logs(second)?);
    if first.is_empty() || first.len() != second.len() {
        return None;
    }
    let n = first.len();
    let mean = first.iter().zip(&second).map(|(a, b)| a - b).sum::<f64>() / n as f64;
    let test = paired_test(&first, &second).map(|test| RatioSpread {
        low: libm::exp(test.low),
        high: libm::exp(test.high),
        p: test.p,
    });
    Some(RatioTest { n, ratio: libm::exp(mean), test })
}

/// Geometric mean; `None` if there is nothing, or something that is not a positive number.
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    ratio_test(values, &vec![1.0; values.len()]).map(|test| test.ratio)
}

/// Spearman's rank correlation, −1…1; equal values share the mean of their ranks. `None` if the series differ in
/// length, are shorter than 2, hold something that is not a number, or one of them is constant.
pub fn rank_correlation(first: &[f64], second: &[f64]) -> Option<f64> {
    if first.len() != second.len() || first.iter().chain(second).any(|value| !value.is_finite()) {
        return None;
    }
    let (a, b) = (ranks(first), ranks(second));
    let middle = f64::midpoint(first.len() as f64, 1.0);
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - middle) * (y - middle)).sum::<f64>();
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (0.0 < scale).then(|| (product(&a, &b) / scale).clamp(-1.0, 1.0))
}

/// Ranks from 1; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
    let mut ranks = vec![0.0; values.len()];
    let mut start = 0;
    while start < order.len() {
        let tied = order[start..].iter().take_while(|&&i| values[i] == values[order[start]]).count();
        let shared = start as f64 + f64::midpoint(tied as f64, 1.0);
        order[start..start + tied].iter().for_each(|&i| ranks[i] = shared);
        start += tied;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, known: f64, tolerance: f64) {
        assert!((found - known).abs() <= tolerance, "{found} is not {known}");
    }

    /// Two-sided 95 % and 99 % points of the t table, to its four decimals, and beyond it for 19 degrees.
    #[test]
    fn quantiles_are_those_of_the_table() {
        for (freedom, at_975, at_995) in [
            (1, 12.7062, 63.6567),
            (2, 4.3027, 9.9248),
            (3, 3.1824, 5.8409),
            (4, 2.7764, 4.6041),
            (9, 2.2622, 3.2498),
            (19, 2.0930, 2.8609),
            (30, 2.0423, 2.7500),
            (120, 1.9799, 2.6174),
        ] {
            close(t_quantile(0.975, freedom), at_975, 5.1e-5);
            close(t_quantile(0.995, freedom), at_995, 5.1e-5);
            close(t_quantile(0.025, freedom), -at_975, 5.1e-5);
        }
        close(t_quantile(0.975, 19), 2.093_024_054_408_263, 1e-9);
        close(t_quantile(0.975, 1000), 1.962_339, 1e-6);
        close(t_quantile(0.975, 1_000_000), 1.959_966, 1e-6);
    }

    /// One degree of freedom is the Cauchy distribution, two have a closed form: tan(π(p − ½)) and
    /// (2p − 1)·√(2 / (4p(1 − p))).
    #[test]
    fn quantiles_follow_the_closed_forms() {
        for p in [0.6, 0.75, 0.9, 0.975, 0.999] {
            close(t_quantile(p, 1), libm::tan(std::f64::consts::PI * (p - 0.5)), 1e-7);
            close(t_quantile(p, 2), (2.0 * p - 1.0) * (2.0 / (4.0 * p * (1.0 - p))).sqrt(), 1e-7);
        }
    }

    #[test]
    fn a_summary_is_the_textbook_s() {
        // Mean 5, squares 32, n 8: sd = √(32/7); t(0.975, 7) = 2.364624.
        let found = Summary::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        let spread = found.spread.unwrap();
        assert_eq!((found.n, found.mean), (8, 5.0));
        close(spread.sd, (32.0f64 / 7.0).sqrt(), 1e-12);
        close(found.half_width().unwrap(), 2.364_624_251_592_785 * (32.0f64 / 7.0 / 8.0).sqrt(), 1e-8);
        close(spread.low + spread.high, 10.0, 1e-12);
    }

    #[test]
    fn one_measurement_has_no_spread_and_none_no_mean() {
        assert_eq!(Summary::of(&[3.0]), Some(Summary { n: 1, mean: 3.0, spread: None }));
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(Summary::of(&[1.0, f64::NAN]), None);
    }

    /// Student's own example (1908): hours of sleep gained by ten patients with two drugs; t = 4.0621, p = 0.00283.
    #[test]
    fn the_paired_test_gives_student_s_answer() {
        let second = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
        let first = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
        let test = paired_test(&first, &second).unwrap();
        close(test.difference, 1.58, 1e-12);
        close(test.p, 0.002_832_89, 1e-7);
        close(test.low, 0.700_114_2, 1e-6);
        close(test.high, 2.459_885_8, 1e-6);
        let turned = paired_test(&second, &first).unwrap();
        close(turned.p, test.p, 1e-12);
        close(turned.difference, -1.58, 1e-12);
    }

    #[test]
    fn differences_without_spread_are_certain_or_none() {
        assert_eq!(paired_test(&[1.0, 2.0], &[1.0, 2.0]).unwrap().p, 1.0);
        assert_eq!(paired_test(&[2.0, 3.0], &[1.0, 2.0]).unwrap().p, 0.0);
        assert_eq!(paired_test(&[2.0], &[1.0]), None);
        assert_eq!(paired_test(&[2.0, 3.0], &[1.0]), None);
    }

    #[test]
    fn ratios_are_geometric() {
        let test = ratio_test(&[2.0, 8.0], &[1.0, 1.0]).unwrap();
        close(test.ratio, 4.0, 1e-12);
        let back = ratio_test(&[1.0, 1.0], &[2.0, 8.0]).unwrap();
        close(back.ratio * test.ratio, 1.0, 1e-12);
        close(back.test.unwrap().low * test.test.unwrap().high, 1.0, 1e-9);
        close(back.test.unwrap().p, test.test.unwrap().p, 1e-12);
        assert_eq!(ratio_test(&[3.0], &[1.5]).unwrap().test, None);
        assert_eq!(ratio_test(&[0.0], &[1.5]), None);
        assert_eq!(ratio_test(&[], &[]), None);
        close(geometric_mean(&[1.0, 10.0, 100.0]).unwrap(), 10.0, 1e-12);
        assert_eq!(geometric_mean(&[]), None);
        assert_eq!(geometric_mean(&[1.0, -1.0]), None);
    }

    #[test]
    fn rank_correlation_sees_order_alone() {
        let rising = [1.0, 5.0, 6.0, 100.0];
        assert_eq!(rank_correlation(&rising, &[0.1, 0.2, 0.3, 0.4]), Some(1.0));
        assert_eq!(rank_correlation(&rising, &[4.0, 3.0, 2.0, -1.0]), Some(-1.0));
        // Ten pupils, IQ against hours of television: Σd² = 194, ρ = 1 − 6·194 / 990.
        let iq = [106.0, 100.0, 86.0, 101.0, 99.0, 103.0, 97.0, 113.0, 112.0, 110.0];
        let hours = [7.0, 27.0, 2.0, 50.0, 28.0, 29.0, 20.0, 12.0, 6.0, 17.0];
        close(rank_correlation(&iq, &hours).unwrap(), 1.0 - 6.0 * 194.0 / 990.0, 1e-12);
    }

    #[test]
    fn equal_values_share_their_rank() {
        assert_eq!(ranks(&[2.0, 1.0, 2.0, 3.0]), [2.5, 1.0, 2.5, 4.0]);
        // Pearson's correlation of the ranks 1, 2.5, 2.5, 4 and 1, 2, 3, 4.
        close(rank_correlation(&[1.0, 2.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]).unwrap(), 0.9f64.sqrt(), 1e-12);
        assert_eq!(rank_correlation(&[1.0, 1.0], &[1.0, 2.0]), None);
        assert_eq!(rank_correlation(&[1.0], &[1.0]), None);
        assert_eq!(rank_correlation(&[1.0, f64::INFINITY], &[1.0, 2.0]), None);
    }
}
