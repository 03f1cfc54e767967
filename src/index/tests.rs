//! Every reason to bake again, and every reason not to trust, by example.

use std::fs;
use std::time::{Duration, SystemTime};

use super::*;
use crate::config::Pipeline;
use crate::scan::scan;

/// A project with one scene `in/a.gltf` that refers to `a.bin`, and its output `out/a.glb`.
struct Project {
    folder: tempfile::TempDir,
    pipeline: Pipeline,
    settings: SettingsKey,
}

impl Project {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Self::pipeline(folder.path(), "");
        let project = Self { settings: SettingsKey::of(pipeline.settings()), folder, pipeline };
        for (file, content) in [("in/a.gltf", "scene"), ("in/a.bin", "buffer"), ("out/a.glb", "output")] {
            project.write(file, content);
        }
        project.let_the_clock_tick();
        project
    }

    fn pipeline(folder: &Path, rest: &str) -> Pipeline {
        let text = format!("input = 'in'\noutput = 'out'\n{rest}");
        Pipeline::parse(&text, &folder.join("pipeline.toml").display().to_string()).unwrap()
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    fn write(&self, file: &str, content: &str) {
        fs::create_dir_all(self.path(file).parent().unwrap()).unwrap();
        fs::write(self.path(file), content).unwrap();
    }

    /// Until a file made now has a later time stamp than all before it.
    fn let_the_clock_tick(&self) {
        let now = || store::file_system_time(&self.path("clock/x"));
        let before = now();
        while now() == before {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn open(&self) -> Index {
        let (index, warning) = Index::open(&self.pipeline.cache.path, &self.pipeline);
        assert!(warning.is_none(), "{warning:?}");
        index
    }

    fn scene(&self) -> SceneFile {
        scan(&self.pipeline).unwrap().files.remove(0)
    }

    /// What a bake of the files, as they are now, records.
    fn bake(&self, index: &mut Index) {
        let scene = self.scene();
        let seen = |file: &str| Seen::read(&self.path(file)).ok();
        let bake = Bake {
            scene: Seen { stat: scene.stat, content: seen("in/a.gltf").unwrap().content },
            dependencies: ["b.png", "a.bin"]
                .map(|name| Dependency { relative: name.to_owned(), seen: seen(&format!("in/{name}")) })
                .to_vec(),
            meshes: vec![MeshHash([3; 32])],
            outputs: vec![Output { relative: "a.glb".to_owned(), seen: seen("out/a.glb").unwrap() }],
            facts: b"facts".to_vec(),
        };
        index.record("a.gltf", &self.settings, bake);
    }

    /// A bake and the end of its run, and the index as the next run finds it.
    fn baked(&self) -> Index {
        let mut index = self.open();
        assert!(matches!(index.status(&self.scene(), &self.settings), Status::New));
        self.bake(&mut index);
        index.save().unwrap();
        self.let_the_clock_tick();
        self.open()
    }

    /// In words, with a recheck where it is needed.
    fn told(&self, index: &mut Index) -> String {
        let scene = self.scene();
        let join = |reasons: &[Reason]| reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let checked = match index.status(&scene, &self.settings) {
            Status::Unchanged(_) => return "unchanged".to_owned(),
            Status::New => return "new".to_owned(),
            Status::Changed(reasons) => return join(&reasons),
            Status::Touched(entry) => index.recheck(&scene, entry),
        };
        let told = format!("touched ({} bytes): {}", checked.read_bytes, join(&checked.reasons));
        if checked.reasons.is_empty() {
            index.refresh("a.gltf", checked.entry);
        }
        told
    }
}

#[test]
fn unchanged_reads_and_writes_nothing() {
    let project = Project::new();
    let mut index = project.baked();
    assert_eq!(project.told(&mut index), "unchanged");
    assert_eq!(index.facts("a.gltf").unwrap(), b"facts");
    assert_eq!(index.facts("b.gltf"), None);
    assert_eq!(index.entry("a.gltf").unwrap().meshes, [MeshHash([3; 32])]);
    assert_eq!(index.fields(index.entry("a.gltf").unwrap()), project.settings.fields());
    let stamp = FileStat::of(&index.file).unwrap();
    index.save().unwrap();
    assert_eq!(FileStat::of(&index.file).unwrap(), stamp);
    assert!(index.started_ns.get().is_none(), "no file was made to ask for the time");
}

#[test]
fn touch_is_hashed_once() {
    let project = Project::new();
    let mut index = project.baked();
    for file in ["in/a.gltf", "in/a.bin", "out/a.glb"] {
        let later = SystemTime::now() + Duration::from_secs(100);
        fs::File::options().append(true).open(project.path(file)).unwrap().set_modified(later).unwrap();
    }
    project.let_the_clock_tick();
    assert_eq!(project.told(&mut index), "touched (17 bytes): ");
    assert_eq!(project.told(&mut index), "unchanged");
    index.save().unwrap();
    assert_eq!(project.told(&mut project.open()), "unchanged");
}

#[test]
fn changes_are_named() {
    let project = Project::new();
    let check = |change: &dyn Fn(), expected: &str| {
        let mut index = project.baked();
        change();
        project.let_the_clock_tick();
        assert_eq!(project.told(&mut index), expected);
        fs::remove_dir_all(project.path(".lodbake")).unwrap();
    };
    check(&|| project.write("in/a.gltf", "scene2"), "the scene file has changed");
    check(&|| project.write("in/a.gltf", "scene3"), "touched (6 bytes): the scene file has changed");
    check(&|| project.write("in/a.bin", "bubber"), "touched (6 bytes): `a.bin` has changed");
    check(&|| project.write("in/a.bin", ""), "`a.bin` has changed");
    check(&|| fs::remove_file(project.path("in/a.bin")).unwrap(), "`a.bin` is gone");
    check(&|| project.write("in/b.png", "x"), "`b.png` was missing and is there now");
    check(&|| project.write("out/a.glb", "OUTPUT"), "touched (6 bytes): output `a.glb` is not as it was written");
    check(&|| project.write("out/a.glb", "longer output"), "output `a.glb` is not as it was written");
    check(&|| fs::remove_dir_all(project.path("out")).unwrap(), "output `a.glb` is missing");
}

#[test]
fn settings_are_named() {
    let mut project = Project::new();
    let mut index = project.baked();
    let changed = Project::pipeline(project.folder.path(), "simplify.normal = 0.5\nprofile = 'core'\nexclude = ['x']");
    project.settings = SettingsKey::of(changed.settings());
    assert_eq!(project.told(&mut index), "simplify.normal: 0.003 -> 0.5, profile: web -> core");
}

/// A file that is changed after it was read, in the same tick of the clock and to the same length, has the facts that
/// were recorded.
#[test]
fn files_as_young_as_their_reading_are_not_trusted() {
    let project = Project::new();
    let mut index = project.open();
    assert!(matches!(index.status(&project.scene(), &project.settings), Status::New));
    project.write("in/a.gltf", "racy1");
    project.bake(&mut index);
    project.write("in/a.gltf", "racy2");
    let racy = FileStat::of(&project.path("in/a.gltf")).unwrap();
    index.entries.get_mut("a.gltf").unwrap().scene.stat = racy;
    index.save().unwrap();
    let mut index = project.open();
    assert_eq!(project.told(&mut index), "touched (5 bytes): the scene file has changed");

    let mut index = project.open();
    project.bake(&mut index);
    index.save().unwrap();
    project.let_the_clock_tick();
    let mut index = project.open();
    assert_eq!(project.told(&mut index), "touched (11 bytes): ", "the time of reading was not noted");
    assert_eq!(project.told(&mut index), "unchanged", "hashed once");
}

/// The entry of a scene that one run does not look at keeps the time of its own reading.
#[test]
fn another_run_does_not_make_a_young_entry_trusted() {
    let project = Project::new();
    let mut index = project.open();
    assert!(matches!(index.status(&project.scene(), &project.settings), Status::New));
    project.write("in/a.gltf", "young");
    project.bake(&mut index);
    index.save().unwrap();
    project.let_the_clock_tick();
    let mut other = project.open();
    let elsewhere = SceneFile { relative: "b.gltf".to_owned(), ..project.scene() };
    assert!(matches!(other.status(&elsewhere, &project.settings), Status::New));
    other.is_changed = true;
    other.save().unwrap();
    assert_eq!(project.told(&mut project.open()), "touched (5 bytes): ");
}

#[test]
fn damaged_and_foreign_files_count_as_empty() {
    let project = Project::new();
    let file = project.baked().file;
    let good = fs::read(&file).unwrap();
    let check = |bytes: &[u8], expected: &str| {
        fs::write(&file, bytes).unwrap();
        let (index, warning) = Index::open(&project.pipeline.cache.path, &project.pipeline);
        assert_eq!(index.entries().count(), 0);
        assert_eq!(warning.unwrap().cause, expected);
    };
    check(&good[..20], "it is cut off");
    check(&good[..good.len() - 1], "its length is wrong");
    check(&b"lodbake index 2\n".repeat(9), "it is not an index of this version");
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    check(&flipped(20), "it is damaged");
    check(&flipped(50), "its length is wrong");
    check(&flipped(100), "it is damaged");
    // A good hash over records that are none.
    check(
        &store::header(&[255; 3], 0).into_iter().chain([255; 3]).collect::<Vec<_>>(),
        "Hit the end of buffer, expected more data",
    );
    fs::write(&file, flipped(good.len() - 1)).unwrap();
    let mut index = project.open();
    assert_eq!(index.facts("a.gltf"), None, "damaged facts are not handed out");
    index.is_changed = true;
    index.save().unwrap();
    assert_eq!(project.told(&mut project.open()), "new", "nor kept");
    fs::write(&file, &good).unwrap();
    assert_eq!(project.told(&mut project.open()), "unchanged");
}

#[test]
fn facts_outlive_a_run_that_bakes_another_scene() {
    let project = Project::new();
    let mut index = project.baked();
    let bake = Bake {
        scene: Seen::read(&project.path("in/a.gltf")).unwrap(),
        dependencies: Vec::new(),
        meshes: Vec::new(),
        outputs: Vec::new(),
        facts: b"other facts".to_vec(),
    };
    index.record("0.gltf", &project.settings, bake);
    for _ in 0..2 {
        assert_eq!(index.facts("0.gltf").unwrap(), b"other facts");
        assert_eq!(index.facts("a.gltf").unwrap(), b"facts");
        index.save().unwrap();
    }
    assert_eq!(project.open().facts("0.gltf").unwrap(), b"other facts");
    assert_eq!(project.open().facts("a.gltf").unwrap(), b"facts");
    assert_eq!(fs::read_dir(index.file.parent().unwrap()).unwrap().count(), 1, "no temporary file is left");
}

#[test]
fn vanished_and_failed_scenes_are_forgotten() {
    let project = Project::new();
    let mut index = project.baked();
    assert!(index.take_vanished(["a.gltf", "b.gltf"]).is_empty());
    let vanished = index.take_vanished(["b.gltf"]);
    assert_eq!(vanished[0].0, "a.gltf");
    assert_eq!(vanished[0].1.outputs[0].relative, "a.glb");
    index.save().unwrap();
    assert_eq!(project.told(&mut project.open()), "new");
    let mut index = project.baked();
    index.forget("a.gltf");
    assert_eq!(project.told(&mut index), "new");
    // But not its outputs, which are still there.
    index.save().unwrap();
    let mut index = project.open();
    assert_eq!(project.told(&mut index), "new");
    assert_eq!(index.take_vanished([])[0].1.outputs[0].relative, "a.glb");
}

#[test]
fn outputs_that_a_scene_has_no_more_are_told_once() {
    let project = Project::new();
    let mut index = project.baked();
    project.bake(&mut index);
    assert_eq!(index.take_superseded(), []);
    project.write("out/b.glb", "another output");
    let before = index.entry("a.gltf").unwrap().clone();
    let outputs = vec![Output { relative: "b.glb".to_owned(), seen: Seen::read(&project.path("out/b.glb")).unwrap() }];
    let (scene, dependencies) = (before.scene.clone(), before.dependencies.clone());
    let bake = Bake { scene, dependencies, meshes: Vec::new(), outputs, facts: Vec::new() };
    index.record("a.gltf", &project.settings, bake);
    assert_eq!(index.take_superseded(), before.outputs);
    assert_eq!(index.take_superseded(), []);
}

#[test]
fn each_pipeline_has_its_own_index_and_a_moved_project_keeps_it() {
    let project = Project::new();
    let file = |folder: &Path, pipeline: &str, output: &str, cache: &str| {
        let text = format!("input = 'in'\noutput = '{output}'");
        let pipeline = Pipeline::parse(&text, &folder.join(pipeline).display().to_string()).unwrap();
        Index::open(&folder.join(cache), &pipeline).0.file.file_name().unwrap().to_owned()
    };
    let here = project.folder.path();
    let first = file(here, "pipeline.toml", "out", ".lodbake");
    assert_ne!(first, file(here, "pipeline.toml", "other", ".lodbake"));
    assert_ne!(first, file(here, "other.toml", "out", ".lodbake"));
    let moved = tempfile::tempdir().unwrap();
    assert_eq!(first, file(moved.path(), "pipeline.toml", "out", ".lodbake"));
    let shared = |folder: &Path| {
        let pipeline = Project::pipeline(folder, "");
        Index::open(Path::new("shared-cache"), &pipeline).0.file
    };
    assert_ne!(shared(here), shared(moved.path()), "two projects in one cache");
}

#[test]
fn read_only_cache_is_an_error_of_saving_only() {
    let project = Project::new();
    project.write(".lodbake", "a file where the folder should be");
    let (mut index, warning) = Index::open(&project.pipeline.cache.path, &project.pipeline);
    assert!(warning.is_some());
    assert!(matches!(index.status(&project.scene(), &project.settings), Status::New));
    project.bake(&mut index);
    let error = index.save().unwrap_err().to_string();
    assert!(error.starts_with("failed to write the index `"), "{error}");
}
