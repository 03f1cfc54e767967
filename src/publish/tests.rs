//! Every format names the worst first, escapes what it is given, and stays within what its readers take.

use super::*;
use crate::budget::tests::scene;
use crate::config::SceneSettings;
use crate::difference::Thresholds;
use crate::report::Problem;

#[derive(Debug)]
struct At;

impl ScenePaths for At {
    fn scene(&self, relative: &str) -> String {
        format!("art/{relative}")
    }

    fn pipeline(&self) -> String {
        "art/pipeline.toml".to_owned()
    }
}

fn finding(severity: Severity, scene: Option<&str>, message: &str, excess: f64) -> Finding {
    Finding {
        severity,
        rule: "budget/triangles".to_owned(),
        scene: scene.map(str::to_owned),
        mesh: Some("shade".to_owned()),
        level: Some(1),
        value: Some(5.0),
        base: None,
        limit: Some(4.0),
        message: message.to_owned(),
        help: "ask for `ratio = 0.4`".to_owned(),
        line: Some(7),
        excess,
    }
}

fn record() -> Report {
    let problem = Problem {
        scene: Some("a b,c.glb".into()),
        severity: Severity::Warning,
        place: "meshes[0]".into(),
        cause: "<odd> & 100%\nof it".into(),
        hint: None,
    };
    Report::new(SceneSettings::default(), vec![scene("a b,c.glb"), scene("lamp.glb"), scene("ok.glb")], vec![problem])
}

