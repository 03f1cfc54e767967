//! Copies of a mesh: where they stand, and all of them as one mesh.
//!
//! Knows nothing of files and of simplification.

use crate::mesh::{Attribute, Format, Mesh, Primitive};
use crate::quadric::{cross, dot, sub};

/// Rotation about the vertical axis, uniform scale and place: `p ↦ turned(p · scale) + place`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Copy {
    /// Cosine and sine of the angle.
    pub turn: [f64; 2],
    /// More than 0.
    pub scale: f64,
    /// Where the origin goes.
    pub place: [f64; 3],
}

impl Copy {
    /// `count` copies of a thing of that size on a square, each turned and scaled its own way.
    pub fn spread(count: usize, size: f64) -> Vec<Self> {
        let side = (count as f64).sqrt().ceil().max(1.0) as usize;
        let copy = |i: usize| {
            let angle = i as f64 * 2.399_963_229_728_653;
            let scale = 0.75 + 0.5 * (i % 7) as f64 / 6.0;
            let place = [(i % side) as f64 * 1.5 * size, 0.0, (i / side) as f64 * 1.5 * size];
            Self { turn: [libm::cos(angle), libm::sin(angle)], scale, place }
        };
        (0..count).map(copy).collect()
    }

    /// The matrix, rows first.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let ([c, s], k, [x, y, z]) = (self.turn, self.scale, self.place);
        [[c * k, 0.0, s * k, x], [0.0, k, 0.0, y], [-s * k, 0.0, c * k, z], [0.0, 0.0, 0.0, 1.0]]
    }

    fn rotated(&self, p: [f32; 3]) -> [f64; 3] {
        let ([c, s], [x, y, z]) = (self.turn, p.map(f64::from));
        [c * x + s * z, y, c * z - s * x]
    }

    /// Where a point of the mesh is.
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let p = self.rotated(p);
        [0, 1, 2].map(|k| (p[k] * self.scale + self.place[k]) as f32)
    }

    /// Where a normal of the mesh points.
    pub fn normal(&self, n: [f32; 3]) -> [f32; 3] {
        self.rotated(n).map(|x| x as f32)
    }
}

/// All copies as one primitive.
pub fn flattened(mesh: &Primitive, copies: &[Copy]) -> Primitive {
    let turned = |attribute: &Attribute| {
        let mut values = Vec::with_capacity(attribute.values.len() * copies.len());
        for copy in copies {
            let threes = attribute.values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]);
            match attribute.name.as_str() {
                "POSITION" => values.extend(threes.flat_map(|p| copy.point(p))),
                "NORMAL" => values.extend(threes.flat_map(|n| copy.normal(n))),
                _ => values.extend_from_slice(&attribute.values),
            }
        }
        Attribute { name: attribute.name.clone(), components: attribute.components, format: attribute.format, values }
    };
    let shifted = |copy: usize| mesh.indices.iter().map(move |i| i + (copy * mesh.count) as u32);
    Primitive {
        count: mesh.count * copies.len(),
        attributes: mesh.attributes.iter().map(turned).collect(),
        targets: Vec::new(),
        indices: (0..copies.len()).flat_map(shifted).collect(),
    }
}

/// The mesh with what the paper's models have and this one may lack: normals from the faces around a vertex, texture
/// coordinates from its place in the bounding box, seen from the front.
pub fn dressed(mesh: &Primitive) -> Primitive {
    let mut out = mesh.clone();
    let mut add = |name: &str, components: usize, values: Vec<f32>| {
        if mesh.attribute(name).is_none() {
            out.attributes.push(Attribute { name: name.to_owned(), components, format: Format::F32, values });
        }
    };
    let positions: Vec<[f32; 3]> = mesh.positions().to_vec();
    let mut sums = vec![[0.0f64; 3]; mesh.count];
    for t in mesh.indices.chunks_exact(3) {
        let p = [0, 1, 2].map(|i| positions[t[i] as usize].map(f64::from));
        let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        for &corner in t {
            (0..3).for_each(|k| sums[corner as usize][k] += normal[k]);
        }
    }
    let unit = |n: &[f64; 3]| {
        let length = dot(*n, *n).sqrt();
        if length > 0.0 { n.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
    };
    add("NORMAL", 3, sums.iter().flat_map(unit).collect());
    let (low, high) = positions.iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
        ([0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k])))
    });
    let size = [0, 1, 2].map(|k| high[k] - low[k]).into_iter().fold(f32::MIN_POSITIVE, f32::max);
    add("TEXCOORD_0", 2, positions.iter().flat_map(|p| [0, 1].map(|k| (p[k] - low[k]) / size)).collect());
    out
}

/// The only primitive of a mesh.
pub fn single(primitive: Primitive) -> Mesh {
    Mesh { primitives: vec![primitive] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Primitive {
        let attribute = |name: &str, components, values| Attribute {
            name: String::from(name),
            components,
            format: Format::F32,
            values,
        };
        let positions = vec![0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        Primitive {
            count: 3,
            attributes: vec![attribute("POSITION", 3, positions)],
            targets: Vec::new(),
            indices: vec![0, 1, 2],
        }
    }

    #[test]
    fn copies_keep_shape_and_turn_normals_with_positions() {
        let copies = Copy::spread(5, 3.0);
        let all = flattened(&dressed(&triangle()), &copies);
        assert_eq!((all.count, all.indices.len()), (15, 15));
        let p = all.positions();
        for (i, copy) in copies.iter().enumerate() {
            let edge = sub(p[3 * i + 1].map(f64::from), p[3 * i].map(f64::from));
            assert!((dot(edge, edge).sqrt() - 2.0 * copy.scale).abs() < 1e-5);
            let normal = &all.attribute("NORMAL").unwrap().values[9 * i..9 * i + 3];
            let n = [0, 1, 2].map(|k| f64::from(normal[k]));
            assert!(dot(n, edge).abs() < 1e-5 && (dot(n, n) - 1.0).abs() < 1e-5, "{n:?}");
            let m = copy.matrix();
            let by_matrix = [0, 1, 2].map(|r| m[r][0] * 2.0 + m[r][3]);
            assert!((0..3).all(|k| (by_matrix[k] - f64::from(p[3 * i + 1][k])).abs() < 1e-5), "{by_matrix:?}");
        }
        let uv = &all.attribute("TEXCOORD_0").unwrap().values[..6];
        assert_eq!(uv, [0.0, 0.0, 1.0, 0.0, 0.0, 0.5]);
    }
}
