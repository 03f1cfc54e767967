//! Input folders → the scene files in them, in one order on every platform.
//!
//! Looks at names and file facts only and opens no file. Names that begin with `.` are left out (`.git`, the resource
//! forks `._x.glb` that macOS leaves on foreign disks), and so are the output and the cache, wherever they are.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use ignore::{DirEntry, WalkBuilder};
use serde::{Deserialize, Serialize};

use crate::config::{Folder, Globs, Pipeline};

/// What the file system says of a file without opening it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileStat {
    /// Length in bytes.
    pub size: u64,
    /// Last change of the content, in nanoseconds since 1970.
    pub mtime_ns: i64,
    /// Last change of content, name or rights, in nanoseconds since 1970; 0 where the platform does not tell. It shows
    /// a change whose author has set the old `mtime` again, as `cp -p` does.
    pub ctime_ns: i64,
    /// Number of the file on its device; 0 where the platform does not tell.
    pub inode: u64,
    /// Device; 0 where the platform does not tell.
    pub device: u64,
}

impl FileStat {
    /// The facts of the file at `path`; links are followed.
    pub fn of(path: &Path) -> io::Result<Self> {
        std::fs::metadata(path).map(|metadata| Self::from(&metadata))
    }
}

impl From<&Metadata> for FileStat {
    #[cfg(unix)]
    fn from(metadata: &Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        Self {
            size: metadata.len(),
            mtime_ns: modified_ns(metadata),
            ctime_ns: metadata.ctime().saturating_mul(1_000_000_000).saturating_add(metadata.ctime_nsec()),
            inode: metadata.ino(),
            device: metadata.dev(),
        }
    }

    #[cfg(not(unix))]
    fn from(metadata: &Metadata) -> Self {
        Self { size: metadata.len(), mtime_ns: modified_ns(metadata), ..Self::default() }
    }
}

fn modified_ns(metadata: &Metadata) -> i64 {
    let Ok(time) = metadata.modified() else { return 0 };
    match time.duration_since(UNIX_EPOCH) {
        Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
        Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |ns| -ns),
    }
}

/// One scene of an input folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFile {
    /// Index into [`Pipeline::inputs`].
    pub input: usize,
    /// Path below the input folder, with `/` as separator on every platform; the bytes of the name are left as they are.
    pub relative: String,
    /// Where it is.
    pub path: PathBuf,
    /// As the file system told during the scan.
    pub stat: FileStat,
}

/// What was found.
#[derive(Debug, Default)]
pub struct Scan {
    /// Sorted by the bytes of `relative`; no two have the same.
    pub files: Vec<SceneFile>,
    /// Scenes or folders that could not be taken; the others can still be baked.
    pub problems: Vec<ScanProblem>,
    /// Worth telling, but nothing is missing for it.
    pub warnings: Vec<ScanWarning>,
}

/// An input folder that is not there: nothing can be baked before `pipeline.toml` is mended.
#[derive(Debug, thiserror::Error)]
#[error("failed to scan input `{input}`: {source}")]
pub struct ScanError {
    /// As the user wrote it.
    pub input: String,
    /// From the operating system.
    pub source: io::Error,
}

/// Something in an input folder that cannot be taken. Paths begin with the input as the user wrote it.
#[derive(Debug, thiserror::Error)]
pub enum ScanProblem {
    /// No permission, gone meanwhile, or a link to nothing.
    #[error("failed to scan `{path}`: {source}")]
    Unreadable {
        /// File or folder.
        path: String,
        /// From the operating system.
        source: io::Error,
    },
    /// The path of a scene is not UTF-8; `path` shows it with `\u{fffd}` for the bad bytes.
    #[error("failed to scan `{path}`: the name is not UTF-8")]
    NotUtf8 {
        /// File.
        path: String,
    },
    /// Named like a scene, but a pipe, socket or device.
    #[error("failed to scan `{path}`: not a regular file")]
    NotAFile {
        /// Path of it.
        path: String,
    },
    /// Two inputs have a scene at the same place, so that both would become the same output.
    #[error("`{second}` is not baked: `{first}` has the same output")]
    SameOutput {
        /// The scene that is baked: that of the input named first.
        first: String,
        /// The scene that is not.
        second: String,
    },
}

/// Something worth telling.
#[derive(Debug, thiserror::Error)]
pub enum ScanWarning {
    /// A link to a folder that it is in. It is not entered again.
    #[error("`{path}` is a link to `{ancestor}`, the folder it is in")]
    Loop {
        /// The link.
        path: String,
        /// What it leads to.
        ancestor: String,
    },
    /// A line of a `.gitignore` or `.ignore` file that is no pattern.
    #[error("in the ignore files of `{path}`: {cause}")]
    IgnoreFile {
        /// Folder.
        path: String,
        /// In the words of the parser.
        cause: String,
    },
}

