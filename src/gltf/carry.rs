//! Which extensions of a mesh or primitive its levels may have too.
//!
//! An extension can refer to vertices or triangles by number; on other vertices or triangles it would say something
//! false. So only what is known to hold for a level goes there, and whatever stays behind is named in a note.

use super::instancing::MOVE_WITH_MESH;
use super::notes::Notes;
use serde_json::{Map, Value};

/// They name materials, attributes and textures, never single vertices or triangles.
const KNOWN_TO_HOLD: [&str; 4] =
    ["KHR_materials_variants", "EXT_mesh_features", "EXT_structural_metadata", "KHR_xmp_json_ld"];

/// They describe the source's own triangles, points or bytes; on a level they would be wrong.
const BOUND_TO_SOURCE: [&str; 7] = [
    "EXT_mesh_polygon",
    "EXT_mesh_primitive_edge_visibility",
    "EXT_mesh_primitive_restart",
    "CESIUM_primitive_outline",
    "FB_ngon_encoding",
    "KHR_gaussian_splatting",
    "PRIMITIVE_OUTLINE",
];

/// How the source's bytes are packed, not what they mean: a level has its own bytes and loses nothing.
const PACKING: &str = "KHR_draco_mesh_compression";

/// What a level has in common with its source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared {
    /// The vertices are the source's.
    pub(super) vertices: bool,
    /// The level has every custom attribute (`_NAME`) of the source.
    pub(super) custom_attributes: bool,
}

/// The entries of `extensions` that hold for a level. `place` is that of the object which has them.
pub(super) fn extensions(
    source: &Map<String, Value>,
    shared: Shared,
    place: &str,
    notes: &mut Notes,
) -> Map<String, Value> {
    let mut carried = Map::new();
    for (name, value) in source.iter().filter(|(name, _)| *name != PACKING) {
        let holds = KNOWN_TO_HOLD.contains(&name.as_str());
        if BOUND_TO_SOURCE.contains(&name.as_str()) {
            notes.add(place, format!("`{name}` belongs to the source's triangles and is not carried to levels"));
        } else if holds && !shared.vertices && !shared.custom_attributes && name != "KHR_materials_variants" {
            notes.add(place, format!("`{name}` is not carried to levels, which lack a custom attribute"));
        } else if name == "EXT_mesh_features" && !shared.vertices && numbers_vertices(value) {
            notes.add(place, format!("`{name}` numbers the source's vertices and is not carried to levels"));
        } else if holds {
            carried.insert(name.clone(), value.clone());
        } else if shared.vertices {
            notes.add(place, format!("`{name}` is not known and is carried unseen to levels with the same vertices"));
            carried.insert(name.clone(), value.clone());
        } else {
            notes.add(place, format!("`{name}` is not known and is not carried to levels"));
        }
    }
    carried
}

/// They act on the node as a whole, wherever its mesh is.
const KNOWN_TO_STAY: [&str; 9] = [
    "EXT_lights_ies",
    "KHR_lights_punctual",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_node_visibility",
    "KHR_physics_rigid_bodies",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "VRMC_node_constraint",
];

/// Notes extensions that stay on a node although they might mean the mesh that leaves it.
pub(super) fn note_staying(node: &Value, index: usize, notes: &mut Notes) {
    let extensions = node.get("extensions").and_then(Value::as_object);
    for name in extensions.into_iter().flat_map(Map::keys) {
        let known = KNOWN_TO_STAY.contains(&name.as_str()) || MOVE_WITH_MESH.contains(&name.as_str());
        if !known {
            let text = format!("`{name}` is not known and stays here; the mesh is on an added child now");
            notes.add(format_args!("nodes[{index}]"), text);
        }
    }
}

/// Feature ids that are neither in an attribute nor in a texture are the vertices' own numbers.
fn numbers_vertices(features: &Value) -> bool {
    let sets = features.get("featureIds").and_then(Value::as_array);
    sets.is_some_and(|sets| sets.iter().any(|set| set.get("attribute").is_none() && set.get("texture").is_none()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const OWN: Shared = Shared { vertices: false, custom_attributes: true };

    fn carried(source: &Value, shared: Shared) -> (Vec<String>, usize) {
        let mut notes = Notes::default();
        let kept = extensions(source.as_object().unwrap(), shared, "meshes[0]", &mut notes);
        (kept.keys().cloned().collect(), notes.into_vec().len())
    }

    #[test]
    fn own_vertices_get_only_what_is_known_to_hold() {
        let source = json!({ "KHR_materials_variants": {}, "FB_ngon_encoding": {}, "VENDOR_x": {} });
        assert_eq!(carried(&source, OWN), (vec!["KHR_materials_variants".to_owned()], 2));
    }

    #[test]
    fn shared_vertices_get_what_is_not_known_but_never_what_is_bound() {
        let source = json!({ "CESIUM_primitive_outline": {}, "VENDOR_x": {} });
        let shared = Shared { vertices: true, custom_attributes: true };
        assert_eq!(carried(&source, shared), (vec!["VENDOR_x".to_owned()], 2));
    }

    #[test]
    fn feature_ids_by_vertex_number_need_the_same_vertices() {
        let by_number = json!({ "EXT_mesh_features": { "featureIds": [{ "featureCount": 3 }] } });
        assert_eq!(carried(&by_number, OWN), (vec![], 1));
        assert_eq!(carried(&by_number, Shared { vertices: true, ..OWN }).0.len(), 1);
        let by_attribute = json!({ "EXT_mesh_features": { "featureIds": [{ "attribute": 0 }] } });
        assert_eq!(carried(&by_attribute, OWN).0.len(), 1);
        assert_eq!(carried(&by_attribute, Shared { custom_attributes: false, ..OWN }), (vec![], 1));
    }
}
