//! What is in one scene, and what a bake would do with it. Nothing is simplified: levels are estimates.

mod structure;
mod table;

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

pub use structure::Structure;

use crate::config::defaults;
use crate::gltf::document::{Document, DocumentError};
use crate::gltf::json;
use crate::gltf::scene::{Scene, SourceMesh, SourcePrimitive};
use crate::identify::Occurrence;
use crate::identify::instances::mesh_uses;
use crate::mesh::ComponentType;
use crate::mesh::hash::MeshHash;
use structure::array;

/// One scene file.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Inspection {
    /// As the user named it.
    pub file: String,
    /// Bytes of the file and of its external buffers; images are not counted.
    pub bytes: u64,
    /// What it declares.
    pub structure: Structure,
    /// Triangles of all meshes, each mesh once.
    pub triangles: u64,
    /// Triangles of all meshes, as often as they are drawn.
    pub triangles_drawn: u64,
    /// Its meshes, in order.
    pub meshes: Vec<InspectedMesh>,
    /// Its distinct sub-meshes, by hash.
    pub distinct: Vec<DistinctPiece>,
    /// What a bake would do.
    pub bake: Estimate,
    /// What is odd about the file.
    pub warnings: Vec<String>,
}

/// One mesh.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct InspectedMesh {
    /// Index in `meshes`.
    pub index: u64,
    /// Its name in the file.
    pub name: Option<String>,
    /// Times it is drawn: nodes, and instances of `EXT_mesh_gpu_instancing`.
    pub instances: u64,
    /// Triangles.
    pub triangles: u64,
    /// Vertices.
    pub vertices: u64,
    /// Its sub-meshes.
    pub pieces: Vec<Piece>,
    /// Why primitives get no levels: `lines`, `no POSITION`, …
    pub left_alone: Vec<String>,
}

/// A sub-mesh: the smallest group of a mesh's primitives that share border vertices.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Piece {
    /// Content hash, 64 hexadecimal digits.
    #[schemars(with = "String")]
    pub hash: MeshHash,
    /// Indices in the mesh's `primitives`.
    pub primitives: Vec<usize>,
    /// Triangles.
    pub triangles: u64,
}

/// A distinct sub-mesh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct DistinctPiece {
    /// Content hash, 64 hexadecimal digits.
    #[schemars(with = "String")]
    pub hash: MeshHash,
    /// Triangles.
    pub triangles: u64,
    /// Times it is declared.
    pub uses: u64,
    /// Times it is drawn.
    pub instances: u64,
}

/// What a bake with default settings would do.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Estimate {
    /// Sub-meshes that would be simplified, each once.
    pub jobs: u64,
    /// Sub-meshes that would be left alone, having fewer triangles than this.
    pub min_triangles: u64,
    /// Bytes of buffers, decoded, that hold a sub-mesh which other bytes of the file already hold.
    pub duplicate_bytes: u64,
    /// Triangles at the default levels, if each reaches its target.
    pub levels: Vec<EstimatedLevel>,
}

/// One default level.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct EstimatedLevel {
    /// Share of the source's triangles, 0 to 1.
    pub ratio: f64,
    /// Triangles of all meshes, each mesh once.
    pub triangles: u64,
    /// Triangles of all meshes, as often as they are drawn.
    pub triangles_drawn: u64,
}

impl Inspection {
    /// Looks at a scene of which `found` are the sub-meshes; `bytes` is the size of its files.
    pub fn new(file: String, bytes: u64, scene: &Scene, found: &[Occurrence]) -> Result<Self, DocumentError> {
        let uses = mesh_uses(&scene.document)?;
        let meshes: Vec<InspectedMesh> = scene
            .meshes
            .iter()
            .map(|mesh| {
                let instances = uses.get(mesh.index).map_or(0, |used| used.instances);
                inspected(mesh, instances, found.iter().filter(|piece| piece.mesh == mesh.index))
            })
            .collect();
        Ok(Self {
            file,
            bytes,
            structure: Structure::of(&scene.document),
            triangles: meshes.iter().map(|mesh| mesh.triangles).sum(),
            triangles_drawn: meshes
                .iter()
                .map(|mesh| mesh.triangles.saturating_mul(mesh.instances))
                .fold(0, u64::saturating_add),
            distinct: distinct(&meshes),
            bake: estimate(&scene.document, &meshes),
            warnings: scene.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect(),
            meshes,
        })
    }

    /// For people, at most 80 columns where names allow.
    pub fn to_text(&self) -> String {
        table::text(self)
    }
}

