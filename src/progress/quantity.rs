//! Numbers as people read them: `115,204`, `12.4 MB`, `1.2 M`, `3.1 s`.

use std::time::Duration;

/// With thousands separated: `1,234,567`.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Three significant digits and a power of 1000: `999`, `1.23 k`, `45.6 M`.
pub fn short(number: f64) -> String {
    scaled(number, &["", " k", " M", " G", " T"])
}

/// Bytes in powers of 1000: `999 B`, `1.23 kB`, `45.6 MB`.
pub fn bytes(number: u64) -> String {
    scaled(number as f64, &[" B", " kB", " MB", " GB", " TB"])
}

fn scaled(number: f64, units: &[&str]) -> String {
    let mut value = number;
    let mut unit = 0;
    // 999.5 would print as "1000": go on to the next unit before rounding gets there.
    while value >= 999.5 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    let digits = if unit == 0 || value >= 99.95 {
        0
    } else if value >= 9.995 {
        1
    } else {
        2
    };
    format!("{value:.digits$}{}", units[unit])
}

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
pub(crate) fn decimals(value: f64) -> usize {
    // Rounded first, as 9.996 has three digits as 10.0.
    let rounded: f64 = format!("{:.2e}", value.abs()).parse().unwrap_or(1.0);
    (2.0 - libm::floor(libm::log10(rounded))).clamp(0.0, 9.0) as usize
}

/// With thousands separated and this many decimals.
pub(crate) fn with_digits(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let whole = count(whole.parse().unwrap_or(0));
    let sign = if value < 0.0 { "−" } else { "" };
    if fraction.is_empty() { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
}

/// A wall time: `0.42 s`, `12.3 s`, `4 min 05 s`, `2 h 03 min`.
pub fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let whole = seconds.round() as u64;
    if seconds < 9.995 {
        format!("{seconds:.2} s")
    } else if seconds < 59.95 {
        format!("{seconds:.1} s")
    } else if whole < 3600 {
        format!("{} min {:02} s", whole / 60, whole % 60)
    } else {
        format!("{} h {:02} min", whole / 3600, whole % 3600 / 60)
    }
}

/// `1 scene`, `12 scenes`, `1,200 meshes`.
pub fn plural(number: u64, word: &str) -> String {
    let ending = match number {
        1 => "",
        _ if word.ends_with("sh") => "es",
        _ => "s",
    };
    format!("{} {word}{ending}", count(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts() {
        assert_eq!([0, 999, 1000, 1234567].map(count), ["0", "999", "1,000", "1,234,567"]);
    }

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
    fn plurals() {
        assert_eq!([0, 1, 2].map(|n| plural(n, "mesh")), ["0 meshes", "1 mesh", "2 meshes"]);
        assert_eq!(plural(1200, "scene"), "1,200 scenes");
    }

    #[test]
    fn sizes_keep_three_digits() {
        assert_eq!(
            [0, 999, 1000, 12_345, 123_456, 999_600].map(bytes),
            ["0 B", "999 B", "1.00 kB", "12.3 kB", "123 kB", "1.00 MB"]
        );
        assert_eq!(short(1_230_000.0), "1.23 M");
    }

    #[test]
    fn durations_choose_their_unit() {
        let told = [0.4, 9.999, 59.97, 245.0, 7380.0].map(|s| duration(Duration::from_secs_f64(s)));
        assert_eq!(told, ["0.40 s", "10.0 s", "1 min 00 s", "4 min 05 s", "2 h 03 min"]);
    }
}
