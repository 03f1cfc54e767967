//! What a person reads at the end of a bake: a sentence, a few figures, and the triangles of each level.
//!
//! At most 80 columns, plain text: it reads the same in a log, in a pipe and without colour.

use std::collections::BTreeMap;
use std::time::Duration;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use super::{BatchesRecord, LevelRecord, MeshRecord, PartsRecord, Report, Stop};
use crate::config::{ErrorUnit, LevelTarget};
use crate::progress::Summary;
use crate::progress::quantity::{bytes, count, duration, plural};

/// The end of a bake in words: `report` says what the outputs are, `summary` what this run did, in `wall` time.
pub fn summary_table(report: &Report, summary: &Summary, wall: Duration) -> String {
    let sentence = sentence(summary, wall);
    if summary.dry_run || summary.baked + summary.copied == 0 {
        return sentence;
    }
    let parts = [Some(sentence), Some(figures(report, summary, wall)), levels(report), missed(report)];
    parts.into_iter().flatten().collect::<Vec<_>>().join("\n\n")
}

/// `no work: 200 scenes unchanged (0.05 s)`, `baked 14 scenes, 186 unchanged, 1 failed (12.3 s)`.
fn sentence(summary: &Summary, wall: Duration) -> String {
    let time = duration(wall);
    if summary.files == 0 {
        return format!("no work: no scenes found ({time})");
    }
    let rest = [
        (summary.copied, "copied"),
        (summary.unchanged, "unchanged"),
        (summary.skipped, "skipped"),
        (summary.failed, "failed"),
    ];
    let mut parts: Vec<String> = rest
        .iter()
        .filter(|(number, _)| *number > 0)
        .map(|(number, what)| format!("{} {what}", count(*number)))
        .collect();
    let scenes = plural(summary.baked, "scene");
    if summary.baked > 0 && summary.dry_run {
        parts.insert(0, format!("would bake {scenes} with {}", plural(summary.jobs, "job")));
    } else if summary.baked > 0 {
        parts.insert(0, format!("baked {scenes}"));
    } else if summary.unchanged + summary.skipped == summary.files {
        return format!("no work: {} unchanged ({time})", plural(summary.unchanged, "scene"));
    }
    format!("{} ({time})", parts.join(", "))
}

fn figures(report: &Report, summary: &Summary, wall: Duration) -> String {
    let totals = &report.totals;
    let mut rows = vec![
        vec!["meshes found".to_owned(), count(totals.meshes_found)],
        vec![
            "distinct".to_owned(),
            format!("{}{}", count(totals.meshes_distinct), times(totals.meshes_found, totals.meshes_distinct)),
        ],
        vec!["jobs run".to_owned(), count(summary.jobs)],
        vec!["cache hits".to_owned(), count(summary.cache_hits)],
        vec!["bytes in".to_owned(), bytes(totals.bytes_in)],
        vec![
            "bytes out".to_owned(),
            format!("{}{}", bytes(totals.bytes_out), change(totals.bytes_in, totals.bytes_out)),
        ],
    ];
    if totals.instances_found > 0 {
        let worst = meshes(report).filter(|mesh| mesh.is_recovered()).filter_map(|mesh| mesh.instance_of.as_ref());
        let worst = worst.map(|instance| instance.residual.worst()).fold(0.0, f64::max);
        let residual =
            if totals.instances_recovered > 0 { format!("; residual up to {worst:.1e}") } else { String::new() };
        let (found, recovered) = (count(totals.instances_found), count(totals.instances_recovered));
        rows.push(vec!["instances".to_owned(), format!("{recovered} recovered of {found} found{residual}")]);
    }
    rows.extend(parts(report));
    rows.extend(batches(report));
    let looks = Duration::from_millis(summary.looks_milliseconds);
    if !looks.is_zero() && looks <= wall {
        let share = looks.as_secs_f64() / wall.as_secs_f64();
        rows.push(vec![
            "looks".to_owned(),
            format!("measured in {}  ({share:.0} %)", duration(looks), share = 100.0 * share),
        ]);
    }
    if summary.warnings > 0 {
        rows.push(vec!["warnings".to_owned(), count(summary.warnings)]);
    }
    columns(&[], rows, &[])
}

/// `200 (2 different) on 400 nodes; residual up to 1.2e-7`; of those that stay most with the reason.
fn parts(report: &Report) -> Vec<Vec<String>> {
    let scenes: Vec<&PartsRecord> = report.scenes.iter().filter_map(|scene| scene.parts.as_ref()).collect();
    if scenes.is_empty() {
        return Vec::new();
    }
    let groups = || scenes.iter().flat_map(|scene| &scene.groups);
    let instances: u64 = groups().map(|group| group.instances).sum();
    let nodes = plural(scenes.iter().map(|scene| scene.nodes).sum(), "node");
    let worst = groups().map(|group| group.residual.worst()).fold(0.0, f64::max);
    let different = count(groups().count() as u64);
    let words = match instances {
        0 => count(0),
        _ => format!("{} ({different} different) on {nodes}; residual up to {worst:.1e}", count(instances)),
    };
    let mut rows = vec![vec!["parts".to_owned(), words]];
    rows.extend(stays("stay parts", scenes.iter().map(|scene| &scene.stayed)));
    rows
}

