//! Takes bytes out of buffers that no buffer view and no accessor needs any more, and moves the rest together.
//!
//! Only bytes of views that lost a user go; whatever else a buffer holds stays, in its order. Cuts are multiples of
//! eight bytes, so that everything stays as aligned as it was. Knows nothing of meshes.

use crate::gltf::accessor::Accessor;
use crate::gltf::buffers::Buffers;
use crate::gltf::decode::meshopt;
use crate::gltf::document::Document;
use crate::gltf::error::DocumentError;
use crate::gltf::json;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Every cut is a multiple of it.
const GRAIN: usize = 8;

/// Drops what nothing needs. `touched` are views that lost a user, each with a view that can stand for it. Buffers that
/// were files and have changed have no address afterwards.
pub(in crate::gltf) fn compact(
    document: &mut Document,
    buffers: &Buffers,
    touched: &BTreeMap<usize, usize>,
) -> Result<Buffers, DocumentError> {
    let found = Uses::find(document)?;
    let views = document.array("bufferViews")?.to_vec();
    let mut live: Vec<Vec<Range<usize>>> = vec![Vec::new(); buffers.len()];
    let mut dead = live.clone();
    // What becomes of the views that lost a user.
    let mut gone = BTreeSet::new();
    let mut shrunk: BTreeMap<usize, Vec<(usize, Range<usize>)>> = BTreeMap::new();
    for (i, view) in views.iter().enumerate() {
        let packed = packed_range(view);
        let whole = range(view);
        let ranges = whole.iter().chain(&packed);
        let parts = found.accessors.get(&i);
        let plain = packed.is_none() && !found.other.contains(&i);
        match (touched.contains_key(&i), parts) {
            (true, None) if !found.other.contains(&i) => {
                ranges.for_each(|(buffer, range)| push(&mut dead, *buffer, range.clone()));
                gone.insert(i);
            }
            (true, Some(parts)) if plain && whole.as_ref().is_some_and(|(_, range)| range.start.is_multiple_of(4)) => {
                let Some((buffer, range)) = whole else { continue };
                push(&mut dead, buffer, range.clone());
                let spans: Vec<(usize, Range<usize>)> = spans(document, view, parts, range.start)?;
                for (_, span) in &spans {
                    push(&mut live, buffer, span.clone());
                }
                shrunk.insert(i, spans);
            }
            _ => ranges.for_each(|(buffer, range)| push(&mut live, *buffer, range.clone())),
        }
    }
    let cuts: Vec<Cuts> = (0..buffers.len())
        .map(|i| {
            let length = buffers.bytes(i).map_or(0, <[u8]>::len);
            Cuts::new(std::mem::take(&mut dead[i]), std::mem::take(&mut live[i]), length)
        })
        .collect();
    let shifted = |at: &mut Value| {
        if let Some((buffer, range)) = range(at)
            && let Some(cuts) = cuts.get(buffer).filter(|cuts| !cuts.0.is_empty())
        {
            set_offset(at, cuts.shift(range.start));
        }
    };
    for (i, view) in document.array_mut("bufferViews")?.iter_mut().enumerate() {
        if !gone.contains(&i) && !shrunk.contains_key(&i) {
            shifted(view);
            for name in meshopt::EXTENSIONS {
                if let Some(packed) = view.get_mut("extensions").and_then(|e| e.get_mut(name)) {
                    shifted(packed);
                }
            }
        }
    }
    for (view, spans) in shrunk {
        shrink(document, view, &spans, &cuts)?;
    }
    for (i, &other) in touched.iter().filter(|(i, _)| gone.contains(i)) {
        // Of a chain of stand-ins the last one is there.
        let mut other = other;
        while let Some(&next) = touched.get(&other).filter(|_| gone.contains(&other)) {
            other = next;
        }
        let views = document.array_mut("bufferViews")?;
        let mut entry = views[other].clone();
        if let (Some(name), Some(entry)) = (views[*i].get("name").cloned(), entry.as_object_mut()) {
            entry.insert("name".to_owned(), name);
        }
        views[*i] = entry;
    }
    cut(document, buffers, &cuts)
}

/// Who uses which view.
struct Uses {
    /// Accessors by view; sparse parts count as other uses.
    accessors: BTreeMap<usize, Vec<usize>>,
    /// Views that something else needs as a whole.
    other: BTreeSet<usize>,
}

impl Uses {
    fn find(document: &Document) -> Result<Self, DocumentError> {
        let mut uses = Self { accessors: BTreeMap::new(), other: BTreeSet::new() };
        for (i, accessor) in document.array("accessors")?.iter().enumerate() {
            if let Some(view) = super::index(accessor, "bufferView") {
                uses.accessors.entry(view).or_default().push(i);
            }
            let sparse = accessor.get("sparse");
            uses.other.extend(["indices", "values"].iter().filter_map(|k| super::index(sparse?.get(k)?, "bufferView")));
        }
        uses.other.extend(document.array("images")?.iter().filter_map(|image| super::index(image, "bufferView")));
        uses.other.extend(super::packed_views(document)?);
        Ok(uses)
    }
}

