//! The record of two small scenes: its sums, its bytes, its words.

use std::time::Duration;

use super::*;
use crate::progress::Summary;

fn hash(byte: u8) -> MeshHash {
    MeshHash([byte; 32])
}

fn level(number: u64, triangles: u64, stop: Stop) -> LevelRecord {
    LevelRecord {
        number,
        target: LevelTarget::Ratio(0.5),
        triangles,
        vertices: triangles / 2,
        bytes: 6 * triangles,
        error: 0.02,
        error_of_radius: 0.01,
        coverage: 0.5,
        distance: 12.5,
        stop,
        recipe: None,
        d_rms: Some(1.5),
        worst_view: Some(2.5),
        silhouette: Some(0.01),
        surface: None,
    }
}

fn mesh(hashes: &[u8], instances: u64, levels: &[u64]) -> MeshRecord {
    let triangles = 1000 * hashes.len() as u64;
    let piece = |byte: &u8| PieceRecord {
        hash: hash(*byte),
        primitives: vec![0],
        triangles: 1000,
        vertices: 600,
        levels: levels.iter().map(|&t| PieceLevel { triangles: t, error: 0.02 }).collect(),
    };
    MeshRecord {
        index: 0,
        name: Some("lamp".into()),
        instances,
        draw_calls: instances,
        copy_of: None,
        instance_of: None,
        shares: Vec::new(),
        triangles,
        vertices: 600 * hashes.len() as u64,
        radius: 2.0,
        pieces: hashes.iter().map(piece).collect(),
        levels: levels.iter().zip(1..).map(|(&t, number)| level(number, t, Stop::Target)).collect(),
        notes: vec![],
    }
}

fn scene(path: &str, status: Status, meshes: Vec<MeshRecord>) -> SceneRecord {
    SceneRecord {
        path: path.into(),
        status,
        settings: None,
        bytes_in: 100_000,
        bytes_out: if status == Status::Baked { 120_000 } else { 0 },
        outputs: vec![],
        meshes,
        costs: None,
        batches: None,
        parts: None,
    }
}

fn report() -> Report {
    let a = scene("a.glb", Status::Baked, vec![mesh(&[1], 10, &[500, 250]), mesh(&[2, 1], 2, &[900])]);
    let b = scene("b.glb", Status::Baked, vec![mesh(&[1], 0, &[500, 250])]);
    let c = scene("c.glb", Status::Failed, vec![]);
    let problem = Problem {
        scene: Some("c.glb".into()),
        severity: Severity::Error,
        place: "meshes[2].primitives[0]".into(),
        cause: "index 812 is out of range (640 vertices)".into(),
        hint: None,
    };
    let mut settings = SceneSettings::default();
    let limit = LevelTarget::Error { limit: 0.01, unit: crate::config::ErrorUnit::Radius };
    settings.chain.levels = vec![LevelTarget::Ratio(0.5), limit];
    Report::new(settings, vec![c, b, a], vec![problem])
}

fn summary() -> Summary {
    Summary {
        files: 3,
        baked: 2,
        failed: 1,
        meshes_found: 4,
        meshes_distinct: 2,
        jobs: 1,
        cache_hits: 1,
        ..Summary::default()
    }
}

#[test]
fn sums_count_instances_and_the_level_before_where_there_is_none() {
    let report = report();
    let paths: Vec<&str> = report.scenes.iter().map(|s| s.path.as_str()).collect();
    assert_eq!(paths, ["a.glb", "b.glb", "c.glb"]);
    let totals = &report.totals;
    assert_eq!((totals.files, totals.baked, totals.failed), (3, 2, 1));
    assert_eq!((totals.meshes_found, totals.meshes_distinct, totals.instances), (4, 2, 12));
    assert_eq!(totals.triangles_drawn, [10 * 1000 + 2 * 2000, 10 * 500 + 2 * 900, 10 * 250 + 2 * 900]);
    assert_eq!(totals.triangles_stored, [4000, 1900, 1400]);
    assert_eq!((totals.bytes_in, totals.bytes_out), (300_000, 240_000));
}

#[test]
fn distinct_meshes_say_who_uses_them() {
    let meshes = report().meshes;
    let first = DistinctMesh { hash: hash(1), triangles: 1000, vertices: 600, uses: 3, instances: 12, scenes: 2 };
    let second = DistinctMesh { hash: hash(2), triangles: 1000, vertices: 600, uses: 1, instances: 2, scenes: 1 };
    assert_eq!(meshes, [first, second]);
}

#[test]
fn it_survives_json_and_the_binary_form() {
    let report = report();
    assert_eq!(serde_json::from_slice::<Report>(&to_json(&report)).expect("it was just written"), report);
    let binary = postcard::to_stdvec(&report).expect("every field has a binary form");
    assert_eq!(postcard::from_bytes::<Report>(&binary).expect("it was just written"), report);
}

