//! Instances that nobody declared, with planted truth: meshes of the corpus, moved, scaled, mirrored and reordered, beside
//! such as are nearly the same; and every readable scene of the corpus, whose nodes must draw what they drew.
#![expect(clippy::print_stdout, reason = "how much was checked is said aloud")]

mod corpus;

use corpus::{corpus, scenes};
use glam::{DQuat, DVec3};
use lodbake::gltf::document::Document;
use lodbake::gltf::read;
use lodbake::gltf::scene::{Scene, SourceMesh, SourcePrimitive};
use lodbake::gltf::share::{Copy, Sharing, share};
use lodbake::gltf::similarity::{self, Similarity};
use lodbake::gltf::split::{Repeated, Splitting, split};
use lodbake::identify::alike::{Kind, Match, find};
use lodbake::identify::parts::{self, Group, Search};
use lodbake::identify::sub_meshes;
use lodbake::mesh::{Attribute, Format, Primitive};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const TOLERANCE: f64 = 1e-5;

/// Meshes that are planted.
const PLANTED: usize = 40;

/// Numbers between 0 and 1, the same every time.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn order(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, (self.next() * (i + 1) as f64) as usize);
        }
        order
    }

    /// About `middle`, by up to two radii.
    fn similarity(&mut self, (middle, radius): (DVec3, f64), scale: f64, mirror: bool) -> Similarity {
        let mut part = || self.next() - 0.5;
        let rotation = similarity::rotation(DQuat::from_xyzw(part(), part(), part(), part()));
        let offset = DVec3::new(part(), part(), part()) * 4.0 * radius;
        let turned = Similarity { scale, mirror, rotation, translation: DVec3::ZERO };
        Similarity { translation: middle - turned.point(middle) + offset, ..turned }
    }
}

fn vector(values: &[f32]) -> DVec3 {
    DVec3::new(f64::from(values[0]), f64::from(values[1]), f64::from(values[2]))
}

fn triangles(mesh: &SourceMesh) -> Option<Vec<&Primitive>> {
    let all = mesh.primitives.iter().map(|primitive| match primitive {
        SourcePrimitive::Triangles(primitive) => Some(primitive),
        SourcePrimitive::PassThrough { .. } => None,
    });
    all.collect::<Option<Vec<_>>>().filter(|all| !all.is_empty())
}

/// Positions of all corners.
fn corners(mesh: &SourceMesh) -> Vec<DVec3> {
    let primitives = triangles(mesh).unwrap_or_default();
    primitives.iter().flat_map(|p| p.indices.iter().map(|&i| vector(&p.positions()[i as usize]))).collect()
}

fn ball(points: &[DVec3]) -> (DVec3, f64) {
    let middle = points.iter().copied().sum::<DVec3>() / points.len() as f64;
    (middle, points.iter().map(|p| p.distance(middle)).fold(0.0, f64::max))
}

fn moved(mesh: &SourceMesh, by: &Similarity, mut order: Option<&mut Chance>) -> SourceMesh {
    let mut mesh = mesh.clone();
    mesh.vertex_maps.clear();
    for primitive in &mut mesh.primitives {
        let SourcePrimitive::Triangles(primitive) = primitive else { continue };
        for attribute in &mut primitive.attributes {
            let point = attribute.name == "POSITION";
            if !point && !["NORMAL", "TANGENT"].contains(&attribute.name.as_str()) {
                continue;
            }
            for v in attribute.values.chunks_exact_mut(attribute.components) {
                let to = if point { by.point(vector(v)) } else { by.direction(vector(v)) };
                v[..3].copy_from_slice(&to.to_array().map(|c| c as f32));
            }
        }
        if by.mirror {
            primitive.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        }
        if let Some(chance) = order.as_deref_mut() {
            reorder(primitive, chance);
        }
    }
    mesh
}

/// Vertices and triangles in another order, triangles begun at another corner.
fn reorder(primitive: &mut Primitive, chance: &mut Chance) {
    let old = chance.order(primitive.count);
    let mut place = vec![0u32; primitive.count];
    old.iter().enumerate().for_each(|(to, &from)| place[from] = to as u32);
    let shuffle = |attribute: &mut Attribute| {
        let width = attribute.components;
        attribute.values = old.iter().flat_map(|&i| attribute.values[i * width..][..width].to_vec()).collect();
    };
    primitive.attributes.iter_mut().for_each(shuffle);
    let triangles = chance.order(primitive.triangles());
    let indices = triangles.iter().flat_map(|&t| {
        let mut corners = [0, 1, 2].map(|i| place[primitive.indices[t * 3 + i] as usize]);
        corners.rotate_left(t % 3);
        corners
    });
    primitive.indices = indices.collect();
}

