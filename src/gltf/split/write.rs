//! Puts a plan into the document: accessors, meshes, nodes, and the bytes.

use super::plan::{Column, PartPrimitive, Plan};
use super::{Repeated, Split};
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use crate::gltf::share::compact::compact;
use crate::gltf::share::{Retired, index};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Buffer views begin at multiples of it.
const GRAIN: usize = 8;

/// Targets of buffer views: of vertices, of indices.
const TARGETS: [u32; 2] = [34962, 34963];

pub(super) fn write(
    document: &mut Document,
    buffers: &Buffers,
    plan: Plan,
    groups: &[Repeated],
) -> Result<Split, DocumentError> {
    let before = total(buffers);
    // What has vertices has a buffer with bytes.
    let buffer = (0..buffers.len()).find(|&i| buffers.bytes(i).is_some()).unwrap_or(0);
    let mut own = Stream { buffer, start: buffers.bytes(buffer).map_or(0, <[u8]>::len), data: Vec::new() };
    own.data.resize(own.start.next_multiple_of(GRAIN) - own.start, 0);
    let Plan { vertices, indices, parts } = plan;
    // From the source's accessors, which the rest changes.
    let mut meshes = Vec::with_capacity(groups.len());
    for (group, part) in groups.iter().zip(parts) {
        let mesh = match (group.mesh, part) {
            (Some(mesh), _) => mesh,
            (None, part) => own.mesh(document, group, part.unwrap_or_default())?,
        };
        meshes.push(mesh);
    }
    let mut touched = own.rest(document, vertices)?;
    let mut retired = Retired::default();
    for ((mesh, primitive), column) in indices {
        let old = index(&document.array("meshes")?[mesh]["primitives"][primitive], "indices");
        let new = own.accessor(document, None, &column)?;
        document.array_mut("meshes")?[mesh]["primitives"][primitive]["indices"] = json!(new);
        retired.accessors.extend(old.map(|old| (old, new)));
    }
    let aliases = aliases(document, &retired.accessors)?;
    retired.accessors.extend(aliases);
    for (old, new) in retired.settle(document)? {
        touched.entry(old).or_insert(new);
    }
    let nodes = show(document, groups, &meshes)?;
    let mut out = buffers.clone();
    let mut bytes = buffers.bytes(buffer).unwrap_or_default().to_vec();
    bytes.append(&mut own.data);
    out.rewrite(document, buffer, bytes)?;
    let buffers = compact(document, &out, &touched)?;
    let bytes = (before, total(&buffers));
    Ok(Split { buffers, meshes, nodes, bytes })
}

fn total(buffers: &Buffers) -> u64 {
    (0..buffers.len()).filter_map(|i| buffers.bytes(i)).map(|bytes| bytes.len() as u64).sum()
}

/// New bytes behind those of a buffer.
struct Stream {
    buffer: usize,
    /// Bytes of the buffer before.
    start: usize,
    data: Vec<u8>,
}

impl Stream {
    /// Appends the elements; answers a view of them.
    fn view(&mut self, document: &mut Document, column: &Column) -> Result<usize, DocumentError> {
        let is_index = column.bounds[0].is_empty();
        let mut view = json!({
            "buffer": self.buffer,
            "byteOffset": self.start + self.data.len(),
            "byteLength": column.bytes.len(),
            "target": TARGETS[usize::from(is_index)],
        });
        if column.stride != column.size {
            view["byteStride"] = json!(column.stride);
        }
        self.data.extend_from_slice(&column.bytes);
        let end = (self.start + self.data.len()).next_multiple_of(GRAIN);
        self.data.resize(end - self.start, 0);
        document.push("bufferViews", view)
    }

    /// Appends an accessor, with the type of another one if that is given.
    fn accessor(
        &mut self,
        document: &mut Document,
        like: Option<usize>,
        column: &Column,
    ) -> Result<usize, DocumentError> {
        let view = self.view(document, column)?;
        let mut entry = match like {
            Some(like) => document.array("accessors")?[like].clone(),
            None => json!({ "componentType": column.component.gltf(), "type": "SCALAR" }),
        };
        if let Some(entry) = entry.as_object_mut() {
            for key in ["name", "extras"] {
                entry.shift_remove(key);
            }
        }
        fill(&mut entry, view, column);
        document.push("accessors", entry)
    }

