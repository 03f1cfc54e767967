//! All materials of a document with their textures, decoded once and shared by every level that is drawn.
//!
//! A texture that is missing or cannot be read is a note, never a failure: the factor beside it is used alone.

use super::image_file::{Decoded, decode};
use super::material::Material;
use super::texture::{Encoding, Texture};
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::scene::Warning;
use crate::gltf::views::Views;
use crate::gltf::{json, uri};
use rayon::prelude::*;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Extensions that give a texture another image in a format of their own, in the order of preference.
const OTHER_SOURCES: [&str; 2] = ["EXT_texture_webp", "KHR_texture_basisu"];

/// Materials and textures of one document.
#[derive(Clone, Debug)]
pub struct Looks {
    /// As in the document, and behind them the default material.
    pub materials: Vec<Material>,
    /// What the materials refer to.
    pub textures: Vec<Texture>,
    /// What could not be read, once for each image.
    pub notes: Vec<Warning>,
}

impl Default for Looks {
    /// The default material alone.
    fn default() -> Self {
        Self { materials: vec![Material::default()], textures: Vec::new(), notes: Vec::new() }
    }
}

impl Looks {
    /// Reads the materials `wanted` (all, if `None`) with their images; the others keep their factors only. Relative
    /// addresses start at `base`, the scene's folder.
    pub fn load(document: &Document, buffers: &Buffers, base: &Path, wanted: Option<&BTreeSet<usize>>) -> Self {
        let entries = document.array("materials").unwrap_or_default();
        let mut materials: Vec<Material> = entries.iter().map(|value| Material::read(document, value)).collect();
        materials.push(Material::default());
        // One texture for each image and encoding, however many `textures` refer to it.
        let mut numbers: BTreeMap<(usize, Encoding), usize> = BTreeMap::new();
        let mut notes = Vec::new();
        for (i, material) in materials.iter_mut().enumerate() {
            let is_wanted = wanted.is_none_or(|wanted| wanted.contains(&i));
            for (slot, texture) in material.textures_mut().into_iter().enumerate() {
                let encoding = if matches!(slot, 0 | 3) { Encoding::Color } else { Encoding::Data };
                let image = texture.filter(|_| is_wanted).and_then(|t| image_of(document, t.texture, &mut notes));
                *texture = texture.zip(image).map(|(mut texture, image)| {
                    let next = numbers.len();
                    texture.texture = *numbers.entry((image, encoding)).or_insert(next);
                    texture
                });
            }
        }
        let views = Views::new(document, buffers);
        let read = |image: usize| -> Result<Decoded, String> {
            let views = views.as_ref().map_err(ToString::to_string)?;
            decode(&image_bytes(document, views, base, image)?)
        };
        let images: Vec<usize> = numbers.keys().map(|(image, _)| *image).collect::<BTreeSet<_>>().into_iter().collect();
        let decoded: Vec<Result<Decoded, String>> = images.par_iter().map(|image| read(*image)).collect();
        let jobs: Vec<(usize, usize, Encoding)> = numbers
            .iter()
            .map(|(&(image, encoding), &number)| (number, images.partition_point(|i| *i < image), encoding))
            .collect();
        let made: Vec<(usize, Option<Texture>)> = jobs
            .par_iter()
            .map(|&(number, at, encoding)| {
                let image = decoded[at].as_ref().ok();
                let texture = image.and_then(|i| Texture::new(i.width, i.height, i.texels.clone(), encoding));
                (number, texture)
            })
            .collect();
        for (image, result) in images.iter().zip(&decoded) {
            if let Err(text) = result {
                let text = format!("{text}; materials are shown without it");
                notes.push(Warning { place: format!("images[{image}]"), text });
            }
        }
        let textures = settle(&mut materials, made);
        notes.dedup();
        Self { materials, textures, notes }
    }

    /// The number of a primitive's material in [`Self::materials`].
    pub fn material(&self, index: Option<usize>) -> usize {
        let default = self.materials.len() - 1;
        index.filter(|i| *i < default).unwrap_or(default)
    }
}

/// Puts the textures that could be made in order and takes out the uses of the others.
fn settle(materials: &mut [Material], made: Vec<(usize, Option<Texture>)>) -> Vec<Texture> {
    let mut places = BTreeMap::new();
    let mut textures = Vec::new();
    for (number, texture) in made {
        if let Some(texture) = texture {
            places.insert(number, textures.len());
            textures.push(texture);
        }
    }
    for slot in materials.iter_mut().flat_map(Material::textures_mut) {
        *slot = slot.and_then(|mut used| {
            used.texture = *places.get(&used.texture)?;
            Some(used)
        });
    }
    textures
}

