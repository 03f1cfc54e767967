//! `study.toml` → [`Study`]: defaults, globs, and the rules that need more than one key to tell.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::file::{self, AlgorithmEntry, StudyFile};
use super::template::{Placeholder, Template};
use crate::config::check::Document;
use crate::config::file::OneOrMany;
use crate::config::{ConfigError, Globs, Names, Place, Renderer, SceneSettings, read_text};

/// A validated `study.toml`.
#[derive(Clone, Debug)]
pub struct Study {
    /// Path of the file as the user wrote it.
    pub file: String,
    /// Folder of the file: commands run there.
    pub folder: PathBuf,
    /// Where results go.
    pub output: PathBuf,
    /// At least one, sorted by path within each entry of `meshes`.
    pub meshes: Vec<MeshFile>,
    /// At least one: ratios, then triangle counts, in the file's order.
    pub targets: Vec<Target>,
    /// Values of `d_RMS`.
    pub appearance: Vec<f64>,
    /// Pixels a side of each view, 16…4096.
    pub size: u32,
    /// What draws the views.
    pub renderer: Renderer,
    /// At least one.
    pub algorithms: Vec<Algorithm>,
    /// Index of the algorithm that the others are compared with.
    pub baseline: usize,
}

/// A mesh of a study.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// As tables call it; no other has this name.
    pub name: String,
    /// The scene file.
    pub path: PathBuf,
}

/// What is asked of an algorithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Share of the triangles, between 0 and 1, exclusive.
    Ratio(f64),
    /// Number of triangles, 1 or more.
    Triangles(u32),
}

impl Target {
    /// Triangles to be left of `source`, at least 1.
    pub fn triangles(self, source: u64) -> u64 {
        match self {
            Self::Ratio(ratio) => ((source as f64 * ratio).round() as u64).max(1),
            Self::Triangles(triangles) => u64::from(triangles),
        }
    }
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Ratio(ratio) => write!(f, "{ratio}"),
            Self::Triangles(triangles) => write!(f, "{triangles} triangles"),
        }
    }
}

/// An algorithm of a study.
#[derive(Clone, Debug)]
pub struct Algorithm {
    /// As tables call it; no other has this name.
    pub name: String,
    /// What runs.
    pub kind: Kind,
    /// Index of the algorithm whose counts are asked for.
    pub matched: Option<usize>,
    /// Timed runs, 1 or more.
    pub repetitions: usize,
    /// Longest run of a command.
    pub timeout: Duration,
}

/// What runs.
#[derive(Clone, Debug)]
pub enum Kind {
    /// lodbake, in this process.
    Own(Box<SceneSettings>),
    /// A program.
    Command(Template),
}

impl Study {
    /// Reads and validates a file.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        let (text, written) = read_text(file)?;
        Self::parse(&text, &written)
    }

    /// Validates `text`. Relative paths are relative to the folder of `file`.
    pub fn parse(text: &str, file: &str) -> Result<Self, ConfigError> {
        let schema = file::schema();
        let document = Document::parse(file, text, &schema)?;
        let typed: StudyFile = document.typed()?;
        let top = Place::default();
        let folder = Path::new(file).parent().unwrap_or(Path::new("")).to_path_buf();
        let targets = targets(&document, &typed)?;
        let output = folder.join(&typed.output);
        let meshes = meshes(&document, &folder, &output, &typed.meshes)?;
        let algorithms = algorithms(&document, &typed)?;
        let baseline = match &typed.baseline {
            None => 0,
            Some(name) => index_of(&document, &top.key("baseline"), name, &typed.algorithm)?,
        };
        Ok(Self {
            file: file.to_owned(),
            output,
            folder,
            meshes,
            targets,
            appearance: typed.appearance.unwrap_or_default(),
            size: typed.size.unwrap_or(file::SIZE),
            renderer: typed.renderer.unwrap_or_default(),
            algorithms,
            baseline,
        })
    }
}

