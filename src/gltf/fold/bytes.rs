//! The numbers of batches: translations, rotations and scales as plain floats, each accessor with a buffer view of its own.
//!
//! What is the same is written once: two meshes on the same nodes share their accessors, and columns of which every element is
//! the same (unit scales) are the beginning of the longest of them. Bytes go behind those of the first buffer that has any.

use super::cells::Cell;
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use glam::DVec3;
use serde_json::json;
use std::collections::BTreeMap;

/// Bytes of a float.
const FLOAT: usize = 4;

/// The elements of one accessor.
struct Column {
    components: usize,
    count: usize,
    /// Without repetition where every element is the same.
    bytes: Vec<u8>,
}

impl Column {
    fn new<const N: usize>(elements: impl Iterator<Item = [f32; N]>) -> Self {
        let elements: Vec<[f32; N]> = elements.collect();
        // −0 and 0 are different bits, and stay so.
        let bits = |e: &[f32; N]| e.map(f32::to_bits);
        let is_constant = elements.windows(2).all(|w| bits(&w[0]) == bits(&w[1]));
        let kept = if is_constant { &elements[..elements.len().min(1)] } else { &elements[..] };
        let bytes = kept.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        Self { components: N, count: elements.len(), bytes }
    }

    fn length(&self) -> usize {
        self.count * self.components * FLOAT
    }

    fn is_constant(&self) -> bool {
        self.bytes.len() < self.length()
    }
}

/// Appends the numbers of all cells; answers their accessors: translation, rotation, scale.
pub(super) fn write<'a>(
    document: &mut Document,
    buffers: &mut Buffers,
    cells: impl Iterator<Item = &'a Cell>,
) -> Result<Vec<[usize; 3]>, DocumentError> {
    let columns: Vec<[Column; 3]> = cells.map(columns).collect();
    let mut longest: BTreeMap<&[u8], usize> = BTreeMap::new();
    for column in columns.iter().flatten().filter(|column| column.is_constant()) {
        let known = longest.entry(&column.bytes).or_insert(0);
        *known = column.length().max(*known);
    }
    let buffer = (0..buffers.len()).find(|&i| buffers.bytes(i).is_some()).unwrap_or(0);
    let start = buffers.bytes(buffer).map_or(0, <[u8]>::len).next_multiple_of(FLOAT);
    let mut data: Vec<u8> = Vec::new();
    let mut places: BTreeMap<&[u8], usize> = BTreeMap::new();
    let mut known: BTreeMap<(usize, usize, usize), usize> = BTreeMap::new();
    let mut accessors = Vec::with_capacity(columns.len());
    for cell in &columns {
        let mut three = [0; 3];
        for (slot, column) in three.iter_mut().zip(cell) {
            let place = *places.entry(&column.bytes).or_insert_with(|| {
                let place = data.len();
                let length = if column.is_constant() { longest[column.bytes.as_slice()] } else { column.length() };
                data.extend(column.bytes.iter().cycle().take(length));
                place
            });
            let (offset, length) = (start + place, column.length());
            *slot = if let Some(&accessor) = known.get(&(place, length, column.components)) {
                accessor
            } else {
                let view = json!({ "buffer": buffer, "byteOffset": offset, "byteLength": length });
                let view = document.push("bufferViews", view)?;
                let kind = if column.components == 4 { "VEC4" } else { "VEC3" };
                let entry = json!({ "bufferView": view, "componentType": 5126, "count": column.count, "type": kind });
                document.push("accessors", entry)?
            };
            known.insert((place, length, column.components), *slot);
        }
        accessors.push(three);
    }
    let mut bytes = buffers.bytes(buffer).unwrap_or_default().to_vec();
    bytes.resize(start, 0);
    bytes.append(&mut data);
    buffers.rewrite(document, buffer, bytes)?;
    Ok(accessors)
}

fn columns(cell: &Cell) -> [Column; 3] {
    let middle = DVec3::from_array(cell.middle.map(f64::from));
    let all = || cell.instances.iter();
    [
        Column::new(all().map(|i| (i.translation - middle).to_array().map(|v| v as f32))),
        Column::new(all().map(|i| i.rotation)),
        Column::new(all().map(|i| i.scale)),
    ]
}
