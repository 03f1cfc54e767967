//! Shares a budget among the meshes of a scene: the contraction that the scene would miss least, anywhere in it, comes first.
//!
//! **Price.** E, the sum of a mesh's costs so far, is squared distances times areas, hence √E the distance that its surface is off
//! times the root of its area, an area: what the scene loses with a step of cost c is c / √E in the mesh's own units, times the square of
//! the largest scale that the mesh is shown at. So the scene loses Σ √E, which goes with what pictures lose: a surface that T triangles
//! approximate has faces of size h ~ T^(-1/2), lies h² off, and its normals are h off, so that squared differences of shading (area · h²) and
//! those of outlines (length · h²) grow alike. Costs that are lengths go with h² themselves. c alone, and other powers of the
//! mesh's size in the scene, were measured too: `docs/budgets.md`.
//!
//! **Number.** How often a mesh is drawn cancels out where triangles count: with it grows what a step saves, and what it costs.

use super::{Allocation, Instances};
use crate::metric::CostUnit;
use crate::simplify::progressive::Progressive;

/// What a budget counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// Triangles of all instances.
    Triangles,
    /// Bytes of vertices and indices of all distinct meshes, each once.
    Bytes,
}

/// One mesh of a scene.
#[derive(Clone, Debug)]
pub struct SceneMesh<'a> {
    /// Its parts that have a sequence.
    pub parts: Vec<ScenePart<'a>>,
    /// Triangles of parts that stay as they are.
    pub fixed: usize,
    /// Bytes of parts that stay as they are.
    pub fixed_bytes: u64,
    /// What the costs of its sequences are.
    pub unit: CostUnit,
    /// How often it is drawn, and how large.
    pub instances: Instances,
}

/// One part of a mesh.
#[derive(Clone, Debug)]
pub struct ScenePart<'a> {
    /// Its sequence.
    pub sequence: &'a Progressive,
    /// Bytes of its vertices and indices after some numbers of steps, from 0 on: these rise, and the bytes never do. Between two of
    /// them bytes fall evenly. Empty where bytes do not count.
    pub bytes: Vec<(usize, u64)>,
}

impl ScenePart<'_> {
    /// Bytes after the first `steps`.
    fn bytes(&self, steps: usize) -> u64 {
        let next = self.bytes.partition_point(|(at, _)| *at <= steps);
        let Some(&(at, bytes)) = next.checked_sub(1).and_then(|last| self.bytes.get(last)) else { return 0 };
        match self.bytes.get(next) {
            Some(&(to, fewer)) => bytes - (bytes - fewer) * (steps - at) as u64 / (to - at) as u64,
            None => bytes,
        }
    }
}

impl SceneMesh<'_> {
    /// What the scene loses with a step of this cost, after which the costs of the mesh add up to `sum`.
    fn price(&self, cost: f64, sum: f64) -> f64 {
        let scale = self.instances.largest_scale;
        match self.unit {
            CostUnit::SquareTimesArea if 0.0 < sum => cost / sum.sqrt() * scale * scale,
            CostUnit::SquareTimesArea => 0.0,
            CostUnit::Length => cost * scale,
        }
    }
}

/// What the meshes of a scene keep, for any budget.
#[derive(Debug)]
pub struct SceneShares {
    /// The cheapest first; steps of one mesh in their order.
    order: Vec<Step>,
    /// Triangles of one instance of each mesh.
    triangles: Vec<usize>,
    /// What all meshes take of a budget.
    whole: u64,
}

#[derive(Debug)]
struct Step {
    price: f64,
    /// Of the budget.
    frees: u64,
    mesh: u32,
    /// Triangles, in one instance.
    saves: u32,
}

impl SceneShares {
    /// Ranks the steps of all meshes.
    pub fn new(meshes: &[SceneMesh], counts: Counts) -> Self {
        let mut shares = Self { order: Vec::new(), triangles: Vec::new(), whole: 0 };
        for (index, mesh) in (0..).zip(meshes) {
            let sequences: Vec<&Progressive> = mesh.parts.iter().map(|part| part.sequence).collect();
            // The steps that a level of the mesh takes, in the same order.
            let allocation = Allocation::new(&sequences);
            let triangles = mesh.fixed + allocation.triangles;
            let instances = mesh.instances.count as u64;
            let moving: u64 = mesh.parts.iter().map(|part| part.bytes(0)).sum();
            let (weight, whole) = match counts {
                Counts::Triangles => (1.0, triangles as u64 * instances),
                // Errors are as many as instances; the bytes of a triangle are there once.
                Counts::Bytes => {
                    let triangle = moving as f64 / allocation.triangles.max(1) as f64;
                    (instances as f64 / triangle, mesh.fixed_bytes + moving)
                }
            };
            let (mut left, mut sum, mut price) = (triangles, 0.0, 0.0f64);
            let mut taken = vec![0; mesh.parts.len()];
            for step in allocation.priced() {
                left -= step.saves as usize;
                if left == 0 {
                    // A level that shows nothing is no level.
                    break;
                }
                let part = &mesh.parts[step.sequence as usize];
                let at = &mut taken[step.sequence as usize];
                *at += 1;
                let frees = match counts {
                    Counts::Triangles => step.saves * instances,
                    Counts::Bytes => part.bytes(*at - 1) - part.bytes(*at),
                };
                let cost = f64::from(step.cost);
                sum += cost;
                price = price.max(mesh.price(cost, sum) * weight);
                shares.order.push(Step { price, frees, mesh: index, saves: step.saves as u32 });
            }
            shares.triangles.push(triangles);
            shares.whole += whole;
        }
        // Stable: steps of one mesh stay in their order, and of equals the first mesh gives first.
        shares.order.sort_by(|a, b| a.price.total_cmp(&b.price));
        shares
    }

