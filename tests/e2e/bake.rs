//! Baking: what is done, what is not done again, what is left alone.

use std::time::{Duration, SystemTime};

use serde_json::{Value, json};

use crate::scene::{Scene, Shape};
use crate::space::Space;

/// Two levels, few enough triangles for a quick test.
const PIPELINE: &str = r#"input = "scenes"
output = "out"

[[lod]]
ratio = 0.5

[[lod]]
ratio = 0.25
"#;

/// A folder with a pipeline and `scenes`.
fn space(scenes: &[(&str, Vec<u8>)]) -> Space {
    let space = Space::new();
    space.write("pipeline.toml", PIPELINE);
    for (name, bytes) in scenes {
        space.write(&format!("scenes/{name}"), bytes);
    }
    space
}

/// Three scenes in both forms and a sub-folder: two of them with the same mesh.
fn three_scenes() -> Space {
    let mut street = Scene::new();
    let lamp = street.mesh("lamp", &Shape::sphere(12, 16));
    for i in 0..5 {
        street.node("lamp", lamp, [i as f32, 0.0, 0.0]);
    }
    let ground = street.mesh("ground", &Shape::grid(10, 0.1));
    street.node("ground", ground, [0.0; 3]);
    let (text, buffer) = Scene::of(&Shape::grid(12, 0.2)).gltf_beside("two%20words.bin");
    space(&[
        ("street.glb", street.glb()),
        ("props/lamp.gltf", Scene::of(&Shape::sphere(12, 16)).gltf()),
        ("props/hill.gltf", text),
        ("props/two words.bin", buffer),
    ])
}

/// Sets the time of the last change of all scenes to `seconds` after 2020, as a checkout or a copy would.
fn date_scenes(space: &Space, seconds: u64) {
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(1_577_836_800 + seconds);
    for name in space.files("scenes").keys() {
        let file = std::fs::File::options().append(true).open(space.path(&format!("scenes/{name}")));
        file.and_then(|file| file.set_modified(time)).expect("scenes are the test's own files");
    }
}

/// The numbers of a summary by name.
fn numbers(summary: &Value, names: &[&str]) -> Vec<u64> {
    names.iter().map(|name| summary[name].as_u64().unwrap_or_else(|| panic!("`{name}`: {summary}"))).collect()
}

/// The JSON of a scene that was written.
fn document(bytes: &[u8]) -> Value {
    let text = if bytes.starts_with(b"glTF") {
        let length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes"));
        &bytes[20..20 + length as usize]
    } else {
        bytes
    };
    serde_json::from_slice(text).expect("an output is JSON")
}

#[test]
fn scenes_get_levels_and_a_report() {
    let space = three_scenes();
    let run = space.run_fine(&["pipeline.toml", "--json"]);
    let counted = ["files", "baked", "failed", "meshes_found", "meshes_distinct", "jobs", "cache_hits"];
    assert_eq!(numbers(&run.summary(), &counted), [3, 3, 0, 4, 3, 3, 0]);

    let street = document(&space.read("out/street.glb"));
    assert_eq!(street["extensionsUsed"], json!(["MSFT_lod"]));
    assert!(street.get("extensionsRequired").is_none());
    let groups = street["nodes"].as_array().expect("it has nodes").iter();
    let groups = groups.filter(|node| node["extensions"]["MSFT_lod"]["ids"].as_array().map(Vec::len) == Some(2));
    assert_eq!(groups.count(), 6, "five lamps and a ground");

    let report = space.json("out/report.json");
    assert_eq!(report["totals"]["files"], 3);
    let scenes = report["scenes"].as_array().expect("it lists scenes");
    let paths: Vec<_> = scenes.iter().map(|scene| scene["path"].as_str().unwrap_or_default()).collect();
    assert_eq!(paths, ["props/hill.gltf", "props/lamp.gltf", "street.glb"]);
    let lamp = &scenes[2]["meshes"][0];
    assert_eq!((&lamp["instances"], &lamp["triangles"]), (&json!(5), &json!(Shape::sphere(12, 16).triangles())));
    assert_eq!(lamp["levels"].as_array().map(Vec::len), Some(2));
    assert!(lamp["levels"][0]["error"].as_f64().is_some_and(|error| error > 0.0), "{lamp}");
}

#[test]
fn the_report_obeys_the_published_schema() {
    let space = three_scenes();
    space.run_fine(&[]);
    let schema = space.run_fine(&["schema", "report"]).document();
    let validator = jsonschema::validator_for(&schema).expect("it is a schema");
    let report = space.json("out/report.json");
    let errors: Vec<String> = validator.iter_errors(&report).map(|error| error.to_string()).collect();
    assert_eq!(errors, Vec::<String>::new());
}

