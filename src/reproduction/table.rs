//! The reproduced tables beside the printed ones, as Markdown and CSV. Knows no files.

use std::fmt::Write as _;

use super::paper;
use super::{Record, Row};

/// Everything as Markdown.
pub fn markdown(record: &Record) -> String {
    let [vertices, faces] = record.source;
    let mut out = format!(
        "# The instanced-model paper's tables\n\nModel: {vertices} vertices, {faces} faces (the paper's: {} and {}), {} instances, \
         the least time of {} runs.\n",
        paper::SOURCE[0],
        paper::SOURCE[1],
        record.instances,
        record.repetitions,
    );
    counts(record, &mut out);
    costs(record, &mut out);
    growth(record, &mut out);
    out
}

fn table(out: &mut String, title: &str, header: &[&str], rows: Vec<Vec<String>>) {
    write!(out, "\n## {title}\n\n| {} |\n|---|{}\n", header.join(" | "), "---:|".repeat(header.len() - 1))
        .expect("a String takes any text");
    for row in rows {
        writeln!(out, "| {} |", row.join(" | ")).expect("a String takes any text");
    }
}

fn name(row: &Row) -> String {
    format!("`{}`{}", row.method, if row.flattened { " (flattened)" } else { "" })
}

/// Rows of one method, in the order of the shares.
fn by_method(record: &Record) -> Vec<Vec<&Row>> {
    let mut out: Vec<Vec<&Row>> = Vec::new();
    for row in &record.rows {
        match out.iter_mut().find(|rows| rows[0].method == row.method) {
            Some(rows) => rows.push(row),
            None => out.push(vec![row]),
        }
    }
    out
}

/// Table 2.
fn counts(record: &Record, out: &mut String) {
    let header = ["", "−10 % V", "F", "off", "−20 % V", "F", "off", "−50 % V", "F", "off"];
    let mut rows = Vec::new();
    let mut paper_row = vec!["paper".to_owned()];
    for [vertices, faces] in paper::COUNTS {
        paper_row.extend([vertices.to_string(), faces.to_string(), String::new()]);
    }
    rows.push(paper_row);
    for method in by_method(record) {
        let mut cells = vec![name(method[0])];
        for (row, [_, faces]) in method.iter().zip(paper::COUNTS) {
            let off = (row.faces / faces as f64 - 1.0) * 100.0;
            cells.extend([format!("{:.0}", row.vertices), format!("{:.0}", row.faces), format!("{off:+.2} %")]);
        }
        rows.push(cells);
    }
    table(out, "Table 2: vertices and faces of one copy; faces against the paper's", &header, rows);
}

/// Table 3.
fn costs(record: &Record, out: &mut String) {
    let header = ["", "−10 % ms", "KB", "GLB KB", "−20 % ms", "KB", "GLB KB", "−50 % ms", "KB", "GLB KB"];
    let names = ["paper: quadrics", "paper: GAPS", "paper: IAS", "paper: ITS"];
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let mut cells = vec![(*name).to_owned()];
        for shares in paper::COSTS {
            let [kilobytes, milliseconds] = shares[index];
            cells.extend([milliseconds.to_string(), kilobytes.to_string(), String::new()]);
        }
        rows.push(cells);
    }
    let kilobytes = |bytes: usize| format!("{:.0}", bytes as f64 / 1024.0);
    for method in by_method(record) {
        let mut cells = vec![name(method[0])];
        for row in method {
            cells.extend([format!("{:.1}", row.milliseconds), kilobytes(row.obj_bytes), kilobytes(row.glb_bytes)]);
        }
        rows.push(cells);
    }
    table(out, "Table 3: time from file to file and size, all instances", &header, rows);
    let header = ["flattened / instanced", "−10 % time", "size", "−20 % time", "size", "−50 % time", "size"];
    let paper_ratio = |flat: usize, instanced: usize| {
        let mut cells = vec![format!("{} / {}", names[flat], names[instanced].trim_start_matches("paper: "))];
        for shares in paper::COSTS {
            let ratio = |k: usize| f64::from(shares[flat][k]) / f64::from(shares[instanced][k]);
            cells.extend([format!("{:.1}", ratio(1)), format!("{:.2}", ratio(0))]);
        }
        cells
    };
    let mut rows = vec![paper_ratio(0, 2), paper_ratio(1, 3)];
    let methods = by_method(record);
    let of = |name: &str| methods.iter().find(|rows| rows[0].method == name);
    for (flat, instanced) in [("qem", "ias"), ("gaps", "its-paper"), ("gaps", "its")] {
        let (Some(a), Some(b)) = (of(flat), of(instanced)) else { continue };
        let mut cells = vec![format!("`{flat}` / `{instanced}`")];
        for (a, b) in a.iter().zip(b) {
            let size = a.obj_bytes as f64 / b.obj_bytes as f64;
            cells.extend([format!("{:.1}", a.milliseconds / b.milliseconds), format!("{size:.2}")]);
        }
        rows.push(cells);
    }
    table(out, "Flattened over instanced", &header, rows);
}

fn growth(record: &Record, out: &mut String) {
    let header = ["−50 %", "instances", "simplification ms", "file to file ms", "mesh bytes", "transform bytes"];
    let rows = record.growth.iter().map(|g| {
        vec![
            format!("`{}`", g.method),
            g.instances.to_string(),
            format!("{:.2}", g.simplification),
            format!("{:.2}", g.milliseconds),
            g.mesh_bytes.to_string(),
            g.transform_bytes.to_string(),
        ]
    });
    table(out, "More instances", &header, rows.collect());
}

/// The rows as CSV.
pub fn csv(record: &Record) -> String {
    let mut out =
        "method,flattened,percent,vertices,faces,paper_faces,milliseconds,simplification,obj_bytes,glb_bytes\n"
            .to_owned();
    for row in &record.rows {
        let at = paper::PERCENTS.iter().position(|&percent| percent == row.percent);
        let faces = at.map_or(0, |at| paper::COUNTS[at][1]);
        let Row { method, flattened, percent, .. } = row;
        writeln!(
            out,
            "{method},{flattened},{percent},{},{},{faces},{},{},{},{}",
            row.vertices, row.faces, row.milliseconds, row.simplification, row.obj_bytes, row.glb_bytes
        )
        .expect("a String takes any text");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_of_the_same_share() {
        let row = |method: &'static str, percent: u32, milliseconds: f64| Row {
            method,
            flattened: method == "qem",
            percent,
            vertices: 2247.0,
            faces: 4456.0,
            milliseconds,
            simplification: 1.0,
            obj_bytes: 1024,
            glb_bytes: 2048,
        };
        let rows = paper::PERCENTS.iter().flat_map(|&p| [row("qem", p, 130.0), row("ias", p, f64::from(p))]).collect();
        let record = Record { source: paper::SOURCE, instances: 13, repetitions: 1, rows, growth: Vec::new() };
        let text = markdown(&record);
        assert!(text.contains("| `qem` / `ias` | 13.0 | 1.00 | 6.5 | 1.00 | 2.6 | 1.00 |"), "{text}");
        assert!(text.contains("| `qem` (flattened) | 2247 | 4456 | +0.00 % |"), "{text}");
        assert!(text.contains("| paper: quadrics / IAS | 13.7 | 1.37 |"), "{text}");
        assert_eq!(csv(&record).lines().count(), 7);
    }
}
