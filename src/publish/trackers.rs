//! For services that draw figures over time: Bencher, and github-action-benchmark's `customSmallerIsBetter`. Smaller is
//! better for all of these figures.

use serde_json::{Map, Value, json};

use super::{Publication, triangles, worst_look};
use crate::report::Report;

/// A figure of a scene: name, unit, value.
type Figure = (&'static str, &'static str, f64);

/// Bencher Metric Format: benchmarks (scenes) with their measures.
pub fn bencher(publication: &Publication<'_>) -> Value {
    let of = |figures: &[Figure]| -> Value {
        figures.iter().map(|(name, _, value)| (slug(name), json!({ "value": value }))).collect::<Map<_, _>>().into()
    };
    all(publication.report).iter().map(|(scene, figures)| (scene.clone(), of(figures))).collect::<Map<_, _>>().into()
}

/// `customSmallerIsBetter`: a list of figures.
pub fn benchmark(publication: &Publication<'_>) -> Value {
    let entry = |scene: &str, (name, unit, value): &Figure| json!({ "name": format!("{scene}: {name}"), "unit": unit, "value": value });
    all(publication.report).iter().flat_map(|(scene, figures)| figures.iter().map(move |f| entry(scene, f))).collect()
}

fn all(report: &Report) -> Vec<(String, Vec<Figure>)> {
    let mut found = Vec::new();
    let written = || report.scenes.iter().filter(|scene| !scene.outputs.is_empty());
    let bytes: u64 = written().map(crate::report::SceneRecord::file_bytes).sum();
    let drawn: u64 = written().map(triangles).sum();
    let worst = written().filter_map(worst_look).reduce(f64::max);
    found.push(("all scenes".to_owned(), figures(bytes, drawn, worst, None)));
    for scene in written() {
        let calls = scene.costs.as_ref().map(|costs| costs.draw_calls);
        found.push((scene.path.clone(), figures(scene.file_bytes(), triangles(scene), worst_look(scene), calls)));
    }
    found
}

fn figures(bytes: u64, triangles: u64, worst: Option<f64>, calls: Option<u64>) -> Vec<Figure> {
    let mut found = vec![("file size", "bytes", bytes as f64), ("triangles", "triangles", triangles as f64)];
    found.extend(worst.map(|worst| ("worst d_RMS", "luminance", worst)));
    found.extend(calls.map(|calls| ("draw calls", "calls", calls as f64)));
    found
}

fn slug(name: &str) -> String {
    name.to_ascii_lowercase().replace([' ', '_'], "-")
}
