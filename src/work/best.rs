//! Effort `best`: simplify, look, give each part of the surface the weight that its picture asks for, and again.
//!
//! Views are this loop's own ([`fibonacci`]), never those of the image metric. Weights begin with what can be seen: the
//! inside of a pocket costs less than a face. Then each round's differences are given back to the faces of the source
//! that are seen there. Paper: P. Lindstrom, G. Turk, *Image-driven simplification*, 2000, whose idea this is; there the
//! image prices every contraction, here it re-weights quadrics, at a thousandth of the pictures. Knows no cache.

use std::collections::BTreeMap;

use super::look::Judge;
use crate::appearance::drawable::Drawable;
use crate::appearance::metric::Reference;
use crate::appearance::render::{Cpu, Shot};
use crate::appearance::views::fibonacci;
use crate::lod::ChainLevel;
use crate::mesh::{Level, Mesh, Primitive};
use crate::plan::PartTask;
use crate::quadric::{cross, dot, sub};

/// Pictures of a round.
const VIEWS: usize = 32;

/// Least weight of what is never seen, against 1 for what is seen from everywhere: it may still be seen from closer by.
const UNSEEN: f64 = 0.1;

/// Times that errors are spread to the neighbours: a face's own pixels are few.
const SMOOTHING: usize = 3;

/// Range of one round's factor, and of all rounds together.
const STEP: (f64, f64) = (0.3, 4.0);
const TOTAL: (f64, f64) = (0.05, 30.0);

/// The source as the loop sees it.
pub(super) struct Loop<'a> {
    judge: &'a Judge<'a>,
    own: Reference,
    surfaces: Vec<Surface>,
}

/// The triangles of one part, primitive by primitive.
struct Surface {
    areas: Vec<f64>,
    /// Corners as numbers of distinct positions.
    corners: Vec<[u32; 3]>,
    positions: usize,
    /// Unit normals.
    normals: Vec<[f64; 3]>,
}

/// One weight for each triangle of each part.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights(pub(super) Vec<Vec<f64>>);

impl<'a> Loop<'a> {
    pub(super) fn new(judge: &'a Judge<'a>, tasks: &[PartTask]) -> Self {
        let drawable = judge.source_drawable();
        let shot = Shot { size: judge.size(), faces: true };
        let own = Reference::new(&Cpu, &drawable, drawable.frame(), &fibonacci(VIEWS), shot)
            .expect("the configuration allows only sizes that can be drawn");
        Self { judge, own, surfaces: tasks.iter().map(|task| Surface::new(&task.mesh)).collect() }
    }

    /// d_RMS of a level in the loop's own views.
    pub(super) fn difference(&self, levels: &[Option<Level>]) -> f64 {
        let drawable = self.judge.drawable(levels);
        self.own.compare(&Cpu, &drawable, false).expect("the source was drawn at the same size").rms
    }

    /// Weights by what can be seen: the share of the pixels that a vertex's faces would cover if nothing stood before
    /// them.
    pub(super) fn visibility(&self) -> Weights {
        let drawable = self.judge.source_drawable();
        let faces = drawable.first_faces().last().copied().unwrap_or(0) as usize;
        let seen = self.own.seen(faces);
        let scale = self.pixels_of_area(&drawable);
        let directions = fibonacci(VIEWS);
        let mut first = 0;
        let weights = self.surfaces.iter().map(|surface| {
            let seen = &seen[first..first + surface.areas.len()];
            first += surface.areas.len();
            let expected: Vec<f64> = (surface.normals.iter().zip(&surface.areas))
                .map(|(normal, area)| {
                    let facing = directions.iter().map(|view| dot(*normal, view.to_array()).max(0.0)).sum::<f64>();
                    facing * area * scale
                })
                .collect();
            // Ratios of sums over the faces at a vertex: single faces have few pixels.
            let (mut pixels, mut wanted) = (vec![0.0; surface.positions], vec![0.0; surface.positions]);
            for (face, corners) in surface.corners.iter().enumerate() {
                for &corner in corners {
                    pixels[corner as usize] += f64::from(seen[face]);
                    wanted[corner as usize] += expected[face];
                }
            }
            let share = |corner: u32| {
                let (pixels, wanted) = (pixels[corner as usize], wanted[corner as usize]);
                if wanted > 0.0 { (pixels / wanted).min(1.0) } else { 0.0 }
            };
            let weight = |corners: &[u32; 3]| UNSEEN + (1.0 - UNSEEN) * corners.map(share).iter().sum::<f64>() / 3.0;
            surface.corners.iter().map(weight).collect()
        });
        Weights(weights.collect())
    }

