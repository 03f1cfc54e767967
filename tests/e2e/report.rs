//! What was recorded, in the formats of others: written where it is asked for, the worst first in each.

use crate::scene::{Scene, Shape};
use crate::space::Space;

/// Two scenes, one beyond its budget, baked.
fn space() -> Space {
    let space = Space::new();
    let budget = "[[budget]]\nlevel = [1]\ntriangles = { error = 130 }\n";
    space.write(
        "art/pipeline.toml",
        format!("input = \"scenes\"\noutput = \"out\"\nbaseline = \"base.json\"\n{budget}"),
    );
    space.write("art/scenes/low.glb", Scene::of(&Shape::grid(8, 0.2)).glb());
    let (text, buffer) = Scene::of(&Shape::grid(12, 0.2)).gltf_beside("hill.bin");
    space.write("art/scenes/the hill.gltf", text);
    space.write("art/scenes/hill.bin", buffer);
    space.run_fine(&["art/pipeline.toml"]);
    space
}

fn text(space: &Space, name: &str) -> String {
    String::from_utf8(space.read(name)).expect("reports are UTF-8")
}

#[test]
fn each_file_is_written_by_its_name() {
    let space = space();
    let outputs = ["base.json", "r.html", "r.md", "r.sarif", "r.xml"].map(|name| format!("art/{name}"));
    let mut words = vec!["report", "art/pipeline.toml"];
    words.extend(outputs.iter().flat_map(|name| ["--output", name]));
    assert_eq!(space.run_fine(&words).stdout, "");
    assert_eq!(space.read("art/base.json"), space.read("art/out/report.json"));
    assert!(text(&space, "art/r.md").starts_with("<!-- lodbake report -->\n## lodbake: 1 error\n"));
    let sarif = space.json("art/r.sarif");
    let place = &sarif["runs"][0]["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"];
    assert_eq!(place, "art/scenes/the%20hill.gltf");
    assert!(text(&space, "art/r.xml").contains("<testcase name=\"art/scenes/the hill.gltf\" classname=\"lodbake\">"));
    let page = text(&space, "art/r.html");
    assert_eq!(page.matches("src=\"data:image/jpeg;base64,").count(), 2, "a contact sheet of each scene");
    assert!(!page.contains("<script type=\"application/octet-stream\">") && page.len() < 1_000_000);

    let viewed = ["report", "art/pipeline.toml", "-o", "v.html", "--viewer", "--sheets", "1"];
    space.run_fine(&viewed);
    let page = text(&space, "v.html");
    assert_eq!(page.matches("<script type=\"application/octet-stream\">").count(), 1);
    assert_eq!(page.matches("src=\"data:image/jpeg;base64,").count(), 1);
}

#[test]
fn standard_output_takes_any_format() {
    let space = space();
    let of = |format: &str| space.run_fine(&["report", "art/pipeline.toml", "--format", format]).stdout;
    let first =
        "::error file=art/scenes/the hill.gltf,title=lodbake budget/triangles::the hill.gltf: mesh `shape`, level 1: ";
    assert!(of("github").starts_with(first), "{}", of("github"));
    let figures: serde_json::Value = serde_json::from_str(&of("bencher")).expect("JSON");
    assert_eq!(figures["low.glb"]["triangles"]["value"], 128.0);
    assert!(of("benchmark").starts_with("[\n"));
    assert_eq!(of("json").as_bytes(), space.read("art/out/report.json"));
}

#[test]
fn history_and_changes_come_from_other_reports() {
    let space = space();
    std::fs::copy(space.path("art/out/report.json"), space.path("old.json")).expect("a bake writes it");
    space.write("art/scenes/low.glb", Scene::of(&Shape::grid(16, 0.2)).glb());
    space.run_fine(&["art/pipeline.toml"]);
    let words =
        ["report", "old.json", "art/out", "--pipeline", "art/pipeline.toml", "--baseline", "old.json", "-o", "r.html"];
    space.run_fine(&words);
    let page = text(&space, "r.html");
    assert!(page.contains("<section id=\"history\"") && page.contains("<section id=\"changes\""));
    assert!(page.contains("<td><span class=\"error\">grew</span></td><td>low.glb</td>"), "changes name the scene");
}

#[test]
fn what_cannot_be_written_is_refused() {
    let space = space();
    for (words, said) in [
        (&["report", "art/pipeline.toml", "-o", "report.txt"][..], "error: `report.txt` does not tell its format"),
        (&["report", "art/pipeline.toml", "-f", "html", "-o", "a", "-o", "b"], "error: `--format` is for one output"),
        (&["report", "none.toml"], "error: failed to read `none.toml`"),
        (&["report"], "error: there is no pipeline here"),
    ] {
        let run = space.run(words);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{run:#?}");
        assert!(run.stderr.starts_with(said), "{}", run.stderr);
    }
}
