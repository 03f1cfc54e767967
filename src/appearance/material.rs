//! Materials of a glTF document, as far as looks are measured: metallic-roughness, unlit, masks, texture transforms.
//!
//! Reading is forgiving: what cannot be understood takes the specification's default, for a picture with one wrong
//! factor says more than none. Knows no images but their textures' numbers.

use super::texture::Wrap;
use crate::gltf::document::Document;
use crate::gltf::json;
use glam::{Vec2, Vec3, Vec4};
use serde_json::Value;

/// How alpha counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// Not at all.
    #[default]
    Opaque,
    /// Less than this is not drawn.
    Mask(f32),
    /// Blended: drawn as a screen door, in as many of 16 neighbouring pixels as alpha says.
    Blend,
}

/// A texture in use: which one, and how it is laid on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureUse {
    /// Index in the textures of [`super::looks::Looks`].
    pub texture: usize,
    /// Set of texture coordinates.
    pub set: usize,
    /// Wrap mode of each axis.
    pub wrap: [Wrap; 2],
    /// `KHR_texture_transform` as `columns · uv + offset`; `None` if it changes nothing.
    pub transform: Option<Transform>,
}

/// An affine map of texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Image of (1, 0).
    pub u: Vec2,
    /// Image of (0, 1).
    pub v: Vec2,
    /// Image of (0, 0).
    pub offset: Vec2,
}

impl TextureUse {
    /// Where a texture coordinate falls.
    #[inline]
    pub fn point(&self, uv: Vec2) -> Vec2 {
        match &self.transform {
            None => uv,
            Some(t) => t.u * uv.x + t.v * uv.y + t.offset,
        }
    }

    /// What a difference of texture coordinates becomes.
    #[inline]
    pub fn direction(&self, uv: Vec2) -> Vec2 {
        match &self.transform {
            None => uv,
            Some(t) => t.u * uv.x + t.v * uv.y,
        }
    }
}

/// One material. Colours are linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Base colour and alpha, a factor of texture and vertex colour.
    pub base: Vec4,
    /// sRGB texture of the base colour.
    pub base_texture: Option<TextureUse>,
    /// 0 dielectric … 1 metal, a factor of the texture's blue.
    pub metallic: f32,
    /// 0 mirror … 1 matte, a factor of the texture's green (of one minus alpha where `glossy`).
    pub roughness: f32,
    /// Texture of both.
    pub metallic_roughness_texture: Option<TextureUse>,
    /// Factor of the normal map's x and y.
    pub normal_scale: f32,
    /// Tangent space normals.
    pub normal_texture: Option<TextureUse>,
    /// Light of its own, with its strength.
    pub emissive: Vec3,
    /// sRGB texture of it.
    pub emissive_texture: Option<TextureUse>,
    /// How alpha counts.
    pub alpha: Alpha,
    /// Are back faces drawn?
    pub double_sided: bool,
    /// Shown as the base colour, without any lighting.
    pub unlit: bool,
}

impl Default for Material {
    /// The specification's default material.
    fn default() -> Self {
        Self {
            base: Vec4::ONE,
            base_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_scale: 1.0,
            normal_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// The material `value`. Its texture uses carry indices into the document's `textures`.
    pub fn read(document: &Document, value: &Value) -> Self {
        let mut material = Self::default();
        let reader = Reader { document };
        if let Some(pbr) = value.get("pbrMetallicRoughness") {
            material.base = Vec4::from_array(numbers(pbr, "baseColorFactor", [1.0; 4]));
            material.base_texture = reader.texture(pbr, "baseColorTexture");
            material.metallic = number(pbr, "metallicFactor", 1.0).clamp(0.0, 1.0);
            material.roughness = number(pbr, "roughnessFactor", 1.0).clamp(0.0, 1.0);
            material.metallic_roughness_texture = reader.texture(pbr, "metallicRoughnessTexture");
        }
        if let Some(gloss) = json::extension(value, "KHR_materials_pbrSpecularGlossiness") {
            material.read_gloss(&reader, gloss);
        }
        material.normal_texture = reader.texture(value, "normalTexture");
        material.normal_scale = value.get("normalTexture").map_or(1.0, |t| number(t, "scale", 1.0));
        let strength = json::extension(value, "KHR_materials_emissive_strength");
        let strength = strength.map_or(1.0, |e| number(e, "emissiveStrength", 1.0));
        material.emissive = Vec3::from_array(numbers(value, "emissiveFactor", [0.0; 3])) * strength;
        material.emissive_texture = reader.texture(value, "emissiveTexture");
        material.alpha = match value.get("alphaMode").and_then(Value::as_str) {
            Some("MASK") => Alpha::Mask(number(value, "alphaCutoff", 0.5)),
            Some("BLEND") => Alpha::Blend,
            _ => Alpha::Opaque,
        };
        material.double_sided = value.get("doubleSided").and_then(Value::as_bool).unwrap_or(false);
        material.unlit = json::extension(value, "KHR_materials_unlit").is_some();
        material
    }

    /// The archived predecessor of metallic-roughness: its diffuse colour on a dielectric. The specular colour is left
    /// out, and so is the gloss in a texture.
    fn read_gloss(&mut self, reader: &Reader<'_>, gloss: &Value) {
        self.base = Vec4::from_array(numbers(gloss, "diffuseFactor", [1.0; 4]));
        self.base_texture = reader.texture(gloss, "diffuseTexture");
        self.metallic = 0.0;
        self.roughness = 1.0 - number(gloss, "glossinessFactor", 1.0).clamp(0.0, 1.0);
        self.metallic_roughness_texture = None;
        if gloss.get("specularGlossinessTexture").is_some() {
            self.roughness = 0.7;
        }
    }

    /// Every texture use, for renumbering.
    pub(super) fn textures_mut(&mut self) -> [&mut Option<TextureUse>; 4] {
        [
            &mut self.base_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.emissive_texture,
        ]
    }

    /// Can its alpha let pixels through?
    pub fn has_holes(&self) -> bool {
        self.alpha != Alpha::Opaque
    }
}

struct Reader<'a> {
    document: &'a Document,
}

impl Reader<'_> {
    fn texture(&self, value: &Value, key: &str) -> Option<TextureUse> {
        let info = value.get(key)?;
        let index = |value: &Value, key: &str| value.get(key).and_then(json::integer).map(|i| i as usize);
        let texture = index(info, "index")?;
        let mut set = index(info, "texCoord").unwrap_or(0);
        let mut transform = None;
        if let Some(extension) = json::extension(info, "KHR_texture_transform") {
            set = index(extension, "texCoord").unwrap_or(set);
            transform = Some(read_transform(extension));
        }
        let entry = self.document.array("textures").ok()?.get(texture)?;
        let sampler = index(entry, "sampler").and_then(|i| self.document.array("samplers").ok()?.get(i));
        let wrap = ["wrapS", "wrapT"].map(|key| {
            let mode = sampler.and_then(|s| s.get(key)).and_then(json::integer);
            match mode {
                Some(33071) => Wrap::Clamp,
                Some(33648) => Wrap::Mirror,
                _ => Wrap::Repeat,
            }
        });
        Some(TextureUse { texture, set, wrap, transform })
    }
}

