//! Geometry in files that scenes share: each mesh with levels gets a buffer of its own, which holds the source's arrays, then its
//! levels, the coarsest first. The file is named by the hash of its bytes, so that scenes with the same mesh name the same file.
//!
//! A mesh goes there whole or not at all, and its bytes depend on nothing but its geometry and levels: arrays packed one
//! behind the other in a fixed order, however the source had them. Materials, nodes and all other JSON stay in the scene. What a
//! scene's own buffers lost is taken out of them. Nothing changes its index; an array that others need too stays for them, and the mesh
//! refers to an appended accessor. Knows nothing of folders but the one name.

use super::accessor::Accessor;
use super::anchors::Anchors;
use super::buffers::Buffers;
use super::decode::{draco, meshopt};
use super::document::{Container, Document};
use super::error::DocumentError;
use super::json;
use super::lod::{MeshLevels, PrimitiveLevel, has_levels};
use super::notes::{Note, Notes};
use super::package::data_uri;
use super::share::{self, Sharing, compact};
use super::views::Views;
use super::write::{Kind, NewBuffer, Streams, WriteError};

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Where the files are, in the output folder.
pub const FOLDER: &str = "lodbake-library";

/// Hexadecimal digits of a file's name: 128 bits of the hash. Among 10¹² files two agree by chance once in 10¹⁴ times.
const DIGITS: usize = 32;

/// Content of a buffer of which nothing is left: none may be empty.
const NOTHING: [u8; 4] = [0; 4];

/// The buffers of one document that become such files.
#[derive(Debug, Default)]
pub struct Library {
    homes: BTreeMap<usize, usize>,
    /// By buffer: the source's arrays.
    buffers: BTreeMap<usize, Vec<u8>>,
    notes: Notes,
}

/// A file of the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LibraryFile {
    /// In the library's folder.
    pub name: String,
    /// All of it.
    pub bytes: Vec<u8>,
}

/// One array of a mesh.
struct Slot {
    accessor: usize,
    kind: Kind,
    /// As the library holds it: elements at multiples of four bytes, indices one after another.
    bytes: Vec<u8>,
}

/// Meshes with the same arrays and levels.
struct Family {
    /// Each with its accessors, slot by slot.
    meshes: Vec<(usize, Vec<usize>)>,
    /// Of the first of them; the others have the same.
    slots: Vec<Slot>,
}

impl Library {
    /// Gives meshes that will get levels a buffer each and moves their arrays there. `buffers` are the document's and stay its:
    /// the new ones are not among them. `partial` are meshes that use a small part of their arrays: these are kept by several
    /// meshes together, and stay.
    pub fn open(
        document: &mut Document,
        buffers: &mut Buffers,
        levels: &[MeshLevels],
        partial: &BTreeSet<usize>,
    ) -> Result<Self, DocumentError> {
        let mut library = Self::default();
        if let Some(name) = Sharing::unknown_extension(document) {
            let text = format!("`{name}` might refer to geometry, so all of it stays in the scene's own files");
            library.notes.add("extensionsUsed", text);
            return Ok(library);
        }
        let families = library.families(document, buffers, levels, partial)?;
        if families.is_empty() {
            return Ok(library);
        }
        let users = users(document, &families)?;
        let mut touched = BTreeMap::new();
        for (number, family) in families.iter().enumerate() {
            library.settle(document, (number, family), &users, &mut touched)?;
        }
        let views = document.array("bufferViews")?;
        let lost: BTreeSet<usize> = touched.keys().filter_map(|&view| share::index(&views[view], "buffer")).collect();
        *buffers = compact::compact(document, buffers, &touched)?;
        empty_unused(document, buffers, &lost)?;
        Ok(library)
    }

    /// The buffer of each mesh that has one.
    pub fn homes(&self) -> &BTreeMap<usize, usize> {
        &self.homes
    }

