//! A record as a reader meets it: sections with words, tables and plots. Markdown and the page are two forms of it.

use super::contrast::{Contrast, MEASURES, Needed, common, contrasts, frontier, needed, paired_times, pairs};
use super::record::{Cell, Measure, MeshFacts, Record, per_second};
use super::statistics::{Summary, geometric_mean};
use super::words::{NONE, mean_and_interval, number, probability};
use crate::page::plot::{Plot, Point, Series};
use crate::progress::quantity::count;

/// One part of the report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Paragraphs before the tables.
    pub words: Vec<String>,
    /// For the page alone.
    pub plots: Vec<Plot>,
    /// In order.
    pub tables: Vec<Table>,
}

/// Text in rows and columns. The first column names the row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it is about; empty where the section says it.
    pub title: String,
    /// Names of columns.
    pub header: Vec<String>,
    /// As long as the header.
    pub rows: Vec<Vec<String>>,
    /// Columns of numbers, from this one on, are set to the right.
    pub numbers_from: usize,
    /// What stands in brackets has a line of its own where there is room for lines.
    pub is_stacked: bool,
}

/// All sections, most important first.
pub fn sections(record: &Record) -> Vec<Section> {
    let mut sections = vec![
        summary(record),
        looks(record),
        surfaces(record),
        times(record),
        memory(record),
        frames(record),
        algorithms(record),
        failures(record),
        method(record),
    ];
    sections.retain(|section| !section.tables.is_empty() || !section.words.is_empty());
    sections
}

/// What is measured, for plots.
struct Quantity {
    measure: Measure,
    /// Values are shown times this.
    scale: f64,
    /// Of the axis.
    label: &'static str,
}

const D_RMS: Quantity = Quantity { measure: Measure::DRms, scale: 1.0, label: "d_RMS (0–255)" };
const DISTANCE: Quantity =
    Quantity { measure: Measure::DistanceRms, scale: 100.0, label: "RMS distance, % of diagonal" };
const WALL: Quantity = Quantity { measure: Measure::Wall, scale: 1000.0, label: "wall time, ms" };
const CPU: Quantity = Quantity { measure: Measure::Cpu, scale: 1000.0, label: "processor time, ms" };
const RESIDENT: Quantity = Quantity { measure: Measure::Resident, scale: 1e-6, label: "largest resident set, MB" };

/// Algorithms that are asked for the targets themselves. The others repeat curves of theirs and are left out of plots.
fn unmatched(record: &Record) -> impl Iterator<Item = usize> + '_ {
    (0..record.algorithms.len()).filter(|&algorithm| record.algorithms[algorithm].matched.is_none())
}

/// A quantity against the triangles reached, a plot for each mesh.
fn against_triangles(record: &Record, quantity: &Quantity) -> Vec<Plot> {
    let plot = |(number, mesh): (usize, &MeshFacts)| {
        let series = unmatched(record).map(|algorithm| {
            let point = |target: usize| {
                let cell = record.cell(number, target, algorithm);
                let summary = cell.summary(quantity.measure)?;
                let ends = summary.spread.map(|spread| [spread.low * quantity.scale, spread.high * quantity.scale]);
                let at = [cell.level.as_ref()?.triangles as f64, summary.mean * quantity.scale];
                Some(Point { at, ends, name: String::new() })
            };
            let mut points: Vec<Point> = (0..record.targets.len()).filter_map(point).collect();
            points.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
            series_of(record, algorithm, points)
        });
        Plot {
            title: mesh.name.clone(),
            axes: ["triangles".to_owned(), quantity.label.to_owned()],
            series: series.collect(),
            frontier: Vec::new(),
            is_even: false,
        }
    };
    let plots = record.meshes.iter().enumerate().map(plot);
    plots.filter(|plot| plot.series.iter().any(|series| !series.points.is_empty())).collect()
}

