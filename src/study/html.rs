//! A study as one page: plots and tables, nothing beside it, no script; light or dark as the reader's system is.

use super::record::Record;
use super::sections::{Section, Table, sections};
use crate::page::{anchor, document, escape, figures};

/// `study.html`.
pub fn page(record: &Record) -> String {
    let title = format!("Study {}", record.study);
    let heading = escape(&title);
    let sections = sections(record);
    let link = |section: &Section| format!("<a href=\"#{}\">{}</a>", anchor(&section.title), escape(&section.title));
    let links: String = sections.iter().map(link).collect();
    let body: String = sections.iter().map(of_section).collect();
    let triangles: u64 = record.meshes.iter().map(|mesh| mesh.triangles).sum();
    let lead = escape(&format!(
        "{} meshes ({} triangles), {} algorithms, {} targets · lodbake {}",
        record.meshes.len(),
        crate::progress::quantity::count(triangles),
        record.algorithms.len(),
        record.targets.len(),
        record.version
    ));
    let body =
        format!("<header><h1>{heading}</h1>\n<p>{lead}</p>\n<nav>{links}</nav></header>\n<main>\n{body}</main>\n");
    document(&title, "", &body)
}

fn of_section(section: &Section) -> String {
    let mut text = format!("<section id=\"{}\">\n<h2>{}</h2>\n", anchor(&section.title), escape(&section.title));
    for words in &section.words {
        text.extend(["<p>", &escape(words), "</p>\n"]);
    }
    text.push_str(&figures(&section.plots));
    text.extend(section.tables.iter().filter(|table| !table.rows.is_empty()).map(of_table));
    text.push_str("</section>\n");
    text
}

fn of_table(table: &Table) -> String {
    let class = |column: usize| if column < table.numbers_from { "" } else { " class=\"n\"" };
    let text = |column: usize, cell: &str| match cell.split_once(" (") {
        Some((before, behind)) if table.is_stacked && table.numbers_from <= column => {
            format!("{}<small>{}</small>", escape(before), escape(behind.trim_end_matches(')')))
        }
        _ => escape(cell),
    };
    let row = |cells: &[String], tag: &str| {
        let cell = |(i, c): (usize, &String)| format!("<{tag}{}>{}</{tag}>", class(i), text(i, c));
        let cells: String = cells.iter().enumerate().map(cell).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let title = if table.title.is_empty() { String::new() } else { format!("<h3>{}</h3>\n", escape(&table.title)) };
    let rows: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
    let header = row(&table.header, "th");
    format!("{title}<div class=\"wide\"><table>\n<thead>{header}</thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n")
}
