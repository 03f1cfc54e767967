//! Plots as SVG text: points and lines over two axes, logarithmic unless said otherwise.
//!
//! Colours are classes of the page's style sheet, so that one SVG is right in light and in dark; that is what the
//! plotting crates cannot do, which write colours into every element. Knows nothing of studies.

use std::fmt::Write as _;

use super::escape;
use crate::progress::quantity::number;

/// One plot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Above it.
    pub title: String,
    /// Labels of the horizontal and the vertical axis.
    pub axes: [String; 2],
    /// In the order of the legend.
    pub series: Vec<Series>,
    /// Points of a line below everything: from left to right.
    pub frontier: Vec<[f64; 2]>,
    /// The horizontal axis counts evenly: for runs, not for sizes.
    pub is_even: bool,
}

/// Points that belong together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Number of its colour and mark.
    pub color: usize,
    /// Its line is dashed.
    pub is_dashed: bool,
    /// Its points are of unlike things: no line joins them.
    pub is_scattered: bool,
    /// From left to right.
    pub points: Vec<Point>,
}

/// One point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// Above 0, both; others are left out.
    pub at: [f64; 2],
    /// Ends of the vertical interval.
    pub ends: Option<[f64; 2]>,
    /// Written beside it.
    pub name: String,
}

/// Colours and marks repeat after this many.
pub const COLORS: usize = 10;

const WIDTH: f64 = 400.0;
const HEIGHT: f64 = 270.0;
/// Room for labels: left, top, right, bottom.
const MARGINS: [f64; 4] = [56.0, 12.0, 14.0, 42.0];

/// A logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
    /// Pixels of `low` and `high`.
    span: [f64; 2],
    /// Not logarithmic: `low` and `high` are values.
    is_even: bool,
}

impl Axis {
    /// Holds all values with some room; `None` if there are none.
    fn new(values: impl Iterator<Item = f64>, span: [f64; 2]) -> Option<Self> {
        let logs = values.filter(|v| 0.0 < *v && v.is_finite()).map(libm::log10);
        let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            return None;
        }
        // At least a third of a decade, so that noise is not blown up to fill the plot.
        let room = (0.06 * (high - low)).max(0.5 * (1.0 / 3.0 - (high - low))).max(0.02);
        Some(Self { low: low - room, high: high + room, span, is_even: false })
    }

    /// Counts evenly, over whole numbers.
    fn even(values: impl Iterator<Item = f64>, span: [f64; 2]) -> Option<Self> {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (low <= high).then_some(Self { low: low - 0.5, high: high + 0.5, span, is_even: true })
    }

    fn scaled(&self, value: f64) -> f64 {
        if self.is_even { value } else { libm::log10(value) }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (self.scaled(value) - self.low) / (self.high - self.low);
        self.span[0] + share * (self.span[1] - self.span[0])
    }

    fn holds(&self, value: f64) -> bool {
        let at = self.scaled(value);
        self.low <= at && at <= self.high
    }

    /// Round values, 3 to 8 of them where the range allows: decades, or 1-2-5 steps, or finer.
    fn ticks(&self) -> Vec<f64> {
        if self.is_even {
            let step = libm::ceil((self.high - self.low) / 8.0).max(1.0) as usize;
            return (libm::ceil(self.low) as i64..=libm::floor(self.high) as i64)
                .step_by(step)
                .map(|t| t as f64)
                .collect();
        }
        let decades =
            (libm::floor(self.low) as i32..=libm::ceil(self.high) as i32).map(|e| libm::pow(10.0, f64::from(e)));
        let decades: Vec<f64> = decades.collect();
        let steps: [&[f64]; 4] = [
            &[1.0],
            &[1.0, 3.0],
            &[1.0, 2.0, 5.0],
            &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0],
        ];
        let mut ticks = Vec::new();
        for steps in steps {
            ticks = decades.iter().flat_map(|decade| steps.iter().map(move |step| decade * step)).collect();
            ticks.retain(|&tick| self.holds(tick));
            if 3 <= ticks.len() {
                break;
            }
        }
        while 8 < ticks.len() {
            ticks = ticks.into_iter().step_by(2).collect();
        }
        ticks
    }
}