fn series_of(record: &Record, algorithm: usize, points: Vec<Point>) -> Series {
    let facts = &record.algorithms[algorithm];
    let color = unmatched(record).take_while(|&other| other != algorithm).count();
    Series { name: facts.name.clone(), color, is_dashed: !facts.is_own, is_scattered: false, points }
}

/// A table for each mesh: a row for each algorithm, a column for each target.
fn by_mesh(record: &Record, text: impl Fn(&Cell) -> Option<String>) -> Vec<Table> {
    let table = |(number, mesh): (usize, &MeshFacts)| {
        let row = |algorithm: usize| {
            let cells = (0..record.targets.len()).map(|target| record.cell(number, target, algorithm));
            let name = record.algorithms[algorithm].name.clone();
            std::iter::once(name).chain(cells.map(|cell| text(cell).unwrap_or_else(|| NONE.to_owned()))).collect()
        };
        Table {
            title: mesh_title(mesh),
            header: std::iter::once("algorithm".to_owned()).chain(record.targets.iter().cloned()).collect(),
            rows: (0..record.algorithms.len()).map(row).collect(),
            numbers_from: 1,
            is_stacked: false,
        }
    };
    record.meshes.iter().enumerate().filter(|(_, mesh)| mesh.error.is_none()).map(table).collect()
}

fn mesh_title(mesh: &MeshFacts) -> String {
    format!("{} ({} triangles)", mesh.name, count(mesh.triangles))
}

fn header(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Ratios over everything, and looks against time.
fn summary(record: &Record) -> Section {
    let all = contrasts(record);
    if all.is_empty() {
        return Section::default();
    }
    let row = |(first, second): (usize, usize)| {
        let found: Vec<Option<&Contrast>> = (MEASURES.iter())
            .map(|&measure| all.iter().find(|c| (c.first, c.second, c.measure) == (first, second, measure)))
            .collect();
        let most = found.iter().flatten().map(|contrast| contrast.test.n).max()?;
        let names = [first, second].map(|index| record.algorithms[index].name.clone());
        let ratios = found.into_iter().map(|contrast| contrast.map_or_else(|| NONE.to_owned(), |c| ratio(c, most)));
        Some(names.into_iter().chain(ratios).chain([most.to_string()]).collect())
    };
    let names = MEASURES.iter().map(|&measure| words_of(measure).to_owned());
    let table = Table {
        header: header(&["algorithm", "against"]).into_iter().chain(names).chain(header(&["pairs"])).collect(),
        rows: pairs(record).into_iter().filter_map(row).collect(),
        numbers_from: 2,
        is_stacked: true,
        ..Table::default()
    };
    let words = format!(
        "Each algorithm against {}; one that is asked for another's counts, against that one. Ratios are geometric means \
         over the pairs of mesh and target that both have; below 1, the algorithm has less. In brackets the 95 % interval \
         and the probability p of such a ratio if there were no difference, from a paired t-test on logarithms. A ratio of \
         triangles that is not 1 says that the others compare levels of different size.",
        record.algorithms[record.baseline].name
    );
    let (plot, points) = looks_against_time(record);
    let plots = plot.into_iter().collect();
    Section { title: "Comparison".to_owned(), words: vec![words], plots, tables: vec![table, points] }
}

/// `0.631 (0.497 to 0.802, p 0.002)`; with the number of pairs where it is less than the most.
fn ratio(contrast: &Contrast, most: usize) -> String {
    let test = &contrast.test;
    let fewer =
        if test.n == most { String::new() } else { format!(", {} pair{}", test.n, if test.n == 1 { "" } else { "s" }) };
    match &test.test {
        None => format!("{}{fewer}", number(test.ratio)),
        Some(spread) => {
            let (low, high, p) = (number(spread.low), number(spread.high), probability(spread.p));
            format!("{} ({low} to {high}, p {p}{fewer})", number(test.ratio))
        }
    }
}

fn words_of(measure: Measure) -> &'static str {
    match measure {
        Measure::Triangles => "triangles reached",
        Measure::DRms => "d_RMS",
        Measure::DistanceRms => "RMS distance",
        Measure::Wall => "wall time",
        Measure::Cpu => "processor time",
        Measure::Resident => "resident set",
        other => other.name(),
    }
}

