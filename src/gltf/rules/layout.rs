//! Where new bytes lie: behind the source's, coarsest level first, every level one range.

use super::group::Group;
use super::{Found, Rule, array, index};
use crate::gltf::document::Document;
use crate::gltf::library;
use serde_json::Value;
use std::collections::BTreeMap;

/// Gaps of up to three bytes align what follows.
const ALIGNMENT: usize = 4;

/// One appended buffer view.
#[derive(Clone, Copy)]
struct Range {
    buffer: usize,
    start: usize,
    end: usize,
}

pub(super) fn check(source: &Document, output: &Document, groups: &[Group], found: &mut Found) {
    let ranges = ranges(source, output, found);
    let ranks = ranks(source, output, groups, found);
    // All levels in one buffer, but for those in files that scenes share: one for each mesh.
    let is_shared = |buffer: usize| {
        let address = array(output, "buffers").get(buffer).and_then(|b| b.get("uri")?.as_str());
        address.is_some_and(|address| address.contains(library::FOLDER))
    };
    let mut sections: BTreeMap<Option<usize>, BTreeMap<usize, Vec<Range>>> = BTreeMap::new();
    for (view, rank) in ranks {
        if let Some(range) = ranges.get(&view) {
            let buffer = Some(range.buffer).filter(|&buffer| is_shared(buffer));
            sections.entry(buffer).or_default().entry(rank).or_default().push(*range);
        }
    }
    for sections in sections.into_values() {
        check_order(sections, found);
    }
    check_accessors(source, output, found);
}

/// Each section, by rank, behind the one before it.
fn check_order(sections: BTreeMap<usize, Vec<Range>>, found: &mut Found) {
    let mut before: Option<Range> = None;
    for (rank, mut section) in sections {
        section.sort_by_key(|range| (range.buffer, range.start));
        for range in section {
            if let Some(before) = before {
                let follows =
                    range.buffer == before.buffer && range.start >= before.end && range.start < before.end + ALIGNMENT;
                let text = format!("bytes {}..{} do not follow the bytes of the coarser level", range.start, range.end);
                found.require(follows, Rule::Layout, format_args!("rank {rank} from the coarsest"), text);
            }
            before = Some(range);
        }
    }
}

/// Appended buffer views, behind everything that the source has in the same buffer.
fn ranges(source: &Document, output: &Document, found: &mut Found) -> BTreeMap<usize, Range> {
    let mut ranges = BTreeMap::new();
    let (old_views, old_buffers) = (array(source, "bufferViews").len(), array(source, "buffers"));
    for (i, view) in array(output, "bufferViews").iter().enumerate().skip(old_views) {
        let place = format!("bufferViews[{i}]");
        let number = |key| index(view, key).unwrap_or(0);
        let buffer = number("buffer");
        let range = Range { buffer, start: number("byteOffset"), end: number("byteOffset") + number("byteLength") };
        let length = array(output, "buffers").get(buffer).and_then(|b| index(b, "byteLength")).unwrap_or(0);
        found.require(range.end <= length, Rule::Layout, &place, "leaves its buffer");
        let taken = old_buffers.get(buffer).and_then(|b| index(b, "byteLength")).unwrap_or(0);
        found.require(range.start >= taken, Rule::Layout, &place, "overlaps bytes of the source");
        found.require(range.start.is_multiple_of(ALIGNMENT), Rule::Layout, &place, "is not aligned to four bytes");
        ranges.insert(i, range);
    }
    ranges
}

/// For each appended buffer view of level geometry the rank of the coarsest level that needs it, 0 for the coarsest
/// of a group.
fn ranks(source: &Document, output: &Document, groups: &[Group], found: &mut Found) -> BTreeMap<usize, usize> {
    let (nodes, accessors) = (array(output, "nodes"), array(output, "accessors"));
    let old_views = array(source, "bufferViews").len();
    let mut ranks = BTreeMap::new();
    for group in groups {
        for (rank, &level) in group.levels.iter().rev().enumerate() {
            let mesh = index(&nodes[level], "mesh").and_then(|mesh| array(output, "meshes").get(mesh));
            for accessor in mesh.map(mesh_accessors).unwrap_or_default() {
                let Some(entry) = accessors.get(accessor) else {
                    let text = format!("accessor {accessor} does not exist");
                    found.add(Rule::Layout, format_args!("nodes[{level}].mesh"), text);
                    continue;
                };
                if let Some(view) = index(entry, "bufferView").filter(|&view| view >= old_views) {
                    let known = ranks.entry(view).or_insert(rank);
                    *known = rank.min(*known);
                }
            }
        }
    }
    ranks
}

/// All accessors of a mesh.
fn mesh_accessors(mesh: &Value) -> Vec<usize> {
    let mut all = Vec::new();
    for primitive in mesh["primitives"].as_array().into_iter().flatten() {
        all.extend(index(primitive, "indices"));
        let targets = primitive["targets"].as_array().into_iter().flatten();
        for attributes in std::iter::once(&primitive["attributes"]).chain(targets) {
            let entries = attributes.as_object().into_iter().flat_map(|map| map.keys());
            all.extend(entries.filter_map(|name| index(attributes, name)));
        }
    }
    all
}

/// Appended accessors stay inside their views.
fn check_accessors(source: &Document, output: &Document, found: &mut Found) {
    let old = array(source, "accessors").len();
    for (i, accessor) in array(output, "accessors").iter().enumerate().skip(old) {
        let place = format!("accessors[{i}]");
        let Some(view) = index(accessor, "bufferView").and_then(|view| array(output, "bufferViews").get(view)) else {
            found.add(Rule::Layout, place, "has no buffer view");
            continue;
        };
        let components = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4" | "MAT2") => 4,
            Some("MAT3") => 9,
            _ => 16,
        };
        let size = match index(accessor, "componentType") {
            Some(5120 | 5121) => 1,
            Some(5122 | 5123) => 2,
            _ => 4,
        };
        let element = components * size;
        let stride = index(view, "byteStride").unwrap_or(element);
        let count = index(accessor, "count").unwrap_or(0);
        let offset = index(accessor, "byteOffset").unwrap_or(0);
        let end = offset + count.saturating_sub(1) * stride + element;
        let fits = count > 0 && end <= index(view, "byteLength").unwrap_or(0);
        found.require(fits, Rule::Layout, &place, "leaves its buffer view");
        found.require(stride >= element, Rule::Layout, &place, "its elements overlap");
    }
}
