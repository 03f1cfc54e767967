//! Shapes whose likeness is known, because they were made that way.

use super::super::sub_meshes;
use super::*;
use crate::gltf::similarity;
use crate::mesh::{Attribute, Format};

/// A generator of numbers between 0 and 1.
pub(in crate::identify) struct Chance(pub(in crate::identify) u64);

impl Chance {
    pub(in crate::identify) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn rotation(&mut self) -> DQuat {
        let mut part = || self.next() - 0.5;
        similarity::rotation(DQuat::from_xyzw(part(), part(), part(), part()))
    }

    pub(in crate::identify) fn order(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, (self.next() * (i + 1) as f64) as usize);
        }
        order
    }
}

pub(in crate::identify) fn attribute(name: &str, rows: &[[f32; 3]]) -> Attribute {
    Attribute { name: name.into(), components: 3, format: Format::F32, values: rows.as_flattened().to_vec() }
}

pub(in crate::identify) fn primitive(positions: &[[f32; 3]], normals: &[[f32; 3]], indices: Vec<u32>) -> Primitive {
    let attributes = vec![attribute("NORMAL", normals), attribute("POSITION", positions)];
    Primitive { count: positions.len(), attributes, targets: vec![], indices }
}

/// A box with flat faces: 24 vertices, 12 triangles.
pub(in crate::identify) fn cuboid(size: [f32; 3]) -> Primitive {
    let (mut positions, mut normals, mut indices) = (vec![], vec![], vec![]);
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let (u, v) = if side > 0.0 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
            let first = positions.len() as u32;
            for [a, b] in [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let (mut p, mut n) = ([0.0; 3], [0.0; 3]);
                (p[axis], p[u], p[v], n[axis]) = (side * size[axis], a * size[u], b * size[v], side);
                positions.push(p);
                normals.push(n);
            }
            indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    primitive(&positions, &normals, indices)
}

/// A surface of revolution without seam: rings of equal vertices, closed at the ends.
pub(in crate::identify) fn lathe(rings: &[(f32, f32)], segments: u32) -> Primitive {
    let (mut positions, mut indices) = (vec![], vec![]);
    for &(radius, height) in rings {
        for i in 0..segments {
            let angle = std::f32::consts::TAU * i as f32 / segments as f32;
            positions.push([radius * angle.cos(), height, radius * angle.sin()]);
        }
    }
    for ring in 0..rings.len() as u32 - 1 {
        for i in 0..segments {
            let (a, b) = (ring * segments + i, ring * segments + (i + 1) % segments);
            indices.extend([a, a + segments, b, b, a + segments, b + segments]);
        }
    }
    let normals = vec![[0.0, 1.0, 0.0]; positions.len()];
    primitive(&positions, &normals, indices)
}

fn sphere(segments: u32) -> Primitive {
    let rings = segments / 2;
    let ring = |i: u32| {
        let angle = std::f32::consts::PI * (i as f32 + 0.5) / rings as f32;
        (angle.sin(), angle.cos())
    };
    lathe(&(0..rings).map(ring).collect::<Vec<_>>(), segments)
}

/// No symmetry at all.
pub(in crate::identify) fn rock() -> Primitive {
    let mut chance = Chance(5);
    let mut rock = sphere(12);
    rock.attributes[1].values.iter_mut().for_each(|v| *v *= 1.0 + 0.3 * chance.next() as f32);
    rock
}

/// The same surface: moved, its vertices and triangles in another order, triangles turned.
pub(in crate::identify) fn moved(source: &Primitive, by: &Similarity, chance: Option<&mut Chance>) -> Primitive {
    let vector = |v: &[f32]| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
    let mut out = source.clone();
    for attribute in &mut out.attributes {
        let point = attribute.name == "POSITION";
        for v in attribute.values.chunks_exact_mut(3) {
            let to = if point { by.point(vector(v)) } else { by.direction(vector(v)) };
            v.copy_from_slice(&to.to_array().map(|c| c as f32));
        }
    }
    if by.mirror {
        out.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    }
    let Some(chance) = chance else { return out };
    let place = chance.order(source.count);
    let mut old = vec![0; source.count];
    place.iter().enumerate().for_each(|(from, &to)| old[to] = from);
    for attribute in &mut out.attributes {
        attribute.values = old.iter().flat_map(|&i| attribute.values[i * 3..i * 3 + 3].to_vec()).collect();
    }
    let triangles = chance.order(source.triangles());
    let turned = triangles.iter().flat_map(|&t| {
        let mut corners = [0, 1, 2].map(|i| place[out.indices[t * 3 + i] as usize] as u32);
        corners.rotate_left(t % 3);
        corners
    });
    out.indices = turned.collect();
    out
}

fn matches(primitives: Vec<Primitive>) -> Vec<Match> {
    let mesh = |(index, primitive)| SourceMesh {
        index,
        name: None,
        primitives: vec![SourcePrimitive::Triangles(primitive)],
        vertex_maps: BTreeMap::new(),
    };
    let meshes: Vec<SourceMesh> = primitives.into_iter().enumerate().map(mesh).collect();
    let subs: Vec<Vec<SubMesh>> = meshes.iter().map(sub_meshes).collect();
    find(&meshes, &subs, 1e-5, &|_| true)
}

fn kinds(primitives: Vec<Primitive>) -> Vec<(usize, usize, Kind)> {
    matches(primitives).iter().map(|m| (m.mesh, m.of, m.kind)).collect()
}

