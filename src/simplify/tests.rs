//! What simplification must and must not do, on meshes small enough to know the answer, for every metric.

use proptest::prelude::*;

use super::replay::{Replay, Welded};
use super::*;
use crate::mesh::{Attribute, Format, Primitive};
use crate::quadric::{cross, dot, sub};

pub(crate) const BALANCED: Settings = Settings {
    metric: MetricKind::Its,
    placement: Placement::Optimal,
    attributes: AttributeScale { normal: 0.003, texcoord: 0.3, color: 0.1 },
    edges: EdgeWeights { border: 1.0, seam: 0.3, crease: 0.04 },
    lock_border: false,
    memoryless: true,
    by_visibility: true,
};

/// Every metric with every placement.
pub(super) fn all_settings() -> impl Iterator<Item = Settings> {
    MetricKind::ALL.into_iter().flat_map(|metric| {
        let places = [(Placement::Optimal, true), (Placement::Optimal, false), (Placement::Subset, true)];
        let settings = places.map(|(placement, memoryless)| Settings { metric, placement, memoryless, ..BALANCED });
        settings.into_iter().filter(move |settings| metric.can_place(settings.placement))
    })
}

/// Metrics whose price knows the outline: `naive` knows lengths alone, `its-paper` asks for the length first.
fn knows_outlines(settings: &Settings) -> bool {
    !matches!(settings.metric, MetricKind::Naive | MetricKind::ItsPaper)
}

fn attribute(name: &str, components: usize, values: Vec<f32>) -> Attribute {
    Attribute { name: name.to_owned(), components, format: Format::F32, values }
}

/// `(columns + 1) × (rows + 1)` vertices, two triangles a cell; positions and texture coordinates by `place`.
fn grid(columns: u32, rows: u32, place: impl Fn(f32, f32) -> ([f32; 3], [f32; 2])) -> Primitive {
    let (mut positions, mut texcoords, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for y in 0..=rows {
        for x in 0..=columns {
            let (position, texcoord) = place(x as f32 / columns as f32, y as f32 / rows as f32);
            positions.extend(position);
            texcoords.extend(texcoord);
            if x < columns && y < rows {
                let at = y * (columns + 1) + x;
                let above = at + columns + 1;
                indices.extend([at, at + 1, above + 1, at, above + 1, above]);
            }
        }
    }
    let count = positions.len() / 3;
    let attributes = vec![attribute("POSITION", 3, positions), attribute("TEXCOORD_0", 2, texcoords)];
    Primitive { count, attributes, targets: Vec::new(), indices }
}

fn one(primitive: Primitive) -> Mesh {
    Mesh { primitives: vec![primitive] }
}

/// A torus: closed, one seam in each direction of the texture.
pub(crate) fn torus(columns: u32, rows: u32) -> Mesh {
    use std::f32::consts::TAU;
    one(grid(columns, rows, |u, v| {
        // The last column and row are the first again, bit for bit.
        let (a, b) = ((u.fract() * TAU), (v.fract() * TAU));
        let r = 1.0 + 0.4 * b.cos();
        ([r * a.cos(), r * a.sin(), 0.4 * b.sin()], [u, v])
    }))
}

/// Positions of the triangles after `steps`.
fn triangles(mesh: &Mesh, sequence: &Progressive, steps: usize) -> Vec<[[f32; 3]; 3]> {
    let welded = Welded::new(mesh);
    let mut replay = Replay::new(mesh, &welded, sequence);
    replay.advance(steps);
    let cuts = replay.primitives();
    let corner = |cut: &replay::CutPrimitive, i: u32| replay.wedge_position(cut.wedges[i as usize]);
    cuts.iter().flat_map(|cut| cut.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| corner(cut, t[i])))).collect()
}

fn area(t: &[[f32; 3]; 3]) -> f64 {
    let p = t.map(|p| p.map(f64::from));
    let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
    dot(n, n).sqrt() / 2.0
}

#[test]
fn a_flat_grid_becomes_two_triangles_and_keeps_its_outline() {
    let mesh = one(grid(12, 9, |u, v| ([u * 4.0, v * 3.0, 0.0], [u, v])));
    for settings in all_settings().filter(knows_outlines) {
        let sequence = simplify(&mesh, &settings);
        let steps = sequence.cut_at(2);
        let left = triangles(&mesh, &sequence, steps);
        assert_eq!(left.len(), 2, "{settings:?}");
        let sum: f64 = left.iter().map(area).sum();
        assert!((sum - 12.0).abs() < 1e-3, "{settings:?}: area {sum}");
        assert!(left.iter().flatten().all(|p| p[2].abs() < 1e-5), "{settings:?}");
    }
}

