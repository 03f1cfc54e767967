//! The instanced-model paper's tables 2 and 3, made again: the same bunny, the same number of copies, each method from file
//! to file, beside the figures as printed.
//!
//! `qem` and `gaps` know no instances and get all copies as one mesh; `ias`, `its-paper` and `its` get the mesh and the
//! transforms. Every run reads an OBJ, simplifies to the paper's share of the vertices (10, 20 and 50 % less, in round
//! numbers) and writes an OBJ of the same dialect. One thread; the runs take turns, so that a slow minute meets all of them; the
//! least time counts, which is the least disturbed. Knows no arguments.

pub mod copies;
pub mod paper;
pub mod table;
pub mod write;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::config::Metric;
use crate::config::SimplifySettings;
use crate::gltf::error::{DocumentError, ReadError};
use crate::mesh::{Mesh, Primitive};
use crate::obj;
use crate::plan::simplify_settings;
use crate::simplify::progressive::Progressive;
use crate::simplify::replay::{Replay, Welded};
use crate::simplify::simplify;
use copies::{Copy, dressed, flattened, single};

/// The methods of table 3, in its order, and lodbake's own.
pub const METHODS: [Metric; 5] = [Metric::Qem, Metric::Gaps, Metric::Ias, Metric::ItsPaper, Metric::Its];

/// Whether a method gets all copies as one mesh.
pub fn is_flattened(metric: Metric) -> bool {
    matches!(metric, Metric::Qem | Metric::Gaps)
}

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum ReproductionError {
    /// The model cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file cannot be written or read back.
    #[error("failed to {what} `{path}`: {cause}")]
    File {
        /// `write` or `read`.
        what: &'static str,
        /// The file.
        path: String,
        /// From the operating system.
        cause: std::io::Error,
    },
    /// The model is not one mesh of triangles.
    #[error("`{path}` has {found} meshes of triangles: one is needed")]
    Meshes {
        /// The file.
        path: String,
        /// How many it has.
        found: usize,
    },
    /// A scene cannot be written as glTF.
    #[error(transparent)]
    Document(#[from] DocumentError),
}

/// One method at one share of vertices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the metric.
    pub method: &'static str,
    /// All copies were one mesh.
    pub flattened: bool,
    /// Percent of the vertices that were asked to go.
    pub percent: u32,
    /// Vertices left for each copy (mean, where all copies are one mesh).
    pub vertices: f64,
    /// Triangles left for each copy.
    pub faces: f64,
    /// Least time from file to file, in milliseconds.
    pub milliseconds: f64,
    /// Least time of the simplification alone, in milliseconds.
    pub simplification: f64,
    /// Bytes of the OBJ.
    pub obj_bytes: usize,
    /// Bytes of the same as GLB.
    pub glb_bytes: usize,
}

/// The same mesh with more and more instances: what stays and what grows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Name of the metric.
    pub method: &'static str,
    /// Instances of the mesh.
    pub instances: usize,
    /// Least time of the simplification, in milliseconds.
    pub simplification: f64,
    /// Least time from file to file, in milliseconds.
    pub milliseconds: f64,
    /// Bytes of the OBJ without the lines of the transforms.
    pub mesh_bytes: usize,
    /// Bytes of those lines.
    pub transform_bytes: usize,
}

/// All of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Record {
    /// Vertices and faces of the model.
    pub source: [usize; 2],
    /// Copies of it.
    pub instances: usize,
    /// Timed runs of each method and share.
    pub repetitions: usize,
    /// Methods × shares.
    pub rows: Vec<Row>,
    /// `its-paper` and `its` with few and with many instances.
    pub growth: Vec<Growth>,
}

/// What to do.
#[derive(Clone, Debug)]
pub struct Options {
    /// Copies of the model.
    pub instances: usize,
    /// Copies of the second scene, which shows what grows.
    pub many: usize,
    /// Timed runs, 1 or more.
    pub repetitions: usize,
    /// Folder for inputs, outputs and tables.
    pub folder: PathBuf,
}

/// Makes both tables. Outputs stay in the folder.
pub fn run(model: &Path, options: &Options, mut tell: impl FnMut(&str)) -> Result<Record, ReproductionError> {
    let mesh = dressed(&primitive(model)?);
    let size = 2.0 * crate::mesh::layout::frame([&mesh]).1;
    let copies = Copy::spread(options.instances, size);
    let folder = Folder(&options.folder);
    let (instanced, flat) = (folder.at("source-instanced"), folder.at("source-flattened"));
    write(&instanced, write::obj(&mesh, &copies).as_bytes())?;
    write(&flat, write::obj(&flattened(&mesh, &copies), &[]).as_bytes())?;
    let mut rows = Vec::new();
    for (percent, [left, _]) in paper::PERCENTS.into_iter().zip(paper::COUNTS) {
        let share = left as f64 / paper::SOURCE[0] as f64;
        let mut runs: Vec<Vec<Run>> = vec![Vec::new(); METHODS.len()];
        for repetition in 0..options.repetitions {
            tell(&format!("-{percent} %: run {} of {}", repetition + 1, options.repetitions));
            for (metric, runs) in METHODS.iter().zip(&mut runs) {
                let (source, copies): (_, &[Copy]) =
                    if is_flattened(*metric) { (&flat, &[]) } else { (&instanced, &copies) };
                let output = folder.at(&format!("{metric}-{percent}"));
                runs.push(from_file_to_file(source, &output, *metric, share, copies)?);
            }
        }
        for (&metric, runs) in METHODS.iter().zip(&runs) {
            rows.push(row(metric, percent, runs, options, &copies, &folder)?);
        }
    }
    let growth = growth(&mesh, size, options, &folder, &mut tell)?;
    let source = [Welded::new(&single(mesh.clone())).positions.len(), mesh.indices.len() / 3];
    Ok(Record { source, instances: options.instances, repetitions: options.repetitions, rows, growth })
}

