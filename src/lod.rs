//! Recorded sequences + targets → the chain of levels of one mesh, each with its measured error.
//!
//! Pure: knows sub-meshes and sequences, not files, nodes or caches. The budget of a level is shared among the
//! sub-meshes of its mesh by [`crate::allocate`].

use serde::{Deserialize, Serialize};

use crate::allocate::Allocation;
use crate::distance::near::Sheet;
use crate::mesh::{Attribute, Level, LevelPrimitive, LevelVertices, Mesh, Primitive};
use crate::simplify::progressive::Progressive;
use crate::simplify::replay::refit::{Fit, Importance};
use crate::simplify::replay::{CutPrimitive, Replay, Welded};

/// How coarse a level is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Target {
    /// Share of the mesh's triangles, 0…1.
    Ratio(f64),
    /// Triangles of the mesh.
    Triangles(usize),
    /// Largest distance from the source, as a fraction of each sub-mesh's radius.
    ErrorOfRadius(f64),
    /// Largest distance from the source, object space units.
    Error(f64),
    /// Largest distance from the source, as a fraction of the whole mesh's radius.
    ErrorOfMesh(f64),
    /// Image difference from the source as the [`Judge`] sees it.
    Appearance(f64),
}

/// How much a level, one entry for each part (`None` = as the source), differs from the source to look at: d_RMS.
pub type Judge<'a> = &'a (dyn Fn(&[Option<Level>]) -> f64 + Sync);

/// Where the vertices of a level are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Storage {
    /// In the source's vertices if all of them are source vertices, else as [`Self::Compact`].
    Shared,
    /// Each level has its own.
    Compact,
    /// Whatever takes fewer bytes.
    Smallest,
}

/// What decides the levels, besides the sequences.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainSettings {
    /// Finest first.
    pub targets: Vec<Target>,
    /// Where vertices are kept.
    pub storage: Storage,
    /// Order triangles and vertices for the caches of the GPU.
    pub vertex_cache: bool,
}

/// One sub-mesh of the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The source.
    pub mesh: &'a Mesh,
    /// Its sequence; `None` leaves the sub-mesh as it is at every level.
    pub sequence: Option<&'a Progressive>,
    /// The sequence kept to source vertices ([`crate::metric::Placement::Subset`]) and the source's vertices can be
    /// referred to.
    pub shareable: bool,
    /// Which levels are fitted to the source.
    pub refit: Refit,
    /// A fit leaves vertices of open borders where they are.
    pub hold_borders: bool,
}

/// Which levels are fitted to the source when they are cut, and what of them ([`crate::simplify::replay::refit`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refit {
    /// None: levels refer to source vertices, or speed matters.
    Never,
    /// Shape and normals of those with less than three tenths of the triangles: below, one normal at a vertex cannot
    /// follow the surface.
    Coarse,
    /// The shape of all.
    Shape,
    /// Shape and normals of all.
    Whole,
}

/// Why a level has the triangles that it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stop {
    /// The triangle count asked for.
    Target,
    /// The error limit asked for.
    ErrorLimit,
    /// The image difference asked for.
    LookLimit,
    /// No pair was left that could be contracted.
    NoLegalPair,
}

/// The levels of one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    /// Finest first. Targets that would repeat the level before them are not here.
    pub levels: Vec<ChainLevel>,
}

/// One level of one mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainLevel {
    /// Number of the target, from 0.
    pub target: usize,
    /// One for each part; `None` = as the source.
    pub parts: Vec<Option<Level>>,
    /// Triangles of all parts.
    pub triangles: usize,
    /// Largest measured distance from the source of all parts, object space units.
    pub error: f64,
    /// How far it is at most from the source in the sense of the metric's paper, if the metric says so; object space
    /// units. What exactly it bounds stands at the metric.
    pub bound: Option<f64>,
    /// Why it stopped there.
    pub stop: Stop,
    /// The recipe that made it, where several were tried.
    pub recipe: Option<String>,
}

