//! A mesh as the simplifier sees it: triangles with named vertex attributes.
//!
//! Knows nothing of files, scenes, materials or transforms. Values are decoded floats; each attribute remembers
//! the storage format of its source so that a level can be written in the same one.

pub mod hash;
pub mod layout;
pub mod sets;
pub mod topology;
pub mod visible;
pub mod weld;

use serde::{Deserialize, Serialize};

/// Storage type of one component, as glTF `componentType` (5120…5126).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[repr(u8)]
pub enum ComponentType {
    /// 5120, BYTE
    I8,
    /// 5121, UNSIGNED_BYTE
    U8,
    /// 5122, SHORT
    I16,
    /// 5123, UNSIGNED_SHORT
    U16,
    /// 5125, UNSIGNED_INT (indices, and custom attributes of non-conforming files)
    U32,
    /// 5126, FLOAT
    F32,
}

impl ComponentType {
    /// Bytes of one component.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The glTF number, 5120…5126.
    pub fn gltf(self) -> u32 {
        match self {
            Self::I8 => 5120,
            Self::U8 => 5121,
            Self::I16 => 5122,
            Self::U16 => 5123,
            Self::U32 => 5125,
            Self::F32 => 5126,
        }
    }

    /// From the glTF number; `None` for any other number (5124 INT is not a glTF type).
    pub fn from_gltf(number: u64) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }
}

/// How an attribute is stored in the source file, and is stored again in its levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Format {
    /// Type of one component.
    pub component: ComponentType,
    /// Integers stand for [0, 1] (unsigned) or [-1, 1] (signed), as glTF `normalized`.
    pub normalized: bool,
}

impl Format {
    /// Plain 32-bit floats.
    pub const F32: Self = Self { component: ComponentType::F32, normalized: false };
}

/// One named vertex attribute (glTF semantic: `POSITION`, `NORMAL`, `TEXCOORD_0`, `_FEATURE_ID_0`, …).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attribute {
    /// glTF semantic.
    pub name: String,
    /// Components per vertex: 1…4 (SCALAR…VEC4), or 4, 9, 16 for matrices of custom attributes.
    pub components: usize,
    /// Storage in the source.
    pub format: Format,
    /// Decoded values, vertex after vertex, `components` each. Normalised integers are mapped to [0, 1] or [-1, 1],
    /// other integers are their own value (exact up to 2²⁴).
    pub values: Vec<f32>,
}

impl Attribute {
    /// Bytes of one vertex's values in storage, padded to a multiple of four.
    pub fn row_bytes(&self) -> usize {
        (self.components * self.format.component.size()).next_multiple_of(4)
    }
}

/// One primitive: a list of triangles over its own vertices.
///
/// Strips and fans are converted to lists when read. The order of `attributes` is by name, so that two files that
/// list the same attributes in another order give equal primitives.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Primitive {
    /// Number of vertices; every attribute has `count × components` values.
    pub count: usize,
    /// Sorted by name; `POSITION` (3 components) is always there.
    pub attributes: Vec<Attribute>,
    /// Morph targets in order; each holds displacement attributes (`POSITION`, `NORMAL`, `TANGENT`, …), sorted by name.
    pub targets: Vec<Vec<Attribute>>,
    /// Triangle list, three indices each, all `< count`.
    pub indices: Vec<u32>,
}

impl Primitive {
    /// The attribute of that name.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// `POSITION` as triples.
    ///
    /// # Panics
    /// If there is no `POSITION` of three components: the reader refuses such primitives.
    pub fn positions(&self) -> &[[f32; 3]] {
        bytemuck::cast_slice(&self.attribute("POSITION").expect("a primitive has positions").values)
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Bytes of all that is kept of one vertex, as it is written.
    pub fn row_bytes(&self) -> usize {
        self.attributes.iter().chain(self.targets.iter().flatten()).map(Attribute::row_bytes).sum()
    }
}

/// A sub-mesh: the smallest group of one mesh's primitives that share border vertices. It is the unit that is
/// identified, simplified once and cached. No crack can open between its primitives.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Mesh {
    /// In the order of the source mesh.
    pub primitives: Vec<Primitive>,
}

impl Mesh {
    /// Number of triangles of all primitives.
    pub fn triangles(&self) -> usize {
        self.primitives.iter().map(Primitive::triangles).sum()
    }

    /// Number of vertices of all primitives, as stored.
    pub fn vertices(&self) -> usize {
        self.primitives.iter().map(|p| p.count).sum()
    }
}

/// Vertices of one primitive at one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LevelVertices {
    /// The level's indices refer to the source primitive's vertices: nothing but indices is written.
    Source,
    /// The level has vertices of its own, in the source's formats.
    Own(LevelOwnVertices),
}

/// Vertices that belong to one level only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelOwnVertices {
    /// Number of vertices.
    pub count: usize,
    /// As [`Primitive::attributes`].
    pub attributes: Vec<Attribute>,
    /// As [`Primitive::targets`].
    pub targets: Vec<Vec<Attribute>>,
}

/// One primitive at one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelPrimitive {
    /// Triangle list; empty if nothing of this primitive is left at this level.
    pub indices: Vec<u32>,
    /// Where the indices point.
    pub vertices: LevelVertices,
}

/// One sub-mesh at one level: as many primitives as the sub-mesh, in the same order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// One for each primitive of the sub-mesh.
    pub primitives: Vec<LevelPrimitive>,
    /// Largest distance between the surfaces of source and level, measured in both directions, in object space units.
    pub error: f64,
}

/// Bytes of an index into this many vertices, as indices are written: 65535 is the restart value of two-byte indices and never
/// names a vertex.
pub fn index_bytes(vertices: usize) -> usize {
    if vertices < usize::from(u16::MAX) { 2 } else { 4 }
}

impl LevelPrimitive {
    /// Bytes of its arrays as they are written: indices of two bytes where they fit, rows of vertices padded to four.
    pub fn bytes(&self) -> usize {
        let vertices = match &self.vertices {
            LevelVertices::Source => self.indices.iter().max().map_or(0, |&most| most as usize + 1),
            LevelVertices::Own(own) => own.count,
        };
        let own = match &self.vertices {
            LevelVertices::Source => 0,
            LevelVertices::Own(own) => {
                own.count
                    * own.attributes.iter().chain(own.targets.iter().flatten()).map(Attribute::row_bytes).sum::<usize>()
            }
        };
        self.indices.len() * index_bytes(vertices) + own
    }
}

impl Level {
    /// Bytes of all primitives.
    pub fn bytes(&self) -> usize {
        self.primitives.iter().map(LevelPrimitive::bytes).sum()
    }

    /// Number of triangles of all primitives.
    pub fn triangles(&self) -> usize {
        self.primitives.iter().map(|p| p.indices.len() / 3).sum()
    }
}
