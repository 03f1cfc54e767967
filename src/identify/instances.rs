//! How often each mesh of a document is drawn. Knows nodes, not transforms.

use crate::gltf::document::{Document, DocumentError};
use crate::gltf::json;
use serde_json::Value;

/// How often a mesh is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshUse {
    /// Nodes that carry it, whether or not a scene shows them.
    pub nodes: usize,
    /// How often these nodes draw it: a node with `EXT_mesh_gpu_instancing` draws once per instance.
    pub instances: u64,
}

/// One for each entry of `meshes`.
pub fn mesh_uses(document: &Document) -> Result<Vec<MeshUse>, DocumentError> {
    let mut uses = vec![MeshUse::default(); document.array("meshes")?.len()];
    let accessors = document.array("accessors")?;
    for (i, node) in document.array("nodes")?.iter().enumerate() {
        let Some(mesh) = json::index(node, "mesh", format_args!("nodes[{i}]"))? else { continue };
        if let Some(used) = uses.get_mut(mesh) {
            used.nodes += 1;
            used.instances = used.instances.saturating_add(instance_count(node, accessors).unwrap_or(1));
        }
    }
    Ok(uses)
}

/// The extension's attributes must agree; where they do not, what all of them can serve is drawn.
fn instance_count(node: &Value, accessors: &[Value]) -> Option<u64> {
    let attributes = json::extension(node, "EXT_mesh_gpu_instancing")?.get("attributes")?.as_object()?;
    let counts = attributes.values().filter_map(|index| {
        let accessor = accessors.get(usize::try_from(json::integer(index)?).ok()?)?;
        json::integer(accessor.get("count")?)
    });
    counts.min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    #[test]
    fn nodes_and_instances_are_counted() {
        let instanced = |attributes: Value| json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
        let mut document = Document::new(Container::Gltf, "test");
        document.json["meshes"] = json!([{}, {}, {}]);
        document.json["accessors"] = json!([{ "count": 40 }, { "count": 41 }]);
        document.json["nodes"] = json!([
            { "mesh": 0 },
            { "mesh": 0, "extensions": instanced(json!({ "TRANSLATION": 0, "_ID": 1 })) },
            { "mesh": 2, "extensions": instanced(json!({})) },
            {},
        ]);
        let expected = [(2, 41), (0, 0), (1, 1)].map(|(nodes, instances)| MeshUse { nodes, instances });
        assert_eq!(mesh_uses(&document).unwrap(), expected);
    }
}