fn targets(document: &Document<'_>, typed: &StudyFile) -> Result<Vec<Target>, ConfigError> {
    let ratios = typed.ratios.iter().flatten().map(|&ratio| Target::Ratio(ratio));
    let counts = typed.triangles.iter().flatten().map(|&count| Target::Triangles(count));
    let all: Vec<Target> = ratios.chain(counts).collect();
    if all.is_empty() {
        return Err(document.invalid(&Place::default().key("ratios"), "is missing, and so is `triangles`: give one"));
    }
    for (i, ratio) in typed.ratios.iter().flatten().enumerate() {
        let place = Place::default().key("ratios").index(i);
        if *ratio <= 0.0 || 1.0 <= *ratio {
            return Err(document.invalid(&place, format!("is {ratio}: must be between 0 and 1, exclusive")));
        }
    }
    let lists: [(&str, Vec<f64>); 3] = [
        ("ratios", typed.ratios.clone().unwrap_or_default()),
        ("triangles", typed.triangles.iter().flatten().map(|&count| f64::from(count)).collect()),
        ("appearance", typed.appearance.clone().unwrap_or_default()),
    ];
    for (key, values) in lists {
        for (i, value) in values.iter().enumerate() {
            if values[..i].contains(value) {
                return Err(document.invalid(&Place::default().key(key).index(i), format!("repeats {value}")));
            }
        }
    }
    Ok(all)
}

/// Entries are files, or globs that match at least one outside `output`: what an earlier study wrote is no source.
fn meshes(
    document: &Document<'_>,
    folder: &Path,
    output: &Path,
    entries: &OneOrMany,
) -> Result<Vec<MeshFile>, ConfigError> {
    let many = matches!(entries, OneOrMany::Many(_));
    let mut paths: Vec<PathBuf> = Vec::new();
    for (i, entry) in entries.clone().into_vec().into_iter().enumerate() {
        let key = Place::default().key("meshes");
        let place = if many { key.index(i) } else { key };
        let found: Vec<PathBuf> = if is_glob(&entry) {
            let found = matching(folder, &entry)
                .map_err(|cause| document.invalid(&place, format!("`{entry}` is not a glob: {cause}")))?;
            found.into_iter().filter(|path| !path.starts_with(output)).collect()
        } else {
            vec![folder.join(&entry)].into_iter().filter(|path| path.is_file()).collect()
        };
        if found.is_empty() {
            let what = if is_glob(&entry) { "matches no file" } else { "is not there" };
            return Err(document.invalid(&place, format!("`{entry}` {what} (paths are relative to the study's file)")));
        }
        for path in found {
            if !paths.contains(&path) {
                paths.push(path);
            }
        }
    }
    if paths.is_empty() {
        return Err(document.invalid(&Place::default().key("meshes"), "is empty: name at least one file"));
    }
    let names = names(&paths);
    Ok(paths.into_iter().zip(names).map(|(path, name)| MeshFile { name, path }).collect())
}

fn is_glob(entry: &str) -> bool {
    entry.contains(['*', '?', '[', '{'])
}

/// Files below `folder` that match, sorted. The part before the first folder with a wildcard may go up by `..`.
fn matching(folder: &Path, pattern: &str) -> Result<Vec<PathBuf>, String> {
    let parts: Vec<&str> = pattern.split('/').collect();
    let plain = parts.iter().take_while(|part| !is_glob(part)).count();
    // An absolute pattern replaces the folder.
    let top = folder.join(pattern.split_inclusive('/').take(plain).collect::<String>());
    let globs = Globs::new(vec![parts[plain..].join("/")]).map_err(|(_, cause)| cause)?;
    let mut open = vec![(top, String::new())];
    let mut found = Vec::new();
    while let Some((path, below)) = open.pop() {
        for entry in std::fs::read_dir(&path).into_iter().flatten().flatten() {
            let name = format!("{below}{}", entry.file_name().to_string_lossy());
            let path = entry.path();
            if path.is_dir() {
                open.push((path, format!("{name}/")));
            } else if globs.matches(&name) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// The stem of each file, with as many folders before it as it takes to tell them apart.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let parts = |path: &Path| -> Vec<String> {
        let stem = path.with_extension("");
        stem.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).rev().collect()
    };
    let all: Vec<Vec<String>> = paths.iter().map(|path| parts(path)).collect();
    let name = |parts: &[String], depth: usize| {
        parts.iter().take(depth).rev().map(String::as_str).collect::<Vec<_>>().join("/")
    };
    let deepest = all.iter().map(Vec::len).max().unwrap_or(1);
    let mut out: Vec<String> = all.iter().map(|parts| name(parts, 1)).collect();
    for depth in 2..=deepest {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        for name in &out {
            *counts.entry(name.clone()).or_default() += 1;
        }
        for (own, parts) in out.iter_mut().zip(&all) {
            if 1 < counts[own] {
                *own = name(parts, depth);
            }
        }
    }
    // The same file under two extensions.
    for i in 0..out.len() {
        if out.iter().filter(|name| **name == out[i]).count() > 1 {
            out[i] = format!("{}.{}", out[i], paths[i].extension().unwrap_or_default().to_string_lossy());
        }
    }
    out
}