    /// Which meshes stayed, and why.
    pub fn notes(&self) -> Vec<Note> {
        self.notes.clone().into_vec()
    }

    /// The files, with `added` (what `add_levels_to` appended), whose addresses begin with `way`: the way from the scene's folder to the
    /// output folder.
    pub fn close(
        self,
        document: &mut Document,
        added: Vec<NewBuffer>,
        way: &str,
    ) -> Result<Vec<LibraryFile>, DocumentError> {
        let mut added: BTreeMap<usize, NewBuffer> = added.into_iter().map(|buffer| (buffer.index, buffer)).collect();
        let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        for (index, mut bytes) in self.buffers {
            if let Some(levels) = added.remove(&index) {
                bytes.resize(levels.behind, 0);
                bytes.extend_from_slice(&levels.bytes);
            }
            let name = format!("{}.bin", &blake3::hash(&bytes).to_hex()[..DIGITS]);
            document.array_mut("buffers")?[index] =
                json!({ "uri": format!("{way}{FOLDER}/{name}"), "byteLength": bytes.len() });
            files.insert(name, bytes);
        }
        Ok(files.into_iter().map(|(name, bytes)| LibraryFile { name, bytes }).collect())
    }

    fn families(
        &mut self,
        document: &Document,
        buffers: &Buffers,
        levels: &[MeshLevels],
        partial: &BTreeSet<usize>,
    ) -> Result<Vec<Family>, DocumentError> {
        let with_levels: BTreeSet<usize> = levels.iter().filter(|l| has_levels(l)).map(|l| l.mesh).collect();
        let anchors = Anchors::find(document, &with_levels, &mut Notes::default())?;
        let shown: BTreeSet<usize> = anchors.nodes.iter().map(|&(_, mesh)| mesh).collect();
        let views = Views::new(document, buffers)?;
        let mut families: Vec<Family> = Vec::new();
        let mut known = BTreeMap::new();
        for entry in levels.iter().filter(|entry| shown.contains(&entry.mesh)) {
            let place = format!("meshes[{}]", entry.mesh);
            let slots = match slots(document, &views, entry.mesh)? {
                _ if partial.contains(&entry.mesh) => Err("it uses a small part of its vertex arrays"),
                found => found,
            };
            let slots = match slots {
                Ok(slots) => slots,
                Err(why) => {
                    self.notes.add(place, format!("{why}, so its geometry stays in the scene's own files"));
                    continue;
                }
            };
            let accessors = slots.iter().map(|slot| slot.accessor).collect();
            let number = *known.entry((content(&slots), shape(entry))).or_insert_with(|| {
                families.push(Family { meshes: Vec::new(), slots });
                families.len() - 1
            });
            families[number].meshes.push((entry.mesh, accessors));
        }
        Ok(families)
    }

