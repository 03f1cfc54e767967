//! Nearest points of a surface through a grid of cubes: made in a few passes, for surfaces that are asked for a few
//! hundred points of which a bound is known. A hierarchy ([`super::Surface`]) answers quicker and takes longer to make.
//!
//! Each triangle lies in the one cube that has the middle of its box; a search reaches one cube further. Those that are
//! larger are kept apart. Where triangles are so uneven that most share a few cubes, a hierarchy it is.

use super::{Surface, squared_distance_to_triangle};

/// The triangles of a surface by place.
#[derive(Debug)]
pub(super) struct Grid {
    low: [f64; 3],
    /// Length of a cube's edge.
    size: f64,
    cells: [usize; 3],
    /// Triangles of each cube lie from here to the next cube's start in `items`.
    start: Vec<u32>,
    items: Vec<u32>,
    /// Triangles with a corner more than `size` from the middle of their box, in some direction.
    large: Vec<u32>,
    /// Instead of all that.
    tree: Option<Surface>,
}

/// Cubes along the longest side, at most.
const MOST_CELLS: f64 = 64.0;

/// Length of a cube's edge, in mean half extents of a triangle.
const SIZE: f64 = 3.0;

/// A triangle shares its cube with so many at most, in the mean; and of so many one at most is large.
const MOST_SHARING: usize = 512;
const FEW_LARGE: usize = 64;

/// No cube.
const LARGE: u32 = u32::MAX;

/// Middle of a triangle's box, and its largest half extent. Single precision may put a triangle into the cube beside its
/// own: searches allow for that.
#[inline]
fn place(positions: &[[f32; 3]], triangle: [u32; 3]) -> ([f32; 3], f32) {
    let least = |a: f32, b: f32| if a < b { a } else { b };
    let most = |a: f32, b: f32| if a < b { b } else { a };
    let corners = triangle.map(|v| positions[v as usize]);
    let mut half = 0.0f32;
    let middle = [0, 1, 2].map(|i| {
        let [a, b, c] = corners.map(|p| p[i] * 0.5);
        let (low, high) = (least(least(a, b), c), most(most(a, b), c));
        half = most(half, high - low);
        low + high
    });
    (middle, half)
}

#[inline]
fn corners(positions: &[[f32; 3]], triangle: [u32; 3]) -> [[f64; 3]; 3] {
    triangle.map(|v| positions[v as usize].map(f64::from))
}

