//! What a study found: facts without words. Tables, CSV and the page are made from it, and from nothing else.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::appearance::renderer::REFERENCE;

use super::statistics::Summary;

/// The results of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// Path of the study's file as the user wrote it.
    pub study: String,
    /// Version of lodbake.
    pub version: String,
    /// What the times were measured on: system, processor, number of processors.
    pub machine: String,
    /// In the study's order.
    pub meshes: Vec<MeshFacts>,
    /// In the study's order.
    pub algorithms: Vec<AlgorithmFacts>,
    /// As they are told in tables: `0.5`, `1000 triangles`.
    pub targets: Vec<String>,
    /// Pixels a side of each view.
    pub size: u32,
    /// What drew them: `cpu` is the reference; a graphics card is named with its driver.
    #[serde(default = "reference")]
    pub renderer: String,
    /// Values of `d_RMS` for which the triangles needed are told.
    pub appearance: Vec<f64>,
    /// Index of the algorithm that the others are compared with.
    pub baseline: usize,
    /// One for each mesh, target and algorithm, in this order of loops.
    pub cells: Vec<Cell>,
}

/// What drew before there was a choice.
fn reference() -> String {
    REFERENCE.to_owned()
}

/// A source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeshFacts {
    /// No other mesh of the study has this name.
    pub name: String,
    /// Drawn triangles, instances counted each.
    pub triangles: u64,
    /// Drawn vertices.
    pub vertices: u64,
    /// Seconds to draw one view of it.
    pub frame_seconds: Option<Summary>,
    /// Why it could not be studied; then it has no cells with levels.
    pub error: Option<String>,
}

/// An algorithm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlgorithmFacts {
    /// No other algorithm of the study has this name.
    pub name: String,
    /// The command, or lodbake's settings that differ from the defaults.
    pub what: String,
    /// lodbake itself, in the study's process.
    pub is_own: bool,
    /// Name of the algorithm whose counts it is asked for.
    pub matched: Option<String>,
}

/// One algorithm on one mesh with one target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cell {
    /// Index in `meshes`.
    pub mesh: usize,
    /// Index in `targets`.
    pub target: usize,
    /// Index in `algorithms`.
    pub algorithm: usize,
    /// Triangles asked for; 0 if nothing could be asked for.
    pub asked: u64,
    /// The level; `None` if there is none.
    pub level: Option<LevelFacts>,
    /// One for each timed run that succeeded.
    pub runs: Vec<RunFacts>,
    /// Largest resident set of lodbake's own run in a process of its own, in bytes; absent for a command.
    pub resident_bytes: Option<u64>,
    /// Why there is no level, or why runs are missing.
    pub error: Option<String>,
}

/// A level that was made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LevelFacts {
    /// Drawn triangles.
    pub triangles: u64,
    /// Drawn vertices.
    pub vertices: u64,
    /// Root mean square of luminance differences to the source over 24 views, 0…255.
    pub d_rms: f64,
    /// The same for the worst view.
    pub worst_view: f64,
    /// Share of the pixels covered by source or level that only one of them covers, 0…1.
    pub silhouette: f64,
    /// Mean structural similarity over covered pixels; 1 for equal pictures.
    pub ssim: f64,
    /// Distance between the surfaces, both directions, as a fraction of the diagonal of the source's box; absent where
    /// one of them has no area.
    pub distance: Option<DistanceFacts>,
    /// Seconds to draw one view of it.
    pub frame_seconds: Option<Summary>,
}

/// Fractions of the diagonal of the source's bounding box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DistanceFacts {
    /// Mean of both directions' means.
    pub mean: f64,
    /// Larger of both directions' root mean squares.
    pub rms: f64,
    /// Larger of both directions' maxima.
    pub max: f64,
}

/// One timed run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunFacts {
    /// Wall time, in seconds.
    pub wall_seconds: f64,
    /// User and system time, in seconds; absent where the system does not tell.
    pub cpu_seconds: Option<f64>,
    /// Largest resident set of a command, in bytes; absent for lodbake, and where the system does not tell.
    pub resident_bytes: Option<u64>,
    /// Peak heap of lodbake, in bytes; absent for a command.
    pub heap_bytes: Option<u64>,
}

impl Record {
    /// The cell of a mesh, target and algorithm.
    pub fn cell(&self, mesh: usize, target: usize, algorithm: usize) -> &Cell {
        &self.cells[(mesh * self.targets.len() + target) * self.algorithms.len() + algorithm]
    }
}

/// A quantity that is measured of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Triangles asked for.
    Asked,
    /// Triangles reached.
    Triangles,
    /// Vertices of the level.
    Vertices,
    /// Image difference.
    DRms,
    /// Image difference in the worst view.
    WorstView,
    /// Difference of outlines.
    Silhouette,
    /// Structural similarity.
    Ssim,
    /// Mean distance of the surfaces.
    DistanceMean,
    /// Root mean square distance.
    DistanceRms,
    /// Largest distance.
    DistanceMax,
    /// Wall time of a run.
    Wall,
    /// Processor time of a run.
    Cpu,
    /// Largest resident set of a run.
    Resident,
    /// Peak heap of a run.
    Heap,
    /// Renderings per second.
    FramesPerSecond,
}