    /// Moves the arrays of one family. Notes which views lost an accessor in `touched`, each with a view that stands for it.
    fn settle(
        &mut self,
        document: &mut Document,
        (number, family): (usize, &Family),
        users: &BTreeMap<usize, BTreeSet<Option<usize>>>,
        touched: &mut BTreeMap<usize, usize>,
    ) -> Result<(), DocumentError> {
        let buffer = document.push("buffers", json!({ "byteLength": 0 }))?;
        // Equal arrays are kept once.
        let mut contents: BTreeMap<(Kind, &[u8]), usize> = BTreeMap::new();
        let mut order: Vec<(&Slot, BTreeSet<usize>)> = Vec::new();
        let mut repeated: BTreeMap<usize, usize> = BTreeMap::new();
        let mut moved: Vec<(usize, usize)> = Vec::new();
        for (at, slot) in family.slots.iter().enumerate() {
            let place = *contents.entry((slot.kind, &slot.bytes)).or_insert_with(|| {
                order.push((slot, BTreeSet::new()));
                order.len() - 1
            });
            for (_, accessors) in &family.meshes {
                let accessor = accessors[at];
                if users.get(&accessor).is_some_and(|users| users.iter().all(|user| *user == Some(number))) {
                    if order[place].1.insert(accessor) {
                        let view = share::index(&document.array("accessors")?[accessor], "bufferView");
                        moved.extend(view.map(|view| (accessor, view)));
                    }
                } else if let Some(&copy) = repeated.get(&accessor) {
                    order[place].1.insert(copy);
                } else {
                    let copy = document.array("accessors")?[accessor].clone();
                    let copy = document.push("accessors", copy)?;
                    repeated.insert(accessor, copy);
                    order[place].1.insert(copy);
                }
            }
        }
        let mut streams = Streams::default();
        streams.append_to(document, buffer).map_err(document_error)?;
        for (slot, accessors) in &order {
            streams.adopt(&accessors.iter().copied().collect::<Vec<_>>(), slot.kind, &slot.bytes);
        }
        streams.end_section(document).map_err(document_error)?;
        let written = streams.close(document).map_err(document_error)?;
        self.buffers.insert(buffer, written.map(|written| written.bytes).unwrap_or_default());
        for (accessor, before) in moved {
            let now = share::index(&document.array("accessors")?[accessor], "bufferView");
            touched.extend(now.map(|now| (before, now)));
        }
        for &(mesh, _) in &family.meshes {
            self.homes.insert(mesh, buffer);
            visit(&mut document.array_mut("meshes")?[mesh], &mut |_, reference| {
                let copy = json::integer(reference).and_then(|accessor| repeated.get(&(accessor as usize)));
                if let Some(copy) = copy {
                    *reference = json!(copy);
                }
            });
        }
        Ok(())
    }
}

/// `Streams` refuses documents only, here where there are no levels.
fn document_error(error: WriteError) -> DocumentError {
    match error {
        WriteError::Document(error) => error,
        level @ WriteError::Level { .. } => DocumentError::invalid("buffers", level.to_string()),
    }
}

/// Shows each reference of a mesh to an accessor, and whether it means indices; in an order that does not depend on the file's.
fn visit(mesh: &mut Value, see: &mut dyn FnMut(bool, &mut Value)) {
    let object = |object: &mut Value, see: &mut dyn FnMut(bool, &mut Value)| {
        let mut members: Vec<(&String, &mut Value)> = object.as_object_mut().into_iter().flatten().collect();
        members.sort_unstable_by_key(|(name, _)| *name);
        for (_, value) in members {
            see(false, value);
        }
    };
    for primitive in mesh.get_mut("primitives").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(indices) = primitive.get_mut("indices") {
            see(true, indices);
        }
        if let Some(attributes) = primitive.get_mut("attributes") {
            object(attributes, see);
        }
        let targets = primitive.get_mut("targets").and_then(Value::as_array_mut);
        targets.into_iter().flatten().for_each(|target| object(target, see));
    }
}

/// The accessors of a mesh, and which of them are indices.
fn references(mesh: &Value) -> Vec<(bool, Option<usize>)> {
    let mut found = Vec::new();
    let mut mesh = mesh.clone();
    visit(&mut mesh, &mut |is_index, value| found.push((is_index, json::integer(value).map(|i| i as usize))));
    found
}

