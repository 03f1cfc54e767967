//! Distance between two surfaces: nearest points through a bounding volume hierarchy.
//!
//! Knows positions and triangles only. Deterministic: splits by median, ties by triangle number.

mod grid;
pub mod near;

use crate::quadric::{cross, dot, sub};

/// A surface that can be asked for nearest points.
#[derive(Clone, Debug)]
pub struct Surface {
    triangles: Vec<[[f64; 3]; 3]>,
    nodes: Vec<Node>,
}

/// Leaf if `count > 0`: triangles `first..first + count`; else the children are the next node and `first`.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    first: u32,
    count: u32,
}

/// Triangles in a leaf.
const LEAF: usize = 8;

impl Surface {
    /// Builds the hierarchy over triangles given by their corners.
    pub fn new(triangles: &[[[f64; 3]; 3]]) -> Self {
        let mut items: Vec<Item> = triangles.iter().zip(0..).map(|(t, index)| Item::new(t, index)).collect();
        let mut nodes = Vec::with_capacity(triangles.len().div_ceil(LEAF) * 2);
        if !items.is_empty() {
            split(&mut items, 0, &mut nodes);
        }
        let mut out = Self { triangles: items.iter().map(|item| triangles[item.index as usize]).collect(), nodes };
        out.set_bounds();
        out
    }

    /// Whether there is nothing to be near to.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// From leaves to root: children come after their parents.
    fn set_bounds(&mut self) {
        for index in (0..self.nodes.len()).rev() {
            let node = self.nodes[index];
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            let mut include = |p: &[f64; 3], q: &[f64; 3]| {
                for i in 0..3 {
                    low[i] = if p[i] < low[i] { p[i] } else { low[i] };
                    high[i] = if q[i] > high[i] { q[i] } else { high[i] };
                }
            };
            if node.count == 0 {
                for child in [index + 1, node.first as usize] {
                    include(&self.nodes[child].low, &self.nodes[child].high);
                }
            } else {
                let leaf = &self.triangles[node.first as usize..(node.first + node.count) as usize];
                leaf.iter().flatten().for_each(|p| include(p, p));
            }
            (self.nodes[index].low, self.nodes[index].high) = (low, high);
        }
    }