/// Scale, then rotation, then offset. Counter-clockwise as seen on the image, whose v points down: what the Khronos
/// viewer and the engines do; the formula in the extension's text turns the other way.
fn read_transform(extension: &Value) -> Transform {
    let [x, y] = numbers(extension, "offset", [0.0; 2]);
    let [sx, sy] = numbers(extension, "scale", [1.0; 2]);
    let angle = extension.get("rotation").and_then(Value::as_f64).unwrap_or(0.0);
    let (sin, cos) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
    Transform { u: Vec2::new(sx * cos, -sx * sin), v: Vec2::new(sy * sin, sy * cos), offset: Vec2::new(x, y) }
}

fn number(value: &Value, key: &str, default: f32) -> f32 {
    value.get(key).and_then(Value::as_f64).map_or(default, |x| x as f32)
}

fn numbers<const N: usize>(value: &Value, key: &str, default: [f32; N]) -> [f32; N] {
    let Some(items) = value.get(key).and_then(Value::as_array) else { return default };
    std::array::from_fn(|i| items.get(i).and_then(Value::as_f64).map_or(default[i], |x| x as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    fn read(value: &Value) -> Material {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["textures"] = json!([{ "sampler": 0, "source": 0 }, {}]);
        document.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648 }]);
        Material::read(&document, value)
    }

    #[test]
    fn an_empty_material_is_the_default() {
        assert_eq!(read(&json!({})), Material::default());
        assert_eq!(read(&json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 9 } } })).base_texture, None);
    }

    #[test]
    fn what_is_written_is_read() {
        let material = read(&json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                "metallicFactor": 0.25,
                "baseColorTexture": { "index": 0, "texCoord": 1 },
            },
            "normalTexture": { "index": 1, "scale": 2 },
            "emissiveFactor": [1, 0, 0.5],
            "alphaMode": "MASK",
            "doubleSided": true,
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 3 }, "KHR_materials_unlit": {} },
        }));
        assert_eq!(material.base.to_array(), [0.1, 0.2, 0.3, 0.4]);
        let base = material.base_texture.unwrap();
        assert_eq!((base.texture, base.set, base.wrap), (0, 1, [Wrap::Clamp, Wrap::Mirror]));
        assert_eq!((material.normal_scale, material.normal_texture.unwrap().wrap), (2.0, [Wrap::Repeat; 2]));
        assert_eq!(material.emissive, Vec3::new(3.0, 0.0, 1.5));
        assert_eq!((material.alpha, material.double_sided, material.unlit), (Alpha::Mask(0.5), true, true));
    }

    #[test]
    fn a_quarter_turn_is_counter_clockwise_on_the_image() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let material = read(&json!({ "emissiveTexture": { "index": 0, "extensions": { "KHR_texture_transform": {
            "rotation": quarter, "scale": [2, 3], "offset": [0.5, 0], "texCoord": 1 } } } }));
        let texture = material.emissive_texture.unwrap();
        assert_eq!(texture.set, 1);
        let off = texture.point(Vec2::new(1.0, 0.0)) - Vec2::new(0.5, -2.0);
        assert!(off.length() < 1e-6);
        let off = texture.direction(Vec2::new(0.0, 1.0)) - Vec2::new(3.0, 0.0);
        assert!(off.length() < 1e-6);
    }
}
