//! Do the parts of a document refer to parts that exist, and are its nodes a forest?
//!
//! Later stages walk the document without looking back; whatever they rely on is checked here once. Looks at JSON
//! only, at no bytes.

use super::decode::draco;
use super::document::Document;
use super::error::{DocumentError, Problem};
use super::json;
use serde_json::Value;

/// The root's arrays that hold objects, and what one entry is called.
const ARRAYS: [(&str, &str); 14] = [
    ("accessors", "accessor"),
    ("animations", "animation"),
    ("bufferViews", "buffer view"),
    ("buffers", "buffer"),
    ("cameras", "camera"),
    ("images", "image"),
    ("materials", "material"),
    ("meshes", "mesh"),
    ("nodes", "node"),
    ("samplers", "sampler"),
    ("scenes", "scene"),
    ("skins", "skin"),
    ("textures", "texture"),
    ("extensionsUsed", "extension"),
];

/// Checks all references and the node hierarchy.
pub fn check(document: &Document) -> Result<(), DocumentError> {
    let check = Check { document };
    for (name, _) in &ARRAYS[..13] {
        for (i, entry) in document.array(name)?.iter().enumerate() {
            json::object(entry, format_args!("{name}[{i}]"))?;
        }
    }
    check.names("extensionsUsed")?;
    check.names("extensionsRequired")?;
    check.reference(&document.json, "scene", "scenes", "")?;
    check.each("scenes", |scene, place| check.list(scene, "nodes", "nodes", place))?;
    check.each("nodes", |node, place| check.node(node, place))?;
    check.each("meshes", |mesh, place| check.mesh(mesh, place))?;
    check.each("materials", |material, place| check.textures(material, place))?;
    check.each("textures", |texture, place| {
        check.reference(texture, "source", "images", place)?;
        check.reference(texture, "sampler", "samplers", place)
    })?;
    check.each("images", |image, place| check.reference(image, "bufferView", "bufferViews", place))?;
    check.each("skins", |skin, place| {
        check.list(skin, "joints", "nodes", place)?;
        check.reference(skin, "skeleton", "nodes", place)?;
        check.reference(skin, "inverseBindMatrices", "accessors", place)
    })?;
    check.each("accessors", |accessor, place| check.accessor(accessor, place))?;
    check.each("bufferViews", |view, place| check.reference(view, "buffer", "buffers", place))?;
    check.each("animations", |animation, place| check.animation(animation, place))?;
    check.forest()
}

struct Check<'a> {
    document: &'a Document,
}

