//! Markdown for a comment or a step's summary: what is wrong, what changed, what there is, as much as fits.

use super::{Publication, scenes_by_severity, status, triangles, worst_look};
use crate::budget::{Finding, figure};
use crate::difference::{Difference, by, title};
use crate::progress::quantity::{bytes, count, number, plural};
use crate::report::Severity;

/// First line of the text: by it a comment is found again and kept up to date.
pub const MARK: &str = "<!-- lodbake report -->";

/// Rows of the tables of changes and scenes are left out before those of findings are.
const SHARE: [usize; 3] = [5, 3, 2];

/// The text, of at most `most` bytes.
pub fn markdown(publication: &Publication<'_>, most: usize) -> String {
    let totals = &publication.report.totals;
    let lead = format!(
        "{MARK}\n## lodbake: {}\n\n{} baked, {} of {} meshes distinct, {} written ({}).\n",
        publication.verdict(),
        plural(totals.baked, "scene"),
        count(totals.meshes_distinct),
        count(totals.meshes_found),
        bytes(totals.bytes_out),
        escape(&publication.report.tool),
    );
    let room = most.saturating_sub(lead.len() + 200);
    let mut text = lead;
    let total: usize = SHARE.iter().sum();
    // What one part does not take is left to the next.
    let mut left = room;
    for (number, share) in SHARE.iter().enumerate() {
        let open: usize = SHARE[number..].iter().sum();
        let part = left * share / open.min(total);
        let made = match number {
            0 => findings(publication, part),
            1 => publication.difference.map(|difference| changes(difference, part)).unwrap_or_default(),
            _ => scenes(publication, part),
        };
        left -= made.len().min(left);
        text.push_str(&made);
    }
    text
}

/// Rows as long as they fit into `room` bytes, and a word about the rest.
fn table(head: &str, rows: impl ExactSizeIterator<Item = String>, room: usize) -> String {
    let mut text = head.to_owned();
    let all = rows.len();
    for (number, row) in rows.enumerate() {
        if room < text.len() + row.len() + 60 {
            text.extend(["\n… and ", &count((all - number) as u64), " more.\n"]);
            return text;
        }
        text.push_str(&row);
    }
    text
}

fn findings(publication: &Publication<'_>, room: usize) -> String {
    if publication.findings.is_empty() {
        return String::new();
    }
    let row = |finding: &Finding| {
        let word = if finding.severity == Severity::Error { "**error**" } else { "warning" };
        let (place, message, help) = (escape(&finding.place()), escape(&finding.message), escape(&finding.help));
        format!("| {word} | {place} | {message} | {help} |\n")
    };
    table("\n| | where | what | what would help |\n|---|---|---|---|\n", publication.findings.iter().map(row), room)
}

fn changes(difference: &Difference, room: usize) -> String {
    if difference.changes.is_empty() {
        return format!("\n### Since the baseline\n\nNo change: {} the same.\n", plural(difference.unchanged, "scene"));
    }
    let sums = difference.sums.iter().filter(|sum| sum.base != sum.head).map(|sum| {
        let (base, head) = (figure(sum.fact, sum.base), figure(sum.fact, sum.head));
        format!("{}: {base} → {head} ({})", sum.fact.title(), by(sum.base, sum.head))
    });
    let sums = sums.collect::<Vec<_>>().join("; ");
    let sums = if sums.is_empty() { String::new() } else { format!("\nIn sum: {sums}.\n") };
    let row = |change: &crate::difference::Change| {
        let word = title(change.kind);
        let word = if change.is_regression { format!("**{word}**") } else { word.to_owned() };
        format!("| {word} | {} | {} |\n", escape(&change.place()), escape(&change.message()))
    };
    let head = format!("\n### Since the baseline\n{sums}\n| | where | what |\n|---|---|---|\n");
    table(&head, difference.changes.iter().map(row), room)
}

fn scenes(publication: &Publication<'_>, room: usize) -> String {
    let all = scenes_by_severity(publication);
    let head = format!(
        "\n<details><summary>All {}</summary>\n\n| scene | state | triangles | levels | worst d_RMS | bytes |\n\
         |---|---|--:|--:|--:|--:|\n",
        plural(all.len() as u64, "scene")
    );
    let rows = all.into_iter().map(|(scene, _)| {
        let levels = scene.meshes.iter().map(|mesh| mesh.levels.len()).max().unwrap_or(0);
        let look = worst_look(scene).map_or_else(|| "–".to_owned(), number);
        format!(
            "| {} | {} | {} | {levels} | {look} | {} |\n",
            escape(&scene.path),
            status(scene.status),
            count(triangles(scene)),
            bytes(scene.file_bytes())
        )
    });
    table(&head, rows, room.saturating_sub(20)) + "\n</details>\n"
}

/// Names come from files: they must not become markup, links or mentions.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut in_code = false;
    for c in text.chars() {
        match c {
            '`' => {
                in_code = !in_code;
                out.push('`');
            }
            '\n' | '\r' => out.push(' '),
            '|' => out.push_str("\\|"),
            '<' if !in_code => out.push_str("&lt;"),
            '>' if !in_code => out.push_str("&gt;"),
            '&' if !in_code => out.push_str("&amp;"),
            '*' | '_' | '[' | ']' | '\\' | '#' | '~' if !in_code => out.extend(['\\', c]),
            '@' if !in_code => out.push_str("&#64;"),
            c => out.push(c),
        }
    }
    out
}
