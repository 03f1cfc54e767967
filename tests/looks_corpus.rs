//! Levels by appearance on real assets: each is the coarsest cut that keeps to its target, so one contraction further
//! is over it.

mod corpus;

use corpus::corpus;
use lodbake::report::{Report, Stop, read};
use std::fmt::Write;
use std::path::Path;

/// Small enough for a test; the search is the same for all.
const ASSETS: [&str; 4] = ["duck", "suzanne", "avocado", "water-bottle"];
/// d_RMS.
const TARGETS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// Bakes one asset with the levels that `lod` lists; sequences come from the cache of the runs before.
fn bake(folder: &Path, corpus: &Path, asset: &str, size: u32, lod: &str) -> Report {
    let mut text = format!("input = {:?}\noutput = 'out'\n", corpus.join("quality").join(asset).to_str().unwrap());
    write!(text, "simplify.effort = 'fast'\nappearance.size = {size}\nlod = [{lod}]\n").unwrap();
    let file = folder.join("pipeline.toml");
    std::fs::write(&file, text).unwrap();
    assert_cmd::Command::cargo_bin("lodbake").unwrap().arg("--quiet").arg(&file).assert().success();
    read(&folder.join("out").join("report.json")).unwrap()
}

/// Levels of one asset that keep to their targets while the next cut does not.
fn check(corpus: &Path, asset: &str, size: u32) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let lod: Vec<String> = TARGETS.iter().map(|target| format!("{{ appearance = {target} }}")).collect();
    let reached = bake(folder.path(), corpus, asset, size, &lod.join(", "));
    let meshes = || reached.scenes[0].meshes.iter().enumerate();
    let reached: Vec<_> = meshes().flat_map(|(mesh, record)| record.levels.iter().map(move |l| (mesh, l))).collect();
    assert!(!reached.is_empty(), "{asset}");
    for &(mesh, level) in &reached {
        let (target, found) = (TARGETS[level.number as usize - 1], level.d_rms.unwrap());
        assert!(found <= target, "{asset}: {found} for {target}");
        if level.stop == Stop::NoLegalPair {
            continue;
        }
        // The next cut is the finest level with fewer triangles.
        let next = bake(folder.path(), corpus, asset, size, &format!("{{ triangles = {} }}", level.triangles - 1));
        let next = &next.scenes[0].meshes[mesh].levels[0];
        // A level of nothing is none: the last triangles stay.
        if next.triangles == level.triangles && level.triangles <= 2 {
            continue;
        }
        // Two triangles fewer, or all that was left of a loose part.
        assert!(next.triangles < level.triangles, "{asset}: {} after {}", next.triangles, level.triangles);
        let over = next.d_rms.unwrap();
        // On a large mesh one step changes next to nothing, and not always for the worse.
        assert!(over > target * 0.999, "{asset}: {} triangles already differ by {over} only", next.triangles);
    }
    reached.len()
}

#[test]
fn a_level_by_appearance_is_the_coarsest_within_its_target() {
    let Some(corpus) = corpus() else { return };
    let checked: usize = ASSETS.iter().map(|asset| check(&corpus, asset, 96)).sum();
    assert!(checked >= 8, "{checked} levels");
}

/// Minutes of work (`LODBAKE_ASSET=a,b` for some assets): `cargo test --release --test looks_corpus -- --ignored --nocapture`.
#[test]
#[ignore = "takes minutes"]
#[expect(clippy::print_stdout, reason = "the figures are what it is run for")]
fn so_it_is_at_512_pixels_for_every_asset() {
    let Some(corpus) = corpus() else { return };
    for entry in std::fs::read_dir(corpus.join("quality")).unwrap() {
        let asset = entry.unwrap().file_name().into_string().unwrap();
        if std::env::var("LODBAKE_ASSET").is_ok_and(|wanted| !wanted.split(',').any(|one| one == asset)) {
            continue;
        }
        let began = std::time::Instant::now();
        println!("{asset}: {} levels, {:.0} s", check(&corpus, &asset, 512), began.elapsed().as_secs_f64());
    }
}
