//! Buffer views of `EXT_meshopt_compression` and `KHR_meshopt_compression` to the bytes they stand for.
//!
//! Both name the same streams; the second adds the colour filter. Knows buffers, but not accessors.

use super::filters;
use crate::gltf::buffers::Buffers;
use crate::gltf::error::{DocumentError, Problem};
use crate::gltf::json;
use serde_json::Value;

/// The two names, the ratified one first: a view with both is read by the ratified one.
pub const EXTENSIONS: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// A block of the vertex codec holds at most 256 elements and 8192 bytes, and costs at least one byte per four bytes
/// of stride: no stream can stand for more than this many times its own size.
const LARGEST_GAIN: u64 = 1024;

/// What kind of stream the bytes are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// How decoded attributes are transformed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Colour,
}

/// The extension's object of one buffer view.
#[derive(Clone, Debug)]
pub struct Stream {
    extension: &'static str,
    buffer: usize,
    offset: u64,
    length: u64,
    /// Bytes of one decoded element.
    pub stride: usize,
    /// Number of decoded elements.
    count: u64,
    mode: Mode,
    filter: Filter,
}

impl Stream {
    /// The stream of a buffer view, if it has one. `place` is that of the view.
    pub fn of_view(view: &Value, place: &str) -> Result<Option<Self>, DocumentError> {
        for name in EXTENSIONS {
            if let Some(object) = json::extension(view, name) {
                return Self::parse(object, name, &format!("{place}.extensions.{name}")).map(Some);
            }
        }
        Ok(None)
    }

    fn parse(object: &Value, extension: &'static str, place: &str) -> Result<Self, DocumentError> {
        let required = |key: &'static str| {
            let found = json::uint(object, key, place)?;
            found.ok_or_else(|| DocumentError::new(place, Problem::Missing(key)))
        };
        let unknown = |key: &str, word: &str| DocumentError::invalid(place, format!("unknown {key} `{word}`"));
        let mode = match json::string(object, "mode", place)?.unwrap_or("") {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            "INDICES" => Mode::Indices,
            other => return Err(unknown("mode", other)),
        };
        let filter = match json::string(object, "filter", place)?.unwrap_or("NONE") {
            "NONE" => Filter::None,
            "OCTAHEDRAL" => Filter::Octahedral,
            "QUATERNION" => Filter::Quaternion,
            "EXPONENTIAL" => Filter::Exponential,
            "COLOR" => Filter::Colour,
            other => return Err(unknown("filter", other)),
        };
        let stream = Self {
            extension,
            buffer: required("buffer")? as usize,
            offset: json::uint(object, "byteOffset", place)?.unwrap_or(0),
            length: required("byteLength")?,
            stride: usize::try_from(required("byteStride")?).unwrap_or(usize::MAX),
            count: required("count")?,
            mode,
            filter,
        };
        stream.check(place)?;
        Ok(stream)
    }

    /// The codec trusts these; a lie would be an assertion or a huge allocation there.
    fn check(&self, place: &str) -> Result<(), DocumentError> {
        let stride = self.stride;
        let strides = match (self.mode, self.filter) {
            (Mode::Attributes, Filter::None | Filter::Exponential) => {
                stride.is_multiple_of(4) && (4..=256).contains(&stride)
            }
            (Mode::Attributes, Filter::Octahedral | Filter::Colour) => stride == 4 || stride == 8,
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
            (_, Filter::None) => stride == 2 || stride == 4,
            _ => return Err(DocumentError::invalid(place, "a filter is for attributes only")),
        };
        if !strides {
            return Err(DocumentError::invalid(
                place,
                format!("`byteStride` {stride} does not fit its mode and filter"),
            ));
        }
        if self.mode == Mode::Triangles && !self.count.is_multiple_of(3) {
            return Err(DocumentError::invalid(place, format!("`count` {} is not a multiple of three", self.count)));
        }
        let most = match self.mode {
            Mode::Attributes => self.length.saturating_mul(LARGEST_GAIN) / stride as u64,
            Mode::Triangles => self.length.saturating_mul(3),
            Mode::Indices => self.length,
        };
        if self.count > most {
            let words = format!("{} bytes cannot hold {} elements", self.length, self.count);
            return Err(DocumentError::invalid(place, words));
        }
        Ok(())
    }

    /// Is it a vertex stream, whose stride is that of its accessors?
    pub fn is_attributes(&self) -> bool {
        self.mode == Mode::Attributes
    }

    /// The decoded bytes: `count` elements of `stride` bytes.
    pub fn decode(&self, buffers: &Buffers, place: &str) -> Result<Vec<u8>, DocumentError> {
        let place = format!("{place}.extensions.{}", self.extension);
        let encoded = buffers.range(self.buffer, self.offset, self.length, &place)?;
        let count = self.count as usize;
        let decoded = match (self.mode, self.stride) {
            _ if count == 0 => Some(Vec::new()),
            (Mode::Attributes, stride) => decode_vertices(encoded, count, stride),
            (Mode::Triangles, 2) => as_bytes(meshopt::decode_index_buffer::<u16>(encoded, count)),
            (Mode::Triangles, _) => as_bytes(meshopt::decode_index_buffer::<u32>(encoded, count)),
            (Mode::Indices, 2) => as_bytes(meshopt::decode_index_sequence::<u16>(encoded, count)),
            (Mode::Indices, _) => as_bytes(meshopt::decode_index_sequence::<u32>(encoded, count)),
        };
        let mut decoded = decoded.ok_or_else(|| {
            let reason = "the stream is damaged, or in a later version of the codec".to_owned();
            DocumentError::new(&place, Problem::Decode { extension: self.extension, reason })
        })?;
        match self.filter {
            Filter::None => {}
            Filter::Octahedral => filters::octahedral(&mut decoded, self.stride / 4),
            Filter::Quaternion => filters::quaternion(&mut decoded),
            Filter::Exponential => filters::exponential(&mut decoded),
            Filter::Colour => filters::colour(&mut decoded, self.stride / 4),
        }
        Ok(decoded)
    }
}

