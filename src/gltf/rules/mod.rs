//! A second opinion on written documents: are levels in the one form that all readers agree on, and is nothing lost?
//!
//! Compares an output with its source, knowing only the two documents and the rules, not how the writer works. The
//! official validator checks neither `MSFT_lod` nor `EXT_mesh_gpu_instancing`, hence this one.

mod drives;
mod group;
mod kept;
mod layout;
mod roles;

use super::document::Document;
use drives::Drives;
use group::Group;
use serde_json::Value;

/// The rules, by the numbers under which they are documented.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// Everything in the source is in the output, at the same index, with the same value.
    NothingLost = 0,
    /// Transforms live on the anchor; its child and the levels have none.
    Transforms = 1,
    /// Skin, weights, their animations and material variants go where the mesh goes and drive every level.
    Follow = 2,
    /// A level node belongs to one group and to nothing else; a mesh is one level of one mesh.
    Roles = 3,
    /// `MSFT_screencoverage` has one number more than levels, strictly decreasing, ending in 0.
    Coverage = 4,
    /// `MSFT_lod` is in `extensionsUsed` and not in `extensionsRequired`.
    Declared = 5,
    /// New bytes behind the source's, the coarsest level first, each level one range.
    Layout = 6,
    /// Every node that shows a mesh is an anchor of its own.
    OwnAnchor = 10,
    /// Every level of an instanced node draws the same instances.
    Instances = 11,
    /// Instances have translation, rotation and scale as plain floats in buffer views of their own.
    InstanceData = 13,
    /// Instancing that exists only in the extension is declared.
    InstancingDeclared = 14,
}

/// One breach of a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Which rule.
    pub rule: Rule,
    /// JSON place in the output.
    pub place: String,
    /// What is wrong there.
    pub text: String,
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {} (rule {})", self.place, self.text, self.rule as u8)
    }
}

/// Checks `output`, which was made from `source`. No violation: an empty list.
pub fn check(source: &Document, output: &Document) -> Vec<Violation> {
    let mut found = Found(Vec::new());
    let groups = Group::find_all(source, output, &mut found);
    kept::check(source, output, &groups, &mut found);
    let drives = Drives::new(output);
    for group in &groups {
        group.check(source, output, &drives, &mut found);
    }
    roles::check(source, output, &groups, &mut found);
    layout::check(source, output, &groups, &mut found);
    found.0
}

/// Violations so far.
struct Found(Vec<Violation>);

impl Found {
    fn add(&mut self, rule: Rule, place: impl std::fmt::Display, text: impl Into<String>) {
        self.0.push(Violation { rule, place: place.to_string(), text: text.into() });
    }

    fn require(&mut self, holds: bool, rule: Rule, place: impl std::fmt::Display, text: impl Into<String>) {
        if !holds {
            self.add(rule, place, text);
        }
    }
}

/// The array `name` of a document, empty if there is none.
fn array<'d>(document: &'d Document, name: &str) -> &'d [Value] {
    document.array(name).unwrap_or_default()
}

/// The list of indices `key` of an object, empty if there is none.
fn indices(value: &Value, key: &str) -> Vec<usize> {
    let list = value.get(key).and_then(Value::as_array);
    list.into_iter().flatten().filter_map(|v| super::json::integer(v).map(|i| i as usize)).collect()
}

/// The index `key` of an object.
fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key).and_then(super::json::integer).map(|i| i as usize)
}

#[cfg(test)]
mod tests;
