//! What every metric must do, whatever it prices: each property over every metric of [`MetricKind::ALL`], with every
//! placement that it has. A metric that does not claim a property is named here, with the reason.

use std::collections::{BTreeMap, BTreeSet};

use lodbake::mesh::layout::AttributeScale;
use lodbake::mesh::{Attribute, Format, LevelOwnVertices, Mesh, Primitive};
use lodbake::metric::Placement;
use lodbake::metric::its::EdgeWeights;
use lodbake::simplify::progressive::Progressive;
use lodbake::simplify::replay::{CutPrimitive, Replay, Welded};
use lodbake::simplify::{MetricKind, Settings, simplify};

const BALANCED: Settings = Settings {
    metric: MetricKind::Its,
    placement: Placement::Optimal,
    attributes: AttributeScale { normal: 0.003, texcoord: 0.3, color: 0.1 },
    edges: EdgeWeights { border: 1.0, seam: 0.3, crease: 0.04 },
    lock_border: false,
    memoryless: true,
    by_visibility: true,
};

/// Every metric with every placement that it has.
fn all_settings() -> impl Iterator<Item = Settings> {
    MetricKind::ALL.into_iter().flat_map(|metric| {
        let places = [Placement::Optimal, Placement::Subset].into_iter().filter(move |&p| metric.can_place(p));
        places.map(move |placement| Settings { metric, placement, ..BALANCED })
    })
}

fn attribute(name: &str, components: usize, values: Vec<f32>) -> Attribute {
    Attribute { name: name.to_owned(), components, format: Format::F32, values }
}

/// What stands at a point of a grid.
struct Point {
    position: [f32; 3],
    texcoord: [f32; 2],
}

