//! The mesh of one level: primitives with the source's materials over the level's geometry.
//!
//! Knows nothing of nodes. Arrays that several meshes or levels share are written once.

use super::carry::{self, Shared};
use super::document::Document;
use super::encode::{self, Layout};
use super::error::DocumentError;
use super::json;
use super::lod::{MeshLevel, PrimitiveLevel};
use super::notes::Notes;
use super::write::{LevelProblem, NewBuffer, Streams, WriteError};
use crate::mesh::{Attribute, Format, LevelOwnVertices, LevelPrimitive, LevelVertices};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One level's mesh, ready to be appended, and what its nodes have to know of it.
pub(super) struct LevelMesh {
    /// The entry for `meshes`.
    pub(super) entry: Value,
    /// Triangles of all primitives that were simplified.
    pub(super) triangles: usize,
    /// The level has the source's morph targets, so that weights have something to drive.
    pub(super) targets: bool,
}

/// Which mesh and level is being written; `number` is 1 for the finest level.
#[derive(Clone, Copy)]
pub(super) struct Role {
    pub(super) mesh: usize,
    pub(super) number: usize,
}

impl Role {
    fn error(self, primitive: usize, problem: LevelProblem) -> WriteError {
        let place = format!("meshes[{}].primitives[{primitive}], level {}", self.mesh, self.number);
        WriteError::Level { place, problem }
    }
}

/// Its vertices exist only after decoding a whole primitive.
const DRACO: &str = "KHR_draco_mesh_compression";

/// Whether levels cannot refer to the vertices of a mesh of the source, because a primitive keeps them compressed.
pub fn is_sealed(document: &Document, mesh: usize) -> bool {
    let meshes = document.array("meshes").unwrap_or_default();
    let primitives = meshes.get(mesh).and_then(|mesh| mesh.get("primitives")?.as_array());
    primitives.into_iter().flatten().any(|primitive| json::extension(primitive, DRACO).is_some())
}

/// Writes meshes of levels into a document.
pub(super) struct LevelWriter<'d> {
    pub(super) document: &'d mut Document,
    pub(super) streams: Streams,
    pub(super) notes: Notes,
    /// What was written for a level primitive, by its address (it lives as long as the levels) and, for shared
    /// vertices, their number.
    written: BTreeMap<(usize, usize), Written>,
}

#[derive(Clone)]
struct Written {
    indices: usize,
    /// `attributes` and `targets` of the primitive; `None`: the source's.
    vertices: Option<(Value, Vec<Value>)>,
}

impl<'d> LevelWriter<'d> {
    pub(super) fn new(document: &'d mut Document) -> Result<Self, WriteError> {
        let streams = Streams::open(document)?;
        Ok(Self { document, streams, notes: Notes::default(), written: BTreeMap::new() })
    }

    /// From now on arrays go behind the bytes of the buffer `home`. What was written elsewhere is written again: each such
    /// buffer holds all of its meshes.
    pub(super) fn turn_to(&mut self, home: usize) -> Result<(), WriteError> {
        self.written.clear();
        self.streams = Streams::default();
        self.streams.append_to(self.document, home)
    }

    /// What was appended to the buffer so far, if anything was.
    pub(super) fn close(&mut self) -> Result<Option<NewBuffer>, WriteError> {
        std::mem::take(&mut self.streams).close(self.document)
    }

    /// Appends the level's arrays; answers its mesh, which is not appended yet.
    pub(super) fn level(&mut self, role: Role, level: &MeshLevel) -> Result<LevelMesh, WriteError> {
        let source = self.document.array("meshes")?[role.mesh].clone();
        let place = format!("meshes[{}]", role.mesh);
        let mut primitives = Vec::new();
        let mut triangles = 0;
        let mut counts = Vec::new();
        for (i, (primitive, level)) in
            json::array(&source, "primitives", &place)?.iter().zip(&level.primitives).enumerate()
        {
            let entry = match level {
                PrimitiveLevel::AsSource => primitive.clone(),
                PrimitiveLevel::Level(level) if level.indices.is_empty() => continue,
                PrimitiveLevel::Level(level) => {
                    triangles += level.indices.len() / 3;
                    self.primitive(role, i, primitive, level)?
                }
            };
            counts.push((i, target_count(&entry), target_count(primitive)));
            primitives.push(entry);
        }
        let targets = counts.iter().any(|&(_, found, _)| found > 0);
        if let Some(&(i, found, expected)) = counts.iter().find(|&&(_, found, expected)| targets && found != expected) {
            return Err(role.error(i, LevelProblem::Targets { found, expected }));
        }
        let entry = self.mesh_entry(&source, role, &primitives, targets);
        Ok(LevelMesh { entry, triangles, targets })
    }