/// Scans all input folders of the pipeline.
pub fn scan(pipeline: &Pipeline) -> Result<Scan, ScanError> {
    let mut scan = Scan::default();
    for (input, folder) in pipeline.inputs.iter().enumerate() {
        let refused = |source| ScanError { input: folder.written.clone(), source };
        if !std::fs::metadata(&folder.path).map_err(refused)?.is_dir() {
            return Err(refused(io::Error::new(io::ErrorKind::NotADirectory, "not a folder")));
        }
        Walker { pipeline, input, folder, scan: &mut scan }.walk();
    }
    scan.files.sort_by(|a, b| a.relative.cmp(&b.relative).then(a.input.cmp(&b.input)));
    let Scan { files, problems, .. } = &mut scan;
    files.dedup_by(|second, first| {
        let same = first.relative == second.relative;
        if same {
            let path = |file: &SceneFile| shown(&pipeline.inputs[file.input], &file.relative);
            problems.push(ScanProblem::SameOutput { first: path(first), second: path(second) });
        }
        same
    });
    problems.sort_by_cached_key(ToString::to_string);
    scan.warnings.sort_by_cached_key(ToString::to_string);
    Ok(scan)
}

/// A path for messages.
fn shown(folder: &Folder, relative: &str) -> String {
    match (folder.written.trim_end_matches('/'), relative) {
        (written, "") => written.to_owned(),
        (".", relative) => relative.to_owned(),
        (written, relative) => format!("{written}/{relative}"),
    }
}

/// One input folder.
struct Walker<'a> {
    pipeline: &'a Pipeline,
    input: usize,
    folder: &'a Folder,
    scan: &'a mut Scan,
}

impl Walker<'_> {
    fn walk(&mut self) {
        let mut builder = WalkBuilder::new(&self.folder.path);
        let ignore_files = self.pipeline.ignore_files;
        builder
            .standard_filters(false)
            .ignore(ignore_files)
            .git_ignore(ignore_files)
            .parents(ignore_files)
            // Neither the user's global ignore file nor the presence of `.git` may change what is baked.
            .require_git(false)
            .follow_links(self.pipeline.follow_links);
        let filter = Filter::new(self.pipeline, &self.folder.path);
        builder.filter_entry(move |entry| filter.wants(entry));
        for entry in builder.build() {
            match entry {
                Ok(entry) => self.take(&entry),
                Err(error) => self.tell(&error),
            }
        }
    }

    fn take(&mut self, entry: &DirEntry) {
        if let Some(error) = entry.error() {
            let (path, cause) = (self.shown(entry.path()), error.to_string());
            self.scan.warnings.push(ScanWarning::IgnoreFile { path, cause });
        }
        let is_link = entry.file_type().is_some_and(|kind| kind.is_symlink());
        if entry.depth() == 0 || is_link || entry.file_type().is_some_and(|kind| kind.is_dir()) {
            return;
        }
        let lossy = relative(&self.folder.path, entry.path());
        if !self.pipeline.include.matches(&lossy) {
            return;
        }
        let path = || shown(self.folder, &lossy);
        let stat = entry
            .metadata()
            .map_err(|error| error.io_error().map_or_else(|| io::Error::other(error.to_string()), innermost));
        let problem = match stat {
            Err(source) => ScanProblem::Unreadable { path: path(), source },
            Ok(metadata) if !metadata.is_file() => ScanProblem::NotAFile { path: path() },
            Ok(_) if entry.path().to_str().is_none() => ScanProblem::NotUtf8 { path: path() },
            Ok(metadata) => {
                let (path, stat) = (entry.path().to_path_buf(), FileStat::from(&metadata));
                self.scan.files.push(SceneFile { input: self.input, relative: lossy, path, stat });
                return;
            }
        };
        self.scan.problems.push(problem);
    }

    fn shown(&self, path: &Path) -> String {
        shown(self.folder, &relative(&self.folder.path, path))
    }

    /// Errors of the walk, unwrapped to path and cause.
    fn tell(&mut self, error: &ignore::Error) {
        if let Some((ancestor, child)) = find_loop(error) {
            let (path, ancestor) = (self.shown(child), self.shown(ancestor));
            self.scan.warnings.push(ScanWarning::Loop { path, ancestor });
            return;
        }
        let path = find_path(error).unwrap_or(&self.folder.path);
        // A link to nothing is of interest only where a scene was meant.
        let is_link = std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink());
        if is_link && !self.pipeline.include.matches(&relative(&self.folder.path, path)) {
            return;
        }
        let source = error.io_error().map_or_else(|| io::Error::other(error.to_string()), innermost);
        self.scan.problems.push(ScanProblem::Unreadable { path: self.shown(path), source });
    }
}

