//! The report as one page with nothing beside it: summary, findings, changes, a table to sort and filter, plots, and of
//! each asset its contact sheet and, if asked for, a live view of its levels.
//!
//! Pictures and models come from outside. Everything but the live view works without a graphics card, most without a
//! script; all of it without a network.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::{Publication, scenes_by_severity, status, worst_look};
use crate::budget::{Finding, figure, level_facts, mesh_name};
use crate::config::Fact;
use crate::difference::{Difference, by, title};
use crate::page::plot::{Plot, Point, Series};
use crate::page::{document, escape, figures};
use crate::progress::quantity::{bytes, count, number, plural};
use crate::report::{MeshRecord, Report, SceneRecord, Severity, percent};

/// Most rows of the table of levels: browsers sort that many at once.
const MOST_ROWS: usize = 20_000;
/// Most points of the plot of looks.
const MOST_POINTS: usize = 3_000;
/// Most bars of the plot of bytes.
const MOST_BARS: usize = 60;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// What the page shows beside the record.
#[derive(Debug, Default)]
pub struct Extras<'a> {
    /// Earlier records with their names, the oldest first.
    pub history: &'a [(String, Report)],
    /// Pictures and models, in the order in which they are shown.
    pub assets: &'a [Asset],
    /// The program that shows models; without it there is no live view.
    pub viewer: Option<&'a str>,
}

/// An asset to look at.
#[derive(Clone, Debug, Default)]
pub struct Asset {
    /// Scene file, relative to its input folder.
    pub scene: String,
    /// Its contact sheet.
    pub sheet: Option<Sheet>,
    /// The written scene as one GLB.
    pub model: Option<Vec<u8>>,
    /// Why there is no picture or no model.
    pub note: Option<String>,
}

/// A contact sheet: the source, then each level with its difference from it.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// The picture.
    pub jpeg: Vec<u8>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// How many levels it shows.
    pub levels: usize,
}

/// The page.
pub fn html(publication: &Publication<'_>, extras: &Extras<'_>) -> String {
    let name = format!("lodbake report: {}", publication.verdict());
    let parts = [
        ("summary", "Summary", summary(publication)),
        ("findings", "Findings", findings(publication)),
        ("changes", "Changes since the baseline", publication.difference.map(changes).unwrap_or_default()),
        ("history", "History", history(publication.report, extras.history)),
        ("plots", "Looks and sizes", plots(publication.report)),
        ("levels", "Levels", levels(publication)),
        ("assets", "Assets", assets(publication, extras)),
    ];
    let shown = || parts.iter().filter(|(_, _, text)| !text.is_empty());
    let link = |(id, title, _): &(&str, &str, String)| format!("<a href=\"#{id}\">{title}</a>");
    let links: String = shown().map(link).collect();
    let section = |(id, title, text): &(&str, &str, String)| {
        let heading = format!("<h2 id=\"{id}-title\">{title}</h2>");
        format!("<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n{heading}\n{text}</section>\n")
    };
    let sections: String = shown().map(section).collect();
    let viewer =
        extras.viewer.map(|program| format!("<script>\n{}\n</script>\n", harmless(program))).unwrap_or_default();
    let body = format!(
        "<a class=\"skip\" href=\"#levels\">Skip to the table of levels</a>\n<header><h1>{}</h1>\n<p>{}</p>\n\
         <nav aria-label=\"Sections\">{links}</nav></header>\n<main>\n{sections}</main>\n<script>\n{SCRIPT}</script>\n{viewer}",
        escape(&name),
        escape(&format!("{}, {}", publication.report.tool, plural(publication.report.totals.files, "scene")))
    );
    document(&name, STYLE, &body)
}

/// A program between tags must not contain the closing one.
fn harmless(program: &str) -> String {
    program.replace("</script", "<\\/script")
}

