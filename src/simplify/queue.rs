//! The priority queue of pairs: least cost first, ties by vertex numbers; entries of merged vertices die by stamp.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Ordered by cost, then by the two vertices. Costs are not negative, so their bits order as they do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    cost: u32,
    a: u32,
    b: u32,
    /// Sum of the stamps of both ends when the entry was made.
    stamp: u32,
}

/// Pairs by price.
#[derive(Debug)]
pub struct Queue {
    heap: BinaryHeap<Reverse<Entry>>,
    staged: Vec<Reverse<Entry>>,
    /// Number of merges into each vertex; [`GONE`] if the vertex is gone.
    stamps: Vec<u32>,
}

const GONE: u32 = u32::MAX;

fn bits(cost: f64) -> u32 {
    // −0 would order above everything.
    (cost.max(0.0) as f32 + 0.0).to_bits()
}

impl Queue {
    /// An empty queue over that many vertices.
    pub fn new(vertices: usize) -> Self {
        Self { heap: BinaryHeap::new(), staged: Vec::new(), stamps: vec![0; vertices] }
    }

    fn entry(&self, a: u32, b: u32, cost: f64) -> Reverse<Entry> {
        let (a, b) = (a.min(b), a.max(b));
        let stamp = self.stamps[a as usize].wrapping_add(self.stamps[b as usize]);
        Reverse(Entry { cost: bits(cost), a, b, stamp })
    }

    /// Adds a pair without ordering it yet; [`Self::heapify`] orders all staged pairs at once.
    pub fn stage(&mut self, a: u32, b: u32, cost: f64) {
        let entry = self.entry(a, b, cost);
        self.staged.push(entry);
    }

    /// Orders what was staged, in linear time.
    pub fn heapify(&mut self) {
        self.heap = BinaryHeap::from(std::mem::take(&mut self.staged));
    }

    /// Adds a pair.
    #[inline]
    pub fn push(&mut self, a: u32, b: u32, cost: f64) {
        let entry = self.entry(a, b, cost);
        self.heap.push(entry);
    }

    /// The cheapest pair whose ends have not been merged since, with the cost it was entered at.
    #[inline]
    pub fn pop(&mut self) -> Option<(u32, u32, u32)> {
        while let Some(Reverse(entry)) = self.heap.pop() {
            let (a, b) = (self.stamps[entry.a as usize], self.stamps[entry.b as usize]);
            if a != GONE && b != GONE && a.wrapping_add(b) == entry.stamp {
                return Some((entry.a, entry.b, entry.cost));
            }
        }
        None
    }

    /// Whether a pair just popped at `entered` may go ahead at `cost`: it is no dearer than it was, or than the next.
    #[inline]
    pub fn is_next(&self, cost: f64, entered: u32) -> bool {
        let cost = bits(cost);
        cost <= entered || self.heap.peek().is_none_or(|next| cost <= next.0.cost)
    }

    /// `gone` was merged into `kept`: all their entries are void.
    #[inline]
    pub fn merged(&mut self, kept: u32, gone: u32) {
        self.stamps[gone as usize] = GONE;
        self.stamps[kept as usize] += 1;
    }
}
