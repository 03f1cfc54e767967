//! A study with lodbake's own algorithms and competitors that are shell scripts.

use std::collections::BTreeMap;

use crate::scene::{Scene, Shape};
use crate::space::{Run, Space};

/// A sphere, a grid, and competitors: one copies its input, one fails, one writes nothing, one is slow, one writes junk.
fn space(extra: &str) -> Space {
    let space = Space::new();
    space.write("meshes/sphere.glb", Scene::of(&Shape::sphere(16, 24)).glb());
    space.write("meshes/grid.glb", Scene::of(&Shape::grid(20, 0.2)).glb());
    space.write(
        "study.toml",
        format!(
            "meshes = \"meshes/*.glb\"\noutput = \"out\"\nratios = [0.5, 0.25]\nappearance = [5]\nrepetitions = 3\nsize = 64\n\
             [[algorithm]]\nname = \"its\"\nsimplify = {{}}\n\
             [[algorithm]]\nname = \"qem\"\nsimplify = {{ metric = \"qem\", effort = \"fast\" }}\n\
             [[algorithm]]\nname = \"copy\"\ncommand = \"cp {{in}} {{out}}\"\n{extra}"
        ),
    );
    space
}

/// The rows of the CSV: by mesh, algorithm, target and measure, the mean and the error.
fn rows(space: &Space) -> BTreeMap<[String; 4], (String, String)> {
    let bytes = space.read("out/study.csv");
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let header = reader.headers().expect("it has a header").clone();
    let at = |name: &str| header.iter().position(|column| column == name).expect("the column exists");
    let (keys, mean, error) = (["mesh", "algorithm", "target", "measure"].map(at), at("mean"), at("error"));
    let rows = reader.records().map(|row| row.expect("it is well-formed"));
    rows.map(|row| (keys.map(|i| row[i].to_owned()), (row[mean].to_owned(), row[error].to_owned()))).collect()
}

fn mean(rows: &BTreeMap<[String; 4], (String, String)>, key: [&str; 4]) -> f64 {
    let row = rows.get(&key.map(str::to_owned)).unwrap_or_else(|| panic!("no row {key:?} in {:#?}", rows.keys()));
    row.0.parse().unwrap_or_else(|error| panic!("{key:?}: {row:?}: {error}"))
}

#[cfg(unix)]
#[test]
fn a_study_is_run_and_written() {
    let space = space("[[algorithm]]\nname = \"its as copy\"\nsimplify = {}\nmatched = \"qem\"\n");
    let run: Run = space.run_fine(&["study"]);
    assert!(run.stdout.contains("| qem | its | "), "{}", run.stdout);
    assert!(run.stderr.contains("grid (1 of 2)") && run.stderr.contains("study.html"), "{}", run.stderr);
    let rows = rows(&space);
    for mesh in ["sphere", "grid"] {
        for target in ["0.5", "0.25"] {
            let of = |algorithm, measure| mean(&rows, [mesh, algorithm, target, measure]);
            assert!(of("its", "triangles") <= of("its", "triangles_asked"), "{mesh} {target}");
            assert!(0.0 < of("its", "d_rms") && 0.0 < of("its", "distance_rms"));
            // A copy looks like its source, to the last bit.
            assert_eq!((of("copy", "d_rms"), of("copy", "ssim")), (0.0, 1.0));
            assert_eq!(of("its as copy", "triangles_asked"), of("qem", "triangles"));
            assert!(0.0 < of("its", "wall") && 0.0 < of("copy", "wall") && 0.0 < of("copy", "peak_resident"));
            // The heap is a part of what is resident.
            assert!(50_000.0 < of("its", "peak_heap") && of("its", "peak_heap") < of("its", "peak_resident"));
            assert!(0.0 < of("its", "frames_per_second"));
        }
        assert!(mean(&rows, [mesh, "its", "0.25", "d_rms"]) > mean(&rows, [mesh, "its", "0.5", "d_rms"]));
    }
    let page = String::from_utf8(space.read("out/study.html")).expect("it is UTF-8");
    assert!(page.contains("<svg") && !page.contains("<script") && !page.contains("http"), "it stands alone");
    let levels = space.files("out/levels");
    assert_eq!(levels.len(), 2 * 2 * 4);
    assert!(levels.contains_key("sphere/0.25/its.glb"), "{:?}", levels.keys());
}