    /// Triangles of each mesh, one instance, so that all together take at most `budget`, or as little as they can; and what they
    /// take. A larger budget never leaves fewer to any mesh.
    pub fn share(&self, budget: u64) -> (Vec<usize>, u64) {
        let (mut left, mut taken) = (self.triangles.clone(), self.whole);
        for step in &self.order {
            if taken <= budget {
                break;
            }
            left[step.mesh as usize] -= step.saves as usize;
            taken -= step.frees;
        }
        (left, taken)
    }

    /// What the meshes take of a budget as they are.
    pub fn whole(&self) -> u64 {
        self.whole
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::sequence;
    use super::*;

    fn mesh(sequence: &Progressive) -> SceneMesh<'_> {
        SceneMesh {
            parts: vec![ScenePart { sequence, bytes: vec![] }],
            fixed: 0,
            fixed_bytes: 0,
            unit: CostUnit::SquareTimesArea,
            instances: Instances::default(),
        }
    }

    fn shown(count: usize, largest_scale: f64) -> Instances {
        Instances { count, largest_scale }
    }

    fn shares(meshes: &[SceneMesh]) -> SceneShares {
        SceneShares::new(meshes, Counts::Triangles)
    }

    fn left(shares: &SceneShares, budget: u64) -> Vec<usize> {
        shares.share(budget).0
    }

    /// Prices for radius and scale 1: 1, 2/√3 = 1.15, then 9/√12, which leaves nothing; and 3/√3 = 1.73, 4/√7 = 1.51, held at 1.73.
    const COSTS: [[f32; 3]; 2] = [[1.0, 2.0, 9.0], [3.0, 4.0, 5.0]];

    #[test]
    fn the_cheapest_step_of_the_scene_comes_first_and_something_is_left() {
        let [a, b] = COSTS.map(|costs| sequence(&costs));
        let both = shares(&[mesh(&a), mesh(&b)]);
        for (budget, expected) in [(20, [6, 6]), (12, [6, 6]), (11, [4, 6]), (8, [2, 6]), (7, [2, 4]), (4, [2, 2])] {
            assert_eq!(left(&both, budget), expected, "{budget}");
        }
        // Nobody goes below the last step before nothing; a mesh with parts that stay may.
        assert_eq!(both.share(0), (vec![2, 2], 4));
        let based = SceneMesh { fixed: 5, ..mesh(&a) };
        assert_eq!(shares(&[based, mesh(&b)]).share(0), (vec![5, 2], 7));
        assert_eq!(shares(&[SceneMesh { parts: vec![], fixed: 7, ..mesh(&a) }]).share(3), (vec![7], 7));
        assert_eq!(left(&shares(&[mesh(&b), mesh(&b)]), 11), [4, 6], "of equals the first");
    }

    #[test]
    fn errors_weigh_by_the_largest_scale() {
        let [a, b] = COSTS.map(|costs| sequence(&costs));
        // Half as large: a quarter of 1.73 is less than 1.
        let halved = shares(&[mesh(&a), SceneMesh { instances: shown(1, 0.5), ..mesh(&b) }]);
        assert_eq!(left(&halved, 8), [6, 2]);
        // The same mesh in other units, twice as large: its costs are 16 times as large, its scale is half.
        let c = sequence(&COSTS[1].map(|cost| 16.0 * cost));
        let same = shares(&[mesh(&a), SceneMesh { instances: shown(1, 0.5), ..mesh(&c) }]);
        let plain = shares(&[mesh(&a), mesh(&b)]);
        assert!((0..=12).all(|budget| left(&same, budget) == left(&plain, budget)));
        // Costs that are lengths: 1 and 2, and 3 and 4 times 0.4.
        let length = |mesh| SceneMesh { unit: CostUnit::Length, ..mesh };
        let lengths = shares(&[length(mesh(&a)), length(SceneMesh { instances: shown(1, 0.4), ..mesh(&b) })]);
        assert_eq!([10, 8, 6, 4].map(|budget| left(&lengths, budget)), [[4, 6], [4, 4], [4, 2], [2, 2]]);
        // What costs nothing goes first, whatever it is.
        let free = sequence(&[0.0, 0.0, 0.0]);
        assert_eq!(left(&shares(&[mesh(&a), mesh(&free)]), 8), [6, 2]);
    }

