//! Instances of one mesh, cut into cells that are small enough to switch levels as one.
//!
//! Knows places and sizes, no documents. Results use + − × ÷ √ alone, in the order of the instances.

use super::Instance;
use glam::DVec3;

/// Within a cell, sizes differ by no more than this factor: the largest instance decides when the cell may show a level.
const SIZES: f64 = 4.0;

/// Instances that become one batch.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    /// Where its node stands: the middle of the box round the middles of its instances.
    pub(super) middle: [f32; 3],
    /// In their order in the file; never empty.
    pub(super) instances: Vec<Instance>,
}

/// Cuts instances of a mesh of this `radius` into cells whose own radius is at most `reach` times that of their largest
/// instance. Halves the longest side of what is too large, so the time is near linear in the number of instances.
pub(super) fn cut(instances: Vec<Instance>, radius: f64, reach: f64) -> Vec<Cell> {
    let mut cells = Vec::new();
    let mut open = vec![instances];
    while let Some(instances) = open.pop() {
        let Some((low, high)) = bounds(instances.iter().map(|i| i.middle)) else { continue };
        let sizes = || instances.iter().map(Instance::size);
        let (smallest, largest) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
        let middle = (low + high) * 0.5;
        let spread = instances.iter().map(|i| i.middle.distance_squared(middle)).fold(0.0, f64::max).sqrt();
        let halves = if SIZES * smallest < largest {
            let between = (smallest * largest).sqrt();
            instances.into_iter().partition(|i| i.size() < between)
        } else if spread <= reach * radius * largest {
            cells.push(Cell { middle: middle.to_array().map(|v| v as f32), instances });
            continue;
        } else {
            let axis = (high - low).max_position();
            let (below, above): (Vec<_>, Vec<_>) = instances.into_iter().partition(|i| i.middle[axis] < middle[axis]);
            if below.is_empty() {
                // Neighbouring numbers have no middle.
                cells.push(Cell { middle: middle.to_array().map(|v| v as f32), instances: above });
                continue;
            }
            (below, above)
        };
        open.extend([halves.1, halves.0]);
    }
    cells
}

fn bounds(points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    points.fold(None, |found, p| Some(found.map_or((p, p), |(low, high): (DVec3, DVec3)| (low.min(p), high.max(p)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(node: usize, middle: [f64; 3], size: f32) -> Instance {
        let middle = DVec3::from_array(middle);
        Instance { node, translation: middle, rotation: [0.0, 0.0, 0.0, 1.0], scale: [size; 3], middle }
    }

    #[test]
    fn every_instance_is_in_one_cell_that_is_small_enough() {
        let grid = (0..1000).map(|i| at(i, [f64::from(i as u32 % 10), f64::from(i as u32 / 10), 0.0], 1.0));
        let cells = cut(grid.collect(), 0.5, 8.0);
        let mut nodes: Vec<usize> = cells.iter().flat_map(|cell| cell.instances.iter().map(|i| i.node)).collect();
        nodes.sort_unstable();
        assert_eq!(nodes, (0..1000).collect::<Vec<_>>());
        assert!(cells.len() > 10 && cells.len() < 64, "{}", cells.len());
        for cell in &cells {
            let middle = DVec3::from_array(cell.middle.map(f64::from));
            assert!(cell.instances.iter().all(|i| i.middle.distance(middle) <= 4.0 + 1e-6));
            assert!(cell.instances.windows(2).all(|w| w[0].node < w[1].node));
        }
    }

    #[test]
    fn large_and_small_ones_are_apart_and_coinciding_ones_together() {
        let mixed = (0..20).map(|i| at(i, [0.0; 3], if i % 2 == 0 { 1.0 } else { 10.0 }));
        let cells = cut(mixed.collect(), 1.0, 1.0);
        assert_eq!(cells.iter().map(|cell| cell.instances.len()).collect::<Vec<_>>(), [10, 10]);
        assert_eq!(cells[0].instances[0].node, 0);
        assert!(cut(Vec::new(), 1.0, 1.0).is_empty());
        // No cell is small enough for a mesh without extent, and still there is an end.
        assert_eq!(cut((0..8).map(|i| at(i, [f64::from(i as u32 / 4); 3], 1.0)).collect(), 0.0, 1.0).len(), 2);
    }
}