/// Cuts the chain. Levels by appearance need a judge; without one they are left out.
pub fn chain(parts: &[Part], settings: &ChainSettings, judge: Option<Judge>) -> Chain {
    let sequences: Vec<&Progressive> = parts.iter().filter_map(|p| p.sequence).collect();
    let fixed: usize = parts.iter().filter(|p| p.sequence.is_none()).map(|p| p.mesh.triangles()).sum();
    let source: usize = parts.iter().map(|p| p.mesh.triangles()).sum();
    let radius = crate::mesh::layout::frame(parts.iter().flat_map(|p| &p.mesh.primitives)).1;
    let allocation = Allocation::new(&sequences);
    let welded: Vec<Option<Welded>> = parts.iter().map(|p| p.sequence.map(|_| Welded::new(p.mesh))).collect();
    let mut cutters: Vec<Cutter> = parts
        .iter()
        .zip(&welded)
        .filter_map(|(part, welded)| Some(Cutter::new(part, welded.as_ref()?, part.sequence?, settings)))
        .collect();
    let mut chain = Chain { levels: Vec::new() };
    let mut triangles_before = source;
    for (number, &target) in settings.targets.iter().enumerate() {
        let (cuts, mut stop) = match target {
            Target::Ratio(_) | Target::Triangles(_) => {
                let wanted = wanted(target, source);
                let cuts = allocation.cuts(wanted.saturating_sub(fixed));
                let left = left(&sequences, &cuts);
                (cuts, if left + fixed <= wanted { Stop::Target } else { Stop::NoLegalPair })
            }
            Target::Appearance(limit) => {
                let Some(judge) = judge else { continue };
                let difference = |cuts: &[usize]| judge(&cut_all(parts, &mut cutters, cuts, Finish::Draft));
                let fine = |steps: &usize| {
                    (left(&sequences, &allocation.cuts_after(*steps)) + fixed) as f64 > COARSE * source as f64
                };
                let first = first_not(allocation.steps(), fine);
                let cuts = cuts_by_looks(&allocation, limit, first, difference);
                let all = sequences.iter().zip(&cuts).all(|(s, &c)| c == s.steps.len());
                (cuts, if all { Stop::NoLegalPair } else { Stop::LookLimit })
            }
            Target::Error(_) | Target::ErrorOfRadius(_) | Target::ErrorOfMesh(_) => {
                let target = match target {
                    Target::ErrorOfMesh(fraction) => Target::Error(fraction * radius),
                    other => other,
                };
                let cuts: Vec<usize> = cutters.iter().map(|cutter| cutter.cut_within(target)).collect();
                let all = sequences.iter().zip(&cuts).all(|(s, &c)| c == s.steps.len());
                (cuts, if all { Stop::NoLegalPair } else { Stop::ErrorLimit })
            }
        };
        let (cuts, kept_one) = keep_something(&sequences, cuts, fixed);
        if kept_one {
            stop = Stop::NoLegalPair;
        }
        let left = left(&sequences, &cuts);
        if triangles_before <= left + fixed {
            continue;
        }
        triangles_before = left + fixed;
        let level_parts = cut_all(parts, &mut cutters, &cuts, Finish::Whole);
        let error = level_parts.iter().flatten().map(|level| level.error).fold(0.0, f64::max);
        chain.levels.push(ChainLevel {
            target: number,
            triangles: left + fixed,
            parts: level_parts,
            error,
            bound: sequences.iter().zip(&cuts).filter_map(|(s, &cut)| s.bound_after(cut)).reduce(f64::max),
            stop,
            recipe: None,
        });
    }
    chain
}

/// What a level is cut for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Finish {
    /// To be looked at once: not measured. Its triangles are in their final order, for of faces that coincide the first is seen.
    Draft,
    /// To be kept.
    Whole,
}

/// One level of every part; `None` for those without a sequence.
fn cut_all(parts: &[Part], cutters: &mut [Cutter], cuts: &[usize], finish: Finish) -> Vec<Option<Level>> {
    let mut levels = cutters.iter_mut().zip(cuts).map(|(cutter, &cut)| cutter.level(cut, finish));
    parts.iter().map(|p| p.sequence.and_then(|_| levels.next())).collect()
}

/// The cuts after which the next contraction, anywhere in the mesh, exceeds the limit. The difference grows with the
/// contractions, though not strictly: the search by halves finds one such place, and looks a little further. It begins at
/// `first`, behind which the difference is smaller than before, since coarse levels are fitted.
fn cuts_by_looks(
    allocation: &Allocation,
    limit: f64,
    first: usize,
    mut difference: impl FnMut(&[usize]) -> f64,
) -> Vec<usize> {
    let (mut within, mut over) = (0, allocation.steps() + 1);
    let mut next = first.min(over - 1).max(1);
    while 1 < over - within {
        let middle = next;
        if difference(&allocation.cuts_after(middle)) <= limit {
            within = middle;
        } else {
            over = middle;
        }
        next = within + (over - within) / 2;
    }
    // `over` is known to be too much; a few contractions more may not be, above all where few triangles are left.
    let mut further = over + 1;
    while further <= allocation.steps() && further <= over + LOOK_FURTHER {
        if difference(&allocation.cuts_after(further)) <= limit {
            within = further;
            over = further;
        }
        further += 1;
    }
    allocation.cuts_after(within)
}

/// Contractions after one that is too much that are looked at all the same.
const LOOK_FURTHER: usize = 4;

