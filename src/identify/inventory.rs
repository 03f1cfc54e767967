//! All distinct sub-meshes of a run, with every place that uses them. Scenes may be added in any order.

use super::Occurrence;
use crate::mesh::hash::MeshHash;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One place where a sub-mesh is used.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Use {
    /// The scene, relative to the input folder.
    pub scene: String,
    /// Index in the scene's `meshes`.
    pub mesh: usize,
    /// Indices into that mesh's primitives.
    pub primitives: Vec<usize>,
    /// Nodes that carry the mesh.
    pub nodes: usize,
    /// How often they draw it.
    pub instances: u64,
}

/// One distinct sub-mesh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Distinct {
    /// Its content.
    pub hash: MeshHash,
    /// Its triangles.
    pub triangles: usize,
    /// Its vertices.
    pub vertices: usize,
    /// Where it is used, by scene and mesh.
    pub uses: Vec<Use>,
}

impl Distinct {
    /// How often it is drawn, over all scenes.
    pub fn instances(&self) -> u64 {
        self.uses.iter().fold(0, |sum, used| sum.saturating_add(used.instances))
    }
}

/// Sums over an [`Inventory`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Totals {
    /// Sub-meshes as they are declared.
    pub declared: usize,
    /// Sub-meshes with different content.
    pub distinct: usize,
    /// Triangles of all declared ones.
    pub triangles_declared: usize,
    /// Triangles of the distinct ones.
    pub triangles_distinct: usize,
    /// How often sub-meshes are drawn.
    pub instances: u64,
}

/// The distinct sub-meshes of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inventory {
    found: BTreeMap<MeshHash, Distinct>,
}

impl Inventory {
    /// Adds what was found in one scene, named by its path relative to the input folder.
    pub fn add(&mut self, scene: &str, occurrences: &[Occurrence]) {
        for occurrence in occurrences {
            let distinct = self.found.entry(occurrence.hash).or_insert_with(|| Distinct {
                hash: occurrence.hash,
                triangles: occurrence.triangles,
                vertices: occurrence.vertices,
                uses: Vec::new(),
            });
            distinct.uses.push(Use {
                scene: scene.to_owned(),
                mesh: occurrence.mesh,
                primitives: occurrence.primitives.clone(),
                nodes: occurrence.nodes,
                instances: occurrence.instances,
            });
        }
    }

    /// All distinct sub-meshes in the order of their first uses, whatever order scenes were added in.
    pub fn distinct(&self) -> Vec<Distinct> {
        let mut all: Vec<Distinct> = self.found.values().cloned().collect();
        for distinct in &mut all {
            distinct.uses.sort_unstable();
        }
        all.sort_by(|a, b| a.uses.first().cmp(&b.uses.first()));
        all
    }

    /// The sub-mesh with that content.
    pub fn get(&self, hash: &MeshHash) -> Option<&Distinct> {
        self.found.get(hash)
    }

    /// Sums.
    pub fn totals(&self) -> Totals {
        let mut totals = Totals { distinct: self.found.len(), ..Totals::default() };
        for distinct in self.found.values() {
            totals.declared += distinct.uses.len();
            totals.triangles_declared += distinct.uses.len() * distinct.triangles;
            totals.triangles_distinct += distinct.triangles;
            totals.instances = totals.instances.saturating_add(distinct.instances());
        }
        totals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn occurrence(mesh: usize, content: u8, triangles: usize) -> Occurrence {
        let hash = MeshHash([content; 32]);
        Occurrence { mesh, primitives: vec![0], hash, triangles, vertices: 3, nodes: 2, instances: 5 }
    }

    #[test]
    fn the_order_of_scenes_does_not_matter() {
        let lamp = [occurrence(0, 9, 10), occurrence(1, 1, 4)];
        let street = [occurrence(0, 1, 4), occurrence(1, 1, 4), occurrence(2, 7, 1)];
        let mut one = Inventory::default();
        one.add("street.gltf", &street);
        one.add("lamp.gltf", &lamp);
        let mut other = Inventory::default();
        other.add("lamp.gltf", &lamp);
        other.add("street.gltf", &street);
        assert_eq!(one.distinct(), other.distinct());
        let order: Vec<u8> = one.distinct().iter().map(|d| d.hash.0[0]).collect();
        assert_eq!(order, [9, 1, 7]);
        let scenes: Vec<&str> = one.distinct()[1]
            .uses
            .iter()
            .map(|u| u.scene.as_str())
            .map(|s| match s {
                "lamp.gltf" => "lamp",
                _ => "street",
            })
            .collect();
        assert_eq!(scenes, ["lamp", "street", "street"]);
        let totals = Totals { declared: 5, distinct: 3, triangles_declared: 23, triangles_distinct: 15, instances: 25 };
        assert_eq!(one.totals(), totals);
        assert_eq!(one.get(&MeshHash([1; 32])).unwrap().instances(), 15);
    }
}