/// `40; 30 of them: too few with their mesh are near them`.
fn stays<'r>(name: &str, all: impl Iterator<Item = &'r BTreeMap<String, u64>>) -> Option<Vec<String>> {
    let mut stayed: BTreeMap<&str, u64> = BTreeMap::new();
    for (why, number) in all.flatten() {
        *stayed.entry(why).or_insert(0) += number;
    }
    let (why, most) = stayed.iter().rev().max_by_key(|(_, most)| **most)?;
    let all = count(stayed.values().sum());
    let words = if stayed.len() == 1 { all } else { format!("{all}; {} of them", count(*most)) };
    Some(vec![name.to_owned(), format!("{words}: {why}")])
}

/// `1,296 nodes in 12 batches`; `40`, most of them with the reason why they are no part of any.
fn batches(report: &Report) -> Vec<Vec<String>> {
    let scenes: Vec<&BatchesRecord> = report.scenes.iter().filter_map(|scene| scene.batches.as_ref()).collect();
    if scenes.is_empty() {
        return Vec::new();
    }
    let (nodes, batches) = scenes.iter().fold((0, 0), |sums, s| (sums.0 + s.instances, sums.1 + s.batches));
    let batches = if batches == 1 { "1 batch".to_owned() } else { format!("{} batches", count(batches)) };
    let mut rows = vec![vec!["batches".to_owned(), format!("{} in {batches}", plural(nodes, "node"))]];
    rows.extend(stays("stay nodes", scenes.iter().map(|scene| &scene.stayed)));
    rows
}

/// ` (13.7 times less)`, when there is something to save.
fn times(found: u64, distinct: u64) -> String {
    if distinct == 0 || found <= distinct {
        return String::new();
    }
    format!("  (each used {:.1} times)", found as f64 / distinct as f64)
}

/// `  (+14 %)`
fn change(before: u64, after: u64) -> String {
    if before == 0 {
        return String::new();
    }
    format!("  ({:+.0} %)", 100.0 * (after as f64 / before as f64 - 1.0))
}

/// Triangles of each level over all scenes. `None` if nothing has levels.
fn levels(report: &Report) -> Option<String> {
    let drawn = &report.totals.triangles_drawn;
    let stored = &report.totals.triangles_stored;
    if drawn.len() < 2 {
        return None;
    }
    let rows = (0..drawn.len()).map(|level| {
        let name = if level == 0 { "source".to_owned() } else { format!("level {level}") };
        let asked = level.checked_sub(1).and_then(|k| report.settings.chain.levels.get(k));
        let share = if stored[0] == 0 { 0.0 } else { stored[level] as f64 / stored[0] as f64 };
        vec![
            name,
            asked.map(target).unwrap_or_default(),
            count(stored[level]),
            percent(share),
            count(drawn[level]),
            if level == 0 { String::new() } else { percent(worst_error(report, level as u64)) },
        ]
    });
    let header = ["", "asked", "triangles", "of source", "drawn", "worst error"];
    Some(
        columns(&header, rows.collect(), &[1, 2, 3, 4, 5])
            + "\n(drawn: with every instance; error: of the mesh's radius)",
    )
}

/// `50 %`, `1,000 triangles`, `0.5 % of radius`, `0.01 units`.
pub fn target(target: &LevelTarget) -> String {
    match *target {
        LevelTarget::Ratio(ratio) => percent(ratio),
        LevelTarget::Triangles(triangles) => format!("{} triangles", count(triangles.into())),
        LevelTarget::Error { limit, unit: ErrorUnit::Radius } => format!("error {}", percent(limit)),
        LevelTarget::Error { limit, unit: ErrorUnit::Object } => format!("error {limit}"),
        LevelTarget::Pixels { limit, size } => format!("{limit} px at {size}"),
        LevelTarget::Appearance(limit) => format!("d_RMS {limit}"),
        LevelTarget::SceneRatio(ratio) => format!("{} of the scene", percent(ratio)),
        LevelTarget::SceneTriangles(triangles) => format!("{} triangles a scene", count(triangles)),
        LevelTarget::SceneBytes(bytes) => format!("{} bytes a scene", count(bytes)),
    }
}

/// `50 %`, `2.5 %`, `0.013 %`: at least two significant digits below 10 %.
pub fn percent(fraction: f64) -> String {
    let value = 100.0 * fraction;
    let digits = if value == 0.0 || value >= 9.95 { 0 } else { (1.0 - value.log10().floor()).clamp(1.0, 6.0) as usize };
    format!("{value:.digits$} %")
}

fn meshes(report: &Report) -> impl Iterator<Item = &MeshRecord> {
    report.scenes.iter().flat_map(|scene| &scene.meshes)
}

fn worst_error(report: &Report, number: u64) -> f64 {
    meshes(report).filter_map(|mesh| mesh.level_for(number)).map(|level| level.error_of_radius).fold(0.0, f64::max)
}

/// How many levels have more triangles than asked for. An error limit is no such promise: `None` for those.
fn missed(report: &Report) -> Option<String> {
    let counted = |level: &&LevelRecord| matches!(level.target, LevelTarget::Ratio(_) | LevelTarget::Triangles(_));
    let levels = || meshes(report).flat_map(|mesh| &mesh.levels).filter(counted);
    let missed = levels().filter(|level| level.stop != Stop::Target).count() as u64;
    let all = plural(levels().count() as u64, "level");
    (missed > 0).then(|| format!("{} of {all} have more triangles than asked: nothing left to contract", count(missed)))
}

/// Columns two spaces apart, those in `right` to the right; no rules, no trailing spaces.
pub fn columns(header: &[&str], rows: Vec<Vec<String>>, right: &[usize]) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled).force_no_tty();
    if !header.is_empty() {
        table.set_header(header.iter().copied());
    }
    table.add_rows(rows);
    for (index, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if right.contains(&index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| line.trim_end().to_owned()).collect::<Vec<_>>().join("\n")
}
