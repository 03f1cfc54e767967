//! Reads every scene of the corpus: valid ones must be read, broken ones refused with a reason, and nothing may
//! panic, hang or ask for absurd amounts of memory.

mod corpus;

use corpus::{corpus, scenes};
use lodbake::gltf::document::{Container, Document};
use lodbake::gltf::error::ReadCause;
use lodbake::gltf::read;
use lodbake::gltf::scene::{Scene, SourcePrimitive};
use lodbake::identify::inventory::Inventory;
use lodbake::identify::survey;
use lodbake::mesh::Primitive;
use lodbake::obj;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// `(scenes, meshes, triangle primitives, passed-through primitives, triangles)` of a folder, and what was refused.
fn read_folder(folder: &Path) -> ([usize; 5], String) {
    let mut sums = [0; 5];
    let mut refused = String::new();
    for path in scenes(folder) {
        let start = Instant::now();
        let result = read::read(&path);
        assert!(start.elapsed() < Duration::from_secs(60), "`{}` took {:?}", path.display(), start.elapsed());
        match result {
            Ok(scene) => add(&mut sums, &scene),
            Err(error) => {
                let name = path.file_name().unwrap().to_string_lossy();
                let ReadCause::Document(fault) = error.cause else { panic!("{error}") };
                writeln!(refused, "{name}: {fault}").unwrap();
            }
        }
    }
    (sums, refused)
}

fn add(sums: &mut [usize; 5], scene: &Scene) {
    sums[0] += 1;
    sums[1] += scene.meshes.len();
    for primitive in scene.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        match primitive {
            SourcePrimitive::Triangles(primitive) => {
                check_primitive(primitive);
                sums[2] += 1;
                sums[4] += primitive.triangles();
            }
            SourcePrimitive::PassThrough { .. } => sums[3] += 1,
        }
    }
    check_vertex_maps(scene);
}

/// What every later stage relies on.
fn check_primitive(primitive: &Primitive) {
    assert!(primitive.indices.len().is_multiple_of(3) && !primitive.indices.is_empty());
    assert!(primitive.indices.iter().all(|&i| (i as usize) < primitive.count));
    for attributes in std::iter::once(&primitive.attributes).chain(&primitive.targets) {
        assert!(attributes.windows(2).all(|pair| pair[0].name < pair[1].name));
        for attribute in attributes {
            assert_eq!(attribute.values.len(), primitive.count * attribute.components, "{}", attribute.name);
            assert!(attribute.values.iter().all(|v| v.is_finite()), "{}", attribute.name);
        }
    }
    assert_eq!(primitive.positions().len(), primitive.count);
}

fn check_vertex_maps(scene: &Scene) {
    for mesh in &scene.meshes {
        for (i, primitive) in mesh.triangle_primitives() {
            if let Some(map) = mesh.vertex_maps.get(&i) {
                assert_eq!(map.len(), primitive.count);
            }
        }
    }
}

#[test]
fn valid_scenes_are_read_and_only_invalid_ones_refused() {
    let Some(corpus) = corpus() else { return };
    let (sums, refused) = read_folder(&corpus.join("quality"));
    assert_eq!((sums, refused.as_str()), ([11, 18, 26, 0, 570_861], ""));
    let (sums, refused) = read_folder(&corpus.join("scenes"));
    assert_eq!((sums, refused.as_str()), ([29, 1238, 1288, 1, 966_200], ""));
    let (sums, refused) = read_folder(&corpus.join("features"));
    assert_eq!(sums, [84, 215, 187, 42, 285_013]);
    assert_eq!(
        refused,
        "\
unresolved_channel_target.gltf: animations[0].channels[0].target.node: node 0 does not exist (there are 0)
unresolved_morph_positions.gltf: meshes[0].primitives[0].targets[0].POSITION: accessor 2 does not exist (there are 1)
"
    );
}

#[test]
fn malformed_scenes_are_refused_with_a_reason_or_read() {
    let Some(corpus) = corpus() else { return };
    let (sums, refused) = read_folder(&corpus.join("malformed"));
    assert_eq!(sums, [119, 33, 0, 37, 0]);
    insta::assert_snapshot!(refused);
}

/// Least and greatest corner.
fn bounds(positions: impl Iterator<Item = [f32; 3]>) -> [[f32; 3]; 2] {
    positions.fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], p| {
        [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
    })
}

