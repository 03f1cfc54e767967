//! `EXT_mesh_gpu_instancing` of the source: it moves with its mesh, every level draws the same instances, and the
//! whole batch switches levels at once.
//!
//! Knows how far a batch reaches and how large its instances are; writes no instances of its own.

use super::accessor::Accessor;
use super::buffers::Buffers;
use super::coverage::Extent;
use super::document::Document;
use super::encode::unit;
use super::error::DocumentError;
use super::json;
use super::views::Views;
use crate::mesh::ComponentType;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// The extension.
pub const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Extensions of a node that say something of its mesh or its instances and go where the mesh goes.
pub(super) const MOVE_WITH_MESH: [&str; 2] = [INSTANCING, "EXT_instance_features"];

/// How far the instances of one node reach, in the node's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Batch {
    /// Radius of the sphere round all instances' origins.
    pub spread: f64,
    /// Largest scale factor among them.
    pub scale: f64,
}

impl Batch {
    /// From the instances' translations and scales; a missing attribute is empty. `None` if there is no instance.
    pub fn new(translations: &[[f32; 3]], scales: &[[f32; 3]]) -> Option<Self> {
        if translations.is_empty() && scales.is_empty() {
            return None;
        }
        let points = || translations.iter().map(|t| t.map(f64::from));
        let mut centre = [0.0; 3];
        for (axis, middle) in centre.iter_mut().enumerate() {
            let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            let high = points().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
            *middle = if low <= high { f64::midpoint(low, high) } else { 0.0 };
        }
        let distance = |p: [f64; 3]| (0..3).map(|i| (p[i] - centre[i]) * (p[i] - centre[i])).sum::<f64>().sqrt();
        let spread = points().map(distance).fold(0.0, f64::max);
        let scale = scales.iter().flatten().map(|s| f64::from(s.abs())).fold(0.0, f64::max);
        let scale = if scales.is_empty() { 1.0 } else { scale };
        (spread.is_finite() && scale.is_finite()).then_some(Self { spread, scale })
    }

    /// What the batch is on the screen. `offset` is how far the mesh's centre lies from its origin: instances turn
    /// round their origins.
    pub(super) fn extent(&self, radius: f64, offset: f64) -> Extent {
        Extent { radius: self.spread + self.scale * (radius + offset), scale: self.scale, batch: true }
    }
}

/// Batches by node. A node that has the extension but no entry is treated like a single object.
pub type Batches = BTreeMap<usize, Batch>;

