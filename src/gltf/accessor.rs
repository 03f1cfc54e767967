//! Accessors as numbers: every component type, normalised, interleaved, sparse, with or without data.
//!
//! Counts and offsets are believed only as far as there are bytes to back them. Knows nothing of meshes.

use super::document::Document;
use super::error::{DocumentError, Problem};
use super::json;
use super::views::{View, Views};
use crate::mesh::{ComponentType, Format};
use serde_json::Value;
use std::borrow::Cow;

/// Elements of an accessor with no bytes of its own (all zero, perhaps with sparse values), if nothing else tells how
/// many there must be. 2²⁰ zeros are 12 MB of positions; a real mesh of that size has data.
const MOST_WITHOUT_DATA: u64 = 1 << 20;

/// The shape of an accessor's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Type of one component.
    pub component: ComponentType,
    /// Components of one column: 1…4.
    rows: usize,
    /// Columns: 1 for scalars and vectors, 2…4 for matrices.
    columns: usize,
}

impl Layout {
    fn new(component: ComponentType, kind: &str) -> Option<Self> {
        let (rows, columns) = match kind {
            "SCALAR" => (1, 1),
            "VEC2" => (2, 1),
            "VEC3" => (3, 1),
            "VEC4" => (4, 1),
            "MAT2" => (2, 2),
            "MAT3" => (3, 3),
            "MAT4" => (4, 4),
            _ => return None,
        };
        Some(Self { component, rows, columns })
    }

    /// Numbers in one element.
    pub fn components(self) -> usize {
        self.rows * self.columns
    }

    /// Bytes from one column of a matrix to the next: columns start at multiples of four.
    fn column_size(self) -> usize {
        let size = self.rows * self.component.size();
        if self.columns > 1 { size.next_multiple_of(4) } else { size }
    }

    /// Bytes of one element.
    pub fn size(self) -> usize {
        self.column_size() * self.columns
    }

    fn is_packed(self) -> bool {
        self.column_size() == self.rows * self.component.size()
    }
}

/// One entry of `accessors`, checked but not yet read.
#[derive(Clone, Debug)]
pub struct Accessor<'a> {
    place: String,
    value: &'a Value,
    /// Shape of an element.
    pub layout: Layout,
    /// Integers stand for [0, 1] or [-1, 1]; never set for floats, where the flag has no meaning.
    pub normalized: bool,
    /// Number of elements, as the document says.
    pub count: u64,
}

/// The numbers of an accessor.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Numbers in one element.
    pub components: usize,
    /// Storage in the file.
    pub format: Format,
    /// Element after element; see [`crate::mesh::Attribute::values`].
    pub values: Vec<f32>,
}

impl<'a> Accessor<'a> {
    /// The accessor `index`, which `place` refers to.
    pub fn parse(document: &'a Document, index: usize, place: &str) -> Result<Self, DocumentError> {
        let all = document.array("accessors")?;
        let Some(value) = all.get(index) else {
            let problem = Problem::Unresolved { kind: "accessor", index: index as u64, count: all.len() };
            return Err(DocumentError::new(place, problem));
        };
        let place = format!("accessors[{index}]");
        json::object(value, &place)?;
        let missing = |key| DocumentError::new(&place, Problem::Missing(key));
        let number = json::uint(value, "componentType", &place)?.ok_or_else(|| missing("componentType"))?;
        let component = component_type(number, &place)?;
        let kind = json::string(value, "type", &place)?.ok_or_else(|| missing("type"))?;
        let layout = Layout::new(component, kind)
            .ok_or_else(|| DocumentError::invalid(&place, format!("unknown type `{kind}`")))?;
        let count = json::uint(value, "count", &place)?.ok_or_else(|| missing("count"))?;
        let normalized = json::boolean(value, "normalized", &place)?.unwrap_or(false);
        let normalized = normalized && component != ComponentType::F32;
        Ok(Self { place, value, layout, normalized, count })
    }

    /// Does the accessor have any data, packed or sparse?
    pub fn has_data(&self) -> bool {
        self.value.get("bufferView").is_some() || self.value.get("sparse").is_some()
    }

    /// How the accessor is stored.
    pub fn format(&self) -> Format {
        Format { component: self.layout.component, normalized: self.normalized }
    }

    /// All elements as floats. `expected` is how many there must be, if the caller knows.
    pub fn numbers(&self, views: &Views<'_>, expected: Option<usize>) -> Result<Numbers, DocumentError> {
        if let Some(expected) = expected.filter(|&e| e as u64 != self.count) {
            let words = format!("has {} elements where {expected} are needed", self.count);
            return Err(DocumentError::invalid(&self.place, words));
        }
        let bytes = self.bytes(views, expected.is_some())?;
        let values = to_floats(&bytes, self.format());
        Ok(Numbers { components: self.layout.components(), format: self.format(), values })
    }

