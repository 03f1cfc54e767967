//! Simplifies every mesh of the corpus, all primitives of a mesh together, and checks what every level must be.

mod corpus;

use std::path::Path;

use corpus::{corpus, scenes};
use lodbake::gltf::read;
use lodbake::gltf::scene::SourceMesh;
use lodbake::lod::{ChainSettings, Ground, Part, Refit, Storage, Target, chain};
use lodbake::mesh::layout::AttributeScale;
use lodbake::mesh::{Attribute, Level, LevelVertices, Mesh};
use lodbake::metric::Placement;
use lodbake::metric::its::EdgeWeights;
use lodbake::simplify::{MetricKind, Settings, simplify};
use rayon::prelude::*;

fn settings(metric: MetricKind, placement: Placement) -> Settings {
    let attributes = AttributeScale { normal: 0.003, texcoord: 0.3, color: 0.1 };
    let edges = EdgeWeights { border: 1.0, seam: 0.3, crease: 0.04 };
    Settings { metric, placement, attributes, edges, lock_border: false, memoryless: true, by_visibility: true }
}

#[test]
fn every_level_of_every_mesh_is_sound() {
    let Some(corpus) = corpus() else { return };
    let folders = ["features", "quality", "scenes"];
    let files: Vec<_> = folders.iter().flat_map(|folder| scenes(&corpus.join(folder))).collect();
    let meshes: usize =
        files.par_iter().map(|file| read::read(file).map_or(0, |scene| check_all(file, &scene.meshes))).sum();
    assert!(meshes > 1000, "only {meshes} meshes were read");
}

fn check_all(file: &Path, meshes: &[SourceMesh]) -> usize {
    for source in meshes {
        let primitives = source.triangle_primitives().map(|(_, p)| p.clone()).collect();
        let mesh = Mesh { primitives };
        if 0 < mesh.triangles() {
            for (metric, placement) in [(MetricKind::Its, Placement::Optimal), (MetricKind::Qem, Placement::Subset)] {
                let place = format!("{}: meshes[{}] {metric:?}", file.display(), source.index);
                check(&place, &mesh, &settings(metric, placement));
            }
        }
    }
    meshes.len()
}

fn check(place: &str, mesh: &Mesh, settings: &Settings) {
    let sequence = simplify(mesh, settings);
    let shareable = settings.placement == Placement::Subset;
    let ground = Ground::new(mesh);
    let part = Part {
        ground: &ground,
        sequence: Some(&sequence),
        shareable,
        refit: if shareable { Refit::Never } else { Refit::Coarse },
        hold_borders: false,
    };
    let targets = vec![Target::Ratio(0.5), Target::Ratio(0.1), Target::Triangles(12)];
    let chain = chain(
        &[part],
        &ChainSettings { targets: targets.clone(), storage: Storage::Smallest, vertex_cache: true },
        None,
    );
    let mut finer = mesh.triangles();
    for level in &chain.levels {
        let part = level.parts[0].as_ref().expect("the part has a sequence");
        assert_eq!(part.triangles(), level.triangles, "{place}");
        assert!(0 < level.triangles && level.triangles < finer, "{place}: {} after {finer}", level.triangles);
        finer = level.triangles;
        let asked = match targets[level.target] {
            Target::Ratio(ratio) => (mesh.triangles() as f64 * ratio).round() as usize,
            Target::Triangles(triangles) => triangles,
            _ => 0,
        };
        if level.stop == lodbake::lod::Stop::Target {
            assert!(level.triangles <= asked.max(1), "{place}: {} for {asked}", level.triangles);
        }
        assert!(level.error.is_finite() && 0.0 <= level.error, "{place}: error {}", level.error);
        check_level(place, mesh, part);
    }
}

fn check_level(place: &str, mesh: &Mesh, level: &Level) {
    for (source, primitive) in mesh.primitives.iter().zip(&level.primitives) {
        let LevelVertices::Own(own) = &primitive.vertices else {
            assert!(primitive.indices.iter().all(|&i| (i as usize) < source.count), "{place}: index out of range");
            continue;
        };
        assert!(primitive.indices.iter().all(|&i| (i as usize) < own.count), "{place}: index out of range");
        let names: Vec<&str> = own.attributes.iter().map(|a| a.name.as_str()).collect();
        let expected: Vec<&str> = source.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, expected, "{place}");
        assert_eq!(own.targets.len(), source.targets.len(), "{place}");
        for (found, expected) in own.attributes.iter().zip(&source.attributes) {
            assert_eq!((found.components, found.format), (expected.components, expected.format), "{place}");
            check_attribute(place, found, own.count, expected);
        }
    }
}

fn check_attribute(place: &str, found: &Attribute, count: usize, source: &Attribute) {
    let name = &found.name;
    assert_eq!(found.values.len(), count * found.components, "{place}: {name}");
    assert!(found.values.iter().all(|v| v.is_finite()), "{place}: {name} is not finite");
    let rows = || found.values.chunks_exact(found.components);
    match name.as_str() {
        "NORMAL" => assert!(rows().all(|n| (length(n) - 1.0).abs() < 1e-3), "{place}: normals are not unit vectors"),
        "TANGENT" => {
            assert!(rows().all(|t| (length(&t[..3]) - 1.0).abs() < 1e-3), "{place}: tangents are not unit vectors");
            assert!(rows().all(|t| t[3].abs() == 1.0), "{place}: handedness is not ±1");
        }
        "POSITION" => {
            let reach = |values: &[f32]| values.iter().fold(0.0f32, |a, v| a.max(v.abs()));
            assert!(reach(&found.values) <= 4.0 * reach(&source.values) + 1e-6, "{place}: a vertex flew away");
        }
        name if name.starts_with("JOINTS_") => {
            let most = source.values.iter().copied().fold(0.0, f32::max);
            assert!(found.values.iter().all(|&j| j <= most && j.fract() == 0.0), "{place}: joint out of range");
        }
        "WEIGHTS_0" => {
            let sums = |a: &Attribute| a.values.chunks_exact(4).all(|w| (w.iter().sum::<f32>() - 1.0).abs() < 0.02);
            assert!(!sums(source) || sums(found), "{place}: weights do not sum to 1");
        }
        _ => {}
    }
}

fn length(v: &[f32]) -> f32 {
    v.iter().map(|x| x * x).sum::<f32>().sqrt()
}
