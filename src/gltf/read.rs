//! A file to a [`Scene`]: document, buffers, structure, every mesh.
//!
//! Scenes are read one at a time by the caller; the primitives of one scene are decoded in parallel.

use super::buffers::Buffers;
use super::dependencies::dependencies;
use super::document::Document;
use super::error::{DocumentError, ReadError};
use super::primitive::{self, ReadPrimitive};
use super::scene::{Scene, SourceMesh, Warning};
use super::views::Views;
use super::{json, structure, uri};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// Extensions that may be required without hiding any geometry from lodbake; prefixes of whole families.
const HARMLESS: [&str; 12] = [
    "EXT_lights_",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_",
    "MSFT_",
];

/// Reads a `.gltf` or `.glb` file and everything it needs beside it.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    let bytes = std::fs::read(path).map_err(|e| ReadError::io(path, &e))?;
    let base = path.parent().unwrap_or(Path::new(""));
    read_bytes(&bytes, base).map_err(|fault| ReadError::document(path, fault))
}

/// Reads a document from memory; addresses are relative to `base`.
pub fn read_bytes(bytes: &[u8], base: &Path) -> Result<Scene, DocumentError> {
    let document = Document::parse(bytes)?;
    structure::check(&document)?;
    let buffers = Buffers::load(&document, base)?;
    from_document(document, buffers, base)
}

/// The scene of a document whose buffers are loaded.
pub fn from_document(document: Document, buffers: Buffers, base: &Path) -> Result<Scene, DocumentError> {
    let mut warnings = odd_extensions(&document)?;
    warnings.extend(missing_images(&document, base)?);
    let (meshes, oddities) = read_meshes(&document, &buffers)?;
    warnings.extend(oddities);
    let dependencies = dependencies(&document, base);
    Ok(Scene { document, buffers, meshes, dependencies, warnings })
}

fn read_meshes(document: &Document, buffers: &Buffers) -> Result<(Vec<SourceMesh>, Vec<Warning>), DocumentError> {
    let views = Views::new(document, buffers)?;
    let mut jobs = Vec::new();
    let mut meshes = Vec::new();
    for (index, mesh) in document.array("meshes")?.iter().enumerate() {
        let place = format!("meshes[{index}]");
        let primitives = json::array(mesh, "primitives", &place)?;
        jobs.extend(primitives.iter().enumerate().map(|(i, p)| (index, p, format!("{place}.primitives[{i}]"))));
        // A wrong name does not keep anybody from reading the mesh.
        let name = mesh.get("name").and_then(|n| n.as_str()).map(str::to_owned);
        let primitives = Vec::with_capacity(primitives.len());
        meshes.push(SourceMesh { index, name, primitives, vertex_maps: BTreeMap::new() });
    }
    let read: Vec<(usize, Result<ReadPrimitive, DocumentError>)> = jobs
        .into_par_iter()
        .map(|(mesh, value, place)| (mesh, primitive::read(document, &views, value, place)))
        .collect();
    let mut warnings = Vec::new();
    for (mesh, result) in read {
        let ReadPrimitive { primitive, vertex_map, warnings: oddities } = result?;
        let mesh = &mut meshes[mesh];
        if let Some(map) = vertex_map {
            mesh.vertex_maps.insert(mesh.primitives.len(), map);
        }
        mesh.primitives.push(primitive);
        warnings.extend(oddities);
    }
    Ok((meshes, warnings))
}

fn odd_extensions(document: &Document) -> Result<Vec<Warning>, DocumentError> {
    let required = document.array("extensionsRequired")?.iter().filter_map(|name| name.as_str());
    let odd = required.filter(|name| !HARMLESS.iter().any(|known| name.starts_with(known)));
    let warning = |name| Warning {
        place: "extensionsRequired".to_owned(),
        text: format!("`{name}` is required but unknown here: its parts stay as they are"),
    };
    Ok(odd.map(warning).collect())
}

/// Images are passed on, not opened: a missing one is the user's to know, no reason to stop.
fn missing_images(document: &Document, base: &Path) -> Result<Vec<Warning>, DocumentError> {
    let mut warnings = Vec::new();
    for (i, image) in document.array("images")?.iter().enumerate() {
        let place = format!("images[{i}]");
        let Some(address) = json::string(image, "uri", &place)? else { continue };
        if uri::form(address) == uri::Form::Data {
            continue;
        }
        let text = match uri::resolve(address, base, &place) {
            Ok(path) if path.is_file() => continue,
            Ok(_) => format!("there is no file `{}`", uri::shorten(address)),
            Err(fault) => fault.problem.to_string(),
        };
        warnings.push(Warning { place, text });
    }
    Ok(warnings)
}

#[cfg(test)]
#[expect(clippy::needless_pass_by_value, reason = "tests read better with `json!` in place")]
mod tests;
