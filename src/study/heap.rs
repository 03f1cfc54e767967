//! Peak heap of a piece of work, from the counting allocator that the binary installs.
//!
//! Counts the bytes asked for, not what the system rounds them up to. Counts all threads: nothing else may run beside
//! the work that is measured.

use std::alloc::System;

use peakmem_alloc::{INSTRUMENTED_SYSTEM, PeakMemAlloc, PeakMemAllocTrait};

/// The type of [`COUNTING`].
pub type Counting = PeakMemAlloc<System>;

/// For the binary's `#[global_allocator]`: the system's allocator, with a count beside it.
pub static COUNTING: &Counting = &INSTRUMENTED_SYSTEM;

/// Does `work`; with its result comes the largest number of bytes that it held at once, beyond what was held before.
/// `None` where the counting allocator is not installed.
pub fn peak_of<T>(work: impl FnOnce() -> T) -> (T, Option<u64>) {
    INSTRUMENTED_SYSTEM.reset_peak_memory();
    let probe = std::hint::black_box(vec![0u8; 64]);
    let is_installed = 64 <= INSTRUMENTED_SYSTEM.get_peak_memory();
    drop(probe);
    INSTRUMENTED_SYSTEM.reset_peak_memory();
    let done = work();
    let peak = INSTRUMENTED_SYSTEM.get_peak_memory() as u64;
    (done, is_installed.then_some(peak))
}