#[test]
fn a_flat_grid_keeps_its_texture_where_it_was() {
    let mesh = one(grid(10, 10, |u, v| ([u, v, 0.5], [0.25 + u * 0.5, 1.0 - v])));
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        let welded = Welded::new(&mesh);
        let mut replay = Replay::new(&mesh, &welded, &sequence);
        replay.advance(sequence.cut_at(20));
        let cut = &replay.primitives()[0];
        let own = replay.vertices(0, cut);
        let rows = own.attributes[0].values.chunks_exact(3).zip(own.attributes[1].values.chunks_exact(2));
        for (p, t) in rows {
            let off = (t[0] - (0.25 + p[0] * 0.5)).abs().max((t[1] - (1.0 - p[1])).abs());
            assert!(off < 1e-4, "{settings:?}: {p:?} has {t:?}");
        }
    }
}

#[test]
fn a_closed_surface_stays_closed() {
    let mesh = torus(24, 16);
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        for ratio in [2, 4, 10] {
            let left = triangles(&mesh, &sequence, sequence.cut_at(mesh.triangles() / ratio));
            let mut edges = std::collections::BTreeMap::new();
            for t in &left {
                let p = t.map(|p| p.map(f32::to_bits));
                for i in 0..3 {
                    *edges.entry((p[i], p[(i + 1) % 3])).or_insert(0i32) += 1;
                    *edges.entry((p[(i + 1) % 3], p[i])).or_insert(0i32) -= 1;
                }
            }
            assert!(edges.values().all(|&n| n == 0), "{settings:?}: an open edge at 1/{ratio}");
        }
    }
}

#[test]
fn texture_seams_do_not_smear_across_the_texture() {
    // A seam torn open would stretch one triangle over the whole texture: its texture area would leap.
    let mesh = torus(32, 20);
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        let welded = Welded::new(&mesh);
        let mut replay = Replay::new(&mesh, &welded, &sequence);
        replay.advance(sequence.cut_at(mesh.triangles() / 4));
        let cut = &replay.primitives()[0];
        let own = replay.vertices(0, cut);
        for t in cut.indices.chunks_exact(3) {
            let at = |i: usize, c: usize| own.attributes[1].values[t[i] as usize * 2 + c];
            for c in 0..2 {
                let widths = [at(0, c), at(1, c), at(2, c)];
                let width = widths.iter().fold(0.0f32, |a, v| a.max(*v)) - widths.iter().fold(1.0f32, |a, v| a.min(*v));
                assert!(width < 0.5, "{settings:?}: a triangle spans {width} of the texture");
            }
        }
    }
}

#[test]
fn locked_borders_stay_bit_for_bit() {
    let mesh = one(grid(8, 8, |u, v| ([u, v, (u * 7.0).sin() * (v * 5.0).cos() * 0.2], [u, v])));
    let border = |p: &[f32; 3]| p[0] == 0.0 || p[0] == 1.0 || p[1] == 0.0 || p[1] == 1.0;
    let mut before: Vec<[u32; 3]> =
        mesh.primitives[0].positions().iter().filter(|p| border(p)).map(|p| p.map(f32::to_bits)).collect();
    before.sort_unstable();
    for settings in all_settings() {
        let sequence = simplify(&mesh, &Settings { lock_border: true, ..settings });
        let left = triangles(&mesh, &sequence, sequence.steps.len());
        assert!(left.len() < mesh.triangles() / 2, "{settings:?}: {} triangles", left.len());
        let mut after: Vec<[u32; 3]> =
            left.iter().flatten().filter(|p| border(p)).map(|p| p.map(f32::to_bits)).collect();
        after.sort_unstable();
        after.dedup();
        assert_eq!(after, before, "{settings:?}");
    }
}

#[test]
fn subset_placement_leaves_only_source_vertices() {
    let mesh = torus(16, 12);
    let source: std::collections::BTreeSet<[u32; 3]> =
        mesh.primitives[0].positions().iter().map(|p| p.map(f32::to_bits)).collect();
    for metric in MetricKind::ALL {
        let sequence = simplify(&mesh, &Settings { metric, placement: Placement::Subset, ..BALANCED });
        let left = triangles(&mesh, &sequence, sequence.cut_at(60));
        assert!(left.iter().flatten().all(|p| source.contains(&p.map(f32::to_bits))), "{metric:?}");
    }
}

