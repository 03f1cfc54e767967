//! The driver: takes the cheapest legal pair, contracts it, writes it down, until nothing is left to contract.
//!
//! Generic over the metric and never knows which one it runs. Deterministic: ties go by vertex number.

use super::joins::Joins;
use super::progressive::Recorder;
use super::queue::{Entry, Queue};
use super::{Locks, legal};
use crate::mesh::topology::{Contraction, Topology};
use crate::metric::{CostUnit, ErrorMetric, Price};
use crate::quadric::{cross, dot, lerp, sub};

/// Keeps what was done.
pub(super) trait Record {
    /// A contraction has been done in `surface`, with its wedge values set; `bound` is the metric's, if it has one.
    fn record(&mut self, surface: &Topology, done: &Contraction, price: &Price, bound: Option<f64>);
}

impl Record for Recorder {
    fn record(&mut self, surface: &Topology, done: &Contraction, price: &Price, bound: Option<f64>) {
        self.add(surface, done, price.cost, bound);
    }
}

/// A run on its way.
pub(super) struct Driver<'a, E, R> {
    surface: &'a mut Topology,
    metric: E,
    locks: &'a Locks,
    queue: Queue,
    /// Pairs without an edge, for metrics that join parts.
    joins: Joins,
    /// Ends of pairs without a price, for metrics that refuse for now.
    waiting: Vec<u32>,
    recorder: R,
    done: Contraction,
}

/// Stamp of a vertex that is gone.
const GONE: u32 = u32::MAX;

/// Pairs whose surroundings are read before their turn.
const AHEAD: usize = 8;

impl<'a, E: ErrorMetric, R: Record> Driver<'a, E, R> {
    pub(super) fn new(surface: &'a mut Topology, metric: E, locks: &'a Locks, recorder: R) -> Self {
        Self {
            waiting: Vec::new(),
            queue: Queue::new(),
            joins: Joins::new(surface.positions.len(), E::JOINS),
            recorder,
            done: Contraction::default(),
            surface,
            metric,
            locks,
        }
    }

    fn price(&self, a: u32, b: u32) -> Option<Price> {
        let mut price = self.locks.price(&self.metric, self.surface, a, b)?;
        price.cost += self.vanishing(a, b);
        Some(price)
    }

    /// [`vanishing`] in the metric's unit.
    #[inline]
    fn vanishing(&self, a: u32, b: u32) -> f64 {
        let cost = vanishing(self.surface, a, b);
        match E::COST {
            CostUnit::SquareTimesArea => cost,
            CostUnit::Length => cost.sqrt().sqrt(),
        }
    }

    /// Enters every pair.
    fn fill(&mut self) {
        let mut neighbours = Vec::new();
        for a in 0..self.surface.positions.len() as u32 {
            self.surface.neighbours(a, &mut neighbours);
            for &b in neighbours.iter().filter(|&&b| a < b) {
                if let Some(price) = self.locks.price(&self.metric, self.surface, a, b) {
                    self.queue.push(a, b, price.cost, 0);
                } else if E::REFUSES_FOR_NOW {
                    self.waiting.extend([a, b]);
                }
            }
        }
    }

    fn contract(&mut self, a: u32, b: u32, price: &Price) -> [u32; 2] {
        let (kept, gone) = if price.keep_second { (b, a) } else { (a, b) };
        self.metric.contracting(self.surface, kept, gone, price);
        self.surface.contract(kept, gone, price.position, &mut self.done);
        self.metric.contracted(self.surface, &self.done);
        self.recorder.record(self.surface, &self.done, price, self.metric.bound());
        [kept, gone]
    }

