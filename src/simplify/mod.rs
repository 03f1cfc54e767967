//! The driver: takes the cheapest legal pair, contracts it, writes it down, until nothing is left to contract.
//!
//! Generic over the metric and never knows which one it runs. Single-threaded and deterministic: ties go by vertex
//! number. One run makes the whole sequence; every level is a cut of it ([`progressive`]).

mod joins;
mod legal;
pub mod progressive;
pub mod replay;
mod queue;
#[cfg(test)]
mod tests;
mod threshold;

use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::mesh::layout::{AttributeScale, Layout};
use crate::mesh::topology::{self, Contraction, EdgeKind, NEXT, Topology};
use crate::mesh::visible::visible;
use crate::metric::aps::Aps;
use crate::metric::gaps::Gaps;
use crate::metric::ias::Ias;
use crate::metric::its::{EdgeWeights, Its};
use crate::metric::its_paper::ItsPaper;
use crate::metric::naive::Naive;
use crate::metric::qem::Qem;
use crate::metric::qem_attributes::QemAttributes;
use crate::metric::tmpm::Tmpm;
use crate::metric::{CostUnit, ErrorMetric, Placement, Price};
use crate::quadric::{cross, dot, lerp, sub};
use joins::Joins;
use progressive::{Progressive, Recorder};
use queue::{Entry, Queue};

/// Which metric prices contractions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MetricKind {
    /// [`crate::metric::its`]
    Its,
    /// [`crate::metric::qem`]
    Qem,
    /// [`crate::metric::qem_attributes`]
    QemAttributes,
    /// [`crate::metric::naive`]
    Naive,
    /// [`crate::metric::gaps`]
    Gaps,
    /// [`crate::metric::its_paper`]
    ItsPaper,
    /// [`crate::metric::ias`]
    Ias,
    /// [`crate::metric::aps`]
    Aps,
    /// [`crate::metric::tmpm`]
    Tmpm,
}

impl MetricKind {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Its,
        Self::Qem,
        Self::QemAttributes,
        Self::Naive,
        Self::Gaps,
        Self::ItsPaper,
        Self::Ias,
        Self::Aps,
        Self::Tmpm,
    ];

    /// Whether it can put merged vertices there. All can put them onto one of the ends.
    pub fn can_place(self, placement: Placement) -> bool {
        placement == Placement::Subset || !matches!(self, Self::ItsPaper | Self::Tmpm)
    }
}

/// Everything that decides the sequence, besides the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The metric.
    pub metric: MetricKind,
    /// Where merged vertices go.
    pub placement: Placement,
    /// Weights of attributes in the price.
    pub attributes: AttributeScale,
    /// Weights of borders, seams and creases.
    pub edges: EdgeWeights,
    /// Vertices of open borders stay where they are.
    pub lock_border: bool,
    /// Metrics that can, rebuild their state from the current surface after each contraction: closer to the source,
    /// more work.
    pub memoryless: bool,
    /// Area counts by how much of it can be seen from outside ([`visible`]), where no other weights are given. Only `its`
    /// heeds it.
    pub by_visibility: bool,
}

/// Simplifies `mesh` as far as it goes and returns the recorded sequence.
pub fn simplify(mesh: &Mesh, settings: &Settings) -> Progressive {
    simplify_weighted(mesh, settings, &[])
}

/// The same with a weight for each triangle (of all primitives, in order; all 1 if there are none), by which its area
/// counts. Only `its` heeds them.
pub fn simplify_weighted(mesh: &Mesh, settings: &Settings, weights: &[f64]) -> Progressive {
    let layout = Layout::new(mesh, settings.attributes);
    let (mut surface, weld) = Topology::new(mesh, &layout);
    let weights: Vec<f32> = if weights.is_empty() && settings.by_visibility && settings.metric == MetricKind::Its {
        visible(mesh).into_iter().map(|share| UNSEEN + (1.0 - UNSEEN) * share).collect()
    } else {
        weights.iter().map(|&weight| weight as f32).collect()
    };
    let weights = if weights.is_empty() { weights } else { topology::of_faces(mesh, &weld, &weights) };
    let recorder = Recorder::new(mesh, &surface, &layout, weld);
    let locks = Locks::new(&surface, settings.lock_border);
    build(&mut surface, settings, weights, &locks, recorder)
}

/// Weight of a triangle that cannot be seen from outside, against 1: it may be seen from within, or when things move.
const UNSEEN: f32 = 0.1;