    fn mesh_entry(&mut self, source: &Value, role: Role, primitives: &[Value], targets: bool) -> Value {
        let place = format!("meshes[{}]", role.mesh);
        let mut entry = Map::new();
        for (key, value) in source.as_object().into_iter().flatten() {
            let kept = match key.as_str() {
                "primitives" => Some(Value::Array(primitives.to_vec())),
                "name" => value.as_str().map(|name| json!(format!("{name}_LOD{}", role.number))),
                "weights" => targets.then(|| value.clone()),
                "extras" => Some(mesh_extras(value, targets)),
                "extensions" => {
                    let shared = Shared { vertices: false, custom_attributes: true };
                    let extensions = value.as_object().map(|e| carry::extensions(e, shared, &place, &mut self.notes));
                    extensions.filter(|e| !e.is_empty()).map(Value::Object)
                }
                other => {
                    self.notes.add(&place, format!("`{other}` is not known and is not carried to levels"));
                    None
                }
            };
            if let Some(kept) = kept {
                entry.insert(key.clone(), kept);
            }
        }
        Value::Object(entry)
    }

    fn primitive(
        &mut self,
        role: Role,
        number: usize,
        source: &Value,
        level: &Arc<LevelPrimitive>,
    ) -> Result<Value, WriteError> {
        let place = format!("meshes[{}].primitives[{number}]", role.mesh);
        let written = self.geometry(role, number, source, level)?;
        let shares = written.vertices.is_none();
        let mut entry = Map::new();
        let (attributes, targets) = written.vertices.unwrap_or_else(|| {
            let targets = source.get("targets").and_then(Value::as_array).cloned().unwrap_or_default();
            (source["attributes"].clone(), targets)
        });
        let shared = Shared { vertices: shares, custom_attributes: !self.lost_attributes(source, &attributes, &place) };
        entry.insert("attributes".to_owned(), attributes);
        entry.insert("indices".to_owned(), json!(written.indices));
        if !targets.is_empty() {
            entry.insert("targets".to_owned(), Value::Array(targets));
        }
        for (key, value) in source.as_object().into_iter().flatten() {
            match key.as_str() {
                // Levels are lists of triangles, which is the default mode.
                "attributes" | "indices" | "targets" | "mode" => {}
                "material" | "extras" => {
                    entry.insert(key.clone(), value.clone());
                }
                "extensions" => {
                    let source = value.as_object();
                    let kept = source.map(|e| carry::extensions(e, shared, &place, &mut self.notes));
                    if let Some(kept) = kept.filter(|e| !e.is_empty()) {
                        entry.insert(key.clone(), Value::Object(kept));
                    }
                }
                other => self.notes.add(&place, format!("`{other}` is not known and is not carried to levels")),
            }
        }
        Ok(Value::Object(entry))
    }

    /// Notes attributes that a level lacks; answers whether a custom one is among them.
    fn lost_attributes(&mut self, source: &Value, level: &Value, place: &str) -> bool {
        let mut custom = false;
        for name in source.get("attributes").and_then(Value::as_object).into_iter().flat_map(Map::keys) {
            if level.get(name).is_none() {
                custom |= name.starts_with('_');
                self.notes.add(place, format!("levels lack the attribute `{name}`"));
            }
        }
        custom
    }

    fn geometry(
        &mut self,
        role: Role,
        number: usize,
        source: &Value,
        level: &Arc<LevelPrimitive>,
    ) -> Result<Written, WriteError> {
        let vertices = match &level.vertices {
            LevelVertices::Source => self.source_vertices(role, number, source)?,
            LevelVertices::Own(own) => own.count,
        };
        let key = (Arc::as_ptr(level) as usize, vertices);
        if let Some(written) = self.written.get(&key) {
            return Ok(written.clone());
        }
        if !level.indices.len().is_multiple_of(3) {
            return Err(role.error(number, LevelProblem::Triangles(level.indices.len())));
        }
        if let Some(&index) = level.indices.iter().find(|&&i| i as usize >= vertices) {
            return Err(role.error(number, LevelProblem::Index { index, vertices }));
        }
        let indices = self.streams.indices(self.document, &level.indices, vertices)?;
        let vertices = match &level.vertices {
            LevelVertices::Source => None,
            LevelVertices::Own(own) => {
                let kinds = self.attribute_kinds(source);
                check_values(own).map_err(|problem| role.error(number, problem))?;
                Some(self.own_vertices(own, &kinds)?)
            }
        };
        let written = Written { indices, vertices };
        self.written.insert(key, written.clone());
        Ok(written)
    }

