//! What a `study.toml` may say, what is said about one that is wrong, and how results are told.

use std::path::Path;
use std::time::Duration;

use super::record::{AlgorithmFacts, Cell, DistanceFacts, LevelFacts, MeshFacts, Record, RunFacts};
use super::statistics::Summary;
use super::{Kind, Study, Target};
use crate::config::{Effort, Metric};

/// A folder with two meshes of the same name.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "studies/out/levels/old.glb",
        "meshes/duck/model.glb",
        "meshes/fox/model.gltf",
        "meshes/fox/notes.txt",
        "one.glb",
    ] {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
    folder
}

/// Parses a study that stands in `studies/` of the folder.
fn parse(folder: &Path, text: &str) -> Result<Study, String> {
    let file = folder.join("studies/study.toml").display().to_string();
    Study::parse(text, &file).map_err(|error| {
        let text = error.to_string().replace(&file, "study.toml");
        error.hint().map_or(text.clone(), |hint| format!("{text} / {hint}"))
    })
}

const HEAD: &str = "meshes = \"../one.glb\"\noutput = \"out\"\nratios = [0.5]\n";
const OWN: &str = "[[algorithm]]\nname = \"its\"\nsimplify = {}\n";

#[test]
fn everything_is_settled() {
    let folder = folder();
    let text = r#"
meshes = ["../one.glb", "../meshes/**/*.gl{b,tf}", "../one.glb"]
output = "out"
ratios = [0.5, 0.25]
triangles = [100]
repetitions = 3
timeout = 9
baseline = "peer"
[[algorithm]]
name = "fast"
simplify = { metric = "qem", effort = "fast", normal = 0.5, min_triangles = 10 }
matched = "peer"
[[algorithm]]
name = "peer"
command = "tool -i {in} -o {out} -r {ratio}"
repetitions = 1
timeout = 0.5
"#;
    let study = parse(folder.path(), text).unwrap();
    let names: Vec<&str> = study.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["one", "duck/model", "fox/model"]);
    assert!(study.meshes.iter().all(|mesh| mesh.path.is_file()));
    assert_eq!(study.targets, [Target::Ratio(0.5), Target::Ratio(0.25), Target::Triangles(100)]);
    assert_eq!((study.baseline, study.output.ends_with("studies/out")), (1, true));
    let [fast, peer] = study.algorithms.as_slice() else { panic!("{:?}", study.algorithms) };
    assert_eq!((fast.matched, fast.repetitions, fast.timeout), (Some(1), 3, Duration::from_secs(9)));
    assert_eq!((peer.matched, peer.repetitions, peer.timeout), (None, 1, Duration::from_millis(500)));
    let Kind::Own(settings) = &fast.kind else { panic!("{:?}", fast.kind) };
    assert_eq!((settings.simplify.metric, settings.simplify.effort), (Metric::Qem, Effort::Fast));
    assert_eq!((settings.simplify.weights.normal, settings.min_triangles), (0.5, 10));
    assert!(matches!(&peer.kind, Kind::Command(template) if template.program() == Some("tool")));
}

#[test]
fn defaults_are_those_of_a_pipeline() {
    let folder = folder();
    let study = parse(folder.path(), &format!("{HEAD}{OWN}")).unwrap();
    let Kind::Own(settings) = &study.algorithms[0].kind else { panic!("it has no command") };
    let pipeline = crate::config::Pipeline::parse("input = \"a\"\noutput = \"b\"\n", "pipeline.toml").unwrap();
    assert_eq!(**settings, pipeline.settings());
    assert_eq!((study.algorithms[0].repetitions, study.baseline), (20, 0));
}