/// `0.05`, `20`, `3k`, `2M`.
fn tick_label(value: f64) -> String {
    let round = |v: f64| {
        let text = format!("{v:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    match value {
        v if v >= 999_999.0 => format!("{}M", round(v / 1e6)),
        v if v >= 999.9 => format!("{}k", round(v / 1e3)),
        v if v < 0.000_999 => format!("{v:.0e}"),
        v => round(v),
    }
}

impl Plot {
    /// The SVG element; empty if there is nothing to draw.
    pub fn svg(&self) -> String {
        let [left, top, right, bottom] = MARGINS;
        let points = || self.series.iter().flat_map(|series| &series.points);
        let ys = points().flat_map(|p| std::iter::once(p.at[1]).chain(p.ends.into_iter().flatten()));
        let xs = points().map(|p| p.at[0]);
        let span = [left, WIDTH - right];
        let x = if self.is_even { Axis::even(xs, span) } else { Axis::new(xs, span) };
        let y = Axis::new(ys, [HEIGHT - bottom, top]);
        let (Some(x), Some(y)) = (x, y) else { return String::new() };
        let mut svg = String::new();
        let label = escape(&format!("{}: {} against {}", self.title, self.axes[1], self.axes[0]));
        put(&mut svg, format_args!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{label}\">\n"));
        self.draw_axes(&mut svg, &x, &y);
        if 1 < self.frontier.len() {
            let places: Vec<String> = self.frontier.iter().map(|p| place(&x, &y, *p)).collect();
            put(&mut svg, format_args!("<polyline class=\"frontier\" points=\"{}\"/>\n", places.join(" ")));
        }
        for series in &self.series {
            series.draw(&mut svg, &x, &y);
        }
        self.draw_names(&mut svg, &x, &y);
        svg.push_str("</svg>\n");
        svg
    }

    fn draw_axes(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let [left, top, right, bottom] = MARGINS;
        let (far, low) = (WIDTH - right, HEIGHT - bottom);
        for tick in x.ticks() {
            let (at, text) = (x.at(tick), tick_label(tick));
            put(svg, format_args!("<path class=\"grid\" d=\"M{at:.1} {top}V{low}\"/>"));
            put(svg, format_args!("<text x=\"{at:.1}\" y=\"{:.1}\" class=\"tick middle\">{text}</text>\n", low + 15.0));
        }
        for tick in y.ticks() {
            let (at, text) = (y.at(tick), tick_label(tick));
            put(svg, format_args!("<path class=\"grid\" d=\"M{left} {at:.1}H{far}\"/>"));
            put(
                svg,
                format_args!("<text x=\"{:.1}\" y=\"{:.1}\" class=\"tick end\">{text}</text>\n", left - 6.0, at + 4.0),
            );
        }
        put(svg, format_args!("<path class=\"axis\" d=\"M{left} {top}V{low}H{far}\"/>\n"));
        let [across, up] = [&self.axes[0], &self.axes[1]].map(|label| escape(label));
        let middle = f64::midpoint(left, far);
        put(svg, format_args!("<text x=\"{middle}\" y=\"{}\" class=\"label middle\">{across}</text>\n", HEIGHT - 6.0));
        let middle = f64::midpoint(top, low);
        put(
            svg,
            format_args!("<text transform=\"translate(13 {middle}) rotate(-90)\" class=\"label middle\">{up}</text>\n"),
        );
    }
}

/// Width of a letter of a name and height of its line, in pixels: about, to keep names apart.
const LETTER: [f64; 2] = [5.8, 12.0];

impl Plot {
    /// Names beside their points, on the side where they cover no mark, no name and no border.
    fn draw_names(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let all = || self.series.iter().flat_map(|series| series.points.iter().map(move |point| (series, point)));
        let drawn = |point: &Point| point.at.iter().all(|v| 0.0 < *v && v.is_finite());
        let mut taken: Vec<[f64; 4]> = all()
            .filter(|(_, point)| drawn(point))
            .map(|(_, p)| [x.at(p.at[0]) - 5.0, y.at(p.at[1]) - 5.0, x.at(p.at[0]) + 5.0, y.at(p.at[1]) + 5.0])
            .collect();
        for (series, point) in all().filter(|(_, point)| drawn(point) && !point.name.is_empty()) {
            let (cx, cy) = (x.at(point.at[0]), y.at(point.at[1]));
            let width = point.name.chars().count() as f64 * LETTER[0];
            let sides = [
                (8.0, -3.0),
                (8.0, 13.0),
                (-8.0 - width, -3.0),
                (-8.0 - width, 13.0),
                (-width / 2.0, -9.0),
                (-width / 2.0, 20.0),
            ];
            let place = |(dx, dy): (f64, f64)| [cx + dx, cy + dy - LETTER[1] + 2.0, cx + dx + width, cy + dy + 2.0];
            let free = |b: &[f64; 4]| {
                MARGINS[0] < b[0]
                    && b[2] < WIDTH
                    && 0.0 < b[1]
                    && b[3] < HEIGHT - MARGINS[3]
                    && taken.iter().all(|o| b[2] < o[0] || o[2] < b[0] || b[3] < o[1] || o[3] < b[1])
            };
            let side = sides.into_iter().find(|side| free(&place(*side))).unwrap_or(sides[0]);
            taken.push(place(side));
            put(
                svg,
                format_args!(
                    "<text x=\"{:.1}\" y=\"{:.1}\" class=\"name c{}\">{}</text>\n",
                    cx + side.0,
                    cy + side.1,
                    series.color % COLORS,
                    escape(&point.name)
                ),
            );
        }
    }
}