fn summary(publication: &Publication<'_>) -> String {
    let totals = &publication.report.totals;
    let worst = publication.report.scenes.iter().filter_map(|scene| Some((worst_look(scene)?, scene)));
    let worst = worst.max_by(|a, b| a.0.total_cmp(&b.0));
    let texture: u64 = publication
        .report
        .scenes
        .iter()
        .filter_map(|s| s.costs.as_ref())
        .flat_map(|c| &c.images)
        .map(|i| i.bytes)
        .sum();
    let mut cards = vec![
        ("Findings", publication.verdict()),
        ("Scenes", format!("{} baked, {} failed", count(totals.baked), count(totals.failed))),
        ("Meshes", format!("{} found, {} distinct", count(totals.meshes_found), count(totals.meshes_distinct))),
        ("Instances", count(totals.instances)),
        ("Bytes in, out", format!("{}, {}", bytes(totals.bytes_in), bytes(totals.bytes_out))),
        ("Textures", bytes(texture)),
    ];
    if let [source, levels @ ..] = &totals.triangles_drawn[..] {
        let chain = levels.iter().map(|l| count(*l)).collect::<Vec<_>>().join(", ");
        cards.push(("Triangles drawn", format!("{}; by level {chain}", count(*source))));
    }
    if let Some((look, scene)) = worst {
        cards.push(("Worst d_RMS", format!("{} in {}", number(look), scene.path)));
    }
    let card = |(name, value): &(&str, String)| format!("<div><dt>{name}</dt><dd>{}</dd></div>\n", escape(value));
    format!("<dl class=\"cards\">\n{}</dl>\n", cards.iter().map(card).collect::<String>())
}

fn findings(publication: &Publication<'_>) -> String {
    if publication.findings.is_empty() {
        return "<p>Nothing is beyond its limit.</p>\n".to_owned();
    }
    let row = |finding: &Finding| {
        let (class, word) = match finding.severity {
            Severity::Error => ("error", "error"),
            Severity::Warning => ("warning", "warning"),
        };
        format!(
            "<tr><td><span class=\"{class}\">{word}</span></td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
            code(&finding.place()),
            code(&finding.message),
            code(&finding.help)
        )
    };
    let rows: String = publication.findings.iter().take(1_000).map(row).collect();
    let more = match publication.findings.len().checked_sub(1_000) {
        None | Some(0) => String::new(),
        Some(more) => format!("<p>… and {} more.</p>\n", count(more as u64)),
    };
    format!(
        "{}<table><caption class=\"hidden\">Findings, the worst first</caption><thead><tr><th scope=\"col\">how bad</th>\
         <th scope=\"col\">where</th><th scope=\"col\">what</th><th scope=\"col\">what would help</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n{more}",
        wide("Findings")
    )
}

fn changes(difference: &Difference) -> String {
    if difference.changes.is_empty() {
        return format!("<p>No change: {} the same.</p>\n", plural(difference.unchanged, "scene"));
    }
    let row = |change: &crate::difference::Change| {
        let class = if change.is_regression { "error" } else { "plain" };
        format!(
            "<tr><td><span class=\"{class}\">{}</span></td><td>{}</td><td>{}</td></tr>\n",
            title(change.kind),
            code(&change.place()),
            code(&change.message())
        )
    };
    let rows: String = difference.changes.iter().take(500).map(row).collect();
    let sum = |sum: &crate::difference::Sum| {
        let by = if sum.base == sum.head { "=".to_owned() } else { by(sum.base, sum.head) };
        let (base, head) = (figure(sum.fact, sum.base), figure(sum.fact, sum.head));
        format!(
            "<tr><td>{}</td><td class=\"n\">{base}</td><td class=\"n\">{head}</td><td class=\"n\">{by}</td></tr>\n",
            sum.fact.title()
        )
    };
    let sums: String = difference.sums.iter().map(sum).collect();
    format!(
        "{}<table><thead><tr><th scope=\"col\"></th><th scope=\"col\">where</th><th scope=\"col\">what</th></tr></thead>\n<tbody>\n\
         {rows}</tbody></table></div>\n<h3>In sum</h3>\n{}<table><thead><tr><th scope=\"col\">over all scenes</th>\
         <th scope=\"col\" class=\"n\">before</th><th scope=\"col\" class=\"n\">now</th><th scope=\"col\" class=\"n\"></th></tr></thead>\n\
         <tbody>\n{sums}</tbody></table></div>\n",
        wide("Changes"),
        wide("Sums")
    )
}