fn with<T>(report: &Report, findings: &[Finding], use_it: impl Fn(&Publication<'_>) -> T) -> T {
    let mut base = report.clone();
    base.scenes.push(scene("zzz.glb"));
    base.scenes[1].outputs[0].bytes = 10_000;
    let difference = Difference::between(&base, report, &Thresholds::default());
    use_it(&Publication { report, findings, difference: Some(&difference), paths: &At })
}

fn some() -> Vec<Finding> {
    let mut found: Vec<Finding> = record().problems.iter().map(Finding::of_problem).collect();
    found.push(finding(Severity::Error, Some("lamp.glb"), "5 triangles; limit 4 | 25 % over", 1.25));
    found.push(Finding {
        rule: "regression/vanished".into(),
        ..finding(Severity::Error, Some("gone.glb"), "gone", 9.0)
    });
    crate::budget::sort(&mut found);
    found
}

#[test]
fn markdown_names_the_worst_first() {
    insta::assert_snapshot!(with(&record(), &some(), |p| markdown(p, 64_000)), @r"
    <!-- lodbake report -->
    ## lodbake: 2 errors, 1 warning

    3 scenes baked, 0 of 0 meshes distinct, 60.0 kB written (lodbake 0.1.0).

    | | where | what | what would help |
    |---|---|---|---|
    | **error** | gone.glb: mesh `shade`, level 1 | gone | ask for `ratio = 0.4` |
    | **error** | lamp.glb: mesh `shade`, level 1 | 5 triangles; limit 4 \| 25 % over | ask for `ratio = 0.4` |
    | warning | a b,c.glb | meshes\[0\]: &lt;odd&gt; &amp; 100% of it |  |

    ### Since the baseline

    In sum: bytes of the files: 70.0 kB → 60.0 kB (−14 %); bytes of geometry: 60.0 kB → 45.0 kB (−25 %); bytes of textures: 20.0 kB → 15.0 kB (−25 %); triangles of the scene, with every instance: 24,000 → 18,000 (−25 %); draw calls: 48 → 36 (−25 %).

    | | where | what |
    |---|---|---|
    | **vanished** | zzz.glb | the scene is not there any more |
    | **grew** | lamp.glb | bytes of the files 2.0 times as much: 10.0 kB → 20.0 kB |

    <details><summary>All 3 scenes</summary>

    | scene | state | triangles | levels | worst d_RMS | bytes |
    |---|---|--:|--:|--:|--:|
    | lamp.glb | baked | 6,000 | 2 | 6.00 | 20.0 kB |
    | a b,c.glb | baked | 6,000 | 2 | 6.00 | 20.0 kB |
    | ok.glb | baked | 6,000 | 2 | 6.00 | 20.0 kB |

    </details>
    ");
}

#[test]
fn markdown_stays_within_its_size() {
    let many: Vec<Finding> = (0..5_000)
        .map(|i| finding(Severity::Error, Some(&format!("scene {i}.glb")), "too many triangles", 2.0))
        .collect();
    let scenes: Vec<SceneRecord> = (0..5_000).map(|i| scene(&format!("scene {i}.glb"))).collect();
    let report = Report::new(SceneSettings::default(), scenes, Vec::new());
    for most in [3_000, 64_000] {
        let text = with(&report, &many, |p| markdown(p, most));
        assert!(text.len() <= most && most / 2 < text.len(), "{}", text.len());
        assert!(text.contains("\n… and ") && text.ends_with("</details>\n"), "{}", &text[text.len() - 200..]);
        let rows = text.lines().filter(|line| line.starts_with("| **error** |")).count();
        assert!(5 < rows, "{rows}");
    }
}

#[test]
fn junit_has_a_case_for_each_scene() {
    insta::assert_snapshot!(with(&record(), &some(), junit), @r#"
    <?xml version="1.0" encoding="UTF-8"?>
    <testsuites name="lodbake" tests="4" skipped="0" failures="2" errors="0">
        <testsuite name="budgets and regressions" tests="4" skipped="0" errors="0" failures="2">
            <testcase name="art/gone.glb" classname="lodbake">
                <failure message="gone.glb: mesh `shade`, level 1: gone" type="regression/vanished">gone.glb: mesh `shade`, level 1: gone
      ask for `ratio = 0.4`</failure>
            </testcase>
            <testcase name="art/lamp.glb" classname="lodbake">
                <failure message="lamp.glb: mesh `shade`, level 1: 5 triangles; limit 4 | 25 % over" type="budget/triangles">lamp.glb: mesh `shade`, level 1: 5 triangles; limit 4 | 25 % over
      ask for `ratio = 0.4`</failure>
            </testcase>
            <testcase name="art/a b,c.glb" classname="lodbake">
                <system-out>a b,c.glb: meshes[0]: &lt;odd&gt; &amp; 100%
    of it</system-out>
            </testcase>
            <testcase name="art/ok.glb" classname="lodbake"/>
        </testsuite>
    </testsuites>
    "#);
}

#[test]
fn sarif_has_places_and_steady_fingerprints() {
    let document = with(&record(), &some(), sarif);
    let results = document["runs"][0]["results"].as_array().unwrap();
    assert_eq!(results.len(), 3);
    assert_eq!(results[0]["ruleId"], "regression/vanished");
    let uri = |i: usize| &results[i]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"];
    assert_eq!([uri(0), uri(1), uri(2)], ["art/gone.glb", "art/lamp.glb", "art/a%20b%2Cc.glb"]);
    assert_eq!(results[1]["relatedLocations"][0]["physicalLocation"]["region"]["startLine"], 7);
    let mut other = some();
    for finding in &mut other {
        finding.value = Some(6.0);
        finding.message.push_str(" or so");
    }
    let prints = |d: &serde_json::Value| -> Vec<String> {
        let all = d["runs"][0]["results"].as_array().unwrap().iter();
        all.map(|r| r["partialFingerprints"]["lodbakeFinding/v1"].as_str().unwrap().to_owned()).collect()
    };
    let again = with(&record(), &other, sarif);
    assert_eq!(prints(&document), prints(&again));
    assert_eq!(prints(&document).into_iter().collect::<std::collections::BTreeSet<_>>().len(), 3);
    let many: Vec<Finding> = (0..6_000).map(|_| some()[0].clone()).collect();
    let capped = with(&record(), &many, sarif);
    assert_eq!(capped["runs"][0]["results"].as_array().map(Vec::len), Some(5_000));
}

#[test]
fn github_gets_ten_of_each_kind() {
    insta::assert_snapshot!(with(&record(), &some(), annotations), @r"
    ::error file=art/gone.glb,title=lodbake regression/vanished::gone.glb: mesh `shade`, level 1: gone%0Aask for `ratio = 0.4`
    ::error file=art/lamp.glb,title=lodbake budget/triangles::lamp.glb: mesh `shade`, level 1: 5 triangles; limit 4 | 25 %25 over%0Aask for `ratio = 0.4`
    ::warning file=art/a b%2Cc.glb,title=lodbake bake/odd::a b,c.glb: meshes[0]: <odd> & 100%25%0Aof it
    ");
    let many: Vec<Finding> = (0..40)
        .map(|i| finding(if i < 25 { Severity::Error } else { Severity::Warning }, Some("lamp.glb"), "much", 1.0))
        .collect();
    let text = with(&record(), &many, annotations);
    let count = |word: &str| text.lines().filter(|line| line.starts_with(word)).count();
    assert_eq!([count("::error "), count("::warning "), count("::notice ")], [10, 10, 1]);
    assert!(text.ends_with("::and 20 more findings: they are in the summary\n"), "{text}");
}

#[test]
fn trackers_get_figures() {
    let document = with(&record(), &[], bencher);
    assert_eq!(document["lamp.glb"]["file-size"]["value"], 20_000.0);
    assert_eq!(document["all scenes"]["triangles"]["value"], 18_000.0);
    assert_eq!(document["lamp.glb"]["worst-d-rms"]["value"], 6.0);
    let list = with(&record(), &[], benchmark);
    let names: Vec<&str> = list.as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"lamp.glb: file size") && names.contains(&"all scenes: triangles"), "{names:?}");
}

#[test]
fn the_page_needs_nothing_beside_it() {
    let mut findings = some();
    findings[0].message = "<script>alert(1)</script>".to_owned();
    let asset = html::Asset {
        scene: "lamp.glb".to_owned(),
        sheet: Some(html::Sheet { jpeg: vec![1, 2, 3], size: [100, 50], levels: 2 }),
        model: Some(vec![4, 5]),
        note: None,
    };
    let history = [("v1".to_owned(), record())];
    let extras = html::Extras { history: &history, assets: &[asset], viewer: Some("'</script>'") };
    let page = with(&record(), &findings, |p| html::html(p, &extras));
    assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert"));
    for outside in ["http://", "https://", "src=\"/", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    for part in ["summary", "findings", "changes", "history", "plots", "levels", "assets"] {
        assert!(page.contains(&format!("<section id=\"{part}\"")), "{part}");
    }
    // A row for the source and each level of each mesh.
    assert_eq!(page.matches("<tr data-state=").count(), 3 * (3 + 1));
    assert_eq!(page.matches("<script").count(), page.matches("</script>").count());
}
