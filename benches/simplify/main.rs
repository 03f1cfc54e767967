//! `cargo bench`: the chain of four levels, by lodbake (`fast`, `balanced`) and by meshoptimizer, side by side.
//!
//! One thread. All take turns in one run, so that what else the machine does hits all alike; the ratio of two medians
//! would mix different minutes, which is why no harness that times one function after the other is used. Seconds are
//! CPU time, the least and the median of the rounds, ratios those of the least. The work of lodbake is all of a bake but
//! files and looks: weld, topology, sequence, cuts, vertices of each level, measured errors (also shown apart). That of
//! meshoptimizer is `meshopt_simplifyWithAttributes` from level to level and nothing else.
//!
//! `LODBAKE_CORPUS` names the corpus. `cargo bench -- [--rounds N] [--only WORK] [--memory] [--threads] [PART OF A NAME]..`; `--memory`
//! adds the peak of the resident set, each in a process of its own; `--threads` the wall time with one thread and with two.

#![expect(clippy::print_stdout, reason = "a benchmark prints its table")]

mod assets;
mod clock;
#[path = "../../tests/corpus/mod.rs"]
mod corpus;
mod memory;
mod work;

use std::process::ExitCode;

use assets::Asset;
use work::{Report, Work};

/// What the command line asks for.
struct Arguments {
    rounds: usize,
    memory: bool,
    threads: bool,
    works: Vec<Work>,
    names: Vec<String>,
}

fn main() -> ExitCode {
    // Work that is done side by side is this thread's as well, so that its clock counts all.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("the first to ask for threads");
    let mut words = std::env::args().skip(1).peekable();
    if words.peek().is_some_and(|word| word == memory::CHILD) {
        memory::child(&words.skip(1).collect::<Vec<_>>());
        return ExitCode::SUCCESS;
    }
    let mut arguments =
        Arguments { rounds: 5, memory: false, threads: false, works: Work::ALL.to_vec(), names: Vec::new() };
    while let Some(word) = words.next() {
        match word.as_str() {
            "--rounds" => arguments.rounds = words.next().and_then(|n| n.parse().ok()).unwrap_or(5),
            "--only" => {
                let only = words.next();
                arguments.works.retain(|work| Some(work.name()) == only.as_deref());
            }
            "--memory" => arguments.memory = true,
            "--threads" => arguments.threads = true,
            // Cargo says this to every benchmark.
            "--bench" => {}
            name => arguments.names.push(name.to_owned()),
        }
    }
    let Some(corpus) = corpus::corpus() else { return ExitCode::SUCCESS };
    for asset in assets::load(&corpus, &arguments.names) {
        compare(&asset, &arguments);
    }
    ExitCode::SUCCESS
}

/// All works on one asset, in turn, and their table.
fn compare(asset: &Asset, arguments: &Arguments) {
    let triangles = asset.mesh.triangles();
    println!("\n{}: {triangles} triangles", asset.name);
    let mut reports: Vec<Vec<Report>> = arguments.works.iter().map(|_| Vec::new()).collect();
    for _ in 0..arguments.rounds {
        for (work, reports) in arguments.works.iter().zip(&mut reports) {
            reports.push(work.run(asset));
        }
    }
    println!(
        "{:10} {:>8} {:>8} {:>9} {:>8} | {:>8} {:>8} {:>8} | triangles (error in radii)",
        "", "least s", "median s", "ktri/s", "ratio", "sequence", "levels", "measure"
    );
    let least = |reports: &[Report]| reports.iter().map(Report::total).fold(f64::INFINITY, f64::min);
    let peer = reports.last().map_or(f64::NAN, |reports| least(reports));
    for (work, reports) in arguments.works.iter().zip(&mut reports) {
        reports.sort_by(|a, b| a.total().total_cmp(&b.total()));
        let (best, median) = (&reports[0], reports[reports.len() / 2].total());
        let levels: Vec<String> = best.levels.iter().map(|(n, error)| format!("{n} ({error:.5})")).collect();
        println!(
            "{:10} {:8.3} {:8.3} {:9.1} {:8.2} | {:8.3} {:8.3} {:8.3} | {}",
            work.name(),
            best.total(),
            median,
            triangles as f64 / best.total() / 1e3,
            peer / best.total(),
            best.sequence,
            best.levels_secs,
            best.measure,
            levels.join(" ")
        );
    }
    if arguments.memory {
        memory::compare(asset);
    }
    if arguments.threads {
        threads(asset, arguments.rounds);
    }
}

/// Wall time of the works of lodbake with one thread and with two, in turn. Means something on a machine that does
/// nothing else.
fn threads(asset: &Asset, rounds: usize) {
    for work in Work::ALL.iter().filter(|work| **work != Work::Peer) {
        let mut least = [f64::INFINITY; 2];
        for _ in 0..rounds {
            for (threads, least) in (1..).zip(&mut least) {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                let began = std::time::Instant::now();
                pool.install(|| work.run(asset));
                *least = least.min(began.elapsed().as_secs_f64());
            }
        }
        let [one, two] = least;
        println!("{:10} wall {one:.3} s with one thread, {two:.3} s with two: {:.2} times", work.name(), one / two);
    }
}
