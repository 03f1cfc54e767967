//! Numbers, settings and probabilities as people read them in a study's tables.

use serde_json::Value;

use super::statistics::Summary;
use crate::config::{SceneSettings, SimplifySettings};

/// Absent values.
pub const NONE: &str = "–";

/// Three significant digits, thousands separated: `1.23e-5`, `0.00123`, `1.20`, `45.6`, `1,234`; trailing zeros stay, so
/// that columns line up.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if value.abs() < 1e-4 {
        let text = format!("{:.2e}", value.abs());
        return if value < 0.0 { format!("−{text}") } else { text };
    }
    with_digits(value, decimals(value))
}

/// Decimals that leave three significant digits.
fn decimals(value: f64) -> usize {
    // Rounded first, as 9.996 has three digits as 10.0.
    let rounded: f64 = format!("{:.2e}", value.abs()).parse().unwrap_or(1.0);
    (2.0 - libm::floor(libm::log10(rounded))).clamp(0.0, 9.0) as usize
}

fn with_digits(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let whole = crate::progress::quantity::count(whole.parse().unwrap_or(0));
    let sign = if value < 0.0 { "−" } else { "" };
    if fraction.is_empty() { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
}

/// `12.3 ± 0.4`: the mean and half the width of its interval, with the digits of the mean.
pub fn mean_and_interval(summary: &Summary, scale: f64) -> String {
    let mean = summary.mean * scale;
    let digits = decimals(mean);
    match summary.half_width() {
        None => with_digits(mean, digits),
        Some(half) => format!("{} ± {}", with_digits(mean, digits), with_digits(half * scale, digits)),
    }
}

/// `0.042`, `< 0.001`.
pub fn probability(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { format!("{p:.3}") }
}

/// Settings of lodbake: metric and effort, and whatever else differs from the defaults.
pub fn of_settings(settings: &SceneSettings) -> String {
    let plain = serde_json::to_value(SimplifySettings::default()).unwrap_or_default();
    let own = serde_json::to_value(&settings.simplify).unwrap_or_default();
    let mut words = Vec::new();
    collect(&own, &plain, &mut words);
    let min = SceneSettings::simplified_by(&crate::config::file::SimplifyTable::default()).min_triangles;
    if settings.min_triangles != min {
        words.push(format!("min_triangles {}", settings.min_triangles));
    }
    format!("lodbake: {}", words.join(", "))
}

fn collect(own: &Value, plain: &Value, words: &mut Vec<String>) {
    for (key, value) in own.as_object().into_iter().flatten() {
        let default = &plain[key];
        match value {
            Value::Object(_) => collect(value, default, words),
            Value::String(text) if value != default || matches!(key.as_str(), "metric" | "effort") => {
                words.push(format!("{key} {text}"));
            }
            _ if value != default => words.push(format!("{key} {value}")),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::file::SimplifyTable;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (0.000_012_345, "1.23e-5"),
            (0.001_234_5, "0.00123"),
            (0.5, "0.500"),
            (1.0, "1.00"),
            (9.996, "10.0"),
            (45.67, "45.7"),
            (999.6, "1,000"),
            (1_234_567.0, "1,234,567"),
            (-2.5, "−2.50"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn intervals_have_the_digits_of_the_mean() {
        let summary = Summary::of(&[0.010, 0.012, 0.014]).unwrap();
        assert_eq!(mean_and_interval(&summary, 1000.0), "12.0 ± 5.0");
        assert_eq!(mean_and_interval(&Summary::of(&[2.0]).unwrap(), 1.0), "2.00");
        assert_eq!([probability(0.04249), probability(0.0001)], ["0.042", "< 0.001"]);
    }

    #[test]
    fn settings_tell_what_is_not_as_usual() {
        assert_eq!(
            of_settings(&SceneSettings::simplified_by(&SimplifyTable::default())),
            "lodbake: metric its, effort balanced"
        );
        let table = SimplifyTable { normal: Some(0.5), lock_border: Some(true), ..SimplifyTable::default() };
        let told = of_settings(&SceneSettings::simplified_by(&table));
        assert_eq!(told, "lodbake: metric its, effort balanced, normal 0.5, lock_border true");
    }
}
