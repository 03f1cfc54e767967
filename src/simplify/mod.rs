//! The driver: takes the cheapest legal pair, contracts it, writes it down, until nothing is left to contract.
//!
//! Generic over the metric and never knows which one it runs. Single-threaded and deterministic: ties go by vertex
//! number. One run makes the whole sequence; every level is a cut of it ([`progressive`]).

mod legal;
pub mod progressive;
pub mod replay;
mod queue;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::mesh::layout::{AttributeScale, Layout};
use crate::mesh::topology::{self, Contraction, EdgeKind, Topology};
use crate::metric::its::{EdgeWeights, Its};
use crate::metric::qem::Qem;
use crate::metric::{ErrorMetric, Placement, Price};
use crate::quadric::{cross, dot, lerp, sub};
use progressive::{Progressive, Recorder};
use queue::Queue;

/// Which metric prices contractions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MetricKind {
    /// [`crate::metric::its`]
    Its,
    /// [`crate::metric::qem`]
    Qem,
}

impl MetricKind {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Its, Self::Qem];
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
    let weights = if weights.is_empty() { Vec::new() } else { topology::of_faces(mesh, &weld, weights) };
    let recorder = Recorder::new(mesh, &surface, &layout, weld);
    let locks = Locks::new(&surface, settings.lock_border);
    build(&mut surface, settings, weights, &locks, recorder)
}

/// Numbers of columns that meshes have: normals, + one or two texture sets, + colours. Others are padded with zeros.
const WIDTHS: [usize; 6] = [3, 5, 7, 9, 16, 32];

/// The only place that builds a metric. The number of columns is a compile-time constant of `its`, so that its inner
/// loops have known lengths.
fn build(
    surface: &mut Topology,
    settings: &Settings,
    weights: Vec<f64>,
    locks: &Locks,
    recorder: Recorder,
) -> Progressive {
    if settings.metric == MetricKind::Qem {
        let metric = Qem::new(surface, settings.edges.border, settings.placement);
        return run(surface, metric, locks, recorder);
    }
    let width = WIDTHS.into_iter().find(|&width| surface.columns <= width).expect("a layout has at most 32 columns");
    surface.resize_columns(width);
    macro_rules! its {
        ($($m:literal)*) => {
            match width {
                $($m => {
                    let metric = Its::<$m>::new(surface, settings.edges, settings.placement, settings.memoryless, weights);
                    run(surface, metric, locks, recorder)
                })*
                _ => unreachable!("a width of the list"),
            }
        };
    }
    its!(3 5 7 9 16 32)
}

/// Vertices that must stay where they are.
struct Locks(Vec<bool>);

impl Locks {
    /// The ends of all border edges, or none.
    fn new(surface: &Topology, lock_border: bool) -> Self {
        let mut held = Vec::new();
        if lock_border {
            held.resize(surface.positions.len(), false);
            for face in &surface.faces {
                for edge in (0..3).filter(|&edge| face.edges[edge] == EdgeKind::Border) {
                    held[face.v[edge] as usize] = true;
                    held[face.v[(edge + 1) % 3] as usize] = true;
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

fn run<E: ErrorMetric>(surface: &mut Topology, mut metric: E, locks: &Locks, mut recorder: Recorder) -> Progressive {
    let mut queue = Queue::new(surface.positions.len());
    let (mut neighbours, mut second) = (Vec::new(), Vec::new());
    let mut done = Contraction::default();
    // Ends of pairs that were illegal when their turn came: tried again when something beside them changes.
    let mut refused = vec![false; surface.positions.len()];
    fill(surface, &metric, locks, &mut queue);
    while let Some((a, b, entered)) = queue.pop() {
        let Some(mut price) = locks.price(&metric, surface, a, b) else { continue };
        price.cost += vanishing(surface, a, b);
        // Prices are not kept up to date behind the queue's back: a pair is priced again when its turn comes.
        if !queue.is_next(price.cost, entered) {
            queue.push(a, b, price.cost);
            continue;
        }
        let Some(price) = legal_price(surface, &metric, locks, [a, b], price) else {
            (refused[a as usize], refused[b as usize]) = (true, true);
            continue;
        };
        // The middle may be far dearer than the best place: it waits for its own turn.
        if !queue.is_next(price.cost, entered) {
            queue.push(a, b, price.cost);
            continue;
        }
        let (kept, gone) = if price.keep_second { (b, a) } else { (a, b) };
        surface.contract(kept, gone, price.position, &mut done);
        metric.contracted(surface, &done);
        recorder.record(surface, &done, &price);
        queue.merged(kept, gone);
        surface.neighbours(kept, &mut neighbours);
        push_all(surface, &metric, locks, &mut queue, kept, &neighbours);
        for &vertex in &neighbours {
            if std::mem::take(&mut refused[vertex as usize]) {
                surface.neighbours(vertex, &mut second);
                push_all(surface, &metric, locks, &mut queue, vertex, &second);
            }
        }
    }
    recorder.finish()
}

/// What it costs, besides the metric's price, that nothing is left of a part: its area times the square of its longest
/// edge. Quadrics see planes only, and a point has no distance from the planes of a needle that shrinks into it, so
/// without this, lamp posts and railings would be the first to go.
fn vanishing(surface: &Topology, a: u32, b: u32) -> f64 {
    let (ring, other) = (surface.ring(a), surface.ring(b));
    if ring.len() != other.len() || ring.iter().any(|&id| surface.faces[id as usize].corner(b).is_none()) {
        return 0.0;
    }
    let sizes = ring.iter().map(|&id| {
        let p = surface.corners(&surface.faces[id as usize]);
        let edges = [sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2])];
        let n = cross(edges[0], edges[1]);
        (dot(n, n).sqrt() / 2.0, edges.map(|e| dot(e, e)).into_iter().fold(0.0, f64::max))
    });
    let (area, longest) = sizes.fold((0.0, 0.0f64), |sum, size| (sum.0 + size.0, sum.1.max(size.1)));
    area * longest
}

/// The price if the contraction is legal; else that of contracting to the middle if that is; else `None`.
fn legal_price<E: ErrorMetric>(
    s: &Topology,
    metric: &E,
    locks: &Locks,
    [a, b]: [u32; 2],
    price: Price,
) -> Option<Price> {
    if legal::turns_gently(s, a, b, price.position) {
        return Some(price);
    }
    if locks.holds(a) || locks.holds(b) {
        return None;
    }
    let middle = lerp(s.positions[a as usize], s.positions[b as usize], 0.5);
    let vanishing = vanishing(s, a, b);
    let mut price = metric.price_at(s, a, b, middle)?;
    price.cost += vanishing;
    legal::turns_gently(s, a, b, middle).then_some(price)
}

fn push_all<E: ErrorMetric>(s: &Topology, metric: &E, locks: &Locks, queue: &mut Queue, vertex: u32, others: &[u32]) {
    for &other in others {
        if let Some(price) = locks.price(metric, s, vertex, other) {
            queue.push(vertex, other, price.cost);
        }
    }
}

fn fill<E: ErrorMetric>(surface: &Topology, metric: &E, locks: &Locks, queue: &mut Queue) {
    let mut neighbours = Vec::new();
    for a in 0..surface.positions.len() as u32 {
        surface.neighbours(a, &mut neighbours);
        for &b in neighbours.iter().filter(|&&b| a < b) {
            if let Some(price) = locks.price(metric, surface, a, b) {
                queue.stage(a, b, price.cost);
            }
        }
    }
    queue.heapify();
}
