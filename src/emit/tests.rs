//! Writing on real disks: atomicity, equality, links, and everything that can be in the way.

use super::*;
use std::fs;
use std::time::{Duration, SystemTime};

struct Space {
    folder: tempfile::TempDir,
    output: OutputFolder,
}

impl Space {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let output = OutputFolder::new(&folder.path().join("w/out"));
        fs::create_dir_all(folder.path().join("w/in")).unwrap();
        Self { folder, output }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join("w").join(name)
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    fn dependency(&self, uri: &str) -> Dependency {
        Dependency { uri: uri.into(), path: self.path("in").join(uri), kind: DependencyKind::Image }
    }

    fn emit(&self, source: &str, target: &str, content: &Content) -> Result<Emitted, EmitError> {
        let (source, target) = (self.path(source), self.path(target));
        self.output.emit(&Emission { source: &source, target: &target, content })
    }

    /// Names of all files below `out`, temporary ones included.
    fn files(&self) -> Vec<String> {
        let mut names = Vec::new();
        let mut open = vec![self.path("out")];
        while let Some(folder) = open.pop() {
            for entry in fs::read_dir(folder).into_iter().flatten() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    names.push(path.strip_prefix(self.path("out")).unwrap().to_str().unwrap().to_owned());
                }
            }
        }
        names.sort();
        names
    }

    fn age(&self, name: &str) -> SystemTime {
        let old = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
        let file = fs::File::options().write(true).open(self.path(name)).unwrap();
        file.set_modified(old).unwrap();
        old
    }

    fn modified(&self, name: &str) -> SystemTime {
        fs::metadata(self.path(name)).unwrap().modified().unwrap()
    }
}

fn files(main: &[u8], beside: &[(&str, &[u8])], copied: Vec<Dependency>) -> Content {
    let beside = beside.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())).collect();
    Content::Files(Files { main: main.to_vec(), beside, copied, library: Vec::new() })
}

#[test]
fn files_appear_beside_each_other_and_the_main_file_last() {
    let space = Space::new();
    space.put("in/a.gltf", b"source");
    space.put("in/tex/b.png", b"image");
    let content = files(b"{}", &[("a.lod.bin", b"levels")], vec![space.dependency("tex/b.png")]);
    let emitted = space.emit("in/a.gltf", "out/sub/a.gltf", &content).unwrap();
    assert_eq!(space.files(), ["sub/a.gltf", "sub/a.lod.bin", "sub/tex/b.png"]);
    assert_eq!(fs::read(space.path("out/sub/tex/b.png")).unwrap(), b"image");
    let names: Vec<_> =
        emitted.files.iter().map(|f| (f.path.file_name().unwrap().to_str().unwrap(), f.written)).collect();
    assert_eq!(names, [("b.png", true), ("a.lod.bin", true), ("a.gltf", true)]);
}

#[test]
fn equal_files_are_not_touched() {
    let space = Space::new();
    space.put("in/a.gltf", b"source");
    space.put("in/b.png", &vec![7; 200_000]);
    let content = || files(b"{}", &[("a.lod.bin", b"levels")], vec![space.dependency("b.png")]);
    space.emit("in/a.gltf", "out/a.gltf", &content()).unwrap();
    let old = ["out/a.gltf", "out/a.lod.bin", "out/b.png"].map(|name| space.age(name));
    let again = OutputFolder::new(&space.path("out"));
    let (source, target) = (space.path("in/a.gltf"), space.path("out/a.gltf"));
    let emitted = again.emit(&Emission { source: &source, target: &target, content: &content() }).unwrap();
    assert!(emitted.files.iter().all(|file| !file.written), "{emitted:?}");
    assert_eq!(["out/a.gltf", "out/a.lod.bin", "out/b.png"].map(|name| space.modified(name)), old);
    // One byte of the same length.
    let mut image = vec![7; 200_000];
    image[150_000] = 8;
    space.put("in/b.png", &image);
    let emitted = again_emit(&space, &content());
    assert_eq!(emitted.files.iter().map(|file| file.written).collect::<Vec<_>>(), [true, false, false]);
    assert_eq!(fs::read(space.path("out/b.png")).unwrap(), image);
}

fn again_emit(space: &Space, content: &Content) -> Emitted {
    let (source, target) = (space.path("in/a.gltf"), space.path("out/a.gltf"));
    OutputFolder::new(&space.path("out")).emit(&Emission { source: &source, target: &target, content }).unwrap()
}

#[test]
fn without_levels_the_source_is_copied() {
    let space = Space::new();
    space.put("in/a.glb", &[1, 2, 3]);
    let content = Content::AsSource { copied: vec![space.dependency("missing.png")] };
    let emitted = space.emit("in/a.glb", "out/a.glb", &content).unwrap();
    assert_eq!(fs::read(space.path("out/a.glb")).unwrap(), [1, 2, 3]);
    assert_eq!(emitted.missing, ["missing.png"]);
}

