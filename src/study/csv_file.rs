//! A study as comma-separated values: one row for each mesh, target, algorithm and measure.

use super::record::{Cell, Measure, Record};

/// Columns.
const HEADER: [&str; 13] = [
    "mesh",
    "algorithm",
    "matched",
    "target",
    "measure",
    "unit",
    "n",
    "mean",
    "sd",
    "low95",
    "high95",
    "values",
    "error",
];

/// `study.csv`. A cell that failed has a row with its error; numbers are written so that reading gives the same bits.
pub fn csv(record: &Record) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut rows: Vec<Vec<String>> = vec![HEADER.map(str::to_owned).to_vec()];
    for cell in &record.cells {
        rows.extend(rows_of(record, cell));
    }
    for row in rows {
        writer.write_record(row).expect("memory takes any bytes, and all rows are of one length");
    }
    let bytes = writer.into_inner().expect("memory takes any bytes");
    String::from_utf8(bytes).expect("all fields are UTF-8")
}

fn rows_of(record: &Record, cell: &Cell) -> Vec<Vec<String>> {
    let algorithm = &record.algorithms[cell.algorithm];
    let head = [
        record.meshes[cell.mesh].name.clone(),
        algorithm.name.clone(),
        algorithm.matched.clone().unwrap_or_default(),
        record.targets[cell.target].clone(),
    ];
    let row = |tail: [String; 9]| head.iter().cloned().chain(tail).collect();
    let mut rows = Vec::new();
    for measure in Measure::ALL {
        let Some(summary) = cell.summary(measure) else { continue };
        let [sd, low, high] = match summary.spread {
            None => [String::new(), String::new(), String::new()],
            Some(spread) => [spread.sd, spread.low, spread.high].map(|value| value.to_string()),
        };
        // The single runs, for other tests than those of the tables.
        let values = cell.values(measure);
        let values = if values.len() < 2 { Vec::new() } else { values };
        let values: Vec<String> = values.iter().map(ToString::to_string).collect();
        rows.push(row([
            measure.name().to_owned(),
            measure.unit().to_owned(),
            summary.n.to_string(),
            summary.mean.to_string(),
            sd,
            low,
            high,
            values.join(" "),
            String::new(),
        ]));
    }
    if let Some(error) = &cell.error {
        let mut tail = std::array::from_fn(|_| String::new());
        "error".clone_into(&mut tail[0]);
        tail[8].clone_from(error);
        rows.push(row(tail));
    }
    rows
}
