//! Accessors of the same content: one of them serves all.
//!
//! Meshes that differ in one attribute alone (texture coordinates of a light map) need the others only once; so do the
//! channels of an animation that share their times. Bits, type and bounds are the same, so nothing that is drawn changes.

use super::{index, names};
use crate::gltf::accessor::Accessor;
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use crate::gltf::views::Views;
use serde_json::Value;
use std::collections::BTreeMap;

/// What an accessor is used for: the view of an index may not be that of a vertex.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
    Indices,
    Vertices,
    Animation,
}

/// Visits every reference to an accessor that may be exchanged.
fn visit(document: &mut Document, mut each: impl FnMut(Role, &mut Value)) -> Result<(), DocumentError> {
    if document.json.get("meshes").is_some() {
        for mesh in document.array_mut("meshes")?.iter_mut().filter(|mesh| super::is_plain(mesh)) {
            let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut).into_iter().flatten();
            for primitive in primitives.filter(|p| json::extension(p, super::draco::EXTENSION).is_none()) {
                if let Some(indices) = primitive.get_mut("indices") {
                    each(Role::Indices, indices);
                }
                let own = primitive.get_mut("attributes").and_then(Value::as_object_mut);
                own.into_iter().flat_map(|own| own.values_mut()).for_each(|value| each(Role::Vertices, value));
                let targets = primitive.get_mut("targets").and_then(Value::as_array_mut).into_iter().flatten();
                let targets = targets.filter_map(Value::as_object_mut).flat_map(|target| target.values_mut());
                targets.for_each(|value| each(Role::Vertices, value));
            }
        }
    }
    if document.json.get("animations").is_some() {
        for animation in document.array_mut("animations")? {
            let samplers = animation.get_mut("samplers").and_then(Value::as_array_mut).into_iter().flatten();
            for sampler in samplers {
                for key in ["input", "output"] {
                    if let Some(value) = sampler.get_mut(key) {
                        each(Role::Animation, value);
                    }
                }
            }
        }
    }
    Ok(())
}

/// Lets references to accessors with the content of an earlier one refer to that one; answers which one stands for which.
pub(super) fn merge(document: &mut Document, buffers: &Buffers) -> Result<BTreeMap<usize, usize>, DocumentError> {
    let mut used: BTreeMap<(Role, usize), usize> = BTreeMap::new();
    visit(document, |role, value| {
        if let Some(accessor) = json::integer(value) {
            used.insert((role, accessor as usize), accessor as usize);
        }
    })?;
    let views = Views::new(document, buffers)?;
    let mut first: BTreeMap<(Role, String, [u8; 32]), usize> = BTreeMap::new();
    for (&(role, accessor), stand_in) in &mut used {
        let entry = &document.array("accessors")?[accessor];
        // What has no bytes of its own has none to spare.
        if index(entry, "bufferView").is_none() || entry.get("sparse").is_some() {
            continue;
        }
        let members = names(Some(entry)).filter(|key| !["bufferView", "byteOffset", "name"].contains(key));
        let form = members.map(|key| format!("{key}:{}", entry[key])).collect::<Vec<_>>().join(",");
        // A buffer without data is told where it is read; here it only has nothing to compare.
        let Ok(bytes) = Accessor::parse(document, accessor, "accessors")?.packed(&views) else { continue };
        *stand_in = *first.entry((role, form, *blake3::hash(&bytes).as_bytes())).or_insert(accessor);
    }
    drop(views);
    visit(document, |role, value| {
        let accessor = json::integer(value).map(|accessor| accessor as usize);
        if let Some(stand_in) = accessor.and_then(|accessor| used.get(&(role, accessor)))
            && accessor != Some(*stand_in)
        {
            *value = serde_json::json!(stand_in);
        }
    })?;
    Ok(used.into_iter().map(|((_, accessor), stand_in)| (accessor, stand_in)).filter(|(a, b)| a != b).collect())
}