fn history(now: &Report, past: &[(String, Report)]) -> String {
    if past.is_empty() {
        return String::new();
    }
    let all: Vec<(&str, &Report)> =
        past.iter().map(|(name, report)| (name.as_str(), report)).chain([("now", now)]).collect();
    let plot = |title: &str, axis: &str, value: &dyn Fn(&Report) -> f64| {
        let point = |(at, (name, report)): (usize, &(&str, &Report))| Point {
            at: [(at + 1) as f64, value(report)],
            ends: None,
            name: (*name).to_owned(),
        };
        let series =
            Series { name: title.to_owned(), points: all.iter().enumerate().map(point).collect(), ..Series::default() };
        let axes = ["report".to_owned(), axis.to_owned()];
        Plot { title: title.to_owned(), axes, series: vec![series], is_even: true, ..Plot::default() }
    };
    let worst = |report: &Report| report.scenes.iter().filter_map(worst_look).fold(0.0, f64::max);
    let drawn = |report: &Report| report.totals.triangles_drawn.first().copied().unwrap_or(0) as f64;
    figures(&[
        plot("Bytes of the outputs", "bytes", &|report| report.totals.bytes_out as f64),
        plot("Triangles drawn", "triangles", &drawn),
        plot("Worst d_RMS", "d_RMS", &worst),
    ])
}

fn plots(report: &Report) -> String {
    let levels = report.totals.triangles_drawn.len();
    let mut series: Vec<Series> =
        (1..levels).map(|k| Series { name: format!("level {k}"), color: k - 1, ..Series::default() }).collect();
    let mut left = MOST_POINTS;
    for level in report.scenes.iter().flat_map(|scene| &scene.meshes).flat_map(|mesh| &mesh.levels) {
        if let (Some(look), Some(series)) = (level.d_rms, series.get_mut(level.number as usize - 1))
            && 0 < left
        {
            series.points.push(Point { at: [level.triangles as f64, look], ends: None, name: String::new() });
            left -= 1;
        }
    }
    for series in &mut series {
        series.is_scattered = true;
    }
    let axes = ["triangles".to_owned(), "d_RMS".to_owned()];
    let plot = Plot { title: "Image difference against triangles".to_owned(), axes, series, ..Plot::default() };
    let looks = if left == MOST_POINTS { String::new() } else { figures(&[plot]) };
    looks + &bars(report)
}

/// Bytes of each scene: geometry and textures.
fn bars(report: &Report) -> String {
    let part = |scene: &SceneRecord| {
        let costs = scene.costs.clone().unwrap_or_default();
        let textures: u64 = costs.images.iter().map(|image| image.bytes).sum();
        (costs.geometry_bytes, textures)
    };
    let mut all: Vec<(&SceneRecord, u64, u64)> =
        report.scenes.iter().map(|scene| (scene, part(scene).0, part(scene).1)).filter(|(_, g, t)| 0 < g + t).collect();
    all.sort_by_key(|(scene, geometry, textures)| (std::cmp::Reverse(geometry + textures), &scene.path));
    let Some(most) = all.first().map(|(_, geometry, textures)| (geometry + textures) as f64) else {
        return String::new();
    };
    let more = match all.len().checked_sub(MOST_BARS) {
        None | Some(0) => String::new(),
        Some(more) => format!("<p>… and {} smaller scenes.</p>\n", count(more as u64)),
    };
    let row = |(scene, geometry, textures): &(&SceneRecord, u64, u64)| {
        let width = |bytes: u64| 100.0 * bytes as f64 / most;
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"bars\" aria-hidden=\"true\">\
             <i class=\"c0\" style=\"width:{:.2}%\"></i><i class=\"c1\" style=\"width:{:.2}%\"></i></td></tr>\n",
            escape(&scene.path),
            bytes(*geometry),
            bytes(*textures),
            width(*geometry),
            width(*textures)
        )
    };
    let rows: String = all.iter().take(MOST_BARS).map(row).collect();
    format!(
        "<h3>Bytes of each scene</h3>\n{}<table class=\"sizes\"><thead><tr><th scope=\"col\">scene</th>\
         <th scope=\"col\" class=\"n\"><span class=\"c0\">■</span> geometry</th>\
         <th scope=\"col\" class=\"n\"><span class=\"c1\">■</span> textures</th><td></td></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n{more}",
        wide("Bytes of each scene")
    )
}

