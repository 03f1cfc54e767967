//! Which primitives number the same vertices: those that share an accessor, directly or through others.

use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use crate::gltf::share::{index, names};
use crate::mesh::sets::Sets;
use std::collections::{BTreeMap, BTreeSet};

/// Accessors with the same numbers of vertices, and who uses them.
#[derive(Debug, Default)]
pub(super) struct Domain {
    /// Mesh and primitive, ascending.
    pub(super) users: Vec<(usize, usize)>,
    /// Of their attributes.
    pub(super) accessors: BTreeSet<usize>,
}

/// All domains of a document.
pub(super) struct Domains(Vec<Domain>);

impl Domains {
    pub(super) fn new(document: &Document) -> Result<Self, DocumentError> {
        let accessors = document.array("accessors")?.len();
        let mut sets = Sets::new(accessors);
        let mut first: Vec<((usize, usize), usize)> = Vec::new();
        for (mesh, entry) in document.array("meshes")?.iter().enumerate() {
            let place = format!("meshes[{mesh}]");
            for (i, primitive) in json::array(entry, "primitives", &place)?.iter().enumerate() {
                let attributes = primitive.get("attributes");
                let mut own = names(attributes).filter_map(|name| index(attributes?, name));
                let Some(one) = own.next() else { continue };
                first.push(((mesh, i), one));
                for other in own {
                    sets.join(one, other);
                }
            }
        }
        let mut domains: BTreeMap<usize, Domain> = BTreeMap::new();
        for (user, accessor) in first {
            domains.entry(sets.root(accessor)).or_default().users.push(user);
        }
        for accessor in 0..accessors {
            if let Some(domain) = domains.get_mut(&sets.root(accessor)) {
                domain.accessors.insert(accessor);
            }
        }
        Ok(Self(domains.into_values().collect()))
    }

    pub(super) fn all(&self) -> &[Domain] {
        &self.0
    }
}
