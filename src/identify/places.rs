//! Vertices at the same place: positions that are equal bit for bit (with one zero). Sorting does the work, so the time is near-linear
//! for any input and the result does not depend on chance.

use crate::mesh::hash::positive_zero;

/// A position by its bits.
pub type Key = [u32; 3];

/// For each point the number of its place, and the key of each place, ascending.
pub fn places<'p>(points: impl IntoIterator<Item = &'p [f32; 3]>) -> (Vec<u32>, Vec<Key>) {
    let keys = points.into_iter().map(|point| point.map(positive_zero));
    let mut sorted: Vec<(Key, u32)> = keys.zip(0..).collect();
    sorted.sort_unstable();
    let mut place = vec![0u32; sorted.len()];
    let mut keys: Vec<Key> = Vec::new();
    for (key, vertex) in sorted {
        if keys.last() != Some(&key) {
            keys.push(key);
        }
        place[vertex as usize] = (keys.len() - 1) as u32;
    }
    (place, keys)
}
