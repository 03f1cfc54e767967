//! Recorded sequences + targets → the chain of levels of one mesh, each with its measured error.
//!
//! Pure: knows sub-meshes and sequences, not files, nodes or caches. The budget of a level is shared among the
//! sub-meshes of its mesh by [`crate::allocate`].

mod cutter;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};

use crate::allocate::Allocation;
use crate::mesh::Level;
use crate::simplify::progressive::Progressive;

pub use cutter::{Ground, Source};

use cutter::{COARSE, Cutter, Finish};

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
    pub ground: &'a Ground<'a>,
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
    chain_sized(parts, settings, judge, LARGE)
}

fn chain_sized(parts: &[Part], settings: &ChainSettings, judge: Option<Judge>, large: usize) -> Chain {
    let sequences: Vec<&Progressive> = parts.iter().filter_map(|p| p.sequence).collect();
    let fixed: usize = parts.iter().filter(|p| p.sequence.is_none()).map(|p| p.ground.mesh.triangles()).sum();
    let source: usize = parts.iter().map(|p| p.ground.mesh.triangles()).sum();
    let radius = crate::mesh::layout::frame(parts.iter().flat_map(|p| &p.ground.mesh.primitives)).1;
    let allocation = Allocation::new(&sequences);
    let sources: Vec<Option<Source>> =
        parts.iter().map(|part| part.sequence.map(|_| Source::new(part.ground.mesh, part.ground.welded()))).collect();
    let cutters = || -> Vec<Cutter> {
        let each = parts.iter().zip(&sources);
        each.filter_map(|(part, source)| Cutter::new(part, source.as_ref()?, settings)).collect()
    };
    let mut first = cutters();
    let mut planned: Vec<Planned> = Vec::new();
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
                let difference = |cuts: &[usize]| judge(&cut_all(parts, &mut first, cuts, Finish::Draft));
                let fine = |steps: &usize| {
                    (left(&sequences, &allocation.cuts_after(*steps)) + fixed) as f64 > COARSE * source as f64
                };
                let start = first_not(allocation.steps(), fine);
                let cuts = cuts_by_looks(&allocation, limit, start, difference);
                let all = sequences.iter().zip(&cuts).all(|(s, &c)| c == s.steps.len());
                (cuts, if all { Stop::NoLegalPair } else { Stop::LookLimit })
            }
            Target::Error(_) | Target::ErrorOfRadius(_) | Target::ErrorOfMesh(_) => {
                let target = match target {
                    Target::ErrorOfMesh(fraction) => Target::Error(fraction * radius),
                    other => other,
                };
                let cuts: Vec<usize> = first.iter().map(|cutter| cutter.cut_within(target)).collect();
                let all = sequences.iter().zip(&cuts).all(|(s, &c)| c == s.steps.len());
                (cuts, if all { Stop::NoLegalPair } else { Stop::ErrorLimit })
            }
        };
        let (cuts, kept_one) = keep_something(&sequences, cuts, fixed);
        if kept_one {
            stop = Stop::NoLegalPair;
        }
        let triangles = left(&sequences, &cuts) + fixed;
        if triangles < triangles_before {
            triangles_before = triangles;
            planned.push(Planned { target: number, cuts, triangles, stop });
        }
    }
    let one = |cutters: &mut [Cutter], planned: &Planned| -> ChainLevel {
        let parts = cut_all(parts, cutters, &planned.cuts, Finish::Whole);
        ChainLevel {
            target: planned.target,
            triangles: planned.triangles,
            error: parts.iter().flatten().map(|level| level.error).fold(0.0, f64::max),
            parts,
            bound: sequences.iter().zip(&planned.cuts).filter_map(|(s, &cut)| s.bound_after(cut)).reduce(f64::max),
            stop: planned.stop,
            recipe: None,
        }
    };
    if source <= large {
        return Chain { levels: planned.iter().map(|planned| one(&mut first, planned)).collect() };
    }
    for planned in &planned {
        first.iter().zip(&planned.cuts).for_each(|(cutter, &cut)| cutter.prepare(cut));
    }
    // Each thread goes down on its own and takes the next level that nobody has.
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, ChainLevel)>> = Mutex::new(Vec::new());
    let down = |mut cutters: Vec<Cutter>| {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(planned) = planned.get(number) else { break };
            let level = one(&mut cutters, planned);
            done.lock().expect("no thread panics with it").push((number, level));
        }
    };
    let others = rayon::current_num_threads().min(planned.len()).saturating_sub(1);
    rayon::scope(|scope| {
        for _ in 0..others {
            scope.spawn(|_| {
                if next.load(Ordering::Relaxed) < planned.len() {
                    down(cutters());
                }
            });
        }
        down(first);
    });
    let mut levels = done.into_inner().expect("no thread panics with it");
    levels.sort_unstable_by_key(|(number, _)| *number);
    Chain { levels: levels.into_iter().map(|(_, level)| level).collect() }
}

/// Levels of meshes of more triangles than this are made side by side: each takes a copy of the sequence's state.
const LARGE: usize = 200_000;

/// A level that is wanted.
struct Planned {
    target: usize,
    cuts: Vec<usize>,
    triangles: usize,
    stop: Stop,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simplify::simplify;
    use crate::simplify::tests::{BALANCED, torus};

    #[test]
    fn levels_made_side_by_side_are_those_made_one_after_the_other() {
        let mesh = torus(48, 32);
        let sequence = simplify(&mesh, &BALANCED);
        let ground = Ground::new(&mesh);
        let part =
            |refit| Part { ground: &ground, sequence: Some(&sequence), shareable: false, refit, hold_borders: false };
        // The last one is finer than the one before it: it is none, and the descent is not undone for it.
        let targets = [0.7, 0.5, 0.25, 0.1, 0.05].map(Target::Ratio).into_iter().chain([Target::ErrorOfRadius(0.001)]);
        let settings = ChainSettings { targets: targets.collect(), storage: Storage::Smallest, vertex_cache: true };
        for refit in [Refit::Never, Refit::Coarse, Refit::Whole] {
            let alone = chain_sized(&[part(refit)], &settings, None, usize::MAX);
            assert_eq!(alone.levels.len(), 5);
            for threads in [1, 2, 4] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                assert!(alone == pool.install(|| chain_sized(&[part(refit)], &settings, None, 0)), "{threads} threads");
            }
        }
    }
}