    /// All elements as vertex indices.
    pub fn indices(&self, views: &Views<'_>) -> Result<Vec<u32>, DocumentError> {
        use ComponentType::{U8, U16, U32};
        if self.layout.components() != 1 || !matches!(self.layout.component, U8 | U16 | U32) {
            return Err(DocumentError::invalid(&self.place, "indices must be unsigned integers of type `SCALAR`"));
        }
        let bytes = self.bytes(views, false)?;
        Ok(to_integers(&bytes, self.layout.component))
    }

    /// Are there bytes for every element? Reads none of them.
    pub fn verify(&self, views: &Views<'_>) -> Result<(), DocumentError> {
        match self.run(views)? {
            Some((view, run)) => run.stride_in(view, &self.place).map(|_| ()),
            None if self.count <= MOST_WITHOUT_DATA => Ok(()),
            None => {
                let words = format!("{} elements without data are too many", self.count);
                Err(DocumentError::invalid(&self.place, words))
            }
        }
    }

    /// The elements as they are stored, without padding between them, sparse values put in.
    pub(super) fn packed<'v>(&self, views: &'v Views<'_>) -> Result<Cow<'v, [u8]>, DocumentError> {
        self.bytes(views, false)
    }

    /// Where the packed elements stand, if there are any.
    fn run<'v>(&self, views: &'v Views<'_>) -> Result<Option<(View<'v>, Run)>, DocumentError> {
        let Some(view) = json::index(self.value, "bufferView", &self.place)? else { return Ok(None) };
        let offset = json::uint(self.value, "byteOffset", &self.place)?.unwrap_or(0);
        let view = views.get(view, &self.place)?;
        Ok(Some((view, Run { layout: self.layout, offset, count: self.count })))
    }

    /// Elements one after another without any padding, sparse values put in.
    fn bytes<'v>(&self, views: &'v Views<'_>, count_is_known: bool) -> Result<Cow<'v, [u8]>, DocumentError> {
        if !count_is_known {
            self.verify(views)?;
        }
        let mut bytes = if let Some((view, run)) = self.run(views)? {
            gather(view, run, &self.place)?
        } else {
            let size = self.layout.components() * self.layout.component.size();
            Cow::Owned(vec![0; self.count as usize * size])
        };
        if let Some(sparse) = json::child(self.value, "sparse", &self.place)? {
            self.put_sparse(sparse, views, bytes.to_mut())?;
        }
        Ok(bytes)
    }

    fn put_sparse(&self, sparse: &Value, views: &Views<'_>, bytes: &mut [u8]) -> Result<(), DocumentError> {
        let place = format!("{}.sparse", self.place);
        let count = json::uint(sparse, "count", &place)?
            .ok_or_else(|| DocumentError::new(&place, Problem::Missing("count")))?;
        if count > self.count {
            let words = format!("{count} values for {} elements", self.count);
            return Err(DocumentError::invalid(place, words));
        }
        let part = |key: &'static str| -> Result<(&Value, String), DocumentError> {
            let value = json::child(sparse, key, &place)?;
            let value = value.ok_or_else(|| DocumentError::new(&place, Problem::Missing(key)))?;
            Ok((value, format!("{place}.{key}")))
        };
        let (indices, indices_place) = part("indices")?;
        let number = json::uint(indices, "componentType", &indices_place)?.unwrap_or(0);
        let component = component_type(number, &indices_place)?;
        let layout = Layout { component, rows: 1, columns: 1 };
        let targets = sparse_part(indices, layout, count, views, &indices_place)?;
        let targets = to_integers(&targets, component);
        let (values, values_place) = part("values")?;
        let values = sparse_part(values, self.layout, count, views, &values_place)?;
        let size = self.layout.components() * self.layout.component.size();
        for (target, value) in targets.iter().zip(values.chunks_exact(size)) {
            let at = (*target as usize).saturating_mul(size);
            let element = at.checked_add(size).and_then(|end| bytes.get_mut(at..end)).ok_or_else(|| {
                let words = format!("element {target} does not exist (there are {})", self.count);
                DocumentError::invalid(&indices_place, words)
            })?;
            element.copy_from_slice(value);
        }
        Ok(())
    }
}

fn component_type(number: u64, place: &str) -> Result<ComponentType, DocumentError> {
    ComponentType::from_gltf(number)
        .ok_or_else(|| DocumentError::invalid(place, format!("unknown component type {number}")))
}

