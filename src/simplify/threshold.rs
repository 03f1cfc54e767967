//! The driver of the instanced-model paper's Algorithm 1: a threshold on the length of edges instead of a queue of prices.
//!
//! ITS paper, Algorithm 1 and section 3.2: pairs are the edges shorter than the threshold; none left, it doubles; more than
//! ten, it halves; the least error of those pairs is contracted.
//!
//! Where the paper leaves gaps: the threshold starts at a thousandth of the radius; it does not halve where no edge would be
//! left; a pair whose geometric error exceeds the threshold is not valid either; of the valid pairs eleven are compared, among
//! the 32 shortest edges (a regular grid has thousands of one length); pairs that may not be contracted are left out until
//! something beside them changes.

use std::collections::BTreeSet;

use super::driver::vanishing;
use super::progressive::{Progressive, Recorder};
use super::{Locks, legal};
use crate::mesh::topology::{Contraction, Topology};
use crate::metric::{Price, Staged};
use crate::quadric::{dot, sub};

/// The first threshold, unit frame.
const FIRST: f64 = 1.0 / 1024.0;

/// Beyond this no edge is too long, and no error too large.
const LAST: f64 = 4.0;

/// More valid pairs than this halve the threshold.
const MOST: usize = 10;

/// Edges that are looked at for one contraction, the shortest.
const BATCH: usize = 32;

/// An edge by its length. Lengths are not negative, so their bits order as they do.
type Edge = (u64, u32, u32);

struct Run<'a, E> {
    surface: &'a mut Topology,
    metric: E,
    locks: &'a Locks,
    edges: BTreeSet<Edge>,
    threshold: f64,
}

/// Contracts until no pair is left.
pub fn run<E: Staged>(surface: &mut Topology, metric: E, locks: &Locks, mut recorder: Recorder) -> Progressive {
    recorder.costs_are(E::COST);
    let vertices = surface.positions.len();
    let mut run = Run { surface, metric, locks, edges: BTreeSet::new(), threshold: FIRST };
    let (mut neighbours, mut second) = (Vec::new(), Vec::new());
    for vertex in 0..vertices as u32 {
        run.surface.neighbours(vertex, &mut neighbours);
        run.insert(vertex, &neighbours);
    }
    let mut refused = vec![false; vertices];
    let mut done = Contraction::default();
    while let Some((a, b, price)) = run.next(&mut refused) {
        let (kept, gone) = if price.keep_second { (b, a) } else { (a, b) };
        run.surface.neighbours(gone, &mut neighbours);
        for &other in &neighbours {
            let edge = run.edge(gone, other);
            run.edges.remove(&edge);
        }
        run.metric.contracting(run.surface, kept, gone, &price);
        run.surface.contract(kept, gone, price.position, &mut done);
        run.metric.contracted(run.surface, &done);
        recorder.add(run.surface, &done, price.cost, run.metric.bound());
        run.surface.neighbours(kept, &mut neighbours);
        run.insert(kept, &neighbours);
        for &vertex in &neighbours {
            if std::mem::take(&mut refused[vertex as usize]) {
                run.surface.neighbours(vertex, &mut second);
                run.insert(vertex, &second);
            }
        }
    }
    recorder.finish()
}

impl<E: Staged> Run<'_, E> {
    fn edge(&self, a: u32, b: u32) -> Edge {
        let along = sub(self.surface.positions[b as usize], self.surface.positions[a as usize]);
        (dot(along, along).sqrt().to_bits(), a.min(b), a.max(b))
    }

    fn insert(&mut self, vertex: u32, others: &[u32]) {
        for &other in others {
            let edge = self.edge(vertex, other);
            self.edges.insert(edge);
        }
    }

    /// Edges shorter than `threshold`, no more than `most`.
    fn shorter(&self, threshold: f64, most: usize) -> Vec<Edge> {
        let all = threshold > LAST;
        let end = if all { (u64::MAX, 0, 0) } else { (threshold.to_bits(), 0, 0) };
        self.edges.range(..end).take(most).copied().collect()
    }

    /// The next pair to contract. Those that may not be are taken out on the way.
    fn next(&mut self, refused: &mut [bool]) -> Option<(u32, u32, Price)> {
        loop {
            let mut best: Option<(f64, u32, u32, Price)> = None;
            let (mut valid, mut out) = (0, 0);
            let edges = self.shorter(self.threshold, BATCH);
            let looked_at = edges.len();
            for (length, a, b) in edges {
                match self.stage(a, b) {
                    Stage::Never => {
                        self.edges.remove(&(length, a, b));
                        (refused[a as usize], refused[b as usize]) = (true, true);
                        out += 1;
                    }
                    Stage::OverLimit => {}
                    Stage::Valid(price) => {
                        valid += 1;
                        if best.as_ref().is_none_or(|(cost, ..)| price.cost < *cost) {
                            best = Some((price.cost, a, b, price));
                        }
                        if MOST < valid {
                            break;
                        }
                    }
                }
            }
            if MOST < valid && !self.shorter(self.threshold / 2.0, 1).is_empty() {
                self.threshold /= 2.0;
            }
            if let Some((_, a, b, price)) = best {
                return Some((a, b, price));
            }
            if looked_at == BATCH && 0 < out {
                // Others come up behind those that are out.
                continue;
            }
            if self.threshold > LAST {
                return None;
            }
            self.threshold *= 2.0;
        }
    }

    /// The geometric error first: of a pair beyond the limit no attribute is looked at.
    fn stage(&self, a: u32, b: u32) -> Stage {
        if !self.surface.are_joined(a, b) {
            // The last face on it is gone, or one of its ends.
            return Stage::Never;
        }
        let Some(geometric) = self.metric.geometric_error(self.surface, a, b) else { return Stage::Never };
        if geometric > self.threshold && self.threshold <= LAST {
            return Stage::OverLimit;
        }
        let Some(mut price) = self.locks.price(&self.metric, self.surface, a, b) else { return Stage::Never };
        if !legal::turns_gently(self.surface, a, b, price.position) {
            return Stage::Never;
        }
        price.cost += vanishing(self.surface, a, b).sqrt().sqrt();
        Stage::Valid(price)
    }
}

enum Stage {
    Never,
    OverLimit,
    Valid(Price),
}