    /// Pixels of a unit of area that faces a camera, in the middle of the picture.
    fn pixels_of_area(&self, drawable: &Drawable) -> f64 {
        // 45° across the picture, the sphere fills it: half its width is the radius times about 1.02.
        let side = f64::from(self.judge.size()) / (2.0 * 1.02 * drawable.frame().radius);
        side * side
    }

    /// Weights of the next round: more where the levels differ, less where they do not. `start` are those of the first. With
    /// them the differences of the levels.
    pub(super) fn again(&self, weights: &Weights, start: &Weights, levels: &[ChainLevel]) -> (Weights, Vec<f64>) {
        let faces: usize = self.surfaces.iter().map(|surface| surface.areas.len()).sum();
        let mut errors = vec![0.0; faces];
        let mut differences = Vec::with_capacity(levels.len());
        for level in levels {
            let drawable = self.judge.drawable(&level.parts);
            let blame = self.own.blame(&Cpu, &drawable, faces).expect("the source was drawn at the same size");
            differences.push(blame.rms);
            let sum: f64 = blame.squares.iter().sum();
            if sum > 0.0 {
                // Every level counts the same, however much coarser one is.
                errors.iter_mut().zip(&blame.squares).for_each(|(error, square)| *error += square / sum);
            }
        }
        let area: f64 = self.surfaces.iter().flat_map(|surface| &surface.areas).sum();
        let mean = errors.iter().sum::<f64>() / area;
        if !(mean > 0.0 && mean.is_finite()) {
            return (weights.clone(), differences);
        }
        let mut first = 0;
        let next = self.surfaces.iter().enumerate().map(|(part, surface)| {
            let density = surface.smoothed(&errors[first..first + surface.areas.len()]);
            first += surface.areas.len();
            let weight = |(face, density): (usize, f64)| {
                // The fourth root: a face that differs sixteen times as much counts twice.
                let factor = ((density + 0.1 * mean) / (1.1 * mean)).sqrt().sqrt().clamp(STEP.0, STEP.1);
                let (now, start) = (weights.0[part][face], start.0[part][face]);
                (now * factor).clamp(TOTAL.0 * start, TOTAL.1 * start)
            };
            density.into_iter().enumerate().map(weight).collect()
        });
        (Weights(next.collect()), differences)
    }
}

impl Surface {
    fn new(mesh: &Mesh) -> Self {
        let mut numbers: BTreeMap<[u32; 3], u32> = BTreeMap::new();
        let (mut areas, mut corners, mut normals) = (Vec::new(), Vec::new(), Vec::new());
        for primitive in &mesh.primitives {
            let positions: Vec<[f32; 3]> = Primitive::positions(primitive).to_vec();
            for t in primitive.indices.chunks_exact(3) {
                let p = [0, 1, 2].map(|i| positions[t[i] as usize]);
                corners.push(p.map(|p| {
                    let next = numbers.len() as u32;
                    *numbers.entry(p.map(f32::to_bits)).or_insert(next)
                }));
                let p = p.map(|p| p.map(f64::from));
                let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
                let length = dot(normal, normal).sqrt();
                areas.push(length / 2.0);
                normals.push(if length > 0.0 { normal.map(|x| x / length) } else { [0.0; 3] });
            }
        }
        Self { areas, corners, positions: numbers.len(), normals }
    }

    /// Errors for each unit of area, spread over neighbours.
    fn smoothed(&self, errors: &[f64]) -> Vec<f64> {
        let mut density: Vec<f64> =
            errors.iter().zip(&self.areas).map(|(error, area)| if *area > 0.0 { error / area } else { 0.0 }).collect();
        for _ in 0..SMOOTHING {
            let (mut sums, mut areas) = (vec![0.0; self.positions], vec![0.0; self.positions]);
            for (face, corners) in self.corners.iter().enumerate() {
                for &corner in corners {
                    sums[corner as usize] += density[face] * self.areas[face];
                    areas[corner as usize] += self.areas[face];
                }
            }
            let at = |corner: u32| {
                let area = areas[corner as usize];
                if area > 0.0 { sums[corner as usize] / area } else { 0.0 }
            };
            density = self.corners.iter().map(|corners| corners.map(at).iter().sum::<f64>() / 3.0).collect();
        }
        density
    }
}
