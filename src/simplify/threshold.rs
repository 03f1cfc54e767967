//! The driver of the instanced-model paper's Algorithm 1: a threshold on the length of edges instead of a queue of prices.
//!
//! ITS paper, Algorithm 1 and section 3.2: pairs are the edges shorter than the threshold; none left, it doubles; more than
//! ten, it halves; the least error of those pairs is contracted.
//!
//! Where the paper leaves gaps: the threshold starts at a thousandth of the radius; it does not halve where nothing would be
//! left, and then the ten shortest edges are looked at (a regular grid has thousands of one length); a pair whose geometric
//! error exceeds the threshold is not valid either; pairs that may not be contracted are left out until something beside
//! them changes.

use std::collections::BTreeSet;

use super::progressive::{Progressive, Recorder};
use super::{Locks, legal, vanishing};
use crate::mesh::topology::{Contraction, Topology};
use crate::metric::{Price, Staged};
use crate::quadric::{dot, sub};

/// The first threshold, unit frame.
const FIRST: f64 = 1.0 / 1024.0;

/// Beyond this no edge is too long, and no error too large.
const LAST: f64 = 4.0;

/// More valid pairs than this halve the threshold.
const MOST: usize = 10;

/// Edges that are taken from the set at once.
const BATCH: usize = 64;

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
        recorder.record(run.surface, &done, &price, run.metric.bound());
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
        while MOST < self.shorter(self.threshold, MOST + 1).len() && !self.shorter(self.threshold / 2.0, 1).is_empty() {
            self.threshold /= 2.0;
        }
        loop {
            let mut best: Option<(f64, u32, u32, Price)> = None;
            let mut waiting = 0;
            let edges = self.shorter(self.threshold, BATCH);
            let more = edges.len() == BATCH;
            for (_, a, b) in edges {
                match self.stage(a, b) {
                    Stage::Never => {
                        let edge = self.edge(a, b);
                        self.edges.remove(&edge);
                        (refused[a as usize], refused[b as usize]) = (true, true);
                        continue;
                    }
                    Stage::OverLimit => {}
                    Stage::Valid(price) => {
                        if best.as_ref().is_none_or(|(cost, ..)| price.cost < *cost) {
                            best = Some((price.cost, a, b, price));
                        }
                    }
                }
                waiting += 1;
                if waiting == MOST && (best.is_some() || self.threshold <= LAST) {
                    break;
                }
            }
            if let Some((_, a, b, price)) = best {
                return Some((a, b, price));
            }
            if more && waiting < MOST {
                // Nearly all of them could not be contracted, and are out.
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