fn inspected<'a>(mesh: &SourceMesh, instances: u64, found: impl Iterator<Item = &'a Occurrence>) -> InspectedMesh {
    let reasons = mesh.primitives.iter().filter_map(|primitive| match primitive {
        SourcePrimitive::PassThrough { reason } => Some(reason.clone()),
        SourcePrimitive::Triangles(_) => None,
    });
    let piece = |found: &Occurrence| Piece {
        hash: found.hash,
        primitives: found.primitives.clone(),
        triangles: found.triangles as u64,
    };
    InspectedMesh {
        index: mesh.index as u64,
        name: mesh.name.clone(),
        instances,
        triangles: mesh.triangles() as u64,
        vertices: mesh.triangle_primitives().map(|(_, primitive)| primitive.count as u64).sum(),
        pieces: found.map(piece).collect(),
        left_alone: reasons.collect(),
    }
}

/// Each sub-mesh with the mesh it is part of.
fn pieces(meshes: &[InspectedMesh]) -> impl Iterator<Item = (&InspectedMesh, &Piece)> {
    meshes.iter().flat_map(|mesh| mesh.pieces.iter().map(move |piece| (mesh, piece)))
}

fn distinct(meshes: &[InspectedMesh]) -> Vec<DistinctPiece> {
    let mut found: BTreeMap<MeshHash, DistinctPiece> = BTreeMap::new();
    for (mesh, piece) in pieces(meshes) {
        let (hash, triangles) = (piece.hash, piece.triangles);
        let entry = found.entry(hash).or_insert(DistinctPiece { hash, triangles, uses: 0, instances: 0 });
        entry.uses += 1;
        entry.instances = entry.instances.saturating_add(mesh.instances);
    }
    found.into_values().collect()
}

fn estimate(document: &Document, meshes: &[InspectedMesh]) -> Estimate {
    let min_triangles = u64::from(defaults::MIN_TRIANGLES);
    let jobs: BTreeSet<MeshHash> =
        pieces(meshes).filter(|(_, p)| p.triangles >= min_triangles).map(|(_, p)| p.hash).collect();
    let level = |ratio: f64| {
        let at = |piece: &Piece| match piece.triangles {
            few if few < min_triangles => few,
            many => (many as f64 * ratio).round() as u64,
        };
        let drawn = pieces(meshes).map(|(mesh, piece)| at(piece).saturating_mul(mesh.instances));
        EstimatedLevel {
            ratio,
            triangles: pieces(meshes).map(|(_, piece)| at(piece)).sum(),
            triangles_drawn: drawn.fold(0, u64::saturating_add),
        }
    };
    Estimate {
        jobs: jobs.len() as u64,
        min_triangles,
        duplicate_bytes: duplicate_bytes(document, meshes),
        levels: defaults::RATIOS.map(level).to_vec(),
    }
}

/// Bytes of the accessors that a second, third, … declaration of an equal sub-mesh has for itself.
fn duplicate_bytes(document: &Document, meshes: &[InspectedMesh]) -> u64 {
    let mut known = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut bytes = 0;
    for (mesh, piece) in pieces(meshes) {
        let copy = !known.insert(piece.hash);
        for accessor in accessors(document, mesh.index, &piece.primitives) {
            if seen.insert(accessor) && copy {
                bytes += accessor_bytes(document, accessor);
            }
        }
    }
    bytes
}

/// The accessors of some primitives of a mesh: attributes, morph targets and indices.
fn accessors(document: &Document, mesh: u64, primitives: &[usize]) -> BTreeSet<u64> {
    let declared = array(&document.json, "meshes").get(mesh as usize).map_or(&[][..], |m| array(m, "primitives"));
    let mut found = BTreeSet::new();
    for primitive in primitives.iter().filter_map(|&i| declared.get(i)) {
        let attributes = primitive.get("attributes").into_iter().chain(array(primitive, "targets"));
        let attributes = attributes.filter_map(Value::as_object).flat_map(|named| named.values());
        found.extend(attributes.chain(primitive.get("indices")).filter_map(json::integer));
    }
    found
}

/// Decoded size of an accessor; 0 where it says too little about itself.
fn accessor_bytes(document: &Document, index: u64) -> u64 {
    let size = || {
        let accessor = array(&document.json, "accessors").get(usize::try_from(index).ok()?)?;
        let component = ComponentType::from_gltf(json::integer(accessor.get("componentType")?)?)?;
        let components = match accessor.get("type")?.as_str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => return None,
        };
        json::integer(accessor.get("count")?)?.checked_mul(components * component.size() as u64)
    };
    size().unwrap_or(0)
}

/// The JSON schema of an inspection.
pub fn schema() -> Value {
    schemars::schema_for!(Inspection).to_value()
}

#[cfg(test)]
mod tests;
