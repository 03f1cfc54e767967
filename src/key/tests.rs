//! Which part of a key each change moves.

use super::*;
use crate::config::{ChainSettings, Pipeline, SceneSettings};
use crate::mesh::hash::MeshHash;

fn settings(rest: &str) -> SceneSettings {
    Pipeline::parse(&format!("input = 'in'\noutput = 'out'\n{rest}"), "pipeline.toml").unwrap().settings()
}

/// A sequence and how it is cut, as `plan` writes it.
struct Chain<'a> {
    sequence: SequenceJob<'a>,
    chain: &'a ChainSettings,
}

impl Manifest for Chain<'_> {
    fn write(&self, to: &mut dyn ManifestWriter) {
        to.hash("sequence", &key_of(&self.sequence).0);
        write_chain(self.chain, to);
    }
}

/// Keys of sequence, chain and scene.
fn keys(settings: &SceneSettings, parts: MeshParts) -> [JobKey; 3] {
    let sequence = SequenceJob { mesh: MeshHash([7; 32]), parts, simplify: &settings.simplify };
    [key_of(&sequence), key_of(&Chain { sequence, chain: &settings.chain }), key_of(settings)]
}

/// Which of the three keys change with these lines, and what `explain` says of it.
fn effect(base: &str, changed: &str, parts: MeshParts) -> (Vec<&'static str>, String) {
    let (before, after) = (settings(base), settings(changed));
    let changed = std::iter::zip(keys(&before, parts), keys(&after, parts));
    let names = changed.zip(["sequence", "chain", "scene"]).filter(|((a, b), _)| a != b).map(|(_, name)| name);
    let told = diff(&fields_of(&before), &fields_of(&after));
    (names.collect(), told.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
}

const ALL: &[&str] = &["sequence", "chain", "scene"];
const LEVELS: &[&str] = &["chain", "scene"];
const SCENE: &[&str] = &["scene"];

/// Every setting of a scene, another value for it, and the keys that it must change.
const CASES: [(&str, &[&str], &str); 31] = [
    (
        "simplify.metric = 'qem'",
        ALL,
        "simplify.metric: its -> qem; simplify.normal: 0.003 -> (none); simplify.texcoord: 0.3 -> (none); simplify.color: 0.1 -> (none); simplify.seam: 0.3 -> (none); simplify.crease: 0.04 -> (none)",
    ),
    ("simplify.effort = 'fast'", ALL, "simplify.effort: balanced -> fast"),
    ("simplify.normal = 0.01", ALL, "simplify.normal: 0.003 -> 0.01"),
    ("simplify.texcoord = 0", ALL, "simplify.texcoord: 0.3 -> 0.0"),
    ("simplify.color = 1e-7", ALL, "simplify.color: 0.1 -> 1e-7"),
    ("simplify.border = 0.30000000000000004", ALL, "simplify.border: 1.0 -> 0.30000000000000004"),
    ("simplify.seam = 2", ALL, "simplify.seam: 0.3 -> 2.0"),
    ("simplify.crease = 2", ALL, "simplify.crease: 0.04 -> 2.0"),
    ("simplify.placement = 'subset'", ALL, "simplify.placement: auto -> subset"),
    ("simplify.lock_border = true", ALL, "simplify.lock_border: false -> true"),
    ("simplify.min_triangles = 65", SCENE, "simplify.min_triangles: 64 -> 65"),
    ("storage = 'compact'", LEVELS, "storage: smallest -> compact"),
    ("vertex_cache = false", LEVELS, "vertex_cache: true -> false"),
    ("lod = [{ ratio = 0.5 }, { ratio = 0.25 }]", LEVELS, "lod[2].ratio: 0.1 -> (none)"),
    (
        "lod = [{ triangles = 1 }, { ratio = 0.25 }, { error = 0.1 }]",
        LEVELS,
        "lod[0].triangles: (none) -> 1; lod[2].error: (none) -> 0.1; lod[2].unit: (none) -> radius; lod[0].ratio: 0.5 -> (none); lod[2].ratio: 0.1 -> (none)",
    ),
    (
        "lod = [{ ratio = 0.5, coverage = 0.5 }, { ratio = 0.25, coverage = 0.25 }, { ratio = 0.1, coverage = 0.1 }]",
        SCENE,
        "lod[0].coverage: (none) -> 0.5; lod[1].coverage: (none) -> 0.25; lod[2].coverage: (none) -> 0.1",
    ),
    (
        "simplify = { metric = 'auto', candidates = 5 }",
        ALL,
        "simplify.metric: its -> auto; simplify.candidates: (none) -> 5; look_size: 64 -> 128",
    ),
    (
        "lod = [{ ratio = 0.5 }, { pixels = 1, size = 300 }, { appearance = 4 }]",
        LEVELS,
        "lod[1].pixels: (none) -> 1.0; lod[1].size: (none) -> 300.0; lod[2].appearance: (none) -> 4.0; look_size: 64 -> 128; lod[1].ratio: 0.25 -> (none); lod[2].ratio: 0.1 -> (none)",
    ),
    (
        "lod = [{ ratio = 0.5 }, { scene_ratio = 0.25 }, { scene_triangles = 1000 }]",
        LEVELS,
        "lod[1].scene_ratio: (none) -> 0.25; lod[2].scene_triangles: (none) -> 1000; share_version: (none) -> 1; lod[1].ratio: 0.25 -> (none); lod[2].ratio: 0.1 -> (none)",
    ),
    (
        "lod = [{ ratio = 0.5 }, { ratio = 0.25 }, { scene_bytes = 500 }]\nscene = { cameras = [[1, 2, 3]], distances = [4] }",
        LEVELS,
        "lod[2].scene_bytes: (none) -> 500; share_version: (none) -> 1; scene.cameras[0].x: (none) -> 1.0; scene.cameras[0].y: (none) -> 2.0; scene.cameras[0].z: (none) -> 3.0; scene.distances[0]: (none) -> 4.0; lod[2].ratio: 0.1 -> (none)",
    ),
    ("appearance.record = false", SCENE, "record_looks: true -> false; look_size: 64 -> (none)"),
    ("appearance.size = 256", SCENE, "look_size: 64 -> 256"),
    (
        "simplify.metric = 'auto'",
        ALL,
        "simplify.metric: its -> auto; simplify.candidates: (none) -> 3; look_size: 64 -> 128",
    ),
    (
        "instances = { recover = 'similar', tolerance = 1e-4 }",
        SCENE,
        "instances.recover: (none) -> similar; instances.tolerance: (none) -> 0.0001",
    ),
    (
        "instances = { recover = 'rigid', split = true }",
        SCENE,
        "instances.recover: (none) -> rigid; instances.tolerance: (none) -> 1e-5; instances.split: (none) -> true",
    ),
    (
        "instances = { instancing = 'gpu', cell = 20, names = 'drop', required = false }",
        SCENE,
        "instances.tolerance: (none) -> 1e-5; instances.instancing: (none) -> gpu; instances.cell: (none) -> 20.0; instances.names: (none) -> drop; instances.required: (none) -> false",
    ),
    ("format = 'glb'", SCENE, "format: source -> glb"),
    ("layout = 'library'", SCENE, "layout: (none) -> library"),
    ("profile = 'unity'", SCENE, "profile: web -> unity"),
    ("screen.pixels = 2", SCENE, "screen.pixels: 1.0 -> 2.0"),
    ("screen = { height = 1, fov = 1 }", SCENE, "screen.height: 1080.0 -> 1.0; screen.fov: 60.0 -> 1.0"),
];

#[test]
fn each_setting_changes_exactly_its_keys() {
    for (line, keys, told) in CASES {
        assert_eq!(effect("", line, MeshParts::ALL), (keys.to_vec(), told.to_owned()), "{line}");
    }
}

/// Fails when a setting is added and not listed above.
#[test]
fn the_cases_cover_every_setting() {
    let mut leaves = Vec::new();
    collect_leaves("", &serde_json::to_value(settings("")).unwrap(), &mut leaves);
    for leaf in leaves.iter().filter(|leaf| !["skip", "levels"].contains(&leaf.as_str())) {
        assert!(CASES.iter().any(|(line, ..)| line.contains(leaf.as_str())), "no case changes `{leaf}`");
    }
    assert!(leaves.len() >= 18, "{leaves:?}");
}

fn collect_leaves(name: &str, value: &serde_json::Value, leaves: &mut Vec<String>) {
    match value.as_object() {
        Some(object) => object.iter().for_each(|(name, value)| collect_leaves(name, value, leaves)),
        None => leaves.push(name.to_owned()),
    }
}

#[test]
fn what_is_not_used_is_not_in_the_key() {
    let qem = "simplify.metric = 'qem'\n";
    for line in ["normal", "texcoord", "color", "seam", "crease"] {
        let line = format!("{qem}simplify.{line} = 5");
        assert_eq!(effect(qem, &line, MeshParts::ALL), (vec![], String::new()), "{line}");
    }
    let unused: [(&str, &[&str]); 7] = [
        ("qem-attributes", &["crease"]),
        ("gaps", &["seam", "crease"]),
        ("its-paper", &["seam", "crease"]),
        ("ias", &["normal", "texcoord", "color", "seam", "crease"]),
        ("aps", &["normal", "texcoord", "color", "seam", "crease"]),
        ("tmpm", &["normal", "texcoord", "color", "border", "seam", "crease"]),
        ("naive", &["normal", "texcoord", "color", "border", "seam", "crease"]),
    ];
    for (metric, unused) in unused {
        let base = format!("simplify.metric = '{metric}'\n");
        for line in ["normal", "texcoord", "color", "border", "seam", "crease"] {
            let changed = !effect(&base, &format!("{base}simplify.{line} = 5"), MeshParts::ALL).0.is_empty();
            assert_eq!(changed, !unused.contains(&line), "{metric}: {line}");
        }
    }
    let bare = MeshParts { normals: false, texcoords: false, colors: false };
    for line in ["normal", "texcoord", "color"] {
        assert_eq!(effect("", &format!("simplify.{line} = 5"), bare).0, SCENE, "{line}");
    }
    for line in [
        "instances.tolerance = 1e-3",
        "scene = { cameras = [[1, 2, 3]], distances = [4] }",
        "instances = { cell = 20, names = 'drop', required = false }",
        "jobs = 3",
        "cache = 'x'",
        "ignore_files = true",
        "exclude = ['x']",
        "simplify.seam = 0.3",
    ] {
        assert_eq!(effect("", line, MeshParts::ALL).0, [""; 0], "{line}");
    }
    assert_eq!(effect("simplify.normal = 0", "simplify.normal = -0.0", MeshParts::ALL), (vec![], String::new()));
}

/// The key of a fixed job. If this changes, every cache in the world is cold: raise a version instead, on purpose.
#[test]
fn the_key_is_the_same_on_every_machine() {
    let [sequence, chain, scene] = keys(&settings(""), MeshParts::ALL);
    insta::assert_snapshot!(sequence, @"977ade5e909e7dda168da923a07a9ec468cda16142ad404788993576b0832d47");
    insta::assert_snapshot!(chain, @"505991637f50ddd66570258de7a21a65c14f9b271d47dff4466dc1bd7360d7a9");
    insta::assert_snapshot!(scene, @"8ebcc5452c5f34728b00441dd4a22ab79878f2dda15c6971c003a2aaf5c065dd");
    assert_eq!(sequence.to_string().parse(), Ok(sequence));
    assert!("x".parse::<JobKey>().is_err());
}

#[test]
fn the_mesh_is_in_the_key() {
    let settings = settings("");
    let key = |mesh| key_of(&SequenceJob { mesh, parts: MeshParts::ALL, simplify: &settings.simplify });
    assert_ne!(key(MeshHash([1; 32])), key(MeshHash([2; 32])));
}
