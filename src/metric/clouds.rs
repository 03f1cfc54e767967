//! Point clouds of attributes: what merged values differ from, in a sum that stays three numbers for each value.
//!
//! C. Erikson, D. Manocha, *GAPS: general and automatic polygonal simplification*, 1999; the instanced-model paper (ITS),
//! section 3.3. A cloud is `(X0, X1, X2)`: weights, weighted values, weighted squared values; `Π(x) = X0 |x|² − 2 x·X1 + X2`
//! and `A(x) = sqrt(Π(x) / X0)`. Knows neither the place of a vertex nor which metric asks.
//!
//! Where the sources leave gaps: each wedge has its own clouds, so that sides of a discontinuity do not blur; a point's weight
//! is a third of the areas of its faces, as that of the geometry; values are scaled as the configuration says, so that a
//! difference of 1 is a distance of one radius and the sums may be compared with lengths.

use crate::mesh::layout::{Layout, MOST_COLUMNS};
use crate::mesh::topology::{Contraction, Topology};
use crate::quadric::{cross, dot, sub};

/// The clouds of all wedges: one for each attribute.
#[derive(Clone, Debug)]
pub(super) struct Clouds {
    /// First column and number of columns of each attribute.
    groups: Vec<(usize, usize)>,
    columns: usize,
    /// X0, for each wedge and attribute.
    weights: Vec<f64>,
    /// X1, for each wedge and column.
    sums: Vec<f64>,
    /// X2, for each wedge and attribute.
    squares: Vec<f64>,
}

/// Weights and squared differences of one merged vertex, by attribute.
#[derive(Clone, Copy, Debug)]
pub(super) struct Differences {
    weights: [f64; MOST_COLUMNS],
    squares: [f64; MOST_COLUMNS],
}

impl Default for Differences {
    fn default() -> Self {
        Self { weights: [0.0; MOST_COLUMNS], squares: [0.0; MOST_COLUMNS] }
    }
}

impl Clouds {
    /// One point for each wedge and face. An attribute that a wedge's primitive lacks has no weight there.
    pub fn new(surface: &Topology, layout: &Layout, wedge_primitive: &[u32]) -> Self {
        let groups: Vec<(usize, usize)> = layout.fields.iter().map(|f| (f.offset, f.components)).collect();
        let wedges = surface.wedge_vertex.len();
        let mut out = Self {
            columns: surface.columns,
            weights: vec![0.0; wedges * groups.len()],
            sums: vec![0.0; wedges * surface.columns],
            squares: vec![0.0; wedges * groups.len()],
            groups,
        };
        for face in &surface.faces {
            let p = surface.corners(face);
            let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            let weight = dot(normal, normal).sqrt() / 6.0;
            for wedge in face.w {
                let values = surface.value(wedge);
                let wedge = wedge as usize;
                for (number, field) in layout.fields.iter().enumerate() {
                    if field.scale[wedge_primitive[wedge] as usize] <= 0.0 {
                        continue;
                    }
                    let at = wedge * out.groups.len() + number;
                    out.weights[at] += weight;
                    let sums = &mut out.sums[wedge * out.columns + field.offset..];
                    for (sum, &value) in sums.iter_mut().zip(&values[field.offset..field.offset + field.components]) {
                        let value = f64::from(value);
                        *sum += weight * value;
                        out.squares[at] += weight * value * value;
                    }
                }
            }
        }
        out
    }

    /// Adds how far the clouds of `wedge` are from `values`.
    pub fn differ(&self, wedge: u32, values: &[f32], to: &mut Differences) {
        let wedge = wedge as usize;
        for (number, &(offset, components)) in self.groups.iter().enumerate() {
            let at = wedge * self.groups.len() + number;
            let (mut norm, mut product) = (0.0, 0.0);
            let sums = &self.sums[wedge * self.columns + offset..];
            for (&value, sum) in values[offset..offset + components].iter().zip(sums) {
                let value = f64::from(value);
                norm += value * value;
                product += value * sum;
            }
            to.weights[number] += self.weights[at];
            to.squares[number] += (self.weights[at] * norm - 2.0 * product + self.squares[at]).max(0.0);
        }
    }

    /// The unified error: the mean of the geometric error and those of all attributes by their weights; a length.
    pub fn unified(&self, area: f64, geometric: f64, differences: &Differences) -> f64 {
        let (mut sum, mut weights) = (area * geometric, area);
        for number in 0..self.groups.len() {
            let weight = differences.weights[number];
            if weight > 0.0 {
                sum += weight * (differences.squares[number] / weight).sqrt();
                weights += weight;
            }
        }
        if weights > 0.0 { sum / weights } else { geometric }
    }

    /// Merges the clouds of joined wedges.
    pub fn merge(&mut self, done: &Contraction) {
        for &[stays, goes] in &done.merged {
            let (stays, goes) = (stays as usize, goes as usize);
            let n = self.groups.len();
            for k in 0..n {
                self.weights[stays * n + k] += self.weights[goes * n + k];
                self.squares[stays * n + k] += self.squares[goes * n + k];
            }
            for k in 0..self.columns {
                self.sums[stays * self.columns + k] += self.sums[goes * self.columns + k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_the_mean_over_geometry_and_attributes() {
        // Two points, 0 with weight 1 and 4 with weight 3.
        let clouds =
            Clouds { groups: vec![(0, 1)], columns: 1, weights: vec![4.0], sums: vec![12.0], squares: vec![48.0] };
        let mut differences = Differences::default();
        clouds.differ(0, &[2.0], &mut differences);
        // Both are 2 away.
        assert!((differences.squares[0] - 16.0).abs() < 1e-12);
        // Geometry 5 with weight 4 beside attributes 2 with weight 4.
        assert!((clouds.unified(4.0, 5.0, &differences) - 3.5).abs() < 1e-12);
        assert_eq!(clouds.unified(4.0, 5.0, &Differences::default()), 5.0);
    }
}