pub(in crate::identify) fn random(chance: &mut Chance, scale: f64, mirror: bool) -> Similarity {
    let translation = DVec3::new(chance.next(), chance.next(), chance.next()) * 4.0 - 2.0;
    Similarity { scale, mirror, rotation: chance.rotation(), translation }
}

#[test]
fn every_kind_of_likeness_is_found_and_named() {
    let mut chance = Chance(1);
    let still = Similarity::IDENTITY;
    let shapes = vec![
        rock(),
        rock(),
        moved(&rock(), &still, Some(&mut chance)),
        moved(&rock(), &random(&mut chance, 1.0, false), None),
        moved(&rock(), &random(&mut chance, 1.0, false), Some(&mut chance)),
        moved(&rock(), &random(&mut chance, 0.013, false), Some(&mut chance)),
        moved(&rock(), &random(&mut chance, 40.0, true), Some(&mut chance)),
    ];
    let found = kinds(shapes);
    let expected = [Kind::Exact, Kind::Reordered, Kind::Rigid, Kind::Rigid, Kind::Similar, Kind::Mirrored];
    assert_eq!(found, (1..7).map(|i| (i, 0, expected[i - 1])).collect::<Vec<_>>());
}

#[test]
fn symmetric_shapes_are_found_by_any_of_their_symmetries() {
    let mut chance = Chance(2);
    let tube = lathe(&[(1.0, -2.0), (1.0, 0.0), (1.0, 2.0)], 32);
    for shape in [cuboid([1.0; 3]), cuboid([1.0, 2.0, 3.0]), sphere(24), sphere(64), tube] {
        for mirror in [false, true] {
            let others: Vec<Primitive> =
                (0..6).map(|_| moved(&shape, &random(&mut chance, 2.0, mirror), Some(&mut chance))).collect();
            let found = matches(std::iter::once(shape.clone()).chain(others).collect());
            assert_eq!(found.len(), 6, "{} triangles, mirror {mirror}", shape.triangles());
            assert!(found.iter().all(|m| m.of == 0 && m.residual.worst() < 1e-6), "{found:?}");
        }
    }
}

#[test]
fn what_is_nearly_alike_is_not_alike() {
    let mut chance = Chance(3);
    for shape in [rock(), cuboid([1.0; 3]), sphere(24), lathe(&[(1.0, -2.0), (1.0, 2.0)], 48)] {
        let mut dented = moved(&shape, &random(&mut chance, 3.0, false), Some(&mut chance));
        dented.attributes[1].values[4] += 3e-3;
        let mut bent = moved(&shape, &random(&mut chance, 1.0, false), None);
        bent.attributes[0].values[0] += 1e-3;
        let mut turned = shape.clone();
        turned.indices.swap(0, 1);
        let mut stretched = shape.clone();
        stretched.attributes[1].values.iter_mut().step_by(3).for_each(|x| *x *= 1.0001);
        let mut coloured = shape.clone();
        coloured.attributes.insert(0, attribute("COLOR_0", &vec![[0.5; 3]; shape.count]));
        let mut repainted = coloured.clone();
        repainted.attributes[0].values[0] = 0.25;
        assert_eq!(kinds(vec![shape, dented, bent, turned, stretched, coloured, repainted]), []);
    }
}

#[test]
fn copies_of_moved_meshes_are_instances_of_the_first() {
    let mut chance = Chance(4);
    let other = moved(&rock(), &random(&mut chance, 1.0, false), None);
    let found = kinds(vec![cuboid([1.0; 3]), rock(), other.clone(), other]);
    assert_eq!(found, [(2, 1, Kind::Rigid), (3, 1, Kind::Rigid)]);
}

#[test]
fn how_vertices_are_split_does_not_count() {
    let mut soup = rock();
    for attribute in &mut soup.attributes {
        let values = rock().indices.iter().flat_map(|&i| attribute.values[i as usize * 3..][..3].to_vec()).collect();
        attribute.values = values;
    }
    soup.count = soup.indices.len();
    soup.indices = (0..soup.count as u32).collect();
    assert_eq!(kinds(vec![rock(), soup]), [(1, 0, Kind::Reordered)]);
}

#[test]
fn triangles_without_area_may_begin_anywhere() {
    let mut chance = Chance(6);
    let mut sliver = rock();
    // A vertex once more: places are one, vertices two.
    for attribute in &mut sliver.attributes {
        attribute.values.extend_from_within(..3);
    }
    sliver.count += 1;
    let twin = sliver.count as u32 - 1;
    sliver.indices.extend([twin, 0, 5, 0, 7, twin, 9, twin, 0]);
    let others: Vec<Primitive> =
        (0..4).map(|_| moved(&sliver, &random(&mut chance, 1.0, false), Some(&mut chance))).collect();
    let found = kinds(std::iter::once(sliver).chain(others).collect());
    assert_eq!(found, (1..5).map(|i| (i, 0, Kind::Rigid)).collect::<Vec<_>>());
}

#[test]
fn many_of_the_same_form_but_different_proportions_are_told_apart() {
    let boxes: Vec<Primitive> = (0..400).map(|i| cuboid([1.0, 1.0 + (i / 2) as f32 * 0.01, 2.5])).collect();
    let found = kinds(boxes);
    assert_eq!(found.len(), 200);
    assert!(found.iter().all(|&(mesh, of, kind)| mesh == of + 1 && kind == Kind::Exact));
}

#[test]
fn nothing_without_extent() {
    let point = primitive(&[[1.0; 3]; 3], &[[0.0; 3]; 3], vec![0, 1, 2]);
    let mut other = point.clone();
    other.attributes[1].values.fill(2.0);
    assert_eq!(kinds(vec![point, other]), []);
}
