//! Pairs that no edge connects, for metrics that join parts: vertices closer than a threshold that doubles.
//!
//! C. Erikson, D. Manocha, *GAPS*, 1999 (adaptive threshold). Knows distances, not what a pair costs.

use crate::mesh::topology::Topology;
use crate::quadric::{dot, sub};

/// The pairs so far.
#[derive(Debug)]
pub struct Joins {
    /// Vertices closer than this are pairs, unit frame.
    threshold: f64,
    /// Partners of each vertex, both ways.
    partners: Vec<Vec<u32>>,
    ended: bool,
}

/// The first threshold: a thousandth of the radius.
const FIRST: f64 = 1.0 / 1024.0;

/// Beyond this everything is near.
const LAST: f64 = 4.0;

/// Partners that one doubling gives a vertex, the nearest first.
const MOST: usize = 8;

/// Partners that merges may bring together at one vertex.
const MOST_MERGED: usize = 32;

/// More vertices than this in a cube as wide as the threshold are no longer parts with gaps between them: joining ends.
const CROWD: usize = 256;

impl Joins {
    /// No pairs yet, and none ever where `on` is false.
    pub fn new(vertices: usize, on: bool) -> Self {
        let partners = if on { vec![Vec::new(); vertices] } else { Vec::new() };
        Self { threshold: FIRST / 2.0, partners, ended: !on }
    }

    /// Everything that costs less comes before the threshold doubles; `None`: it will not double again.
    pub fn limit(&self) -> Option<f64> {
        (!self.ended && self.threshold < LAST).then_some(self.threshold)
    }

    /// Doubles the threshold and returns the pairs that this adds, in order of their vertices.
    pub fn widen(&mut self, surface: &Topology) -> Vec<[u32; 2]> {
        self.threshold *= 2.0;
        let cell = |p: [f64; 3]| p.map(|x| libm::floor(x / self.threshold) as i64);
        let alive = (0..surface.positions.len() as u32).filter(|&v| !surface.ring(v).is_empty());
        let mut cells: Vec<([i64; 3], u32)> = alive.map(|v| (cell(surface.positions[v as usize]), v)).collect();
        cells.sort_unstable();
        let mut added = Vec::new();
        let mut near: Vec<(f64, u32)> = Vec::new();
        for &(own, vertex) in &cells {
            near.clear();
            let here = surface.positions[vertex as usize];
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                let column = [own[0] + dx, own[1] + dy];
                let from = cells.partition_point(|(c, _)| *c < [column[0], column[1], own[2] - 1]);
                let until = cells.partition_point(|(c, _)| *c <= [column[0], column[1], own[2] + 1]);
                if 3 * CROWD < until - from {
                    self.ended = true;
                    return added;
                }
                for &(_, other) in &cells[from..until] {
                    let off = sub(surface.positions[other as usize], here);
                    let squared = dot(off, off);
                    if other != vertex && squared < self.threshold * self.threshold {
                        near.push((squared, other));
                    }
                }
            }
            near.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            let free = near.iter().map(|&(_, other)| other).filter(|&other| {
                !self.partners[vertex as usize].contains(&other) && !surface.are_joined(vertex, other)
            });
            let chosen: Vec<u32> = free.take(MOST).collect();
            for other in chosen {
                self.partners[vertex as usize].push(other);
                self.partners[other as usize].push(vertex);
                added.push([vertex.min(other), vertex.max(other)]);
            }
        }
        added.sort_unstable();
        added
    }

    /// `gone` has become `kept`: its partners are those of `kept` now, and are added to `neighbours`.
    pub fn merged(&mut self, kept: u32, gone: u32, surface: &Topology, neighbours: &mut Vec<u32>) {
        for other in std::mem::take(&mut self.partners[gone as usize]) {
            let back = &mut self.partners[other as usize];
            back.retain(|&v| v != gone);
            if other == kept {
                continue;
            }
            if !back.contains(&kept) && self.partners[kept as usize].len() < MOST_MERGED {
                self.partners[other as usize].push(kept);
                self.partners[kept as usize].push(other);
            }
        }
        let free = |&&other: &&u32| !surface.ring(other).is_empty() && !surface.are_joined(kept, other);
        neighbours.extend(self.partners[kept as usize].iter().filter(free));
    }
}
