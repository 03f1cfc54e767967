//! The binary: parse, run, exit code.

use std::process::ExitCode;

use lodbake::study::heap::{COUNTING, Counting};

/// Counts what is held, for `lodbake study`.
#[global_allocator]
static ALLOCATOR: &Counting = COUNTING;

fn main() -> ExitCode {
    ExitCode::from(lodbake::cli::run(std::env::args_os()) as u8)
}