impl<'a> Check<'a> {
    fn each(
        &self,
        array: &str,
        visit: impl Fn(&'a Value, &str) -> Result<(), DocumentError>,
    ) -> Result<(), DocumentError> {
        let entries = self.document.array(array)?.iter().enumerate();
        entries.into_iter().try_for_each(|(i, entry)| visit(entry, &format!("{array}[{i}]")))
    }

    fn names(&self, list: &str) -> Result<(), DocumentError> {
        for (i, name) in self.document.array(list)?.iter().enumerate() {
            if !name.is_string() {
                let problem = Problem::Type { expected: "a string", found: json::type_name(name) };
                return Err(DocumentError::new(format_args!("{list}[{i}]"), problem));
            }
        }
        Ok(())
    }

    /// `value[key]`, if there, is an index into the root's `array`.
    fn reference(&self, value: &Value, key: &str, array: &str, place: &str) -> Result<(), DocumentError> {
        let Some(index) = json::index(value, key, place)? else { return Ok(()) };
        let dot = if place.is_empty() { "" } else { "." };
        self.resolve(index, array, || format!("{place}{dot}{key}"))
    }

    fn resolve(&self, index: usize, array: &str, place: impl Fn() -> String) -> Result<(), DocumentError> {
        let count = self.document.array(array)?.len();
        if index < count {
            return Ok(());
        }
        let kind = ARRAYS.iter().find(|(name, _)| *name == array).map_or("entry", |(_, kind)| kind);
        Err(DocumentError::new(place(), Problem::Unresolved { kind, index: index as u64, count }))
    }

    /// `value[key]`, if there, is a list of indices into the root's `array`.
    fn list(&self, value: &Value, key: &str, array: &str, place: &str) -> Result<(), DocumentError> {
        for (i, entry) in json::array(value, key, place)?.iter().enumerate() {
            let index = json::integer(entry).and_then(|n| usize::try_from(n).ok()).ok_or_else(|| {
                let problem = Problem::Type { expected: "an index", found: json::type_name(entry) };
                DocumentError::new(format_args!("{place}.{key}[{i}]"), problem)
            })?;
            self.resolve(index, array, || format!("{place}.{key}[{i}]"))?;
        }
        Ok(())
    }

    /// Every value of the object `value[key]` is an accessor.
    fn accessors(&self, value: &Value, key: &str, place: &str) -> Result<(), DocumentError> {
        let Some(object) = json::child(value, key, place)? else { return Ok(()) };
        let place = format!("{place}.{key}");
        let names = json::object(object, &place)?.keys();
        names.into_iter().try_for_each(|name| self.reference(object, name, "accessors", &place))
    }

    fn node(&self, node: &Value, place: &str) -> Result<(), DocumentError> {
        for (key, array) in [("mesh", "meshes"), ("skin", "skins"), ("camera", "cameras")] {
            self.reference(node, key, array, place)?;
        }
        self.list(node, "children", "nodes", place)?;
        let extension = "EXT_mesh_gpu_instancing";
        json::extension(node, extension).map_or(Ok(()), |instancing| {
            self.accessors(instancing, "attributes", &format!("{place}.extensions.{extension}"))
        })
    }

    fn mesh(&self, mesh: &Value, place: &str) -> Result<(), DocumentError> {
        for (i, primitive) in json::array(mesh, "primitives", place)?.iter().enumerate() {
            let place = format!("{place}.primitives[{i}]");
            json::object(primitive, &place)?;
            self.reference(primitive, "material", "materials", &place)?;
            self.reference(primitive, "indices", "accessors", &place)?;
            self.accessors(primitive, "attributes", &place)?;
            for (j, target) in json::array(primitive, "targets", &place)?.iter().enumerate() {
                let place = format!("{place}.targets[{j}]");
                let names = json::object(target, &place)?.keys();
                names.into_iter().try_for_each(|name| self.reference(target, name, "accessors", &place))?;
            }
            if let Some(compressed) = json::extension(primitive, draco::EXTENSION) {
                let place = format!("{place}.extensions.{}", draco::EXTENSION);
                self.reference(compressed, "bufferView", "bufferViews", &place)?;
            }
        }
        Ok(())
    }

    fn accessor(&self, accessor: &Value, place: &str) -> Result<(), DocumentError> {
        self.reference(accessor, "bufferView", "bufferViews", place)?;
        let Some(sparse) = json::child(accessor, "sparse", place)? else { return Ok(()) };
        for key in ["indices", "values"] {
            let place = format!("{place}.sparse");
            if let Some(part) = json::child(sparse, key, &place)? {
                self.reference(part, "bufferView", "bufferViews", &format!("{place}.{key}"))?;
            }
        }
        Ok(())
    }

    /// All texture references of a material, also those of the Khronos material extensions: objects under a key that
    /// ends in `Texture`. The parser bounds the depth.
    fn textures(&self, value: &Value, place: &str) -> Result<(), DocumentError> {
        let Some(entries) = value.as_object() else { return Ok(()) };
        for (key, entry) in entries {
            let known = key != "extras" && (!place.ends_with(".extensions") || key.starts_with("KHR_materials_"));
            if !known || !entry.is_object() {
                continue;
            }
            let place = format!("{place}.{key}");
            if key.ends_with("Texture") {
                self.reference(entry, "index", "textures", &place)?;
            }
            self.textures(entry, &place)?;
        }
        Ok(())
    }

    fn animation(&self, animation: &Value, place: &str) -> Result<(), DocumentError> {
        let samplers = json::array(animation, "samplers", place)?;
        for (i, sampler) in samplers.iter().enumerate() {
            let place = format!("{place}.samplers[{i}]");
            json::object(sampler, &place)?;
            self.reference(sampler, "input", "accessors", &place)?;
            self.reference(sampler, "output", "accessors", &place)?;
        }
        for (i, channel) in json::array(animation, "channels", place)?.iter().enumerate() {
            let place = format!("{place}.channels[{i}]");
            json::object(channel, &place)?;
            if let Some(index) = json::index(channel, "sampler", &place)?.filter(|&s| s >= samplers.len()) {
                let problem =
                    Problem::Unresolved { kind: "animation sampler", index: index as u64, count: samplers.len() };
                return Err(DocumentError::new(format_args!("{place}.sampler"), problem));
            }
            if let Some(target) = json::child(channel, "target", &place)? {
                self.reference(target, "node", "nodes", &format!("{place}.target"))?;
            }
        }
        Ok(())
    }

    /// Every node has at most one parent, and none is its own ancestor.
    fn forest(&self) -> Result<(), DocumentError> {
        let nodes = self.document.array("nodes")?;
        let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
        for (parent, node) in nodes.iter().enumerate() {
            let place = format!("nodes[{parent}]");
            for (i, child) in json::array(node, "children", &place)?.iter().enumerate() {
                let child = json::integer(child).unwrap_or(0) as usize;
                if let Some(other) = parents[child] {
                    let words = format!("node {child} already has a parent, node {other}");
                    return Err(DocumentError::invalid(format_args!("{place}.children[{i}]"), words));
                }
                parents[child] = Some(parent);
            }
        }
        // Walk up from every node until a node that an earlier walk has passed: each node is passed once.
        let mut walks = vec![usize::MAX; nodes.len()];
        for start in 0..nodes.len() {
            let mut at = Some(start);
            while let Some(node) = at.filter(|&n| walks[n] == usize::MAX) {
                walks[node] = start;
                at = parents[node];
            }
            if let Some(node) = at.filter(|&n| walks[n] == start) {
                let words = "the node is its own ancestor";
                return Err(DocumentError::invalid(format_args!("nodes[{node}]"), words));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[expect(clippy::needless_pass_by_value, reason = "tests read better with `json!` in place")]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    fn failure(parts: Value) -> String {
        let mut document = Document::new(Container::Gltf, "test");
        for (key, value) in parts.as_object().unwrap() {
            document.json[key] = value.clone();
        }
        check(&document).map_or_else(|e| e.to_string(), |()| "fine".to_owned())
    }

    #[test]
    fn forests_are_fine_and_nothing_else_is() {
        assert_eq!(failure(json!({ "nodes": [{ "children": [1, 2.0] }, {}, { "children": [3] }, {}] })), "fine");
        let shared = failure(json!({ "nodes": [{ "children": [2] }, { "children": [2] }, {}] }));
        assert_eq!(shared, "nodes[1].children[0]: node 2 already has a parent, node 0");
        let twice = failure(json!({ "nodes": [{ "children": [1, 1] }, {}] }));
        assert_eq!(twice, "nodes[0].children[1]: node 1 already has a parent, node 0");
        let circle = failure(json!({ "nodes": [{ "children": [1] }, { "children": [2] }, { "children": [0] }] }));
        assert_eq!(circle, "nodes[0]: the node is its own ancestor");
        let own = failure(json!({ "nodes": [{}, { "children": [1] }] }));
        assert_eq!(own, "nodes[1]: the node is its own ancestor");
        let missing = failure(json!({ "nodes": [{ "children": [4] }] }));
        assert_eq!(missing, "nodes[0].children[0]: node 4 does not exist (there are 1)");
    }

    #[test]
    fn long_chains_take_linear_time() {
        let nodes: Vec<Value> = (1..=200_000).map(|i| json!({ "children": [i] })).chain([json!({})]).collect();
        assert_eq!(failure(json!({ "nodes": nodes })), "fine");
    }

    #[test]
    fn unresolved_references_are_named() {
        let cases = [
            (json!({ "scene": 0 }), "scene: scene 0 does not exist (there are 0)"),
            (json!({ "scenes": [{ "nodes": [1] }], "nodes": [{}] }), "scenes[0].nodes[0]: node 1 does not exist"),
            (json!({ "nodes": [{ "mesh": 3 }] }), "nodes[0].mesh: mesh 3 does not exist"),
            (json!({ "nodes": [{ "skin": 0 }] }), "nodes[0].skin: skin 0 does not exist"),
            (json!({ "nodes": ["a"] }), "nodes[0]: expected an object, found a string"),
            (json!({ "nodes": {} }), "nodes: expected an array, found an object"),
            (
                json!({ "meshes": [{ "primitives": [{ "attributes": { "NORMAL": 2 } }] }] }),
                "meshes[0].primitives[0].attributes.NORMAL: accessor 2 does not exist",
            ),
            (
                json!({ "meshes": [{ "primitives": [{ "material": 2 }] }] }),
                "meshes[0].primitives[0].material: material 2 does not exist",
            ),
            (
                json!({ "meshes": [{ "primitives": [{ "targets": [{ "POSITION": 0 }] }] }] }),
                "meshes[0].primitives[0].targets[0].POSITION: accessor 0 does not exist",
            ),
            (
                json!({ "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } } }] }),
                "materials[0].pbrMetallicRoughness.baseColorTexture.index: texture 1 does not exist",
            ),
            (
                json!({ "materials": [{ "extensions": { "KHR_materials_sheen": { "sheenColorTexture": { "index": 1 } } } }] }),
                "materials[0].extensions.KHR_materials_sheen.sheenColorTexture.index: texture 1 does not exist",
            ),
            (json!({ "skins": [{ "joints": [true] }] }), "skins[0].joints[0]: expected an index, found a boolean"),
            (
                json!({ "animations": [{ "channels": [{ "sampler": 0 }] }] }),
                "animations[0].channels[0].sampler: animation sampler 0 does not exist",
            ),
            (json!({ "accessors": [{ "bufferView": 0 }] }), "accessors[0].bufferView: buffer view 0 does not exist"),
            (json!({ "bufferViews": [{ "buffer": 0 }] }), "bufferViews[0].buffer: buffer 0 does not exist"),
            (json!({ "extensionsUsed": [7] }), "extensionsUsed[0]: expected a string, found a number"),
        ];
        for (parts, words) in cases {
            let found = failure(parts);
            assert!(found.starts_with(words), "{found} <> {words}");
        }
        let unknown = json!({ "materials": [{ "extensions": { "VENDOR_x": { "aTexture": { "index": 1 } } } }] });
        assert_eq!(failure(unknown), "fine");
    }
}
