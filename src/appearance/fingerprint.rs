//! What a material shows, as a hash: its entry in the document, its textures and samplers, and the content of its images.
//!
//! Indices do not count, contents do: the same material in two files has one fingerprint, and a changed image another.
//! Opens no file; the content of external images is asked of the caller, who has seen the files anyway.

use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::json;
use crate::gltf::views::Views;
use crate::key::ContentHash;
use serde_json::Value;

/// Fingerprints of all materials of a document.
#[derive(Clone, Debug)]
pub struct Fingerprints(Vec<ContentHash>);

impl Fingerprints {
    /// Takes them. `external` tells the content of the file at an address; `None` if there is none.
    pub fn new(document: &Document, buffers: &Buffers, external: &dyn Fn(&str) -> Option<ContentHash>) -> Self {
        let array = |key: &str| document.array(key).unwrap_or_default();
        let views = Views::new(document, buffers).ok();
        let image = |entry: &Value| -> ContentHash {
            let view = entry.get("bufferView").and_then(json::integer);
            let bytes = view.and_then(|view| views.as_ref()?.get(view as usize, "images").ok());
            let address = entry.get("uri").and_then(Value::as_str);
            match (bytes, address) {
                (Some(view), _) => hash(view.bytes),
                (None, Some(address)) => external(address).unwrap_or_else(|| hash(address.as_bytes())),
                (None, None) => hash(b""),
            }
        };
        let images: Vec<ContentHash> = array("images").iter().map(image).collect();
        let samplers = array("samplers");
        let textures: Vec<ContentHash> = (array("textures").iter())
            .map(|texture| {
                let mut hasher = blake3::Hasher::new();
                let at = |value: &Value, key: &str| value.get(key).and_then(json::integer).map(|i| i as usize);
                let own = at(texture, "source");
                let others = texture.get("extensions").and_then(Value::as_object).into_iter().flatten();
                let sources = others.map(|(name, value)| (name.as_str(), at(value, "source")));
                for (name, source) in std::iter::once(("", own)).chain(sources) {
                    hasher.update(name.as_bytes());
                    hasher.update(source.and_then(|i| images.get(i)).map_or(&[0; 32], |hash| &hash.0));
                }
                let sampler = at(texture, "sampler").and_then(|i| samplers.get(i));
                hasher.update(sampler.map(Value::to_string).unwrap_or_default().as_bytes());
                ContentHash(*hasher.finalize().as_bytes())
            })
            .collect();
        let material = |entry: &Value| {
            let mut hasher = blake3::Hasher::new();
            let mut entry = entry.clone();
            for key in ["name", "extras"] {
                entry.as_object_mut().map(|object| object.shift_remove(key));
            }
            fold_textures(&mut entry, &textures, &mut hasher);
            hasher.update(entry.to_string().as_bytes());
            ContentHash(*hasher.finalize().as_bytes())
        };
        Self(array("materials").iter().map(material).collect())
    }

    /// Of a list of materials, in order: what a mesh shows, primitive by primitive.
    pub fn of(&self, materials: &[Option<usize>]) -> ContentHash {
        let mut hasher = blake3::Hasher::new();
        for material in materials {
            let own = material.and_then(|i| self.0.get(i));
            hasher.update(own.map_or(&[0; 32], |hash| &hash.0));
        }
        ContentHash(*hasher.finalize().as_bytes())
    }
}

fn hash(bytes: &[u8]) -> ContentHash {
    ContentHash(*blake3::hash(bytes).as_bytes())
}

/// Hashes the textures that `value` refers to, in the order of the text, and takes their indices out of it.
fn fold_textures(value: &mut Value, textures: &[ContentHash], hasher: &mut blake3::Hasher) {
    for (key, entry) in value.as_object_mut().into_iter().flatten() {
        if key.ends_with("Texture")
            && let Some(index) = entry.as_object_mut().and_then(|info| info.shift_remove("index"))
        {
            let texture = json::integer(&index).and_then(|i| textures.get(i as usize));
            hasher.update(texture.map_or(&[0; 32], |hash| &hash.0));
        }
        fold_textures(entry, textures, hasher);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;
    use std::path::Path;

    fn document(materials: Value, textures: Value) -> Document {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["materials"] = materials;
        document.json["textures"] = textures;
        document.json["images"] = json!([{ "uri": "a.png" }, { "uri": "b.png" }]);
        document
    }

    fn of(document: &Document, material: usize) -> ContentHash {
        let buffers = Buffers::load(document, Path::new("")).unwrap();
        let external = |address: &str| Some(ContentHash([address.as_bytes()[0]; 32]));
        Fingerprints::new(document, &buffers, &external).of(&[Some(material)])
    }

    fn textured(index: usize) -> Value {
        json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": index, "texCoord": 1 } } })
    }

    #[test]
    fn contents_count_and_numbers_do_not() {
        let one = document(json!([textured(0), {}]), json!([{ "source": 0 }, { "source": 1 }]));
        let other = document(json!([{}, textured(1)]), json!([{ "source": 1 }, { "source": 0 }]));
        assert_eq!(of(&one, 0), of(&other, 1));
        assert_ne!(of(&one, 0), of(&document(json!([textured(1)]), one.json["textures"].clone()), 0));
        assert_ne!(of(&one, 0), of(&one, 1));
    }

    #[test]
    fn what_cannot_be_seen_does_not_count() {
        let mut named = textured(0);
        named["name"] = json!("brass");
        let textures = json!([{ "source": 0 }]);
        let plain = document(json!([textured(0)]), textures.clone());
        assert_eq!(of(&plain, 0), of(&document(json!([named]), textures.clone()), 0));
        let mut rough = textured(0);
        rough["pbrMetallicRoughness"]["roughnessFactor"] = json!(0.5);
        assert_ne!(of(&plain, 0), of(&document(json!([rough]), textures), 0));
    }

    #[test]
    fn a_sampler_counts() {
        let mut wrapped = document(json!([textured(0)]), json!([{ "source": 0, "sampler": 0 }]));
        wrapped.json["samplers"] = json!([{ "wrapS": 33071 }]);
        assert_ne!(of(&wrapped, 0), of(&document(json!([textured(0)]), json!([{ "source": 0 }])), 0));
    }
}