    /// Squared distance from `p` to the surface if it is above `least_squared`, else some value not above that.
    /// Stops as soon as anything that near is found, so that a search for the largest of many distances is quick.
    pub fn squared_distance_above(&self, p: [f64; 3], least_squared: f64) -> f64 {
        let mut best = f64::INFINITY;
        let mut stack = [(0u32, 0.0f64); 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while 0 < depth {
            depth -= 1;
            let (index, near) = stack[depth];
            if best <= near {
                continue;
            }
            let node = &self.nodes[index as usize];
            if 0 < node.count {
                for triangle in &self.triangles[node.first as usize..(node.first + node.count) as usize] {
                    best = best.min(squared_distance_to_triangle(p, triangle));
                }
                if best <= least_squared {
                    return best;
                }
                continue;
            }
            let (a, b) = (index + 1, node.first);
            let near_a = self.nodes[a as usize].squared_distance(p);
            let near_b = self.nodes[b as usize].squared_distance(p);
            let (first, second) = if near_b < near_a { ((b, near_b), (a, near_a)) } else { ((a, near_a), (b, near_b)) };
            stack[depth] = second;
            stack[depth + 1] = first;
            depth += 2;
        }
        best
    }
}

impl Node {
    #[inline]
    fn squared_distance(&self, p: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(p) {
            let off = (low - at).max(at - high).max(0.0);
            sum += off * off;
        }
        sum
    }
}

/// A triangle while it looks for its place: sum of its corners, and its number.
#[derive(Clone, Copy)]
struct Item {
    sum: [f32; 3],
    index: u32,
}

impl Item {
    fn new(t: &[[f64; 3]; 3], index: u32) -> Self {
        Self { sum: [0, 1, 2].map(|i| (t[0][i] + t[1][i] + t[2][i]) as f32), index }
    }
}

/// Bits that order as the number does.
#[inline]
fn ordered(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Splits `items`, which start at `first`, at the median of the longest axis of their sums, as often as needed; adds the
/// nodes without bounds. Halving keeps the depth under 32, so that a fixed stack of 64 entries is enough for any search.
fn split(items: &mut [Item], first: usize, nodes: &mut Vec<Node>) {
    let node = nodes.len();
    nodes.push(Node { low: [0.0; 3], high: [0.0; 3], first: first as u32, count: items.len() as u32 });
    if items.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for item in items.iter() {
        for i in 0..3 {
            low[i] = if item.sum[i] < low[i] { item.sum[i] } else { low[i] };
            high[i] = if item.sum[i] > high[i] { item.sum[i] } else { high[i] };
        }
    }
    let extent = [0, 1, 2].map(|i| high[i] - low[i]);
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let middle = items.len() / 2;
    items.select_nth_unstable_by_key(middle, |item| u64::from(ordered(item.sum[axis])) << 32 | u64::from(item.index));
    let (left, right) = items.split_at_mut(middle);
    nodes[node].count = 0;
    // The first child follows its parent.
    split(left, first, nodes);
    nodes[node].first = nodes.len() as u32;
    split(right, first + middle, nodes);
}

/// C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5: the region of the triangle's plane decides.
fn squared_distance_to_triangle(p: [f64; 3], &[a, b, c]: &[[f64; 3]; 3]) -> f64 {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    let to = |q: [f64; 3]| {
        let off = sub(p, q);
        dot(off, off)
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return to(a);
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if 0.0 <= d3 && d4 <= d3 {
        return to(b);
    }
    let along = |o: [f64; 3], d: [f64; 3], t: f64| to([o[0] + d[0] * t, o[1] + d[1] * t, o[2] + d[2] * t]);
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && 0.0 <= d1 && d3 <= 0.0 {
        return along(a, ab, if d1 - d3 == 0.0 { 0.0 } else { d1 / (d1 - d3) });
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if 0.0 <= d6 && d5 <= d6 {
        return to(c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && 0.0 <= d2 && d6 <= 0.0 {
        return along(a, ac, if d2 - d6 == 0.0 { 0.0 } else { d2 / (d2 - d6) });
    }
    let va = d3 * d6 - d5 * d4;
    let (e, f) = (d4 - d3, d5 - d6);
    if va <= 0.0 && 0.0 <= e && 0.0 <= f {
        return along(b, sub(c, b), if e + f == 0.0 { 0.0 } else { e / (e + f) });
    }
    let n = cross(ab, ac);
    let squared = dot(n, n);
    if squared == 0.0 { to(a) } else { dot(ap, n) * dot(ap, n) / squared }
}

/// Largest distance from any of `points` to `surface`, if it is above `least`; else `least`. `∞` if the surface is
/// empty and there are points.
pub fn largest_distance(points: impl Iterator<Item = [f64; 3]>, surface: &Surface, least: f64) -> f64 {
    let least_squared = least * least;
    let most = points.fold(least_squared, |most, p| most.max(surface.squared_distance_above(p, most)));
    if most <= least_squared { least } else { most.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit square in z = 0, cut into `2 n²` triangles.
    fn square(n: usize) -> Vec<[[f64; 3]; 3]> {
        let at = |x: usize, y: usize| [x as f64 / n as f64, y as f64 / n as f64, 0.0];
        (0..n * n)
            .flat_map(|i| {
                let (x, y) = (i % n, i / n);
                let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    #[test]
    fn distances_to_a_square_are_the_closed_form() {
        let surface = Surface::new(&square(9));
        for (p, want) in [
            ([0.5, 0.5, 2.0], 2.0),
            ([0.31, 0.77, 0.0], 0.0),
            ([-3.0, 0.4, 4.0], 5.0),
            ([2.0, 2.0, 0.0], 2f64.sqrt()),
            ([1.5, 0.25, 0.0], 0.5),
        ] {
            let got = surface.squared_distance_above(p, -1.0).sqrt();
            assert!((got - want).abs() < 1e-12, "{p:?}: {got} for {want}");
        }
    }

    #[test]
    fn hierarchy_agrees_with_every_triangle() {
        // Points and triangles from a small linear congruence.
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let triangles: Vec<[[f64; 3]; 3]> =
            (0..300).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| next()))).collect();
        let surface = Surface::new(&triangles);
        for _ in 0..200 {
            let p = [next() * 3.0, next() * 3.0, next() * 3.0];
            let want = triangles.iter().map(|t| squared_distance_to_triangle(p, t)).fold(f64::INFINITY, f64::min);
            assert_eq!(surface.squared_distance_above(p, -1.0), want);
        }
    }

    #[test]
    fn largest_distance_finds_the_one_far_point() {
        let surface = Surface::new(&square(4));
        let points = (0..100).map(|i| [0.5, 0.5, if i == 57 { 0.25 } else { 0.01 }]);
        assert!((largest_distance(points, &surface, 0.0) - 0.25).abs() < 1e-12);
        assert_eq!(largest_distance(std::iter::empty(), &surface, 0.125), 0.125);
        assert_eq!(largest_distance(std::iter::once([0.0; 3]), &Surface::new(&[]), 0.0), f64::INFINITY);
    }
}
