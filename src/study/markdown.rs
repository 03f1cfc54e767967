//! A study as Markdown: the tables, no plots.

use super::record::Record;
use super::sections::{Section, Table, sections};

/// `study.md`.
pub fn markdown(record: &Record) -> String {
    let mut text = format!("# Study `{}`\n", record.study);
    for section in sections(record) {
        text.push_str(&of_section(&section));
    }
    text
}

/// The comparison alone; empty if nothing can be compared.
pub fn summary(record: &Record) -> String {
    let first = sections(record).into_iter().next().filter(|section| section.title == "Comparison");
    first.map_or_else(String::new, |section| section.tables.iter().take(1).map(of_table).collect())
}

fn of_section(section: &Section) -> String {
    let mut text = format!("\n## {}\n", section.title);
    for words in &section.words {
        text.extend(["\n", words, "\n"]);
    }
    for table in section.tables.iter().filter(|table| !table.rows.is_empty()) {
        if !table.title.is_empty() {
            text.extend(["\n### ", &cell(&table.title), "\n"]);
        }
        text.extend(["\n", &of_table(table)]);
    }
    text
}

fn of_table(table: &Table) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.iter().map(|c| cell(c)).collect::<Vec<_>>().join(" | "));
    let rule = (0..table.header.len()).map(|column| if column < table.numbers_from { "---|" } else { "---:|" });
    let mut text = line(&table.header);
    text.extend(["|", &rule.collect::<String>(), "\n"]);
    table.rows.iter().for_each(|row| text.push_str(&line(row)));
    text
}

/// A bar would end the cell, a line break the row; the rest of what Markdown knows is disarmed as well.
fn cell(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '|' | '*' | '_' | '`' | '<' | '[' | '\\' => out.extend(['\\', c]),
            '\n' | '\r' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_stay_cells() {
        assert_eq!(cell("a|b\nc_d `x` <y>"), "a\\|b c\\_d \\`x\\` \\<y>");
    }
}
