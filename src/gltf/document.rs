//! The lossless document: all JSON as it stood, the GLB's binary chunk, and chunks nobody knows.
//!
//! Existing entries are never renumbered or dropped; a writer appends. Knows nothing of what the entries mean: `json`
//! has the look-ups, `read` the sense. No file access.

pub use super::error::{DocumentError, Problem};
use super::json;
use serde_json::{Map, Value, json};
use std::sync::Arc;

const MAGIC: [u8; 4] = *b"glTF";
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// The form a document was stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// JSON text, `.gltf`.
    Gltf,
    /// The binary container, `.glb`.
    Glb,
}

/// A glTF 2.0 document without any loss.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// The root object. Keys keep their order.
    pub json: Value,
    /// How the document was stored.
    pub container: Container,
    /// The GLB's BIN chunk, with its padding.
    pub bin: Option<Arc<[u8]>>,
    /// Chunks of other types, in order: type and content.
    pub extra_chunks: Vec<(u32, Vec<u8>)>,
    /// The JSON text had line breaks, so people may read it: keep it that way.
    pub indented: bool,
}

impl Document {
    /// An empty document of version 2.0.
    pub fn new(container: Container, generator: &str) -> Self {
        let json = json!({ "asset": { "version": "2.0", "generator": generator } });
        Self { json, container, bin: None, extra_chunks: Vec::new(), indented: false }
    }

    /// Takes a `.gltf` or `.glb` apart; which one it is, the first bytes tell.
    pub fn parse(bytes: &[u8]) -> Result<Self, DocumentError> {
        let document = if bytes.starts_with(&MAGIC) { parse_glb(bytes)? } else { parse_gltf(bytes)? };
        check_version(&document.json)?;
        Ok(document)
    }

    /// The array `name` of the root (`"meshes"`); empty if absent.
    pub fn array(&self, name: &str) -> Result<&[Value], DocumentError> {
        match self.json.get(name) {
            None => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(other) => Err(not_an_array(name, other)),
        }
    }

    /// The array `name` of the root, created if absent.
    pub fn array_mut(&mut self, name: &str) -> Result<&mut Vec<Value>, DocumentError> {
        let found = json::type_name(&self.json);
        let Value::Object(root) = &mut self.json else {
            return Err(DocumentError::new("", Problem::Type { expected: "an object", found }));
        };
        match root.entry(name).or_insert_with(|| Value::Array(Vec::new())) {
            Value::Array(items) => Ok(items),
            other => Err(not_an_array(name, other)),
        }
    }

    /// Appends to the array `name` of the root; answers the new entry's index.
    pub fn push(&mut self, name: &str, value: Value) -> Result<usize, DocumentError> {
        let items = self.array_mut(name)?;
        items.push(value);
        Ok(items.len() - 1)
    }

    /// Does `extensionsUsed` or `extensionsRequired` (the `list`) hold `extension`?
    pub fn lists_extension(&self, list: &str, extension: &str) -> bool {
        self.array(list).is_ok_and(|names| names.iter().any(|n| n.as_str() == Some(extension)))
    }

    /// Adds `extension` to `extensionsUsed`, and to `extensionsRequired` if `required`; no entry twice.
    pub fn use_extension(&mut self, extension: &str, required: bool) -> Result<(), DocumentError> {
        let lists: &[&str] = if required { &["extensionsUsed", "extensionsRequired"] } else { &["extensionsUsed"] };
        for list in lists {
            if !self.lists_extension(list, extension) {
                self.push(list, Value::from(extension))?;
            }
        }
        Ok(())
    }

    /// The JSON text alone, as a `.gltf` file holds it.
    pub fn to_gltf_bytes(&self) -> Vec<u8> {
        let text = if self.indented { serde_json::to_vec_pretty(&self.json) } else { serde_json::to_vec(&self.json) };
        text.expect("a value has string keys only and writing to memory does not fail")
    }

