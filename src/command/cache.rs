//! `lodbake cache …`: how much is in the cache, and taking out what is not needed.

use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use serde_json::json;

use super::failure::UsageError;
use super::{CacheChoice, Context, Exit};
use crate::cache::{Removed, Stats, Upkeep};
use crate::config::{Pipeline, defaults};
use crate::progress::quantity::{bytes, count};
use crate::report::columns;

/// What `gc` takes out if nothing else is said: a month without use.
const MAX_AGE: Duration = Duration::from_secs(30 * 24 * 60 * 60);

/// Look after the cache
#[derive(Clone, Debug, clap::Args)]
pub struct CacheCommand {
    #[command(subcommand)]
    action: Action,
    /// The pipeline whose cache it is
    #[arg(long, global = true, value_name = "PIPELINE", default_value = "pipeline.toml")]
    pipeline: PathBuf,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Action {
    /// Tell how much is in the cache
    Stats,
    /// Take out everything
    Clean,
    /// Take out what was not used for longest
    Gc {
        /// Keep at most so many bytes: `500M`, `2G`
        #[arg(long, value_name = "SIZE", value_parser = parse_size)]
        max_size: Option<u64>,
        /// Take out what was not used for so long: `12h`, `30d`, `8w` [default: 30d, if no size is given]
        #[arg(long, value_name = "AGE", value_parser = parse_age)]
        max_age: Option<Duration>,
    },
    /// Check every entry, and take out those that are damaged
    Verify,
}

impl CacheCommand {
    /// Does it.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let folder = self.folder(context)?;
        let shown = folder.display();
        match &self.action {
            Action::Stats => {
                let stats = Stats::of(&folder)?;
                let text = if context.json { document(&json!(stats)) } else { table(&shown.to_string(), &stats) };
                context.print(&text)?;
            }
            Action::Clean => tell_removed(context, Upkeep::begin(&folder)?.clean()?)?,
            Action::Gc { max_size, max_age } => {
                let max_age = if max_size.is_none() { max_age.or(Some(MAX_AGE)) } else { *max_age };
                tell_removed(context, Upkeep::begin(&folder)?.collect(*max_size, max_age, SystemTime::now())?)?;
            }
            Action::Verify => {
                let verified = Upkeep::begin(&folder)?.verify()?;
                let damaged = verified.damaged.iter();
                let text = if context.json {
                    let damaged: Vec<_> = damaged
                        .map(
                            |(path, damage)| json!({ "file": path.display().to_string(), "cause": damage.to_string() }),
                        )
                        .collect();
                    document(&json!({ "entries": verified.entries, "bytes": verified.bytes, "damaged": damaged }))
                } else {
                    let removed = damaged.map(|(path, damage)| format!("removed `{}`: {damage}\n", path.display()));
                    let good = format!("{} entries are good ({})\n", count(verified.entries), bytes(verified.bytes));
                    removed.collect::<String>() + &good
                };
                context.print(&text)?;
            }
        }
        Ok(Exit::Fine)
    }

    fn folder(&self, context: &Context) -> anyhow::Result<PathBuf> {
        match &context.cache {
            CacheChoice::Folder(folder) => Ok(folder.clone()),
            CacheChoice::Off => {
                let message = "`--no-cache` leaves `lodbake cache` nothing to do".to_owned();
                Err(UsageError { message, hint: None }.into())
            }
            // Without a pipeline there may still be the cache that it had.
            CacheChoice::Pipeline if !self.pipeline.exists() && PathBuf::from(defaults::CACHE).is_dir() => {
                Ok(defaults::CACHE.into())
            }
            CacheChoice::Pipeline => Ok(Pipeline::load(&self.pipeline)?.cache.path),
        }
    }
}

fn document(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

fn table(folder: &str, stats: &Stats) -> String {
    let mut rows: Vec<Vec<String>> = stats
        .buckets
        .iter()
        .map(|bucket| vec![bucket.name.clone(), count(bucket.entries), bytes(bucket.bytes)])
        .collect();
    let entries = stats.buckets.iter().map(|bucket| bucket.entries).sum();
    rows.push(vec!["all".to_owned(), count(entries), bytes(stats.bytes())]);
    let table = columns(&[folder, "entries", "size"], rows, &[1, 2]);
    let unfinished = match stats.unfinished {
        0 => String::new(),
        left => format!("\n{} unfinished files; `lodbake cache gc` removes what killed runs have left", count(left)),
    };
    format!("{table}{unfinished}\n")
}

fn tell_removed(context: &Context, removed: Removed) -> anyhow::Result<()> {
    if context.json {
        return context.print(&document(&json!(removed)));
    }
    let Removed { entries, bytes: size } = removed;
    context.print(&format!("removed {} files ({})\n", count(entries), bytes(size)))
}

/// A whole number and its unit.
fn parse_quantity(text: &str, units: &[(&str, u64)]) -> Result<u64, String> {
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let (number, unit) = text.split_at(digits);
    let factor = units.iter().find(|(name, _)| name.eq_ignore_ascii_case(unit.trim())).map(|(_, factor)| *factor);
    let value = number.parse().ok().and_then(|number: u64| number.checked_mul(factor?));
    value.ok_or_else(|| {
        let names: Vec<_> = units.iter().map(|(name, _)| format!("`{name}`")).filter(|name| name != "``").collect();
        format!("must be a whole number and one of {}", names.join(", "))
    })
}

fn parse_size(text: &str) -> Result<u64, String> {
    const K: u64 = 1000;
    let text = text.strip_suffix(['B', 'b']).unwrap_or(text);
    parse_quantity(text, &[("", 1), ("k", K), ("M", K * K), ("G", K * K * K), ("T", K * K * K * K)])
}

fn parse_age(text: &str) -> Result<Duration, String> {
    const HOUR: u64 = 60 * 60;
    let units = [("m", 60), ("h", HOUR), ("d", 24 * HOUR), ("w", 7 * 24 * HOUR)];
    parse_quantity(text, &units).map(Duration::from_secs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::BucketStats;

    #[test]
    fn sizes_and_ages_have_units() {
        assert_eq!(parse_size("0"), Ok(0));
        assert_eq!(parse_size("1500"), Ok(1500));
        assert_eq!(parse_size("2G"), Ok(2_000_000_000));
        assert_eq!(parse_size("2 gb"), Ok(2_000_000_000));
        assert_eq!(parse_age("12h"), Ok(Duration::from_secs(43_200)));
        assert_eq!(parse_age("30d"), Ok(MAX_AGE));
        insta::assert_snapshot!(parse_size("2X").unwrap_err(), @"must be a whole number and one of `k`, `M`, `G`, `T`");
        insta::assert_snapshot!(parse_age("30").unwrap_err(), @"must be a whole number and one of `m`, `h`, `d`, `w`");
        for bad in ["", "G", "-1G", "1.5G", "99999999999T"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn stats_are_a_table() {
        let bucket = |name: &str, entries, bytes| BucketStats { name: name.to_owned(), entries, bytes };
        let buckets = vec![bucket("chains-v1", 1200, 3_400_000), bucket("index-v1", 1, 900)];
        insta::assert_snapshot!(table(".lodbake", &Stats { buckets, unfinished: 2 }), @r"
    .lodbake   entries     size
    chains-v1    1,200  3.40 MB
    index-v1         1    900 B
    all          1,201  3.40 MB
    2 unfinished files; `lodbake cache gc` removes what killed runs have left
    ");
    }
}