#[test]
fn mistakes_are_told_with_their_line() {
    let folder = folder();
    let cases = [
        (
            "meshes = \"../one.glb\"\noutput = \"o\"\n[[algorithm]]\nname = \"a\"\nsimplify = {}\n",
            "`study.toml` line 1: ratios is missing, and so is `triangles`: give one",
        ),
        (
            "meshes = \"../two.glb\"\noutput = \"o\"\nratios = [0.5]\n[[algorithm]]\nname = \"a\"\nsimplify = {}\n",
            "`study.toml` line 1: meshes `../two.glb` is not there (paths are relative to the study's file)",
        ),
        (
            "output = \"o\"\nmeshes = [\"../*.obj\"]\nratios = [0.5]\n[[algorithm]]\nname = \"a\"\nsimplify = {}\n",
            "`study.toml` line 2: meshes[0] `../*.obj` matches no file (paths are relative to the study's file)",
        ),
        (
            "meshes = \"../one.glb\"\noutput = \"o\"\nratio = [0.5]\n",
            "unknown key `ratio` in `study.toml` line 3 (did you mean `ratios`? known: `meshes`, `output`, `ratios`, `triangles`, `appearance`, `repetitions`, `timeout`, `size`, `renderer`, `baseline`, `algorithm`)",
        ),
        (
            &format!("{HEAD}repetitions = 0\n{OWN}"),
            "`study.toml` line 4: repetitions 0 is out of range: must be between 1 and 10000, both inclusive",
        ),
        (
            &format!("{HEAD}{OWN}repetitions = 2\ntimeout = 0\n"),
            "`study.toml` line 8: algorithm[0].timeout 0 is out of range: must be more than 0",
        ),
        (
            &format!("{HEAD}[[algorithm]]\nname = \"a\"\n"),
            "`study.toml` line 4: algorithm[0] must have exactly one of `simplify` and `command`",
        ),
        (&format!("{HEAD}{OWN}{OWN}"), "`study.toml` line 8: algorithm[1].name `its` is taken"),
        (
            &format!("{HEAD}[[algorithm]]\nname = \"a\"\nsimplify = {{ placement = \"subse\" }}\n"),
            "unknown algorithm[0].simplify.placement `subse` in `study.toml` line 6 (did you mean `subset`? known: `auto`, `optimal`, `subset`)",
        ),
        (
            &format!("{HEAD}[[algorithm]]\nname = \"a\"\ncommand = \"x {{in}} {{output}}\"\n"),
            "`study.toml` line 6: algorithm[0].command has `{output}`, which stands for nothing (did you mean `out`? known: `in`, `out`, `ratio`, `triangles`)",
        ),
        (
            &format!("{HEAD}[[algorithm]]\nname = \"a\"\ncommand = [\"x\", \"{{in}}\"]\n"),
            "`study.toml` line 6: algorithm[0].command has no `{out}`: a command must read `{in}` and write `{out}`",
        ),
        (
            &format!("{HEAD}[[algorithm]]\nname = \"a\"\ncommand = \"\"\n"),
            "`study.toml` line 6: algorithm[0].command is empty",
        ),
        (
            &format!("{HEAD}baseline = \"it\"\n{OWN}"),
            "`study.toml` line 4: baseline is `it`, which is no algorithm of this study (did you mean `its`? known: `its`)",
        ),
        (
            &format!("{HEAD}{OWN}matched = \"its\"\n"),
            "`study.toml` line 7: algorithm[0].matched is the algorithm itself",
        ),
        (
            &format!("{HEAD}{OWN}matched = \"b\"\n[[algorithm]]\nname = \"b\"\nsimplify = {{}}\nmatched = \"its\"\n"),
            "`study.toml` line 7: algorithm[0].matched is `b`, which is itself matched to `its`: name `its`",
        ),
    ];
    for (text, told) in cases {
        assert_eq!(parse(folder.path(), text).unwrap_err(), told, "{text}");
    }
    let ratios = |list: &str| format!("meshes = \"../one.glb\"\noutput = \"o\"\nratios = {list}\n{OWN}");
    for (list, told) in [
        ("[0.5, 1.5]", "`study.toml` line 3: ratios[1] 1.5 is out of range: must be between 0 and 1, both inclusive"),
        ("[1]", "`study.toml` line 3: ratios[0] is 1: must be between 0 and 1, exclusive"),
        ("[0.5, 0.5]", "`study.toml` line 3: ratios[1] repeats 0.5"),
        ("0.5", "`study.toml` line 3: ratios must be a list, not a number with a point"),
    ] {
        assert_eq!(parse(folder.path(), &ratios(list)).unwrap_err(), told, "{list}");
    }
}