    /// The binary container: JSON, BIN if there is one, then the other chunks. Fails above 4 GiB, which the format
    /// cannot express.
    pub fn to_glb_bytes(&self) -> Result<Vec<u8>, DocumentError> {
        let text = serde_json::to_vec(&self.json).expect("as in `to_gltf_bytes`");
        let bin = self.bin.iter().map(|b| (CHUNK_BIN, b.as_ref(), 0));
        let extra = self.extra_chunks.iter().map(|(kind, data)| (*kind, data.as_slice(), 0));
        let chunks: Vec<_> = std::iter::once((CHUNK_JSON, text.as_slice(), b' ')).chain(bin).chain(extra).collect();
        let length = 12 + chunks.iter().map(|(_, data, _)| 8 + data.len().next_multiple_of(4)).sum::<usize>();
        let length = u32::try_from(length).map_err(|_| {
            DocumentError::new("", Problem::Glb(format!("{length} bytes do not fit into a GLB (4 GiB)")))
        })?;
        let mut out = Vec::with_capacity(length as usize);
        out.extend(MAGIC);
        out.extend(2u32.to_le_bytes());
        out.extend(length.to_le_bytes());
        for (kind, data, padding) in chunks {
            let padded = data.len().next_multiple_of(4);
            out.extend((padded as u32).to_le_bytes());
            out.extend(kind.to_le_bytes());
            out.extend_from_slice(data);
            out.resize(out.len() + padded - data.len(), padding);
        }
        Ok(out)
    }
}

fn not_an_array(name: &str, found: &Value) -> DocumentError {
    DocumentError::new(name, Problem::Type { expected: "an array", found: json::type_name(found) })
}

fn parse_gltf(bytes: &[u8]) -> Result<Document, DocumentError> {
    let json = parse_json(bytes)?;
    let indented = bytes.contains(&b'\n');
    Ok(Document { json, container: Container::Gltf, bin: None, extra_chunks: Vec::new(), indented })
}

/// Some exporters write a byte-order mark, some pad with zeros where the specification wants spaces.
fn parse_json(bytes: &[u8]) -> Result<Value, DocumentError> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let end = text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    serde_json::from_slice(&text[..end]).map_err(|e| {
        let words = e.to_string();
        // The parser repeats the position at the end; ours stands before the words.
        let message = words.split(" at line ").next().unwrap_or_default().to_owned();
        DocumentError::new("", Problem::Json { line: e.line(), column: e.column(), message })
    })
}

fn parse_glb(bytes: &[u8]) -> Result<Document, DocumentError> {
    let glb = |words: String| DocumentError::new("", Problem::Glb(words));
    let word =
        |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?)) };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(glb(format!("the header needs 12 bytes, the file has {}", bytes.len())));
    };
    if version != 2 {
        return Err(DocumentError::new("", Problem::Version(format!("{version} (GLB container)"))));
    }
    if length as usize != bytes.len() {
        return Err(glb(format!("the header says {length} bytes, the file has {}", bytes.len())));
    }
    let mut json = None;
    let mut bin = None;
    let mut extra_chunks = Vec::new();
    let mut at = 12;
    while at < bytes.len() {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(glb(format!("a chunk header at byte {at} is cut short")));
        };
        let rest = &bytes[at + 8..];
        let Some(data) = rest.get(..size as usize) else {
            return Err(glb(format!("the chunk at byte {at} says {size} bytes, {} are left", rest.len())));
        };
        match kind {
            CHUNK_JSON if at == 12 => json = Some(parse_json(data)?),
            _ if at == 12 => return Err(glb("the first chunk is not JSON".to_owned())),
            CHUNK_JSON => return Err(glb(format!("a second JSON chunk at byte {at}"))),
            CHUNK_BIN if bin.is_some() => return Err(glb(format!("a second BIN chunk at byte {at}"))),
            CHUNK_BIN => bin = Some(Arc::from(data)),
            _ => extra_chunks.push((kind, data.to_vec())),
        }
        at += 8 + size as usize;
    }
    let json = json.ok_or_else(|| glb("there is no JSON chunk".to_owned()))?;
    Ok(Document { json, container: Container::Glb, bin, extra_chunks, indented: false })
}