#[test]
fn a_second_run_has_no_work_and_touches_nothing() {
    let space = three_scenes();
    date_scenes(&space, 0);
    space.run_fine(&["pipeline.toml"]);
    let times = space.times("out");
    let run = space.run_fine(&["pipeline.toml"]);
    assert!(run.stderr.starts_with("no work: 3 scenes unchanged ("), "{}", run.stderr);
    assert_eq!(run.stdout, "");
    let run = space.run_fine(&["pipeline.toml", "--json"]);
    let counted = ["files", "unchanged", "baked", "jobs", "cache_hits", "scene_bytes_read", "outputs_written"];
    assert_eq!(numbers(&run.summary(), &counted), [3, 3, 0, 0, 0, 0, 0]);
    assert_eq!(space.times("out"), times);
}

#[test]
fn touch_alone_rebuilds_nothing() {
    let space = three_scenes();
    date_scenes(&space, 0);
    space.run_fine(&["pipeline.toml"]);
    let times = space.times("out");
    date_scenes(&space, 1000);
    let run = space.run_fine(&["pipeline.toml", "--json"]);
    assert_eq!(numbers(&run.summary(), &["jobs", "outputs_written", "failed"]), [0, 0, 0]);
    assert_eq!(space.times("out"), times);
}

#[test]
fn one_changed_mesh_among_200_files_is_one_job() {
    let shapes: Vec<Shape> = (0..20).map(|i| Shape::grid(8, 0.01 * (1.0 + i as f32))).collect();
    let names: Vec<String> = (0..200).map(|i| format!("{:02}/prop_{i:03}.glb", i % 7)).collect();
    let files: Vec<(&str, Vec<u8>)> =
        names.iter().enumerate().map(|(i, name)| (name.as_str(), Scene::of(&shapes[i % 20]).glb())).collect();
    let space = space(&files);
    date_scenes(&space, 0);
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["files", "meshes_found", "meshes_distinct", "jobs"]), [200, 200, 20, 20]);
    space.write(&format!("scenes/{}", names[123]), Scene::of(&Shape::grid(8, 0.9)).glb());
    let run = space.run_fine(&["--json"]);
    let counted = ["unchanged", "baked", "jobs", "cache_hits", "outputs_written"];
    assert_eq!(numbers(&run.summary(), &counted), [199, 1, 1, 0, 1]);
    assert_eq!(run.events_of("job_started").len(), 1);
}

#[test]
fn the_number_of_threads_and_the_cache_change_no_byte() {
    let space = three_scenes();
    space.run_fine(&["--jobs", "1", "--cache", "first"]);
    let one = space.files("out");
    assert!(one.contains_key("report.json"));
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    space.run_fine(&["--jobs", "2", "--cache", "second"]);
    assert_eq!(space.files("out"), one, "two threads");
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    let run = space.run_fine(&["--json", "--cache", "second"]);
    assert_eq!(numbers(&run.summary(), &["jobs", "cache_hits"]), [0, 3]);
    assert_eq!(space.files("out"), one, "a warm cache");
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    space.run_fine(&["--no-cache"]);
    assert_eq!(space.files("out"), one, "no cache");
}

#[test]
fn a_broken_scene_does_not_stop_the_others() {
    let mut broken = Scene::of(&Shape::grid(8, 0.1)).glb();
    broken.truncate(broken.len() / 2);
    let space = space(&[
        ("a.glb", Scene::of(&Shape::grid(8, 0.1)).glb()),
        ("b.glb", broken),
        ("c.gltf", b"{ \"asset\": ".to_vec()),
        ("d.glb", Scene::of(&Shape::grid(9, 0.1)).glb()),
    ]);
    let run = space.run(&["pipeline.toml"]);
    assert_eq!(run.code, 3, "{run:#?}");
    assert!(run.stderr.contains("error: failed to read `scenes/b.glb`: "), "{}", run.stderr);
    assert!(run.stderr.contains("error: failed to read `scenes/c.gltf`: "), "{}", run.stderr);
    assert!(run.stderr.contains("\nhint: "), "{}", run.stderr);
    assert!(run.stderr.contains("error: 2 of 4 scenes could not be baked:\n  b.glb\n  c.gltf\n"), "{}", run.stderr);
    assert_eq!(space.files("out").into_keys().collect::<Vec<_>>(), ["a.glb", "d.glb", "report.json"]);
    let report = space.json("out/report.json");
    assert_eq!(report["totals"]["failed"], 2);
    assert_eq!(report["problems"][0]["scene"], "b.glb");

    let again = space.run(&["pipeline.toml", "--json"]);
    assert_eq!(again.code, 3, "a failure stays one until it is mended");
    assert_eq!(again.events_of("scene_failed").len(), 2);
    space.write("scenes/b.glb", Scene::of(&Shape::grid(8, 0.1)).glb());
    std::fs::remove_file(space.path("scenes/c.gltf")).expect("the test wrote it");
    space.run_fine(&["pipeline.toml"]);
    assert_eq!(space.json("out/report.json")["problems"], json!([]));
}