#[test]
fn primitives_that_share_a_border_stay_together() {
    // Two halves of a bumpy sheet with two materials: the common border must stay common.
    let place = |u: f32, v: f32| ([u, v, (u * 9.0).sin() * (v * 8.0).cos() * 0.1], [u, v]);
    let left = grid(10, 12, |u, v| place(u * 0.5, v));
    let right = grid(10, 12, |u, v| place(0.5 + u * 0.5, v));
    let mesh = Mesh { primitives: vec![left, right] };
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        let all = triangles(&mesh, &sequence, sequence.cut_at(mesh.triangles() / 5));
        let mut edges = std::collections::BTreeMap::new();
        for t in &all {
            for i in 0..3 {
                let mut ends = [t[i].map(f32::to_bits), t[(i + 1) % 3].map(f32::to_bits)];
                ends.sort_unstable();
                *edges.entry(ends).or_insert(0) += 1;
            }
        }
        // An edge inside the sheet that has one triangle only is a crack.
        let inside = |p: [u32; 3]| {
            let [x, y, _] = p.map(f32::from_bits);
            (0.1..0.9).contains(&x) && (0.1..0.9).contains(&y)
        };
        let cracks = edges.iter().filter(|(ends, n)| **n == 1 && inside(ends[0]) && inside(ends[1])).count();
        assert_eq!(cracks, 0, "{settings:?}");
    }
}

#[test]
fn degenerate_input_is_survived() {
    let at = |positions: Vec<f32>, indices: Vec<u32>| {
        let count = positions.len() / 3;
        one(Primitive { count, attributes: vec![attribute("POSITION", 3, positions)], targets: Vec::new(), indices })
    };
    let meshes = [
        // Nothing; one point three times; a line; a triangle and its double.
        at(vec![], vec![]),
        at(vec![1.0; 9], vec![0, 1, 2]),
        at(vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0], vec![0, 1, 2]),
        at(vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], vec![0, 1, 2, 0, 1, 2, 2, 1, 0]),
        // Three triangles on one edge.
        at(
            vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, -1.0, 0.0],
            vec![0, 1, 2, 0, 1, 3, 0, 1, 4],
        ),
    ];
    for (number, mesh) in meshes.iter().enumerate() {
        for settings in all_settings() {
            let sequence = simplify(mesh, &settings);
            let left = triangles(mesh, &sequence, sequence.steps.len());
            assert_eq!(left.len(), sequence.triangles_after(sequence.steps.len()), "mesh {number}, {settings:?}");
        }
    }
}