/// The only place that builds a metric.
fn build(
    surface: &mut Topology,
    settings: &Settings,
    importance: Vec<f32>,
    locks: &Locks,
    recorder: Recorder,
) -> Progressive {
    let Settings { edges, placement, memoryless, .. } = *settings;
    let (layout, primitives) = (recorder.layout(), recorder.wedge_primitive());
    match settings.metric {
        MetricKind::Qem => run(surface, Qem::new(surface, edges.border, placement), locks, recorder),
        MetricKind::QemAttributes => run(surface, QemAttributes::new(surface, edges, placement), locks, recorder),
        MetricKind::Naive => run(surface, Naive::new(placement), locks, recorder),
        MetricKind::Gaps => {
            let metric = Gaps::new(surface, layout, primitives, edges.border, placement);
            run(surface, metric, locks, recorder)
        }
        MetricKind::ItsPaper => {
            let metric = ItsPaper::new(surface, layout, primitives, edges.border);
            threshold::run(surface, metric, locks, recorder)
        }
        MetricKind::Aps => {
            let metric = Aps::new(surface, layout, primitives, edges.border, placement);
            run(surface, metric, locks, recorder)
        }
        MetricKind::Tmpm => run(surface, Tmpm::new(surface, layout, primitives), locks, recorder),
        MetricKind::Ias => run(surface, Ias::new(surface, edges.border, placement), locks, recorder),
        MetricKind::Its => {
            let metric = Its::new(surface, edges, placement, memoryless, importance);
            run(surface, metric, locks, recorder)
        }
    }
}

/// Vertices that must stay where they are.
struct Locks(Vec<bool>);

impl Locks {
    /// The ends of all border edges, or none.
    fn new(surface: &Topology, lock_border: bool) -> Self {
        let mut held = Vec::new();
        if lock_border {
            held.resize(surface.positions.len(), false);
            for (face, kinds) in surface.faces.iter().zip(&surface.kinds) {
                for edge in (0..3).filter(|&edge| kinds[edge] == EdgeKind::Border) {
                    held[face.v[edge] as usize] = true;
                    held[face.v[NEXT[edge]] as usize] = true;
                }
            }
        }
        Self(held)
    }

    #[inline]
    fn holds(&self, vertex: u32) -> bool {
        !self.0.is_empty() && self.0[vertex as usize]
    }

    /// The metric's price, with a held vertex as the only place to go.
    #[inline]
    fn price<E: ErrorMetric>(&self, metric: &E, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        let price = match (self.holds(a), self.holds(b)) {
            (false, false) => return metric.price(surface, a, b),
            (true, true) => return None,
            (true, false) => metric.price_at(surface, a, b, surface.positions[a as usize]),
            (false, true) => metric.price_at(surface, a, b, surface.positions[b as usize]),
        };
        price.map(|price| Price { keep_second: self.holds(b), ..price })
    }
}

fn run<E: ErrorMetric>(surface: &mut Topology, metric: E, locks: &Locks, mut recorder: Recorder) -> Progressive {
    recorder.costs_are(E::COST);
    let joins = Joins::new(surface.positions.len(), E::JOINS);
    let mut driver = Driver {
        waiting: Vec::new(),
        queue: Queue::new(),
        joins,
        recorder,
        done: Contraction::default(),
        surface,
        metric,
        locks,
    };
    driver.fill();
    driver.run();
    driver.recorder.finish()
}

/// A run on its way.
struct Driver<'a, E> {
    surface: &'a mut Topology,
    metric: E,
    locks: &'a Locks,
    queue: Queue,
    /// Pairs without an edge, for metrics that join parts.
    joins: Joins,
    /// Ends of pairs without a price, for metrics that refuse for now.
    waiting: Vec<u32>,
    recorder: Recorder,
    done: Contraction,
}

/// Stamp of a vertex that is gone.
const GONE: u32 = u32::MAX;

/// Pairs whose surroundings are read before their turn.
const AHEAD: usize = 8;

impl<E: ErrorMetric> Driver<'_, E> {
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

    /// All pairs at the merged vertex are priced anew and entered again. Other prices are not kept up to date behind the
    /// queue's back: a pair is priced again when its turn comes.
    fn run(&mut self) {
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
fn vanishing(surface: &Topology, a: u32, b: u32) -> f64 {
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