fn push(list: &mut [Vec<Range<usize>>], buffer: usize, range: Range<usize>) {
    if let Some(ranges) = list.get_mut(buffer) {
        ranges.push(range);
    }
}

/// Buffer and bytes of a view, or of the object of a compression.
fn range(view: &Value) -> Option<(usize, Range<usize>)> {
    let offset = super::index(view, "byteOffset").unwrap_or(0);
    Some((super::index(view, "buffer")?, offset..offset.checked_add(super::index(view, "byteLength")?)?))
}

fn packed_range(view: &Value) -> Option<(usize, Range<usize>)> {
    meshopt::EXTENSIONS.iter().find_map(|name| range(json::extension(view, name)?))
}

/// The bytes from the first to the last element of each accessor, in the buffer.
fn spans(
    document: &Document,
    view: &Value,
    accessors: &[usize],
    start: usize,
) -> Result<Vec<(usize, Range<usize>)>, DocumentError> {
    let span = |&accessor: &usize| {
        let parsed = Accessor::parse(document, accessor, "bufferViews")?;
        let size = parsed.layout.size();
        let stride = super::index(view, "byteStride").filter(|&stride| stride != 0).unwrap_or(size);
        let from = start + super::index(&document.array("accessors")?[accessor], "byteOffset").unwrap_or(0);
        let length = (parsed.count as usize).saturating_sub(1) * stride + size;
        Ok((accessor, from..from + length))
    };
    accessors.iter().map(span).collect()
}

/// What is taken out of one buffer: places and lengths, ascending.
struct Cuts(Vec<Range<usize>>);

impl Cuts {
    /// `dead` without `live`.
    fn new(mut dead: Vec<Range<usize>>, mut live: Vec<Range<usize>>, length: usize) -> Self {
        dead.sort_by_key(|range| (range.start, range.end));
        live.sort_by_key(|range| (range.start, range.end));
        let mut cuts = Vec::new();
        let mut add = |from: usize, to: usize| {
            let whole = to.min(length).saturating_sub(from) / GRAIN * GRAIN;
            if 0 < whole {
                cuts.push(from..from + whole);
            }
        };
        let mut live = live.into_iter().peekable();
        // Everything before it is dealt with.
        let mut at = 0;
        for range in dead {
            at = at.max(range.start);
            while at < range.end {
                // The first live byte from here on, and where the live bytes there end.
                while live.next_if(|l| l.end <= at).is_some() {}
                match live.peek() {
                    Some(next) if next.start <= at => at = next.end,
                    Some(next) if next.start < range.end => {
                        add(at, next.start);
                        at = next.start;
                    }
                    _ => {
                        add(at, range.end);
                        at = range.end;
                    }
                }
            }
        }
        Self(cuts)
    }

    /// Where a byte is afterwards.
    fn shift(&self, at: usize) -> usize {
        at - self.0.iter().take_while(|cut| cut.start < at).map(|cut| cut.len().min(at - cut.start)).sum::<usize>()
    }
}

fn set_offset(value: &mut Value, offset: usize) {
    let Some(members) = value.as_object_mut() else { return };
    if members.contains_key("byteOffset") || offset != 0 {
        members.insert("byteOffset".to_owned(), json!(offset));
    }
}

/// A view of what its accessors use, and the accessors at their new places.
fn shrink(
    document: &mut Document,
    view: usize,
    spans: &[(usize, Range<usize>)],
    cuts: &[Cuts],
) -> Result<(), DocumentError> {
    let Some((buffer, old)) = range(&document.array("bufferViews")?[view]) else { return Ok(()) };
    let Some(cuts) = cuts.get(buffer).filter(|cuts| !cuts.0.is_empty()) else { return Ok(()) };
    let first = spans.iter().map(|(_, span)| span.start).min().unwrap_or(old.start);
    let last = spans.iter().map(|(_, span)| span.end).max().unwrap_or(old.end);
    // Offsets of accessors stay multiples of four where they were.
    let start = cuts.shift(first) - (first - old.start) % 4;
    let entry = &mut document.array_mut("bufferViews")?[view];
    set_offset(entry, start);
    entry["byteLength"] = json!(cuts.shift(last) - start);
    let accessors = document.array_mut("accessors")?;
    for (accessor, span) in spans {
        set_offset(&mut accessors[*accessor], cuts.shift(span.start) - start);
    }
    Ok(())
}

/// The buffers without the cuts.
fn cut(document: &mut Document, buffers: &Buffers, cuts: &[Cuts]) -> Result<Buffers, DocumentError> {
    let mut out = buffers.clone();
    for (i, cuts) in cuts.iter().enumerate().filter(|(_, cuts)| !cuts.0.is_empty()) {
        let Some(bytes) = buffers.bytes(i) else { continue };
        let mut kept = Vec::with_capacity(bytes.len());
        let mut at = 0;
        for cut in &cuts.0 {
            kept.extend_from_slice(&bytes[at..cut.start]);
            at = cut.end;
        }
        kept.extend_from_slice(&bytes[at..]);
        out.rewrite(document, i, kept)?;
    }
    Ok(out)
}
