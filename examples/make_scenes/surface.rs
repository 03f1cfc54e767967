//! A triangle surface in the making: built from grids, moved, joined, then shaded. Knows no file format.
//!
//! Counter-clockwise triangles face outwards; y is up; lengths in metres.

use crate::turn;
use glam::{DMat3, DVec2, DVec3, DVec4};
use std::collections::BTreeMap;

/// Vertices and triangles. `normals`, `uvs`, `colors` and `tangents` are empty or as long as `positions`.
#[derive(Clone, Default)]
pub struct Surface {
    /// Metres.
    pub positions: Vec<DVec3>,
    /// Unit vectors; filled by [`Surface::shaded`].
    pub normals: Vec<DVec3>,
    /// v grows downwards, as in glTF.
    pub uvs: Vec<DVec2>,
    /// Linear red, green, blue.
    pub colors: Vec<DVec3>,
    /// Unit tangent and sign of the bitangent; filled by [`Surface::with_tangents`].
    pub tangents: Vec<DVec4>,
    /// Indices, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
}

/// A position rounded to a micrometre: vertices of one place compare equal on both sides of a seam.
pub fn place(p: DVec3) -> [i64; 3] {
    [(p.x * 1e6).round() as i64, (p.y * 1e6).round() as i64, (p.z * 1e6).round() as i64]
}