impl Grid {
    /// Of `triangles` over `positions`.
    pub(super) fn new(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let (mut low, mut high, mut sum) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], 0.0);
        for &t in triangles {
            let (middle, half) = place(positions, t);
            sum += f64::from(half);
            for i in 0..3 {
                low[i] = if middle[i] < low[i] { middle[i] } else { low[i] };
                high[i] = if high[i] < middle[i] { middle[i] } else { high[i] };
            }
        }
        let extent = [0, 1, 2].map(|i| f64::from((high[i] - low[i]).max(0.0)));
        let longest = extent.into_iter().fold(0.0, f64::max);
        let size = (SIZE * sum / triangles.len().max(1) as f64).max(longest / MOST_CELLS).max(1e-30);
        let cells = extent.map(|length| (length / size) as usize + 1);
        let mut grid = Self {
            low: low.map(f64::from),
            size,
            cells,
            start: Vec::new(),
            items: Vec::new(),
            large: Vec::new(),
            tree: None,
        };
        // Counted two places on, so that filling moves each start to its own place.
        let mut start = vec![0u32; cells.iter().product::<usize>() + 2];
        let mut cell_of = Vec::with_capacity(triangles.len());
        for (number, &t) in (0..).zip(triangles) {
            let (middle, half) = place(positions, t);
            if f64::from(half) <= size {
                let cell = grid.cell(middle.map(f64::from));
                start[cell + 2] += 1;
                cell_of.push(cell as u32);
            } else {
                grid.large.push(number);
                cell_of.push(LARGE);
            }
        }
        let sharing: usize = start.iter().map(|&n| n as usize * n as usize).sum();
        if MOST_SHARING * triangles.len() < sharing || triangles.len() < grid.large.len() * FEW_LARGE {
            let all: Vec<_> = triangles.iter().map(|&t| corners(positions, t)).collect();
            return Self { large: Vec::new(), tree: Some(Surface::new(&all)), ..grid };
        }
        for at in 2..start.len() {
            start[at] += start[at - 1];
        }
        let mut items = vec![0; triangles.len() - grid.large.len()];
        for (number, &cell) in (0..).zip(&cell_of).filter(|(_, cell)| **cell != LARGE) {
            let at = &mut start[cell as usize + 1];
            items[*at as usize] = number;
            *at += 1;
        }
        Self { start, items, ..grid }
    }

    /// Number of the cube along `axis`, from 0.
    #[inline]
    fn along(&self, axis: usize, x: f64) -> usize {
        // Saturates at 0 below, whatever the number.
        (((x - self.low[axis]) / self.size) as usize).min(self.cells[axis] - 1)
    }

    #[inline]
    fn cell(&self, [x, y, z]: [f64; 3]) -> usize {
        (self.along(2, z) * self.cells[1] + self.along(1, y)) * self.cells[0] + self.along(0, x)
    }

    /// Squared distance from `p` to the surface, which is not above `bound`, if it is above `least`; else some value not
    /// above that. `positions` and `triangles` are those that the grid was made of.
    pub(super) fn squared_distance_above(
        &self,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        p: [f64; 3],
        least: f64,
        bound: f64,
    ) -> f64 {
        if let Some(tree) = &self.tree {
            return tree.squared_distance_above(p, least);
        }
        let mut nearest = bound;
        let mut test = |numbers: &[u32]| {
            for &number in numbers {
                let squared = squared_distance_to_triangle(p, &corners(positions, triangles[number as usize]));
                nearest = if squared < nearest { squared } else { nearest };
            }
            nearest
        };
        let mut best = test(&self.large);
        if best <= least || self.items.is_empty() {
            return best;
        }
        // A triangle nearer than the bound has its middle in these cubes: it reaches as far as one more, and a little.
        let margin =
            self.size * 1.0001 + 1e-6 * self.low.into_iter().chain(p).fold(0.0, |most: f64, x| most.max(x.abs()));
        let reach = bound.sqrt() + margin;
        let from = [0, 1, 2].map(|i| self.along(i, p[i] - reach));
        let to = [0, 1, 2].map(|i| self.along(i, p[i] + reach));
        // How far `p` is from all triangles of the cubes of one number along an axis.
        let off = |axis: usize, number: usize| {
            let low = self.low[axis] + number as f64 * self.size;
            let off = (low - margin - p[axis]).max(p[axis] - (low + self.size + margin)).max(0.0);
            off * off
        };
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                if best <= off(2, z) + off(1, y) {
                    continue;
                }
                let row = (z * self.cells[1] + y) * self.cells[0];
                let (first, last) = (self.start[row + from[0]], self.start[row + to[0] + 1]);
                best = test(&self.items[first as usize..last as usize]);
                if best <= least {
                    return best;
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances that a grid and a hierarchy find, for points in and around a surface, bounds being right or absent.
    fn check(positions: &[[f32; 3]], triangles: &[[u32; 3]], is_even: bool) {
        let tree = Surface::new(&triangles.iter().map(|&t| corners(positions, t)).collect::<Vec<_>>());
        let grid = Grid::new(positions, triangles);
        assert_eq!(grid.tree.is_none(), is_even);
        for i in 0..500 {
            let p = [i % 5, i / 5 % 10, i / 50].map(|x| f64::from(x) * 0.3 - 0.7);
            let want = tree.squared_distance_above(p, -1.0);
            for bound in [want, want * 1.5, want + 0.3, f64::INFINITY] {
                assert_eq!(grid.squared_distance_above(positions, triangles, p, -1.0, bound), want, "{p:?}, {bound}");
            }
            assert!(grid.squared_distance_above(positions, triangles, p, want, f64::INFINITY) <= want);
        }
    }

    /// Triangles from a small linear congruence, all within `extent` of their first corner.
    fn scattered(count: u32, extent: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let mut state = 1u64;
        let mut next = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let mut positions = Vec::new();
        for _ in 0..count {
            let first: [f32; 3] = std::array::from_fn(|_| next());
            positions.push(first);
            positions.extend([(); 2].map(|()| first.map(|x| x + next() * extent)));
        }
        (positions, (0..count).map(|i| [i * 3, i * 3 + 1, i * 3 + 2]).collect())
    }

    #[test]
    fn a_grid_finds_what_a_hierarchy_finds() {
        let (mut positions, mut triangles) = scattered(2000, 0.03);
        check(&positions, &triangles, true);
        // One triangle across all.
        let first = positions.len() as u32;
        positions.extend([[-2.0, -2.0, -2.0], [3.0, -1.0, 0.0], [0.0, 3.0, 3.0]]);
        triangles.push([first, first + 1, first + 2]);
        check(&positions, &triangles, true);
    }

    #[test]
    fn a_crowd_far_from_the_rest_gets_a_hierarchy() {
        let (mut positions, mut triangles) = scattered(2000, 0.03);
        positions.iter_mut().skip(3).flatten().for_each(|x| *x *= 1e-3);
        check(&positions, &triangles, false);
        triangles.clear();
        assert_eq!(
            Grid::new(&positions, &triangles).squared_distance_above(&positions, &triangles, [0.0; 3], 0.0, 9.0),
            9.0
        );
    }
}
