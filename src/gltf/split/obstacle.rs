//! What may be taken apart: primitives of which it is known what every vertex and every triangle is for.

use super::domains::Domains;
use crate::gltf::decode::{draco, meshopt};
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use crate::gltf::share::{Sharing, VARIANTS, index, names, other_accessors};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Why a primitive stays whole.
pub type Obstacle = &'static str;

/// Which primitives of a document may be taken apart, what they look like, and how many nodes show them.
pub struct Splitting {
    /// By mesh and primitive: the number of what it looks like.
    looks: Vec<Vec<Result<usize, Obstacle>>>,
    /// By mesh.
    shown: Vec<u64>,
}

impl Splitting {
    /// Looks at all meshes. `is_read`: the triangles of a primitive of a mesh were read, so all that it refers to is there. `scales`: parts
    /// may be shown larger or smaller.
    pub fn new(
        document: &Document,
        is_read: &dyn Fn(usize, usize) -> bool,
        scales: bool,
    ) -> Result<Self, DocumentError> {
        let sharing = Sharing::new(document)?;
        let meshes = document.array("meshes")?;
        let mut others = other_accessors(document)?;
        others.extend(meshes.iter().flat_map(primitives).filter_map(|primitive| index(primitive, "indices")));
        let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
        let mut looks: Vec<Vec<Result<usize, Obstacle>>> = Vec::with_capacity(meshes.len());
        for (i, mesh) in meshes.iter().enumerate() {
            let whole = of_mesh(&sharing, i);
            let look = |(number, primitive)| {
                let unread = || (!is_read(i, number)).then_some("it is no list of triangles");
                let own = || unread().or_else(|| of_primitive(document, primitive, &others, scales));
                if let Some(why) = whole.or_else(own) {
                    return Err(why);
                }
                let next = numbers.len();
                Ok(*numbers.entry(appearance(primitive)).or_insert(next))
            };
            looks.push(primitives(mesh).enumerate().map(look).collect());
        }
        for domain in Domains::new(document)?.all() {
            if domain.users.iter().any(|&(mesh, primitive)| looks[mesh][primitive].is_err()) {
                for &(mesh, primitive) in &domain.users {
                    if looks[mesh][primitive].is_ok() {
                        looks[mesh][primitive] = Err("something that stays whole has the same vertices");
                    }
                }
            }
        }
        let shown = (0..meshes.len()).map(|mesh| sharing.nodes(mesh).len() as u64).collect();
        Ok(Self { looks, shown })
    }

    /// A number for what a primitive looks like, the same for those that look the same; or why it stays whole.
    pub fn looks(&self, mesh: usize, primitive: usize) -> Result<usize, Obstacle> {
        self.looks.get(mesh).and_then(|all| all.get(primitive)).copied().unwrap_or(Err("it is not in the document"))
    }

    /// Nodes that show a mesh.
    pub fn shown(&self, mesh: usize) -> u64 {
        self.shown.get(mesh).copied().unwrap_or(0)
    }
}

fn primitives(mesh: &Value) -> impl Iterator<Item = &Value> {
    mesh.get("primitives").and_then(Value::as_array).into_iter().flatten()
}

fn of_mesh(sharing: &Sharing<'_>, mesh: usize) -> Option<Obstacle> {
    if sharing.is_eligible(mesh) {
        sharing.fixed(mesh)
    } else {
        Some("its mesh is a level, or has members that are not known here")
    }
}

fn of_primitive(document: &Document, primitive: &Value, others: &BTreeSet<usize>, scales: bool) -> Option<Obstacle> {
    if primitive.get("mode").is_some_and(|mode| json::integer(mode) != Some(4)) {
        return Some("it is no list of triangles");
    }
    if json::extension(primitive, draco::EXTENSION).is_some() {
        return Some("it is compressed");
    }
    let attributes = primitive.get("attributes");
    let own: Vec<usize> = names(attributes).filter_map(|name| index(attributes?, name)).collect();
    if own.iter().any(|accessor| others.contains(accessor)) {
        return Some("its vertices serve something else, too");
    }
    let mut all = own.iter().copied().chain(index(primitive, "indices"));
    if let Some(why) = all.find_map(|accessor| of_accessor(document, accessor)) {
        return Some(why);
    }
    materials(primitive).find_map(|material| {
        let material = document.array("materials").ok()?.get(material)?;
        if material.get("alphaMode").and_then(Value::as_str) == Some("BLEND") {
            Some("it is transparent, and its triangles are drawn in their order")
        } else if scales && json::extension(material, "KHR_materials_volume").is_some() {
            Some("a scale would change the thickness of its material")
        } else {
            None
        }
    })
}

/// Materials of all variants.
fn materials(primitive: &Value) -> impl Iterator<Item = usize> {
    let mappings = json::extension(primitive, VARIANTS).and_then(|e| e.get("mappings")?.as_array());
    index(primitive, "material")
        .into_iter()
        .chain(mappings.into_iter().flatten().filter_map(|mapping| index(mapping, "material")))
}

fn of_accessor(document: &Document, accessor: usize) -> Option<Obstacle> {
    let accessor = document.array("accessors").ok()?.get(accessor)?;
    let Some(view) = index(accessor, "bufferView").filter(|_| accessor.get("sparse").is_none()) else {
        return Some("its vertices are stored sparsely");
    };
    if accessor.get("type").and_then(Value::as_str).is_none_or(|kind| kind.starts_with("MAT")) {
        return Some("an attribute of it is a matrix");
    }
    let view = document.array("bufferViews").ok()?.get(view)?;
    let is_packed = meshopt::EXTENSIONS.iter().any(|name| json::extension(view, name).is_some());
    is_packed.then_some("it is compressed")
}

/// Everything but the geometry.
fn appearance(primitive: &Value) -> String {
    let members = names(Some(primitive)).filter(|key| !["attributes", "indices", "mode"].contains(key));
    let mut members: Vec<String> = members.map(|key| format!("{key}:{}", primitive[key])).collect();
    members.sort_unstable();
    members.join(",")
}
