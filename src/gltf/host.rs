//! Which buffer of a `.gltf` must hold the levels too.
//!
//! Babylon.js asks for a buffer where it first meets it. Inside a finer level that is put off until all else has arrived;
//! so, if an animation, a skin, an image, the instances of a batch or a mesh without levels needs the same buffer, each waits for
//! the other and the scene never loads. The cure: levels behind the source's bytes in that buffer, which the coarsest level asks for at once. (In a
//! GLB all bytes are in one chunk, and nothing waits.) Knows nothing of bytes.

use super::document::{Container, Document};
use super::error::DocumentError;
use super::instancing::INSTANCING;
use super::json;
use serde_json::Value;
use std::collections::BTreeSet;

/// The buffer, if one is met first by level 0 of `anchors` (nodes that get levels) and needed by others, too. Of several
/// the first.
pub(super) fn find(document: &Document, anchors: &BTreeSet<usize>) -> Result<Option<usize>, DocumentError> {
    if document.container != Container::Gltf {
        return Ok(None);
    }
    let finder = Finder {
        accessors: document.array("accessors")?,
        views: document.array("bufferViews")?,
        meshes: document.array("meshes")?,
        skins: document.array("skins")?,
    };
    let nodes = document.array("nodes")?;
    let (mut put_off, mut needed) = (BTreeSet::new(), BTreeSet::new());
    for (i, node) in nodes.iter().enumerate() {
        let meshes = index(node, "mesh").and_then(|mesh| finder.meshes.get(mesh));
        let skin = index(node, "skin").and_then(|skin| finder.skins.get(skin));
        let mut of_mesh = meshes.map_or_else(BTreeSet::new, |mesh| finder.mesh(mesh));
        // The coarsest level of a batch asks for its instances at once: that is too late only if another group put it off.
        let of_batch = finder.batch(node);
        of_mesh.retain(|buffer| !of_batch.contains(buffer));
        needed.extend(of_batch);
        let list = if anchors.contains(&i) { &mut put_off } else { &mut needed };
        list.extend(of_mesh);
        needed.extend(skin.and_then(|skin| finder.accessor(index(skin, "inverseBindMatrices"))));
    }
    for animation in document.array("animations")? {
        for sampler in animation.get("samplers").and_then(Value::as_array).into_iter().flatten() {
            needed.extend(["input", "output"].iter().filter_map(|key| finder.accessor(index(sampler, key))));
        }
    }
    for image in document.array("images")? {
        let view = index(image, "bufferView").and_then(|view| finder.views.get(view));
        needed.extend(view.and_then(|view| index(view, "buffer")));
    }
    let buffers = document.array("buffers")?.len();
    Ok(put_off.intersection(&needed).copied().find(|buffer| *buffer < buffers))
}

fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key).and_then(json::integer).map(|index| index as usize)
}

struct Finder<'d> {
    accessors: &'d [Value],
    views: &'d [Value],
    meshes: &'d [Value],
    skins: &'d [Value],
}

impl Finder<'_> {
    /// The buffer of an accessor's own view.
    fn accessor(&self, accessor: Option<usize>) -> Option<usize> {
        let view = self.views.get(index(self.accessors.get(accessor?)?, "bufferView")?)?;
        let packed = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
        let packed = packed.iter().find_map(|name| json::extension(view, name));
        index(packed.unwrap_or(view), "buffer")
    }

    /// The buffers of a node's instances.
    fn batch(&self, node: &Value) -> BTreeSet<usize> {
        let attributes = json::extension(node, INSTANCING).and_then(|batch| batch.get("attributes")?.as_object());
        let accessors = attributes.into_iter().flatten().filter_map(|(_, accessor)| json::integer(accessor));
        accessors.filter_map(|accessor| self.accessor(Some(accessor as usize))).collect()
    }

    /// All buffers of a mesh.
    fn mesh(&self, mesh: &Value) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        for primitive in mesh.get("primitives").and_then(Value::as_array).into_iter().flatten() {
            found.extend(self.accessor(index(primitive, "indices")));
            let targets = primitive.get("targets").and_then(Value::as_array).into_iter().flatten();
            for attributes in primitive.get("attributes").into_iter().chain(targets) {
                let names = attributes.as_object().into_iter().flat_map(|object| object.keys());
                found.extend(names.filter_map(|name| self.accessor(index(attributes, name))));
            }
            // Compressed: the buffer of the packed bytes.
            let packed = json::extension(primitive, "KHR_draco_mesh_compression");
            let view = packed.and_then(|packed| self.views.get(index(packed, "bufferView")?));
            found.extend(view.and_then(|view| index(view, "buffer")));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Two nodes with a mesh each in buffers 0 and 1, an animation in buffer 2.
    fn document() -> Document {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["buffers"] = json!([{ "uri": "a.bin" }, { "uri": "b.bin" }, { "uri": "c.bin" }]);
        document.json["bufferViews"] = json!([{ "buffer": 0 }, { "buffer": 1 }, { "buffer": 2 }]);
        document.json["accessors"] = json!([{ "bufferView": 0 }, { "bufferView": 1 }, { "bufferView": 2 }]);
        document.json["meshes"] = json!([
            { "primitives": [{ "attributes": { "POSITION": 0 } }] },
            { "primitives": [{ "attributes": { "POSITION": 1 } }] },
        ]);
        document.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 1 }]);
        document.json["animations"] = json!([{ "samplers": [{ "input": 2, "output": 2 }] }]);
        document
    }

    fn host(document: &Document, anchors: &[usize]) -> Option<usize> {
        find(document, &anchors.iter().copied().collect()).unwrap()
    }

    #[test]
    fn buffers_of_their_own_stay_apart() {
        assert_eq!(host(&document(), &[0, 1]), None);
    }

    #[test]
    fn a_buffer_that_others_need_holds_the_levels() {
        let mut shared = document();
        shared.json["bufferViews"][1]["buffer"] = json!(0);
        assert_eq!(host(&shared, &[0]), Some(0), "node 1 has no levels");
        assert_eq!(host(&shared, &[0, 1]), None);
        let mut animated = document();
        animated.json["bufferViews"][2]["buffer"] = json!(1);
        assert_eq!(host(&animated, &[0, 1]), Some(1));
        animated.container = Container::Glb;
        assert_eq!(host(&animated, &[0, 1]), None);
    }

    #[test]
    fn instances_need_their_buffer_with_the_coarsest_level() {
        let mut batches = document();
        batches.json["bufferViews"][1]["buffer"] = json!(0);
        batches.json["nodes"][1]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "SCALE": 1 } } });
        assert_eq!(host(&batches, &[0, 1]), Some(0), "level 0 of node 0 comes first and puts it off");
        batches.json["nodes"][0]["extensions"] = batches.json["nodes"][1]["extensions"].clone();
        assert_eq!(host(&batches, &[0, 1]), None, "both ask for it at once");
    }

    #[test]
    fn skins_and_images_need_their_buffers_too() {
        let mut skinned = document();
        skinned.json["skins"] = json!([{ "joints": [0], "inverseBindMatrices": 1 }]);
        assert_eq!(host(&skinned, &[0, 1]), None, "no node has the skin");
        skinned.json["nodes"][0]["skin"] = json!(0);
        assert_eq!(host(&skinned, &[0, 1]), Some(1));
        let mut painted = document();
        painted.json["images"] = json!([{ "bufferView": 0 }]);
        assert_eq!(host(&painted, &[0, 1]), Some(0));
    }
}