/// The first number up to `last` for which `holds` is false, if it is true up to there; else `last`.
fn first_not(last: usize, holds: impl Fn(&usize) -> bool) -> usize {
    let (mut low, mut high) = (0, last);
    while low < high {
        let middle = low + (high - low) / 2;
        (low, high) = if holds(&middle) { (middle + 1, high) } else { (low, middle) };
    }
    low
}

/// Triangles asked for; at least one.
fn wanted(target: Target, source: usize) -> usize {
    match target {
        Target::Ratio(ratio) => ((source as f64 * ratio).round() as usize).max(1),
        Target::Triangles(triangles) => triangles,
        Target::Error(_) | Target::ErrorOfRadius(_) | Target::ErrorOfMesh(_) | Target::Appearance(_) => 0,
    }
}

/// Triangles of all sequences at their cuts.
fn left(sequences: &[&Progressive], cuts: &[usize]) -> usize {
    sequences.iter().zip(cuts).map(|(sequence, &cut)| sequence.triangles_after(cut)).sum()
}

/// A level that shows nothing is no level: steps back in the last sequence that still had triangles.
fn keep_something(sequences: &[&Progressive], mut cuts: Vec<usize>, fixed: usize) -> (Vec<usize>, bool) {
    if 0 < fixed || 0 < left(sequences, &cuts) {
        return (cuts, false);
    }
    // The part whose last step cost most is the one to keep.
    let cost = |s: &Progressive| s.steps.iter().map(|step| step.cost).fold(0.0, f32::max);
    let Some(at) = (0..sequences.len()).max_by(|&a, &b| cost(sequences[a]).total_cmp(&cost(sequences[b]))) else {
        return (cuts, false);
    };
    while 0 < cuts[at] && left(sequences, &cuts) == 0 {
        cuts[at] -= 1;
    }
    (cuts, true)
}

/// One sub-mesh on its way down.
struct Cutter<'a> {
    part: Part<'a>,
    welded: &'a Welded,
    sequence: &'a Progressive,
    settings: &'a ChainSettings,
    replay: Replay<'a>,
    done: usize,
    source: Source<'a>,
    importance: Option<Importance>,
}

impl<'a> Cutter<'a> {
    fn new(part: &Part<'a>, welded: &'a Welded, sequence: &'a Progressive, settings: &'a ChainSettings) -> Self {
        Self {
            part: *part,
            welded,
            sequence,
            settings,
            replay: Replay::new(part.mesh, welded, sequence),
            done: 0,
            source: Source::new(part.mesh, welded),
            importance: None,
        }
    }

    /// The coarsest cut whose measured error is within the limit: the error grows, though not strictly, so a search by
    /// halves finds a cut whose successor (at the search's resolution) is over it.
    fn cut_within(&self, target: Target) -> usize {
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
            let mut replay = Replay::new(self.part.mesh, self.welded, self.sequence);
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

    fn level(&mut self, cut: usize, finish: Finish) -> Level {
        if cut < self.done {
            // A later target asked for a finer cut of this part: start again.
            self.replay = Replay::new(self.part.mesh, self.welded, self.sequence);
        }
        self.done = cut;
        self.replay.advance(cut);
        let mut cuts = self.replay.primitives();
        let (left, whole) = (self.sequence.triangles_after(cut), self.sequence.triangles as usize);
        let is_coarse = left as f64 <= whole as f64 * COARSE;
        let hold_borders = self.part.hold_borders;
        let fit = match self.part.refit {
            Refit::Never => None,
            Refit::Coarse if !is_coarse => None,
            Refit::Shape => Some(Fit { shape: true, normals: None, hold_borders }),
            Refit::Coarse | Refit::Whole => Some(Fit { shape: true, normals: Some(SAME_NORMAL), hold_borders }),
        };
        if let Some(fit) = fit {
            let (mesh, welded) = (self.part.mesh, self.welded);
            let importance = self.importance.get_or_insert_with(|| Importance::new(mesh, welded));
            self.replay.refit(&mut cuts, importance, fit);
        }
        let sources = &self.part.mesh.primitives;
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
        let index_size = |vertices: usize| if vertices < usize::from(u16::MAX) { 2 } else { 4 };
        let sets = source.targets.iter().flatten().chain(&source.attributes);
        let stride: usize = sets.map(Attribute::row_bytes).sum();
        let shared = cut.indices.len() * index_size(source.count);
        let compact = cut.indices.len() * index_size(cut.wedges.len()) + cut.wedges.len() * stride;
        match self.settings.storage {
            Storage::Shared => true,
            Storage::Compact => false,
            Storage::Smallest => shared <= compact,
        }
    }
}

/// Share of the source's triangles below which levels are fitted: above it a face of the level has too few source faces
/// to learn from.
const COARSE: f64 = 0.3;

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