/// Files of the reproduction.
struct Folder<'a>(&'a Path);

impl Folder<'_> {
    fn at(&self, name: &str) -> PathBuf {
        self.0.join(format!("{name}.obj"))
    }
}

/// One run from file to file.
#[derive(Clone, Debug)]
struct Run {
    milliseconds: f64,
    simplification: f64,
    vertices: usize,
    level: Primitive,
    bytes: usize,
}

fn from_file_to_file(
    source: &Path,
    output: &Path,
    metric: Metric,
    share: f64,
    copies: &[Copy],
) -> Result<Run, ReproductionError> {
    let settings = simplify_settings(&SimplifySettings { metric, ..SimplifySettings::default() });
    let began = Instant::now();
    let mesh = single(primitive(source)?);
    let read = Instant::now();
    let sequence = simplify(&mesh, &settings);
    let (level, vertices) = cut(&mesh, &sequence, share);
    let simplification = read.elapsed();
    let text = write::obj(&level, copies);
    write(output, text.as_bytes())?;
    let milliseconds = began.elapsed().as_secs_f64() * 1e3;
    let simplification = simplification.as_secs_f64() * 1e3;
    Ok(Run { milliseconds, simplification, vertices, level, bytes: text.len() })
}

/// The level with that share of the vertices, and how many they are.
fn cut(mesh: &Mesh, sequence: &Progressive, share: f64) -> (Primitive, usize) {
    let welded = Welded::new(mesh);
    let mut replay = Replay::new(mesh, &welded, sequence);
    let source = welded.positions.len();
    let wanted = (source as f64 * share).round() as usize;
    // Each step takes one vertex away.
    replay.advance(source - wanted);
    let cut = replay.primitives().swap_remove(0);
    let own = replay.vertices(0, &cut);
    let mut used: Vec<u32> = replay.triangles(&cut).flatten().collect();
    used.sort_unstable();
    used.dedup();
    let level = Primitive { count: own.count, attributes: own.attributes, targets: Vec::new(), indices: cut.indices };
    (level, used.len())
}

fn row(
    metric: Metric,
    percent: u32,
    runs: &[Run],
    options: &Options,
    copies: &[Copy],
    folder: &Folder,
) -> Result<Row, ReproductionError> {
    let last = runs.last().expect("at least one repetition");
    let parts = if is_flattened(metric) { options.instances as f64 } else { 1.0 };
    let glb = write::glb(&last.level, if is_flattened(metric) { &[] } else { copies })?;
    let name = format!("{metric}-{percent}");
    write(&folder.at(&name).with_extension("glb"), &glb)?;
    if !is_flattened(metric) {
        // The same scene as a reader without instances needs it.
        let all = flattened(&last.level, copies);
        write(&folder.at(&format!("{name}-flattened")), write::obj(&all, &[]).as_bytes())?;
        write(&folder.at(&format!("{name}-flattened")).with_extension("glb"), &write::glb(&all, &[])?)?;
    }
    Ok(Row {
        method: metric.name(),
        flattened: is_flattened(metric),
        percent,
        vertices: last.vertices as f64 / parts,
        faces: last.level.indices.len() as f64 / 3.0 / parts,
        milliseconds: least(runs, |run| run.milliseconds),
        simplification: least(runs, |run| run.simplification),
        obj_bytes: last.bytes,
        glb_bytes: glb.len(),
    })
}

/// Half of the vertices go, with few and with many instances.
fn growth(
    mesh: &Primitive,
    size: f64,
    options: &Options,
    folder: &Folder,
    tell: &mut impl FnMut(&str),
) -> Result<Vec<Growth>, ReproductionError> {
    let mut out = Vec::new();
    for metric in [Metric::ItsPaper, Metric::Its] {
        for instances in [options.instances, options.many] {
            tell(&format!("{metric} with {instances} instances"));
            let copies = Copy::spread(instances, size);
            let source = folder.at(&format!("source-{instances}"));
            write(&source, write::obj(mesh, &copies).as_bytes())?;
            let output = folder.at(&format!("{metric}-{instances}-instances"));
            let runs: Vec<Run> = (0..options.repetitions)
                .map(|_| from_file_to_file(&source, &output, metric, 0.5, &copies))
                .collect::<Result<_, _>>()?;
            let mesh_bytes = write::obj(&runs[0].level, &[]).len();
            out.push(Growth {
                method: metric.name(),
                instances,
                simplification: least(&runs, |run| run.simplification),
                milliseconds: least(&runs, |run| run.milliseconds),
                mesh_bytes,
                transform_bytes: runs[0].bytes - mesh_bytes,
            });
        }
    }
    Ok(out)
}

/// The triangles of a file with one mesh.
fn primitive(path: &Path) -> Result<Primitive, ReproductionError> {
    let scene = obj::read_any(path)?;
    let mut all = scene.meshes.iter().flat_map(|mesh| mesh.triangle_primitives().map(|(_, primitive)| primitive));
    match (all.next(), all.count()) {
        (Some(primitive), 0) => Ok(primitive.clone()),
        (first, more) => {
            let found = usize::from(first.is_some()) + more;
            Err(ReproductionError::Meshes { path: path.display().to_string(), found })
        }
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), ReproductionError> {
    let fail = |cause| ReproductionError::File { what: "write", path: path.display().to_string(), cause };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(fail)?;
    }
    fs::write(path, bytes).map_err(fail)
}

fn least(runs: &[Run], time: impl Fn(&Run) -> f64) -> f64 {
    runs.iter().map(time).fold(f64::INFINITY, f64::min)
}