fn levels(publication: &Publication<'_>) -> String {
    let mut rows = String::new();
    let mut made = 0;
    for (scene, findings) in scenes_by_severity(publication) {
        for mesh in &scene.meshes {
            let name = mesh_name(mesh);
            let own: Vec<&&Finding> = findings.iter().filter(|f| f.mesh.as_ref().is_none_or(|m| *m == name)).collect();
            let numbers = std::iter::once(0).chain(mesh.levels.iter().map(|level| level.number));
            for number in numbers {
                if made < MOST_ROWS {
                    rows.push_str(&level_row(scene, mesh, &name, number, &own));
                }
                made += 1;
            }
        }
    }
    let columns: [(&str, bool); 9] = [
        ("scene", false),
        ("mesh", false),
        ("level", true),
        ("triangles", true),
        ("of source", true),
        ("vertices", true),
        ("d_RMS", true),
        ("distance, of radius", true),
        ("state", false),
    ];
    let head = |(name, is_number): &(&str, bool)| {
        let class = if *is_number { " class=\"n\"" } else { "" };
        format!("<th scope=\"col\"{class} aria-sort=\"none\"><button type=\"button\">{name}</button></th>")
    };
    let heads: String = columns.iter().map(head).collect();
    let more = match made.checked_sub(MOST_ROWS) {
        None | Some(0) => String::new(),
        Some(more) => format!("<p>… and {} more rows, of scenes without findings.</p>\n", count(more as u64)),
    };
    format!(
        "<form class=\"filter\" role=\"search\"><label>Filter <input type=\"search\" id=\"filter\" autocomplete=\"off\" \
         placeholder=\"scene or mesh\"></label>\n<label>Show <select id=\"state\"><option value=\"\">all levels</option>\
         <option value=\"error\">those with errors</option><option value=\"warning\">those with findings</option></select></label>\n\
         <p id=\"shown\" role=\"status\"></p></form>\n{}<table id=\"table\"><caption class=\"hidden\">Levels of all meshes; \
         the buttons in the header sort</caption><thead><tr>{heads}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n{more}",
        wide("Levels")
    )
}

/// Cells that are numbers carry the plain value for sorting.
fn level_row(scene: &SceneRecord, mesh: &MeshRecord, name: &str, level: u64, findings: &[&&Finding]) -> String {
    let fact = |wanted| level_facts(mesh).find(|(l, f, _)| (*l, *f) == (level, wanted)).map(|(_, _, value)| value);
    let cell = |value: Option<f64>, told: &dyn Fn(f64) -> String| {
        let (plain, told) = value.map_or_else(|| (String::new(), "–".to_owned()), |v| (format!("{v}"), told(v)));
        format!("<td class=\"n\" data-v=\"{plain}\">{told}</td>")
    };
    let triangles = fact(Fact::Triangles);
    let share = triangles.filter(|_| 0 < mesh.triangles).map(|t| t / mesh.triangles as f64);
    // What is about the whole scene stands at its sources.
    let is_own = |f: &&&&Finding| if f.mesh.is_none() { level == 0 } else { f.level.is_none_or(|l| l == level) };
    let own = || findings.iter().filter(is_own);
    let state = if own().any(|f| f.severity == Severity::Error) {
        "error"
    } else if own().any(|_| true) {
        "warning"
    } else {
        ""
    };
    let word = if state.is_empty() { status(scene.status) } else { state };
    let class = if state.is_empty() { "plain" } else { state };
    let whole = |v: f64| count(v as u64);
    format!(
        "<tr data-state=\"{state}\"><td>{}</td><td>{}</td>{}{}{}{}{}{}<td><span class=\"{class}\">{word}</span></td></tr>\n",
        escape(&scene.path),
        escape(name),
        cell(Some(level as f64), &whole),
        cell(triangles, &whole),
        cell(share, &percent),
        cell(fact(Fact::Vertices), &whole),
        cell(fact(Fact::DRms), &number),
        cell(fact(Fact::Surface), &percent)
    )
}

