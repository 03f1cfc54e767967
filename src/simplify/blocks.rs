//! Large surfaces, block by block and side by side.
//!
//! The faces are parted in space into blocks, each is simplified as if it were alone, but for the vertices that it shares
//! with others, which take part in no pair. What was done in all blocks is then taken into the sequence, the
//! cheapest first, until few enough faces are left, and the whole surface is made anew from it; what would go beyond that is
//! forgotten. Again with other blocks, until
//! the surface is no longer large; the rest, and what was left standing between blocks, is the finishing run's.
//!
//! Blocks depend on the surface alone, never on the number of threads. A pair in a block has all faces of both its vertices
//! there, so its price and its place are what they would be in the whole. The metric begins anew in each block, and again
//! after them: what it had added up by then is forgotten, as a memoryless one forgets it at each step.

use rayon::prelude::*;

use super::Locks;
use super::driver::{Driver, Record};
use super::progressive::{Recorder, Taken};
use super::queue::bin;
use crate::mesh::topology::{Contraction, Merges, Part, Topology};
use crate::mesh::weld::NONE;
use crate::metric::{Parted, Price};

/// Which surfaces are large.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Surfaces of more faces are done in blocks first,
    pub large: usize,
    /// until no more are left than this.
    pub enough: usize,
    /// Faces of a block, about.
    pub block: usize,
}

impl Sizes {
    /// What is used.
    pub const USUAL: Self = Self { large: 200_000, enough: 64_000, block: 32_000 };
}

/// Fewest blocks.
const FEWEST: usize = 4;

/// Share of its faces that a block is brought down to, and that of the whole surface at which the blocks' work ends. The
/// first is less, so that flat blocks can give more than others.
const LEAST_SHARE: f64 = 0.28;
const SHARE: f64 = 0.35;

/// Where blocks are cut in two, by turns: not in the same places as in the turn before.
const CUTS: [f64; 3] = [0.5, 0.36, 0.57];

/// Reduces `surface` until it is not large any more, or as far as that goes.
pub fn reduce<E: Parted>(surface: &mut Topology, metric: &E, locks: &Locks, recorder: &mut Recorder, sizes: Sizes) {
    for cut in CUTS.into_iter().cycle() {
        let before = surface.alive;
        if before <= sizes.enough {
            return;
        }
        let blocks = blocks(surface, sizes.block, cut);
        let owners = owners(surface, &blocks);
        let logs: Vec<Log> =
            blocks.into_par_iter().map(|faces| run_alone(surface, metric, locks, &owners, faces)).collect();
        drop(owners);
        repeat(surface, &logs, (before as f64 * SHARE) as usize, recorder);
        if before - before / 8 < surface.alive {
            return;
        }
    }
}

/// The faces of each block, in order.
fn blocks(surface: &Topology, size: usize, cut: f64) -> Vec<Vec<u32>> {
    let item = |(number, face)| {
        let p = surface.corners(face);
        Item { place: [0, 1, 2].map(|i| (p[0][i] + p[1][i] + p[2][i]) as f32), number }
    };
    let mut items: Vec<Item> = (0..).zip(&surface.faces).filter(|(_, face)| face.is_alive()).map(item).collect();
    let count = (items.len() / size).next_power_of_two().max(FEWEST);
    let mut out: Vec<Vec<u32>> = Vec::with_capacity(count);
    split(&mut items, count, cut, &mut |block| {
        let mut faces: Vec<u32> = block.iter().map(|item| item.number).collect();
        faces.sort_unstable();
        out.push(faces);
    });
    out
}

/// A face while it looks for its block: sum of its corners, and its number.
#[derive(Clone, Copy)]
struct Item {
    place: [f32; 3],
    number: u32,
}

