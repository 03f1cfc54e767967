//! Largest distance between two surfaces of which it is known which places correspond.
//!
//! Where a point comes from a vertex of the other surface's numbering, the faces around that vertex, or around the vertex
//! that a walk downhill from there ends at, are near the point: their distance bounds the true one from above, and nearly
//! always shows that the point cannot be the one that is furthest off. Only the others are searched for. The
//! result is that of a search for every point.

use std::sync::OnceLock;

use super::grid::Grid;
use super::squared_distance_to_triangle;
use crate::quadric::{dot, sub};

/// A surface with its connectivity.
#[derive(Debug)]
pub struct Sheet<'a> {
    positions: &'a [[f32; 3]],
    triangles: Vec<[u32; 3]>,
    /// Faces of each vertex lie from here to the next vertex's start in `ring`.
    start: Vec<u32>,
    ring: Vec<u32>,
    /// Made when the first point needs it.
    grid: OnceLock<Grid>,
}

/// Longest walk, in edges.
const MOST_STEPS: usize = 64;

impl<'a> Sheet<'a> {
    /// A surface over `positions`; not all of them need be used.
    pub fn new(positions: &'a [[f32; 3]], triangles: Vec<[u32; 3]>) -> Self {
        // Counted two places on, so that filling moves each start to its own place.
        let mut start = vec![0u32; positions.len() + 2];
        for &v in triangles.iter().flatten() {
            start[v as usize + 2] += 1;
        }
        for at in 2..start.len() {
            start[at] += start[at - 1];
        }
        let mut ring = vec![0; triangles.len() * 3];
        for (index, t) in triangles.iter().enumerate() {
            for &v in t {
                let at = &mut start[v as usize + 1];
                ring[*at as usize] = index as u32;
                *at += 1;
            }
        }
        Self { positions, triangles, start, ring, grid: OnceLock::new() }
    }

    /// The triangles, as vertices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Position of a vertex.
    #[inline]
    pub fn position(&self, vertex: u32) -> [f64; 3] {
        self.positions[vertex as usize].map(f64::from)
    }

    /// Corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: [u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|v| self.position(v))
    }

    fn ring(&self, vertex: u32) -> &[u32] {
        &self.ring[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }

    /// Squared distance from `p` to the nearest of the faces at `vertex`; stops at the first that is not above `enough`.
    #[inline]
    fn to_ring(&self, p: [f64; 3], vertex: u32, enough: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let ring = self.ring(vertex);
        let off = sub(self.position(vertex), p);
        if !ring.is_empty() && dot(off, off) <= enough {
            return dot(off, off);
        }
        for &face in ring {
            nearest = nearest.min(squared_distance_to_triangle(p, &self.corners(self.triangles[face as usize])));
            if nearest <= enough {
                break;
            }
        }
        nearest
    }

    /// The vertex nearest to `p` on a walk downhill from `vertex`.
    fn walk(&self, p: [f64; 3], vertex: u32) -> u32 {
        let squared = |v: u32| {
            let off = sub(self.position(v), p);
            dot(off, off)
        };
        let mut here = (squared(vertex), vertex);
        for _ in 0..MOST_STEPS {
            let mut next = here;
            for &v in self.ring(here.1).iter().flat_map(|&face| &self.triangles[face as usize]) {
                let off = squared(v);
                if off < next.0 {
                    next = (off, v);
                }
            }
            if next.1 == here.1 {
                break;
            }
            here = next;
        }
        here.1
    }

    /// A squared distance not below that from `p` to the surface.
    #[inline]
    fn bound(&self, p: [f64; 3], vertex: u32, enough: f64) -> f64 {
        let at_once = self.to_ring(p, vertex, enough);
        if at_once <= enough {
            return at_once;
        }
        let nearest = self.walk(p, vertex);
        if nearest == vertex { at_once } else { at_once.min(self.to_ring(p, nearest, enough)) }
    }

    /// Largest distance to the surface from any of `points`, each with a vertex that should be near it, if it is above
    /// `least`; else `least`. `∞` if there is no surface but there are points.
    pub fn largest_distance(&self, points: impl Iterator<Item = ([f64; 3], u32)>, least: f64) -> f64 {
        let mut most = least * least;
        let mut doubtful: Vec<(f64, [f64; 3])> = Vec::new();
        let mut room = FEW_DOUBTS;
        for (p, vertex) in points {
            let bound = self.bound(p, vertex, most);
            if most < bound {
                doubtful.push((bound, p));
                if room <= doubtful.len() {
                    most = self.settle_one(&mut doubtful, most);
                    room = FEW_DOUBTS.max(doubtful.len() * 2);
                }
            }
        }
        while !doubtful.is_empty() {
            most = self.settle_one(&mut doubtful, most);
        }
        if most <= least * least { least } else { most.sqrt() }
    }

    /// Finds the distance of the most doubtful point; returns the new largest one and drops whom it settles.
    fn settle_one(&self, doubtful: &mut Vec<(f64, [f64; 3])>, most: f64) -> f64 {
        let Some(&(bound, p)) = doubtful.iter().reduce(|a, b| if a.0 < b.0 { b } else { a }) else { return most };
        let grid = self.grid.get_or_init(|| Grid::new(self.positions, &self.triangles));
        let exact = grid.squared_distance_above(self.positions, &self.triangles, p, most, bound);
        // The point itself is settled whatever was found.
        let most = most.max(exact);
        doubtful.retain(|&(bound, q)| most < bound && q != p);
        most
    }
}