impl Series {
    fn draw(&self, svg: &mut String, x: &Axis, y: &Axis) {
        let points: Vec<&Point> =
            self.points.iter().filter(|p| p.at.iter().all(|v| 0.0 < *v && v.is_finite())).collect();
        let color = self.color % COLORS;
        put(svg, format_args!("<g class=\"c{color}\">"));
        if 1 < points.len() && !self.is_scattered {
            let places: Vec<String> = points.iter().map(|p| place(x, y, p.at)).collect();
            let dashed = if self.is_dashed { " dashed" } else { "" };
            put(svg, format_args!("<polyline class=\"line{dashed}\" points=\"{}\"/>", places.join(" ")));
        }
        for point in points {
            let (cx, cy) = (x.at(point.at[0]), y.at(point.at[1]));
            if let Some([low, high]) = point.ends.filter(|ends| 0.0 < ends[0]) {
                let (low, high) = (y.at(low), y.at(high));
                let cap = cx - 3.0;
                put(
                    svg,
                    format_args!(
                        "<path class=\"bar\" d=\"M{cx:.1} {low:.1}V{high:.1}M{cap:.1} {low:.1}h6M{cap:.1} {high:.1}h6\"/>"
                    ),
                );
            }
            let title = escape(&format!("{}: {} at {}", self.name, number(point.at[1]), number(point.at[0])));
            put(
                svg,
                format_args!(
                    "<g transform=\"translate({cx:.1} {cy:.1})\"><title>{title}</title>{}</g>",
                    mark(self.color)
                ),
            );
        }
        svg.push_str("</g>\n");
    }
}

/// The mark of a colour, at the origin: told apart without colour too.
pub fn mark(color: usize) -> &'static str {
    match color % COLORS {
        0 => "<circle r=\"4\"/>",
        1 => "<path d=\"M-3.6-3.6h7.2v7.2h-7.2z\"/>",
        2 => "<path d=\"M0-4.8L4.4 3.2H-4.4z\"/>",
        3 => "<path d=\"M0-5L5 0L0 5L-5 0z\"/>",
        4 => "<path d=\"M0 4.8L4.4-3.2H-4.4z\"/>",
        5 => "<path class=\"open\" d=\"M-3.5-3.5L3.5 3.5M-3.5 3.5L3.5-3.5\"/>",
        6 => "<path class=\"open\" d=\"M-4.5 0H4.5M0-4.5V4.5\"/>",
        7 => "<circle class=\"open\" r=\"3.6\"/>",
        8 => "<path class=\"open\" d=\"M-3.3-3.3h6.6v6.6h-6.6z\"/>",
        _ => "<path class=\"open\" d=\"M0-4.6L4.6 0L0 4.6L-4.6 0z\"/>",
    }
}

fn place(x: &Axis, y: &Axis, at: [f64; 2]) -> String {
    format!("{:.1},{:.1}", x.at(at[0]), y.at(at[1]))
}

fn put(svg: &mut String, text: std::fmt::Arguments<'_>) {
    svg.write_fmt(text).expect("a String takes any text");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(low: f64, high: f64) -> Axis {
        Axis::new([low, high].into_iter(), [0.0, 100.0]).unwrap()
    }

    #[test]
    fn axes_are_logarithmic() {
        let axis = axis(1.0, 100.0);
        assert!((axis.at(10.0) - 50.0).abs() < 1e-9);
        assert!(axis.at(1.0) > 0.0 && axis.at(100.0) < 100.0);
        assert!(Axis::new([0.0, f64::NAN].into_iter(), [0.0, 1.0]).is_none());
    }

    #[test]
    fn ticks_are_round_and_few() {
        let labels = |low, high| axis(low, high).ticks().into_iter().map(tick_label).collect::<Vec<_>>();
        assert_eq!(labels(1.0, 1000.0), ["1", "10", "100", "1k"]);
        assert_eq!(labels(20.0, 900.0), ["30", "100", "300", "1k"]);
        assert_eq!(labels(0.2, 3.0), ["0.3", "1", "3"]);
        for (low, high) in [(1.0, 1.0), (3.0, 4.0), (0.001, 5.0), (1e3, 1e9), (9.5, 10.5), (1e-7, 1e7)] {
            let found = labels(low, high);
            assert!((3..=8).contains(&found.len()), "{low} to {high}: {found:?}");
        }
    }

    #[test]
    fn what_is_not_positive_is_left_out() {
        let point = |x, y| Point { at: [x, y], ends: Some([y / 2.0, y * 2.0]), name: "<&>".into() };
        let series = Series { name: "a".into(), points: vec![point(1.0, 2.0), point(0.0, 5.0)], ..Series::default() };
        let svg = Plot { series: vec![series], ..Plot::default() }.svg();
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(svg.contains("&lt;&amp;&gt;") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!(Plot::default().svg(), "");
    }
}
