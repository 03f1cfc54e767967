//! The three works that are compared, each on one mesh and in one thread.

use lodbake::lod::{ChainSettings, Ground, Part, Refit, Source, Storage, Target, chain};
use lodbake::mesh::Mesh;
use lodbake::mesh::layout::{AttributeScale, frame};
use lodbake::metric::Placement;
use lodbake::metric::its::EdgeWeights;
use lodbake::simplify::progressive::Progressive;
use lodbake::simplify::replay::{Replay, Welded};
use lodbake::simplify::{MetricKind, Settings, simplify};
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify_with_attributes_and_locks};

use crate::assets::Asset;
use crate::clock::now;

/// Shares of the source's triangles.
const RATIOS: [f64; 4] = [0.5, 0.25, 0.1, 0.05];

/// Weights that meshoptimizer is given: as gltfpack for normals; texture coordinates as much again.
const PEER_WEIGHTS: [f32; 5] = [0.5, 0.5, 0.5, 1.0, 1.0];

/// One way to make the chain.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// lodbake, effort `fast`.
    Fast,
    /// lodbake, effort `balanced`.
    Balanced,
    /// meshoptimizer.
    Peer,
}

/// What one run took, in seconds, and made.
pub struct Report {
    /// Weld, topology, contractions.
    pub sequence: f64,
    /// Replay, triangles and vertices of the levels.
    pub levels_secs: f64,
    /// Measured errors.
    pub measure: f64,
    /// Triangles and distance from the source in radii, of each level.
    pub levels: Vec<(usize, f64)>,
}

impl Report {
    /// Seconds in sum.
    pub fn total(&self) -> f64 {
        self.sequence + self.levels_secs + self.measure
    }
}

impl Work {
    /// All; the peer is last.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Peer];

    /// As it is printed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Peer => "meshopt",
        }
    }

    /// Makes the chain once.
    pub fn run(self, asset: &Asset) -> Report {
        match self {
            Self::Peer => peer(asset),
            Self::Fast => own(&asset.mesh, false),
            Self::Balanced => own(&asset.mesh, true),
        }
    }
}

fn own(mesh: &Mesh, memoryless: bool) -> Report {
    // The defaults of pipeline.toml.
    let settings = Settings {
        metric: MetricKind::Its,
        placement: Placement::Optimal,
        attributes: AttributeScale { normal: 0.003, texcoord: 0.3, color: 0.1 },
        edges: EdgeWeights { border: 1.0, seam: 0.3, crease: 0.04 },
        lock_border: false,
        memoryless,
        by_visibility: memoryless,
    };
    let targets = RATIOS.map(Target::Ratio).to_vec();
    let settings_of_chain = ChainSettings { targets, storage: Storage::Smallest, vertex_cache: true };
    let began = now();
    let sequence = simplify(mesh, &settings);
    let simplified = now();
    let ground = Ground::new(mesh);
    let part = Part {
        ground: &ground,
        sequence: Some(&sequence),
        shareable: false,
        refit: if settings.memoryless { Refit::Coarse } else { Refit::Never },
        hold_borders: false,
    };
    let chain = chain(&[part], &settings_of_chain, None);
    let chained = now();
    let levels = chain.levels.iter().map(|level| (level.triangles, level.error / frame(&mesh.primitives).1)).collect();
    let measure = measure(mesh, &sequence);
    Report { sequence: simplified - began, levels_secs: chained - simplified - measure, measure, levels }
}

/// Measures the levels once more, to know its share of the chain.
fn measure(mesh: &Mesh, sequence: &Progressive) -> f64 {
    let welded = Welded::new(mesh);
    let mut replay = Replay::new(mesh, &welded, sequence);
    let mut began = now();
    let source = Source::new(mesh, &welded);
    let mut spent = now() - began;
    for ratio in RATIOS {
        replay.advance(sequence.cut_at((mesh.triangles() as f64 * ratio).round() as usize));
        let cuts = replay.primitives();
        began = now();
        std::hint::black_box(source.deviation(&replay, &cuts));
        spent += now() - began;
    }
    spent
}

fn peer(asset: &Asset) -> Report {
    let flat = &asset.flat;
    let positions: &[u8] = bytemuck::cast_slice(&flat.positions);
    let vertices = VertexDataAdapter::new(positions, 12, 0).expect("rows of twelve bytes");
    let free = vec![false; flat.positions.len()];
    let mut levels = Vec::new();
    let mut indices = Vec::new();
    let began = now();
    for ratio in RATIOS {
        let target = (flat.indices.len() as f64 / 3.0 * ratio).round() as usize * 3;
        let from = if indices.is_empty() { &flat.indices } else { &indices };
        indices = simplify_with_attributes_and_locks(
            from,
            &vertices,
            bytemuck::cast_slice(&flat.attributes),
            &PEER_WEIGHTS,
            size_of_val(&PEER_WEIGHTS),
            &free,
            target,
            f32::MAX,
            SimplifyOptions::None,
            None,
        );
        levels.push((indices.len() / 3, f64::NAN));
    }
    Report { sequence: now() - began, levels_secs: 0.0, measure: 0.0, levels }
}
