//! The loops of a study: each algorithm once without a clock, whose level is looked at; then timed runs, the
//! algorithms in turn, so that a slow minute of the machine meets all of them.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::appearance::render::{Render, RenderError};
use crate::appearance::renderer;

use super::evaluate::{EvaluateError, Source, open};
use super::heap;
use super::machine;
use super::own;
use super::process::{End, LEVEL, own_cpu_seconds, run_apart};
use super::record::{AlgorithmFacts, Cell, MeshFacts, Record, RunFacts};
use super::resolve::{Algorithm, Kind, MeshFile, Study, Target};
use super::template::{Template, Values};

/// What is being done, for a person who waits.
#[derive(Clone, Debug, PartialEq)]
pub enum Step<'a> {
    /// A mesh is read and drawn; its number, from 1, of how many.
    Mesh(&'a str, usize, usize),
    /// An algorithm runs for the first time on a mesh and target.
    First(&'a str, &'a str),
    /// Something failed, and the study goes on.
    Failed(&'a str, &'a str, &'a str),
    /// Timed runs of a target begin: how many in all.
    Timed(&'a str, usize),
}

/// One run of one of lodbake's own algorithms, alone in a process: for profilers, and for its resident set.
pub fn level(study: &Study, algorithm: &str, mesh: &str, ratio: f64, out: &Path) -> Result<(), StudyError> {
    let unknown = |name: &str| StudyError::Unknown { name: name.to_owned(), file: study.file.clone() };
    let own = study.algorithms.iter().find_map(|candidate| match &candidate.kind {
        Kind::Own(settings) if candidate.name == algorithm => Some(settings),
        _ => None,
    });
    let settings = own.ok_or_else(|| unknown(algorithm))?;
    let mesh = study.meshes.iter().find(|candidate| candidate.name == mesh).ok_or_else(|| unknown(mesh))?;
    let alone =
        ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| StudyError::Thread(error.to_string()))?;
    let bytes = alone.install(|| own::bake(&mesh.path, settings, ratio))?;
    std::fs::write(out, bytes).map_err(|source| StudyError::Write { path: out.to_owned(), source })
}

/// The study cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// No mesh, or no algorithm of lodbake's own.
    #[error("`{file}` has no mesh and no algorithm of lodbake's own with the name `{name}`")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The study.
        file: String,
    },
    /// The system gives no thread.
    #[error("failed to start a thread: {0}")]
    Thread(String),
    /// The renderer that was asked for cannot be had.
    #[error(transparent)]
    Renderer(#[from] RenderError),
    /// There is no level.
    #[error(transparent)]
    Own(#[from] own::OwnError),
    /// A folder or file of the output.
    #[error("failed to write `{}`: {source}", path.display())]
    Write {
        /// The folder or file.
        path: PathBuf,
        /// From the operating system.
        source: std::io::Error,
    },
}

/// Runs a study and writes its levels below its output folder. What fails is recorded and does not stop it.
pub fn run(study: &Study, tell: &dyn Fn(Step<'_>)) -> Result<Record, StudyError> {
    let targets: Vec<String> = study.targets.iter().map(ToString::to_string).collect();
    let chosen = renderer::open(study.renderer)?;
    let mut record = Record {
        study: study.file.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        machine: machine::description(),
        meshes: Vec::new(),
        algorithms: study.algorithms.iter().map(|algorithm| facts_of(algorithm, study)).collect(),
        targets,
        appearance: study.appearance.clone(),
        size: study.size,
        renderer: chosen.name.clone(),
        baseline: study.baseline,
        cells: Vec::new(),
    };
    let mesh_names = file_names(study.meshes.iter().map(|mesh| mesh.name.as_str()));
    let alone =
        ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| StudyError::Thread(error.to_string()))?;
    let files = file_names(study.algorithms.iter().map(|algorithm| algorithm.name.as_str()));
    for (number, mesh) in study.meshes.iter().enumerate() {
        tell(Step::Mesh(&mesh.name, number + 1, study.meshes.len()));
        let folder = study.output.join("levels").join(&mesh_names[number]);
        let bench =
            Bench { study, renderer: &*chosen.renderer, mesh, folder, files: &files, alone: &alone, number, tell };
        bench.run(&mut record)?;
    }
    Ok(record)
}

fn facts_of(algorithm: &Algorithm, study: &Study) -> AlgorithmFacts {
    let what = match &algorithm.kind {
        Kind::Own(settings) => super::words::of_settings(settings),
        Kind::Command(template) => template.to_string(),
    };
    AlgorithmFacts {
        name: algorithm.name.clone(),
        what,
        is_own: matches!(algorithm.kind, Kind::Own(_)),
        matched: algorithm.matched.map(|index| study.algorithms[index].name.clone()),
    }
}

/// Everything about one mesh.
struct Bench<'a> {
    study: &'a Study,
    /// Draws the views.
    renderer: &'a dyn Render,
    mesh: &'a MeshFile,
    /// For its levels.
    folder: PathBuf,
    /// Stems of the algorithms' files.
    files: &'a [String],
    /// One thread, for own runs.
    alone: &'a ThreadPool,
    number: usize,
    tell: &'a dyn Fn(Step<'_>),
}

