//! Plan → baked chains: look up, run the rest, store. Knows no scene, no path and no thread's number.
//!
//! Sequences and chains are separate results: another ratio cuts the same sequence anew. A sequence is only looked up
//! where a chain is missing. Pictures are drawn where they decide a level or are recorded, scene by scene, so that the
//! textures of one scene at a time are in memory.

mod best;
mod look;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::appearance::looks::Looks;
use crate::cache::{Bucket, Cache, Lookup};
use crate::key::JobKey;
use crate::lod::{self, Chain, ChainLevel, Ground, Part, Refit, Stop, chain};
use crate::mesh::Level;
use crate::metric::Placement;
use crate::plan::{ChainTask, LookTask, MeshLook, PartTask, Plan, Recipe, SequenceTask};
use crate::progress::{Event, Reporter};
use crate::simplify::progressive::Progressive;
use crate::simplify::{MetricKind, simplify, simplify_weighted};

pub use look::LevelLook;

use best::Loop;
use look::Judge;

/// Materials and textures of a scene of the plan, by its number.
pub type LoadLooks<'a> = &'a (dyn Fn(usize) -> Arc<Looks> + Sync);

/// What came of a plan.
#[derive(Debug, Default)]
pub struct Baked {
    /// All chains of the plan.
    pub chains: BTreeMap<JobKey, Arc<Chain>>,
    /// How the levels of a chain look, in their order.
    pub looks: BTreeMap<JobKey, Arc<Vec<LevelLook>>>,
    /// Sub-meshes that were simplified.
    pub jobs: usize,
    /// Sub-meshes whose results came from the cache.
    pub hits: usize,
    /// Wall time in which looks were measured for the record.
    pub looked: Duration,
    /// Damaged entries and results that could not be stored; the bake is whole all the same.
    pub warnings: Vec<String>,
}

/// Sequences that are needed before all chains are planned.
#[derive(Debug, Default)]
pub struct Prepared {
    /// By key.
    pub sequences: BTreeMap<JobKey, Progressive>,
    /// What was done for them.
    baked: Baked,
}

/// Looks up or makes some of the sequences of `plan`.
pub fn prepare(plan: &Plan, wanted: &BTreeSet<JobKey>, cache: &Cache, reporter: &dyn Reporter) -> Prepared {
    let mut baked = Baked::default();
    let sequences = recorded(plan, wanted, cache, reporter, &mut baked);
    Prepared { sequences, baked }
}

/// Makes every chain of `plan` and the figures of their looks.
pub fn work(plan: &Plan, prepared: Prepared, cache: &Cache, load: LoadLooks, reporter: &dyn Reporter) -> Baked {
    let Prepared { sequences: ready, baked: mut out } = prepared;
    let found: Vec<(JobKey, Found<Chain>)> =
        plan.chains.par_iter().map(|(&key, _)| (key, look_up(cache, Bucket::Chains, key))).collect();
    let mut missing: Vec<(JobKey, &ChainTask)> = Vec::new();
    for (key, found) in found {
        out.warnings.extend(found.warning);
        match found.value {
            Some(chain) => drop(out.chains.insert(key, Arc::new(chain))),
            None => missing.push((key, &plan.chains[&key])),
        }
    }
    let sequences = sequences(plan, &missing, ready, cache, reporter, &mut out);
    let make = |key: JobKey, task: &ChainTask, looks: Option<&Arc<Looks>>| {
        let chain = cut(task, &sequences, looks);
        let warning = store(cache, Bucket::Chains, key, &chain);
        (key, Arc::new(chain), warning)
    };
    let (judged, plain): (Vec<_>, Vec<_>) = missing.into_iter().partition(|(_, task)| task.judged.is_some());
    let mut made: Vec<(JobKey, Arc<Chain>, Option<String>)> =
        plain.par_iter().map(|&(key, task)| make(key, task, None)).collect();
    let scene = |task: &ChainTask| task.judged.as_ref().map_or(0, |look: &MeshLook| look.scene);
    for group in by_scene(judged, |(_, task)| scene(task)) {
        let looks = load(scene(group[0].1));
        made.extend(group.par_iter().map(|&(key, task)| make(key, task, Some(&looks))).collect::<Vec<_>>());
    }
    for (key, chain, warning) in made {
        out.warnings.extend(warning);
        out.chains.insert(key, chain);
    }
    let began = Instant::now();
    record_looks(plan, cache, load, reporter, &mut out);
    out.looked = began.elapsed();
    out
}