/// Halves `items` across the longest axis until there are `count` blocks.
fn split(items: &mut [Item], count: usize, cut: f64, visit: &mut impl FnMut(&[Item])) {
    if count < 2 || items.len() < 2 {
        visit(items);
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for item in items.iter() {
        for i in 0..3 {
            low[i] = if item.place[i] < low[i] { item.place[i] } else { low[i] };
            high[i] = if item.place[i] > high[i] { item.place[i] } else { high[i] };
        }
    }
    let extent = [0, 1, 2].map(|i| high[i] - low[i]);
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let middle = (items.len() as f64 * cut) as usize;
    items.select_nth_unstable_by(middle, |a, b| a.place[axis].total_cmp(&b.place[axis]).then(a.number.cmp(&b.number)));
    let (left, right) = items.split_at_mut(middle);
    split(left, count / 2, cut, visit);
    split(right, count / 2, cut, visit);
}

/// The block of all faces of each vertex, or [`SHARED`].
fn owners(surface: &Topology, blocks: &[Vec<u32>]) -> Vec<u32> {
    let mut owners = vec![NONE; surface.positions.len()];
    for (block, faces) in (0..).zip(blocks) {
        for &v in faces.iter().flat_map(|&face| &surface.faces[face as usize].v) {
            let owner = &mut owners[v as usize];
            *owner = if *owner == NONE || *owner == block { block } else { SHARED };
        }
    }
    owners
}

/// More than one block.
const SHARED: u32 = NONE - 1;

/// What was done in a block, in numbers of the whole surface.
struct Log {
    /// Numbers in the whole, by numbers in the block.
    vertices: Vec<u32>,
    wedges: Vec<u32>,
    /// Faces left in the block.
    alive: usize,
    steps: Vec<LogStep>,
    /// Wedges that the steps joined, those of one step after the other.
    merged: Vec<[u32; 2]>,
    /// Wedges whose values the steps set, and the values.
    set: Vec<u32>,
    values: Vec<f32>,
}

struct LogStep {
    taken: Taken,
    /// Faces that it took away.
    saved: usize,
    /// Ends of its entries in [`Log::merged`] and [`Log::set`].
    merged_end: usize,
    set_end: usize,
}

impl Record for Log {
    fn record(&mut self, surface: &Topology, done: &Contraction, price: &Price, _: Option<f64>) {
        let whole = |wedge: u32| self.wedges[wedge as usize];
        self.merged.extend(done.merged.iter().map(|pair| pair.map(whole)));
        for wedge in surface.wedges(done.kept) {
            self.set.push(whole(wedge));
            self.values.extend_from_slice(surface.value(wedge));
        }
        self.steps.push(LogStep {
            taken: Taken {
                kept: self.vertices[done.kept as usize],
                gone: self.vertices[done.gone as usize],
                position: price.position,
                t: done.t as f32,
                place: done.place,
                cost: price.cost,
            },
            saved: self.alive - surface.alive,
            merged_end: self.merged.len(),
            set_end: self.set.len(),
        });
        self.alive = surface.alive;
    }
}

/// Simplifies a block of `surface`.
fn run_alone<E: Parted>(surface: &Topology, metric: &E, locks: &Locks, owners: &[u32], faces: Vec<u32>) -> Log {
    let mut part: Part = surface.part(faces);
    let mut metric = metric.part(&part);
    metric.begin(&part.surface);
    let locks = locks.part(&part, |vertex| owners[vertex as usize] == SHARED);
    let alive = part.surface.alive;
    let log = Log {
        vertices: std::mem::take(&mut part.vertices),
        wedges: std::mem::take(&mut part.wedges),
        alive,
        steps: Vec::with_capacity(alive / 2),
        merged: Vec::with_capacity(alive / 2),
        set: Vec::with_capacity(alive / 2),
        values: Vec::with_capacity(alive / 2 * surface.columns),
    };
    let enough = (alive as f64 * LEAST_SHARE) as usize;
    let log = Driver::new(&mut part.surface, metric, &locks, log).run(enough);
    Log { vertices: Vec::new(), wedges: Vec::new(), ..log }
}

/// Does in `surface` what was done in the blocks, cheapest first, until at most `enough` faces are left.
fn repeat(surface: &mut Topology, logs: &[Log], enough: usize, recorder: &mut Recorder) {
    let mut order: Vec<(u32, u32)> = Vec::with_capacity(logs.iter().map(|log| log.steps.len()).sum());
    for (number, log) in (0..).zip(logs) {
        let mut dearest = 0;
        order.extend(log.steps.iter().map(|step| {
            dearest = bin(step.taken.cost).max(dearest);
            (dearest as u32, number)
        }));
    }
    // Stable: each block's steps stay in their order.
    order.sort_by_key(|&(bin, _)| bin);
    let mut next = vec![0usize; logs.len()];
    let mut alive = surface.alive;
    for (_, number) in order {
        if alive <= enough {
            break;
        }
        let (log, at) = (&logs[number as usize], &mut next[number as usize]);
        alive -= log.steps[*at].saved;
        recorder.take(&log.steps[*at].taken, log.merged_at(*at), log.set_at(*at, surface.columns), alive);
        *at += 1;
    }
    let mut merges = Merges::new(surface);
    for (log, steps) in logs.iter().zip(next) {
        for (at, LogStep { taken, .. }) in log.steps[..steps].iter().enumerate() {
            merges.add(surface, taken.kept, taken.gone, taken.position, log.merged_at(at));
            for (wedge, values) in log.set_at(at, surface.columns) {
                surface.value_mut(wedge).copy_from_slice(values);
            }
        }
    }
    surface.settle(merges);
}

impl Log {
    /// Wedges that a step joined.
    fn merged_at(&self, step: usize) -> &[[u32; 2]] {
        &self.merged[step.checked_sub(1).map_or(0, |last| self.steps[last].merged_end)..self.steps[step].merged_end]
    }

    /// Wedges whose values a step set, with the values, `columns` each.
    fn set_at(&self, step: usize, columns: usize) -> impl Iterator<Item = (u32, &[f32])> {
        let range = step.checked_sub(1).map_or(0, |last| self.steps[last].set_end)..self.steps[step].set_end;
        range.map(move |at| (self.set[at], &self.values[at * columns..][..columns]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::simplify::progressive::Progressive;
    use crate::simplify::tests::{BALANCED, all_settings, torus};
    use crate::simplify::{Settings, simplify_sized};

    const SMALL: Sizes = Sizes { large: 2000, enough: 1500, block: 500 };

    fn by_threads(mesh: &Mesh, settings: &Settings, threads: usize) -> Progressive {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| simplify_sized(mesh, settings, &[], SMALL))
    }

    #[test]
    fn blocks_give_the_same_with_any_number_of_threads() {
        let mesh = torus(96, 64);
        for settings in all_settings() {
            let one = by_threads(&mesh, &settings, 1);
            assert_eq!(one, by_threads(&mesh, &settings, 3), "{settings:?}");
        }
    }

    #[test]
    fn a_surface_done_in_blocks_is_about_as_near_as_one_done_at_once() {
        let mesh = torus(96, 64);
        let whole = simplify_sized(&mesh, &BALANCED, &[], Sizes::USUAL);
        let parted = simplify_sized(&mesh, &BALANCED, &[], SMALL);
        assert_ne!(whole, parted);
        assert_eq!(whole.triangles, parted.triangles);
        for ratio in [0.5, 0.2, 0.05] {
            let triangles = (f64::from(whole.triangles) * ratio) as usize;
            let sum = |s: &Progressive| s.steps[..s.cut_at(triangles)].iter().map(|s| f64::from(s.cost)).sum::<f64>();
            let (whole, parted) = (sum(&whole), sum(&parted));
            // Fourth powers of distances, and blocks of few faces.
            assert!(parted < 2.0 * whole, "{ratio}: {parted} for {whole}");
        }
    }

    #[test]
    fn every_face_is_in_one_block() {
        let mesh = torus(30, 20);
        let layout = crate::mesh::layout::Layout::new(&mesh, BALANCED.attributes);
        let (surface, _) = Topology::new(&mesh, &layout);
        for cut in CUTS {
            let mut all: Vec<u32> = blocks(&surface, 100, cut).concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..surface.faces.len() as u32));
        }
    }
}