/// The image that a texture shows, preferring the forms of extensions that can be read here.
fn image_of(document: &Document, texture: usize, notes: &mut Vec<Warning>) -> Option<usize> {
    let entry = document.array("textures").ok()?.get(texture)?;
    let source = |value: &Value| value.get("source").and_then(json::integer).map(|i| i as usize);
    let other = OTHER_SOURCES.iter().find_map(|name| source(json::extension(entry, name)?));
    let image = other.or_else(|| source(entry));
    let count = document.array("images").map_or(0, <[Value]>::len);
    if let Some(image) = image.filter(|i| *i < count) {
        return Some(image);
    }
    let extensions = entry.get("extensions").and_then(Value::as_object);
    let names: Vec<&str> = extensions.into_iter().flat_map(|e| e.keys().map(String::as_str)).collect();
    let why = if names.is_empty() { "has no image".to_owned() } else { format!("has only {}", names.join(", ")) };
    let text = format!("the texture {why}; materials are shown without it");
    let note = Warning { place: format!("textures[{texture}]"), text };
    if !notes.contains(&note) {
        notes.push(note);
    }
    None
}

/// The file of an image.
pub(super) fn image_bytes<'a>(
    document: &'a Document,
    views: &'a Views<'_>,
    base: &Path,
    image: usize,
) -> Result<Cow<'a, [u8]>, String> {
    let place = format!("images[{image}]");
    let entry = document.array("images").ok().and_then(|all| all.get(image)).ok_or("there is no such image")?;
    if let Some(view) = entry.get("bufferView").and_then(json::integer) {
        let view = views.get(view as usize, &place).map_err(|fault| fault.problem.to_string())?;
        return Ok(Cow::Borrowed(view.bytes));
    }
    let Some(address) = entry.get("uri").and_then(Value::as_str) else {
        return Err("the image has neither an address nor data".to_owned());
    };
    if uri::form(address) == uri::Form::Data {
        return uri::decode_data(address, &place).map(Cow::Owned).map_err(|fault| fault.problem.to_string());
    }
    let path = uri::resolve(address, base, &place).map_err(|fault| fault.problem.to_string())?;
    if !path.is_file() {
        return Err(format!("there is no file `{}`", uri::shorten(address)));
    }
    std::fs::read(&path).map(Cow::Owned).map_err(|e| format!("cannot read `{}`: {e}", uri::shorten(address)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use base64::Engine as _;
    use serde_json::json;
    use std::io::Cursor;

    fn png() -> String {
        let mut bytes = Vec::new();
        let image = image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 0, 0, 255, 128]).unwrap();
        image.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
    }

    fn load(images: &Value, textures: &Value) -> Looks {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["images"] = images.clone();
        document.json["textures"] = textures.clone();
        document.json["materials"] = json!([{
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "baseColorFactor": [0.5, 1, 1, 1] },
            "normalTexture": { "index": 0 },
            "emissiveTexture": { "index": 1 },
        }]);
        Looks::load(&document, &Buffers::default(), Path::new("."), None)
    }

    #[test]
    fn an_image_is_decoded_once_for_each_meaning() {
        let looks = load(&json!([{ "uri": png() }]), &json!([{ "source": 0 }, { "source": 0 }]));
        assert_eq!(looks.notes, []);
        assert_eq!(looks.textures.len(), 2);
        let material = &looks.materials[0];
        let base = &looks.textures[material.base_texture.unwrap().texture];
        assert_eq!((base.encoding(), base.size(), base.is_translucent()), (Encoding::Color, [2, 1], true));
        assert_eq!(base.levels().next().unwrap().2[0], [255, 0, 0, 255]);
        assert_eq!(material.base_texture.unwrap().texture, material.emissive_texture.unwrap().texture);
        assert_eq!(looks.textures[material.normal_texture.unwrap().texture].encoding(), Encoding::Data);
        assert_eq!((looks.material(Some(0)), looks.material(Some(1)), looks.material(None)), (0, 1, 1));
    }

    #[test]
    fn missing_and_broken_images_are_notes() {
        let images = json!([{ "uri": "nowhere.png" }, { "uri": "data:image/png;base64,AAAA" }]);
        let looks = load(&images, &json!([{ "source": 0 }, { "source": 1 }]));
        let notes: Vec<String> = looks.notes.iter().map(|n| format!("{}: {}", n.place, n.text)).collect();
        assert_eq!(
            notes,
            [
                "images[0]: there is no file `nowhere.png`; materials are shown without it",
                "images[1]: the image is neither PNG, JPEG, WebP nor KTX2; materials are shown without it",
            ]
        );
        let material = &looks.materials[0];
        assert_eq!((material.base_texture, material.normal_texture), (None, None));
        assert_eq!(material.base.x, 0.5);
    }

    #[test]
    fn formats_of_extensions() {
        let only = json!([{ "extensions": { "MSFT_texture_dds": { "source": 0 } } }, { "source": 7 }]);
        let notes = load(&json!([{ "uri": png() }]), &only).notes;
        assert_eq!(notes[0].text, "the texture has only MSFT_texture_dds; materials are shown without it");
        assert_eq!(notes[1].text, "the texture has no image; materials are shown without it");
        assert_eq!(notes.len(), 2);
        let webp = json!([{ "source": 7, "extensions": { "EXT_texture_webp": { "source": 0 } } }, { "source": 0 }]);
        assert_eq!(load(&json!([{ "uri": png() }]), &webp).notes, []);
    }
}