/// Makes every chain of `plan` in this thread, keeping nothing: for measuring. Pictures are drawn in rayon's pool.
pub fn chains(plan: &Plan, load: LoadLooks) -> BTreeMap<JobKey, Chain> {
    let sequences: BTreeMap<JobKey, Progressive> =
        plan.sequences.iter().map(|(&key, task)| (key, simplify(&task.mesh, &task.settings))).collect();
    let cut = |task: &ChainTask| {
        let looks = task.judged.as_ref().map(|look| load(look.scene));
        cut(task, &sequences, looks.as_ref())
    };
    plan.chains.iter().map(|(&key, task)| (key, cut(task))).collect()
}

/// Groups of one scene each, in the order of their scenes.
fn by_scene<T>(mut tasks: Vec<T>, scene: impl Fn(&T) -> usize) -> Vec<Vec<T>> {
    tasks.sort_by_key(&scene);
    let mut groups: Vec<Vec<T>> = Vec::new();
    for task in tasks {
        match groups.last_mut() {
            Some(group) if scene(&group[0]) == scene(&task) => group.push(task),
            _ => groups.push(vec![task]),
        }
    }
    groups
}

/// Cuts a chain; of several recipes and rounds, each level is taken from the one that looks best.
fn cut(task: &ChainTask, sequences: &BTreeMap<JobKey, Progressive>, looks: Option<&Arc<Looks>>) -> Chain {
    let judge = task.judged.as_ref().zip(looks).map(|(look, looks)| Judge::new(&task.parts, look, looks));
    let refits: Vec<Refit> = task.recipes.iter().map(refit).collect();
    let grounds: Vec<Ground> = task.parts.iter().map(|part| Ground::new(&part.mesh)).collect();
    let recorded = |recipe: usize| -> Vec<Option<&Progressive>> {
        task.parts.iter().map(|part| part.sequences.get(recipe).map(|key| &sequences[key])).collect()
    };
    let Some(judge) = &judge else {
        return chain(&parts(task, &grounds, &recorded(0), refits[0]), &task.settings, None);
    };
    let difference = |levels: &[Option<Level>]| judge.difference(levels);
    let chains: Vec<Chain> = (0..task.recipes.len())
        .map(|recipe| {
            let parts = parts(task, &grounds, &recorded(recipe), refits[recipe]);
            named(chain(&parts, &task.settings, Some(&difference)), task, recipe, "")
        })
        .collect();
    if task.rounds == 0 {
        let is_alone = chains.len() < 2;
        let rank = |chain: Chain| Candidate::new(chain, |level| if is_alone { 0.0 } else { difference(&level.parts) });
        return joined(best_of(chains.into_iter().map(rank)).into_iter().map(|(_, _, level)| level));
    }
    let around = Loop::new(judge, &task.parts);
    let seen = |level: &ChainLevel| around.difference(&level.parts);
    let mut candidates: Vec<Candidate> = chains.into_iter().map(|chain| Candidate::new(chain, seen)).collect();
    let sums: Vec<f64> = candidates.iter().map(|candidate| candidate.differences.iter().sum()).collect();
    let winner = (0..sums.len()).reduce(|best, next| if sums[next] < sums[best] { next } else { best }).unwrap_or(0);
    let start = around.visibility();
    let mut weights = start.clone();
    let mut rounds: Vec<Vec<Option<Progressive>>> = Vec::new();
    for round in 0..=task.rounds {
        let made: Vec<Option<Progressive>> = (task.parts.par_iter().zip(&weights.0))
            .map(|(part, weights)| {
                let is_left = part.sequences.is_empty();
                (!is_left).then(|| simplify_weighted(&part.mesh, &task.recipes[winner].settings, weights))
            })
            .collect();
        let next = chain(&parts(task, &grounds, &borrowed(&made), refits[winner]), &task.settings, Some(&difference));
        let next = named(next, task, winner, &format!(", round {round}"));
        if round < task.rounds {
            let (next_weights, differences) = around.again(&weights, &start, &next.levels);
            weights = next_weights;
            candidates.push(Candidate { chain: next, differences });
        } else {
            candidates.push(Candidate::new(next, seen));
        }
        rounds.push(made);
    }
    let winners = best_of(candidates).into_iter().map(|(number, difference, level)| {
        if refits[winner] == Refit::Never || level.stop == Stop::LookLimit {
            return level;
        }
        // The same cut as it came, with its shape fitted, and with its normals too.
        let round = number.checked_sub(task.recipes.len());
        let own = round.map_or_else(|| recorded(number), |round| borrowed(&rounds[round]));
        let targets = vec![task.settings.targets[level.target]];
        let settings = lod::ChainSettings { targets, ..task.settings.clone() };
        let parts = |refit| parts(task, &grounds, &own, refit);
        let others =
            [Refit::Never, Refit::Shape, Refit::Whole].map(|refit| chain(&parts(refit), &settings, None).levels.pop());
        let others = others.into_iter().flatten().map(|other| ChainLevel {
            target: level.target,
            recipe: level.recipe.clone(),
            ..other
        });
        let mut best = (difference, level.clone());
        for other in others.filter(|other| other.parts != level.parts) {
            let difference = seen(&other);
            if difference < best.0 {
                best = (difference, other);
            }
        }
        best.1
    });
    joined(winners)
}

