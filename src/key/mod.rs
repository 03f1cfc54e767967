//! What a result depends on, written once and read twice: as a hash, the [`JobKey`] under which the result is kept, and
//! as text, the [`Field`]s by which `explain` tells what changed. So the two can never disagree.
//!
//! A key holds all that changes the bytes and nothing else: versions, content hashes and the settings that are used.
//! No path, no time, no machine, and no setting that the chosen metric does not look at.

mod jobs;
#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use jobs::{MeshParts, SequenceJob, write_chain};

/// Encoding of cached results. Raise it when old bytes can no longer be read.
pub const FORMAT_VERSION: u32 = 3;

/// Simplification and levels. Raise it in the commit that changes any bytes for the same mesh and settings.
pub const ALGORITHM_VERSION: u32 = 8;

/// How looks are measured. Raise it in the commit that changes any figure for the same pictures' subject.
pub const LOOK_VERSION: u32 = 1;

/// Form of the outputs. Raise it in the commit that writes the same levels in another way.
pub const EMIT_VERSION: u32 = 5;

/// How the meshes of a scene share a budget. Raise it in the commit that shares the same budget in another way.
pub const SHARE_VERSION: u32 = 1;

/// Declares a 32-byte name, shown as 64 hexadecimal digits.
macro_rules! digest {
    ($(#[$meta:meta])* $name:ident) => {
        $(#[$meta])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub [u8; 32]);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(blake3::Hash::from_bytes(self.0).to_hex().as_str())
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($name), "({})"), self)
            }
        }

        impl FromStr for $name {
            type Err = DigestError;

            fn from_str(text: &str) -> Result<Self, DigestError> {
                let hash = blake3::Hash::from_hex(text).map_err(|_| DigestError(text.to_owned()))?;
                Ok(Self(*hash.as_bytes()))
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                if serializer.is_human_readable() { serializer.collect_str(self) } else { serializer.serialize_bytes(&self.0) }
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                if deserializer.is_human_readable() {
                    String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
                } else {
                    deserializer.deserialize_bytes(DigestBytes).map(Self)
                }
            }
        }
    };
}

/// 32 bytes in one piece, which loads ten times faster than as a list of numbers.
struct DigestBytes;

impl de::Visitor<'_> for DigestBytes {
    type Value = [u8; 32];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("32 bytes")
    }

    fn visit_bytes<E: de::Error>(self, bytes: &[u8]) -> Result<[u8; 32], E> {
        bytes.try_into().map_err(|_| E::invalid_length(bytes.len(), &self))
    }
}

digest! {
    /// The name of a result: BLAKE3 of the manifest of all that it depends on.
    JobKey
}

digest! {
    /// BLAKE3 of the bytes of a file.
    ContentHash
}

/// The text is not 64 hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a hash (64 hexadecimal digits)")]
pub struct DigestError(String);

/// Something that results depend on.
pub trait Manifest {
    /// Names every part that is used, in a fixed order.
    fn write(&self, to: &mut dyn ManifestWriter);
}

/// Takes the parts of a [`Manifest`], by kind.
pub trait ManifestWriter {
    /// The parts until [`ManifestWriter::close`] belong together under `name`.
    fn open(&mut self, name: &str);
    /// Ends what [`ManifestWriter::open`] began.
    fn close(&mut self);
    /// A name from a closed list.
    fn text(&mut self, name: &str, value: &str);
    /// A count or version.
    fn integer(&mut self, name: &str, value: u64);
    /// A finite number; 0 and -0 are the same.
    fn number(&mut self, name: &str, value: f64);
    /// Yes or no.
    fn flag(&mut self, name: &str, value: bool);
    /// Content.
    fn hash(&mut self, name: &str, value: &[u8; 32]);
}

impl dyn ManifestWriter + '_ {
    fn group(&mut self, name: &str, write: impl FnOnce(&mut dyn ManifestWriter)) {
        self.open(name);
        write(self);
        self.close();
    }
}