/// A run that made a level.
struct Attempt {
    run: RunFacts,
    out: PathBuf,
}

impl Bench<'_> {
    fn run(&self, record: &mut Record) -> Result<(), StudyError> {
        let subject = open(&self.mesh.path, 0).map_err(EvaluateError::from);
        let source = match &subject {
            Ok(subject) => Source::new(self.renderer, subject, self.study.size).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        let error = source.as_ref().err().cloned();
        if let Some(error) = &error {
            (self.tell)(Step::Failed(&self.mesh.name, "", error));
        }
        record.meshes.push(MeshFacts {
            name: self.mesh.name.clone(),
            triangles: source.as_ref().map_or(0, |source| source.triangles),
            vertices: source.as_ref().map_or(0, |source| source.vertices),
            frame_seconds: source.as_ref().ok().and_then(|source| source.frame_seconds),
            error,
        });
        let target_names = file_names(self.study.targets.iter().map(ToString::to_string));
        for (target, asked) in self.study.targets.iter().enumerate() {
            let folder = self.folder.join(&target_names[target]);
            let mut cells = self.cells(target);
            match &source {
                Ok(source) => {
                    std::fs::create_dir_all(&folder)
                        .map_err(|error| StudyError::Write { path: folder.clone(), source: error })?;
                    self.target(*asked, source, &folder, &mut cells);
                }
                Err(_) => {
                    for cell in &mut cells {
                        cell.error = Some("the source cannot be studied".to_owned());
                    }
                }
            }
            record.cells.extend(cells);
        }
        Ok(())
    }

    fn cells(&self, target: usize) -> Vec<Cell> {
        let cell = |algorithm| Cell {
            mesh: self.number,
            target,
            algorithm,
            asked: 0,
            level: None,
            runs: Vec::new(),
            resident_bytes: None,
            error: None,
        };
        (0..self.study.algorithms.len()).map(cell).collect()
    }

    fn target(&self, target: Target, source: &Source<'_>, folder: &Path, cells: &mut [Cell]) {
        let algorithms = &self.study.algorithms;
        // Those that are matched to others need their counts.
        let (after, first): (Vec<usize>, Vec<usize>) =
            (0..algorithms.len()).partition(|&index| algorithms[index].matched.is_some());
        for index in first.into_iter().chain(after) {
            let algorithm = &algorithms[index];
            (self.tell)(Step::First(&algorithm.name, &target.to_string()));
            let asked = asked(algorithm, target, source.triangles, cells);
            let level = asked.and_then(|asked| {
                cells[index].asked = asked;
                if let Kind::Own(_) = algorithm.kind {
                    cells[index].resident_bytes = self.resident(index, source.triangles, asked, folder);
                }
                let attempt = self.attempt(index, source.triangles, asked, folder)?;
                // Own outputs are whole scenes with one level, those of others the level itself.
                let level = usize::from(matches!(algorithm.kind, Kind::Own(_)));
                source.measure(&attempt.out, level).map_err(|error| format!("its level cannot be judged: {error}"))
            });
            match level {
                Ok(level) => cells[index].level = Some(level),
                Err(error) => {
                    (self.tell)(Step::Failed(&self.mesh.name, &algorithm.name, &error));
                    cells[index].error = Some(error);
                }
            }
        }
        let rounds = algorithms.iter().map(|algorithm| algorithm.repetitions).max().unwrap_or(0);
        (self.tell)(Step::Timed(&target.to_string(), rounds));
        for round in 0..rounds {
            for (index, (algorithm, cell)) in algorithms.iter().zip(cells.iter_mut()).enumerate() {
                if cell.level.is_none() || cell.error.is_some() || algorithm.repetitions <= round {
                    continue;
                }
                match self.attempt(index, source.triangles, cell.asked, folder) {
                    Ok(attempt) => cell.runs.push(attempt.run),
                    Err(error) => {
                        let error = format!("timed run {}: {error}", round + 1);
                        (self.tell)(Step::Failed(&self.mesh.name, &algorithm.name, &error));
                        cell.error = Some(error);
                    }
                }
            }
        }
    }

    /// One run. `source` is the number of triangles of the mesh.
    fn attempt(&self, index: usize, source: u64, asked: u64, folder: &Path) -> Result<Attempt, String> {
        let algorithm = &self.study.algorithms[index];
        let out = folder.join(format!("{}.glb", self.files[index]));
        // What an earlier run left is no result of this one.
        match std::fs::remove_file(&out) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(format!("failed to remove `{}`: {error}", out.display()));
            }
            _ => {}
        }
        let ratio = asked as f64 / source as f64;
        let run = match &algorithm.kind {
            Kind::Own(settings) => {
                let (began, before) = (Instant::now(), own_cpu_seconds());
                let (done, heap_bytes) = heap::peak_of(|| {
                    let bake = || own::bake(&self.mesh.path, settings, ratio);
                    let bytes = self.alone.install(bake).map_err(|error| error.to_string())?;
                    std::fs::write(&out, bytes).map_err(|e| format!("failed to write `{}`: {e}", out.display()))
                });
                let wall_seconds = began.elapsed().as_secs_f64();
                let cpu_seconds = before.zip(own_cpu_seconds()).map(|(before, after)| after - before);
                done?;
                RunFacts { wall_seconds, cpu_seconds, resident_bytes: None, heap_bytes }
            }
            Kind::Command(template) => {
                let absolute = |path: &Path| std::path::absolute(path).map_err(|error| error.to_string());
                let (input, written) = (absolute(&self.mesh.path)?, absolute(&out)?);
                let values = Values { source: &input, out: &written, ratio, triangles: asked };
                self.command(template, algorithm, values)?
            }
        };
        Ok(Attempt { run, out })
    }

    /// Largest resident set of lodbake's own run in a process of its own, which is what commands are measured by.
    /// `None` also where the run fails: the one in this process tells why.
    fn resident(&self, index: usize, source: u64, asked: u64, folder: &Path) -> Option<u64> {
        let absolute = |path: &Path| std::path::absolute(path).ok();
        let ratio = (asked as f64 / source as f64).to_string();
        let out = absolute(&folder.join(format!("{}.glb", self.files[index])))?;
        let words: [OsString; 6] = [
            std::env::current_exe().ok()?.into(),
            LEVEL.into(),
            absolute(Path::new(&self.study.file))?.into(),
            self.study.algorithms[index].name.clone().into(),
            self.mesh.name.clone().into(),
            ratio.into(),
        ];
        let words: Vec<OsString> = words.into_iter().chain([out.into()]).collect();
        let run = run_apart(&words, &absolute(Path::new("."))?, self.study.algorithms[index].timeout).ok()?;
        run.peak_bytes.filter(|_| run.end == End::Exit(0))
    }

    fn command(&self, template: &Template, algorithm: &Algorithm, values: Values<'_>) -> Result<RunFacts, String> {
        let folder = if self.study.folder.as_os_str().is_empty() { Path::new(".") } else { &self.study.folder };
        let folder = std::path::absolute(folder).map_err(|error| error.to_string())?;
        let words = template.fill(values);
        let run = run_apart(&words, &folder, algorithm.timeout).map_err(|error| error.to_string())?;
        let told = if run.words.is_empty() { String::new() } else { format!(": {}", last_words(&run.words)) };
        match run.end {
            End::Exit(0) if values.out.is_file() => {}
            End::Exit(0) => return Err(format!("it wrote no `{{out}}`{told}")),
            End::Exit(code) => return Err(format!("exit code {code}{told}")),
            End::Killed => return Err(format!("killed by a signal{told}")),
            End::TimedOut => return Err(format!("took longer than {} s{told}", algorithm.timeout.as_secs_f64())),
        }
        Ok(RunFacts {
            wall_seconds: run.wall_seconds,
            cpu_seconds: run.cpu_seconds,
            resident_bytes: run.peak_bytes,
            heap_bytes: None,
        })
    }
}

