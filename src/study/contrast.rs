//! Two algorithms beside each other: over all cells that both have, and run by run within a cell.

use super::record::{Measure, Record};
use super::statistics::{PairedTest, RatioTest, paired_test, ratio_test};

/// One quantity of one algorithm against another's.
#[derive(Clone, Debug, PartialEq)]
pub struct Contrast {
    /// Index of the algorithm.
    pub first: usize,
    /// Index of what it is compared with.
    pub second: usize,
    /// The quantity.
    pub measure: Measure,
    /// First ÷ second over meshes and targets.
    pub test: RatioTest,
}

/// Quantities whose ratios are told: less is better, but for the count, which says whether the rest is fair.
pub const MEASURES: [Measure; 6] =
    [Measure::Triangles, Measure::DRms, Measure::DistanceRms, Measure::Wall, Measure::Cpu, Measure::Resident];

/// Each algorithm against the baseline, and each matched one against the algorithm whose counts it was asked for.
pub fn pairs(record: &Record) -> Vec<(usize, usize)> {
    let index = |name: &str| record.algorithms.iter().position(|algorithm| algorithm.name == name);
    let against = |(number, algorithm): (usize, &super::record::AlgorithmFacts)| {
        let other = match &algorithm.matched {
            Some(name) => index(name)?,
            None => record.baseline,
        };
        (other != number).then_some((number, other))
    };
    record.algorithms.iter().enumerate().filter_map(against).collect()
}

/// All ratios that can be formed.
pub fn contrasts(record: &Record) -> Vec<Contrast> {
    let mut out = Vec::new();
    for (first, second) in pairs(record) {
        for measure in MEASURES {
            let (a, b) = common(record, measure, first, second);
            if let Some(test) = ratio_test(&a, &b) {
                out.push(Contrast { first, second, measure, test });
            }
        }
    }
    out
}

/// Means of a quantity in the cells where both have one above 0.
pub fn common(record: &Record, measure: Measure, first: usize, second: usize) -> (Vec<f64>, Vec<f64>) {
    let places = (0..record.meshes.len()).flat_map(|mesh| (0..record.targets.len()).map(move |target| (mesh, target)));
    let both = places.filter_map(|(mesh, target)| {
        let mean = |algorithm| record.cell(mesh, target, algorithm).mean(measure).filter(|&mean| 0.0 < mean);
        Some((mean(first)?, mean(second)?))
    });
    both.unzip()
}

/// Wall time of two algorithms on one mesh and target, runs of the same round paired.
pub fn paired_times(record: &Record, mesh: usize, target: usize, first: usize, second: usize) -> Option<PairedTest> {
    let values = |algorithm| record.cell(mesh, target, algorithm).values(Measure::Wall);
    let (a, b) = (values(first), values(second));
    let rounds = a.len().min(b.len());
    paired_test(&a[..rounds], &b[..rounds])
}

/// Algorithms that no other beats in both of two quantities, by the first; `points` are pairs of quantities, less is
/// better.
pub fn frontier(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)).then(a.cmp(&b))
    });
    let mut best = f64::INFINITY;
    order.retain(|&index| {
        let is_better = points[index].1 < best;
        best = best.min(points[index].1);
        is_better
    });
    order
}

/// Triangles that an algorithm needs for an image difference: between two levels on a straight line of logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Needed {
    /// About this many.
    About(f64),
    /// More than the finest level that was measured has.
    MoreThan(u64),
    /// No more than the coarsest level that was measured has.
    AtMost(u64),
}

/// `levels` are pairs of triangles and `d_RMS`. `None` if there are none.
pub fn needed(levels: &[(u64, f64)], threshold: f64) -> Option<Needed> {
    let mut levels = levels.to_vec();
    levels.sort_by_key(|level| std::cmp::Reverse(level.0));
    let &(finest, difference) = levels.first()?;
    if threshold < difference {
        return Some(Needed::MoreThan(finest));
    }
    for pair in levels.windows(2) {
        let ((fine, within), (coarse, over)) = (pair[0], pair[1]);
        if threshold < over {
            if within <= 0.0 || fine == coarse {
                return Some(Needed::About(fine as f64));
            }
            let share = (libm::log(threshold) - libm::log(within)) / (libm::log(over) - libm::log(within));
            let (fine, coarse) = (libm::log(fine as f64), libm::log(coarse as f64));
            return Some(Needed::About(libm::exp(fine + share * (coarse - fine))));
        }
    }
    levels.last().map(|&(coarsest, _)| Needed::AtMost(coarsest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frontier_is_what_nobody_beats() {
        let points = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.5), (4.0, 1.0)];
        assert_eq!(frontier(&points), [0, 1, 4]);
        assert_eq!(frontier(&[]), [0usize; 0]);
    }

    #[test]
    fn needed_triangles_lie_between_levels() {
        let levels = [(100, 8.0), (1000, 2.0), (10_000, 0.5)];
        let Some(Needed::About(found)) = needed(&levels, 4.0) else { panic!("it lies between two levels") };
        assert!((found - 100.0 * 10f64.sqrt()).abs() < 1e-6, "{found}");
        assert_eq!(needed(&levels, 0.4), Some(Needed::MoreThan(10_000)));
        assert_eq!(needed(&levels, 8.0), Some(Needed::AtMost(100)));
        assert_eq!(needed(&[], 8.0), None);
        assert_eq!(needed(&[(10, 1.0), (100, 0.0)], 0.5), Some(Needed::About(100.0)));
    }
}