fn borrowed(sequences: &[Option<Progressive>]) -> Vec<Option<&Progressive>> {
    sequences.iter().map(Option::as_ref).collect()
}

/// Only where vertices are the level's own, and the time is there.
fn refit(recipe: &Recipe) -> Refit {
    let settings = &recipe.settings;
    let has_time = settings.memoryless && settings.metric == MetricKind::Its;
    if has_time && settings.placement == Placement::Optimal { Refit::Coarse } else { Refit::Never }
}

fn parts<'a>(
    chain: &'a ChainTask,
    grounds: &'a [Ground<'a>],
    sequences: &[Option<&'a Progressive>],
    refit: Refit,
) -> Vec<Part<'a>> {
    let hold_borders = chain.recipes.iter().any(|recipe| recipe.settings.lock_border);
    let part = |((task, ground), sequence): ((&'a PartTask, &'a Ground<'a>), Option<&'a Progressive>)| Part {
        ground,
        sequence,
        shareable: task.shareable,
        refit,
        hold_borders,
    };
    chain.parts.iter().zip(grounds).zip(sequences.iter().copied()).map(part).collect()
}

/// Notes in every level what made it, where there was a choice.
fn named(mut chain: Chain, task: &ChainTask, recipe: usize, more: &str) -> Chain {
    if 1 < task.recipes.len() + task.rounds {
        let name = format!("{}{more}", task.recipes[recipe].name);
        chain.levels.iter_mut().for_each(|level| level.recipe = Some(name.clone()));
    }
    chain
}

/// A chain, and how much each of its levels differs from the source to look at.
struct Candidate {
    chain: Chain,
    differences: Vec<f64>,
}

impl Candidate {
    /// Looks at every level.
    fn new(chain: Chain, seen: impl Fn(&ChainLevel) -> f64) -> Self {
        let differences = chain.levels.iter().map(seen).collect();
        Self { chain, differences }
    }
}

/// For each target the level that differs least, with the number of its chain and by how much; where looks were the target, the
/// one with the fewest triangles. The first of equals.
fn best_of(candidates: impl IntoIterator<Item = Candidate>) -> Vec<(usize, f64, ChainLevel)> {
    let mut by_target: BTreeMap<usize, Vec<(usize, f64, ChainLevel)>> = BTreeMap::new();
    for (number, candidate) in candidates.into_iter().enumerate() {
        for (level, difference) in candidate.chain.levels.into_iter().zip(candidate.differences) {
            by_target.entry(level.target).or_default().push((number, difference, level));
        }
    }
    let rank = |(_, difference, level): &(usize, f64, ChainLevel)| match level.stop {
        Stop::LookLimit => level.triangles as f64,
        _ => *difference,
    };
    let best = |levels: Vec<(usize, f64, ChainLevel)>| {
        levels.into_iter().reduce(|best, next| if rank(&next) < rank(&best) { next } else { best })
    };
    by_target.into_values().filter_map(best).collect()
}

/// A chain of these levels, without those that are no coarser than the one before them.
fn joined(levels: impl Iterator<Item = ChainLevel>) -> Chain {
    let mut before = usize::MAX;
    let coarser = levels.filter(|level| {
        let is_coarser = level.triangles < before;
        before = before.min(level.triangles);
        is_coarser
    });
    Chain { levels: coarser.collect() }
}

/// Figures of all chains whose looks are recorded: from the cache, or from pictures.
fn record_looks(plan: &Plan, cache: &Cache, load: LoadLooks, reporter: &dyn Reporter, out: &mut Baked) {
    let found: Vec<(JobKey, &LookTask, Found<Vec<LevelLook>>)> =
        plan.looks.par_iter().map(|(&key, task)| (key, task, look_up(cache, Bucket::Looks, key))).collect();
    let mut missing = Vec::new();
    for (key, task, found) in found {
        out.warnings.extend(found.warning);
        match found.value {
            Some(figures) => drop(out.looks.insert(key, Arc::new(figures))),
            None => missing.push((key, task)),
        }
    }
    if !missing.is_empty() {
        reporter.event(&Event::LooksStarted { meshes: missing.len() as u64 });
    }
    for group in by_scene(missing, |(_, task)| task.look.scene) {
        let looks = load(group[0].1.look.scene);
        let chains = &out.chains;
        let made: Vec<(JobKey, Vec<LevelLook>, Option<String>)> = group
            .par_iter()
            .map(|&(key, task)| {
                let judge = Judge::new(&plan.chains[&task.chain].parts, &task.look, &looks);
                let figures = chains[&task.chain].levels.iter().map(|level| judge.figures(&level.parts)).collect();
                let warning = store(cache, Bucket::Looks, key, &figures);
                reporter.event(&Event::LookFinished);
                (key, figures, warning)
            })
            .collect();
        for (key, figures, warning) in made {
            out.warnings.extend(warning);
            out.looks.insert(key, Arc::new(figures));
        }
    }
}