fn triangles(scene: &Scene, mesh: usize) -> &Primitive {
    scene.meshes[mesh].triangle_primitives().next().unwrap().1
}

/// The same duck, quantised to fewer and fewer bits, with and without filters.
#[test]
fn compressed_ducks_are_the_duck() {
    let Some(corpus) = corpus() else { return };
    let original = read::read(&corpus.join("quality/duck/Duck.glb")).unwrap();
    let original = triangles(&original, 0);
    let original_normals = normals(original);
    let ducks: Vec<PathBuf> =
        scenes(&corpus.join("features")).into_iter().filter(|p| p.to_string_lossy().contains("Duck-vp")).collect();
    assert_eq!(ducks.len(), 3);
    for path in ducks {
        let scene = read::read(&path).unwrap();
        let duck = triangles(&scene, 0);
        assert_eq!((duck.triangles(), duck.count), (original.triangles(), original.count));
        let node = &scene.document.json["nodes"][0];
        let number = |key: &str, k: usize| node[key][k].as_f64().unwrap() as f32;
        let placed =
            |p: [f32; 3]| std::array::from_fn(|k| (p[k] * number("scale", k) + number("translation", k)) * 100.0);
        let positions: Vec<[f32; 3]> = duck.positions().iter().map(|&p| placed(p)).collect();
        // Half a step of the coarsest grid, in the original's units.
        let step = number("scale", 0) * 100.0;
        let (found, wanted) = (bounds(positions.iter().copied()), bounds(original.positions().iter().copied()));
        for (found, wanted) in found.as_flattened().iter().zip(wanted.as_flattened()) {
            assert!((found - wanted).abs() <= step, "{found} {wanted} {}", path.display());
        }
        // Every vertex has one of the original's within a step, with nearly the same normal.
        for (position, normal) in positions.iter().zip(normals(duck)).step_by(7) {
            let near = |other: &[f32; 3]| (0..3).all(|k| (other[k] - position[k]).abs() <= step);
            let along = |other: &[f32; 3]| (0..3).map(|k| other[k] * normal[k]).sum::<f32>() > 0.9;
            let found = original.positions().iter().zip(&original_normals).any(|(p, n)| near(p) && along(n));
            assert!(found, "{position:?} {normal:?} {}", path.display());
        }
    }
}

/// Of unit length: the packed ducks' are shorter in the file.
fn normals(primitive: &Primitive) -> Vec<[f32; 3]> {
    let normals = primitive.attribute("NORMAL").unwrap();
    let unit = |n: &[f32]| {
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        [n[0] / length, n[1] / length, n[2] / length]
    };
    normals.values.chunks(normals.components).map(unit).collect()
}

#[test]
fn a_draco_saw_is_the_saw() {
    let Some(corpus) = corpus() else { return };
    let plain = read::read(&corpus.join("scenes/saw/ReciprocatingSaw.glb")).unwrap();
    let folder = scenes(&corpus.join("features"));
    let draco = folder.iter().find(|p| p.ends_with("ReciprocatingSaw.gltf")).unwrap();
    let draco = read::read(draco).unwrap();
    assert_eq!(draco.meshes.len(), plain.meshes.len());
    for mesh in 0..plain.meshes.len() {
        let (found, wanted) = (triangles(&draco, mesh), triangles(&plain, mesh));
        assert_eq!(found.triangles(), wanted.triangles(), "mesh {mesh}");
        let [found, wanted] = [found, wanted].map(|p| bounds(p.positions().iter().copied()));
        let size = (0..3).map(|k| wanted[1][k] - wanted[0][k]).fold(0.0, f32::max);
        for (found, wanted) in found.as_flattened().iter().zip(wanted.as_flattened()) {
            assert!((found - wanted).abs() <= size / 1000.0, "mesh {mesh}: {found} {wanted}");
        }
    }
}

/// A small generator of our own: the same changes on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % limit.max(1)
    }
}

/// One small scene of each kind in `features`.
fn one_of_each(corpus: &Path) -> Vec<PathBuf> {
    let mut kinds = std::collections::BTreeMap::new();
    for path in scenes(&corpus.join("features")) {
        let kind = path.parent().unwrap().file_name().unwrap().to_string_lossy().split("--").next().unwrap().to_owned();
        let size = std::fs::metadata(&path).unwrap().len();
        let smallest = kinds.entry(kind).or_insert((u64::MAX, PathBuf::new()));
        if size < smallest.0 {
            *smallest = (size, path);
        }
    }
    kinds.into_values().filter(|(size, _)| *size < 100_000).map(|(_, path)| path).collect()
}