/// Nothing but the work holds heap while a run is measured, and the work is the same each time.
#[test]
fn the_peak_of_the_heap_is_the_same_each_time() {
    let space = space("");
    let of = |space: &Space| {
        space.run(&["study"]);
        let rows = rows(space);
        (mean(&rows, ["sphere", "its", "0.5", "peak_heap"]), mean(&rows, ["sphere", "qem", "0.5", "peak_heap"]))
    };
    assert_eq!(of(&space), of(&space));
}

#[cfg(unix)]
#[test]
fn a_failing_competitor_is_a_row() {
    let space = space(
        "[[algorithm]]\nname = \"fails\"\ncommand = [\"sh\", \"-c\", \"echo no luck; exit 3\", \"{in}\", \"{out}\"]\n\
         [[algorithm]]\nname = \"idle\"\ncommand = \"true {in} {out}\"\n\
         [[algorithm]]\nname = \"slow\"\ncommand = [\"sh\", \"-c\", \"exec sleep 600\", \"{in}\", \"{out}\"]\ntimeout = 0.2\n\
         [[algorithm]]\nname = \"text\"\ncommand = [\"sh\", \"-c\", \"cp study.toml $1\", \"{in}\", \"{out}\"]\n\
         [[algorithm]]\nname = \"absent\"\ncommand = \"no-such-program {in} {out}\"\n\
         [[algorithm]]\nname = \"as absent\"\nsimplify = {}\nmatched = \"absent\"\n",
    );
    let run = space.run(&["study", "--json"]);
    assert_eq!(run.code, 3, "{run:#?}");
    let record = run.document();
    let schema = space.run_fine(&["schema", "study-record"]).document();
    let validator = jsonschema::validator_for(&schema).expect("it is a schema");
    let wrong: Vec<String> = validator.iter_errors(&record).map(|error| error.to_string()).collect();
    assert_eq!(wrong, Vec::<String>::new());
    let algorithms = record["algorithms"].as_array().expect("it is a list");
    let errors: BTreeMap<&str, &str> = record["cells"]
        .as_array()
        .expect("it is a list")
        .iter()
        .filter_map(|cell| {
            let algorithm = cell["algorithm"].as_u64().expect("it is an index") as usize;
            Some((algorithms[algorithm]["name"].as_str()?, cell["error"].as_str()?))
        })
        .collect();
    let told = |name: &str| *errors.get(name).unwrap_or_else(|| panic!("{name} did not fail: {errors:#?}"));
    assert_eq!(told("fails"), "exit code 3: no luck");
    assert_eq!(told("idle"), "it wrote no `{out}`");
    assert_eq!(told("slow"), "took longer than 0.2 s");
    assert!(told("text").starts_with("its level cannot be judged: "), "{}", told("text"));
    assert!(told("absent").contains("no-such-program"), "{}", told("absent"));
    assert_eq!(told("as absent"), "the algorithm that it is matched to made no level");
    assert!(!errors.contains_key("its") && !errors.contains_key("copy"), "{errors:#?}");
    // What did not fail is measured all the same.
    assert_eq!(mean(&rows(&space), ["grid", "copy", "0.5", "d_rms"]), 0.0);
    let text = String::from_utf8(space.read("out/study.md")).expect("it is UTF-8");
    assert!(text.contains("## Failures") && text.contains("exit code 3: no luck"), "{text}");
}

#[test]
fn mistakes_stop_a_study_before_it_begins() {
    let space = Space::new();
    let run = space.run(&["study"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.starts_with("error: there is no study `study.toml`\nhint: "), "{}", run.stderr);
    space.write("study.toml", "meshes = \"a.glb\"\noutput = \"o\"\nratios = [0.5]\n");
    let run = space.run(&["study"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.starts_with("error: missing key `algorithm` in `study.toml` line 1"), "{}", run.stderr);
    assert!(!space.path("o").exists());
}