#[test]
fn it_obeys_its_schema() {
    let validator = jsonschema::validator_for(&schema()).expect("the schema is one");
    let record: serde_json::Value = serde_json::from_slice(&to_json(&report())).expect("it was just written");
    let errors: Vec<String> = validator.iter_errors(&record).map(|e| e.to_string()).collect();
    assert_eq!(errors, Vec::<String>::new());
    let mut wrong = record;
    wrong["totals"]["files"] = "three".into();
    assert!(!validator.is_valid(&wrong));
}

#[test]
fn every_field_of_the_schema_is_explained() {
    fn look(place: &str, value: &serde_json::Value, missing: &mut Vec<String>) {
        for (name, field) in value["properties"].as_object().into_iter().flatten() {
            if field.get("description").is_none() {
                missing.push(format!("{place}.{name}"));
            }
        }
    }
    let schema = schema();
    let mut missing = Vec::new();
    look("Report", &schema, &mut missing);
    for (name, definition) in schema["$defs"].as_object().expect("there are nested records") {
        look(name, definition, &mut missing);
    }
    assert_eq!(missing, Vec::<String>::new());
}

#[test]
fn an_equal_record_is_not_touched() {
    let folder = tempfile::tempdir().expect("the system has a temporary folder");
    let below = folder.path().join("out");
    let report = report();
    assert_eq!(write(&report, &below).expect("it can be written"), Written::Changed);
    assert_eq!(write(&report, &below).expect("it can be read"), Written::Untouched);
    assert_eq!(read(&below.join(FILE_NAME)).expect("it was just written"), report);
    std::fs::write(below.join(FILE_NAME), "{}").expect("it can be written");
    assert_eq!(write(&report, &below).expect("it can be written"), Written::Changed);
    assert_eq!(std::fs::read_dir(&below).expect("it is a folder").count(), 1, "no temporary file is left");
}

#[test]
fn a_record_of_a_later_version_is_refused() {
    let folder = tempfile::tempdir().expect("the system has a temporary folder");
    let path = folder.path().join(FILE_NAME);
    std::fs::write(&path, r#"{ "format": 99, "unheard": "of" }"#).expect("it can be written");
    let error = read(&path).expect_err("99 is a later version");
    assert!(matches!(error, ReportError::Newer { found: 99, .. }), "{error}");
}

#[test]
fn the_summary_fits_a_terminal() {
    let text = summary_table(&report(), &summary(), Duration::from_millis(12_340));
    insta::assert_snapshot!(text);
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn a_target_without_a_level_shows_the_one_before() {
    let mut mesh = mesh(&[1], 1, &[500, 250]);
    mesh.levels[1].number = 3;
    let shown: Vec<_> = (0..5).map(|k| mesh.level_for(k).map(|level| level.triangles)).collect();
    assert_eq!(shown, [None, Some(500), Some(500), Some(250), Some(250)]);
    let report = Report::new(SceneSettings::default(), vec![scene("a.glb", Status::Baked, vec![mesh])], vec![]);
    assert_eq!(report.totals.triangles_drawn, [1000, 500, 500, 250]);
}

#[test]
fn the_summary_says_how_many_targets_were_missed() {
    let mut scene = scene("a.glb", Status::Baked, vec![mesh(&[1], 1, &[500, 400, 390])]);
    scene.meshes[0].levels[1].stop = Stop::NoLegalPair;
    scene.meshes[0].levels[2].stop = Stop::ErrorLimit;
    scene.meshes[0].levels[2].target = LevelTarget::Error { limit: 0.1, unit: crate::config::ErrorUnit::Object };
    let report = Report::new(SceneSettings::default(), vec![scene], vec![]);
    let text = summary_table(&report, &summary(), Duration::ZERO);
    assert!(text.ends_with("\n1 of 2 levels have more triangles than asked: nothing left to contract"), "{text}");
}

#[test]
fn a_run_without_work_says_so_in_one_line() {
    let unchanged = Summary { files: 200, unchanged: 200, ..Summary::default() };
    let text = summary_table(&report(), &unchanged, Duration::from_millis(50));
    assert_eq!(text, "no work: 200 scenes unchanged (0.05 s)");
    let failed = Summary { files: 3, unchanged: 2, failed: 1, ..Summary::default() };
    assert_eq!(summary_table(&report(), &failed, Duration::ZERO), "2 unchanged, 1 failed (0.00 s)");
}

#[test]
fn a_dry_run_says_what_would_be_done() {
    let summary = Summary { dry_run: true, files: 9, baked: 7, jobs: 1, skipped: 2, ..Summary::default() };
    let text = summary_table(&report(), &summary, Duration::ZERO);
    assert_eq!(text, "would bake 7 scenes with 1 job, 2 skipped (0.00 s)");
}