/// Reads the batches of a document: every node that has the extension and instances in it.
pub fn batches(document: &Document, buffers: &Buffers) -> Result<Batches, DocumentError> {
    let views = Views::new(document, buffers)?;
    let mut batches = Batches::new();
    for (i, node) in document.array("nodes")?.iter().enumerate() {
        let Some(extension) = json::extension(node, INSTANCING) else { continue };
        let place = format!("nodes[{i}].extensions.{INSTANCING}.attributes");
        let vectors = |name: &str| -> Result<Vec<[f32; 3]>, DocumentError> {
            let attributes = extension.get("attributes").unwrap_or(&Value::Null);
            let Some(accessor) = json::index(attributes, name, &place)? else { return Ok(Vec::new()) };
            let numbers = Accessor::parse(document, accessor, &place)?.numbers(&views, None)?;
            if numbers.components != 3 {
                return Err(DocumentError::invalid(&place, format!("`{name}` must be of type `VEC3`")));
            }
            Ok(numbers.values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
        };
        if let Some(batch) = Batch::new(&vectors("TRANSLATION")?, &vectors("SCALE")?) {
            batches.insert(i, batch);
        }
    }
    Ok(batches)
}

/// Takes the entries that go with the mesh out of a node's `extensions`, and the object itself when nothing is left.
pub(super) fn take_moving(node: &mut Map<String, Value>) -> Map<String, Value> {
    let mut moving = Map::new();
    let Some(extensions) = node.get_mut("extensions").and_then(Value::as_object_mut) else { return moving };
    for name in MOVE_WITH_MESH {
        if let Some(value) = extensions.shift_remove(name) {
            moving.insert(name.to_owned(), value);
        }
    }
    if extensions.is_empty() && !moving.is_empty() {
        node.shift_remove("extensions");
    }
    moving
}

/// Distance of the centre of a mesh's bounds from its origin, by the `min` and `max` of its positions.
pub(super) fn centre_offset(document: &Document, mesh: usize) -> f64 {
    let accessors = document.array("accessors").unwrap_or_default();
    let meshes = document.array("meshes").unwrap_or_default();
    let primitives = meshes.get(mesh).and_then(|m| m.get("primitives")).and_then(Value::as_array);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for primitive in primitives.into_iter().flatten() {
        let position = primitive.get("attributes").and_then(|a| a.get("POSITION")).and_then(json::integer);
        let Some(accessor) = position.and_then(|p| accessors.get(p as usize)) else { continue };
        let component = accessor.get("componentType").and_then(json::integer).and_then(ComponentType::from_gltf);
        // Bounds hold the stored integers, normalised or not.
        let normalized = accessor.get("normalized").and_then(Value::as_bool) == Some(true);
        let scale = component.filter(|_| normalized).map_or(1.0, unit);
        for axis in 0..3 {
            let bound = |key: &str| Some(accessor.get(key)?.get(axis)?.as_f64()? / scale);
            low[axis] = bound("min").unwrap_or(f64::INFINITY).min(low[axis]);
            high[axis] = bound("max").unwrap_or(f64::NEG_INFINITY).max(high[axis]);
        }
    }
    let middle = |i: usize| if low[i] <= high[i] { f64::midpoint(low[i], high[i]) } else { 0.0 };
    (0..3).map(|i| middle(i) * middle(i)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    #[test]
    fn a_batch_reaches_from_its_middle_to_its_farthest_instance() {
        let batch = Batch::new(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]], &[[1.0, 1.0, 1.0], [1.0, -3.0, 1.0]]).unwrap();
        assert_eq!(batch, Batch { spread: 5.0, scale: 3.0 });
        let extent = batch.extent(2.0, 1.0);
        assert_eq!((extent.radius, extent.scale), (5.0 + 3.0 * 3.0, 3.0));
        assert_eq!(Batch::new(&[[4.0, 0.0, 0.0]], &[]), Some(Batch { spread: 0.0, scale: 1.0 }));
        assert_eq!(Batch::new(&[], &[]), None);
        assert_eq!(Batch::new(&[[f32::NAN, 0.0, 0.0]], &[[f32::INFINITY; 3]]), None);
    }

    #[test]
    fn only_what_belongs_to_the_mesh_moves() {
        let mut node = json!({ "extensions": { "KHR_node_visibility": {}, INSTANCING: { "attributes": {} } } });
        let moving = take_moving(node.as_object_mut().unwrap());
        assert_eq!(moving.keys().collect::<Vec<_>>(), [INSTANCING]);
        assert_eq!(node, json!({ "extensions": { "KHR_node_visibility": {} } }));
        let mut alone = json!({ "extensions": { INSTANCING: {} } });
        take_moving(alone.as_object_mut().unwrap());
        assert_eq!(alone, json!({}));
        let mut empty = json!({ "extensions": {} });
        take_moving(empty.as_object_mut().unwrap());
        assert_eq!(empty, json!({ "extensions": {} }));
    }

    #[test]
    fn the_offset_of_a_mesh_is_that_of_its_bounds() {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["accessors"] = json!([{ "min": [2.0, -1.0, 0.0], "max": [4.0, 1.0, 8.0] }]);
        document.json["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": 0 } }] }, {}]);
        assert_eq!(centre_offset(&document, 0), 5.0);
        assert_eq!(centre_offset(&document, 1), 0.0);
        document.json["accessors"] =
            json!([{ "componentType": 5123, "normalized": true, "min": [0, 0, 0], "max": [65535, 0, 0] }]);
        assert_eq!(centre_offset(&document, 0), 0.5);
    }
}