/// The operating system's own error, without the path (the walk's errors repeat it, as absolute as the input is).
fn innermost(error: &io::Error) -> io::Error {
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(error) = cause {
        if let Some(code) = error.downcast_ref::<io::Error>().and_then(io::Error::raw_os_error) {
            return io::Error::from_raw_os_error(code);
        }
        cause = error.source().or_else(|| Some(error.downcast_ref::<io::Error>()?.get_ref()? as _));
    }
    io::Error::new(error.kind(), error.to_string())
}

fn find_loop(error: &ignore::Error) -> Option<(&Path, &Path)> {
    match error {
        ignore::Error::Loop { ancestor, child } => Some((ancestor, child)),
        ignore::Error::WithPath { err, .. }
        | ignore::Error::WithDepth { err, .. }
        | ignore::Error::WithLineNumber { err, .. } => find_loop(err),
        _ => None,
    }
}

fn find_path(error: &ignore::Error) -> Option<&Path> {
    match error {
        ignore::Error::WithPath { path, .. } => Some(path),
        ignore::Error::WithDepth { err, .. } | ignore::Error::WithLineNumber { err, .. } => find_path(err),
        _ => None,
    }
}

/// Path below `root` with `/` as separator; bytes that are not UTF-8 become `\u{fffd}`.
fn relative(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).unwrap_or(path);
    let parts: Vec<_> = below.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

/// Which entries the walk takes and which folders it enters.
struct Filter {
    root: PathBuf,
    exclude: Globs,
    /// Output and cache, where they exist, with links resolved.
    never: Vec<PathBuf>,
}

impl Filter {
    fn new(pipeline: &Pipeline, root: &Path) -> Self {
        let never = [&pipeline.output, &pipeline.cache];
        let never = never.into_iter().filter_map(|folder| folder.path.canonicalize().ok()).collect();
        Self { root: root.to_path_buf(), exclude: pipeline.exclude.clone(), never }
    }

