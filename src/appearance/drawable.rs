//! What a renderer draws: parts with materials, placed by instances. The same for every renderer.
//!
//! Knows primitives, not documents; `assemble` makes drawables of scenes.

use super::looks::Looks;
use super::views::Frame;
use crate::mesh::{Attribute, LevelPrimitive, LevelVertices, Primitive};
use glam::{DMat4, DVec3, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// The triangles of one primitive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Object space.
    pub positions: Vec<Vec3>,
    /// Unit normals, one for each position.
    pub normals: Vec<Vec3>,
    /// Unit tangents with the sign of the bitangent, if the source has them.
    pub tangents: Option<Vec<Vec4>>,
    /// Sets of texture coordinates, by number; a set that the source lacks is empty.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear colours.
    pub colors: Option<Vec<Vec4>>,
    /// Triangle list.
    pub indices: Vec<u32>,
    /// Index in [`Looks::materials`].
    pub material: usize,
}

/// One part at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index in [`Drawable::parts`].
    pub part: usize,
    /// Object space to world space.
    pub transform: DMat4,
}

/// Everything in one picture.
#[derive(Clone, Debug, Default)]
pub struct Drawable {
    /// Shared with other levels where they are the same.
    pub parts: Vec<Arc<Part>>,
    /// In the order in which they are drawn; of two surfaces at the same depth the first is seen.
    pub instances: Vec<Instance>,
    /// Materials and textures.
    pub looks: Arc<Looks>,
}

/// Stands for "no face" in pictures.
pub const NO_FACE: u32 = u32::MAX;

impl Part {
    /// A primitive as it is. `material` is an index in [`Looks::materials`].
    pub fn new(primitive: &Primitive, material: usize) -> Self {
        Self::from_arrays(&primitive.attributes, primitive.count, &primitive.indices, material)
    }

    /// A primitive at one level.
    pub fn of_level(source: &Primitive, level: &LevelPrimitive, material: usize) -> Self {
        match &level.vertices {
            LevelVertices::Source => Self::from_arrays(&source.attributes, source.count, &level.indices, material),
            LevelVertices::Own(own) => Self::from_arrays(&own.attributes, own.count, &level.indices, material),
        }
    }

    /// From attributes of `count` vertices. Attributes of an unexpected shape are left out.
    pub fn from_arrays(attributes: &[Attribute], count: usize, indices: &[u32], material: usize) -> Self {
        let find = |name: &str| attributes.iter().find(|a| a.name == name);
        let rows = |name: &str, components: usize| {
            let found = find(name).filter(|a| a.components == components && a.values.len() == count * components)?;
            Some(found.values.chunks_exact(components))
        };
        let vectors = |name: &str| -> Option<Vec<Vec3>> { Some(rows(name, 3)?.map(Vec3::from_slice).collect()) };
        let sets =
            (0..MOST_SETS).rev().find(|set| find(&format!("TEXCOORD_{set}")).is_some()).map_or(0, |last| last + 1);
        let uvs = (0..sets).map(|set| {
            let rows = rows(&format!("TEXCOORD_{set}"), 2);
            rows.map_or_else(Vec::new, |rows| rows.map(Vec2::from_slice).collect())
        });
        let opaque = rows("COLOR_0", 3).map(|rows| rows.map(|c| Vec4::new(c[0], c[1], c[2], 1.0)).collect());
        let mut part = Self {
            positions: vectors("POSITION").unwrap_or_default(),
            normals: vectors("NORMAL").unwrap_or_default(),
            tangents: rows("TANGENT", 4).map(|rows| rows.map(Vec4::from_slice).collect()),
            uvs: uvs.collect(),
            colors: opaque.or_else(|| Some(rows("COLOR_0", 4)?.map(Vec4::from_slice).collect())),
            indices: indices[..indices.len() - indices.len() % 3].to_vec(),
            material,
        };
        if part.indices.iter().any(|&i| i as usize >= part.positions.len()) {
            part.indices.clear();
        }
        if part.normals.is_empty() {
            part.flatten();
        }
        part
    }

    /// Gives every triangle vertices of its own and their normal: what the specification asks for where there are no
    /// normals. The order of triangles stays.
    fn flatten(&mut self) {
        fn take<T: Copy>(values: &[T], indices: &[u32]) -> Vec<T> {
            if values.is_empty() { Vec::new() } else { indices.iter().map(|&i| values[i as usize]).collect() }
        }
        let indices = std::mem::take(&mut self.indices);
        self.positions = take(&self.positions, &indices);
        // Tangents without normals are ignored, as the specification says.
        self.tangents = None;
        self.uvs.iter_mut().for_each(|set| *set = take(set, &indices));
        self.colors = self.colors.as_ref().map(|colors| take(colors, &indices));
        let normal = |p: &[Vec3]| (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        self.normals = self.positions.chunks_exact(3).flat_map(|p| [normal(p); 3]).collect();
        self.indices = (0..indices.len() as u32).collect();
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }
}

/// Sets of texture coordinates beyond this are not looked for.
pub(super) const MOST_SETS: usize = 8;

impl Drawable {
    /// Parts of one mesh where they stand in object space.
    pub fn of_parts(parts: Vec<Arc<Part>>, looks: Arc<Looks>) -> Self {
        let instances = (0..parts.len()).map(|part| Instance { part, transform: DMat4::IDENTITY }).collect();
        Self { parts, instances, looks }
    }

