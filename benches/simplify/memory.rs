//! Peak memory of each work: the largest resident set of a process of its own, above what it had with the mesh loaded.
//!
//! Linux only (`/proc/self`): elsewhere it says so.

use std::process::Command;

use lodbake::mesh::Mesh;

use crate::assets::{self, Asset};
use crate::work::Work;

/// The first word of a child's command line.
pub const CHILD: &str = "--peak-of";

/// Prints the peaks of all works on `asset`, and their ratios.
pub fn compare(asset: &Asset) {
    let folder = std::env::temp_dir().join(format!("lodbake-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let file = folder.join("mesh");
    std::fs::write(&file, postcard::to_stdvec(&asset.mesh).expect("a mesh is numbers")).expect("room for a mesh");
    let own = std::env::current_exe().expect("this program");
    let peaks = Work::ALL.map(|work| {
        let child = Command::new(&own).arg(CHILD).arg(work.name()).arg(&file).output().expect("a child process");
        String::from_utf8_lossy(&child.stdout).trim().parse::<f64>().ok()
    });
    std::fs::remove_dir_all(&folder).expect("its own folder");
    for (work, peak) in Work::ALL.iter().zip(peaks) {
        match (peak, peaks[Work::ALL.len() - 1]) {
            (Some(peak), Some(peer)) => {
                println!("{:10} peak memory {:7.1} MiB, {:.2} of meshopt's", work.name(), peak / 1024.0, peak / peer);
            }
            _ => println!("{:10} peak memory unknown: no /proc/self here", work.name()),
        }
    }
}

/// The child: loads the mesh, runs the work, prints how many KiB the peak lies above the start.
pub fn child(words: &[String]) {
    let [name, file] = words else { panic!("a work and a file") };
    let work = Work::ALL.into_iter().find(|work| work.name() == name).expect("a work");
    let mesh: Mesh = postcard::from_bytes(&std::fs::read(file).expect("a file")).expect("a mesh");
    let asset = Asset { name: "", flat: assets::flat(&mesh), mesh };
    // Forgets the peak of loading.
    if std::fs::write("/proc/self/clear_refs", "5").is_err() {
        return;
    }
    let Some(before) = kibibytes("VmRSS:") else { return };
    work.run(&asset);
    let Some(after) = kibibytes("VmHWM:") else { return };
    println!("{}", after - before);
}

fn kibibytes(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