fn algorithms(document: &Document<'_>, typed: &StudyFile) -> Result<Vec<Algorithm>, ConfigError> {
    let list = Place::default().key("algorithm");
    let mut out = Vec::new();
    for (i, entry) in typed.algorithm.iter().enumerate() {
        let place = list.index(i);
        if typed.algorithm[..i].iter().any(|other| other.name == entry.name) {
            return Err(document.invalid(&place.key("name"), format!("`{}` is taken", entry.name)));
        }
        let kind = match (&entry.simplify, &entry.command) {
            (Some(simplify), None) => Kind::Own(Box::new(SceneSettings::simplified_by(simplify))),
            (None, Some(command)) => Kind::Command(template(document, &place.key("command"), command)?),
            _ => return Err(document.invalid(&place, "must have exactly one of `simplify` and `command`")),
        };
        let matched = match &entry.matched {
            None => None,
            Some(name) => Some(matched(document, &place.key("matched"), name, i, &typed.algorithm)?),
        };
        let repetitions = entry.repetitions.or(typed.repetitions).unwrap_or(file::REPETITIONS) as usize;
        let timeout = entry.timeout.or(typed.timeout).unwrap_or(file::TIMEOUT);
        // Longer than a year is for ever.
        let timeout = Duration::from_secs_f64(timeout.min(3e7));
        out.push(Algorithm { name: entry.name.clone(), kind, matched, repetitions, timeout });
    }
    Ok(out)
}

fn index_of(
    document: &Document<'_>,
    place: &Place,
    name: &str,
    algorithms: &[AlgorithmEntry],
) -> Result<usize, ConfigError> {
    algorithms.iter().position(|entry| entry.name == name).ok_or_else(|| {
        let names = Names::near(name, algorithms.iter().map(|entry| entry.name.clone()).collect());
        document.invalid(place, format!("is `{name}`, which is no algorithm of this study ({names})"))
    })
}

fn matched(
    document: &Document<'_>,
    place: &Place,
    name: &str,
    own: usize,
    algorithms: &[AlgorithmEntry],
) -> Result<usize, ConfigError> {
    let index = index_of(document, place, name, algorithms)?;
    if index == own {
        return Err(document.invalid(place, "is the algorithm itself"));
    }
    if let Some(other) = &algorithms[index].matched {
        let cause = format!("is `{name}`, which is itself matched to `{other}`: name `{other}`");
        return Err(document.invalid(place, cause));
    }
    Ok(index)
}

fn template(document: &Document<'_>, place: &Place, command: &OneOrMany) -> Result<Template, ConfigError> {
    let words: Vec<String> = match command {
        OneOrMany::One(line) => line.split_whitespace().map(str::to_owned).collect(),
        OneOrMany::Many(words) => words.clone(),
    };
    let template = Template::new(&words).map_err(|unknown| {
        let names = Names::near(&unknown, Placeholder::ALL.iter().map(|p| p.name().to_owned()).collect());
        document.invalid(place, format!("has `{{{unknown}}}`, which stands for nothing ({names})"))
    })?;
    if template.program().is_none_or(str::is_empty) {
        return Err(document.invalid(place, "names no program"));
    }
    for needed in [Placeholder::In, Placeholder::Out] {
        if !template.has(needed) {
            let cause = format!("has no `{{{}}}`: a command must read `{{in}}` and write `{{out}}`", needed.name());
            return Err(document.invalid(place, cause));
        }
    }
    Ok(template)
}
