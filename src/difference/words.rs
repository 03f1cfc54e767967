//! Changes as people read them.

use super::{Change, Difference, Kind, Sum};
use crate::budget::figure;
use crate::progress::quantity::plural;
use crate::report::{columns, percent};

/// `grew by 12 %: 18.0 kB to 20.2 kB of files`.
pub(super) fn message(change: &Change) -> String {
    let what = match (&change.mesh, change.level) {
        (Some(_), Some(_)) => "the level",
        (Some(_), None) => "the mesh",
        _ => "the scene",
    };
    let (Some(fact), Some(base), Some(head)) = (change.fact, change.base, change.head) else {
        return match change.kind {
            Kind::Broke => "it was baked before and cannot be baked any more".to_owned(),
            Kind::Mended => "it could not be baked before and is now".to_owned(),
            Kind::Vanished => format!("{what} is not there any more"),
            _ => format!("{what} is new"),
        };
    };
    let (before, now) = (figure(fact, base), figure(fact, head));
    format!("{} {}: {before} → {now}", fact.title(), by(base, head))
}

/// `+12 %`, `−3.1 %`, `3.2 times as much`, `new`.
pub fn by(base: f64, head: f64) -> String {
    if base == 0.0 {
        return "new".to_owned();
    }
    let ratio = head / base;
    if 2.0 <= ratio {
        format!("{ratio:.1} times as much")
    } else if 1.0 <= ratio {
        format!("+{}", percent(ratio - 1.0))
    } else {
        format!("−{}", percent(1.0 - ratio))
    }
}

impl Difference {
    /// For a terminal: regressions, other changes up to `most`, and sums.
    pub fn to_text(&self, most: usize) -> String {
        let mut lines = Vec::new();
        let regressions = self.changes.iter().filter(|change| change.is_regression).count();
        for change in self.changes.iter().take(regressions.max(most)) {
            let sign = if change.is_regression { "!" } else { " " };
            lines.push(format!("{sign} {} {}: {}", title(change.kind), change.place(), change.message()));
        }
        if let Some(more) = self.changes.len().checked_sub(regressions.max(most)).filter(|more| 0 < *more) {
            lines.push(format!("  and {more} more"));
        }
        if self.changes.is_empty() {
            return format!("no change: {} the same\n", plural(self.unchanged, "scene"));
        }
        let row = |sum: &Sum| {
            let by = if sum.base == sum.head { "=".to_owned() } else { by(sum.base, sum.head) };
            vec![sum.fact.title().to_owned(), figure(sum.fact, sum.base), figure(sum.fact, sum.head), by]
        };
        let table = columns(&["in sum", "before", "now", ""], self.sums.iter().map(row).collect(), &[1, 2, 3]);
        format!("{}\n\n{table}\n", lines.join("\n"))
    }
}

/// In front of a change.
pub fn title(kind: Kind) -> &'static str {
    match kind {
        Kind::Broke => "broke",
        Kind::Vanished => "vanished",
        Kind::Uglier => "uglier",
        Kind::Grew => "grew",
        Kind::Appeared => "appeared",
        Kind::Better => "better",
        Kind::Shrank => "shrank",
        Kind::Mended => "mended",
    }
}