/// The sequences that the missing chains are cut from. Sub-meshes of chains that were found count as hits.
fn sequences(
    plan: &Plan,
    missing: &[(JobKey, &ChainTask)],
    mut ready: BTreeMap<JobKey, Progressive>,
    cache: &Cache,
    reporter: &dyn Reporter,
    out: &mut Baked,
) -> BTreeMap<JobKey, Progressive> {
    let mut wanted: BTreeSet<JobKey> =
        missing.iter().flat_map(|(_, task)| task.parts.iter().flat_map(|p| p.sequences.iter().copied())).collect();
    for (key, task) in &plan.sequences {
        if !wanted.contains(key) && !ready.contains_key(key) {
            out.hits += 1;
            tell(reporter, task, true);
        }
    }
    // Those whose chains were found are not needed any more.
    ready.retain(|key, _| wanted.remove(key));
    let mut sequences = recorded(plan, &wanted, cache, reporter, out);
    sequences.append(&mut ready);
    sequences
}

/// Sequences from the cache or made now.
fn recorded(
    plan: &Plan,
    wanted: &BTreeSet<JobKey>,
    cache: &Cache,
    reporter: &dyn Reporter,
    out: &mut Baked,
) -> BTreeMap<JobKey, Progressive> {
    // The largest first, so that no core is left with it at the end.
    let mut order: Vec<(JobKey, &SequenceTask)> = wanted.iter().map(|&key| (key, &plan.sequences[&key])).collect();
    order.sort_by_key(|(key, task)| (std::cmp::Reverse(task.mesh.triangles()), *key));
    let made: Vec<(JobKey, Progressive, bool, Vec<String>)> = order
        .par_iter()
        .with_max_len(1)
        .map(|&(key, task)| {
            let found: Found<Progressive> = look_up(cache, Bucket::Sequences, key);
            let mut warnings: Vec<String> = found.warning.into_iter().collect();
            let cached = found.value.is_some();
            let sequence = found.value.unwrap_or_else(|| {
                let mesh = task.hash.short();
                reporter.event(&Event::JobStarted { mesh, triangles: task.mesh.triangles() as u64 });
                let sequence = simplify(&task.mesh, &task.settings);
                warnings.extend(store(cache, Bucket::Sequences, key, &sequence));
                sequence
            });
            tell(reporter, task, cached);
            (key, sequence, cached, warnings)
        })
        .collect();
    let mut sequences = BTreeMap::new();
    for (key, sequence, cached, warnings) in made {
        out.warnings.extend(warnings);
        *(if cached { &mut out.hits } else { &mut out.jobs }) += 1;
        sequences.insert(key, sequence);
    }
    sequences
}

fn tell(reporter: &dyn Reporter, task: &SequenceTask, cached: bool) {
    let (mesh, triangles) = (task.hash.short(), task.mesh.triangles() as u64);
    reporter.event(&Event::JobFinished { mesh, triangles, cached });
}

struct Found<T> {
    value: Option<T>,
    warning: Option<String>,
}

/// A result from the cache. An entry that cannot be read is a miss.
fn look_up<T: DeserializeOwned>(cache: &Cache, bucket: Bucket, key: JobKey) -> Found<T> {
    match cache.get(bucket, &key) {
        Lookup::Miss => Found { value: None, warning: None },
        Lookup::Damaged(warning) => Found { value: None, warning: Some(warning.to_string()) },
        Lookup::Hit(bytes) => match postcard::from_bytes(&bytes) {
            Ok(value) => Found { value: Some(value), warning: None },
            Err(error) => Found { value: None, warning: Some(format!("cache entry {key} cannot be read: {error}")) },
        },
    }
}

/// Keeps a result; what went wrong is a warning, since the bake does not need it to be kept.
fn store<T: Serialize>(cache: &Cache, bucket: Bucket, key: JobKey, value: &T) -> Option<String> {
    let bytes = postcard::to_stdvec(value).expect("results hold only numbers, strings and lists");
    cache.put(bucket, &key, &bytes).err().map(|error| error.to_string())
}
