//! Drawables of scenes: a whole scene with its instances, one mesh of it, or a level of its `MSFT_lod` groups.
//!
//! Points, lines and what else has no triangles is not drawn. Skins stand as their joints' nodes do, morph targets are
//! at rest, animations do not run.

use super::drawable::{Drawable, Instance, Part};
use super::looks::Looks;
use super::skin;
use crate::gltf::document::DocumentError;
use crate::gltf::json;
use crate::gltf::lod::MSFT_LOD;
use crate::gltf::places::{self, list, local};
use crate::gltf::scene::{Scene, SourceMesh, SourcePrimitive};
use crate::gltf::views::Views;
use crate::mesh::{LevelPrimitive, Primitive};
use glam::DMat4;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// The materials of a scene with their textures. Relative addresses start at `base`, the scene's folder.
pub fn looks(scene: &Scene, base: &Path) -> Arc<Looks> {
    let meshes = scene.document.array("meshes").unwrap_or_default();
    let primitives = meshes.iter().filter_map(|m| m.get("primitives")?.as_array()).flatten();
    let used: BTreeSet<usize> = primitives.filter_map(|p| Some(json::integer(p.get("material")?)? as usize)).collect();
    Arc::new(Looks::load(&scene.document, &scene.buffers, base, Some(&used)))
}

/// The default scene (the first, if none is; all root nodes, if there is no scene; all meshes, if there is no node).
///
/// `level` chooses from `MSFT_lod` groups: 0 the node itself, k the k-th of its levels, the coarsest where there are
/// fewer. A level stands where the node it replaces stood, with its own transform and children.
pub fn scene(scene: &Scene, looks: Arc<Looks>, level: usize) -> Result<Drawable, DocumentError> {
    let mut walk = Walk::new(scene, Arc::clone(&looks), level)?;
    walk.nodes()?;
    Ok(Drawable { parts: walk.parts, instances: walk.instances, looks })
}

/// One mesh in its own space.
pub fn mesh(scene: &Scene, looks: Arc<Looks>, mesh: usize) -> Drawable {
    let parts = scene.meshes.get(mesh).map_or_else(Vec::new, |source| {
        source.triangle_primitives().map(|(i, p)| Arc::new(Part::new(p, material(scene, &looks, mesh, i)))).collect()
    });
    Drawable::of_parts(parts, looks)
}

/// One mesh at a level that was just made, in its own space. `levels` holds one for each triangle primitive of the
/// mesh, in order; `None` is the source's. Parts of `source`, the drawable of the mesh itself, are shared.
pub fn mesh_level(scene: &Scene, source: &Drawable, mesh: usize, levels: &[Option<&LevelPrimitive>]) -> Drawable {
    let primitives = scene.meshes.get(mesh).into_iter().flat_map(SourceMesh::triangle_primitives);
    let parts = primitives.zip(&source.parts).zip(levels).map(|(((_, primitive), part), level)| match level {
        None => Arc::clone(part),
        Some(level) => Arc::new(Part::of_level(primitive, level, part.material)),
    });
    Drawable::of_parts(parts.collect(), Arc::clone(&source.looks))
}

/// The material of a primitive, as a number in [`Looks::materials`].
pub fn material(scene: &Scene, looks: &Looks, mesh: usize, primitive: usize) -> usize {
    let value = scene.document.array("meshes").ok().and_then(|m| m.get(mesh)?.get("primitives")?.get(primitive));
    looks.material(value.and_then(|p| Some(json::integer(p.get("material")?)? as usize)))
}

/// Walks over nodes and collects what they draw.
struct Walk<'a> {
    scene: &'a Scene,
    looks: Arc<Looks>,
    views: Views<'a>,
    nodes: &'a [Value],
    level: usize,
    parts: Vec<Arc<Part>>,
    instances: Vec<Instance>,
    /// Parts of each mesh that was met: index in `parts`.
    met: BTreeMap<usize, Vec<usize>>,
}

impl<'a> Walk<'a> {
    fn new(scene: &'a Scene, looks: Arc<Looks>, level: usize) -> Result<Self, DocumentError> {
        let views = Views::new(&scene.document, &scene.buffers)?;
        let nodes = scene.document.array("nodes")?;
        let (parts, instances, met) = (Vec::new(), Vec::new(), BTreeMap::new());
        Ok(Self { scene, looks, views, nodes, level, parts, instances, met })
    }