fn assets(publication: &Publication<'_>, extras: &Extras<'_>) -> String {
    let one = |(index, asset): (usize, &Asset)| {
        let own: Vec<&Finding> =
            publication.findings.iter().filter(|finding| finding.scene.as_ref() == Some(&asset.scene)).collect();
        let line =
            |finding: &&Finding| format!("<li>{}</li>", code(&format!("{}: {}", finding.place(), finding.message)));
        let listed: String = own.iter().take(5).map(line).collect();
        let listed = if own.is_empty() { String::new() } else { format!("<ul>{listed}</ul>\n") };
        let sheet = asset.sheet.as_ref().map(|sheet| contact_sheet(&asset.scene, sheet)).unwrap_or_default();
        let note = asset.note.as_ref().map(|note| format!("<p>{}</p>\n", escape(note))).unwrap_or_default();
        let scene = publication.report.scenes.iter().find(|scene| scene.path == asset.scene);
        let plot = scene.map(asset_plot).unwrap_or_default();
        let view = asset.model.as_ref().filter(|_| extras.viewer.is_some()).map_or_else(String::new, |model| {
            format!(
                "<div class=\"view\" data-name=\"{}\"><button type=\"button\">Show in 3-D</button>\
                 <script type=\"application/octet-stream\">{}</script></div>\n",
                escape(&asset.scene),
                STANDARD.encode(model)
            )
        });
        format!(
            "<article id=\"asset-{index}\"><h3>{}</h3>\n{listed}{sheet}{note}{view}{plot}</article>\n",
            escape(&asset.scene)
        )
    };
    extras.assets.iter().enumerate().map(one).collect()
}

fn contact_sheet(scene: &str, sheet: &Sheet) -> String {
    let levels = (1..=sheet.levels).map(|k| format!("<span>level {k}</span><span>difference × 8</span>"));
    let columns = 1 + 2 * sheet.levels;
    let alt = format!("{scene}: source, then each of {} levels with its difference from the source", sheet.levels);
    format!(
        "<figure class=\"sheet\" style=\"max-width:{}px\"><figcaption style=\"grid-template-columns:repeat({columns},1fr)\">\
         <span>source</span>{}</figcaption><img loading=\"lazy\" width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/jpeg;base64,{}\"></figure>\n",
        sheet.size[0],
        levels.collect::<String>(),
        sheet.size[0],
        sheet.size[1],
        escape(&alt),
        STANDARD.encode(&sheet.jpeg)
    )
}

/// Looks of the levels of an asset's meshes: the ten with the most triangles.
fn asset_plot(scene: &SceneRecord) -> String {
    let mut meshes: Vec<&MeshRecord> =
        scene.meshes.iter().filter(|m| m.levels.iter().any(|l| l.d_rms.is_some())).collect();
    meshes.sort_by_key(|mesh| (std::cmp::Reverse(mesh.triangles), mesh.index));
    let series: Vec<Series> = meshes
        .iter()
        .take(crate::page::plot::COLORS)
        .enumerate()
        .map(|(color, mesh)| {
            let mut points: Vec<Point> = (mesh.levels.iter())
                .filter_map(|l| Some(Point { at: [l.triangles as f64, l.d_rms?], ends: None, name: String::new() }))
                .collect();
            points.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
            Series { name: mesh_name(mesh), color, points, ..Series::default() }
        })
        .collect();
    let axes = ["triangles".to_owned(), "d_RMS".to_owned()];
    let plot = Plot { title: "Its levels".to_owned(), axes, series, ..Plot::default() };
    if plot.series.is_empty() { String::new() } else { figures(&[plot]) }
}

/// A part that may be wider than the page: reached and scrolled by keyboard too.
fn wide(name: &str) -> String {
    format!("<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"{name}\">")
}

/// Text with `code` between grave accents.
fn code(text: &str) -> String {
    let mut out = String::new();
    for (number, part) in text.split('`').enumerate() {
        let part = escape(part);
        if number % 2 == 1 { out.extend(["<code>", &part, "</code>"]) } else { out.push_str(&part) }
    }
    out
}