/// Damages text or data at random: single bytes, cuts, or numbers made huge.
fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    match random.below(4) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => {
            for _ in 0..=random.below(8) {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
        }
        _ => {
            let digits: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i].is_ascii_digit()).collect();
            if let Some(&at) = digits.get(random.below(digits.len())) {
                let numbers = ["-1", "0", "7", "255", "4294967295", "1000000000000", "18446744073709551615", "1e300"];
                bytes.splice(at..=at, numbers[random.below(numbers.len())].bytes());
            }
        }
    }
}

/// The document as a GLB with the right lengths, so that damage reaches what lies behind the header.
fn assemble(json: &[u8], bin: Option<&[u8]>) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, data) in [(*b"JSON", Some(json)), (*b"BIN\0", bin)] {
        let Some(data) = data else { continue };
        chunks.extend((data.len() as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend_from_slice(data);
    }
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((chunks.len() as u32 + 12).to_le_bytes());
    glb.extend(chunks);
    glb
}

#[test]
fn damaged_scenes_never_panic() {
    let Some(corpus) = corpus() else { return };
    let mut random = Random(2026);
    let files = one_of_each(&corpus);
    assert!(files.len() >= 20, "{}", files.len());
    let mut still_read = 0;
    for path in files {
        let bytes = std::fs::read(&path).unwrap();
        let base = path.parent().unwrap();
        let document = Document::parse(&bytes);
        for round in 0..60 {
            let damaged = match &document {
                Ok(document) if round % 10 != 0 && document.container == Container::Glb => {
                    let mut json = document.to_gltf_bytes();
                    let mut bin = document.bin.as_deref().map(<[u8]>::to_vec);
                    match &mut bin {
                        Some(bin) if random.below(2) == 0 => damage(bin, &mut random),
                        _ => damage(&mut json, &mut random),
                    }
                    assemble(&json, bin.as_deref())
                }
                _ => {
                    let mut bytes = bytes.clone();
                    damage(&mut bytes, &mut random);
                    bytes
                }
            };
            let start = Instant::now();
            still_read += usize::from(read::read_bytes(&damaged, base).is_ok());
            assert!(start.elapsed() < Duration::from_secs(20), "`{}` round {round}", path.display());
        }
    }
    // Damage to colours or names goes unnoticed, most other damage does not; neither extreme would test anything.
    assert!(still_read > 50, "{still_read}");
}

#[test]
fn obj_files_are_read() {
    let Some(corpus) = corpus() else { return };
    let scene = obj::read(&corpus.join("obj/bunny-2503.obj")).unwrap();
    assert_eq!((scene.meshes.len(), scene.meshes[0].triangles(), triangles(&scene, 0).count), (1, 4968, 2503));
    check_primitive(triangles(&scene, 0));
}

#[test]
fn repeated_meshes_are_found() {
    let Some(corpus) = corpus() else { return };
    let mut inventory = Inventory::default();
    let mut distinct = |name: &str| {
        let scene = read::read(&corpus.join("scenes").join(name)).unwrap();
        let found = survey(&scene).unwrap();
        inventory.add(name, &found);
        let mut hashes: Vec<_> = found.iter().map(|o| o.hash).collect();
        hashes.sort_unstable();
        hashes.dedup();
        (found.len(), hashes.len(), found.iter().map(|o| o.instances).sum::<u64>())
    };
    assert_eq!(distinct("many-cubes/many-cubes.gltf"), (501, 1, 501));
    assert_eq!(distinct("teapots/teapots_galore.gltf"), (2, 2, 1900));
    assert_eq!(distinct("chess-board/chess-board.glb"), (8, 8, 8));
    assert_eq!(distinct("milk-truck/CesiumMilkTruck.glb"), (2, 2, 3));
    assert_eq!(distinct("gearbox/GearboxAssy.gltf"), (42, 31, 95));
    let totals = inventory.totals();
    assert_eq!((totals.declared, totals.distinct, totals.instances), (555, 44, 2507));
    assert_eq!((totals.triangles_declared, totals.triangles_distinct), (601_014, 405_736));
}
