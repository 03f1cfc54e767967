//! One sub-mesh on its way down: cuts of its sequence, fitted, measured, and put into the form of a level.
//!
//! Knows one sub-mesh; which cuts are wanted is the chain's.

use std::sync::OnceLock;

use super::{ChainSettings, Part, Refit, Storage, Target};
use crate::distance::near::Sheet;
use crate::mesh::{Level, LevelPrimitive, LevelVertices, Mesh, Primitive, index_bytes};
use crate::simplify::progressive::Progressive;
use crate::simplify::replay::refit::{Fit, Importance};
use crate::simplify::replay::{CutPrimitive, Replay, Welded};

/// A sub-mesh with what all its levels share, whichever chain they are of; made when first needed.
#[derive(Debug)]
pub struct Ground<'a> {
    pub(super) mesh: &'a Mesh,
    welded: OnceLock<Welded>,
    importance: OnceLock<Importance>,
}

impl<'a> Ground<'a> {
    /// Of `mesh`.
    pub fn new(mesh: &'a Mesh) -> Self {
        Self { mesh, welded: OnceLock::new(), importance: OnceLock::new() }
    }

    /// Its surface.
    pub fn welded(&self) -> &Welded {
        self.welded.get_or_init(|| Welded::new(self.mesh))
    }

    fn importance(&self) -> &Importance {
        self.importance.get_or_init(|| Importance::new(self.mesh, self.welded()))
    }
}

/// What a level is cut for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Finish {
    /// To be looked at once: not measured. Its triangles are in their final order, for of faces that coincide the first is seen.
    Draft,
    /// To be kept.
    Whole,
}

/// One sub-mesh on its way down.
pub(super) struct Cutter<'a> {
    part: Part<'a>,
    welded: &'a Welded,
    sequence: &'a Progressive,
    settings: &'a ChainSettings,
    replay: Replay<'a>,
    done: usize,
    source: &'a Source<'a>,
}

impl<'a> Cutter<'a> {
    /// `source` must be that of the part; `None` if the part has no sequence.
    pub(super) fn new(part: &Part<'a>, source: &'a Source<'a>, settings: &'a ChainSettings) -> Option<Self> {
        let (sequence, welded) = (part.sequence?, part.ground.welded());
        let replay = Replay::new(part.ground.mesh, welded, sequence);
        Some(Self { part: *part, welded, sequence, settings, replay, done: 0, source })
    }

    /// The coarsest cut whose measured error is within the limit: the error grows, though not strictly, so a search by
    /// halves finds a cut whose successor (at the search's resolution) is over it.
    pub(super) fn cut_within(&self, target: Target) -> usize {
        let limit = match target {
            Target::ErrorOfRadius(fraction) => fraction * self.source.radius,
            Target::Error(limit) => limit,
            Target::Ratio(_) | Target::Triangles(_) | Target::ErrorOfMesh(_) | Target::Appearance(_) => return 0,
        };
        let (mut within, mut over) = (0, self.sequence.steps.len() + 1);
        // Below this many steps a finer answer is not worth another measurement.
        let resolution = (self.sequence.steps.len() / 1000).max(1);
        while resolution < over - within {
            let middle = within + (over - within) / 2;
            let mut replay = Replay::new(self.part.ground.mesh, self.welded, self.sequence);
            replay.advance(middle.min(self.sequence.steps.len()));
            let cut = replay.primitives();
            let error = if cut.iter().all(|c| c.indices.is_empty()) {
                f64::INFINITY
            } else {
                self.source.deviation(&replay, &cut)
            };
            if error <= limit {
                within = middle;
            } else {
                over = middle;
            }
        }
        within.min(self.sequence.steps.len())
    }

    /// How a level is fitted.
    fn fit(&self, cut: usize) -> Option<Fit> {
        let (left, whole) = (self.sequence.triangles_after(cut), self.sequence.triangles as usize);
        let is_coarse = left as f64 <= whole as f64 * COARSE;
        let hold_borders = self.part.hold_borders;
        match self.part.refit {
            Refit::Never => None,
            Refit::Coarse if !is_coarse => None,
            Refit::Shape => Some(Fit { shape: true, normals: None, hold_borders }),
            Refit::Coarse | Refit::Whole => Some(Fit { shape: true, normals: Some(SAME_NORMAL), hold_borders }),
        }
    }

    /// Makes what a level shares with others, before they are made side by side: a thread that waited for it could take
    /// up the making of another one, and wait for itself.
    pub(super) fn prepare(&self, cut: usize) {
        if self.fit(cut).is_some() {
            self.part.ground.importance();
        }
    }