    /// A mesh of one part.
    fn mesh(
        &mut self,
        document: &mut Document,
        group: &Repeated,
        part: Vec<PartPrimitive>,
    ) -> Result<usize, DocumentError> {
        let mut primitives = Vec::with_capacity(part.len());
        for PartPrimitive { source: (mesh, primitive), attributes, indices } in part {
            let mut entry = document.array("meshes")?[mesh]["primitives"][primitive].clone();
            let mut own = Map::new();
            for (name, like, column) in attributes {
                own.insert(name, json!(self.accessor(document, Some(like), &column)?));
            }
            entry["attributes"] = Value::Object(own);
            entry["indices"] = json!(self.accessor(document, None, &indices)?);
            primitives.push(entry);
        }
        let mut entry = json!({ "primitives": primitives });
        let source = &document.array("meshes")?[group.of.mesh];
        if let Some(name) = source.get("name").and_then(Value::as_str) {
            let (primitive, triangle) = group.of.place();
            entry["name"] = json!(format!("{name}_part_{primitive}_{triangle}"));
        }
        document.push("meshes", entry)
    }

    /// Accessors of which only a part is left, at their places. Answers the views that they leave, each with one that can stand for
    /// it.
    fn rest(
        &mut self,
        document: &mut Document,
        vertices: BTreeMap<usize, Column>,
    ) -> Result<BTreeMap<usize, usize>, DocumentError> {
        let mut touched = BTreeMap::new();
        let mut followers: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        let itself: BTreeMap<usize, usize> = vertices.keys().map(|&accessor| (accessor, accessor)).collect();
        for (alias, of) in aliases(document, &itself)? {
            followers.entry(of).or_default().push(alias);
        }
        for (accessor, column) in vertices {
            let view = self.view(document, &column)?;
            for place in followers.remove(&accessor).unwrap_or_default().into_iter().chain([accessor]) {
                let entry = &mut document.array_mut("accessors")?[place];
                touched.extend(index(entry, "bufferView").map(|old| (old, view)));
                fill(entry, view, &column);
            }
        }
        Ok(touched)
    }
}

fn fill(entry: &mut Value, view: usize, column: &Column) {
    let Some(members) = entry.as_object_mut() else { return };
    members.shift_remove("byteOffset");
    members.insert("bufferView".to_owned(), json!(view));
    members.insert("count".to_owned(), json!(column.count));
    let is_float = column.component == crate::mesh::ComponentType::F32;
    for (key, bounds) in ["min", "max"].into_iter().zip(&column.bounds) {
        if let Some(value) = members.get_mut(key) {
            let number = |&bound: &f64| if is_float { json!(bound) } else { json!(bound as i64) };
            *value = bounds.iter().map(number).collect();
        }
    }
}

/// Accessors that nothing uses and that say the same as one of `retired`: each with what stands for that one.
fn aliases(document: &Document, retired: &BTreeMap<usize, usize>) -> Result<BTreeMap<usize, usize>, DocumentError> {
    let used = crate::gltf::share::used_accessors(document)?;
    let accessors = document.array("accessors")?;
    let says = |accessor: &Value| {
        let keys = ["bufferView", "byteOffset", "componentType", "normalized", "type", "count"];
        keys.map(|key| accessor.get(key).map(Value::to_string).unwrap_or_default())
    };
    let known: BTreeMap<_, usize> = retired.iter().map(|(&old, &new)| (says(&accessors[old]), new)).collect();
    let unused = (0..accessors.len()).filter(|i| !used.contains(i) && !retired.contains_key(i));
    let alias = |i: usize| {
        let of = *known.get(&says(&accessors[i]))?;
        (accessors[i].get("sparse").is_none() && i != of).then_some((i, of))
    };
    Ok(unused.filter_map(alias).collect())
}

/// Children for every node that shows a mesh of which parts went.
fn show(document: &mut Document, groups: &[Repeated], meshes: &[usize]) -> Result<usize, DocumentError> {
    let mut children: BTreeMap<usize, Vec<Value>> = BTreeMap::new();
    for (group, &shown) in groups.iter().zip(meshes) {
        for (part, by) in &group.occurrences {
            let mut child = Map::from_iter([("mesh".to_owned(), json!(shown))]);
            child.extend(by.node());
            children.entry(part.mesh).or_default().push(Value::Object(child));
        }
    }
    let nodes = document.array_mut("nodes")?;
    let before = nodes.len();
    for node in 0..before {
        let mesh = nodes[node].get("mesh").and_then(json::integer).map(|mesh| mesh as usize);
        let Some(children) = mesh.and_then(|mesh| children.get(&mesh)) else { continue };
        let first = nodes.len();
        nodes.extend(children.iter().cloned());
        let last = nodes.len();
        let Some(members) = nodes[node].as_object_mut() else { continue };
        if let Some(list) = members.entry("children").or_insert_with(|| json!([])).as_array_mut() {
            list.extend((first..last).map(|child| json!(child)));
        }
    }
    Ok(nodes.len() - before)
}