impl Measure {
    /// In the order of the CSV.
    pub const ALL: [Self; 15] = [
        Self::Asked,
        Self::Triangles,
        Self::Vertices,
        Self::DRms,
        Self::WorstView,
        Self::Silhouette,
        Self::Ssim,
        Self::DistanceMean,
        Self::DistanceRms,
        Self::DistanceMax,
        Self::Wall,
        Self::Cpu,
        Self::Resident,
        Self::Heap,
        Self::FramesPerSecond,
    ];

    /// In the CSV.
    pub fn name(self) -> &'static str {
        match self {
            Self::Asked => "triangles_asked",
            Self::Triangles => "triangles",
            Self::Vertices => "vertices",
            Self::DRms => "d_rms",
            Self::WorstView => "d_rms_worst_view",
            Self::Silhouette => "silhouette",
            Self::Ssim => "ssim",
            Self::DistanceMean => "distance_mean",
            Self::DistanceRms => "distance_rms",
            Self::DistanceMax => "distance_max",
            Self::Wall => "wall",
            Self::Cpu => "cpu",
            Self::Resident => "peak_resident",
            Self::Heap => "peak_heap",
            Self::FramesPerSecond => "frames_per_second",
        }
    }

    /// In the CSV; empty for a pure number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::DRms | Self::WorstView => "luminance, 0 to 255",
            Self::Silhouette => "share of covered pixels",
            Self::DistanceMean | Self::DistanceRms | Self::DistanceMax => "share of the diagonal",
            Self::Wall | Self::Cpu => "s",
            Self::Resident | Self::Heap => "bytes",
            Self::FramesPerSecond => "1/s",
            Self::Asked | Self::Triangles | Self::Vertices | Self::Ssim => "",
        }
    }
}

impl Cell {
    /// All measurements of a quantity; empty if there are none. Frames per second come as a summary:
    /// [`Cell::summary`].
    pub fn values(&self, measure: Measure) -> Vec<f64> {
        let level = |get: fn(&LevelFacts) -> f64| self.level.iter().map(get).collect();
        let distance = |get: fn(&DistanceFacts) -> f64| {
            self.level.iter().filter_map(|level| level.distance.as_ref()).map(get).collect()
        };
        match measure {
            Measure::Asked if self.asked == 0 => Vec::new(),
            Measure::Asked => vec![self.asked as f64],
            Measure::Triangles => level(|level| level.triangles as f64),
            Measure::Vertices => level(|level| level.vertices as f64),
            Measure::DRms => level(|level| level.d_rms),
            Measure::WorstView => level(|level| level.worst_view),
            Measure::Silhouette => level(|level| level.silhouette),
            Measure::Ssim => level(|level| level.ssim),
            Measure::DistanceMean => distance(|distance| distance.mean),
            Measure::DistanceRms => distance(|distance| distance.rms),
            Measure::DistanceMax => distance(|distance| distance.max),
            Measure::Wall => self.runs.iter().map(|run| run.wall_seconds).collect(),
            Measure::Cpu => self.runs.iter().filter_map(|run| run.cpu_seconds).collect(),
            Measure::Resident => {
                let runs = self.runs.iter().filter_map(|run| run.resident_bytes);
                self.resident_bytes.into_iter().chain(runs).map(|bytes| bytes as f64).collect()
            }
            Measure::Heap => self.runs.iter().filter_map(|run| run.heap_bytes.map(|bytes| bytes as f64)).collect(),
            Measure::FramesPerSecond => Vec::new(),
        }
    }

    /// Mean and interval of a quantity.
    pub fn summary(&self, measure: Measure) -> Option<Summary> {
        match measure {
            Measure::FramesPerSecond => self.level.as_ref()?.frame_seconds.and_then(per_second),
            _ => Summary::of(&self.values(measure)),
        }
    }

    /// Mean of a quantity.
    pub fn mean(&self, measure: Measure) -> Option<f64> {
        Some(self.summary(measure)?.mean)
    }
}

/// Renderings per second of seconds per rendering: the ends of the interval change places. The deviation of the
/// reciprocal is that of the first order.
pub fn per_second(seconds: Summary) -> Option<Summary> {
    if seconds.mean <= 0.0 {
        return None;
    }
    let spread = seconds.spread.filter(|spread| 0.0 < spread.low);
    let spread = spread.map(|spread| super::statistics::Spread {
        sd: spread.sd / (seconds.mean * seconds.mean),
        low: 1.0 / spread.high,
        high: 1.0 / spread.low,
    });
    Some(Summary { n: seconds.n, mean: 1.0 / seconds.mean, spread })
}
