//! Plan → baked chains: look up, run the rest, store. Knows no scene, no path and no thread's number.
//!
//! Sequences and chains are separate results: another ratio cuts the same sequence anew. A sequence is only looked up
//! where a chain is missing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::cache::{Bucket, Cache, Lookup};
use crate::key::JobKey;
use crate::lod::{Chain, Part, chain};
use crate::plan::{ChainTask, Plan, SequenceTask};
use crate::progress::{Event, Reporter};
use crate::simplify::progressive::Progressive;
use crate::simplify::simplify;

/// What came of a plan.
#[derive(Debug, Default)]
pub struct Baked {
    /// All chains of the plan.
    pub chains: BTreeMap<JobKey, Arc<Chain>>,
    /// Sub-meshes that were simplified.
    pub jobs: usize,
    /// Sub-meshes whose results came from the cache.
    pub hits: usize,
    /// Damaged entries and results that could not be stored; the bake is whole all the same.
    pub warnings: Vec<String>,
}

/// Makes every chain of `plan`.
pub fn work(plan: &Plan, cache: &Cache, reporter: &dyn Reporter) -> Baked {
    let mut out = Baked::default();
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
    let sequences = sequences(plan, &missing, cache, reporter, &mut out);
    let made: Vec<(JobKey, Arc<Chain>, Option<String>)> = missing
        .par_iter()
        .map(|(key, task)| {
            let chain = cut(task, &sequences);
            let warning = store(cache, Bucket::Chains, *key, &chain);
            (*key, Arc::new(chain), warning)
        })
        .collect();
    for (key, chain, warning) in made {
        out.warnings.extend(warning);
        out.chains.insert(key, chain);
    }
    out
}

fn cut(task: &ChainTask, sequences: &BTreeMap<JobKey, Progressive>) -> Chain {
    let part = |part: &crate::plan::PartTask| part.sequence.map(|key| &sequences[&key]);
    let parts: Vec<Part> =
        task.parts.iter().map(|p| Part { mesh: &p.mesh, sequence: part(p), shareable: p.shareable }).collect();
    chain(&parts, &task.settings)
}

/// The sequences that the missing chains are cut from. Sub-meshes of chains that were found count as hits.
fn sequences(
    plan: &Plan,
    missing: &[(JobKey, &ChainTask)],
    cache: &Cache,
    reporter: &dyn Reporter,
    out: &mut Baked,
) -> BTreeMap<JobKey, Progressive> {
    let wanted: BTreeSet<JobKey> =
        missing.iter().flat_map(|(_, task)| task.parts.iter().filter_map(|p| p.sequence)).collect();
    for (key, task) in &plan.sequences {
        if !wanted.contains(key) {
            out.hits += 1;
            tell(reporter, task, true);
        }
    }
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