/// One vertex that is drawn, moved by a thousandth of the radius.
fn dented(mut mesh: SourceMesh, radius: f64) -> SourceMesh {
    if let Some(SourcePrimitive::Triangles(primitive)) = mesh.primitives.first_mut() {
        let vertex = primitive.indices[primitive.indices.len() / 2] as usize;
        let positions = primitive.attributes.iter_mut().find(|a| a.name == "POSITION").unwrap();
        positions.values[vertex * 3 + 1] += (1e-3 * radius) as f32;
    }
    mesh
}

/// Real meshes to plant: all triangles, plain floats, none like another, near enough to their origin that single
/// precision holds their shape.
fn sources(folder: &Path) -> Vec<SourceMesh> {
    let mut found: Vec<SourceMesh> = Vec::new();
    let mut known = BTreeSet::new();
    for path in scenes(folder) {
        let Ok(scene) = read::read(&path) else { continue };
        for mesh in scene.meshes.iter().filter(|mesh| (24..40_000).contains(&mesh.triangles())) {
            let Some(primitives) = triangles(mesh) else { continue };
            let plain = primitives.iter().all(|p| {
                let moving = |a: &&Attribute| ["POSITION", "NORMAL", "TANGENT"].contains(&a.name.as_str());
                p.targets.is_empty() && p.attributes.iter().filter(moving).all(|a| a.format == Format::F32)
            });
            let (middle, radius) = ball(&corners(mesh));
            let hashes: Vec<_> = sub_meshes(mesh).into_iter().map(|sub| sub.hash).collect();
            if plain && middle.length() < 10.0 * radius && known.insert((hashes, primitives.len())) {
                found.push(mesh.clone());
            }
        }
    }
    found
}

/// Largest distance from a sample of `points` to the nearest of `others`.
fn farthest(points: impl Iterator<Item = DVec3>, others: &[DVec3], samples: usize, count: usize) -> f64 {
    let nearest = |p: DVec3| others.iter().map(|q| p.distance_squared(*q)).fold(f64::INFINITY, f64::min).sqrt();
    points.step_by(count.div_ceil(samples).max(1)).map(nearest).fold(0.0, f64::max)
}

#[test]
fn planted_instances_are_found_and_nothing_else() {
    let Some(corpus) = corpus() else { return };
    let mut all = sources(&corpus.join("quality"));
    all.extend(sources(&corpus.join("scenes")));
    // Meshes of the corpus that are alike by themselves would blur the truth: one of each.
    all.iter_mut().enumerate().for_each(|(i, mesh)| mesh.index = i);
    let like: BTreeSet<usize> = matches(&all).iter().map(|found| found.mesh).collect();
    let mut bases: Vec<SourceMesh> = all.into_iter().filter(|mesh| !like.contains(&mesh.index)).collect();
    // From all sizes.
    bases.sort_by_key(|mesh| (mesh.triangles(), mesh.index));
    let step = bases.len() / PLANTED;
    assert!(0 < step, "{} meshes are too few", bases.len());
    let bases: Vec<SourceMesh> = bases.into_iter().step_by(step).take(PLANTED).collect();
    let mut chance = Chance(7);
    let mut meshes: Vec<SourceMesh> = Vec::new();
    // For each mesh: which base it was made of, and whether it must be found.
    let mut truth: Vec<(usize, bool)> = Vec::new();
    for (base, mesh) in bases.iter().enumerate() {
        let ball = ball(&corners(mesh));
        let scale = |chance: &mut Chance| 0.1 * libm::exp2(7.0 * chance.next());
        let mut plant = |planted: SourceMesh, found| {
            meshes.push(planted);
            truth.push((base, found));
        };
        plant(mesh.clone(), false);
        plant(mesh.clone(), true);
        plant(moved(mesh, &Similarity::IDENTITY, Some(&mut chance)), true);
        for mirror in [false, true] {
            for reordered in [false, true] {
                let factor = if mirror { scale(&mut chance) } else { 1.0 };
                let by = chance.similarity(ball, factor, mirror);
                plant(moved(mesh, &by, reordered.then_some(&mut chance)), true);
                let factor = scale(&mut chance);
                let by = chance.similarity(ball, factor, mirror);
                let planted = moved(mesh, &by, reordered.then_some(&mut chance));
                plant(planted.clone(), true);
                plant(dented(planted, factor * ball.1), false);
            }
        }
        plant(dented(mesh.clone(), ball.1), false);
    }
    meshes.iter_mut().enumerate().for_each(|(i, mesh)| mesh.index = i);
    let found = matches(&meshes);
    let by_mesh: BTreeMap<usize, &Match> = found.iter().map(|found| (found.mesh, found)).collect();
    let (mut right, mut kinds, mut worst) = (0, BTreeMap::new(), 0.0f64);
    for (mesh, &(base, planted)) in truth.iter().enumerate() {
        let found = by_mesh.get(&mesh);
        assert_eq!(found.is_some(), planted, "mesh {mesh} of base {base} ({} triangles)", meshes[mesh].triangles());
        let Some(found) = found else { continue };
        assert_eq!(truth[found.of], (base, false), "mesh {mesh} was taken for one of another base");
        // Not by the code that found it: where the move takes the first mesh's corners, the other has some.
        let (from, to) = (corners(&meshes[found.of]), corners(&meshes[mesh]));
        let off = farthest(from.iter().map(|p| found.by.point(*p)), &to, 100, from.len()) / ball(&to).1;
        assert!(off <= TOLERANCE, "mesh {mesh}: off by {off:e}");
        assert!(found.residual.worst() <= TOLERANCE);
        worst = worst.max(found.residual.worst());
        *kinds.entry(found.kind).or_insert(0) += 1;
        right += 1;
    }
    let planted = truth.iter().filter(|(_, planted)| *planted).count();
    println!(
        "{right} of {planted} planted instances of {PLANTED} meshes found, {} near misses refused, largest residual \
         {worst:.2e}; {kinds:?}",
        truth.len() - planted - PLANTED
    );
    assert!(kinds.contains_key(&Kind::Mirrored) && kinds.len() == 5, "every kind occurs: {kinds:?}");
    assert_eq!(matches(&meshes), found, "the same again");
}