#[test]
fn outputs_are_as_public_as_other_files() {
    let space = Space::new();
    let other = space.put("in/a.glb", b"x");
    space.emit("in/a.glb", "out/a.glb", &files(b"y", &[], vec![])).unwrap();
    let (ours, other) = (fs::metadata(space.path("out/a.glb")).unwrap(), fs::metadata(other).unwrap());
    assert_eq!(ours.permissions(), other.permissions());
}

#[test]
fn the_source_is_never_overwritten() {
    let space = Space::new();
    space.put("in/a.glb", b"source");
    let refused = space.emit("in/a.glb", "in/../in/a.glb", &files(b"new", &[], vec![])).unwrap_err();
    assert!(matches!(refused, EmitError::OverSource { .. }), "{refused}");
    let refused = space.emit("in/a.glb", "in/b.gltf", &files(b"new", &[("a.glb", b"bin")], vec![])).unwrap_err();
    assert!(refused.to_string().ends_with("would overwrite it"), "{refused}");
    assert_eq!(fs::read(space.path("in/a.glb")).unwrap(), b"source");
}

#[test]
fn resources_stay_where_they_are_when_the_folders_are_the_same() {
    let space = Space::new();
    space.put("in/a.gltf", b"source");
    space.put("in/b.png", b"image");
    let old = space.age("in/b.png");
    let output = OutputFolder::new(&space.path("in"));
    let (source, target) = (space.path("in/a.gltf"), space.path("in/a.glb"));
    let content = files(b"glb", &[], vec![space.dependency("b.png")]);
    let emitted = output.emit(&Emission { source: &source, target: &target, content: &content }).unwrap();
    assert_eq!(emitted.files.len(), 1);
    assert_eq!(space.modified("in/b.png"), old);
}

#[test]
fn two_scenes_of_one_output_are_both_named() {
    let space = Space::new();
    space.put("in/a.glb", b"1");
    space.put("in/a.gltf", b"2");
    space.emit("in/a.gltf", "out/a.glb", &files(b"x", &[], vec![])).unwrap();
    let refused = space.emit("in/a.glb", "out/a.glb", &files(b"y", &[], vec![])).unwrap_err().to_string();
    let words = |root: &Path| refused.replace(root.to_str().unwrap(), "ROOT/");
    assert_eq!(words(&space.path("")), "`ROOT/in/a.glb` and `ROOT/in/a.gltf` would both write `ROOT/out/a.glb`");
    let pairs = [("in/a", "out/a"), ("in/b", "out/x/../a")];
    let pairs = pairs.map(|(source, target)| (Path::new(source), Path::new(target)));
    assert!(matches!(OutputFolder::check_targets(pairs), Err(EmitError::Taken { .. })));
    assert!(OutputFolder::check_targets(pairs.into_iter().take(1)).is_ok());
}

#[test]
fn a_shared_texture_is_copied_once_and_a_different_one_refused() {
    let space = Space::new();
    for name in ["in/a.gltf", "in/b.gltf", "in/sub/c.gltf"] {
        space.put(name, b"source");
    }
    space.put("in/t.png", b"image");
    let content = files(b"x", &[], vec![space.dependency("t.png")]);
    assert!(space.emit("in/a.gltf", "out/a.gltf", &content).unwrap().files[0].written);
    space.age("out/t.png");
    let second = space.emit("in/b.gltf", "out/b.gltf", &content).unwrap();
    assert_eq!(second.files.len(), 2);
    space.put("in/sub/t.png", b"other");
    let other = Dependency { uri: "t.png".into(), path: space.path("in/sub/t.png"), kind: DependencyKind::Image };
    let refused = space.emit("in/sub/c.gltf", "out/c.gltf", &files(b"x", &[], vec![other])).unwrap_err();
    assert!(matches!(refused, EmitError::Taken { .. }), "{refused}");
}

fn with_library(main: &[u8], name: &str, bytes: &[u8]) -> Content {
    let library = vec![LibraryFile { name: name.to_owned(), bytes: bytes.to_vec() }];
    Content::Files(Files { main: main.to_vec(), beside: Vec::new(), copied: Vec::new(), library })
}