#[test]
fn levels_of_an_earlier_study_are_no_sources() {
    let folder = folder();
    let study = |output: &str| {
        let head = format!("meshes = \"**/*.glb\"\noutput = \"{output}\"\nratios = [0.5]\n");
        parse(folder.path(), &format!("{head}{OWN}"))
    };
    assert_eq!(study("elsewhere").unwrap().meshes.len(), 1);
    assert!(study("./out").unwrap_err().contains("matches no file"));
}

#[test]
fn targets_are_counts_of_triangles() {
    assert_eq!(Target::Ratio(0.25).triangles(1001), 250);
    assert_eq!(Target::Ratio(0.001).triangles(10), 1);
    assert_eq!(Target::Triangles(7).triangles(1001), 7);
    assert_eq!(
        (Target::Ratio(0.1).to_string(), Target::Triangles(5).to_string()),
        ("0.1".into(), "5 triangles".into())
    );
}

/// Two meshes, three algorithms, two targets; one cell failed. Numbers are made up.
fn record() -> Record {
    let algorithm = |name: &str, what: &str, is_own: bool, matched: Option<&str>| AlgorithmFacts {
        name: name.to_owned(),
        what: what.to_owned(),
        is_own,
        matched: matched.map(str::to_owned),
    };
    let frame = Summary::of(&[0.010, 0.012, 0.011]);
    let mesh = |name: &str, triangles: u64| MeshFacts {
        name: name.to_owned(),
        triangles,
        vertices: triangles / 2,
        frame_seconds: frame,
        error: None,
    };
    let mut record = Record {
        study: "studies/<a>.toml".to_owned(),
        version: "1.2.3".to_owned(),
        machine: "a machine, 2 processors".to_owned(),
        meshes: vec![mesh("duck", 4000), mesh("fox|1", 1_234_567)],
        algorithms: vec![
            algorithm("its", "lodbake: metric its, effort balanced", true, None),
            algorithm("peer", "peer -i {in} -o {out} -r {ratio}", false, None),
            algorithm("its as peer", "lodbake: metric its, effort balanced", true, Some("peer")),
        ],
        targets: vec!["0.5".to_owned(), "100 triangles".to_owned()],
        appearance: vec![2.0, 50.0],
        renderer: "cpu".into(),
        size: 512,
        baseline: 0,
        cells: Vec::new(),
    };
    for mesh in 0..2 {
        for target in 0..2 {
            for algorithm in 0..3 {
                record.cells.push(cell(&record, mesh, target, algorithm));
            }
        }
    }
    let failed = &mut record.cells[4];
    (failed.level, failed.runs, failed.error) = (None, Vec::new(), Some("exit code 3: a|b <c>".to_owned()));
    record
}

fn cell(record: &Record, mesh: usize, target: usize, algorithm: usize) -> Cell {
    let asked = [record.meshes[mesh].triangles / 2, 100][target];
    let is_own = record.algorithms[algorithm].is_own;
    let d_rms = [1.0, 1.5, 1.25][algorithm] * [1.0, 4.0][target] * [1.0, 2.0][mesh];
    let level = LevelFacts {
        triangles: asked + [0, 10, 10][algorithm],
        vertices: asked / 2 + 1,
        d_rms,
        worst_view: d_rms * 2.0,
        silhouette: 0.01,
        ssim: 0.99,
        distance: (mesh == 0).then_some(DistanceFacts { mean: 0.001, rms: 0.002, max: 0.01 }),
        frame_seconds: Summary::of(&[0.008, 0.009]),
    };
    let run = |round: u32| RunFacts {
        wall_seconds: [0.010, 0.250, 0.020][algorithm] + f64::from(round * round) * 0.001,
        cpu_seconds: Some([0.009, 0.300, 0.019][algorithm]),
        resident_bytes: (!is_own).then_some(90_000_000 + u64::from(round)),
        heap_bytes: is_own.then_some(3_456_789),
    };
    Cell {
        mesh,
        target,
        algorithm,
        asked,
        level: Some(level),
        runs: (0..3).map(run).collect(),
        resident_bytes: is_own.then_some(12_345_678),
        error: None,
    }
}