/// Two triangles a cell, with normals (up), two sets of texture coordinates (the second turned by 90°) and a colour.
fn grid(columns: u32, rows: u32, place: impl Fn(f32, f32) -> Point) -> Primitive {
    let (mut positions, mut texcoords, mut turned, mut colors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut indices = Vec::new();
    for y in 0..=rows {
        for x in 0..=columns {
            let point = place(x as f32 / columns as f32, y as f32 / rows as f32);
            positions.extend(point.position);
            texcoords.extend(point.texcoord);
            turned.extend([-point.texcoord[1], point.texcoord[0]]);
            colors.extend([point.texcoord[0], 0.5, point.texcoord[1], 1.0]);
            if x < columns && y < rows {
                let at = y * (columns + 1) + x;
                let above = at + columns + 1;
                indices.extend([at, at + 1, above + 1, at, above + 1, above]);
            }
        }
    }
    let count = positions.len() / 3;
    let normals = normals(&positions, &indices);
    let attributes = vec![
        attribute("POSITION", 3, positions),
        attribute("NORMAL", 3, normals),
        attribute("TEXCOORD_0", 2, texcoords),
        attribute("TEXCOORD_1", 2, turned),
        attribute("COLOR_0", 4, colors),
    ];
    Primitive { count, attributes, targets: Vec::new(), indices }
}

/// Unit normals at stored vertices.
fn normals(positions: &[f32], indices: &[u32]) -> Vec<f32> {
    let at = |i: u32| [0, 1, 2].map(|k| f64::from(positions[i as usize * 3 + k]));
    let mut sums = vec![0.0f64; positions.len()];
    for t in indices.chunks_exact(3) {
        let n = cross(at(t[0]), at(t[1]), at(t[2]));
        for &i in t {
            (0..3).for_each(|k| sums[i as usize * 3 + k] += n[k]);
        }
    }
    let unit = |n: &[f64]| {
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
        [0, 1, 2].map(|k| if length > 0.0 { (n[k] / length) as f32 } else { [0.0, 0.0, 1.0][k] })
    };
    sums.chunks_exact(3).flat_map(unit).collect()
}

fn cross(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn one(primitive: Primitive) -> Mesh {
    Mesh { primitives: vec![primitive] }
}

/// A closed surface with a seam of the texture in each direction.
fn torus(columns: u32, rows: u32) -> Mesh {
    use std::f32::consts::TAU;
    one(grid(columns, rows, |u, v| {
        // The last column and row are the first again, bit for bit.
        let (a, b) = (u.fract() * TAU, v.fract() * TAU);
        let r = 1.0 + 0.4 * b.cos();
        Point { position: [r * a.cos(), r * a.sin(), 0.4 * b.sin()], texcoord: [u, v] }
    }))
}

/// A bumpy sheet.
fn sheet(columns: u32, rows: u32, from: f32, to: f32) -> Primitive {
    grid(columns, rows, |u, v| {
        let x = from + (to - from) * u;
        Point { position: [x, v, (x * 9.0).sin() * (v * 8.0).cos() * 0.1], texcoord: [x, v] }
    })
}

/// Two materials side by side.
fn two_materials() -> Mesh {
    Mesh { primitives: vec![sheet(10, 12, 0.0, 0.5), sheet(10, 12, 0.5, 1.0)] }
}

/// Two sheets with a gap between them, narrower than their cells.
fn gap() -> Mesh {
    Mesh { primitives: vec![sheet(10, 12, 0.0, 0.495), sheet(10, 12, 0.505, 1.0)] }
}

fn meshes() -> [(&'static str, Mesh); 4] {
    [("torus", torus(24, 16)), ("sheet", one(sheet(16, 16, 0.0, 1.0))), ("materials", two_materials()), ("gap", gap())]
}

/// One level: each primitive's triangles and vertices.
struct Cut {
    primitives: Vec<(CutPrimitive, LevelOwnVertices)>,
}

impl Cut {
    fn new(mesh: &Mesh, sequence: &Progressive, steps: usize) -> Self {
        let welded = Welded::new(mesh);
        let mut replay = Replay::new(mesh, &welded, sequence);
        replay.advance(steps);
        let cuts = replay.primitives();
        let own = |(index, cut): (usize, CutPrimitive)| {
            let vertices = replay.vertices(index, &cut);
            (cut, vertices)
        };
        Self { primitives: cuts.into_iter().enumerate().map(own).collect() }
    }

    fn triangles(&self) -> Vec<[[f32; 3]; 3]> {
        let mut out = Vec::new();
        for (cut, own) in &self.primitives {
            let at = |i: u32| [0, 1, 2].map(|k| own.attributes[0].values[i as usize * 3 + k]);
            out.extend(cut.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
        }
        out
    }
}

/// Cuts to look at: from none to all.
fn steps(sequence: &Progressive) -> Vec<usize> {
    let all = sequence.steps.len();
    vec![0, all / 4, all / 2, all * 3 / 4, all * 9 / 10, all]
}

#[test]
fn the_same_input_gives_the_same_sequence() {
    for (name, mesh) in meshes() {
        for settings in all_settings() {
            let (one, two) = (simplify(&mesh, &settings), simplify(&mesh, &settings));
            assert!(one == two, "{name}, {settings:?}");
            let bytes = |s: &Progressive| postcard::to_stdvec(s).expect("plain numbers");
            assert_eq!(bytes(&one), bytes(&two), "{name}, {settings:?}");
        }
    }
}

#[test]
fn every_level_is_a_cut_of_one_sequence_and_none_is_finer_than_the_one_before() {
    for (name, mesh) in meshes() {
        for settings in all_settings() {
            let sequence = simplify(&mesh, &settings);
            assert!(sequence.steps.windows(2).all(|p| p[1].triangles <= p[0].triangles), "{name}, {settings:?}");
            assert!(sequence.triangles_after(sequence.steps.len()) < mesh.triangles() / 3, "{name}, {settings:?}");
            let mut gone = BTreeSet::new();
            for step in &sequence.steps {
                assert!(!gone.contains(&step.kept) && gone.insert(step.gone), "{name}, {settings:?}: {step:?}");
            }
            for steps in steps(&sequence) {
                let left = Cut::new(&mesh, &sequence, steps).triangles().len();
                assert_eq!(left, sequence.triangles_after(steps), "{name}, {settings:?}");
            }
        }
    }
}

#[test]
fn numbers_are_finite_errors_not_negative_and_triangles_whole() {
    for (name, mesh) in meshes() {
        for settings in all_settings() {
            let sequence = simplify(&mesh, &settings);
            assert!(
                sequence.steps.iter().all(|s| 0.0 <= s.cost && s.cost.is_finite() && (0.0..=1.0).contains(&s.t)),
                "{name}, {settings:?}"
            );
            assert!(sequence.bounds.windows(2).all(|p| p[0] <= p[1]), "{name}, {settings:?}: bounds fall");
            assert!(
                sequence.bounds.is_empty() || sequence.bounds.len() == sequence.steps.len(),
                "{name}, {settings:?}"
            );
            for steps in steps(&sequence) {
                for (cut, own) in Cut::new(&mesh, &sequence, steps).primitives {
                    let finite = own.attributes.iter().flat_map(|a| &a.values).all(|x| x.is_finite());
                    assert!(finite, "{name}, {settings:?}");
                    for t in cut.indices.chunks_exact(3) {
                        assert!(t.iter().all(|&i| (i as usize) < own.count), "{name}, {settings:?}: {t:?}");
                        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "{name}, {settings:?}: {t:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_flat_textured_grid_stays_flat_and_its_textures_where_they_were() {
    let mesh = one(grid(12, 9, |u, v| Point { position: [u * 4.0, v * 3.0, 0.25], texcoord: [u * 0.5, v] }));
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        for steps in [sequence.steps.len() / 2, sequence.cut_at(24)] {
            let cut = Cut::new(&mesh, &sequence, steps);
            let (_, own) = &cut.primitives[0];
            let rows = |at: usize, n: usize| own.attributes[at].values.chunks_exact(n);
            for (((p, n), t), s) in rows(0, 3).zip(rows(1, 3)).zip(rows(2, 2)).zip(rows(3, 2)) {
                assert!((p[2] - 0.25).abs() < 1e-5 && n[2] > 0.9999, "{settings:?}: {p:?} {n:?}");
                let off = [t[0] - p[0] / 8.0, t[1] - p[1] / 3.0, s[0] + p[1] / 3.0, s[1] - p[0] / 8.0];
                assert!(off.iter().all(|x| x.abs() < 1e-3), "{settings:?}: {p:?} has {t:?} and {s:?}");
            }
        }
    }
}

#[test]
fn a_closed_surface_stays_closed() {
    let mesh = torus(24, 16);
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        for steps in steps(&sequence) {
            let mut edges: BTreeMap<_, i32> = BTreeMap::new();
            for t in Cut::new(&mesh, &sequence, steps).triangles() {
                let p = t.map(|p| p.map(f32::to_bits));
                for i in 0..3 {
                    *edges.entry((p[i], p[(i + 1) % 3])).or_default() += 1;
                    *edges.entry((p[(i + 1) % 3], p[i])).or_default() -= 1;
                }
            }
            assert!(edges.values().all(|&n| n == 0), "{settings:?}: an open edge after {steps}");
        }
    }
}

#[test]
fn locked_borders_stay_bit_for_bit() {
    let mesh = one(sheet(10, 10, 0.0, 1.0));
    let border = |p: &[f32; 3]| p[0] == 0.0 || p[0] == 1.0 || p[1] == 0.0 || p[1] == 1.0;
    let bits = |points: Vec<[f32; 3]>| -> BTreeSet<[u32; 3]> {
        points.iter().filter(|p| border(p)).map(|p| p.map(f32::to_bits)).collect()
    };
    let before = bits(mesh.primitives[0].positions().to_vec());
    for settings in all_settings() {
        let sequence = simplify(&mesh, &Settings { lock_border: true, ..settings });
        let left = Cut::new(&mesh, &sequence, sequence.steps.len()).triangles();
        assert!(left.len() < mesh.triangles() * 2 / 3, "{settings:?}: {} triangles", left.len());
        assert_eq!(bits(left.into_iter().flatten().collect()), before, "{settings:?}");
    }
}

#[test]
fn subset_placement_leaves_only_source_vertices() {
    for (name, mesh) in meshes() {
        for settings in all_settings().filter(|s| s.placement == Placement::Subset) {
            let sequence = simplify(&mesh, &settings);
            for steps in steps(&sequence) {
                let cut = Cut::new(&mesh, &sequence, steps);
                for ((_, own), source) in cut.primitives.iter().zip(&mesh.primitives) {
                    // Normals are unit vectors again, which costs them their last bits.
                    let key = |attributes: &[Attribute], i: usize| -> Vec<u32> {
                        let exact = attributes.iter().filter(|a| a.name != "NORMAL");
                        exact
                            .flat_map(|a| a.values[i * a.components..][..a.components].iter().map(|x| round(*x)))
                            .collect()
                    };
                    let known: BTreeSet<Vec<u32>> = (0..source.count).map(|i| key(&source.attributes, i)).collect();
                    for i in 0..own.count {
                        assert!(known.contains(&key(&own.attributes, i)), "{name}, {settings:?}");
                    }
                }
            }
        }
    }
}

/// Values pass through the scale of the error and back, which may cost the last bits.
fn round(x: f32) -> u32 {
    ((x + 0.0) * 8192.0).round().to_bits()
}

#[test]
fn materials_keep_their_border_and_their_triangles() {
    let mesh = two_materials();
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        let cut = Cut::new(&mesh, &sequence, sequence.cut_at(mesh.triangles() / 5));
        let mut edges: BTreeMap<_, usize> = BTreeMap::new();
        for t in cut.triangles() {
            for i in 0..3 {
                let mut ends = [t[i].map(f32::to_bits), t[(i + 1) % 3].map(f32::to_bits)];
                ends.sort_unstable();
                *edges.entry(ends).or_default() += 1;
            }
        }
        // An edge inside the sheet that has one triangle only is a crack.
        let inside = |p: [u32; 3]| {
            let [x, y, _] = p.map(f32::from_bits);
            (0.1..0.9).contains(&x) && (0.1..0.9).contains(&y)
        };
        let cracks = edges.iter().filter(|(ends, n)| **n == 1 && inside(ends[0]) && inside(ends[1])).count();
        // `naive` and `its-paper` see no outline: the sheet shrinks into its middle, and its border with it.
        let sees_outlines = !matches!(settings.metric, MetricKind::Naive | MetricKind::ItsPaper);
        assert!(!sees_outlines || cracks == 0, "{settings:?}: {cracks} cracks");
        for (index, (primitive, _)) in cut.primitives.iter().enumerate() {
            assert!(!primitive.indices.is_empty(), "{settings:?}: nothing left of material {index}");
        }
    }
}

/// `gaps` alone claims to join what no edge connects.
#[test]
fn only_metrics_that_join_parts_close_gaps() {
    let mesh = gap();
    for settings in all_settings() {
        let sequence = simplify(&mesh, &settings);
        // A vertex of the left half and one of the right half became one.
        let welded = Welded::new(&mesh);
        let left = |v: u32| welded.positions[v as usize][0] < 0.5;
        let mut side: Vec<bool> = (0..sequence.vertices).map(left).collect();
        let mut joined = 0;
        for step in &sequence.steps {
            if side[step.kept as usize] != side[step.gone as usize] {
                joined += 1;
                side[step.kept as usize] = true;
            }
        }
        let joins = settings.metric == MetricKind::Gaps && settings.placement == Placement::Optimal;
        assert_eq!(joined > 0, joins, "{settings:?}: {joined} joined");
    }
}

/// A sheet whose texture is stretched unevenly, so that nothing in it is flat.
fn stretched() -> Mesh {
    one(grid(20, 20, |u, v| Point {
        position: [u, v, (u * 5.0).sin() * (v * 4.0).cos() * 0.2],
        texcoord: [u + 0.1 * (u * 6.0).sin() * (v * 3.0).sin(), v * v * 0.5 + 0.5 * v],
    }))
}

/// Corners in space and in the first texture, by material.
type Textured = Vec<(usize, [[f64; 3]; 3], [[f64; 2]; 3])>;

fn textured(cut: &Cut) -> Textured {
    let mut out = Vec::new();
    for (material, (cut, own)) in cut.primitives.iter().enumerate() {
        let at = |name: usize, n: usize, i: u32, k: usize| f64::from(own.attributes[name].values[i as usize * n + k]);
        out.extend(cut.indices.chunks_exact(3).map(|t| {
            let p = [0, 1, 2].map(|i| [0, 1, 2].map(|k| at(0, 3, t[i], k)));
            (material, p, [0, 1, 2].map(|i| [0, 1].map(|k| at(2, 2, t[i], k))))
        }));
    }
    out
}

/// Points of the surface at a place of the texture, by material; none on the very edge of a triangle.
fn points(surface: &Textured, at: [f64; 2]) -> Vec<(usize, [f64; 3])> {
    let twice = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    let of = |(material, p, uv): &(usize, [[f64; 3]; 3], [[f64; 2]; 3])| {
        let whole = twice(uv[0], uv[1], uv[2]);
        let shares = [0, 1, 2].map(|i| twice(at, uv[(i + 1) % 3], uv[(i + 2) % 3]) / whole);
        let inside = shares.iter().all(|&s| 1e-4 < s);
        inside.then(|| (*material, [0, 1, 2].map(|k| (0..3).map(|i| shares[i] * p[i][k]).sum())))
    };
    surface.iter().filter_map(of).collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>().sqrt()
}

/// 1,000 places of the texture, several levels: source and level are nowhere further apart than `aps` states.
#[test]
fn the_true_deviation_of_a_texture_never_exceeds_the_bound() {
    let meshes = [("torus", torus(24, 16)), ("stretched", stretched()), ("materials", two_materials())];
    let mut random = 0x9E37_79B9_7F4A_7C15u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1u64 << 53) as f64
    };
    for (name, mesh) in meshes {
        for placement in [Placement::Optimal, Placement::Subset] {
            let sequence = simplify(&mesh, &Settings { metric: MetricKind::Aps, placement, ..BALANCED });
            let source = textured(&Cut::new(&mesh, &sequence, 0));
            for ratio in [0.75, 0.5, 0.25, 0.1, 0.05] {
                let steps = sequence.cut_at((mesh.triangles() as f64 * ratio) as usize);
                let bound = sequence.bound_after(steps).expect("aps states one");
                let level = textured(&Cut::new(&mesh, &sequence, steps));
                let (mut pairs, mut most) = (0, 0.0f64);
                while pairs < 1000 {
                    let at = [next() * 1.2 - 0.1, next() * 1.2 - 0.1];
                    let before = points(&source, at);
                    for (material, point) in points(&level, at) {
                        let off = before.iter().filter(|(m, _)| *m == material).map(|(_, p)| distance(*p, point));
                        if let Some(off) = off.reduce(f64::min) {
                            pairs += 1;
                            most = most.max(off);
                            assert!(off <= bound, "{name}, {placement:?}, {ratio}: {off} > {bound} at {at:?}");
                        }
                    }
                }
                assert!(
                    bound < 30.0 * most,
                    "{name}, {placement:?}, {ratio}: a bound of {bound} says nothing of {most}"
                );
            }
        }
    }
}

/// A dome over a round chart, whose border turns by 7.5° at each vertex.
fn dome() -> Mesh {
    use std::f32::consts::TAU;
    let (sides, rings) = (48u32, 12u32);
    let at = |x: f32, y: f32| ([x, y, (1.0 - x * x - y * y).max(0.0) * 0.5], [0.5 + x * 0.5, 0.5 + y * 0.5]);
    let mut rows = vec![at(0.0, 0.0)];
    let mut indices = Vec::new();
    for ring in 1..=rings {
        for side in 0..sides {
            let (r, a) = (ring as f32 / rings as f32, side as f32 / sides as f32 * TAU);
            rows.push(at(r * a.cos(), r * a.sin()));
            let (here, next) = ((ring - 1) * sides + side + 1, (ring - 1) * sides + (side + 1) % sides + 1);
            if ring == 1 {
                indices.extend([0, here, next]);
            } else {
                indices.extend([here - sides, here, next, here - sides, next, next - sides]);
            }
        }
    }
    let attributes = vec![
        attribute("POSITION", 3, rows.iter().flat_map(|row| row.0).collect()),
        attribute("TEXCOORD_0", 2, rows.iter().flat_map(|row| row.1).collect()),
    ];
    one(Primitive { count: rows.len(), attributes, targets: Vec::new(), indices })
}

/// `aps` and `tmpm` work within the texture: what they leave covers what the source covered, the same way round.
#[test]
fn charts_keep_their_outline_and_no_triangle_turns_over_in_the_texture() {
    let areas = |mesh: &Mesh, sequence: &Progressive, steps: usize| -> Vec<f64> {
        let cut = Cut::new(mesh, sequence, steps);
        let mut out = Vec::new();
        for (cut, own) in &cut.primitives {
            let uv = own.attributes.iter().find(|a| a.name == "TEXCOORD_0").expect("it is textured");
            let at = |i: u32| [0, 1].map(|k| f64::from(uv.values[i as usize * 2 + k]));
            out.extend(cut.indices.chunks_exact(3).map(|t| {
                let (a, b, c) = (at(t[0]), at(t[1]), at(t[2]));
                ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) / 2.0
            }));
        }
        out
    };
    for (name, mesh) in [("dome", dome()), ("torus", torus(24, 16)), ("materials", two_materials())] {
        for settings in all_settings().filter(|s| matches!(s.metric, MetricKind::Aps | MetricKind::Tmpm)) {
            let sequence = simplify(&mesh, &settings);
            let source: f64 = areas(&mesh, &sequence, 0).iter().sum();
            for steps in steps(&sequence) {
                let left = areas(&mesh, &sequence, steps);
                assert!(left.iter().all(|&area| 0.0 < area), "{name}, {settings:?}: turned over");
                let sum: f64 = left.iter().sum();
                assert!((sum - source).abs() < 2e-3 * source, "{name}, {settings:?}: {sum} of {source}");
            }
            assert!(sequence.triangles_after(sequence.steps.len()) < mesh.triangles() / 4, "{name}, {settings:?}");
        }
    }
}

/// Quadrics must beat the baseline: the thesis measures up to half the error (section 2.1).
#[test]
fn quadrics_err_less_than_the_naive_scheme() {
    let mesh = one(sheet(24, 24, 0.0, 1.0));
    let off = |metric: MetricKind| {
        let sequence = simplify(&mesh, &Settings { metric, ..BALANCED });
        let cut = Cut::new(&mesh, &sequence, sequence.cut_at(mesh.triangles() / 8));
        // Height of the level's corners over the function that the sheet samples.
        let height = |p: [f32; 3]| (p[2] - (p[0] * 9.0).sin() * (p[1] * 8.0).cos() * 0.1).abs();
        let middles = cut.triangles().into_iter().map(|t| [0, 1, 2].map(|k| (t[0][k] + t[1][k] + t[2][k]) / 3.0));
        let heights: Vec<f32> = middles.map(height).collect();
        f64::from(heights.iter().sum::<f32>()) / heights.len() as f64
    };
    let naive = off(MetricKind::Naive);
    for metric in [MetricKind::Its, MetricKind::Qem, MetricKind::QemAttributes, MetricKind::Ias, MetricKind::Gaps] {
        assert!(off(metric) < naive, "{metric:?}: {} against {naive}", off(metric));
    }
}
