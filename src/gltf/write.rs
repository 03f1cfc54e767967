//! Appends binary data to a document: index and vertex arrays, their buffer views and accessors.
//!
//! Everything the source holds keeps its place and its bytes; new data goes behind it. Arrays are collected section
//! by section (a section is a rank of coarseness, see `lod`), and one section is one range of bytes, so that a reader
//! can fetch it with one request. Within a section arrays of one kind share a buffer view, which keeps the JSON
//! small. Knows nothing of levels, nodes or meshes.

use super::document::{Document, Problem};
use super::encode::{Encoded, Layout};
use super::error::DocumentError;
use super::json;
use crate::mesh::{ComponentType, Format, index_bytes};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Why levels cannot be added to a document.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// The document itself is at fault.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The levels do not fit the mesh they are for.
    #[error("{place}: {problem}")]
    Level {
        /// JSON place, with the level where there is one: `meshes[2].primitives[0], level 1`.
        place: String,
        /// What does not fit.
        problem: LevelProblem,
    },
}

/// What does not fit between a level and its mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LevelProblem {
    /// No such entry in `meshes`.
    #[error("this mesh does not exist (there are {0})")]
    NoMesh(usize),
    /// The same mesh twice.
    #[error("this mesh is given levels twice")]
    Twice,
    /// Not one level primitive for each primitive.
    #[error("the level has {level} primitives, the mesh {mesh}")]
    Primitives {
        /// Of the level.
        level: usize,
        /// Of the mesh.
        mesh: usize,
    },
    /// Neither errors nor radius may be negative, infinite or NaN.
    #[error("`{name}` is {value}, which is no length")]
    Length {
        /// `error` or `radius`.
        name: &'static str,
        /// As given, in words.
        value: String,
    },
    /// An index behind the last vertex.
    #[error("index {index} is out of range ({vertices} vertices)")]
    Index {
        /// The index.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Not a list of triangles.
    #[error("{0} indices are not a list of triangles")]
    Triangles(usize),
    /// The level asks for the source's vertices, but they are stored in a form that only its own indices can use.
    #[error("the source's vertices are compressed with `{0}` and cannot be shared")]
    Sealed(String),
    /// An attribute does not have `count × components` values.
    #[error("attribute `{name}` has {values} values for {vertices} vertices of {components} components")]
    Values {
        /// The attribute.
        name: String,
        /// Number of values.
        values: usize,
        /// Number of vertices.
        vertices: usize,
        /// Components per vertex.
        components: usize,
    },
    /// NaN or infinite.
    #[error("attribute `{0}` is not finite")]
    NotFinite(String),
    /// All primitives of a mesh have the same number of morph targets.
    #[error("{found} morph targets, the source has {expected} (a level has all of them or none)")]
    Targets {
        /// Of the level's primitive.
        found: usize,
        /// Of the source's.
        expected: usize,
    },
}

impl WriteError {
    /// What a user can do about it, where that is known.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Document(error) => error.hint(),
            Self::Level { .. } => None,
        }
    }
}

/// A buffer that `add_levels` created or lengthened because the document has no BIN chunk to append to.
/// [`super::package`] gives it an address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewBuffer {
    /// Index in `buffers`.
    pub index: usize,
    /// The content begins with this many bytes of the source's buffer with the same index, zeros where it is shorter.
    pub behind: usize,
    /// The content, from there on.
    pub bytes: Vec<u8>,
}

/// Arrays that can share a buffer view. The order is that of the bytes: indices first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Indices(ComponentType),
    /// With the stride in bytes.
    Vertices(usize),
}

#[derive(Default)]
struct Pending {
    bytes: Vec<u8>,
    /// Accessor and its offset in `bytes`.
    accessors: Vec<(usize, usize)>,
}

/// Where appended bytes go.
#[derive(Default)]
pub(super) struct Streams {
    /// `None` until the buffer is created, when there is something to put into it.
    buffer: Option<usize>,
    /// The bytes go to the BIN chunk, behind this offset.
    bin_end: Option<usize>,
    /// They go behind this offset of a buffer of the source that is no BIN chunk.
    host_end: usize,
    data: Vec<u8>,
    section: BTreeMap<Kind, Pending>,
}

impl Streams {
    /// Bytes go to the BIN chunk of a GLB where buffer 0 stands for it or can be made to; otherwise to a new buffer.
    pub(super) fn open(document: &Document) -> Result<Self, WriteError> {
        let mut streams = Self::default();
        if document.container != super::document::Container::Glb {
            return Ok(streams);
        }
        let length = document.bin.as_ref().map_or(0, |bin| bin.len());
        match document.array("buffers")?.first() {
            None => streams.bin_end = Some(length.next_multiple_of(4)),
            Some(first) if first.get("uri").is_none() && document.bin.is_some() => {
                let needed = json::uint(first, "byteLength", "buffers[0]")?.unwrap_or(0);
                if needed > length as u64 {
                    let (what, holder) = ("`byteLength`".to_owned(), "the BIN chunk".to_owned());
                    let problem = Problem::Short { what, holder, needed, available: length as u64 };
                    return Err(DocumentError::new("buffers[0]", problem).into());
                }
                streams.buffer = Some(0);
                streams.bin_end = Some(length.next_multiple_of(4));
            }
            Some(_) => {}
        }
        Ok(streams)
    }

    /// From now on bytes go behind those of `buffer`. Before anything is appended.
    pub(super) fn append_to(&mut self, document: &Document, buffer: usize) -> Result<(), WriteError> {
        let length = json::uint(&document.array("buffers")?[buffer], "byteLength", format_args!("buffers[{buffer}]"))?;
        self.buffer = Some(buffer);
        self.host_end = (length.unwrap_or(0) as usize).next_multiple_of(4);
        Ok(())
    }

