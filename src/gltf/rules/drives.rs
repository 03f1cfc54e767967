//! Which animation channels drive which node, looked up by node.

use super::group::{MESH_EXTENSIONS, MESH_KEYS};
use super::{array, index};
use crate::gltf::document::Document;
use serde_json::Value;
use std::collections::BTreeMap;

/// One channel that drives a property of a node.
pub(super) struct Drive<'d> {
    pub(super) animation: usize,
    channel: usize,
    pub(super) sampler: Option<usize>,
    /// Below the node: `rotation`, `weights/0`, `extensions/KHR_node_visibility/visible`.
    pub(super) property: &'d str,
}

impl Drive<'_> {
    pub(super) fn place(&self) -> String {
        format!("animations[{}].channels[{}]", self.animation, self.channel)
    }

    /// The property is of the mesh that the node shows.
    pub(super) fn is_of_mesh(&self) -> bool {
        self.property.split('/').next().is_some_and(|key| MESH_KEYS.contains(&key))
    }

    /// The property is one that a child or a level may have.
    pub(super) fn goes_with_mesh(&self) -> bool {
        let extension = self.property.strip_prefix("extensions/").and_then(|rest| rest.split('/').next());
        self.is_of_mesh() || extension.is_some_and(|name| MESH_EXTENSIONS.contains(&name))
    }
}

/// All channels of a document that drive nodes.
pub(super) struct Drives<'d>(BTreeMap<usize, Vec<Drive<'d>>>);

impl<'d> Drives<'d> {
    pub(super) fn new(document: &'d Document) -> Self {
        let mut drives: BTreeMap<usize, Vec<Drive<'d>>> = BTreeMap::new();
        for (animation, entry) in array(document, "animations").iter().enumerate() {
            let channels = entry.get("channels").and_then(Value::as_array);
            for (number, channel) in channels.into_iter().flatten().enumerate() {
                let Some((node, property)) = target(channel) else { continue };
                let drive = Drive { animation, channel: number, sampler: index(channel, "sampler"), property };
                drives.entry(node).or_default().push(drive);
            }
        }
        Self(drives)
    }

    pub(super) fn of(&self, node: usize) -> &[Drive<'d>] {
        self.0.get(&node).map_or(&[], Vec::as_slice)
    }
}

/// Node and property that a channel drives: `(3, "weights")`.
fn target(channel: &Value) -> Option<(usize, &str)> {
    let target = channel.get("target")?;
    if let Some(pointer) = target.pointer("/extensions/KHR_animation_pointer/pointer").and_then(Value::as_str) {
        let (node, property) = pointer.strip_prefix("/nodes/")?.split_once('/')?;
        return Some((node.parse().ok()?, property));
    }
    Some((index(target, "node")?, target.get("path")?.as_str()?))
}
