//! Which nodes of a document get levels: those that show a mesh with levels, but for groups that the source brings along.

use super::document::Document;
use super::error::DocumentError;
use super::json;
use super::lod::MSFT_LOD;
use super::notes::Notes;
use serde_json::Value;
use std::collections::BTreeSet;

/// The nodes that get levels.
pub(super) struct Anchors {
    /// Node and its mesh.
    pub(super) nodes: Vec<(usize, usize)>,
    /// Meshes that are lower levels of groups in the source. A reader may drop such a mesh when a finer level has
    /// arrived, so it must not be level 0 of anything else.
    pub(super) lower_levels: BTreeSet<usize>,
}

impl Anchors {
    /// `meshes` are those with levels.
    pub(super) fn find(
        document: &Document,
        meshes: &BTreeSet<usize>,
        notes: &mut Notes,
    ) -> Result<Self, DocumentError> {
        let nodes = document.array("nodes")?;
        let existing = SourceGroups::find(nodes);
        let mut anchors = Self { nodes: Vec::new(), lower_levels: BTreeSet::new() };
        let mut used = BTreeSet::new();
        for (i, node) in nodes.iter().enumerate() {
            let Some(mesh) = json::index(node, "mesh", format_args!("nodes[{i}]"))? else { continue };
            json::array(node, "children", format_args!("nodes[{i}]"))?;
            if existing.lower.contains(&i) {
                anchors.lower_levels.insert(mesh);
            }
            if !meshes.contains(&mesh) {
                continue;
            }
            used.insert(mesh);
            if existing.members.contains(&i) {
                notes.add(format_args!("nodes[{i}]"), "the source has levels here, which stay as they are");
            } else {
                anchors.nodes.push((i, mesh));
            }
        }
        for mesh in meshes.iter().filter(|mesh| !used.contains(mesh)) {
            notes.add(format_args!("meshes[{mesh}]"), "no node uses this mesh, so it gets no levels");
        }
        Ok(anchors)
    }
}

/// `MSFT_lod` groups that the source brings along.
pub(super) struct SourceGroups {
    /// Nodes of all their levels, with everything below them.
    pub(super) members: BTreeSet<usize>,
    /// Those of level 1 and lower.
    lower: BTreeSet<usize>,
}

impl SourceGroups {
    pub(super) fn find(nodes: &[Value]) -> Self {
        let mut groups = Self { members: BTreeSet::new(), lower: BTreeSet::new() };
        for (i, node) in nodes.iter().enumerate() {
            let Some(lod) = json::extension(node, MSFT_LOD) else { continue };
            collect_below(nodes, i, &mut groups.members);
            for id in indices(lod.get("ids")) {
                collect_below(nodes, id, &mut groups.lower);
            }
        }
        groups.members.extend(&groups.lower);
        groups
    }
}

fn collect_below(nodes: &[Value], root: usize, found: &mut BTreeSet<usize>) {
    let mut open = vec![root];
    while let Some(node) = open.pop() {
        if node < nodes.len() && found.insert(node) {
            open.extend(indices(nodes[node].get("children")));
        }
    }
}

fn indices(list: Option<&Value>) -> impl Iterator<Item = usize> {
    list.and_then(Value::as_array).into_iter().flatten().filter_map(|v| json::integer(v).map(|i| i as usize))
}
