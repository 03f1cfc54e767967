//! Numbers, settings and probabilities as people read them in a study's tables.

use serde_json::Value;

use super::statistics::Summary;
use crate::config::{SceneSettings, SimplifySettings};
pub use crate::progress::quantity::number;
use crate::progress::quantity::{decimals, with_digits};

/// Absent values.
pub const NONE: &str = "–";

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