#[test]
fn edges_that_lost_their_last_face_are_pairs_no_more() {
    // A ball whose poles are many stored vertices at one place: faces vanish two at a time, borders come and go.
    use std::f32::consts::PI;
    let mesh = one(grid(20, 12, |u, v| {
        let (a, b) = (u * 2.0 * PI, v * PI);
        ([b.sin() * a.cos(), b.cos(), b.sin() * a.sin()], [u, v])
    }));
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        let mut gone = std::collections::BTreeSet::new();
        assert!(sequence.steps.iter().all(|step| gone.insert(step.gone) && !gone.contains(&step.kept)), "{settings:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Any soup of triangles over few vertices: every cut has what the record says, and nothing leaves the box by far.
    #[test]
    fn any_soup_is_simplified_to_what_the_record_says(
        points in prop::collection::vec(prop::array::uniform3(-4i8..4), 3..24),
        corners in prop::collection::vec(0usize..1000, 3..90),
        which in 0usize..1000,
    ) {
        let count = points.len();
        let positions: Vec<f32> = points.iter().flatten().map(|&x| f32::from(x)).collect();
        let indices: Vec<u32> = corners.chunks_exact(3).flatten().map(|&i| (i % count) as u32).collect();
        let mesh = one(Primitive { count, attributes: vec![attribute("POSITION", 3, positions)], targets: Vec::new(), indices });
        let all: Vec<Settings> = all_settings().collect();
        let settings = all[which % all.len()];
        let sequence = simplify(&mesh, &settings);
        for steps in [0, sequence.steps.len() / 2, sequence.steps.len()] {
            let left = triangles(&mesh, &sequence, steps);
            prop_assert_eq!(left.len(), sequence.triangles_after(steps));
            prop_assert!(left.iter().flatten().flatten().all(|x| x.abs() < 100.0));
        }
        prop_assert!(sequence.steps.windows(2).all(|pair| pair[1].triangles <= pair[0].triangles));
    }
}

/// A cut of `mesh` at `triangles`, and what fitting makes of it.
fn fitted<R>(
    mesh: &Mesh,
    triangles: usize,
    hold_borders: bool,
    see: impl Fn(&Replay, &[replay::CutPrimitive]) -> R,
) -> [R; 3] {
    let sequence = simplify(mesh, &BALANCED);
    let welded = Welded::new(mesh);
    let mut replay = Replay::new(mesh, &welded, &sequence);
    let steps = sequence.cut_at(triangles);
    replay.advance(steps);
    let mut cuts = replay.primitives();
    let before = see(&replay, &cuts);
    let fit = replay::refit::Fit { shape: true, normals: Some(0.9), hold_borders };
    replay.refit(&mut cuts, &replay::refit::Importance::new(mesh, &welded), fit);
    let after = see(&replay, &cuts);
    replay.advance(steps);
    let cuts = replay.primitives();
    [before, after, see(&replay, &cuts)]
}

#[test]
fn a_fit_moves_a_coarse_surface_closer_and_is_taken_back() {
    let mesh = torus(48, 24);
    // Mean distance of the faces' corners, middles and edges from the true surface.
    let off = |replay: &Replay, cuts: &[replay::CutPrimitive]| {
        let at = |i: u32| replay.wedge_position(cuts[0].wedges[i as usize]).map(f64::from);
        let mut sum = 0.0;
        for t in cuts[0].indices.chunks_exact(3) {
            let p = [at(t[0]), at(t[1]), at(t[2])];
            for w in [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [1.0 / 3.0; 3]] {
                let q = [0, 1, 2].map(|i| p[0][i] * w[0] + p[1][i] * w[1] + p[2][i] * w[2]);
                let r = (q[0] * q[0] + q[1] * q[1]).sqrt() - 1.0;
                sum += ((r * r + q[2] * q[2]).sqrt() - 0.4).abs();
            }
        }
        sum / cuts[0].indices.len() as f64
    };
    let [before, after, again] = fitted(&mesh, 160, false, off);
    assert!(after < 0.95 * before, "{before} became {after}");
    assert_eq!(before, again);
}

#[test]
fn a_fit_keeps_a_flat_grid_flat_and_its_texture_in_place() {
    let mesh = one(grid(16, 16, |u, v| ([u, v, 0.5], [0.25 + u * 0.5, 1.0 - v])));
    let worst = |replay: &Replay, cuts: &[replay::CutPrimitive]| {
        let own = replay.vertices(0, &cuts[0]);
        let rows = own.attributes[0].values.chunks_exact(3).zip(own.attributes[1].values.chunks_exact(2));
        let off = rows.map(|(p, t)| {
            let texture = (t[0] - (0.25 + p[0] * 0.5)).abs().max((t[1] - (1.0 - p[1])).abs());
            texture.max((p[2] - 0.5).abs())
        });
        off.fold(0.0, f32::max)
    };
    let [_, after, _] = fitted(&mesh, 20, false, worst);
    assert!(after < 1e-3, "{after}");
}

#[test]
fn a_fit_leaves_held_borders_where_they_are() {
    let mesh = one(grid(16, 16, |u, v| ([u, v, (u * 7.0).sin() * (v * 5.0).cos() * 0.2], [u, v])));
    // Ends of edges of one face.
    let corners = |replay: &Replay, cuts: &[replay::CutPrimitive]| {
        let mut edges = std::collections::BTreeMap::new();
        for t in cuts[0].indices.chunks_exact(3) {
            let w = [0, 1, 2].map(|i| replay.wedge_position(cuts[0].wedges[t[i] as usize]).map(f32::to_bits));
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                *edges.entry([w[a].min(w[b]), w[a].max(w[b])]).or_insert(0) += 1;
            }
        }
        let border: std::collections::BTreeSet<_> =
            edges.into_iter().filter(|&(_, faces)| faces == 1).flat_map(|(edge, _)| edge).collect();
        border
    };
    let [before, after, _] = fitted(&mesh, 60, true, corners);
    assert_eq!(before, after);
    let [before, after, _] = fitted(&mesh, 60, false, corners);
    assert_ne!(before, after);
}