/// Doubts that are gathered before the greatest of them is settled.
const FEW_DOUBTS: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::{Surface, largest_distance};

    /// Corners of a bumpy sheet of `2 n²` triangles.
    fn sheet(n: u32, bump: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for y in 0..=n {
            for x in 0..=n {
                let (u, v) = (x as f32 / n as f32, y as f32 / n as f32);
                positions.push([u, v, bump * ((7.0 * u).sin() + (u * v * 9.0).cos())]);
                if x < n && y < n {
                    let at = y * (n + 1) + x;
                    triangles.extend([[at, at + 1, at + n + 2], [at, at + n + 2, at + n + 1]]);
                }
            }
        }
        (positions, triangles)
    }

    #[test]
    fn the_result_is_that_of_searching_for_every_point() {
        let (positions, triangles) = sheet(20, 0.1);
        let sheet = Sheet::new(&positions, triangles.clone());
        let tree = Surface::new(&triangles.iter().map(|&t| sheet.corners(t)).collect::<Vec<_>>());
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        for height in [0.001, 0.05, 2.0] {
            // Hints that are right, near, and plainly wrong.
            for spread in [0.0, 3.0, 400.0] {
                let points: Vec<([f64; 3], u32)> = (0..300)
                    .map(|i| {
                        let p = sheet.position(i);
                        let hint = f64::from(i) + (next() - 0.5) * spread;
                        ([p[0] + next() * 0.02, p[1], p[2] + next() * height], hint.clamp(0.0, 440.0) as u32)
                    })
                    .collect();
                for least in [0.0, height / 2.0] {
                    let want = largest_distance(points.iter().map(|p| p.0), &tree, least);
                    assert_eq!(sheet.largest_distance(points.iter().copied(), least), want);
                }
            }
        }
    }

    #[test]
    fn a_vertex_without_faces_is_no_hint_but_no_harm() {
        let (mut positions, triangles) = sheet(3, 0.0);
        positions.push([9.0, 9.0, 9.0]);
        let alone = positions.len() as u32 - 1;
        let sheet = Sheet::new(&positions, triangles);
        assert_eq!(sheet.largest_distance(std::iter::once(([0.5, 0.5, 0.25], alone)), 0.0), 0.25);
        let nothing = Sheet::new(&positions, Vec::new());
        assert_eq!(nothing.largest_distance(std::iter::once(([0.5, 0.5, 0.25], 0)), 0.0), f64::INFINITY);
    }
}
