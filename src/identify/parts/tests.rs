//! Merged meshes of which it is known what they were made of.

use super::super::alike::tests::{Chance, attribute, cuboid, lathe, moved, random, rock};
use super::*;

fn merged(parts: &[Primitive]) -> Primitive {
    let mut all = parts[0].clone();
    for part in &parts[1..] {
        let first = all.count as u32;
        all.indices.extend(part.indices.iter().map(|i| first + i));
        all.count += part.count;
        for (own, other) in all.attributes.iter_mut().zip(&part.attributes) {
            own.values.extend(&other.values);
        }
    }
    all
}

fn mesh(index: usize, primitives: Vec<Primitive>) -> SourceMesh {
    let primitives = primitives.into_iter().map(SourcePrimitive::Triangles).collect();
    SourceMesh { index, name: None, primitives, vertex_maps: BTreeMap::new() }
}

fn meshes(all: Vec<Vec<Primitive>>) -> Vec<SourceMesh> {
    all.into_iter().enumerate().map(|(index, primitives)| mesh(index, primitives)).collect()
}

/// A bolt: a round shaft with a head, 64 triangles.
fn bolt() -> Primitive {
    lathe(&[(0.5, -3.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1.0), (0.1, 1.25)], 8)
}

fn search(meshes: &[SourceMesh], most: Kind, shown: u64, node_bytes: u64) -> Found {
    let (looks, shown) = (|_, primitive| Ok(primitive), |_| shown);
    find(meshes, &Search { tolerance: 1e-5, most, looks: &looks, shown: &shown, node_bytes })
}

/// The middle of each occurrence, to tell which one it is.
fn firsts(group: &Group) -> Vec<(usize, u32)> {
    group.occurrences.iter().map(|o| o.part.place()).collect()
}

#[test]
fn all_of_200_bolts_are_found_and_none_that_is_nearly_one() {
    let mut chance = Chance(11);
    for shape in [bolt(), rock()] {
        let mut parts = vec![merged(&[cuboid([40.0; 3]), lathe(&[(9.0, -9.0), (9.0, 9.0), (8.0, 9.5)], 60)])];
        let mut planted = Vec::new();
        let mut triangles = parts[0].triangles() as u32;
        for i in 0..260 {
            let scale = 0.5 + chance.next();
            let mut by = random(&mut chance, scale, false);
            by.translation *= 10.0;
            let mut part = moved(&shape, &by, (i % 2 == 0).then_some(&mut chance));
            if i % 13 < 3 {
                // A thousandth of the radius.
                let radius = 3.2 * scale;
                let vertex = i % part.count;
                part.attributes[1].values[vertex * 3] += (1e-3 * radius) as f32;
            } else {
                planted.push((0, triangles));
            }
            triangles += part.triangles() as u32;
            parts.push(part);
        }
        assert_eq!(planted.len(), 200);
        let meshes = meshes(vec![vec![merged(&parts)]]);
        let found = search(&meshes, Kind::Similar, 1, 100);
        assert_eq!(found.groups.len(), 1);
        let group = &found.groups[0];
        assert_eq!(firsts(group), planted);
        assert_eq!((group.of.clone(), group.mesh, group.nodes), (group.occurrences[0].part.clone(), None, 200));
        let worst = group.occurrences.iter().map(|o| o.residual.worst()).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");
        // Rebuilt by other code: where the first part's corners go, there are corners of the other.
        let of = copied(&meshes[0], &group.of).remove(0);
        for occurrence in &group.occurrences {
            let other = copied(&meshes[0], &occurrence.part).remove(0);
            let point = |p: &[f32; 3]| glam::DVec3::from_array(p.map(f64::from));
            let near = |p: glam::DVec3| other.positions().iter().any(|q| point(q).distance(p) < 1e-4);
            assert!(of.positions().iter().all(|p| near(occurrence.by.point(point(p)))));
        }
        assert_eq!(search(&meshes, Kind::Similar, 1, 100), found, "the same again");
    }
}

#[test]
fn kinds_that_are_not_asked_for_are_groups_of_their_own() {
    let mut chance = Chance(12);
    let mut part = |scale, mirror| moved(&rock(), &random(&mut chance, scale, mirror), None);
    let mut parts = Vec::new();
    for _ in 0..5 {
        parts.extend([part(1.0, false), part(1.0, true), part(2.0, false)]);
    }
    let meshes = meshes(vec![vec![merged(&parts)]]);
    let counts = |most| -> Vec<usize> {
        let groups = search(&meshes, most, 1, 10).groups;
        groups.iter().map(|group| group.occurrences.len()).collect()
    };
    // In one primitive of nothing else the first part stays.
    assert_eq!(counts(Kind::Rigid), [4, 5, 5]);
    assert_eq!(counts(Kind::Similar), [9, 5]);
    assert_eq!(counts(Kind::Mirrored), [14]);
}

#[test]
fn a_mesh_of_nothing_else_stands_for_its_parts() {
    let mut chance = Chance(13);
    let mut many = |count: usize| -> Vec<Primitive> {
        (0..count).map(|_| moved(&rock(), &random(&mut chance, 1.0, false), None)).collect()
    };
    // The third is one alone: it stands for all.
    let meshes = meshes(vec![vec![merged(&many(6))], vec![merged(&[merged(&many(5)), cuboid([9.0; 3])])], many(1)]);
    let found = search(&meshes, Kind::Similar, 1, 10);
    let group = &found.groups[0];
    assert_eq!((found.groups.len(), group.mesh, group.of.mesh), (1, Some(2), 2));
    let of_mesh = |mesh| group.occurrences.iter().filter(|o| o.part.mesh == mesh).count();
    assert_eq!([0, 1, 2].map(of_mesh), [5, 5, 0]);
    let alone = search(&meshes[..1], Kind::Similar, 1, 10).groups.remove(0);
    assert_eq!((alone.mesh, alone.occurrences.len(), alone.of.place()), (Some(0), 5, (0, 0)));
}

