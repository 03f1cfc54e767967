//! Buffer views as bytes, decompressed where they are compressed. Knows nothing of accessors.

use super::buffers::Buffers;
use super::decode::meshopt::Stream;
use super::document::Document;
use super::error::{DocumentError, Problem};
use super::json;
use serde_json::Value;
use std::fmt::Display;
use std::sync::OnceLock;

/// The bytes of one buffer view.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// All bytes of the view.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next, where the view says so.
    pub stride: Option<usize>,
}

/// All buffer views of a document. Compressed ones are decoded when first asked for, once.
#[derive(Debug)]
pub struct Views<'a> {
    entries: &'a [Value],
    buffers: &'a Buffers,
    decoded: Vec<OnceLock<Result<Vec<u8>, DocumentError>>>,
}

impl<'a> Views<'a> {
    /// Prepares; decodes nothing yet.
    pub fn new(document: &'a Document, buffers: &'a Buffers) -> Result<Self, DocumentError> {
        let entries = document.array("bufferViews")?;
        let decoded = entries.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { entries, buffers, decoded })
    }

    /// The view `index`, which `place` refers to.
    pub fn get(&self, index: usize, place: impl Display) -> Result<View<'_>, DocumentError> {
        let Some(view) = self.entries.get(index) else {
            let problem = Problem::Unresolved { kind: "buffer view", index: index as u64, count: self.entries.len() };
            return Err(DocumentError::new(place, problem));
        };
        let place = format!("bufferViews[{index}]");
        json::object(view, &place)?;
        let required = |key: &'static str| {
            let found = json::uint(view, key, &place)?;
            found.ok_or_else(|| DocumentError::new(&place, Problem::Missing(key)))
        };
        // Zero stands for "packed" in files of some exporters.
        let stride = json::uint(view, "byteStride", &place)?.filter(|&s| s != 0);
        let stride = stride.map(|s| usize::try_from(s).unwrap_or(usize::MAX));
        if let Some(stream) = Stream::of_view(view, &place)? {
            let decoded = self.decoded[index].get_or_init(|| stream.decode(self.buffers, &place));
            let bytes = decoded.as_ref().map_err(Clone::clone)?;
            return Ok(View { bytes, stride: stride.or(stream.is_attributes().then_some(stream.stride)) });
        }
        let offset = json::uint(view, "byteOffset", &place)?.unwrap_or(0);
        let buffer = required("buffer")? as usize;
        let bytes = self.buffers.range(buffer, offset, required("byteLength")?, &place)?;
        Ok(View { bytes, stride })
    }
}
