//! A document as the bytes of its files: changes the container where asked, and gives every buffer an address.
//!
//! - `.gltf` to `.glb`: buffer 0 becomes the BIN chunk, images of a known format go into buffer views behind it, other
//!   buffers become data URIs.
//! - `.glb` to `.gltf`: the BIN chunk becomes `NAME.bin`; embedded images stay in it.
//!
//! No entry of any array changes its index, no byte of geometry or image changes. A GLB is one file again for whoever
//! asked for one: data URIs cost a third more than the bytes, but they are rare (documents have one buffer) and need
//! no second BIN chunk, which the format has not. What is neither a buffer nor an image in `images` (a schema, an
//! alternative in an extension) stays a file beside the document. Writes no files itself.

use super::buffers::{self, Buffers};
use super::dependencies::{Dependency, DependencyKind};
use super::document::{Container, Document};
use super::error::DocumentError;
use super::json;
use super::library::LibraryFile;
use super::notes::{Note, Notes};
use super::uri;
use super::write::{NewBuffer, WriteError};
use base64::Engine;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// RFC 3986 "unreserved" stays as it is.
const ADDRESS: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'_').remove(b'.').remove(b'~');

/// The files of one document.
#[derive(Clone, Debug, PartialEq)]
pub struct Files {
    /// The `.gltf` or `.glb`.
    pub main: Vec<u8>,
    /// Written files beside it: name and content.
    pub beside: Vec<(String, Vec<u8>)>,
    /// Files of the source that the document still refers to.
    pub copied: Vec<Dependency>,
    /// Files that other documents may refer to, too.
    pub library: Vec<LibraryFile>,
}

/// A document on its way to files.
#[derive(Debug)]
pub struct Package {
    /// In the container of the output. Levels are added to it.
    pub document: Document,
    dependencies: Vec<Dependency>,
    /// Buffers whose content will be written beside the document.
    written: Vec<NewBuffer>,
    converted: bool,
    /// Ending of the names of `written`.
    ending: &'static str,
    notes: Notes,
}

impl Package {
    /// Takes a document to the container of the output. `buffers` and `dependencies` are the document's.
    pub fn new(
        document: Document,
        buffers: &Buffers,
        dependencies: Vec<Dependency>,
        container: Container,
    ) -> Result<Self, WriteError> {
        let converted = document.container != container;
        let mut package = Self {
            document,
            dependencies,
            written: Vec::new(),
            converted,
            // Beside a source of this name there may be a `.bin` of this name, which another scene needs.
            ending: if converted { "bin" } else { "mesh.bin" },
            notes: Notes::default(),
        };
        match container {
            _ if !converted => {}
            Container::Glb => package.convert_to_glb(buffers)?,
            Container::Gltf => package.convert_to_gltf(buffers)?,
        }
        package.write_homeless(buffers)?;
        Ok(package)
    }

    /// Has the container changed, so that the output differs from the source even without levels?
    pub fn is_converted(&self) -> bool {
        self.converted
    }

    /// What was left out or done differently.
    pub fn notes(&self) -> Vec<Note> {
        self.notes.clone().into_vec()
    }

    fn convert_to_glb(&mut self, buffers: &Buffers) -> Result<(), WriteError> {
        self.document.container = Container::Glb;
        let mut bin = None;
        for (i, buffer) in self.document.array("buffers")?.to_vec().iter().enumerate() {
            // Without data (compressed scenes declare such fallbacks) there is nothing to move.
            let Some(bytes) = buffers.bytes(i) else { continue };
            let form = json::string(buffer, "uri", "buffers")?.map(uri::form);
            let Value::Object(entry) = &mut self.document.array_mut("buffers")?[i] else { continue };
            if i == 0 {
                entry.shift_remove("uri");
                bin = Some(bytes.to_vec());
            } else if form != Some(uri::Form::Data) {
                entry.insert("uri".to_owned(), json!(data_uri(bytes)));
            }
        }
        if bin.is_none() && self.document.array("buffers")?.is_empty() {
            bin = Some(Vec::new());
        }
        if let Some(first) = self.document.array("buffers")?.first().filter(|_| bin.is_none()) {
            // Only compressed scenes declare buffers without data for a reason. A BIN chunk would be that data.
            if !buffers::is_fallback(first) {
                return Err(DocumentError::invalid("buffers[0]", "has no data, and in a GLB it must have some").into());
            }
        }
        if let Some(mut bin) = bin {
            self.embed_images(&mut bin)?;
            if !bin.is_empty() {
                if self.document.array("buffers")?.is_empty() {
                    self.document.push("buffers", json!({}))?;
                }
                self.document.array_mut("buffers")?[0]["byteLength"] = json!(bin.len());
                self.document.bin = Some(Arc::from(bin));
            }
        }
        self.forget_unused();
        Ok(())
    }