#[test]
fn a_file_of_the_library_is_written_once_and_before_the_scenes() {
    let space = Space::new();
    space.put("in/a.glb", b"1");
    space.put("in/deep/b.glb", b"2");
    let first = space.emit("in/a.glb", "out/a.glb", &with_library(b"x", "m.bin", b"mesh")).unwrap();
    let told = |emitted: &Emitted| -> Vec<(String, bool)> {
        emitted.files.iter().map(|file| (space.output.relative(&file.path), file.written)).collect()
    };
    assert_eq!(told(&first), [("lodbake-library/m.bin".to_owned(), true), ("a.glb".to_owned(), true)]);
    let old = space.age("out/lodbake-library/m.bin");
    let second = space.emit("in/deep/b.glb", "out/deep/b.glb", &with_library(b"y", "m.bin", b"mesh")).unwrap();
    assert_eq!(told(&second), [("lodbake-library/m.bin".to_owned(), false), ("deep/b.glb".to_owned(), true)]);
    assert_eq!(space.modified("out/lodbake-library/m.bin"), old);
    // Another run finds it, and mends it where it is damaged.
    let again = |content: &Content| {
        let (source, target) = (space.path("in/a.glb"), space.path("out/a.glb"));
        OutputFolder::new(&space.path("out")).emit(&Emission { source: &source, target: &target, content }).unwrap()
    };
    assert!(!again(&with_library(b"x", "m.bin", b"mesh")).files[0].written);
    space.put("out/lodbake-library/m.bin", b"mosh");
    assert!(again(&with_library(b"x", "m.bin", b"mesh")).files[0].written);
    assert_eq!(fs::read(space.path("out/lodbake-library/m.bin")).unwrap(), b"mesh");
    // Whoever stops in between leaves a file that nobody names, never a name without a file.
    fs::create_dir_all(space.path("out/c.glb")).unwrap();
    assert!(space.emit("in/a.glb", "out/c.glb", &with_library(b"z", "n.bin", b"other")).is_err());
    assert!(space.files().contains(&"lodbake-library/n.bin".to_owned()), "{:?}", space.files());
    fs::create_dir_all(space.path("out/lodbake-library/o.bin")).unwrap();
    assert!(space.emit("in/a.glb", "out/d.glb", &with_library(b"z", "o.bin", b"third")).is_err());
    assert!(!space.files().contains(&"d.glb".to_owned()), "{:?}", space.files());
    // No scene may have that name for itself.
    space.put("in/e.glb", b"3");
    let refused = space.emit("in/e.glb", "out/lodbake-library/m.bin", &files(b"x", &[], vec![])).unwrap_err();
    assert!(matches!(refused, EmitError::Taken { .. }), "{refused}");
}

#[test]
fn outputs_are_named_from_the_folder_on() {
    let output = OutputFolder::new(Path::new("a/../b/./out"));
    assert_eq!(output.relative(Path::new("a/../b/./out/c/d.glb")), "c/d.glb");
    assert_eq!(output.relative(Path::new("b/out/c/../d.glb")), "d.glb");
}

#[test]
fn nothing_is_written_outside_the_output_folder() {
    let space = Space::new();
    space.put("in/a.gltf", b"source");
    space.put("shared/t.png", b"image");
    let outside = vec![space.dependency("../shared/../shared/t.png")];
    // The neighbour of both folders is the same file: it stays where it is.
    assert!(space.emit("in/a.gltf", "out/a.gltf", &files(b"x", &[], outside.clone())).is_ok());
    let refused = space.emit("in/a.gltf", "out/deep/a.gltf", &files(b"x", &[], outside)).is_ok();
    assert!(refused, "`out/shared/t.png` is inside");
    let deeper = vec![space.dependency("../../t.png")];
    space.put("../t.png", b"x");
    let refused = space.emit("in/a.gltf", "out/b/a.gltf", &files(b"x", &[], deeper)).unwrap_err();
    assert!(matches!(refused, EmitError::Outside { .. }), "{refused}");
    assert!(refused.hint().is_some());
}

#[test]
fn folders_and_files_in_the_way_are_named() {
    let space = Space::new();
    space.put("in/a.glb", b"source");
    fs::create_dir_all(space.path("out/a.glb")).unwrap();
    let refused = space.emit("in/a.glb", "out/a.glb", &files(b"x", &[("a.bin", b"y")], vec![])).unwrap_err();
    assert!(refused.to_string().ends_with("it is a folder"), "{refused}");
    assert!(space.files().is_empty(), "nothing of a refused scene is left: {:?}", space.files());
    space.put("out/sub", b"a file");
    let refused = space.emit("in/a.glb", "out/sub/a.glb", &files(b"x", &[], vec![])).unwrap_err();
    assert!(refused.to_string().contains("failed to create the folder"), "{refused}");
    assert!(refused.hint().is_some());
}

#[cfg(unix)]
#[test]
fn links_are_replaced_not_written_through() {
    let space = Space::new();
    space.put("in/a.glb", b"source");
    let elsewhere = space.put("elsewhere.glb", b"precious");
    fs::create_dir(space.path("out")).unwrap();
    std::os::unix::fs::symlink(&elsewhere, space.path("out/a.glb")).unwrap();
    space.emit("in/a.glb", "out/a.glb", &files(b"new", &[], vec![])).unwrap();
    assert_eq!(fs::read(elsewhere).unwrap(), b"precious");
    assert_eq!(fs::read(space.path("out/a.glb")).unwrap(), b"new");
}

#[test]
fn failures_of_the_system_have_words_and_hints() {
    for (kind, words) in [
        (std::io::ErrorKind::StorageFull, "the disk is full"),
        (std::io::ErrorKind::PermissionDenied, "permission denied"),
    ] {
        let error = EmitError::io("write", Path::new("out/a.glb"))(kind.into());
        assert_eq!(error.to_string(), format!("failed to write `out/a.glb`: {words}"));
        assert!(error.hint().is_some());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named() {
    let mut full = fs::File::options().write(true).open("/dev/full").unwrap();
    let error = std::io::Write::write_all(&mut full, &[0; 10]).unwrap_err();
    let error = EmitError::io("write", Path::new("out/a.glb"))(error);
    assert_eq!(error.to_string(), "failed to write `out/a.glb`: the disk is full");
}
