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
use super::similarity;
use super::views::Views;
use crate::mesh::ComponentType;
use glam::{DQuat, DVec3};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// The extension.
pub const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Extensions of a node that say something of its mesh or its instances and go where the mesh goes.
pub(super) const MOVE_WITH_MESH: [&str; 2] = [INSTANCING, "EXT_instance_features"];

/// How far the instances of one node reach, in the node's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Batch {
    /// Radius of the sphere round the middles of all instances.
    pub spread: f64,
    /// Largest scale factor among them.
    pub scale: f64,
}

impl Batch {
    /// From the middles of the instances and their scales; without scales all are 1. `None` if there is no instance.
    pub fn new(middles: &[DVec3], scales: &[[f32; 3]]) -> Option<Self> {
        let first = middles.first()?;
        let (low, high) = middles.iter().fold((*first, *first), |(low, high), p| (low.min(*p), high.max(*p)));
        let middle = (low + high) * 0.5;
        let spread = middles.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let scale = scales.iter().flatten().map(|s| f64::from(s.abs())).fold(0.0, f64::max);
        let scale = if scales.is_empty() { 1.0 } else { scale };
        let is_finite = middles.iter().all(|p| p.is_finite()) && scale.is_finite();
        is_finite.then_some(Self { spread, scale })
    }

    /// What the batch is on the screen.
    pub(super) fn extent(&self, radius: f64) -> Extent {
        Extent { radius: self.spread + self.scale * radius, scale: self.scale, batch: true }
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
        let vectors = |name: &str, kind: &str, components: usize| -> Result<Vec<f32>, DocumentError> {
            let attributes = extension.get("attributes").unwrap_or(&Value::Null);
            let Some(accessor) = json::index(attributes, name, &place)? else { return Ok(Vec::new()) };
            let numbers = Accessor::parse(document, accessor, &place)?.numbers(&views, None)?;
            if numbers.components != components {
                return Err(DocumentError::invalid(&place, format!("`{name}` must be of type `{kind}`")));
            }
            Ok(numbers.values)
        };
        let shifts = vectors("TRANSLATION", "VEC3", 3)?;
        let turns = vectors("ROTATION", "VEC4", 4)?;
        let scales = vectors("SCALE", "VEC3", 3)?;
        let scales: Vec<[f32; 3]> = scales.chunks_exact(3).map(|s| [s[0], s[1], s[2]]).collect();
        let mesh = json::index(node, "mesh", format_args!("nodes[{i}]"))?;
        let centre = mesh.map_or(DVec3::ZERO, |mesh| centre(document, mesh));
        // Where the attributes disagree, what all of them can serve is drawn.
        let counts = [shifts.len() / 3, turns.len() / 4, scales.len()];
        let count = counts.into_iter().filter(|&count| 0 < count).min().unwrap_or(0);
        let middle = |i: usize| {
            let wide = |values: &[f32], at: usize| f64::from(values[at]);
            let three = |values: &[f32], default: DVec3| match values.get(i * 3..i * 3 + 3) {
                Some(v) => DVec3::new(wide(v, 0), wide(v, 1), wide(v, 2)),
                None => default,
            };
            let scale = scales.get(i).map_or(DVec3::ONE, |s| DVec3::from_array(s.map(f64::from)));
            let turn = turns.get(i * 4..i * 4 + 4).map_or(DQuat::IDENTITY, |q| {
                similarity::rotation(DQuat::from_xyzw(wide(q, 0), wide(q, 1), wide(q, 2), wide(q, 3)))
            });
            three(&shifts, DVec3::ZERO) + turn * (scale * centre)
        };
        let middles: Vec<DVec3> = (0..count).map(middle).collect();
        if let Some(batch) = Batch::new(&middles, &scales) {
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

/// The centre of a mesh's bounds, by the `min` and `max` of its positions.
fn centre(document: &Document, mesh: usize) -> DVec3 {
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
    DVec3::new(middle(0), middle(1), middle(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    #[test]
    fn a_batch_reaches_from_its_middle_to_its_farthest_instance() {
        let batch = Batch::new(&[DVec3::ZERO, DVec3::X * 10.0], &[[1.0, 1.0, 1.0], [1.0, -3.0, 1.0]]).unwrap();
        assert_eq!(batch, Batch { spread: 5.0, scale: 3.0 });
        let extent = batch.extent(2.0);
        assert_eq!((extent.radius, extent.scale), (5.0 + 3.0 * 2.0, 3.0));
        assert_eq!(Batch::new(&[DVec3::X * 4.0], &[]), Some(Batch { spread: 0.0, scale: 1.0 }));
        assert_eq!(Batch::new(&[], &[]), None);
        assert_eq!(Batch::new(&[DVec3::NAN], &[[f32::INFINITY; 3]]), None);
        assert_eq!(Batch::new(&[DVec3::NAN, DVec3::ONE], &[]), None);
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
    fn the_centre_of_a_mesh_is_that_of_its_bounds() {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["accessors"] = json!([{ "min": [2.0, -1.0, 0.0], "max": [4.0, 1.0, 8.0] }]);
        document.json["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": 0 } }] }, {}]);
        assert_eq!(centre(&document, 0), DVec3::new(3.0, 0.0, 4.0));
        assert_eq!(centre(&document, 1), DVec3::ZERO);
        document.json["accessors"] =
            json!([{ "componentType": 5123, "normalized": true, "min": [0, 0, 0], "max": [65535, 0, 0] }]);
        assert_eq!(centre(&document, 0), DVec3::X * 0.5);
    }
}