impl Surface {
    /// A grid of `columns` × `rows` cells through `point(u, v)`, both in [0, 1]; it faces ∂u × ∂v. Triangles that a
    /// pole makes degenerate are left out.
    pub fn grid(columns: usize, rows: usize, point: impl Fn(f64, f64) -> DVec3) -> Self {
        let mut surface = Self::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f64 / columns as f64, row as f64 / rows as f64);
                surface.positions.push(point(u, v));
                surface.uvs.push(DVec2::new(u, 1.0 - v));
            }
        }
        surface.fill_grid(columns, rows);
        surface
    }

    /// Triangles between the rows of (`columns` + 1) vertices that were pushed before.
    pub fn fill_grid(&mut self, columns: usize, rows: usize) {
        for row in 0..rows {
            for column in 0..columns {
                let a = (row * (columns + 1) + column) as u32;
                let (b, c) = (a + 1, a + columns as u32 + 1);
                self.triangle([a, b, c + 1]);
                self.triangle([a, c + 1, c]);
            }
        }
    }

    /// Adds a triangle unless two of its corners are at the same place.
    pub fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|i| place(self.positions[i as usize]));
        if a != b && b != c && c != a {
            self.triangles.push(corners);
        }
    }

    /// Moves every point; normals must not be made yet.
    pub fn mapped(mut self, map: impl Fn(DVec3) -> DVec3) -> Self {
        assert!(self.normals.is_empty(), "shape first, shade afterwards");
        for p in &mut self.positions {
            *p = map(*p);
        }
        self
    }

    /// Shifted by `offset`.
    pub fn moved(mut self, x: f64, y: f64, z: f64) -> Self {
        for p in &mut self.positions {
            *p += DVec3::new(x, y, z);
        }
        self
    }

    /// Rotated, with its normals and tangents.
    pub fn turned(mut self, rotation: DMat3) -> Self {
        for v in self.positions.iter_mut().chain(&mut self.normals) {
            *v = rotation * *v;
        }
        for t in &mut self.tangents {
            *t = (rotation * t.truncate()).extend(t.w);
        }
        self
    }

    /// Uniformly scaled.
    pub fn scaled(mut self, factor: f64) -> Self {
        for p in &mut self.positions {
            *p *= factor;
        }
        self
    }

    /// Texture coordinates scaled, then shifted.
    pub fn textured(mut self, scale: DVec2, offset: DVec2) -> Self {
        for uv in &mut self.uvs {
            *uv = *uv * scale + offset;
        }
        self
    }

    /// The other side out.
    pub fn flipped(mut self) -> Self {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        for n in &mut self.normals {
            *n = -*n;
        }
        self
    }

    /// One sRGB colour for each vertex, from its position and normal.
    pub fn painted(mut self, color: impl Fn(DVec3, DVec3) -> [f64; 3]) -> Self {
        self.colors = (self.positions.iter().zip(&self.normals)).map(|(p, n)| linear(color(*p, *n))).collect();
        self
    }

    /// Adds another surface; both must have the same attributes.
    pub fn join(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.uvs.extend_from_slice(&other.uvs);
        self.colors.extend_from_slice(&other.colors);
        self.tangents.extend_from_slice(&other.tangents);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// All of them as one.
    pub fn joined(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::default();
        for part in parts {
            all.join(&part);
        }
        all
    }

    /// Normals: each corner takes the mean, weighted by angle, of the faces around its place that turn less than
    /// `crease` degrees from its own. Vertices are split where that gives two normals, and only there.
    pub fn shaded(self, crease: f64) -> Self {
        let limit = turn::cos(crease);
        let faces: Vec<DVec3> = self.triangles.iter().map(|t| self.face_normal(*t)).collect();
        let mut around: BTreeMap<[i64; 3], Vec<(usize, f64)>> = BTreeMap::new();
        for (face, t) in self.triangles.iter().enumerate() {
            for corner in 0..3 {
                let p = self.positions[t[corner] as usize];
                around.entry(place(p)).or_default().push((face, self.angle(*t, corner)));
            }
        }
        let mut shaded = Self::default();
        let mut made: BTreeMap<(u32, [i64; 3]), u32> = BTreeMap::new();
        for (face, t) in self.triangles.iter().enumerate() {
            let corners = t.map(|i| {
                let near = &around[&place(self.positions[i as usize])];
                let sum: DVec3 =
                    near.iter().filter(|(f, _)| faces[*f].dot(faces[face]) >= limit).map(|(f, w)| faces[*f] * *w).sum();
                let normal = sum.normalize_or(faces[face]);
                let key = (i, place(normal * 0.01));
                *made.entry(key).or_insert_with(|| shaded.push_from(&self, i as usize, normal))
            });
            shaded.triangles.push(corners);
        }
        shaded
    }

    fn push_from(&mut self, source: &Self, vertex: usize, normal: DVec3) -> u32 {
        self.positions.push(source.positions[vertex]);
        self.normals.push(normal);
        self.uvs.extend(source.uvs.get(vertex));
        self.colors.extend(source.colors.get(vertex));
        (self.positions.len() - 1) as u32
    }

    /// Unit normal of a triangle.
    pub fn face_normal(&self, t: [u32; 3]) -> DVec3 {
        let [a, b, c] = t.map(|i| self.positions[i as usize]);
        (b - a).cross(c - a).normalize_or(DVec3::Y)
    }

    /// Angle at a corner, in radians.
    fn angle(&self, t: [u32; 3], corner: usize) -> f64 {
        let [a, b, c] = [corner, (corner + 1) % 3, (corner + 2) % 3].map(|k| self.positions[t[k] as usize]);
        let (to_b, to_c) = ((b - a).normalize_or_zero(), (c - a).normalize_or_zero());
        libm::acos(to_b.dot(to_c).clamp(-1.0, 1.0))
    }

    /// Tangents along growing u, orthogonal to the normals. The surface must be shaded and textured.
    pub fn with_tangents(mut self) -> Self {
        let mut along_u = vec![DVec3::ZERO; self.positions.len()];
        let mut along_v = along_u.clone();
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.positions[i as usize]);
            let [ta, tb, tc] = t.map(|i| self.uvs[i as usize]);
            let (e1, e2, d1, d2) = (b - a, c - a, tb - ta, tc - ta);
            let area = d1.x * d2.y - d2.x * d1.y;
            if area.abs() < 1e-14 {
                continue;
            }
            for &i in t {
                along_u[i as usize] += (e1 * d2.y - e2 * d1.y) / area;
                along_v[i as usize] += (e2 * d1.x - e1 * d2.x) / area;
            }
        }
        self.tangents = (0..self.positions.len())
            .map(|i| {
                let n = self.normals[i];
                let t = (along_u[i] - n * n.dot(along_u[i])).normalize_or(n.any_orthonormal_vector());
                // glTF's bitangent points against growing v of the image, which grows downwards.
                t.extend(if n.cross(t).dot(along_v[i]) > 0.0 { -1.0 } else { 1.0 })
            })
            .collect();
        self
    }
}

/// sRGB to linear light.
pub fn linear(srgb: [f64; 3]) -> DVec3 {
    DVec3::from_array(srgb.map(|c| {
        let c = c.clamp(0.0, 1.0);
        if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
    }))
}