#[test]
fn a_lost_or_damaged_cache_is_made_again() {
    let space = three_scenes();
    let cache = ["--cache", "cache", "--json"];
    space.run_fine(&cache);
    let out = space.files("out");
    std::fs::remove_dir_all(space.path("cache")).expect("it was just made");
    let run = space.run_fine(&cache);
    assert_eq!(run.summary()["failed"], 0);
    assert_eq!(space.files("out"), out, "a lost cache");

    // One bit in the middle of every file of it: indexes, chains, whatever there is.
    for (name, mut bytes) in space.files("cache") {
        if let Some(byte) = bytes.len().checked_div(2).and_then(|middle| bytes.get_mut(middle)) {
            *byte ^= 1;
        }
        space.write(&format!("cache/{name}"), bytes);
    }
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    let run = space.run_fine(&cache);
    assert_eq!(numbers(&run.summary(), &["jobs", "cache_hits"]), [3, 0]);
    assert!(!run.events_of("warning").is_empty(), "damage is told");
    assert_eq!(space.files("out"), out, "a damaged cache");
}

#[test]
fn a_lost_output_is_written_again_without_a_job() {
    let space = three_scenes();
    space.run_fine(&[]);
    let out = space.files("out");
    std::fs::remove_file(space.path("out/street.glb")).expect("it was just made");
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["jobs", "outputs_written", "unchanged"]), [0, 1, 2]);
    assert_eq!(space.files("out"), out);
}

#[test]
fn a_changed_setting_bakes_again_and_changing_it_back_costs_no_job() {
    let space = three_scenes();
    space.run_fine(&[]);
    let out = space.files("out");
    space.write("pipeline.toml", PIPELINE.replace("0.25", "0.3"));
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["unchanged", "baked"]), [0, 3]);
    assert_ne!(space.files("out"), out);
    space.write("pipeline.toml", PIPELINE);
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["jobs", "baked"]), [0, 3]);
    assert_eq!(space.files("out"), out);
}