fn matches(meshes: &[SourceMesh]) -> Vec<Match> {
    let subs: Vec<_> = meshes.iter().map(sub_meshes).collect();
    find(meshes, &subs, TOLERANCE, &|_| true)
}

/// What the nodes of the source draw, each in its own space, with the children that were appended to it.
fn drawn(scene: &Scene, nodes: usize) -> BTreeMap<usize, Vec<DVec3>> {
    let all = scene.document.array("nodes").unwrap();
    let mesh = |node: &Value| node.get("mesh").and_then(Value::as_u64).map(|mesh| mesh as usize);
    let mut drawn = BTreeMap::new();
    for (i, node) in all.iter().enumerate().take(nodes) {
        let mut points: Vec<DVec3> = mesh(node).map(|mesh| corners(&scene.meshes[mesh])).unwrap_or_default();
        let children = node.get("children").and_then(Value::as_array).into_iter().flatten();
        for child in children.filter_map(Value::as_u64).filter(|&child| nodes <= child as usize) {
            let child = &all[child as usize];
            let own = mesh(child).map(|mesh| corners(&scene.meshes[mesh])).unwrap_or_default();
            let by = transform(child);
            points.extend(own.into_iter().map(by));
        }
        if !points.is_empty() {
            drawn.insert(i, points);
        }
    }
    drawn
}

fn transform(node: &Value) -> impl Fn(DVec3) -> DVec3 + use<> {
    let list = |key: &str, default: &[f64]| -> Vec<f64> {
        let values = node.get(key).and_then(Value::as_array);
        values.map_or_else(|| default.to_vec(), |values| values.iter().map(|v| v.as_f64().unwrap()).collect())
    };
    let (t, r, s) = (list("translation", &[0.0; 3]), list("rotation", &[0., 0., 0., 1.]), list("scale", &[1.0; 3]));
    let (t, s) = (DVec3::new(t[0], t[1], t[2]), DVec3::new(s[0], s[1], s[2]));
    let r = DQuat::from_xyzw(r[0], r[1], r[2], r[3]);
    move |p| r * (s * p) + t
}