/// Geometric means of time and `d_RMS` for each algorithm that is asked for the targets themselves.
fn looks_against_time(record: &Record) -> (Option<Plot>, Table) {
    let means = |algorithm: usize| {
        let (own, base) = common(record, Measure::Wall, algorithm, record.baseline);
        let time = geometric_mean(&own)? / geometric_mean(&base)?;
        let (own, base) = common(record, Measure::DRms, algorithm, record.baseline);
        Some((algorithm, time, geometric_mean(&own)? / geometric_mean(&base)?, own.len()))
    };
    let found: Vec<(usize, f64, f64, usize)> = unmatched(record).filter_map(means).collect();
    let points: Vec<(f64, f64)> = found.iter().map(|&(_, time, looks, _)| (time, looks)).collect();
    let best = frontier(&points);
    let rows = found.iter().enumerate().map(|(number_of_row, &(algorithm, time, looks, pairs))| {
        let name = record.algorithms[algorithm].name.clone();
        let mark = if best.contains(&number_of_row) { "yes" } else { "" };
        vec![name, number(time), number(looks), mark.to_owned(), pairs.to_string()]
    });
    let table = Table {
        title: format!("Looks against time, relative to {}", record.algorithms[record.baseline].name),
        header: header(&["algorithm", "wall time", "d_RMS", "on the frontier", "pairs"]),
        rows: rows.collect(),
        numbers_from: 1,
        is_stacked: false,
    };
    let series = found.iter().map(|&(algorithm, time, looks, _)| {
        let name = record.algorithms[algorithm].name.clone();
        series_of(record, algorithm, vec![Point { at: [time, looks], ends: None, name }])
    });
    let plot = Plot {
        title: "Looks against time".to_owned(),
        axes: ["wall time, relative".to_owned(), "d_RMS, relative".to_owned()],
        series: series.collect(),
        frontier: best.iter().map(|&index| [points[index].0, points[index].1]).collect(),
        is_even: false,
    };
    ((1 < found.len()).then_some(plot), table)
}

fn looks(record: &Record) -> Section {
    let mut tables = by_mesh(record, |cell| {
        let level = cell.level.as_ref()?;
        Some(format!("{} ({})", number(level.d_rms), count(level.triangles)))
    });
    tables.extend(triangles_needed(record));
    let words = format!(
        "d_RMS: root mean square of luminance differences to the source over 24 views of {0} × {0} pixels, 0 to 255; less is \
         closer. In brackets the triangles reached. Plots leave out algorithms that are asked for another's counts. Drawn \
         by: {1}.",
        record.size, record.renderer
    );
    Section { title: "Looks".to_owned(), words: vec![words], plots: against_triangles(record, &D_RMS), tables }
}

fn triangles_needed(record: &Record) -> Option<Table> {
    if record.appearance.is_empty() {
        return None;
    }
    let mut rows = Vec::new();
    for (number_of_mesh, mesh) in record.meshes.iter().enumerate().filter(|(_, mesh)| mesh.error.is_none()) {
        for (algorithm, facts) in record.algorithms.iter().enumerate() {
            let levels = (0..record.targets.len()).filter_map(|target| {
                let level = record.cell(number_of_mesh, target, algorithm).level.as_ref()?;
                Some((level.triangles, level.d_rms))
            });
            let levels: Vec<(u64, f64)> = levels.collect();
            let text = |threshold: &f64| match needed(&levels, *threshold) {
                None => NONE.to_owned(),
                Some(Needed::About(triangles)) => count(triangles.round() as u64),
                Some(Needed::MoreThan(triangles)) => format!("> {}", count(triangles)),
                Some(Needed::AtMost(triangles)) => format!("≤ {}", count(triangles)),
            };
            let names = [mesh.name.clone(), facts.name.clone()];
            rows.push(names.into_iter().chain(record.appearance.iter().map(text)).collect());
        }
    }
    let thresholds = record.appearance.iter().map(|threshold| format!("d_RMS {threshold}"));
    Some(Table {
        title: "Triangles needed for an image difference, interpolated between levels".to_owned(),
        header: header(&["mesh", "algorithm"]).into_iter().chain(thresholds).collect(),
        rows,
        numbers_from: 2,
        is_stacked: false,
    })
}

