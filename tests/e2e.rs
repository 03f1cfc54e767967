//! End to end through the binary: one file per command or behaviour in `tests/e2e/`, one test binary.

#[path = "e2e/scene.rs"]
mod scene;
#[path = "e2e/space.rs"]
mod space;

#[path = "e2e/bake.rs"]
mod bake;
#[path = "e2e/cache.rs"]
mod cache;
#[path = "e2e/check.rs"]
mod check;
#[path = "e2e/diff.rs"]
mod diff;
#[path = "e2e/explain.rs"]
mod explain;
#[path = "e2e/init.rs"]
mod init;
#[path = "e2e/inspect.rs"]
mod inspect;
#[path = "e2e/instances.rs"]
mod instances;
#[path = "e2e/library.rs"]
mod library;
#[path = "e2e/methods.rs"]
mod methods;
#[path = "e2e/report.rs"]
mod report;
#[path = "e2e/shares.rs"]
mod shares;
#[path = "e2e/study.rs"]
mod study;
#[path = "e2e/usage.rs"]
mod usage;