#[test]
fn an_unknown_key_is_wrong_configuration() {
    let space = three_scenes();
    space.write("pipeline.toml", PIPELINE.replace("ratio = 0.25", "raito = 0.25"));
    let run = space.run(&["pipeline.toml"]);
    assert_eq!((run.code, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.starts_with("error: unknown key `lod[1].raito` in `pipeline.toml` line 8"), "{}", run.stderr);
    assert!(run.stderr.contains("did you mean `ratio`?"), "{}", run.stderr);
    assert!(space.files("out").is_empty());
}

#[test]
fn a_missing_pipeline_names_the_way_to_one() {
    let run = Space::new().run(&["bake", "other.toml"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.starts_with("error: failed to read `other.toml`: "), "{}", run.stderr);
    assert!(run.stderr.contains("\nhint: `lodbake init` writes"), "{}", run.stderr);
}

#[test]
fn a_dry_run_tells_and_writes_nothing() {
    let space = three_scenes();
    let before = space.files("");
    let run = space.run_fine(&["--dry-run", "pipeline.toml"]);
    for path in ["props/hill.gltf", "props/lamp.gltf", "street.glb"] {
        assert!(run.stderr.contains(&format!("would bake {path}: ")), "{}", run.stderr);
    }
    assert!(run.stderr.contains("would bake 3 scenes"), "{}", run.stderr);
    assert_eq!(space.files(""), before);
    space.run_fine(&[]);
    let run = space.run_fine(&["bake", "--dry-run", "--json"]);
    assert_eq!(run.summary()["dry_run"], true);
    assert_eq!(numbers(&run.summary(), &["unchanged", "baked", "jobs"]), [3, 0, 0]);
}

#[test]
fn only_changed_outputs_are_written() {
    let space = three_scenes();
    date_scenes(&space, 0);
    space.run_fine(&[]);
    let before = space.times("out");
    space.write("scenes/street.glb", Scene::of(&Shape::sphere(10, 10)).glb());
    space.run_fine(&[]);
    let after = space.times("out");
    let changed: Vec<_> =
        after.iter().filter(|(name, time)| before.get(*name) != Some(time)).map(|(name, _)| name.as_str()).collect();
    assert_eq!(changed, ["report.json", "street.glb"]);
}

#[test]
fn quiet_tells_nothing_and_json_is_lines_of_known_events() {
    let space = three_scenes();
    let quiet = space.run_fine(&["--quiet"]);
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
    std::fs::remove_dir_all(space.path("out")).expect("it was just made");
    let run = space.run_fine(&["--json", "--no-cache"]);
    assert_eq!(run.stderr, "");
    let kinds: Vec<String> = run.events().iter().map(|e| e["type"].as_str().unwrap_or_default().to_owned()).collect();
    assert_eq!(kinds.first().map(String::as_str), Some("scan_finished"));
    assert_eq!(kinds.last().map(String::as_str), Some("finished"));
    for (kind, times) in [("scene_written", 3), ("job_finished", 3), ("plan_finished", 1)] {
        assert_eq!(kinds.iter().filter(|k| *k == kind).count(), times, "{kind}: {kinds:?}");
    }
    let bytes: u64 = run.events_of("scene_read").iter().filter_map(|event| event["bytes"].as_u64()).sum();
    assert!(bytes > 0);
    assert!(run.summary()["scene_bytes_read"].as_u64() >= Some(bytes), "{:?}", run.summary());
}

#[test]
fn a_run_tells_a_summary_without_colour() {
    let space = three_scenes();
    let run = space.run_fine(&["pipeline.toml"]);
    for words in ["baked 3 scenes (", "meshes found  4", "distinct      3", "jobs run      3", "level 2", "25 %"] {
        assert!(run.stderr.contains(words), "`{words}`: {}", run.stderr);
    }
    assert!(!run.stderr.contains('\x1b'), "{}", run.stderr);
}

#[test]
fn equal_meshes_with_other_materials_are_one_job() {
    let shape = Shape::sphere(10, 12);
    let mut scene = Scene::new();
    for (i, material) in [0, 1, 0].into_iter().enumerate() {
        let mesh = scene.mesh_with_material("copy", &shape, material);
        scene.node("copy", mesh, [i as f32, 0.0, 0.0]);
    }
    let other = scene.mesh("other", &shape.shifted(0.5));
    scene.node("other", other, [0.0; 3]);
    let space = space(&[("copies.glb", scene.glb())]);
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["meshes_found", "meshes_distinct", "jobs"]), [4, 2, 2]);
}

#[test]
fn equal_parts_of_unlike_meshes_look_alike() {
    let mut scene = Scene::new();
    for name in ["with points", "alone"] {
        let mesh = scene.mesh(name, &Shape::sphere(12, 16));
        scene.node(name, mesh, [0.0; 3]);
    }
    scene.add_points(0);
    let space = space(&[("pair.glb", scene.glb())]);
    space.run_fine(&[]);
    let report = space.json("out/report.json");
    let looks = |mesh: usize| &report["scenes"][0]["meshes"][mesh]["levels"][0]["d_rms"];
    assert!(looks(0).as_f64().is_some_and(|d_rms| 0.0 < d_rms), "{report:#}");
    assert_eq!(looks(0), looks(1));
}

#[test]
fn a_scene_without_triangles_to_spare_is_copied() {
    let space = space(&[("tiny.glb", Scene::of(&Shape::grid(2, 0.0)).glb())]);
    let run = space.run_fine(&["--json"]);
    assert_eq!(numbers(&run.summary(), &["baked", "copied", "jobs"]), [0, 1, 0]);
    assert_eq!(space.read("out/tiny.glb"), space.read("scenes/tiny.glb"));
}

#[test]
fn an_image_of_an_unknown_kind_is_told_and_kept() {
    let mut scene: Value = serde_json::from_slice(&Scene::of(&Shape::grid(12, 0.2)).gltf()).expect("JSON");
    scene["images"] = json!([{ "uri": "data:image/png;base64,R0lGODlh" }]);
    scene["textures"] = json!([{ "source": 0 }]);
    scene["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    scene["meshes"][0]["primitives"][0]["material"] = json!(0);
    let space = space(&[("odd.gltf", scene.to_string().into_bytes())]);
    let told = space.run_fine(&["pipeline.toml"]).stderr;
    assert!(told.contains("`odd.gltf`: images[0]: the image is neither PNG, JPEG, WebP nor KTX2"), "{told}");
    assert_eq!(space.json("out/odd.gltf")["images"], scene["images"]);
    assert_eq!(space.json("out/report.json")["problems"][0]["place"], "images[0]");
}