    #[test]
    fn instances_count_for_what_is_drawn_and_not_for_the_order() {
        let [a, b] = COSTS.map(|costs| sequence(&costs));
        let shares = shares(&[mesh(&a), SceneMesh { instances: shown(4, 1.0), ..mesh(&b) }]);
        assert_eq!(shares.whole(), 6 + 4 * 6);
        for (budget, expected) in [(30, [6, 6]), (28, [4, 6]), (26, [2, 6]), (25, [2, 4]), (18, [2, 4]), (17, [2, 2])] {
            let (triangles, taken) = shares.share(budget);
            assert_eq!((triangles, taken), (expected.to_vec(), (expected[0] + 4 * expected[1]) as u64), "{budget}");
        }
    }

    #[test]
    fn bytes_are_there_once_and_errors_as_often_as_instances() {
        let [a, b] = COSTS.map(|costs| sequence(&costs));
        // 18 bytes a triangle, and 42.
        let stored = |sequence, bytes: [u64; 2]| SceneMesh {
            parts: vec![ScenePart { sequence, bytes: vec![(0, bytes[0]), (3, bytes[1])] }],
            fixed_bytes: 100,
            ..mesh(sequence)
        };
        let plain = SceneShares::new(&[stored(&a, [108, 36]), stored(&b, [252, 108])], Counts::Bytes);
        let whole = 200 + 108 + 252;
        assert_eq!(plain.whole(), whole);
        // A triangle of the second mesh takes 42 bytes, of the first 18: its 1.73 count as 0.74 do there.
        assert_eq!(plain.share(whole), (vec![6, 6], whole));
        assert_eq!(plain.share(whole - 1), (vec![6, 4], whole - 48));
        assert_eq!(plain.share(whole - 48 - 48 - 1), (vec![4, 2], whole - 48 - 48 - 24));
        // Twice as many of it are to be seen, and take no more bytes.
        let twice = SceneMesh { instances: shown(2, 1.0), ..stored(&b, [252, 108]) };
        let two = SceneShares::new(&[stored(&a, [108, 36]), twice], Counts::Bytes);
        assert_eq!(two.share(whole - 1), (vec![4, 6], whole - 24));
        assert_eq!(two.share(0), (vec![2, 2], whole - 2 * 48 - 2 * 24));
    }

    #[test]
    fn parts_of_a_mesh_share_as_its_levels_do() {
        let (a, b) = (sequence(&[1.0, 8.0, 9.0]), sequence(&[3.0, 2.0, 5.0]));
        let parts = [&a, &b].map(|sequence| ScenePart { sequence, bytes: vec![] });
        let shares = shares(&[SceneMesh { parts: parts.to_vec(), ..mesh(&a) }]);
        let allocation = Allocation::new(&[&a, &b]);
        for budget in 1..=12 {
            let cuts = allocation.cuts(budget);
            let kept = a.triangles_after(cuts[0]) + b.triangles_after(cuts[1]);
            assert_eq!(left(&shares, budget as u64), [kept.max(2)], "{budget}");
        }
    }

    #[test]
    fn more_never_leaves_less() {
        // Costs that rise and fall, from a fixed sequence of numbers.
        let mut state = 12345u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as f32 / 1000.0
        };
        let sequences: Vec<Progressive> =
            (0..5).map(|n| sequence(&(0..8 + 5 * n).map(|_| next()).collect::<Vec<_>>())).collect();
        let bytes = |sequence: &Progressive| {
            let steps = sequence.steps.len();
            vec![(0, 70 * steps as u64), (steps / 2, 300), (steps, 100)]
        };
        let meshes: Vec<SceneMesh> = (sequences.iter().enumerate())
            .map(|(n, sequence)| SceneMesh {
                parts: vec![ScenePart { sequence, bytes: bytes(sequence) }],
                instances: shown(1 + n, 0.5 + n as f64),
                ..mesh(sequence)
            })
            .collect();
        for counts in [Counts::Triangles, Counts::Bytes] {
            let shares = SceneShares::new(&meshes, counts);
            let (least, _) = shares.share(0);
            let mut before = least.clone();
            for budget in 0..=shares.whole() {
                let (now, taken) = shares.share(budget);
                assert!(
                    before.iter().zip(&now).all(|(before, now)| before <= now),
                    "{budget}: {before:?} then {now:?}"
                );
                assert!(taken <= budget || now == least, "{budget}: {now:?}");
                before = now;
            }
            assert!(before.iter().zip(&sequences).all(|(&all, s)| all == s.triangles as usize));
        }
    }
}
