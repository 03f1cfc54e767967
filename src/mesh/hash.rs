//! The name of a mesh by its content: BLAKE3 over decoded attributes, morph targets and indices.
//!
//! Knows nothing of materials, names, files or how the bytes were laid out or compressed: meshes that decode to the
//! same numbers in the same formats have the same hash.

use super::{Attribute, ComponentType, Primitive};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt;
use std::str::FromStr;

/// Changes whenever the bytes that are hashed change their meaning.
const DOMAIN: &[u8] = b"lodbake mesh 1";

/// Content hash of a sub-mesh.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MeshHash(pub [u8; 32]);

impl MeshHash {
    /// The first 12 hexadecimal digits, for people: among a million meshes two agree by chance once in 500 times.
    pub fn short(&self) -> String {
        self.to_string()[..12].to_owned()
    }
}

impl fmt::Display for MeshHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(blake3::Hash::from_bytes(self.0).to_hex().as_str())
    }
}

impl fmt::Debug for MeshHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MeshHash({self})")
    }
}

/// The text is not 64 hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a mesh hash (64 hexadecimal digits)")]
pub struct MeshHashError(String);

impl FromStr for MeshHash {
    type Err = MeshHashError;

    fn from_str(text: &str) -> Result<Self, MeshHashError> {
        let hash = blake3::Hash::from_hex(text).map_err(|_| MeshHashError(text.to_owned()))?;
        Ok(Self(*hash.as_bytes()))
    }
}

impl Serialize for MeshHash {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() { serializer.collect_str(self) } else { self.0.serialize(serializer) }
    }
}

impl<'de> Deserialize<'de> for MeshHash {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
        } else {
            <[u8; 32]>::deserialize(deserializer).map(Self)
        }
    }
}

/// The hash of the sub-mesh made of these primitives, in this order.
pub fn hash<'a>(primitives: impl IntoIterator<Item = &'a Primitive>) -> MeshHash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(DOMAIN);
    for primitive in primitives {
        hash_primitive(&mut hasher, primitive);
    }
    MeshHash(*hasher.finalize().as_bytes())
}

/// Every list is preceded by its length, so that no two different meshes give the same stream of bytes.
fn hash_primitive(hasher: &mut blake3::Hasher, primitive: &Primitive) {
    hash_number(hasher, primitive.count);
    hash_attributes(hasher, &primitive.attributes);
    hash_number(hasher, primitive.targets.len());
    for target in &primitive.targets {
        hash_attributes(hasher, target);
    }
    hash_number(hasher, primitive.indices.len());
    hash_words(hasher, &primitive.indices, |index| *index);
}

fn hash_attributes(hasher: &mut blake3::Hasher, attributes: &[Attribute]) {
    hash_number(hasher, attributes.len());
    let mut sorted: Vec<&Attribute> = attributes.iter().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    for attribute in sorted {
        hash_number(hasher, attribute.name.len());
        hasher.update(attribute.name.as_bytes());
        hash_number(hasher, attribute.components);
        hasher.update(&[component_code(attribute.format.component), u8::from(attribute.format.normalized)]);
        hash_number(hasher, attribute.values.len());
        hash_words(hasher, &attribute.values, |value| positive_zero(*value));
    }
}

/// The bits of a value, with one form of zero.
pub fn positive_zero(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits == 0x8000_0000 { 0 } else { bits }
}

/// Stable, unlike the order of the enum's variants.
fn component_code(component: ComponentType) -> u8 {
    (component.gltf() - 5120) as u8
}

fn hash_number(hasher: &mut blake3::Hasher, number: usize) {
    hasher.update(&(number as u64).to_le_bytes());
}

/// In blocks: the hasher is many times faster on 16 KiB than on 4 bytes.
fn hash_words<T>(hasher: &mut blake3::Hasher, values: &[T], word: impl Fn(&T) -> u32) {
    let mut block = [0u8; 16384];
    for chunk in values.chunks(block.len() / 4) {
        for (out, value) in block.chunks_exact_mut(4).zip(chunk) {
            out.copy_from_slice(&word(value).to_le_bytes());
        }
        hasher.update(&block[..chunk.len() * 4]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Format;

    fn attribute(name: &str, values: &[f32]) -> Attribute {
        Attribute { name: name.to_owned(), components: 3, format: Format::F32, values: values.to_vec() }
    }

    fn triangle() -> Primitive {
        Primitive {
            count: 3,
            attributes: vec![
                attribute("NORMAL", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]),
                attribute("POSITION", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
            ],
            targets: vec![vec![attribute("POSITION", &[0.5; 9])]],
            indices: vec![0, 1, 2],
        }
    }

    #[test]
    fn the_order_of_attributes_and_the_sign_of_zero_do_not_matter() {
        let mut other = triangle();
        other.attributes.reverse();
        other.attributes[0].values[1] = -0.0;
        assert_eq!(hash([&triangle()]), hash([&other]));
    }

    #[test]
    fn everything_else_matters() {
        let changes: [fn(&mut Primitive); 10] = [
            |p| p.attributes[0].name = "TANGENT".to_owned(),
            |p| p.attributes[1].values[3] = 1.0000001,
            |p| p.attributes[1].format.normalized = true,
            |p| p.attributes[1].format.component = ComponentType::U16,
            |p| p.attributes[1].components = 1,
            |p| p.targets[0][0].values[8] = 0.25,
            |p| p.targets.push(Vec::new()),
            |p| p.indices.rotate_left(1),
            |p| p.indices.clear(),
            |p| p.count = 4,
        ];
        let mut seen = vec![hash([&triangle()]), hash([&triangle(), &triangle()]), hash([])];
        for change in changes {
            let mut other = triangle();
            change(&mut other);
            seen.push(hash([&other]));
        }
        let total = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), total);
    }

    #[test]
    fn hex_in_text_and_bytes_in_binary() {
        let hash = hash([&triangle()]);
        let text = serde_json::to_string(&hash).unwrap();
        assert_eq!(text, format!("\"{hash}\""));
        assert_eq!(serde_json::from_str::<MeshHash>(&text).unwrap(), hash);
        let bytes = postcard::to_stdvec(&hash).unwrap();
        assert_eq!(bytes, hash.0);
        assert_eq!(postcard::from_bytes::<MeshHash>(&bytes).unwrap(), hash);
        assert!(hash.to_string().starts_with(&hash.short()) && hash.short().len() == 12);
        assert!("12".parse::<MeshHash>().is_err());
    }

    /// Cached results are found by this hash: a change of it must be meant, and comes with a new `DOMAIN`.
    #[test]
    fn the_hash_of_a_triangle_stays() {
        assert_eq!(hash([&triangle()]).short(), "b16e5e9ad7b8");
    }
}