/// The hash of a manifest.
pub fn key_of(manifest: &impl Manifest) -> JobKey {
    let mut writer = HashWriter(Vec::new());
    manifest.write(&mut writer);
    JobKey(*blake3::hash(&writer.0).as_bytes())
}

/// The text of a manifest.
pub fn fields_of(manifest: &impl Manifest) -> Vec<Field> {
    let mut writer = FieldWriter::default();
    manifest.write(&mut writer);
    writer.fields
}

/// Each part as a tag for its kind, its name and its value, all with their lengths, so that no two manifests give the
/// same stream of bytes.
struct HashWriter(Vec<u8>);

impl HashWriter {
    fn part(&mut self, kind: u8, name: &str, value: &[u8]) {
        self.0.push(kind);
        for bytes in [name.as_bytes(), value] {
            self.0.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
            self.0.extend_from_slice(bytes);
        }
    }
}

impl ManifestWriter for HashWriter {
    fn open(&mut self, name: &str) {
        self.part(b'{', name, &[]);
    }

    fn close(&mut self) {
        self.part(b'}', "", &[]);
    }

    fn text(&mut self, name: &str, value: &str) {
        self.part(b's', name, value.as_bytes());
    }

    fn integer(&mut self, name: &str, value: u64) {
        self.part(b'i', name, &value.to_le_bytes());
    }

    fn number(&mut self, name: &str, value: f64) {
        self.part(b'n', name, &(value + 0.0).to_bits().to_le_bytes());
    }

    fn flag(&mut self, name: &str, value: bool) {
        self.part(b'b', name, &[u8::from(value)]);
    }

    fn hash(&mut self, name: &str, value: &[u8; 32]) {
        self.part(b'h', name, value);
    }
}

/// One part of a manifest as text: `simplify.normal` and `0.003`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Field {
    /// With the groups that it is in, joined by dots.
    pub name: String,
    /// Numbers as short as they can be read back.
    pub value: String,
}

#[derive(Default)]
struct FieldWriter {
    groups: Vec<String>,
    fields: Vec<Field>,
}

impl FieldWriter {
    fn part(&mut self, name: &str, value: String) {
        let mut full = self.groups.join(".");
        if !full.is_empty() {
            full.push('.');
        }
        full.push_str(name);
        self.fields.push(Field { name: full, value });
    }
}

impl ManifestWriter for FieldWriter {
    fn open(&mut self, name: &str) {
        self.groups.push(name.to_owned());
    }

    fn close(&mut self) {
        self.groups.pop();
    }

    fn text(&mut self, name: &str, value: &str) {
        self.part(name, value.to_owned());
    }

    fn integer(&mut self, name: &str, value: u64) {
        self.part(name, value.to_string());
    }

    fn number(&mut self, name: &str, value: f64) {
        self.part(name, format!("{:?}", value + 0.0));
    }

    fn flag(&mut self, name: &str, value: bool) {
        self.part(name, value.to_string());
    }

    fn hash(&mut self, name: &str, value: &[u8; 32]) {
        self.part(name, blake3::Hash::from_bytes(*value).to_hex()[..12].to_owned());
    }
}

/// A part that differs between two manifests. Shown as `simplify.normal: 0.003 -> 0.01`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// Full name of the part.
    pub name: String,
    /// `None`: it was not there.
    pub before: Option<String>,
    /// `None`: it is not there any more.
    pub after: Option<String>,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "(none)".to_owned());
        write!(f, "{}: {} -> {}", self.name, shown(&self.before), shown(&self.after))
    }
}

/// What differs, in the order of `after`; parts that are gone come last.
pub fn diff(before: &[Field], after: &[Field]) -> Vec<Change> {
    let value = |fields: &[Field], name: &str| fields.iter().find(|f| f.name == name).map(|f| f.value.clone());
    let gone = before.iter().filter(|field| value(after, &field.name).is_none());
    after
        .iter()
        .chain(gone)
        .map(|field| Change {
            name: field.name.clone(),
            before: value(before, &field.name),
            after: value(after, &field.name),
        })
        .filter(|change| change.before != change.after)
        .collect()
}
