//! An inspection as people read it.

use super::{InspectedMesh, Inspection, Structure};
use crate::progress::quantity::{bytes, count, plural};
use crate::report::table::{columns, percent};

/// Meshes listed; the rest is counted, and is in the JSON.
const LISTED: usize = 30;
/// Longer names are cut, so that the table fits a terminal.
const NAME_COLUMNS: usize = 23;
/// A hash and a few words.
const PIECE_COLUMNS: usize = 25;
/// Room beside the words of the first column.
const VALUE_COLUMNS: usize = 66;

/// Three parts: what is declared, the meshes, what a bake would do.
pub(super) fn text(inspection: &Inspection) -> String {
    let title = format!("{}  {}, {}", inspection.file, bytes(inspection.bytes), inspection.structure.container);
    let parts = [title, contents(inspection), meshes(inspection), bake(inspection)];
    let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join("\n\n") + "\n"
}

fn contents(inspection: &Inspection) -> String {
    let structure = &inspection.structure;
    let named = |names: &[String]| names.join(", ");
    let mut rows = vec![
        ("nodes", format!("{}, {} with a mesh", count(structure.nodes), count(structure.mesh_nodes))),
        ("meshes", meshes_row(structure)),
        ("triangles", format!("{}, {} drawn", count(inspection.triangles), count(inspection.triangles_drawn))),
        ("attributes", structure.attributes.keys().cloned().collect::<Vec<_>>().join(", ")),
        ("morphed", optional(structure.morphed_primitives, "primitive")),
        ("materials", materials(structure)),
        ("others", others(structure)),
        ("levels", optional(structure.level_groups, "node")),
        ("uses", named(&structure.extensions_used)),
        ("requires", named(&structure.extensions_required)),
        ("written by", structure.generator.clone().unwrap_or_default()),
    ];
    rows.extend(inspection.warnings.iter().map(|warning| ("warning", warning.clone())));
    rows.retain(|(_, value)| !value.is_empty());
    let lines = rows.into_iter().flat_map(|(name, value)| {
        let names = std::iter::once(name).chain(std::iter::repeat(""));
        names.zip(wrapped(&value)).map(|(name, line)| vec![format!("  {name}"), line]).collect::<Vec<_>>()
    });
    columns(&[], lines.collect(), &[])
}

/// Lines of at most `VALUE_COLUMNS`, broken at spaces; a longer word stays whole.
fn wrapped(value: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in value.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= VALUE_COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// `12 of 16 primitives, 1 of lines`: what is no list of triangles is named.
fn meshes_row(structure: &Structure) -> String {
    let primitives: u64 = structure.primitives.values().sum();
    if primitives == 0 {
        return count(structure.meshes);
    }
    let all = format!("{} of {}", count(structure.meshes), plural(primitives, "primitive"));
    let odd = structure.primitives.iter().filter(|(kind, _)| kind.as_str() != "triangles");
    let odd = odd.map(|(kind, number)| format!("{} of {kind}", count(*number)));
    std::iter::once(all).chain(odd).collect::<Vec<_>>().join(", ")
}

fn materials(structure: &Structure) -> String {
    let parts = [
        (structure.materials, "material"),
        (structure.variants, "variant"),
        (structure.textures, "texture"),
        (structure.images, "image"),
    ];
    listed(&parts)
}

fn others(structure: &Structure) -> String {
    let parts = [
        (structure.scenes, "scene"),
        (structure.skins, "skin"),
        (structure.animations, "animation"),
        (structure.cameras, "camera"),
        (structure.lights, "light"),
    ];
    listed(&parts)
}

fn listed(parts: &[(u64, &str)]) -> String {
    let there = parts.iter().filter(|(number, _)| *number > 0).map(|(number, word)| plural(*number, word));
    there.collect::<Vec<_>>().join(", ")
}

fn optional(number: u64, word: &str) -> String {
    if number == 0 { String::new() } else { plural(number, word) }
}

fn meshes(inspection: &Inspection) -> String {
    if inspection.meshes.is_empty() {
        return String::new();
    }
    let rows = inspection.meshes.iter().take(LISTED).map(|mesh| {
        vec![
            format!("  {}", cut(&name(mesh), NAME_COLUMNS)),
            count(mesh.triangles),
            count(mesh.vertices),
            count(mesh.instances),
            cut(&pieces(mesh), PIECE_COLUMNS),
        ]
    });
    let header = ["  mesh", "triangles", "vertices", "drawn", "sub-mesh"];
    let table = columns(&header, rows.collect(), &[1, 2, 3]);
    match inspection.meshes.len().checked_sub(LISTED) {
        None | Some(0) => table,
        Some(more) => format!("{table}\n  and {} more, see `--json`", count(more as u64)),
    }
}

fn name(mesh: &InspectedMesh) -> String {
    match mesh.name.as_deref().map(str::trim) {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("meshes[{}]", mesh.index),
    }
}

/// Control characters out, and no longer than its column.
fn cut(text: &str, columns: usize) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().count() <= columns {
        return text;
    }
    text.chars().take(columns - 1).chain(['…']).collect()
}

/// `3f2a91c8e1d0`, `3f2a91c8e1d0 and 2 more`, `none: lines`.
fn pieces(mesh: &InspectedMesh) -> String {
    let alone = mesh.left_alone.join(", ");
    match (mesh.pieces.as_slice(), alone.is_empty()) {
        ([], _) => format!("none: {alone}"),
        ([one], true) => one.hash.short(),
        ([one], false) => format!("{}, not: {alone}", one.hash.short()),
        ([first, rest @ ..], _) => format!("{} and {} more", first.hash.short(), rest.len()),
    }
}

fn bake(inspection: &Inspection) -> String {
    let found: u64 = inspection.distinct.iter().map(|piece| piece.uses).sum();
    let distinct = inspection.distinct.len() as u64;
    let left = distinct - inspection.bake.jobs;
    let mut rows = vec![("sub-meshes", format!("{} found, {} distinct", count(found), count(distinct)))];
    let few = match left {
        0 => String::new(),
        _ => format!(", {} left alone (under {} triangles)", count(left), inspection.bake.min_triangles),
    };
    rows.push(("jobs", format!("{}{few}", count(inspection.bake.jobs))));
    if inspection.bake.duplicate_bytes > 0 {
        rows.push((
            "copies",
            format!("{} hold a mesh again that is there already", bytes(inspection.bake.duplicate_bytes)),
        ));
    }
    let summary = rows.into_iter().map(|(name, value)| vec![format!("  {name}"), value]).collect();
    let summary = format!("a bake with default settings\n{}", columns(&[], summary, &[]));
    if inspection.bake.jobs == 0 {
        return summary;
    }
    let source =
        vec!["  source".to_owned(), String::new(), count(inspection.triangles), count(inspection.triangles_drawn)];
    let levels = inspection.bake.levels.iter().zip(1..).map(|(level, number)| {
        vec![format!("  level {number}"), percent(level.ratio), count(level.triangles), count(level.triangles_drawn)]
    });
    let rows = std::iter::once(source).chain(levels).collect();
    format!("{summary}\n\n{}", columns(&["", "target", "triangles", "drawn"], rows, &[1, 2, 3]))
}