/// `sparse.indices` or `sparse.values`.
fn sparse_part<'v>(
    part: &Value,
    layout: Layout,
    count: u64,
    views: &'v Views<'_>,
    place: &str,
) -> Result<Cow<'v, [u8]>, DocumentError> {
    let view = json::index(part, "bufferView", place)?
        .ok_or_else(|| DocumentError::new(place, Problem::Missing("bufferView")))?;
    let offset = json::uint(part, "byteOffset", place)?.unwrap_or(0);
    // A stride has no meaning here: both parts are packed by the specification.
    let view = View { stride: None, ..views.get(view, place)? };
    gather(view, Run { layout, offset, count }, place)
}

/// A run of elements in a view.
#[derive(Clone, Copy)]
struct Run {
    layout: Layout,
    offset: u64,
    count: u64,
}

impl Run {
    /// Bytes from one element to the next, once it is sure that the view holds them all.
    fn stride_in(self, view: View<'_>, place: &str) -> Result<usize, DocumentError> {
        let Self { layout, offset, count } = self;
        let size = layout.size();
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            let words = format!("the view's `byteStride` {stride} is smaller than an element ({size} bytes)");
            return Err(DocumentError::invalid(place, words));
        }
        let span = (count.max(1) - 1).checked_mul(stride as u64);
        let needed = span.and_then(|n| n.checked_add(size as u64)?.checked_add(offset));
        let available = view.bytes.len() as u64;
        if count > 0 && needed.is_none_or(|n| n > available) {
            let (what, holder) = (format!("{count} elements from byte {offset}"), "its buffer view".to_owned());
            let problem = Problem::Short { what, holder, needed: needed.unwrap_or(u64::MAX), available };
            return Err(DocumentError::new(place, problem));
        }
        Ok(stride)
    }
}

/// The elements without gaps. Borrowed where they stand so already. All of them are within the view, so the copy is
/// never larger than the view.
fn gather<'v>(view: View<'v>, run: Run, place: &str) -> Result<Cow<'v, [u8]>, DocumentError> {
    let stride = run.stride_in(view, place)?;
    let Run { layout, offset, count } = run;
    if count == 0 {
        return Ok(Cow::Borrowed(&[]));
    }
    let size = layout.size();
    let bytes = &view.bytes[offset as usize..];
    let count = count as usize;
    if stride == size && layout.is_packed() {
        return Ok(Cow::Borrowed(&bytes[..count * size]));
    }
    let column = layout.rows * layout.component.size();
    let mut packed = Vec::with_capacity(count * column * layout.columns);
    for element in 0..count {
        for index in 0..layout.columns {
            let at = element * stride + index * layout.column_size();
            packed.extend_from_slice(&bytes[at..at + column]);
        }
    }
    Ok(Cow::Owned(packed))
}

/// Packed little-endian components to floats.
fn to_floats(bytes: &[u8], format: Format) -> Vec<f32> {
    use ComponentType::{F32, I8, I16, U8, U16, U32};
    match (format.component, format.normalized) {
        (F32, _) => floats(bytes),
        (I8, false) => bytes.iter().map(|&b| f32::from(b as i8)).collect(),
        (I8, true) => bytes.iter().map(|&b| (f32::from(b as i8) / 127.0).max(-1.0)).collect(),
        (U8, false) => bytes.iter().map(|&b| f32::from(b)).collect(),
        (U8, true) => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
        (I16, false) => words(bytes).map(|w| f32::from(i16::from_le_bytes(w))).collect(),
        (I16, true) => words(bytes).map(|w| (f32::from(i16::from_le_bytes(w)) / 32767.0).max(-1.0)).collect(),
        (U16, false) => words(bytes).map(|w| f32::from(u16::from_le_bytes(w))).collect(),
        (U16, true) => words(bytes).map(|w| f32::from(u16::from_le_bytes(w)) / 65535.0).collect(),
        (U32, false) => words(bytes).map(|w| u32::from_le_bytes(w) as f32).collect(),
        // In double precision: the divisor is no float.
        (U32, true) => words(bytes).map(|w| (f64::from(u32::from_le_bytes(w)) / f64::from(u32::MAX)) as f32).collect(),
    }
}

/// One copy on little-endian machines.
fn floats(bytes: &[u8]) -> Vec<f32> {
    let mut values = vec![0f32; bytes.len() / 4];
    let whole = values.len() * 4;
    bytemuck::cast_slice_mut::<f32, u8>(&mut values).copy_from_slice(&bytes[..whole]);
    if cfg!(target_endian = "big") {
        for value in &mut values {
            *value = f32::from_bits(value.to_bits().swap_bytes());
        }
    }
    values
}