    /// Appends a triangle list over `vertices` vertices; answers its accessor.
    pub(super) fn indices(
        &mut self,
        document: &mut Document,
        indices: &[u32],
        vertices: usize,
    ) -> Result<usize, WriteError> {
        let component = if index_bytes(vertices) == 2 { ComponentType::U16 } else { ComponentType::U32 };
        let bytes: Vec<u8> = match component {
            ComponentType::U16 => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
        };
        let entry = json!({ "componentType": component.gltf(), "count": indices.len(), "type": "SCALAR" });
        self.append(document, Kind::Indices(component), &bytes, entry)
    }

    /// Appends a vertex attribute; answers its accessor. `bounds`: with `min` and `max`, as positions need them.
    pub(super) fn vertices(
        &mut self,
        document: &mut Document,
        encoded: &Encoded,
        form: (Layout, Format),
        bounds: bool,
    ) -> Result<usize, WriteError> {
        let (layout, format) = form;
        let count = encoded.bytes.len() / layout.stride();
        let mut entry = Map::new();
        entry.insert("componentType".to_owned(), json!(format.component.gltf()));
        if format.normalized {
            entry.insert("normalized".to_owned(), json!(true));
        }
        entry.insert("count".to_owned(), json!(count));
        entry.insert("type".to_owned(), json!(layout.kind()));
        if bounds && count > 0 {
            let stored = |values: &[f64]| values.iter().map(|&v| stored_number(v, format)).collect::<Value>();
            entry.insert("min".to_owned(), stored(&encoded.min));
            entry.insert("max".to_owned(), stored(&encoded.max));
        }
        self.append(document, Kind::Vertices(layout.stride()), &encoded.bytes, Value::Object(entry))
    }

    fn append(&mut self, document: &mut Document, kind: Kind, bytes: &[u8], entry: Value) -> Result<usize, WriteError> {
        let accessor = document.push("accessors", entry)?;
        self.adopt(&[accessor], kind, bytes);
        Ok(accessor)
    }

    /// Appends the content of accessors that exist: from the end of the section on they are here.
    pub(super) fn adopt(&mut self, accessors: &[usize], kind: Kind, bytes: &[u8]) {
        let pending = self.section.entry(kind).or_default();
        pending.accessors.extend(accessors.iter().map(|&accessor| (accessor, pending.bytes.len())));
        pending.bytes.extend_from_slice(bytes);
        pending.bytes.resize(pending.bytes.len().next_multiple_of(4), 0);
    }

    /// Bytes collected so far, this section's included.
    pub(super) fn len(&self) -> usize {
        self.data.len() + self.section.values().map(|p| p.bytes.len()).sum::<usize>()
    }

    /// Lays out what was appended since the last section: from here on its place is fixed.
    pub(super) fn end_section(&mut self, document: &mut Document) -> Result<(), WriteError> {
        for (kind, pending) in std::mem::take(&mut self.section) {
            let buffer = match self.buffer {
                Some(buffer) => buffer,
                None => *self.buffer.insert(document.push("buffers", json!({ "byteLength": 0 }))?),
            };
            let offset = self.bin_end.unwrap_or(self.host_end) + self.data.len();
            let mut view = Map::new();
            view.insert("buffer".to_owned(), json!(buffer));
            view.insert("byteOffset".to_owned(), json!(offset));
            view.insert("byteLength".to_owned(), json!(pending.bytes.len()));
            let target = match kind {
                Kind::Indices(_) => 34963,
                Kind::Vertices(stride) => {
                    view.insert("byteStride".to_owned(), json!(stride));
                    34962
                }
            };
            view.insert("target".to_owned(), json!(target));
            let view = document.push("bufferViews", Value::Object(view))?;
            self.data.extend_from_slice(&pending.bytes);
            let accessors = document.array_mut("accessors")?;
            for (accessor, offset) in pending.accessors {
                place(&mut accessors[accessor], view, offset);
            }
        }
        Ok(())
    }

    /// Hands the bytes over: to the BIN chunk, or as a new buffer.
    pub(super) fn close(self, document: &mut Document) -> Result<Option<NewBuffer>, WriteError> {
        let Some(buffer) = self.buffer.filter(|_| !self.data.is_empty()) else { return Ok(None) };
        let length = self.bin_end.unwrap_or(self.host_end) + self.data.len();
        document.array_mut("buffers")?[buffer]["byteLength"] = json!(length);
        let Some(end) = self.bin_end else {
            return Ok(Some(NewBuffer { index: buffer, behind: self.host_end, bytes: self.data }));
        };
        let mut bin = Vec::with_capacity(length);
        bin.extend_from_slice(document.bin.as_deref().unwrap_or_default());
        bin.resize(end, 0);
        bin.extend_from_slice(&self.data);
        document.bin = Some(Arc::from(bin));
        Ok(None)
    }
}

/// `bufferView` first, as most writers have it.
fn place(accessor: &mut Value, view: usize, offset: usize) {
    let Value::Object(entry) = accessor else { unreachable!("`append` pushed an object, and others were read") };
    let mut rest = std::mem::take(entry);
    rest.shift_remove("bufferView");
    rest.shift_remove("byteOffset");
    entry.insert("bufferView".to_owned(), json!(view));
    if offset > 0 {
        entry.insert("byteOffset".to_owned(), json!(offset));
    }
    entry.extend(rest);
}

/// Integers as integers: `min` and `max` hold the stored values.
fn stored_number(value: f64, format: Format) -> Value {
    if format.component == ComponentType::F32 { json!(value) } else { json!(value as i64) }
}