/// The arrays of a mesh, or why they must stay where they are.
fn slots(
    document: &Document,
    views: &Views<'_>,
    mesh: usize,
) -> Result<Result<Vec<Slot>, &'static str>, DocumentError> {
    let entry = &document.array("meshes")?[mesh];
    let primitives = entry.get("primitives").and_then(Value::as_array);
    if primitives.into_iter().flatten().any(|p| json::extension(p, draco::EXTENSION).is_some()) {
        return Ok(Err("it is compressed"));
    }
    let mut slots = Vec::new();
    for (is_index, accessor) in references(entry) {
        let Some(accessor) = accessor else { return Ok(Err("it refers to something that is no number")) };
        let value = document.array("accessors")?.get(accessor).unwrap_or(&Value::Null);
        if value.get("sparse").is_some() {
            return Ok(Err("it has sparse arrays"));
        }
        let Some(view) = share::index(value, "bufferView") else { return Ok(Err("it has arrays without data")) };
        let packed = |name: &&str| document.array("bufferViews").ok()?.get(view)?.get("extensions")?.get(*name);
        if meshopt::EXTENSIONS.iter().any(|name| packed(name).is_some()) {
            return Ok(Err("it is compressed"));
        }
        let parsed = Accessor::parse(document, accessor, "meshes")?;
        let (size, count) = (parsed.layout.size(), parsed.count as usize);
        let elements = parsed.packed(views)?;
        if elements.len() != count * size {
            return Ok(Err("it has matrices with padding"));
        }
        let stride = size.next_multiple_of(4);
        let (kind, bytes) = if is_index {
            (Kind::Indices(parsed.layout.component), elements.into_owned())
        } else if stride == size {
            (Kind::Vertices(stride), elements.into_owned())
        } else {
            let mut padded = vec![0; count * stride];
            for (to, from) in padded.chunks_exact_mut(stride).zip(elements.chunks_exact(size)) {
                to[..size].copy_from_slice(from);
            }
            (Kind::Vertices(stride), padded)
        };
        slots.push(Slot { accessor, kind, bytes });
    }
    Ok(Ok(slots))
}

/// What the arrays of a mesh hold.
fn content(slots: &[Slot]) -> Vec<(Kind, [u8; 32])> {
    slots.iter().map(|slot| (slot.kind, *blake3::hash(&slot.bytes).as_bytes())).collect()
}

/// Which levels a mesh has, by their addresses: for telling whether two have the same, never for an order.
fn shape(levels: &MeshLevels) -> Vec<usize> {
    let primitives = levels.levels.iter().flat_map(|level| &level.primitives);
    let address = |primitive: &PrimitiveLevel| match primitive {
        PrimitiveLevel::AsSource => 0,
        PrimitiveLevel::Level(level) => Arc::as_ptr(level) as usize,
    };
    primitives.map(address).collect()
}

/// Who refers to each accessor: families by number; `None` for meshes that stay, animations, skins and batches.
fn users(document: &Document, families: &[Family]) -> Result<BTreeMap<usize, BTreeSet<Option<usize>>>, DocumentError> {
    let members = families.iter().enumerate();
    let members: BTreeMap<usize, usize> =
        members.flat_map(|(number, family)| family.meshes.iter().map(move |(mesh, _)| (*mesh, number))).collect();
    let mut users: BTreeMap<usize, BTreeSet<Option<usize>>> = BTreeMap::new();
    for (mesh, entry) in document.array("meshes")?.iter().enumerate() {
        for accessor in references(entry).into_iter().filter_map(|(_, accessor)| accessor) {
            users.entry(accessor).or_default().insert(members.get(&mesh).copied());
        }
    }
    for accessor in share::accessors_beside_meshes(document)? {
        users.entry(accessor).or_default().insert(None);
    }
    Ok(users)
}

/// Those of the buffers `lost` that no view needs any more keep a few bytes, and no file for them.
fn empty_unused(document: &mut Document, buffers: &mut Buffers, lost: &BTreeSet<usize>) -> Result<(), DocumentError> {
    let mut used = BTreeSet::new();
    for view in document.array("bufferViews")? {
        used.extend(share::index(view, "buffer"));
        let packed = meshopt::EXTENSIONS.iter().filter_map(|name| json::extension(view, name));
        used.extend(packed.filter_map(|packed| share::index(packed, "buffer")));
    }
    for buffer in lost.difference(&used).copied() {
        buffers.rewrite(document, buffer, NOTHING.to_vec())?;
        if document.container == Container::Gltf {
            document.array_mut("buffers")?[buffer]["uri"] = json!(data_uri(&NOTHING));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