/// Triangles to ask for.
fn asked(algorithm: &Algorithm, target: Target, source: u64, cells: &[Cell]) -> Result<u64, String> {
    let Some(other) = algorithm.matched else { return Ok(target.triangles(source)) };
    match &cells[other].level {
        Some(level) => Ok(level.triangles),
        None => Err("the algorithm that it is matched to made no level".to_owned()),
    }
}

/// Longest end of a command's words in a table, in characters.
const MOST_WORDS: usize = 300;

/// The end of what a command said, on one line.
fn last_words(words: &str) -> String {
    let line = words.split_whitespace().collect::<Vec<_>>().join(" ");
    let skipped = line.chars().count().saturating_sub(MOST_WORDS);
    let end: String = line.chars().skip(skipped).collect();
    if skipped == 0 { end } else { format!("…{end}") }
}

/// Letters, digits, dots and dashes; lower case and the rest become dashes.
fn file_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || matches!(c, '.' | '_') { c.to_ascii_lowercase() } else { '-' };
    name.trim_start_matches('.').chars().map(plain).collect()
}

/// Different names for different things.
fn file_names<T: AsRef<str>>(names: impl Iterator<Item = T>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    names
        .enumerate()
        .map(|(number, name)| {
            let plain = file_name(name.as_ref());
            let unique = if taken.contains(&plain) { format!("{plain}-{number}") } else { plain };
            taken.insert(unique.clone());
            unique
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_are_plain_and_different() {
        let names = file_names(["a b", "a/b", "../A.B", "ü"].iter());
        assert_eq!(names, ["a-b", "a-b-1", "-a.b", "ü"]);
    }

    #[test]
    fn last_words_are_one_line() {
        assert_eq!(last_words("a\n  b"), "a b");
        let long = last_words(&"x".repeat(400));
        assert_eq!((long.chars().count(), long.starts_with('…')), (301, true));
    }
}