fn surfaces(record: &Record) -> Section {
    let tables = by_mesh(record, |cell| {
        let distance = cell.level.as_ref()?.distance.as_ref()?;
        Some(format!("{} ({})", number(distance.rms * 100.0), number(distance.max * 100.0)))
    });
    let words = "Distance between the surfaces of source and level, the worse of both directions, in % of the diagonal of \
                 the source's box: root mean square, in brackets the largest.";
    Section {
        title: "Surface distance".to_owned(),
        words: vec![words.to_owned()],
        plots: against_triangles(record, &DISTANCE),
        tables,
    }
}

fn times(record: &Record) -> Section {
    let mut tables = by_mesh(record, |cell| {
        let wall = mean_and_interval(&cell.summary(WALL.measure)?, WALL.scale);
        let cpu = cell.summary(CPU.measure).map_or_else(|| NONE.to_owned(), |cpu| mean_and_interval(&cpu, CPU.scale));
        Some(format!("{wall} ({cpu})"))
    });
    tables.extend(time_differences(record));
    let words = "Milliseconds of wall time with the 95 % t-interval, in brackets processor time. One level a run, from the \
                 source's file to the level's file. A command's time holds the start of its program; lodbake's own runs are \
                 calls in the study's process, on one thread, and write the source beside the level.";
    Section { title: "Time".to_owned(), words: vec![words.to_owned()], plots: against_triangles(record, &WALL), tables }
}

/// Differences to the baseline, run by run.
fn time_differences(record: &Record) -> Option<Table> {
    let baseline = record.baseline;
    let mut rows = Vec::new();
    for (number_of_mesh, mesh) in record.meshes.iter().enumerate() {
        for algorithm in (0..record.algorithms.len()).filter(|&algorithm| algorithm != baseline) {
            let tests: Vec<Option<String>> = (0..record.targets.len())
                .map(|target| {
                    let test = paired_times(record, number_of_mesh, target, algorithm, baseline)?;
                    let ms = |seconds: f64| number(seconds * 1000.0);
                    let (low, high) = (ms(test.low), ms(test.high));
                    Some(format!("{} ({low} to {high}, p {})", ms(test.difference), probability(test.p)))
                })
                .collect();
            if tests.iter().any(Option::is_some) {
                let names = [mesh.name.clone(), record.algorithms[algorithm].name.clone()];
                let tests = tests.into_iter().map(|test| test.unwrap_or_else(|| NONE.to_owned()));
                rows.push(names.into_iter().chain(tests).collect());
            }
        }
    }
    (!rows.is_empty()).then(|| Table {
        title: format!(
            "Wall time minus that of {}, ms, runs of the same round paired",
            record.algorithms[baseline].name
        ),
        header: header(&["mesh", "algorithm"]).into_iter().chain(record.targets.iter().cloned()).collect(),
        rows,
        numbers_from: 2,
        is_stacked: true,
    })
}

fn memory(record: &Record) -> Section {
    if record.cells.iter().all(|cell| cell.summary(RESIDENT.measure).is_none()) {
        return Section::default();
    }
    let tables = by_mesh(record, |cell| {
        let resident = mean_and_interval(&cell.summary(RESIDENT.measure)?, RESIDENT.scale);
        let heap = cell.summary(Measure::Heap).map(|heap| format!(" ({})", number(heap.mean * RESIDENT.scale)));
        Some(format!("{resident}{}", heap.unwrap_or_default()))
    });
    let words = "Largest resident set of the process, in MB: program, runtime, libraries and data. lodbake is run once in a \
                 process of its own for it. In brackets the peak of its heap, counted byte by byte in the timed runs.";
    Section {
        title: "Memory".to_owned(),
        words: vec![words.to_owned()],
        plots: against_triangles(record, &RESIDENT),
        tables,
    }
}