fn as_bytes<T: bytemuck::Pod>(decoded: meshopt::Result<Vec<T>>) -> Option<Vec<u8>> {
    Some(bytemuck::cast_slice(&decoded.ok()?).to_vec())
}

/// An element of `WORDS` × 4 bytes; arrays of that many have no `Default` of their own.
#[derive(Clone)]
struct Element<const WORDS: usize>([u32; WORDS]);

impl<const WORDS: usize> Default for Element<WORDS> {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

fn decode_words<const WORDS: usize>(encoded: &[u8], count: usize) -> Option<Vec<u8>> {
    let elements = meshopt::decode_vertex_buffer::<Element<WORDS>>(encoded, count).ok()?;
    let mut bytes = Vec::with_capacity(count * WORDS * 4);
    for element in &elements {
        bytes.extend_from_slice(bytemuck::cast_slice(&element.0));
    }
    Some(bytes)
}

/// The library takes the stride as a type; the format allows 64 of them.
fn decode_vertices(encoded: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    macro_rules! by_words {
        ($($words:literal)*) => {
            match stride / 4 {
                $($words => decode_words::<$words>(encoded, count),)*
                _ => None,
            }
        };
    }
    by_words!(
        1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::{Container, Document};
    use serde_json::json;
    use std::path::Path;
    use std::sync::Arc;

    fn buffers(bytes: &[u8]) -> Buffers {
        let mut document = Document::new(Container::Glb, "test");
        document.json["buffers"] = json!([{ "byteLength": bytes.len() }]);
        document.bin = Some(Arc::from(bytes));
        Buffers::load(&document, Path::new("")).unwrap()
    }

    fn decode(encoded: &[u8], mut object: Value) -> Result<Vec<u8>, String> {
        object["buffer"] = json!(0);
        object["byteLength"] = json!(encoded.len());
        let view = json!({ "extensions": { "EXT_meshopt_compression": object } });
        let decoded = Stream::of_view(&view, "view").and_then(|s| s.unwrap().decode(&buffers(encoded), "view"));
        decoded.map_err(|e| e.to_string())
    }

    #[test]
    fn attributes_of_small_and_large_strides_in_both_versions() {
        let values: Vec<[u32; 5]> = (0..1000).map(|i| [i, i * i, 7, i / 3, 0]).collect();
        let wide: Vec<[u32; 64]> = (0..300).map(|i| [i; 64]).collect();
        for version in [0, 1] {
            let encoded = meshopt::encode_vertex_buffer_level(&values, 2, Some(version)).unwrap();
            let object = json!({ "mode": "ATTRIBUTES", "byteStride": 20, "count": 1000 });
            assert_eq!(decode(&encoded, object).unwrap(), bytemuck::cast_slice::<_, u8>(&values));
            let encoded = meshopt::encode_vertex_buffer_level(&wide, 2, Some(version)).unwrap();
            let object = json!({ "mode": "ATTRIBUTES", "byteStride": 256, "count": 300 });
            assert_eq!(decode(&encoded, object).unwrap(), bytemuck::cast_slice::<_, u8>(&wide));
        }
    }

    #[test]
    fn constant_attributes_stay_below_the_largest_gain() {
        fn check<const WORDS: usize>() {
            let zeros = vec![Element::<WORDS>::default(); 100_000];
            let encoded = meshopt::encode_vertex_buffer_level(&zeros, 3, Some(1)).unwrap();
            let object = json!({ "mode": "ATTRIBUTES", "byteStride": WORDS * 4, "count": 100_000 });
            assert_eq!(decode(&encoded, object).unwrap().len(), 400_000 * WORDS);
        }
        check::<1>();
        check::<8>();
        check::<64>();
    }

    #[test]
    fn index_streams() {
        let indices = [0u32, 1, 2, 2, 1, 3, 2, 3, 4];
        let triangles = meshopt::encode_index_buffer(&indices, 5).unwrap();
        let sequence = meshopt::encode_index_sequence(&indices, 5).unwrap();
        for (mode, encoded) in [("TRIANGLES", &triangles), ("INDICES", &sequence)] {
            let wide = decode(encoded, json!({ "mode": mode, "byteStride": 4, "count": 9 })).unwrap();
            let narrow = decode(encoded, json!({ "mode": mode, "byteStride": 2, "count": 9 })).unwrap();
            let wide: Vec<u32> = bytemuck::pod_collect_to_vec(&wide);
            let narrow: Vec<u16> = bytemuck::pod_collect_to_vec(&narrow);
            assert!(wide.iter().zip(&narrow).all(|(a, b)| *a == u32::from(*b)));
            if mode == "INDICES" {
                assert_eq!(wide, indices);
            }
        }
    }

    #[test]
    fn lies_are_refused() {
        let encoded = meshopt::encode_vertex_buffer(&[[1u32; 2]; 16]).unwrap();
        let failure = |object: Value| decode(&encoded, object).unwrap_err();
        let huge = failure(json!({ "mode": "ATTRIBUTES", "byteStride": 8, "count": 1_000_000_000_000_u64 }));
        assert!(huge.ends_with("cannot hold 1000000000000 elements"), "{huge}");
        let stride = failure(json!({ "mode": "ATTRIBUTES", "byteStride": 6, "count": 16 }));
        assert!(stride.ends_with("`byteStride` 6 does not fit its mode and filter"), "{stride}");
        assert!(failure(json!({ "mode": "ATTRIBUTES", "byteStride": 260, "count": 1 })).contains("260"));
        assert!(failure(json!({ "mode": "TRIANGLES", "byteStride": 4, "count": 4 })).contains("multiple of three"));
        assert!(failure(json!({ "mode": "TRIANGLES", "byteStride": 4, "count": 3 })).contains("damaged"));
        assert!(failure(json!({ "mode": "ATTRIBUTES", "byteStride": 8, "count": 1000 })).contains("damaged"));
        assert!(failure(json!({ "mode": "MAGIC", "byteStride": 8, "count": 16 })).contains("unknown mode `MAGIC`"));
        assert!(
            failure(json!({ "mode": "INDICES", "byteStride": 8, "filter": "OCTAHEDRAL", "count": 3 }))
                .contains("filter")
        );
        assert!(failure(json!({ "mode": "ATTRIBUTES", "count": 16 })).contains("`byteStride` is missing"));
    }
}