    fn embed_images(&mut self, bin: &mut Vec<u8>) -> Result<(), WriteError> {
        for i in 0..self.document.array("images")?.len() {
            let image = &self.document.array("images")?[i];
            let place = format!("images[{i}]");
            let Some(address) = json::string(image, "uri", &place)?.map(str::to_owned) else { continue };
            let Some(bytes) = self.image_bytes(&address, &place)? else { continue };
            let Some(kind) = image_kind(&bytes) else {
                self.notes.add(&place, "the image is in no known format and stays outside the GLB");
                continue;
            };
            bin.resize(bin.len().next_multiple_of(4), 0);
            let view = json!({ "buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len() });
            bin.extend_from_slice(&bytes);
            let view = self.document.push("bufferViews", view)?;
            let Value::Object(image) = &mut self.document.array_mut("images")?[i] else { continue };
            image.shift_remove("uri");
            image.insert("bufferView".to_owned(), json!(view));
            image.insert("mimeType".to_owned(), json!(kind));
        }
        Ok(())
    }

    /// `None`: it stays where it is.
    fn image_bytes(&mut self, address: &str, place: &str) -> Result<Option<Vec<u8>>, WriteError> {
        match uri::form(address) {
            uri::Form::Data => Ok(Some(uri::decode_data(address, format_args!("{place}.uri"))?)),
            uri::Form::Absolute => Ok(None),
            uri::Form::Relative => {
                let known = self.dependencies.iter().find(|dependency| dependency.uri == address);
                let bytes = known.and_then(|dependency| std::fs::read(&dependency.path).ok());
                if bytes.is_none() {
                    self.notes.add(place, "the image cannot be read and stays outside the GLB");
                }
                Ok(bytes)
            }
        }
    }

    fn convert_to_gltf(&mut self, buffers: &Buffers) -> Result<(), WriteError> {
        self.document.container = Container::Gltf;
        self.document.indented = true;
        let stands_for_bin = self.document.array("buffers")?.first().is_some_and(|first| first.get("uri").is_none());
        if let (Some(_), Some(bytes), true) = (self.document.bin.take(), buffers.bytes(0), stands_for_bin) {
            self.written.push(NewBuffer { index: 0, behind: 0, bytes: bytes.to_vec() });
        }
        if !std::mem::take(&mut self.document.extra_chunks).is_empty() {
            self.notes.add("chunks", "chunks of types nobody knows have no place in a `.gltf` and are left out");
        }
        Ok(())
    }

    /// Buffers with bytes but without an address (they were files and have changed) become files.
    fn write_homeless(&mut self, buffers: &Buffers) -> Result<(), WriteError> {
        let inside = self.document.bin.is_some();
        for (i, buffer) in self.document.array("buffers")?.iter().enumerate() {
            let known = (i == 0 && inside) || self.written.iter().any(|written| written.index == i);
            if let Some(bytes) = buffers.bytes(i).filter(|_| buffer.get("uri").is_none() && !known) {
                self.written.push(NewBuffer { index: i, behind: 0, bytes: bytes.to_vec() });
            }
        }
        Ok(())
    }

    /// Files that are now inside the document need not be copied.
    fn forget_unused(&mut self) {
        let dependencies = std::mem::take(&mut self.dependencies);
        let addresses: BTreeSet<String> = super::dependencies::dependencies(&self.document, Path::new(""))
            .into_iter()
            .map(|dependency| dependency.uri)
            .collect();
        self.dependencies = dependencies.into_iter().filter(|d| addresses.contains(&d.uri)).collect();
    }

    /// The files, for a main file called `stem` plus the container's extension. `added` is what `add_levels` created;
    /// `buffers` are the source document's.
    pub fn finish(mut self, stem: &str, added: Option<NewBuffer>, buffers: &Buffers) -> Result<Files, WriteError> {
        // The BIN chunk of a GLB that became a `.gltf`, and the levels behind it, are one file.
        let hosted = added.as_ref().filter(|buffer| 0 < buffer.behind).map(|buffer| buffer.index);
        let ending = if self.written.iter().any(|w| Some(w.index) == hosted) { self.ending } else { "lod.bin" };
        let added = added.map(|buffer| self.join(buffer, buffers));
        let mut taken: BTreeSet<String> =
            self.dependencies.iter().filter_map(|d| Some(d.path.file_name()?.to_str()?.to_lowercase())).collect();
        let mut beside = Vec::new();
        for buffer in std::mem::take(&mut self.written) {
            beside.push(self.address(buffer, stem, self.ending, &mut taken)?);
        }
        if let Some(buffer) = added {
            if self.keeps_buffers_inside()? {
                self.document.array_mut("buffers")?[buffer.index]["uri"] = json!(data_uri(&buffer.bytes));
            } else {
                beside.push(self.address(buffer, stem, ending, &mut taken)?);
                self.forget_unused();
            }
        }
        let main = match self.document.container {
            Container::Gltf => self.document.to_gltf_bytes(),
            Container::Glb => self.document.to_glb_bytes()?,
        };
        Ok(Files { main, beside, copied: self.dependencies, library: Vec::new() })
    }

    /// A lengthened buffer with the source's bytes before the new ones.
    fn join(&mut self, buffer: NewBuffer, buffers: &Buffers) -> NewBuffer {
        if buffer.behind == 0 {
            return buffer;
        }
        // What waits to be written becomes part of it.
        self.written.retain(|written| written.index != buffer.index);
        let mut bytes = buffers.bytes(buffer.index).unwrap_or_default().to_vec();
        bytes.resize(buffer.behind, 0);
        bytes.extend_from_slice(&buffer.bytes);
        NewBuffer { behind: 0, bytes, ..buffer }
    }

    /// A `.gltf` with all buffers in data URIs is meant to be one file.
    fn keeps_buffers_inside(&self) -> Result<bool, WriteError> {
        let buffers = self.document.array("buffers")?.iter();
        let addresses: Vec<&str> = buffers.filter_map(|buffer| buffer.get("uri")?.as_str()).collect();
        let inside = addresses.iter().all(|address| uri::form(address) == uri::Form::Data);
        Ok(self.document.container == Container::Gltf && inside && !addresses.is_empty())
    }

    /// A file for `buffer` whose name no other file of this document has.
    fn address(
        &mut self,
        buffer: NewBuffer,
        stem: &str,
        extension: &str,
        taken: &mut BTreeSet<String>,
    ) -> Result<(String, Vec<u8>), WriteError> {
        let numbered = (2_usize..).map(|number| format!("{stem}.{number}.{extension}"));
        let name = std::iter::once(format!("{stem}.{extension}"))
            .chain(numbered)
            .find(|name| taken.insert(name.to_lowercase()))
            .expect("there are more numbers than files");
        self.document.array_mut("buffers")?[buffer.index]["uri"] =
            json!(utf8_percent_encode(&name, ADDRESS).to_string());
        Ok((name, buffer.bytes))
    }
}

impl Files {
    /// Buffers among the copied files; images and others may be missing without harm to geometry.
    pub fn is_needed(dependency: &Dependency) -> bool {
        dependency.kind == DependencyKind::Buffer
    }
}

pub(super) fn data_uri(bytes: &[u8]) -> String {
    let mut text = "data:application/octet-stream;base64,".to_owned();
    base64::engine::general_purpose::STANDARD.encode_string(bytes, &mut text);
    text
}

/// By the first bytes: names and declared types lie.
fn image_kind(bytes: &[u8]) -> Option<&'static str> {
    const KINDS: [(&[u8], &str); 5] = [
        (b"\x89PNG\r\n\x1a\n", "image/png"),
        (b"\xFF\xD8\xFF", "image/jpeg"),
        (b"\xABKTX 20\xBB\r\n\x1a\n", "image/ktx2"),
        (b"DDS ", "image/vnd-ms.dds"),
        (b"sB", "image/basis"),
    ];
    let webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    let avif = bytes.get(4..12) == Some(b"ftypavif");
    let known = || KINDS.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, kind)| kind);
    webp.then_some("image/webp").or(avif.then_some("image/avif")).or_else(known)
}

#[cfg(test)]
mod tests;