    fn wants(&self, entry: &DirEntry) -> bool {
        if entry.depth() == 0 {
            return true;
        }
        let hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if hidden || self.exclude.matches(&relative(&self.root, entry.path())) {
            return false;
        }
        let is_folder = entry.file_type().is_some_and(|kind| kind.is_dir());
        !(is_folder && entry.path().canonicalize().is_ok_and(|path| self.never.contains(&path)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with these files, each holding its own name.
    fn tree(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, file).unwrap();
        }
        folder
    }

    fn pipeline(folder: &tempfile::TempDir, text: &str) -> Pipeline {
        Pipeline::parse(text, &folder.path().join("pipeline.toml").display().to_string()).unwrap()
    }

    fn scan_all(folder: &tempfile::TempDir, rest: &str) -> Scan {
        scan(&pipeline(folder, &format!("input = 'in'\noutput = 'in/baked'\ncache = 'in/kept'\n{rest}"))).unwrap()
    }

    fn names(scan: &Scan) -> Vec<&str> {
        scan.files.iter().map(|file| file.relative.as_str()).collect()
    }

    const FILES: [&str; 10] = [
        "in/b.glb",
        "in/B.GLB",
        "in/a/z.gltf",
        "in/a.obj",
        "in/a/z.bin",
        "in/.git/c.glb",
        "in/._b.glb",
        "in/baked/b.glb",
        "in/kept/b.glb",
        "in/a-a/y.glb",
    ];

    #[test]
    fn order_is_by_bytes_and_hidden_output_and_cache_are_left_out() {
        let folder = tree(&FILES);
        let scan = scan_all(&folder, "");
        assert_eq!(names(&scan), ["B.GLB", "a-a/y.glb", "a.obj", "a/z.gltf", "b.glb"]);
        assert_eq!(scan.files[4].stat.size, "in/b.glb".len() as u64);
        assert_eq!(scan.files[4].path, folder.path().join("in/b.glb"));
        assert!(scan.problems.is_empty() && scan.warnings.is_empty(), "{scan:?}");
    }

    #[test]
    fn globs_choose_files_and_cut_folders() {
        let folder = tree(&FILES);
        assert_eq!(names(&scan_all(&folder, "include = '*.glb'")), ["B.GLB", "b.glb"]);
        assert_eq!(names(&scan_all(&folder, "exclude = ['a', 'b.*']")), ["a-a/y.glb", "a.obj"]);
    }

    #[test]
    fn ignore_files_are_obeyed_on_request() {
        let folder = tree(&["in/a.glb", "in/b.glb", "in/sub/a.glb"]);
        std::fs::write(folder.path().join("in/.gitignore"), "/a.glb\n").unwrap();
        std::fs::write(folder.path().join(".ignore"), "b.glb\n").unwrap();
        assert_eq!(names(&scan_all(&folder, "")), ["a.glb", "b.glb", "sub/a.glb"]);
        assert_eq!(names(&scan_all(&folder, "ignore_files = true")), ["sub/a.glb"]);
    }

    #[test]
    fn two_inputs_are_laid_over_each_other() {
        let folder = tree(&["in/a.glb", "in/c.glb", "more/a.glb", "more/b.glb"]);
        let scan = scan(&pipeline(&folder, "input = ['more', 'in']\noutput = 'out'")).unwrap();
        assert_eq!(names(&scan), ["a.glb", "b.glb", "c.glb"]);
        assert_eq!(scan.files.iter().map(|file| file.input).collect::<Vec<_>>(), [0, 0, 1]);
        insta::assert_snapshot!(scan.problems[0], @"`in/a.glb` is not baked: `more/a.glb` has the same output");
    }

    #[test]
    fn an_input_that_is_no_folder_is_an_error() {
        let folder = tree(&["in"]);
        let refused = scan(&pipeline(&folder, "input = 'in'\noutput = 'out'")).unwrap_err();
        insta::assert_snapshot!(refused, @"failed to scan input `in`: not a folder");
        let refused = scan(&pipeline(&folder, "input = 'absent'\noutput = 'out'")).unwrap_err();
        assert!(refused.to_string().starts_with("failed to scan input `absent`: "), "{refused}");
    }

    #[cfg(target_os = "linux")] // for the words of its errors
    #[test]
    fn links_are_followed_and_loops_survived() {
        use std::os::unix::fs::symlink;
        let folder = tree(&["in/a/x.glb", "in/a/b/y.glb", "elsewhere/z.glb", "in/baked/x.glb"]);
        let at = |name: &str| folder.path().join(name);
        symlink(at("in/a"), at("in/a/b/up")).unwrap();
        symlink("..", at("in/a/top")).unwrap();
        symlink(at("elsewhere"), at("in/linked")).unwrap();
        symlink(at("elsewhere/z.glb"), at("in/file.glb")).unwrap();
        symlink("self.glb", at("in/self.glb")).unwrap();
        symlink("nowhere", at("in/gone.glb")).unwrap();
        symlink("nowhere", at("in/gone.txt")).unwrap();
        symlink(at("in/baked"), at("in/a/outputs")).unwrap();
        let found = scan_all(&folder, "");
        assert_eq!(names(&found), ["a/b/y.glb", "a/x.glb", "file.glb", "linked/z.glb"]);
        assert_eq!(found.files[2].stat, found.files[3].stat);
        let told: Vec<String> = found.warnings.iter().map(ToString::to_string).collect();
        insta::assert_snapshot!(told.join("\n"), @r"
    `in/a/b/up` is a link to `in/a`, the folder it is in
    `in/a/top` is a link to `in`, the folder it is in
    ");
        let told: Vec<String> = found.problems.iter().map(ToString::to_string).collect();
        insta::assert_snapshot!(told.join("\n"), @r"
    failed to scan `in/gone.glb`: No such file or directory (os error 2)
    failed to scan `in/self.glb`: Too many levels of symbolic links (os error 40)
    ");
        let found = scan_all(&folder, "follow_links = false");
        assert_eq!(names(&found), ["a/b/y.glb", "a/x.glb"]);
        assert!(found.problems.is_empty() && found.warnings.is_empty(), "{found:?}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn odd_names_and_files_are_named_not_dropped() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tree(&["in/a.glb"]);
        let odd = std::ffi::OsStr::from_bytes(b"in/b\xff.glb");
        std::fs::write(folder.path().join(odd), "x").unwrap();
        std::fs::write(folder.path().join("in/de\u{301}cor.glb"), "x").unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(folder.path().join("in/s.glb")).unwrap();
        let found = scan_all(&folder, "");
        assert_eq!(names(&found), ["a.glb", "de\u{301}cor.glb"], "the name is not normalised");
        let told: Vec<String> = found.problems.iter().map(ToString::to_string).collect();
        insta::assert_snapshot!(told.join("\n"), @r"
    failed to scan `in/b�.glb`: the name is not UTF-8
    failed to scan `in/s.glb`: not a regular file
    ");
    }
}
