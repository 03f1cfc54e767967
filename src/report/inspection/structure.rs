//! What a glTF document consists of, by its JSON alone.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::gltf::document::{Container, Document};
use crate::gltf::json;

/// Counts of everything a document declares.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Structure {
    /// `glb` or `gltf`.
    pub container: String,
    /// The program that wrote it, as it says itself.
    pub generator: Option<String>,
    /// Scenes.
    pub scenes: u64,
    /// Nodes.
    pub nodes: u64,
    /// Nodes with a mesh.
    pub mesh_nodes: u64,
    /// Meshes.
    pub meshes: u64,
    /// Primitives by what they draw: `points`, `lines`, `triangles`, `triangle strips`, …
    pub primitives: BTreeMap<String, u64>,
    /// Vertex attributes by name, with the number of primitives that have them.
    pub attributes: BTreeMap<String, u64>,
    /// Primitives with morph targets.
    pub morphed_primitives: u64,
    /// Materials.
    pub materials: u64,
    /// Textures.
    pub textures: u64,
    /// Images.
    pub images: u64,
    /// Skins.
    pub skins: u64,
    /// Animations.
    pub animations: u64,
    /// Cameras.
    pub cameras: u64,
    /// Lights (`KHR_lights_punctual`).
    pub lights: u64,
    /// Material variants (`KHR_materials_variants`).
    pub variants: u64,
    /// Nodes that have levels already (`MSFT_lod`).
    pub level_groups: u64,
    /// `extensionsUsed`.
    pub extensions_used: Vec<String>,
    /// `extensionsRequired`.
    pub extensions_required: Vec<String>,
}

/// What `mode` draws, from 0.
const MODES: [&str; 7] =
    ["points", "lines", "line loops", "line strips", "triangles", "triangle strips", "triangle fans"];

impl Structure {
    /// Counts. Parts of an odd shape count as what they are declared to be.
    pub fn of(document: &Document) -> Self {
        let length = |name: &str| array(&document.json, name).len() as u64;
        let root = |extension: &str, list: &str| {
            json::extension(&document.json, extension).map_or(0, |object| array(object, list).len() as u64)
        };
        let nodes = || array(&document.json, "nodes").iter();
        let mut structure = Self {
            container: match document.container {
                Container::Glb => "glb".to_owned(),
                Container::Gltf => "gltf".to_owned(),
            },
            generator: document.json.pointer("/asset/generator").and_then(Value::as_str).map(str::to_owned),
            scenes: length("scenes"),
            nodes: length("nodes"),
            mesh_nodes: nodes().filter(|node| node.get("mesh").is_some()).count() as u64,
            meshes: length("meshes"),
            materials: length("materials"),
            textures: length("textures"),
            images: length("images"),
            skins: length("skins"),
            animations: length("animations"),
            cameras: length("cameras"),
            lights: root("KHR_lights_punctual", "lights"),
            variants: root("KHR_materials_variants", "variants"),
            level_groups: nodes().filter(|node| json::extension(node, "MSFT_lod").is_some()).count() as u64,
            extensions_used: names(document, "extensionsUsed"),
            extensions_required: names(document, "extensionsRequired"),
            ..Self::default()
        };
        for mesh in array(&document.json, "meshes") {
            for primitive in array(mesh, "primitives") {
                structure.count_primitive(primitive);
            }
        }
        structure
    }

    fn count_primitive(&mut self, primitive: &Value) {
        let mode = primitive.get("mode").map_or(Some(4), json::integer).and_then(|mode| usize::try_from(mode).ok());
        let name = mode.and_then(|mode| MODES.get(mode)).copied().unwrap_or("an unknown mode");
        *self.primitives.entry(name.to_owned()).or_default() += 1;
        for attribute in primitive.get("attributes").and_then(Value::as_object).into_iter().flat_map(|a| a.keys()) {
            *self.attributes.entry(attribute.clone()).or_default() += 1;
        }
        self.morphed_primitives += u64::from(!array(primitive, "targets").is_empty());
    }
}

fn names(document: &Document, list: &str) -> Vec<String> {
    array(&document.json, list).iter().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// The array `key` of an object; empty if there is none.
pub(super) fn array<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn document(json: &Value) -> Document {
        let mut document = Document::new(Container::Gltf, "test");
        for (key, value) in json.as_object().expect("tests pass objects") {
            document.json[key] = value.clone();
        }
        document
    }

    #[test]
    fn primitives_are_counted_by_mode() {
        let primitive = |mode: u64| json!({ "mode": mode, "attributes": { "POSITION": 0 } });
        let bare = json!({ "attributes": { "POSITION": 0, "NORMAL": 1 }, "targets": [{}] });
        let primitives = [primitive(0), primitive(5), primitive(5), primitive(99), bare];
        let structure = Structure::of(&document(&json!({ "meshes": [{ "primitives": primitives }, {}] })));
        let counted: Vec<(&str, u64)> = structure.primitives.iter().map(|(name, n)| (name.as_str(), *n)).collect();
        assert_eq!(counted, [("an unknown mode", 1), ("points", 1), ("triangle strips", 2), ("triangles", 1)]);
        assert_eq!((structure.meshes, structure.morphed_primitives), (2, 1));
        assert_eq!(structure.attributes["POSITION"], 5);
    }
}