#[test]
fn the_markdown_is_as_it_was() {
    insta::assert_snapshot!(super::markdown::markdown(&record()));
}

#[test]
fn the_csv_holds_every_measure_and_error() {
    let text = super::csv_file::csv(&record());
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let find = |mesh: &str, algorithm: &str, target: &str, measure: &str| {
        rows.iter().find(|row| row[0] == *mesh && row[1] == *algorithm && row[3] == *target && row[4] == *measure)
    };
    let wall = find("fox|1", "peer", "100 triangles", "wall").unwrap();
    let spread = Summary::of(&[0.250, 0.251, 0.254]).unwrap().spread.unwrap();
    assert_eq!((&wall[5], &wall[6], &wall[11]), ("s", "3", "0.25 0.251 0.254"));
    assert_eq!((wall[9].parse(), wall[10].parse()), (Ok(spread.low), Ok(spread.high)));
    assert_eq!(&find("duck", "its as peer", "0.5", "d_rms").unwrap()[7], "1.25");
    assert_eq!(&find("duck", "its as peer", "0.5", "d_rms").unwrap()[2], "peer");
    assert!(
        find("fox|1", "its", "0.5", "distance_rms").is_none() && find("duck", "its", "0.5", "distance_rms").is_some()
    );
    assert_eq!(&find("duck", "peer", "100 triangles", "error").unwrap()[12], "exit code 3: a|b <c>");
    assert!(find("duck", "peer", "100 triangles", "wall").is_none());
    let per_cell = |measure: &str| rows.iter().filter(|row| row[4] == *measure).count();
    assert_eq!((per_cell("peak_heap"), per_cell("peak_resident"), per_cell("d_rms")), (8, 11, 11));
}

#[test]
fn the_page_stands_alone() {
    let page = super::html::page(&record());
    assert!(page.contains("Study studies/&lt;a&gt;.toml") && page.contains("exit code 3: a|b &lt;c&gt;"));
    assert!(!page.contains("<script") && !page.contains("http:") && !page.contains("https:") && !page.contains("NaN"));
    // Looks, distance, time and memory: a plot for each mesh that has figures; and looks against time.
    assert_eq!(page.matches("<figure>").count(), 2 + 1 + 2 + 2 + 1);
    assert_eq!(page.matches("<svg viewBox=\"0 0").count(), 8);
    let count = |tag: &str| (page.matches(&format!("<{tag}>")).count(), page.matches(&format!("</{tag}>")).count());
    for tag in ["tr", "tbody", "table", "h2", "figure", "main", "body", "g"] {
        let (opened, closed) = count(tag);
        assert!(opened <= closed, "{tag}: {opened} opened, {closed} closed");
    }
}

#[test]
fn a_study_that_found_nothing_can_be_told() {
    let mut record = record();
    for cell in &mut record.cells {
        (cell.level, cell.runs, cell.resident_bytes) = (None, Vec::new(), None);
        cell.error = Some("no".to_owned());
    }
    record.meshes[1].error = Some("not there".to_owned());
    let text = super::markdown::markdown(&record);
    assert!(text.contains("not there") && !text.contains("## Comparison"), "{text}");
    assert!(!super::html::page(&record).contains("<figure>"));
    assert_eq!(record.summary(), "");
}