    pub(super) fn level(&mut self, cut: usize, finish: Finish) -> Level {
        if cut < self.done {
            // A later target asked for a finer cut of this part: start again.
            self.replay = Replay::new(self.part.ground.mesh, self.welded, self.sequence);
        }
        self.done = cut;
        self.replay.advance(cut);
        let mut cuts = self.replay.primitives();
        let fit = self.fit(cut);
        if let Some(fit) = fit {
            self.replay.refit(&mut cuts, self.part.ground.importance(), fit);
        }
        let sources = &self.part.ground.mesh.primitives;
        let error = match finish {
            Finish::Draft => 0.0,
            Finish::Whole => self.source.deviation(&self.replay, &cuts),
        };
        let primitive = |(index, cut)| self.primitive(index, &sources[index], cut);
        let primitives = cuts.into_iter().enumerate().map(primitive).collect();
        Level { primitives, error }
    }

    fn primitive(&self, index: usize, source: &Primitive, mut cut: CutPrimitive) -> LevelPrimitive {
        if cut.indices.is_empty() {
            return LevelPrimitive { indices: Vec::new(), vertices: LevelVertices::Source };
        }
        let count = cut.wedges.len();
        let in_order = self.settings.vertex_cache;
        if in_order {
            cut.indices = meshopt::optimize_vertex_cache(&cut.indices, count);
        }
        if self.part.shareable && self.shares(source, &cut) {
            let indices = cut.indices.iter().map(|&i| self.replay.origin(cut.wedges[i as usize])).collect();
            return LevelPrimitive { indices, vertices: LevelVertices::Source };
        }
        if in_order {
            order_by_use(&mut cut);
        }
        let vertices = self.replay.vertices(index, &cut);
        LevelPrimitive { indices: cut.indices, vertices: LevelVertices::Own(vertices) }
    }

    fn shares(&self, source: &Primitive, cut: &CutPrimitive) -> bool {
        let shared = cut.indices.len() * index_bytes(source.count);
        let compact = cut.indices.len() * index_bytes(cut.wedges.len()) + cut.wedges.len() * source.row_bytes();
        match self.settings.storage {
            Storage::Shared => true,
            Storage::Compact => false,
            Storage::Smallest => shared <= compact,
        }
    }
}

/// Share of the source's triangles below which levels are fitted: above it a face of the level has too few source faces
/// to learn from.
pub(super) const COARSE: f64 = 0.3;

/// Cosine of the angle within which the fitted normals of a vertex's faces stay one: 25°.
const SAME_NORMAL: f64 = 0.906;

/// Numbers vertices by first use, so that a GPU fetches them in order.
fn order_by_use(cut: &mut CutPrimitive) {
    let mut order = vec![u32::MAX; cut.wedges.len()];
    let mut used = Vec::with_capacity(cut.wedges.len());
    for index in &mut cut.indices {
        let at = &mut order[*index as usize];
        if *at == u32::MAX {
            *at = used.len() as u32;
            used.push(*index as usize);
        }
        *index = *at;
    }
    cut.wedges = used.iter().map(|&old| cut.wedges[old]).collect();
    cut.normals = cut.normals.take().map(|normals| used.iter().map(|&old| normals[old]).collect());
}

/// Points measured in each direction: beyond this many a further one hardly ever raises the maximum.
const MOST_SAMPLES: usize = 16384;

/// A source that levels are measured against. Both are surfaces over the source's vertices.
#[derive(Debug)]
pub struct Source<'a> {
    sheet: Sheet<'a>,
    radius: f64,
}

impl<'a> Source<'a> {
    /// The surface of `mesh`, which must be what `welded` was made from.
    pub fn new(mesh: &Mesh, welded: &'a Welded) -> Self {
        let radius = crate::mesh::layout::frame(&mesh.primitives).1;
        Self { sheet: Sheet::new(&welded.positions, welded.triangles(mesh)), radius }
    }

    /// Largest distance between source and level: from source vertices to the level, and from the level's corners and
    /// middles of triangles to the source.
    pub fn deviation(&self, replay: &Replay, cuts: &[CutPrimitive]) -> f64 {
        let triangles: Vec<[u32; 3]> = cuts.iter().flat_map(|cut| replay.triangles(cut)).collect();
        if triangles.is_empty() {
            // Nothing is left of it: as far off as it was large.
            return 2.0 * self.radius;
        }
        let level = Sheet::new(replay.positions(), triangles);
        let middle = |t: [u32; 3]| {
            let p = level.corners(t);
            [0, 1, 2].map(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0)
        };
        // This direction first: its hints are good, and what it finds spares the other one most of its searches.
        let count = replay.positions().len();
        let step = count.div_ceil(MOST_SAMPLES).max(1);
        let vertices = (0..count as u32).step_by(step);
        let there =
            level.largest_distance(vertices.map(|vertex| (self.sheet.position(vertex), replay.root(vertex))), 0.0);
        // A vertex that is left has kept its number.
        let middles = level.triangles().iter().map(|&t| (middle(t), t[0]));
        let corners = level.triangles().iter().map(|&t| (level.position(t[0]), t[0]));
        let step = (level.triangles().len() * 2).div_ceil(MOST_SAMPLES).max(1);
        self.sheet.largest_distance(middles.chain(corners).step_by(step), there)
    }
}
