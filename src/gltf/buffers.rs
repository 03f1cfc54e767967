//! The bytes behind `buffers`: the GLB's BIN chunk, data URIs, and files beside the scene.
//!
//! Knows nothing of what the bytes mean. A buffer without any data is no fault here (compressed scenes declare such
//! fallbacks); whoever needs its bytes gets an error.

use super::decode::meshopt::EXTENSIONS;
use super::document::{Container, Document};
use super::error::{DocumentError, Problem};
use super::{json, package, uri};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes that several places may hold without a copy.
#[derive(Clone, Debug)]
enum Blob {
    /// Cut out of a GLB, shared with its [`Document`].
    Chunk(Arc<[u8]>),
    /// A decoded data URI or a file.
    Whole(Arc<Vec<u8>>),
}

/// One entry of `buffers`.
#[derive(Clone, Debug)]
struct Slot {
    /// At least `length` bytes; `None` if the document gives no data.
    data: Option<Blob>,
    /// `byteLength`.
    length: usize,
}

/// The bytes of every buffer of a document.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    slots: Vec<Slot>,
}

impl Buffers {
    /// Loads all buffers; relative addresses start at `base`, the scene's folder.
    pub fn load(document: &Document, base: &Path) -> Result<Self, DocumentError> {
        let mut files = BTreeMap::new();
        let mut slots = Vec::new();
        for (i, buffer) in document.array("buffers")?.iter().enumerate() {
            let place = format!("buffers[{i}]");
            let data = match json::string(buffer, "uri", &place)? {
                Some(address) => Some(load_address(address, base, &place, &mut files)?),
                None if i == 0 && document.container == Container::Glb => bin_chunk(document, buffer, &place)?,
                None => None,
            };
            slots.push(checked_slot(buffer, data, &place)?);
        }
        Ok(Self { slots })
    }

    /// Number of buffers.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Is there no buffer?
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The `byteLength` bytes of a buffer; `None` if it does not exist or the document gives no data for it.
    pub fn bytes(&self, index: usize) -> Option<&[u8]> {
        let slot = self.slots.get(index)?;
        let data: &[u8] = match slot.data.as_ref()? {
            Blob::Chunk(data) => data,
            Blob::Whole(data) => data,
        };
        Some(&data[..slot.length])
    }

    /// Gives a buffer other bytes, here and in its document: a BIN chunk and a data URI hold them, a buffer that was a file
    /// loses its address, and `package` finds it another one.
    pub(super) fn rewrite(
        &mut self,
        document: &mut Document,
        index: usize,
        bytes: Vec<u8>,
    ) -> Result<(), DocumentError> {
        let entry = &mut document.array_mut("buffers")?[index];
        entry["byteLength"] = json!(bytes.len());
        let address = entry.get("uri").and_then(Value::as_str).map(uri::form);
        let is_chunk = address.is_none() && index == 0 && document.container == Container::Glb;
        let entry = &mut document.array_mut("buffers")?[index];
        match address {
            Some(uri::Form::Data) => entry["uri"] = json!(package::data_uri(&bytes)),
            Some(_) => drop(entry.as_object_mut().and_then(|entry| entry.shift_remove("uri"))),
            None if is_chunk => document.bin = Some(Arc::from(bytes.as_slice())),
            None => {}
        }
        if let Some(slot) = self.slots.get_mut(index) {
            slot.length = bytes.len();
            slot.data = Some(Blob::Whole(Arc::new(bytes)));
        }
        Ok(())
    }

    /// `length` bytes from `offset` of a buffer; every lie about them is an error at `place`.
    pub fn range(&self, index: usize, offset: u64, length: u64, place: impl Display) -> Result<&[u8], DocumentError> {
        let count = self.slots.len();
        if index >= count {
            let problem = Problem::Unresolved { kind: "buffer", index: index as u64, count };
            return Err(DocumentError::new(place, problem));
        }
        let bytes = self.bytes(index).ok_or_else(|| DocumentError::new(&place, Problem::NoData { buffer: index }))?;
        let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
        let Some(end) = end else {
            return Err(DocumentError::new(
                place,
                Problem::Short {
                    what: format!("the range from byte {offset}"),
                    holder: format!("buffer {index}"),
                    needed: offset.saturating_add(length),
                    available: bytes.len() as u64,
                },
            ));
        };
        Ok(&bytes[offset as usize..end as usize])
    }
}

/// Does this buffer stand for data that only exists compressed?
pub(super) fn is_fallback(buffer: &Value) -> bool {
    EXTENSIONS.iter().any(|name| json::extension(buffer, name).is_some())
}

/// The first buffer of a GLB is its BIN chunk, unless it stands for data that only exists compressed.
fn bin_chunk(document: &Document, buffer: &Value, place: &str) -> Result<Option<Blob>, DocumentError> {
    let bin = document.bin.clone().map(Blob::Chunk);
    if bin.is_none() && !is_fallback(buffer) {
        return Err(DocumentError::new(place, Problem::Glb("there is no BIN chunk for this buffer".to_owned())));
    }
    Ok(bin)
}