    /// Goes on until at most `enough` faces are left, or no pair. All pairs at the merged vertex are priced anew and entered
    /// again. Other prices are not kept up to date behind the queue's back: a pair is priced again when its turn comes.
    pub(super) fn run(mut self, enough: usize) -> R {
        self.fill();
        let vertices = self.surface.positions.len();
        // Number of merges into each vertex. An entry carries the sum of both ends; another sum means it is void.
        let mut stamps = vec![0u32; vertices];
        // Ends of pairs that were illegal when their turn came: tried again when something beside them changes.
        let mut refused = vec![false; vertices];
        let (mut neighbours, mut second) = (Vec::new(), Vec::new());
        let mut until_touch = 0;
        while let Some(Entry { a, b, tag }) = self.next(&stamps) {
            if until_touch == 0 {
                self.touch_ahead(&stamps);
                until_touch = AHEAD;
            }
            until_touch -= 1;
            let now = [stamps[a as usize], stamps[b as usize]];
            if now.contains(&GONE) || now[0].wrapping_add(now[1]) != tag {
                continue;
            }
            self.metric.prepare(self.surface, a, b);
            let Some(price) = self.price(a, b) else {
                if E::REFUSES_FOR_NOW {
                    (refused[a as usize], refused[b as usize]) = (true, true);
                }
                continue;
            };
            if !self.queue.is_due(price.cost) {
                self.queue.push(a, b, price.cost, tag);
                continue;
            }
            let Some(price) = self.legal_price([a, b], price) else {
                (refused[a as usize], refused[b as usize]) = (true, true);
                continue;
            };
            // The middle may be far dearer than the best place: it waits for its own turn.
            if !self.queue.is_due(price.cost) {
                self.queue.push(a, b, price.cost, tag);
                continue;
            }
            if E::REFUSES_FOR_NOW {
                self.waiting.drain(..).for_each(|vertex| refused[vertex as usize] = true);
            }
            let [kept, gone] = self.contract(a, b, &price);
            if 0 < enough && self.surface.alive <= enough {
                break;
            }
            stamps[gone as usize] = GONE;
            stamps[kept as usize] += 1;
            self.surface.neighbours(kept, &mut neighbours);
            if E::JOINS {
                self.joins.merged(kept, gone, self.surface, &mut neighbours);
            }
            self.push_all(&stamps, kept, &neighbours);
            for &vertex in &neighbours {
                if std::mem::take(&mut refused[vertex as usize]) {
                    self.surface.neighbours(vertex, &mut second);
                    self.push_all(&stamps, vertex, &second);
                }
            }
        }
        self.recorder
    }

    /// The next pair. Where everything left costs more than the threshold, parts within twice of it may be joined.
    #[inline]
    fn next(&mut self, stamps: &[u32]) -> Option<Entry> {
        if E::JOINS {
            while let Some(limit) = self.joins.limit()
                && self.queue.is_above(limit)
            {
                for [a, b] in self.joins.widen(self.surface) {
                    self.push_all(stamps, a, &[b]);
                }
            }
        }
        self.queue.pop()
    }

    /// Reads what the next pairs need, all at once.
    fn touch_ahead(&self, stamps: &[u32]) {
        let current = |e: &&Entry| stamps[e.a as usize].wrapping_add(stamps[e.b as usize]) == e.tag;
        let ahead = self.queue.ahead(AHEAD).iter().filter(current);
        self.metric.touch(self.surface, ahead.clone().flat_map(|entry| [entry.a, entry.b]));
        let here = |v: u32| self.surface.positions[v as usize][0] + self.surface.ring(v).len() as f64;
        std::hint::black_box(ahead.map(|entry| here(entry.a) + here(entry.b)).sum::<f64>());
    }

    fn push_all(&mut self, stamps: &[u32], vertex: u32, others: &[u32]) {
        self.metric.touch(self.surface, others.iter().copied());
        for &other in others {
            if let Some(price) = self.locks.price(&self.metric, self.surface, vertex, other) {
                let tag = stamps[vertex as usize].wrapping_add(stamps[other as usize]);
                self.queue.push(vertex, other, price.cost, tag);
            } else if E::REFUSES_FOR_NOW {
                self.waiting.extend([vertex, other]);
            }
        }
    }

    /// The price if the contraction is legal; else that of contracting to the middle if that is; else `None`.
    fn legal_price(&self, [a, b]: [u32; 2], price: Price) -> Option<Price> {
        let surface = &*self.surface;
        if legal::turns_gently(surface, a, b, price.position) {
            return Some(price);
        }
        if self.locks.holds(a) || self.locks.holds(b) {
            return None;
        }
        let middle = lerp(surface.positions[a as usize], surface.positions[b as usize], 0.5);
        if !legal::turns_gently(surface, a, b, middle) {
            return None;
        }
        let mut price = self.metric.price_at(surface, a, b, middle)?;
        price.cost += self.vanishing(a, b);
        Some(price)
    }
}

/// What it costs, besides the metric's price, that nothing is left of a part: its area times the square of its longest
/// edge. Quadrics see planes only, and a point has no distance from the planes of a needle that shrinks into it, so
/// without this, lamp posts and railings would be the first to go.
pub(super) fn vanishing(surface: &Topology, a: u32, b: u32) -> f64 {
    let (ring, other) = (surface.ring(a), surface.ring(b));
    if ring.len() != other.len() || ring.iter().any(|corner| surface.faces[corner.face()].corner(b).is_none()) {
        return 0.0;
    }
    let sizes = ring.iter().map(|corner| {
        let p = surface.corners(&surface.faces[corner.face()]);
        let edges = [sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2])];
        let n = cross(edges[0], edges[1]);
        (dot(n, n).sqrt() / 2.0, edges.map(|e| dot(e, e)).into_iter().fold(0.0, f64::max))
    });
    let (area, longest) = sizes.fold((0.0, 0.0f64), |sum, size| (sum.0 + size.0, sum.1.max(size.1)));
    area * longest
}
