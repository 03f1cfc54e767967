//! From a mesh to the recorded sequence of its contractions.
//!
//! The `driver` takes the cheapest legal pair, contracts it, writes it down, until nothing is left to contract; large surfaces
//! are done in `blocks` first, side by side, if the metric can. One run makes the whole sequence; every level is a cut of it
//! ([`progressive`]).

mod blocks;
mod driver;
mod joins;
mod legal;
pub mod progressive;
pub mod replay;
mod queue;
#[cfg(test)]
pub(crate) mod tests;
mod threshold;

use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;
use crate::mesh::layout::{AttributeScale, Layout};
use crate::mesh::topology::{self, EdgeKind, NEXT, Part, Topology};
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
use crate::metric::{CostUnit, ErrorMetric, Parted, Placement, Price};
use blocks::Sizes;
use driver::Driver;
use progressive::{Progressive, Recorder};

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

    /// What the costs in its sequences are.
    pub fn cost_unit(self) -> CostUnit {
        match self {
            Self::Its | Self::Qem | Self::QemAttributes => CostUnit::SquareTimesArea,
            Self::Naive | Self::Gaps | Self::ItsPaper | Self::Ias | Self::Aps | Self::Tmpm => CostUnit::Length,
        }
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
    simplify_sized(mesh, settings, weights, Sizes::USUAL)
}

fn simplify_sized(mesh: &Mesh, settings: &Settings, weights: &[f64], sizes: Sizes) -> Progressive {
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
    build(&mut surface, settings, weights, &locks, recorder, sizes)
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
    sizes: Sizes,
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
            let metric = Its::new(edges, placement, memoryless, importance);
            run_parted(surface, metric, locks, recorder, sizes)
        }
    }
}

/// Vertices that are not free.
#[derive(Default)]
struct Locks {
    /// Must stay where they are; none: no vertex.
    held: Vec<bool>,
    /// Have faces that are not here, so that no pair may have them; none: no vertex.
    cut: Vec<bool>,
}

impl Locks {
    /// Holds the ends of all border edges, or nothing.
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
        Self { held, cut: Vec::new() }
    }

    /// Of a part of the surface, of whose vertices `cut` are not free at all.
    fn part(&self, part: &Part, cut: impl Fn(u32) -> bool) -> Self {
        let held = part.vertices.iter().filter_map(|&vertex| self.held.get(vertex as usize)).copied().collect();
        Self { held, cut: part.vertices.iter().map(|&vertex| cut(vertex)).collect() }
    }

    #[inline]
    fn holds(&self, vertex: u32) -> bool {
        !self.held.is_empty() && self.held[vertex as usize]
    }

    #[inline]
    fn cuts(&self, vertex: u32) -> bool {
        !self.cut.is_empty() && self.cut[vertex as usize]
    }

    /// The metric's price, with a held vertex as the only place to go.
    #[inline]
    fn price<E: ErrorMetric>(&self, metric: &E, surface: &Topology, a: u32, b: u32) -> Option<Price> {
        if self.cuts(a) || self.cuts(b) {
            return None;
        }
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
    Driver::new(surface, metric, locks, recorder).run(0).finish()
}

/// As [`run`], in blocks first if the surface is large.
fn run_parted<E: Parted>(
    surface: &mut Topology,
    mut metric: E,
    locks: &Locks,
    mut recorder: Recorder,
    sizes: Sizes,
) -> Progressive {
    recorder.costs_are(E::COST);
    if sizes.large < surface.alive {
        blocks::reduce(surface, &metric, locks, &mut recorder, sizes);
    }
    metric.begin(surface);
    Driver::new(surface, metric, locks, recorder).run(0).finish()
}