fn load_address(
    address: &str,
    base: &Path,
    place: &str,
    files: &mut BTreeMap<PathBuf, Blob>,
) -> Result<Blob, DocumentError> {
    let place = format!("{place}.uri");
    if uri::form(address) == uri::Form::Data {
        return Ok(Blob::Whole(Arc::new(uri::decode_data(address, &place)?)));
    }
    let path = uri::resolve(address, base, &place)?;
    if let Some(known) = files.get(&path) {
        return Ok(known.clone());
    }
    let data = read_file(&path)
        .map_err(|reason| DocumentError::new(&place, Problem::File { uri: uri::shorten(address), reason }))?;
    let blob = Blob::Whole(Arc::new(data));
    files.insert(path, blob.clone());
    Ok(blob)
}

/// Only plain files: a pipe would block, a device would never end.
fn read_file(path: &Path) -> Result<Vec<u8>, String> {
    let words = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        _ => e.to_string(),
    };
    if !std::fs::metadata(path).map_err(words)?.is_file() {
        return Err("it is not a plain file".to_owned());
    }
    std::fs::read(path).map_err(words)
}

fn checked_slot(buffer: &Value, data: Option<Blob>, place: &str) -> Result<Slot, DocumentError> {
    json::object(buffer, place)?;
    let declared = json::uint(buffer, "byteLength", place)?
        .ok_or_else(|| DocumentError::new(place, Problem::Missing("byteLength")))?;
    let available = match &data {
        None => return Ok(Slot { data, length: 0 }),
        Some(Blob::Chunk(data)) => data.len(),
        Some(Blob::Whole(data)) => data.len(),
    };
    if declared > available as u64 {
        let holder = if matches!(data, Some(Blob::Chunk(_))) { "the BIN chunk" } else { "its data" };
        let (what, holder) = ("`byteLength`".to_owned(), holder.to_owned());
        let problem = Problem::Short { what, holder, needed: declared, available: available as u64 };
        return Err(DocumentError::new(place, problem));
    }
    Ok(Slot { data, length: declared as usize })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn document(container: Container, buffers: Value) -> Document {
        let mut document = Document::new(container, "test");
        document.json["buffers"] = buffers;
        document
    }

    fn load(document: &Document, base: &Path) -> Result<Buffers, String> {
        Buffers::load(document, base).map_err(|e| e.to_string())
    }

    #[test]
    fn chunk_data_and_files() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b.bin"), [7, 8, 9]).unwrap();
        let mut document = document(
            Container::Glb,
            json!([
                { "byteLength": 3 },
                { "byteLength": 2, "uri": "data:;base64,AQID" },
                { "byteLength": 3, "uri": "a%20b.bin" },
                { "byteLength": 3, "uri": "a b.bin" },
                { "byteLength": 1_000_000_000_000_u64 },
            ]),
        );
        document.bin = Some(Arc::from([4u8, 5, 6, 0].as_slice()));
        let buffers = load(&document, folder.path()).unwrap();
        assert_eq!(buffers.bytes(0), Some(&[4, 5, 6][..]));
        assert_eq!(buffers.bytes(1), Some(&[1, 2][..]));
        assert_eq!(buffers.bytes(2), Some(&[7, 8, 9][..]));
        assert_eq!(buffers.bytes(3), buffers.bytes(2));
        assert_eq!(buffers.bytes(4), None);
        assert_eq!(buffers.bytes(5), None);
        assert_eq!(buffers.range(2, 1, 2, "here").unwrap(), [8, 9]);
        let words = |index, offset, length| buffers.range(index, offset, length, "here").unwrap_err().to_string();
        assert_eq!(words(2, 2, 2), "here: the range from byte 2 needs 4 bytes, but buffer 2 has 3");
        assert_eq!(
            words(2, u64::MAX, 2),
            format!("here: the range from byte {0} needs {0} bytes, but buffer 2 has 3", u64::MAX)
        );
        assert_eq!(words(4, 0, 1), "here: buffer 4 has neither an address nor data");
        assert_eq!(words(9, 0, 1), "here: buffer 9 does not exist (there are 5)");
    }

    #[test]
    fn short_and_missing_data_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let failure = |container, buffer| load(&document(container, json!([buffer])), folder.path()).unwrap_err();
        let short = failure(Container::Gltf, json!({ "byteLength": 4, "uri": "data:;base64,AQID" }));
        assert_eq!(short, "buffers[0]: `byteLength` needs 4 bytes, but its data has 3");
        let absent = failure(Container::Gltf, json!({ "byteLength": 4, "uri": "no.bin" }));
        assert_eq!(absent, "buffers[0].uri: cannot read `no.bin`: there is no such file");
        let folder_name = failure(Container::Gltf, json!({ "byteLength": 4, "uri": "." }));
        assert_eq!(folder_name, "buffers[0].uri: cannot read `.`: it is not a plain file");
        assert_eq!(failure(Container::Gltf, json!({})), "buffers[0]: `byteLength` is missing");
        assert_eq!(failure(Container::Gltf, json!(7)), "buffers[0]: expected an object, found a number");
    }
}