    fn nodes(&mut self) -> Result<(), DocumentError> {
        if self.nodes.is_empty() {
            for mesh in 0..self.scene.meshes.len() {
                self.place(mesh, DMat4::IDENTITY, None)?;
            }
            return Ok(());
        }
        // The last is visited first: roots and children are put on in reverse.
        let mut open: Vec<(usize, DMat4)> = self.roots()?.into_iter().rev().map(|n| (n, DMat4::IDENTITY)).collect();
        while let Some((number, parent)) = open.pop() {
            let number = self.replaced(number)?;
            let Some(node) = self.nodes.get(number) else { continue };
            if json::extension(node, "KHR_node_visibility").and_then(|v| v.get("visible")) == Some(&Value::Bool(false))
            {
                continue;
            }
            let transform = parent * local(node);
            if let Some(mesh) = json::index(node, "mesh", format_args!("nodes[{number}]"))? {
                let skin = json::index(node, "skin", format_args!("nodes[{number}]"))?;
                for instance in places::instances(&self.scene.document, &self.views, number)? {
                    self.place(mesh, transform * instance, skin)?;
                }
            }
            open.extend(list(node, "children").into_iter().rev().map(|child| (child, transform)));
        }
        Ok(())
    }

    fn roots(&self) -> Result<Vec<usize>, DocumentError> {
        let document = &self.scene.document;
        let scenes = document.array("scenes")?;
        let default = json::index(&document.json, "scene", "")?.unwrap_or(0);
        if let Some(scene) = scenes.get(default) {
            return Ok(list(scene, "nodes"));
        }
        let mut inner: BTreeSet<usize> = self.nodes.iter().flat_map(|node| list(node, "children")).collect();
        inner.extend(self.nodes.iter().filter_map(|n| json::extension(n, MSFT_LOD)).flat_map(|e| list(e, "ids")));
        Ok((0..self.nodes.len()).filter(|node| !inner.contains(node)).collect())
    }

    /// The node that stands for `number` at the level asked for.
    fn replaced(&self, number: usize) -> Result<usize, DocumentError> {
        let group = self.nodes.get(number).and_then(|node| json::extension(node, MSFT_LOD));
        let ids = group.map_or_else(Vec::new, |group| list(group, "ids"));
        let Some(at) = self.level.min(ids.len()).checked_sub(1) else { return Ok(number) };
        if ids[at] < self.nodes.len() {
            return Ok(ids[at]);
        }
        let words = format!("level {} is node {}, which does not exist", at + 1, ids[at]);
        Err(DocumentError::invalid(format!("nodes[{number}].extensions.{MSFT_LOD}"), words))
    }

    fn place(&mut self, mesh: usize, transform: DMat4, skin: Option<usize>) -> Result<(), DocumentError> {
        let (parts, transform) = match skin {
            // A skinned mesh stands where its joints are; its node's transform does not count.
            Some(skin) => (self.skinned(mesh, skin)?, DMat4::IDENTITY),
            None => (self.rigid(mesh), transform),
        };
        self.instances.extend(parts.into_iter().map(|part| Instance { part, transform }));
        Ok(())
    }

    fn rigid(&mut self, mesh: usize) -> Vec<usize> {
        if let Some(parts) = self.met.get(&mesh) {
            return parts.clone();
        }
        let parts: Vec<usize> =
            self.primitives(mesh).into_iter().map(|(p, material)| self.push(Part::new(p, material))).collect();
        self.met.insert(mesh, parts.clone());
        parts
    }

    fn skinned(&mut self, mesh: usize, skin: usize) -> Result<Vec<usize>, DocumentError> {
        let joints = places::joints(&self.scene.document, &self.views, skin)?;
        let primitives = self.primitives(mesh);
        Ok(primitives.into_iter().map(|(p, material)| self.push(skin::pose(p, &joints, material))).collect())
    }

    fn primitives(&self, mesh: usize) -> Vec<(&'a Primitive, usize)> {
        let scene: &'a Scene = self.scene;
        let Some(source) = scene.meshes.get(mesh) else { return Vec::new() };
        let primitives = source.primitives.iter().enumerate().filter_map(|(i, p)| match p {
            SourcePrimitive::Triangles(primitive) => Some((primitive, material(scene, &self.looks, mesh, i))),
            SourcePrimitive::PassThrough { .. } => None,
        });
        primitives.collect()
    }

    fn push(&mut self, part: Part) -> usize {
        self.parts.push(Arc::new(part));
        self.parts.len() - 1
    }
}
