//! Which meshes a scene really holds: sub-meshes named by their content, and where each is used.
//!
//! A sub-mesh is the smallest group of a mesh's primitives that share border vertices: simplified together, no crack
//! can open between them; apart, each can be found again elsewhere. Does no I/O.

pub mod alike;
pub mod borders;
pub mod instances;
pub mod inventory;
pub mod parts;
mod places;

use crate::gltf::document::{Document, DocumentError};
use crate::gltf::json;
use crate::gltf::scene::{Scene, SourceMesh, SourcePrimitive};
use crate::mesh::hash::{MeshHash, hash};
use crate::mesh::{Mesh, Primitive};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A sub-mesh of one source mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubMesh {
    /// Indices into the source mesh's primitives, ascending.
    pub primitives: Vec<usize>,
    /// Its content.
    pub hash: MeshHash,
}

impl SubMesh {
    /// Its numbers, copied out of the source.
    pub fn mesh(&self, source: &SourceMesh) -> Mesh {
        Mesh { primitives: members(source, &self.primitives).cloned().collect() }
    }
}

fn members<'a>(source: &'a SourceMesh, primitives: &'a [usize]) -> impl Iterator<Item = &'a Primitive> {
    primitives.iter().filter_map(|&i| match source.primitives.get(i) {
        Some(SourcePrimitive::Triangles(primitive)) => Some(primitive),
        _ => None,
    })
}

/// The sub-meshes of a mesh, in the order of their first primitives. Primitives that pass through belong to none.
pub fn sub_meshes(source: &SourceMesh) -> Vec<SubMesh> {
    let (places, primitives): (Vec<usize>, Vec<&Primitive>) = source.triangle_primitives().unzip();
    let groups = borders::groups(&primitives);
    let named = groups.into_iter().map(|group| {
        let hash = hash(group.iter().map(|&i| primitives[i]));
        SubMesh { primitives: group.into_iter().map(|i| places[i]).collect(), hash }
    });
    named.collect()
}

/// Materials of a mesh's sub-meshes, primitive by primitive in their order: what the parts look like, wherever in the
/// mesh they stand and whatever else it has.
pub fn materials(document: &Document, mesh: usize, sub_meshes: &[SubMesh]) -> Vec<Option<usize>> {
    let entry = document.array("meshes").ok().and_then(|meshes| meshes.get(mesh));
    let primitives = entry.and_then(|entry| entry.get("primitives"));
    let material = |&p: &usize| primitives?.get(p)?.get("material").and_then(json::integer).map(|i| i as usize);
    sub_meshes.iter().flat_map(|sub| &sub.primitives).map(material).collect()
}

/// One sub-mesh of one scene, in figures: what an index keeps so that an unchanged scene need not be read again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Occurrence {
    /// Index in the scene's `meshes`.
    pub mesh: usize,
    /// Indices into that mesh's primitives, ascending.
    pub primitives: Vec<usize>,
    /// Content of the sub-mesh.
    pub hash: MeshHash,
    /// Triangles of the sub-mesh.
    pub triangles: usize,
    /// Vertices of the sub-mesh.
    pub vertices: usize,
    /// Nodes of the scene that carry the mesh.
    pub nodes: usize,
    /// How often these nodes draw it: instances of `EXT_mesh_gpu_instancing` count each.
    pub instances: u64,
}

/// All sub-meshes of a scene, by mesh and first primitive.
pub fn survey(scene: &Scene) -> Result<Vec<Occurrence>, DocumentError> {
    let uses = instances::mesh_uses(&scene.document)?;
    let found: Vec<Vec<Occurrence>> = scene
        .meshes
        .par_iter()
        .map(|source| {
            let uses = uses.get(source.index).copied().unwrap_or_default();
            let occurrence = |sub: SubMesh| Occurrence {
                mesh: source.index,
                triangles: members(source, &sub.primitives).map(Primitive::triangles).sum(),
                vertices: members(source, &sub.primitives).map(|p| p.count).sum(),
                primitives: sub.primitives,
                hash: sub.hash,
                nodes: uses.nodes,
                instances: uses.instances,
            };
            sub_meshes(source).into_iter().map(occurrence).collect()
        })
        .collect();
    Ok(found.into_iter().flatten().collect())
}
