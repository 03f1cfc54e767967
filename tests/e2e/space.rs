//! A folder of its own for each test, and the binary run in it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use assert_cmd::Command;
use serde_json::Value;

/// A temporary folder, removed at the end of the test.
pub struct Space {
    folder: Option<tempfile::TempDir>,
    path: PathBuf,
}

/// What a run of the binary left behind.
#[derive(Debug)]
pub struct Run {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Space {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("the system has a temporary folder");
        // Resolved, so that no symbolic link of the system's (`/tmp` on some) changes a path that a test compares.
        let path = folder.path().canonicalize().expect("the folder was just made");
        Self { folder: Some(folder), path }
    }

    /// The path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file, with the folders above it.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("it is below the folder")).expect("folders can be made here");
        fs::write(path, bytes).expect("files can be written here");
    }

    /// Reads a file.
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("`{name}`: {error}"))
    }

    /// Reads a JSON file.
    pub fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap_or_else(|error| panic!("`{name}`: {error}"))
    }

    /// All files below a folder, by path relative to it, with `/`. Empty if there is no such folder.
    pub fn files(&self, below: &str) -> BTreeMap<String, Vec<u8>> {
        self.walk(below).into_iter().map(|(name, path)| (name, fs::read(path).expect("it was just listed"))).collect()
    }

    /// When the files below a folder were last written.
    pub fn times(&self, below: &str) -> BTreeMap<String, SystemTime> {
        let time = |path: PathBuf| fs::metadata(path).and_then(|m| m.modified()).expect("it was just listed");
        self.walk(below).into_iter().map(|(name, path)| (name, time(path))).collect()
    }

    fn walk(&self, below: &str) -> Vec<(String, PathBuf)> {
        let top = self.path(below);
        let mut folders = vec![top.clone()];
        let mut found = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).into_iter().flatten() {
                let path = entry.expect("it can be listed").path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    found.push((relative(&path, &top), path));
                }
            }
        }
        found.sort();
        found
    }

    /// Runs the binary here with these words and no environment of the tester's that changes what it says.
    pub fn run(&self, args: &[&str]) -> Run {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lodbake"));
        command.args(args).current_dir(&self.path);
        for name in ["LODBAKE_CACHE", "NO_COLOR", "TERM", "RAYON_NUM_THREADS"] {
            command.env_remove(name);
        }
        let output = command.output().expect("the binary runs");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the binary writes UTF-8");
        let code = output.status.code().expect("no signal ended it");
        Run { code, stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Runs the binary and asks for exit code 0.
    pub fn run_fine(&self, args: &[&str]) -> Run {
        let run = self.run(args);
        assert_eq!(run.code, 0, "`lodbake {}`: {run:#?}", args.join(" "));
        run
    }

    /// How far the program itself sees a scene from another one: d_RMS of 24 views of `size` pixels a side.
    pub fn difference(&self, source: &str, output: &str, size: u32) -> f64 {
        let size = size.to_string();
        let told = self.run_fine(&["--json", "evaluate", "--size", &size, "--samples", "100", source, output]);
        told.document()["candidates"][0]["d_rms"].as_f64().expect("a figure")
    }

    /// Keeps the folder and says where it is; for a look at a failing test.
    #[expect(dead_code, reason = "called by hand while a test is being mended")]
    pub fn eject(mut self) -> ! {
        let kept = self.folder.take().expect("it is taken once").keep();
        panic!("kept in {}", kept.display());
    }
}

fn relative(path: &Path, top: &Path) -> String {
    let below = path.strip_prefix(top).expect("it was found below it");
    below.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

impl Run {
    /// Standard output as one JSON document.
    pub fn document(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:#?}"))
    }

    /// Standard output as JSON lines.
    pub fn events(&self) -> Vec<Value> {
        let parse = |line| serde_json::from_str(line).unwrap_or_else(|error| panic!("`{line}`: {error}"));
        self.stdout.lines().map(parse).collect()
    }

    /// The events of one type.
    pub fn events_of(&self, kind: &str) -> Vec<Value> {
        self.events().into_iter().filter(|event| event["type"] == kind).collect()
    }

    /// `summary` of the last event.
    pub fn summary(&self) -> Value {
        let last = self.events().pop().unwrap_or_else(|| panic!("there are no events: {self:#?}"));
        assert_eq!(last["type"], "finished", "{self:#?}");
        last["summary"].clone()
    }
}