fn to_integers(bytes: &[u8], component: ComponentType) -> Vec<u32> {
    match component {
        ComponentType::I8 | ComponentType::U8 => bytes.iter().map(|&b| u32::from(b)).collect(),
        ComponentType::I16 | ComponentType::U16 => words(bytes).map(|w| u32::from(u16::from_le_bytes(w))).collect(),
        ComponentType::U32 | ComponentType::F32 => words(bytes).map(u32::from_le_bytes).collect(),
    }
}

fn words<const SIZE: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; SIZE]> {
    bytes.as_chunks::<SIZE>().0.iter().copied()
}

#[cfg(test)]
#[expect(clippy::needless_pass_by_value, reason = "tests read better with `json!` in place")]
mod tests {
    use super::*;
    use crate::gltf::buffers::Buffers;
    use crate::gltf::document::Container;
    use serde_json::json;
    use std::path::Path;
    use std::sync::Arc;

    /// A document whose only buffer holds `bytes`, with one buffer view over all of them.
    fn scene(bytes: &[u8], view: &Value, accessor: &Value) -> (Document, Buffers) {
        let mut document = Document::new(Container::Glb, "test");
        document.json["buffers"] = json!([{ "byteLength": bytes.len() }]);
        document.json["bufferViews"] = json!([{ "buffer": 0, "byteLength": bytes.len() }, view]);
        document.json["accessors"] = json!([accessor]);
        document.bin = Some(Arc::from(bytes));
        let buffers = Buffers::load(&document, Path::new("")).unwrap();
        (document, buffers)
    }

    fn numbers(bytes: &[u8], view: Value, accessor: Value) -> Result<Vec<f32>, String> {
        let (document, buffers) = scene(bytes, &view, &accessor);
        let views = Views::new(&document, &buffers).unwrap();
        let numbers = Accessor::parse(&document, 0, "here").and_then(|a| a.numbers(&views, None));
        numbers.map(|n| n.values).map_err(|e| e.to_string())
    }

    fn accessor(component: u32, kind: &str, count: u64) -> Value {
        json!({ "bufferView": 0, "componentType": component, "type": kind, "count": count })
    }

    fn packed(bytes: &[u8], accessor: Value) -> Vec<f32> {
        numbers(bytes, json!({}), accessor).unwrap()
    }

    #[test]
    fn every_component_type() {
        let bytes = [0x00, 0x80, 0xFF, 0x7F];
        let with = |component, count, normalized| {
            let mut accessor = accessor(component, "SCALAR", count);
            accessor["normalized"] = json!(normalized);
            packed(&bytes, accessor)
        };
        assert_eq!(with(5120, 4, false), [0.0, -128.0, -1.0, 127.0]);
        assert_eq!(with(5120, 4, true), [0.0, -1.0, -1.0 / 127.0, 1.0]);
        assert_eq!(with(5121, 4, false), [0.0, 128.0, 255.0, 127.0]);
        assert_eq!(with(5121, 4, true), [0.0, 128.0 / 255.0, 1.0, 127.0 / 255.0]);
        assert_eq!(with(5122, 2, false), [-32768.0, 32767.0]);
        assert_eq!(with(5122, 2, true), [-1.0, 1.0]);
        assert_eq!(with(5123, 2, false), [32768.0, 32767.0]);
        assert_eq!(with(5123, 2, true), [32768.0 / 65535.0, 32767.0 / 65535.0]);
        assert_eq!(with(5125, 1, false), [2147450880.0]);
        assert_eq!(with(5125, 1, true), [0.5 - 32768.0 / 65536.0 / 65536.0]);
        assert_eq!(packed(&2.5f32.to_le_bytes(), accessor(5126, "SCALAR", 1)), [2.5]);
    }

    #[test]
    fn strides_offsets_and_odd_addresses() {
        let bytes: Vec<u8> = (0..24).collect();
        let mut second = accessor(5121, "VEC2", 3);
        second["bufferView"] = json!(1);
        second["byteOffset"] = json!(1);
        let view = json!({ "buffer": 0, "byteOffset": 3, "byteLength": 20, "byteStride": 8 });
        assert_eq!(numbers(&bytes, view.clone(), second.clone()).unwrap(), [4.0, 5.0, 12.0, 13.0, 20.0, 21.0]);
        second["count"] = json!(4);
        let words = numbers(&bytes, view, second.clone()).unwrap_err();
        assert_eq!(words, "accessors[0]: 4 elements from byte 1 needs 27 bytes, but its buffer view has 20");
        let narrow = json!({ "buffer": 0, "byteLength": 24, "byteStride": 1 });
        assert!(numbers(&bytes, narrow, second).unwrap_err().contains("`byteStride` 1 is smaller than an element (2"));
    }