    /// The number of each part's first face: faces are numbered through all parts, each part once, however often it
    /// is drawn. One number more than there are parts; the last is the number of all faces.
    pub fn first_faces(&self) -> Vec<u32> {
        let mut sum = 0u32;
        let counts = self.parts.iter().map(|part| {
            sum = sum.saturating_add(part.triangles() as u32);
            sum
        });
        std::iter::once(0).chain(counts).collect()
    }

    /// Triangles of all instances.
    pub fn triangles(&self) -> u64 {
        self.instances.iter().map(|i| self.parts[i.part].triangles() as u64).sum()
    }

    /// The sphere that a camera has to look at: round the middle of the bounding box of all drawn vertices, up to the
    /// farthest of them.
    pub fn frame(&self) -> Frame {
        let points = || {
            self.instances.iter().flat_map(|instance| {
                let part = &self.parts[instance.part];
                part.indices.iter().map(move |&i| {
                    let p = part.positions[i as usize];
                    instance.transform.transform_point3(p.as_dvec3())
                })
            })
        };
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points().filter(|p| p.is_finite()) {
            (low, high) = (low.min(p), high.max(p));
        }
        if !(low.is_finite() && high.is_finite()) {
            return Frame { center: DVec3::ZERO, radius: 1.0 };
        }
        let center = low + (high - low) * 0.5;
        let most = points().filter(|p| p.is_finite()).map(|p| (p - center).length_squared()).fold(0.0, f64::max);
        let radius = most.sqrt();
        Frame { center, radius: if radius > 0.0 && radius.is_finite() { radius } else { 1.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Format;

    fn attribute(name: &str, components: usize, values: &[f32]) -> Attribute {
        Attribute { name: name.into(), components, format: Format::F32, values: values.to_vec() }
    }

    /// Two triangles of a unit square in z = 0.
    fn square(more: Vec<Attribute>) -> Primitive {
        let positions = attribute("POSITION", 3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        let attributes = std::iter::once(positions).chain(more).collect();
        Primitive { count: 4, attributes, targets: Vec::new(), indices: vec![0, 1, 2, 0, 2, 3] }
    }

    #[test]
    fn without_normals_faces_are_flat_and_keep_their_order() {
        let uv = attribute("TEXCOORD_1", 2, &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
        let part = Part::new(&square(vec![uv]), 3);
        assert_eq!((part.positions.len(), part.triangles(), part.material), (6, 2, 3));
        assert_eq!(part.normals, [Vec3::Z; 6]);
        assert!(part.uvs[0].is_empty());
        assert_eq!(part.uvs[1][5], Vec2::new(0.0, 1.0));
        assert_eq!(part.positions[4], Vec3::new(1.0, 1.0, 0.0));
    }

    #[test]
    fn with_normals_vertices_stay() {
        let normals = attribute("NORMAL", 3, &[0.0, 1.0, 0.0].repeat(4));
        let colors = attribute("COLOR_0", 3, &[0.5; 12]);
        let part = Part::new(&square(vec![normals, colors]), 0);
        assert_eq!((part.positions.len(), part.normals[2]), (4, Vec3::Y));
        assert_eq!(part.colors.unwrap()[0], Vec4::new(0.5, 0.5, 0.5, 1.0));
    }

    #[test]
    fn wrong_shapes_are_left_out() {
        let part = Part::new(&square(vec![attribute("TEXCOORD_0", 3, &[0.0; 12])]), 0);
        assert!(part.uvs[0].is_empty());
        let mut far = square(Vec::new());
        far.indices = vec![0, 1, 9, 0, 1];
        assert_eq!(Part::new(&far, 0).triangles(), 0);
    }

    #[test]
    fn faces_are_numbered_through_the_parts() {
        let part = Arc::new(Part::new(&square(Vec::new()), 0));
        let mut drawable = Drawable::of_parts(vec![Arc::clone(&part), part], Arc::default());
        assert_eq!(drawable.first_faces(), [0, 2, 4]);
        drawable.instances.push(Instance { part: 0, transform: DMat4::from_translation(DVec3::X * 3.0) });
        assert_eq!(drawable.triangles(), 6);
        let frame = drawable.frame();
        assert_eq!(frame.center, DVec3::new(2.0, 0.5, 0.0));
        assert!((frame.radius - 4.25f64.sqrt()).abs() < 1e-12);
        assert_eq!(Drawable::default().frame().radius, 1.0);
    }
}
