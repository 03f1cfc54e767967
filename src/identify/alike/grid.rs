//! Points by place: which is the nearest within a distance that is small beside the whole.

use glam::DVec3;
use std::collections::HashMap;

/// Points in cubes.
#[derive(Debug)]
pub(super) struct Grid {
    size: f64,
    /// For each cube, where its points stand in `items`.
    cells: HashMap<[i64; 3], (u32, u32)>,
    items: Vec<u32>,
}

impl Grid {
    /// `reach` is the largest distance that will be asked for, more than 0.
    pub(super) fn new(points: &[DVec3], reach: f64) -> Self {
        // Most balls of this radius lie in one cube.
        let size = 4.0 * reach;
        let mut keyed: Vec<([i64; 3], u32)> = (0..).zip(points).map(|(i, p)| (cell(*p, size), i)).collect();
        keyed.sort_unstable();
        let mut cells = HashMap::new();
        let mut from = 0u32;
        for run in keyed.chunk_by(|a, b| a.0 == b.0) {
            let to = from + run.len() as u32;
            cells.insert(run[0].0, (from, to));
            from = to;
        }
        Self { size, cells, items: keyed.into_iter().map(|(_, i)| i).collect() }
    }

    /// Numbers of the points in all cubes that a ball touches; ascending within a cube.
    pub(super) fn near(&self, middle: DVec3, radius: f64) -> impl Iterator<Item = u32> + '_ {
        let low = cell(middle - DVec3::splat(radius), self.size);
        let high = cell(middle + DVec3::splat(radius), self.size);
        let cubes = (low[0]..=high[0])
            .flat_map(move |x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| [x, y, z])));
        cubes
            .filter_map(|cube| self.cells.get(&cube))
            .flat_map(|&(from, to)| self.items[from as usize..to as usize].iter().copied())
    }

    /// The nearest of the `points` that the grid was made of, of those that `fits` takes, within `radius`; of equally
    /// near ones the first.
    pub(super) fn nearest(
        &self,
        points: &[DVec3],
        middle: DVec3,
        radius: f64,
        fits: impl Fn(u32) -> bool,
    ) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        for i in self.near(middle, radius) {
            let distance = points[i as usize].distance_squared(middle);
            let nearer = best.is_none_or(|(least, at)| distance < least || (distance == least && i < at));
            if distance <= radius * radius && nearer && fits(i) {
                best = Some((distance, i));
            }
        }
        best.map(|(_, i)| i)
    }
}

fn cell(p: DVec3, size: f64) -> [i64; 3] {
    [p.x, p.y, p.z].map(|c| (c / size).floor() as i64)
}
