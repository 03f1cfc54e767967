//! Shares one triangle budget among several recorded sequences: the cheapest contraction anywhere comes first. Among the parts
//! of a mesh ([`Allocation`]), or among the meshes of a scene ([`SceneShares`]).
//!
//! Pure; knows sequences only. The instanced-model papers' scene-wide queue (IAS), restated on cuts: no mesh is
//! simplified again.

mod scene;

use crate::simplify::progressive::Progressive;

pub use scene::{Counts, SceneMesh, ScenePart, SceneShares};

/// The instances of one sub-mesh in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instances {
    /// How many there are, 1 or more.
    pub count: usize,
    /// The largest scale among their transforms, more than 0: by it an error of the sub-mesh is seen at most.
    pub largest_scale: f64,
}

impl Default for Instances {
    fn default() -> Self {
        Self { count: 1, largest_scale: 1.0 }
    }
}

/// The cuts of several sequences, for any number of triangles in sum.
#[derive(Debug)]
pub struct Allocation {
    /// Cheapest first; steps of one sequence stay in their order.
    order: Vec<Ranked>,
    triangles: usize,
    sequences: usize,
}

#[derive(Debug)]
struct Ranked {
    /// Never falls.
    cost: f32,
    sequence: u32,
    /// Triangles that the step saves, in all its instances.
    saves: u64,
}

impl Allocation {
    /// Ranks all steps of `sequences` by cost. A step costs at least as much as those before it in its sequence.
    pub fn new(sequences: &[&Progressive]) -> Self {
        Self::of_instances(&sequences.iter().map(|&s| (s, Instances::default())).collect::<Vec<_>>())
    }

    /// Ranks all steps of a scene's sequences as IAS does: the error of a step, which must be a length (metric `ias`, for each
    /// triangle saved), grows with the largest scale among the instances, and what it saves with their number.
    pub fn of_instances(sequences: &[(&Progressive, Instances)]) -> Self {
        let mut ranked: Vec<(f64, u32, u32, u64)> = Vec::new();
        for (index, (sequence, instances)) in sequences.iter().enumerate() {
            let weight = instances.largest_scale / instances.count as f64;
            let (mut dearest, mut before) = (0.0f32, sequence.triangles);
            for (number, step) in sequence.steps.iter().enumerate() {
                dearest = dearest.max(step.cost);
                let saves = u64::from(before - step.triangles) * instances.count as u64;
                ranked.push((f64::from(dearest) * weight, index as u32, number as u32, saves));
                before = step.triangles;
            }
        }
        if 1 < sequences.len() {
            ranked.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        }
        Self {
            order: ranked
                .into_iter()
                .map(|(cost, sequence, _, saves)| Ranked { cost: cost as f32, sequence, saves })
                .collect(),
            triangles: sequences.iter().map(|(s, instances)| s.triangles as usize * instances.count).sum(),
            sequences: sequences.len(),
        }
    }

    /// Number of steps to take of each sequence so that at most `triangles` are left in sum, or as near as they go.
    pub fn cuts(&self, triangles: usize) -> Vec<usize> {
        let mut cuts = vec![0; self.sequences];
        let mut left = self.triangles;
        for &Ranked { sequence, saves, .. } in &self.order {
            if left <= triangles {
                break;
            }
            cuts[sequence as usize] += 1;
            left -= saves as usize;
        }
        cuts
    }
}

impl Allocation {
    /// All steps in order.
    fn priced(&self) -> &[Ranked] {
        &self.order
    }

    /// Steps of all sequences.
    pub fn steps(&self) -> usize {
        self.order.len()
    }

    /// Number of steps of each sequence among the cheapest `steps` of all.
    pub fn cuts_after(&self, steps: usize) -> Vec<usize> {
        let mut cuts = vec![0; self.sequences];
        self.order[..steps.min(self.order.len())].iter().for_each(|step| cuts[step.sequence as usize] += 1);
        cuts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simplify::progressive::Step;

    pub(super) fn sequence(costs: &[f32]) -> Progressive {
        let triangles = costs.len() as u32 * 2;
        let step =
            |(i, &cost): (usize, &f32)| Step { cost, triangles: triangles - 2 * (i as u32 + 1), ..Step::default() };
        Progressive { triangles, steps: costs.iter().enumerate().map(step).collect(), ..Progressive::default() }
    }

    #[test]
    fn the_cheaper_sequence_gives_more() {
        let (a, b) = (sequence(&[1.0, 2.0, 9.0]), sequence(&[3.0, 4.0, 5.0]));
        let all = Allocation::new(&[&a, &b]);
        assert_eq!(all.cuts(12), [0, 0]);
        assert_eq!(all.cuts(8), [2, 0]);
        assert_eq!(all.cuts(7), [2, 1]);
        assert_eq!(all.cuts(2), [2, 3]);
        assert_eq!(all.cuts(0), [3, 3]);
    }

    #[test]
    fn instances_weigh_by_their_scale_and_their_number() {
        let (a, b) = (sequence(&[1.0, 2.0, 9.0]), sequence(&[3.0, 4.0, 5.0]));
        let of = |count, largest_scale| Instances { count, largest_scale };
        // Four times as many of the second: its steps cost a quarter for each triangle saved.
        let many = Allocation::of_instances(&[(&a, of(1, 1.0)), (&b, of(4, 1.0))]);
        assert_eq!(many.cuts(6 + 4 * 6), [0, 0]);
        assert_eq!(many.cuts(6 + 4 * 4), [0, 1]);
        assert_eq!(many.cuts(4), [1, 3]);
        // Ten times as large: its errors are seen ten times as large, so it waits.
        let large = Allocation::of_instances(&[(&a, of(1, 10.0)), (&b, of(1, 1.0))]);
        assert_eq!(large.cuts(6), [0, 3]);
        assert_eq!(large.cuts(4), [1, 3]);
    }

    #[test]
    fn a_cheap_step_behind_a_dear_one_waits() {
        let (a, b) = (sequence(&[5.0, 0.0]), sequence(&[1.0, 6.0]));
        let all = Allocation::new(&[&a, &b]);
        assert_eq!(all.cuts(6), [0, 1]);
        assert_eq!(all.cuts(2), [2, 1]);
    }
}