fn frames(record: &Record) -> Section {
    let mut tables = by_mesh(record, |cell| Some(mean_and_interval(&cell.summary(Measure::FramesPerSecond)?, 1.0)));
    let meshes = record.meshes.iter().filter(|mesh| mesh.error.is_none());
    for (table, mesh) in tables.iter_mut().zip(meshes) {
        let rate = mesh.frame_seconds.and_then(per_second).map(|rate: Summary| mean_and_interval(&rate, 1.0));
        table.title = format!("{}; the source: {}", table.title, rate.unwrap_or_else(|| NONE.to_owned()));
    }
    let words = format!(
        "Renderings per second by the renderer that judges looks ({1}): 24 views of {0} × {0} pixels, one after the other, \
         each read back. Most of the time goes into pixels, so levels gain less than on a graphics card that is short of \
         vertices.",
        record.size, record.renderer
    );
    Section { title: "Frames per second".to_owned(), words: vec![words], plots: Vec::new(), tables }
}

fn algorithms(record: &Record) -> Section {
    let rows = record.algorithms.iter().map(|algorithm| {
        let matched = algorithm.matched.clone().unwrap_or_default();
        vec![algorithm.name.clone(), algorithm.what.clone(), matched]
    });
    let table = Table {
        header: header(&["algorithm", "what runs", "asked for the counts of"]),
        rows: rows.collect(),
        numbers_from: 3,
        ..Table::default()
    };
    Section { title: "Algorithms".to_owned(), words: Vec::new(), plots: Vec::new(), tables: vec![table] }
}

fn failures(record: &Record) -> Section {
    let meshes = record.meshes.iter().filter_map(|mesh| {
        let error = mesh.error.clone()?;
        Some(vec![mesh.name.clone(), String::new(), String::new(), error])
    });
    let cells = record.cells.iter().filter(|cell| record.meshes[cell.mesh].error.is_none()).filter_map(|cell| {
        let names =
            [&record.meshes[cell.mesh].name, &record.targets[cell.target], &record.algorithms[cell.algorithm].name];
        Some(names.into_iter().cloned().chain([cell.error.clone()?]).collect())
    });
    let rows: Vec<Vec<String>> = meshes.chain(cells).collect();
    if rows.is_empty() {
        return Section::default();
    }
    let header = header(&["mesh", "target", "algorithm", "error"]);
    let table = Table { header, rows, numbers_from: 4, ..Table::default() };
    Section { title: "Failures".to_owned(), words: Vec::new(), plots: Vec::new(), tables: vec![table] }
}

fn method(record: &Record) -> Section {
    let runs = record.cells.iter().map(|cell| cell.runs.len());
    let (least, most) = (runs.clone().filter(|&n| 0 < n).min().unwrap_or(0), runs.max().unwrap_or(0));
    let runs = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let first = format!(
        "lodbake {} with `{}` on {}. {runs} timed runs of each algorithm on each mesh and target, in turn, after one that is \
         not timed and whose level is the one that is judged. A target is a share of the source's triangles or their number.",
        record.version, record.study, record.machine
    );
    let second = "All levels are judged alike, whoever made them: read from their files, drawn and measured by the same code. \
                  Intervals are 95 % t-intervals; two algorithms are compared by tests on paired differences, never by \
                  whether two intervals overlap. Times and memory belong to this machine and this minute; looks and \
                  distances do not.";
    Section { title: "Method".to_owned(), words: vec![first, second.to_owned()], ..Section::default() }
}