fn check_version(root: &Value) -> Result<(), DocumentError> {
    let root: &Map<String, Value> = json::object(root, "")?;
    let asset = root.get("asset").ok_or_else(|| DocumentError::new("", Problem::Missing("asset")))?;
    json::object(asset, "asset")?;
    let version = json::string(asset, "version", "asset")?
        .ok_or_else(|| DocumentError::new("asset", Problem::Missing("version")))?;
    // `minVersion` is what a reader must know; without it every 2.x is readable by the specification's promise.
    let needed = json::string(asset, "minVersion", "asset")?.unwrap_or(version);
    let newer = json::string(asset, "minVersion", "asset")?.is_some_and(|v| v != "2.0");
    if newer || needed.split('.').next() != Some("2") {
        return Err(DocumentError::new("asset", Problem::Version(needed.to_owned())));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = r#"{"asset":{"version":"2.0"},"nodes":[{"name":"a"}],"zebra":1,"apple":[]}"#;

    fn failure(bytes: &[u8]) -> String {
        Document::parse(bytes).unwrap_err().to_string()
    }

    #[test]
    fn json_text_survives_byte_for_byte() {
        let document = Document::parse(SMALL.as_bytes()).unwrap();
        assert_eq!(document.container, Container::Gltf);
        assert_eq!(document.to_gltf_bytes(), SMALL.as_bytes());
    }

    #[test]
    fn glb_with_unknown_chunks_survives() {
        let mut document = Document::parse(SMALL.as_bytes()).unwrap();
        document.container = Container::Glb;
        document.bin = Some(Arc::from([1u8, 2, 3, 4].as_slice()));
        document.extra_chunks = vec![(0x4142_4344, vec![9; 8])];
        let bytes = document.to_glb_bytes().unwrap();
        assert_eq!(bytes.len() % 4, 0);
        assert_eq!(Document::parse(&bytes).unwrap(), document);
    }

    #[test]
    fn byte_order_mark_and_zero_padding_are_tolerated() {
        let text = format!("\u{feff}{SMALL}\0\0");
        assert!(Document::parse(text.as_bytes()).is_ok());
    }

    #[test]
    fn wrong_lengths_are_named() {
        let whole = Document::parse(SMALL.as_bytes()).unwrap().to_glb_bytes().unwrap();
        for end in 4..whole.len() {
            assert!(failure(&whole[..end]).starts_with("damaged GLB: "), "{end}");
        }
        let mut long = whole.clone();
        long.extend([0; 4]);
        let words = format!("damaged GLB: the header says {} bytes, the file has {}", whole.len(), long.len());
        assert_eq!(failure(&long), words);
    }

    #[test]
    fn versions() {
        assert_eq!(failure(b"{}"), "`asset` is missing");
        assert_eq!(failure(b"[]"), "expected an object, found an array");
        assert_eq!(failure(br#"{"asset":{}}"#), "asset: `version` is missing");
        assert_eq!(failure(br#"{"asset":{"version":2.0}}"#), "asset.version: expected a string, found a number");
        let old = failure(br#"{"asset":{"version":"1.0"}}"#);
        assert_eq!(old, "asset: glTF version `1.0` is not supported (known: 2.0)");
        assert!(failure(br#"{"asset":{"version":"2.1","minVersion":"2.1"}}"#).contains("`2.1`"));
        assert!(Document::parse(br#"{"asset":{"version":"2.1"}}"#).is_ok());
    }

    #[test]
    fn deep_nesting_is_refused_not_overflowed() {
        let deep = "[".repeat(200_000);
        assert!(failure(deep.as_bytes()).contains("recursion limit"));
    }

    #[test]
    fn arrays_are_created_but_never_replaced() {
        let mut document = Document::parse(SMALL.as_bytes()).unwrap();
        assert_eq!(document.push("nodes", json!({})).unwrap(), 1);
        assert_eq!(document.push("meshes", json!({})).unwrap(), 0);
        let wrong = document.push("zebra", json!({})).unwrap_err().to_string();
        assert_eq!(wrong, "zebra: expected an array, found a number");
        document.use_extension("MSFT_lod", false).unwrap();
        document.use_extension("MSFT_lod", true).unwrap();
        assert_eq!(document.json["extensionsUsed"], json!(["MSFT_lod"]));
        assert_eq!(document.json["extensionsRequired"], json!(["MSFT_lod"]));
    }

    #[test]
    fn integers_written_as_floats_are_integers() {
        let node = json!({ "mesh": 2.0, "skin": 2.5, "camera": -1, "name": 7 });
        assert_eq!(json::index(&node, "mesh", "nodes[3]").unwrap(), Some(2));
        assert_eq!(json::index(&node, "absent", "nodes[3]").unwrap(), None);
        let words = json::index(&node, "skin", "nodes[3]").unwrap_err().to_string();
        assert_eq!(words, "nodes[3].skin: expected an index, found a number");
        assert!(json::index(&node, "camera", "nodes[3]").is_err());
        assert!(json::string(&node, "name", "nodes[3]").is_err());
    }
}
