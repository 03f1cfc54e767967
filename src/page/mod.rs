//! What pages of this program have in common: the frame, the style in light and dark, plots with their legends.
//!
//! Text in, text out. A page is one file with nothing beside it. Knows nothing of studies and reports.

pub mod plot;

use plot::{COLORS, Plot, mark};

/// A whole page. `style` is added to the common one; `body` stands between the tags, and scripts are part of it.
pub fn document(title: &str, style: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>\n{STYLE}{colors}{style}</style>\n\
         </head>\n<body>\n{body}</body>\n</html>\n",
        colors = colors()
    )
}

/// What HTML would take for markup.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// Of a section, for links to it.
pub fn anchor(title: &str) -> String {
    title.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

/// Plots beside each other, and one legend for all: they have the same series.
pub fn figures(plots: &[Plot]) -> String {
    let Some(first) = plots.first() else { return String::new() };
    let figure = |plot: &Plot| {
        let line = if plot.frontier.len() < 2 { "" } else { " <span>(line: nobody is better in both)</span>" };
        format!("<figure><figcaption>{}{line}</figcaption>\n{}</figure>\n", escape(&plot.title), plot.svg())
    };
    let figures: String = plots.iter().map(figure).collect();
    let class = if plots.len() == 1 { "plots one" } else { "plots" };
    format!("{}<div class=\"{class}\">\n{figures}</div>\n", legend(first))
}

/// One for all plots of a section: they have the same series. A single one needs none.
fn legend(plot: &Plot) -> String {
    if plot.series.len() < 2 {
        return String::new();
    }
    let item = |series: &plot::Series| {
        let (color, dashed) = (series.color % COLORS, if series.is_dashed { " dashed" } else { "" });
        let sample = format!("<path class=\"line{dashed}\" d=\"M-15 0H15\"/>{}", mark(series.color));
        format!(
            "<span><svg viewBox=\"-16 -7 32 14\" class=\"key\" aria-hidden=\"true\"><g class=\"c{color}\">{sample}</g></svg>{}</span>",
            escape(&series.name)
        )
    };
    format!("<p class=\"legend\">{}</p>\n", plot.series.iter().map(item).collect::<String>())
}

/// Of the series, in light and in dark: far apart for colour-blind readers too (after Okabe and Ito, 2008), and with
/// enough contrast on either ground.
const SERIES: [[&str; 2]; COLORS] = [
    ["#0a63c9", "#6cb0ff"],
    ["#b85c00", "#ffab57"],
    ["#00825f", "#3fd0a4"],
    ["#b3347f", "#ff8cc8"],
    ["#6d48c9", "#b9a0ff"],
    ["#8a6d00", "#e8cf4a"],
    ["#00788a", "#4fd3e6"],
    ["#5b6470", "#aab4c0"],
    ["#a33a2a", "#ff9a8a"],
    ["#4f7a1d", "#a6d86b"],
];

fn colors() -> String {
    let rules = |dark: usize| -> String {
        let rule = |(i, pair): (usize, &[&str; 2])| format!(".c{i}{{color:{}}}\n", pair[dark]);
        SERIES.iter().enumerate().map(rule).collect()
    };
    format!("{}@media (prefers-color-scheme: dark){{\n{}}}\n", rules(0), rules(1))
}

const STYLE: &str = "\
:root{--ground:#fff;--text:#1b2027;--soft:#59636f;--rule:#d9dee4;--stripe:#f5f7f9;--accent:#0a63c9}
@media (prefers-color-scheme: dark){:root{--ground:#14181d;--text:#e4e8ed;--soft:#9aa6b2;--rule:#2f3740;--stripe:#1b2127;--accent:#6cb0ff}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1280px;padding:1.5rem clamp(1rem,4vw,2.5rem) 4rem;background:var(--ground);color:var(--text);font:16px/1.55 system-ui,sans-serif}
h1{font-size:1.7rem;margin:0 0 .2rem;overflow-wrap:anywhere}
h2{font-size:1.3rem;margin:2.6rem 0 .4rem;padding-bottom:.25rem;border-bottom:1px solid var(--rule)}
h3{font-size:1rem;margin:1.5rem 0 .4rem}
p{margin:.5rem 0;max-width:52rem}
header p{color:var(--soft)}
nav{display:flex;flex-wrap:wrap;gap:.2rem 1.1rem;margin-top:.6rem}
a{color:var(--accent);text-decoration:none}
a:hover{text-decoration:underline}
.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,350px),1fr));gap:1rem 1.4rem;margin:.6rem 0 1rem}
.one{display:block}
figure{margin:0;max-width:560px}
figcaption{font-weight:600;padding-left:.2rem}
figcaption span{font-weight:400;color:var(--soft);font-size:.85em}
svg{display:block;width:100%;height:auto}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1.3rem;max-width:none;font-size:.92rem}
.legend span{display:inline-flex;align-items:center;gap:.45rem}
.key{width:32px;height:14px;flex:none}
.grid{stroke:var(--rule);stroke-width:1}
.axis{stroke:var(--soft);stroke-width:1;fill:none}
svg text{font:11px system-ui,sans-serif;fill:var(--soft)}
svg .label{font-size:12px;fill:var(--text)}
svg .name{font-size:11px;fill:currentColor;paint-order:stroke;stroke:var(--ground);stroke-width:3px}
.middle{text-anchor:middle}
.end{text-anchor:end}
[class^=c] :is(circle,path){fill:currentColor;stroke:none}
[class^=c] .line{fill:none;stroke:currentColor;stroke-width:1.8;stroke-linejoin:round}
[class^=c] .dashed{stroke-dasharray:5 3.5;stroke-width:1.4}
[class^=c] .bar{fill:none;stroke:currentColor;stroke-width:1}
[class^=c] .open{fill:var(--ground);stroke:currentColor;stroke-width:1.9}
.frontier{fill:none;stroke:var(--soft);stroke-width:7;stroke-opacity:.22;stroke-linejoin:round;stroke-linecap:round}
.wide{overflow-x:auto;margin:.4rem 0 1rem}
table{border-collapse:collapse;font-size:.92rem;font-variant-numeric:tabular-nums}
th,td{padding:.3rem .8rem .3rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--rule)}
th{font-weight:600;color:var(--soft);white-space:nowrap}
small{display:block;font-size:.78rem;color:var(--soft)}
.n{text-align:right;white-space:nowrap;padding:.3rem .2rem .3rem 1.1rem}
tbody tr:nth-child(even){background:var(--stripe)}
@media print{body{max-width:none}section{break-inside:avoid-page}}
";