#[test]
fn parts_keep_what_hangs_together_in_several_primitives() {
    let mut chance = Chance(14);
    // The upper and lower half of a thing, in two primitives; the halves of the last one do not touch.
    let (lower, upper) = (lathe(&[(1.0, -2.0), (2.0, 0.0)], 24), lathe(&[(2.0, 0.0), (1.5, 1.0)], 24));
    let (mut lowers, mut uppers) = (vec![cuboid([9.0; 3])], vec![cuboid([8.0; 3])]);
    for i in 0..6 {
        let by = random(&mut chance, 1.0, false);
        lowers.push(moved(&lower, &by, None));
        let mut other = moved(&upper, &by, None);
        if i == 5 {
            other.attributes[1].values.iter_mut().for_each(|v| *v += 20.0);
        }
        uppers.push(other);
    }
    let meshes = meshes(vec![vec![merged(&lowers), merged(&uppers)]]);
    let found = search(&meshes, Kind::Similar, 1, 10);
    assert_eq!(found.groups.len(), 1);
    assert_eq!(found.groups[0].occurrences.len(), 5);
    let primitives = |o: &Occurrence| o.part.triangles.iter().map(|(p, t)| (*p, t.len())).collect::<Vec<_>>();
    assert!(found.groups[0].occurrences.iter().all(|o| primitives(o) == [(0, 48), (1, 48)]));
}

#[test]
fn what_does_not_pay_or_may_not_stays_and_is_told() {
    let mut chance = Chance(15);
    let parts: Vec<Primitive> =
        (0..8).map(|_| moved(&rock(), &random(&mut chance, 1.0, false), None)).chain([cuboid([9.0; 3])]).collect();
    let meshes = meshes(vec![vec![merged(&parts)]]);
    let bytes = search(&meshes, Kind::Similar, 1, 10).groups[0].bytes;
    assert_eq!(bytes, (rock().count * 24 + rock().indices.len() * 2) as u64);
    // Eight go, one comes: each node may take as much as is left then.
    let limit = (7 * bytes - MESH_BYTES).div_ceil(8);
    assert_eq!(search(&meshes, Kind::Similar, 1, limit - 1).groups.len(), 1);
    let dear = search(&meshes, Kind::Similar, 1, limit);
    assert_eq!((dear.groups.len(), &dear.stayed), (0, &BTreeMap::from([(DEAR, 8)])));
    // Twice as many nodes, since two show the mesh.
    assert_eq!(search(&meshes, Kind::Similar, 2, limit / 2 + 1).groups.len(), 0);
    assert_eq!(search(&meshes, Kind::Similar, 1, bytes).stayed, BTreeMap::from([(TINY, 8)]));
    assert_eq!(search(&meshes, Kind::Similar, 0, 1).groups.len(), 0, "nothing shows it");
    let refuse = |_, _| Err("no");
    let refused =
        find(&meshes, &Search { tolerance: 1e-5, most: Kind::Similar, looks: &refuse, shown: &|_| 1, node_bytes: 1 });
    assert_eq!((refused.groups.len(), refused.stayed), (0, BTreeMap::from([("no", 8)])));
}

#[test]
fn small_few_and_different_parts_stay() {
    let mut chance = Chance(16);
    let mut many = |shape: &Primitive, count: usize| -> Vec<Primitive> {
        (0..count).map(|_| moved(shape, &random(&mut chance, 1.0, false), None)).collect()
    };
    let boxes = many(&cuboid([1.0, 2.0, 3.0]), 50);
    let few = many(&rock(), FEWEST - 1);
    assert_eq!(search(&meshes(vec![vec![merged(&boxes)], vec![merged(&few)]]), Kind::Similar, 1, 1), Found::default());
    // Other colours: other parts.
    let painted = |part: Primitive, colour: f32| {
        let mut part = part;
        part.attributes.insert(0, attribute("COLOR_0", &vec![[colour; 3]; part.count]));
        part
    };
    let parts: Vec<Primitive> =
        many(&rock(), 12).into_iter().enumerate().map(|(i, part)| painted(part, (i % 2) as f32)).collect();
    let groups = search(&meshes(vec![vec![merged(&parts)]]), Kind::Similar, 1, 1).groups;
    assert_eq!(groups.iter().map(|group| group.occurrences.len()).collect::<Vec<_>>(), [5, 6]);
    // Other looks, as well.
    let (one, other) = (merged(&many(&rock(), 3)), merged(&many(&rock(), 3)));
    assert_eq!(search(&meshes(vec![vec![one, other]]), Kind::Similar, 1, 1).groups, []);
}

/// What single precision makes of a small part far away is no difference, a dent of a thousandth is.
#[test]
fn far_from_the_origin_rounding_is_no_difference() {
    let mut chance = Chance(17);
    let mut parts = Vec::new();
    for i in 0..12 {
        let mut by = random(&mut chance, 1.0, false);
        by.translation *= 150.0;
        let mut part = moved(&bolt(), &by, None);
        if i >= 10 {
            part.attributes[1].values[7] += 3.2e-3;
        }
        parts.push(part);
    }
    parts.push(cuboid([300.0; 3]));
    let found = search(&meshes(vec![vec![merged(&parts)]]), Kind::Rigid, 1, 10);
    assert_eq!(found.groups.len(), 1);
    assert_eq!(found.groups[0].occurrences.len(), 10);
    assert!(found.groups[0].occurrences.iter().all(|o| o.residual.position < 1e-4 && o.kind <= Kind::Rigid));
}