    #[test]
    fn matrix_columns_are_padded() {
        let bytes: Vec<u8> = (0..24).collect();
        let small = packed(&bytes, accessor(5121, "MAT2", 3));
        assert_eq!(small, [0.0, 1.0, 4.0, 5.0, 8.0, 9.0, 12.0, 13.0, 16.0, 17.0, 20.0, 21.0]);
        assert_eq!(packed(&bytes, accessor(5121, "MAT3", 2))[9..], [12., 13., 14., 16., 17., 18., 20., 21., 22.]);
        assert_eq!(packed(&bytes, accessor(5123, "MAT3", 1)).len(), 9);
        assert_eq!(packed(&[0; 64], accessor(5126, "MAT4", 1)).len(), 16);
    }

    #[test]
    fn sparse_values_over_data_and_over_nothing() {
        let bytes = [10, 20, 30, 40, 3, 1, 7, 8];
        let sparse = json!({
            "count": 2,
            "indices": { "bufferView": 0, "byteOffset": 4, "componentType": 5121 },
            "values": { "bufferView": 0, "byteOffset": 6 },
        });
        let mut over = accessor(5121, "SCALAR", 4);
        over["sparse"] = sparse;
        assert_eq!(packed(&bytes, over.clone()), [10.0, 8.0, 30.0, 7.0]);
        over.as_object_mut().unwrap().remove("bufferView");
        assert_eq!(packed(&bytes, over.clone()), [0.0, 8.0, 0.0, 7.0]);
        over["count"] = json!(3);
        let words = numbers(&bytes, json!({}), over.clone()).unwrap_err();
        assert_eq!(words, "accessors[0].sparse.indices: element 3 does not exist (there are 3)");
        over["sparse"]["count"] = json!(4);
        assert!(numbers(&bytes, json!({}), over).unwrap_err().contains("4 values for 3 elements"));
    }

    #[test]
    fn lies_allocate_nothing() {
        for count in [13, 1_000_000_000_000, u64::MAX] {
            let words = numbers(&[0; 12], json!({}), accessor(5126, "SCALAR", count)).unwrap_err();
            assert!(words.starts_with(&format!("accessors[0]: {count} elements from byte 0 needs ")), "{words}");
            let bare = json!({ "componentType": 5121, "type": "SCALAR", "count": count.max(1 << 21) });
            assert!(numbers(&[0; 12], json!({}), bare).unwrap_err().ends_with("elements without data are too many"));
        }
        let mut far = accessor(5126, "SCALAR", 1);
        far["byteOffset"] = json!(u64::MAX);
        assert!(numbers(&[0; 12], json!({}), far).is_err());
    }

    #[test]
    fn nonsense_is_named() {
        let failure = |accessor: Value| numbers(&[0; 12], json!({}), accessor).unwrap_err();
        assert_eq!(failure(json!([])), "accessors[0]: expected an object, found an array");
        assert_eq!(failure(json!({})), "accessors[0]: `componentType` is missing");
        assert_eq!(failure(accessor(5124, "SCALAR", 1)), "accessors[0]: unknown component type 5124");
        assert_eq!(failure(accessor(5121, "VEC5", 1)), "accessors[0]: unknown type `VEC5`");
        let mut far = accessor(5121, "SCALAR", 1);
        far["bufferView"] = json!(9);
        assert_eq!(failure(far), "accessors[0]: buffer view 9 does not exist (there are 2)");
        let (document, buffers) = scene(&[0; 12], &json!({}), &accessor(5126, "SCALAR", 3));
        let views = Views::new(&document, &buffers).unwrap();
        let parsed = Accessor::parse(&document, 0, "here").unwrap();
        assert!(parsed.indices(&views).is_err());
        assert!(parsed.numbers(&views, Some(4)).is_err());
        assert!(
            Accessor::parse(&document, 1, "here").unwrap_err().to_string().starts_with("here: accessor 1 does not")
        );
    }

    #[test]
    fn indices_of_every_width() {
        for (component, expected) in [(5121, vec![1, 0, 2, 0]), (5123, vec![1, 2]), (5125, vec![131_073])] {
            let (document, buffers) =
                scene(&[1, 0, 2, 0], &json!({}), &accessor(component, "SCALAR", expected.len() as u64));
            let views = Views::new(&document, &buffers).unwrap();
            assert_eq!(Accessor::parse(&document, 0, "").unwrap().indices(&views).unwrap(), expected);
        }
    }
}