#[test]
fn nodes_draw_what_they_drew() {
    let Some(corpus) = corpus() else { return };
    let (mut files, mut instances, mut saved) = (0, 0, 0);
    for path in scenes(&corpus) {
        let Ok(scene) = read::read(&path) else { continue };
        let copies: Vec<Copy> = {
            let sharing = Sharing::new(&scene.document).unwrap();
            let subs: Vec<_> = scene.meshes.iter().map(sub_meshes).collect();
            let found = find(&scene.meshes, &subs, TOLERANCE, &|mesh| sharing.is_eligible(mesh));
            let copies = found.iter().map(|found| Copy { mesh: found.mesh, of: found.of, by: found.by });
            copies.filter(|copy| sharing.obstacle(copy).is_none()).collect()
        };
        if copies.is_empty() {
            continue;
        }
        let Scene { mut document, buffers, .. } = read::read(&path).unwrap();
        let shared = share(&mut document, &buffers, &copies).unwrap();
        let nothing_lost =
            |name: &str| scene.document.array(name).unwrap().len() <= document.array(name).unwrap().len();
        let arrays = ["accessors", "bufferViews", "buffers", "meshes", "nodes", "materials", "images"];
        assert!(arrays.iter().all(|name| nothing_lost(name)), "{}", path.display());
        same_names(&scene.document, &document);
        let bytes = |buffers: &lodbake::gltf::buffers::Buffers| -> usize {
            (0..buffers.len()).filter_map(|i| buffers.bytes(i)).map(<[u8]>::len).sum()
        };
        saved += bytes(&buffers) - bytes(&shared.buffers);
        let after = read::from_document(document, shared.buffers, path.parent().unwrap()).unwrap();
        let nodes = scene.document.array("nodes").unwrap().len();
        same_points(&path, &drawn(&scene, nodes), &drawn(&after, nodes));
        files += 1;
        instances += copies.len();
    }
    println!("{instances} instances in {files} files, {saved} bytes saved");
    assert!(0 < instances);
}

/// Parts are taken out wherever that saves any byte: what nodes draw is the same.
#[test]
fn parts_are_drawn_where_they_were() {
    let Some(corpus) = corpus() else { return };
    let (mut files, mut parts) = (0, 0);
    for path in scenes(&corpus) {
        let Ok(scene) = read::read(&path) else { continue };
        let is_read = |mesh: usize, primitive| triangles_of(&scene.meshes[mesh], primitive);
        let splitting = Splitting::new(&scene.document, &is_read, true).unwrap();
        let search = Search {
            tolerance: TOLERANCE,
            most: Kind::Mirrored,
            looks: &|mesh, primitive| splitting.looks(mesh, primitive),
            shown: &|mesh| splitting.shown(mesh),
            node_bytes: 1,
        };
        let groups = parts::find(&scene.meshes, &search).groups;
        if groups.is_empty() {
            continue;
        }
        let repeated = |group: &Group| {
            let occurrences = group.occurrences.iter().map(|o| (o.part.clone(), o.by)).collect();
            Repeated { of: group.of.clone(), mesh: group.mesh, occurrences }
        };
        let repeated: Vec<Repeated> = groups.iter().map(repeated).collect();
        let Scene { mut document, buffers, .. } = read::read(&path).unwrap();
        let done = split(&mut document, &buffers, &repeated).unwrap();
        same_names(&scene.document, &document);
        let after = read::from_document(document, done.buffers, path.parent().unwrap()).unwrap();
        let nodes = scene.document.array("nodes").unwrap().len();
        same_points(&path, &drawn(&scene, nodes), &drawn(&after, nodes));
        files += 1;
        parts += groups.iter().map(|group| group.occurrences.len()).sum::<usize>();
    }
    println!("{parts} parts in {files} files");
    assert!(0 < parts);
}

fn triangles_of(mesh: &SourceMesh, primitive: usize) -> bool {
    matches!(mesh.primitives[primitive], SourcePrimitive::Triangles(_))
}

fn same_points(path: &Path, before: &BTreeMap<usize, Vec<DVec3>>, after: &BTreeMap<usize, Vec<DVec3>>) {
    assert_eq!(before.keys().collect::<Vec<_>>(), after.keys().collect::<Vec<_>>(), "{}", path.display());
    for (node, points) in before {
        let (others, radius) = (&after[node], ball(points).1);
        assert_eq!(points.len(), others.len(), "{}: node {node}", path.display());
        let off = farthest(points.iter().copied(), others, 20, points.len());
        let back = farthest(others.iter().copied(), points, 20, points.len());
        assert!(off.max(back) <= 2.0 * TOLERANCE * radius, "{}: node {node} is off by {off:e}", path.display());
    }
}

/// Entries keep their places.
fn same_names(before: &Document, after: &Document) {
    for name in ["nodes", "meshes", "accessors", "bufferViews", "materials"] {
        for (old, new) in before.array(name).unwrap().iter().zip(after.array(name).unwrap()) {
            assert_eq!(old.get("name"), new.get("name"), "{name}");
            assert_eq!(old.get("extras"), new.get("extras"), "{name}");
        }
    }
}