    /// Number of the source's vertices, if a level may share them. Compressed with Draco they exist only after
    /// decoding, and even where the accessors have data of their own, its order need not be the decoder's.
    fn source_vertices(&self, role: Role, number: usize, source: &Value) -> Result<usize, WriteError> {
        if json::extension(source, DRACO).is_some() {
            return Err(role.error(number, LevelProblem::Sealed(DRACO.to_owned())));
        }
        let place = format!("meshes[{}].primitives[{number}]", role.mesh);
        let position = json::child(source, "attributes", &place)?
            .and_then(|attributes| json::index(attributes, "POSITION", &place).transpose())
            .transpose()?
            .ok_or_else(|| DocumentError::invalid(&place, "`attributes.POSITION` is missing"))?;
        let accessor = self.document.array("accessors")?.get(position).unwrap_or(&Value::Null);
        let count = json::uint(accessor, "count", format_args!("accessors[{position}]"))?.unwrap_or(0);
        Ok(count as usize)
    }

    /// `type` of each of the source's accessors, by attribute: four components may be a vector or a matrix.
    fn attribute_kinds(&self, source: &Value) -> BTreeMap<String, String> {
        let accessors = self.document.array("accessors").unwrap_or_default();
        let attributes = source.get("attributes").and_then(Value::as_object);
        let kind = |accessor: &Value| {
            accessors.get(json::integer(accessor)? as usize)?.get("type")?.as_str().map(str::to_owned)
        };
        attributes.into_iter().flatten().filter_map(|(name, a)| Some((name.clone(), kind(a)?))).collect()
    }

    fn own_vertices(
        &mut self,
        own: &LevelOwnVertices,
        kinds: &BTreeMap<String, String>,
    ) -> Result<(Value, Vec<Value>), WriteError> {
        let mut attributes = Map::new();
        for (attribute, values) in own.attributes.iter().zip(encode::settle(&own.attributes)) {
            let kind = kinds.get(&attribute.name).map_or("", String::as_str);
            attributes.insert(attribute.name.clone(), json!(self.attribute(attribute, &values, kind)?));
        }
        let mut targets = Vec::new();
        for target in &own.targets {
            let mut entry = Map::new();
            for displacement in target {
                let accessor = self.attribute(displacement, &displacement.values, "")?;
                entry.insert(displacement.name.clone(), json!(accessor));
            }
            targets.push(Value::Object(entry));
        }
        Ok((Value::Object(attributes), targets))
    }

    fn attribute(&mut self, attribute: &Attribute, values: &[f32], kind: &str) -> Result<usize, WriteError> {
        let format: Format = attribute.format;
        let layout = Layout::new(kind, attribute.components, format.component);
        let encoded = encode::encode(values, layout, format);
        let bounds = attribute.name == "POSITION";
        self.streams.vertices(self.document, &encoded, (layout, format), bounds)
    }
}

fn target_count(primitive: &Value) -> usize {
    primitive.get("targets").and_then(Value::as_array).map_or(0, Vec::len)
}

/// Names of morph targets that a level does not have would mislead readers that count them.
fn mesh_extras(extras: &Value, targets: bool) -> Value {
    let mut extras = extras.clone();
    if let (false, Some(entries)) = (targets, extras.as_object_mut()) {
        entries.shift_remove("targetNames");
    }
    extras
}

fn check_values(own: &LevelOwnVertices) -> Result<(), LevelProblem> {
    for attribute in own.attributes.iter().chain(own.targets.iter().flatten()) {
        let (name, values) = (attribute.name.clone(), attribute.values.len());
        if values != own.count * attribute.components {
            let (vertices, components) = (own.count, attribute.components);
            return Err(LevelProblem::Values { name, values, vertices, components });
        }
        if !attribute.values.iter().all(|v| v.is_finite()) {
            return Err(LevelProblem::NotFinite(name));
        }
    }
    Ok(())
}
