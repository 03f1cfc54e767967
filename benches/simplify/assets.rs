//! What is simplified: two meshes of the corpus, and a large one made of the second.

use std::path::Path;

use lodbake::gltf::read;
use lodbake::mesh::{Attribute, Format, Mesh, Primitive};

/// One mesh, as lodbake and as meshoptimizer take it.
pub struct Asset {
    /// As it is printed.
    pub name: &'static str,
    /// All primitives.
    pub mesh: Mesh,
    /// The same in one piece.
    pub flat: Flat,
}

/// One index buffer over one vertex buffer.
pub struct Flat {
    /// Of all primitives.
    pub indices: Vec<u32>,
    /// Of all primitives.
    pub positions: Vec<[f32; 3]>,
    /// Normal and texture coordinate, zero where there is none.
    pub attributes: Vec<[f32; 5]>,
}

/// Meshes whose name has one of `names` in it; all if there are none.
pub fn load<'a>(corpus: &'a Path, names: &'a [String]) -> impl Iterator<Item = Asset> + 'a {
    let all = [
        ("sheen-cloth", "quality/sheen-cloth/SheenCloth.glb", false),
        ("chinese-dragon", "quality/chinese-dragon/chinesedragon.gltf", false),
        ("large-dragon", "quality/chinese-dragon/chinesedragon.gltf", true),
    ];
    let wanted = move |name: &str| names.is_empty() || names.iter().any(|part| name.contains(part.as_str()));
    all.into_iter().filter(move |(name, ..)| wanted(name)).map(move |(name, file, finer)| {
        let scene = read::read(&corpus.join(file)).expect("a scene of the corpus");
        let largest = scene.meshes.iter().max_by_key(|mesh| mesh.triangles()).expect("a mesh");
        let mesh = Mesh { primitives: largest.triangle_primitives().map(|(_, p)| p.clone()).collect() };
        let mesh = if finer { refined(&mesh) } else { mesh };
        Asset { name, flat: flat(&mesh), mesh }
    })
}

/// The whole of `mesh` in one piece.
pub fn flat(mesh: &Mesh) -> Flat {
    let mut out = Flat { indices: Vec::new(), positions: Vec::new(), attributes: Vec::new() };
    for primitive in &mesh.primitives {
        let first = out.positions.len() as u32;
        out.indices.extend(primitive.indices.iter().map(|i| first + i));
        out.positions.extend_from_slice(primitive.positions());
        let column = |name: &str, vertex: usize, at: usize| {
            primitive.attribute(name).map_or(0.0, |a| a.values[vertex * a.components + at])
        };
        out.attributes.extend((0..primitive.count).map(|v| {
            [0, 1, 2, 3, 4].map(|at| if at < 3 { column("NORMAL", v, at) } else { column("TEXCOORD_0", v, at - 3) })
        }));
    }
    out
}

/// Parts that each edge of a [`refined`] mesh is cut into.
const PARTS: usize = 3;

/// Nine triangles for each, on the curved patch that the corners and their normals span (T. Boubekeur, M. Alexa, *Phong
/// tessellation*, 2008), with texture coordinates from the front: a dense, smooth surface as sculpting tools make it. Only
/// for meshes of one primitive whose vertices are welded.
fn refined(mesh: &Mesh) -> Mesh {
    let [source] = mesh.primitives.as_slice() else { panic!("one primitive") };
    let points: Vec<[f64; 3]> = source.positions().iter().map(|p| p.map(f64::from)).collect();
    let normals: Vec<[f64; 3]> =
        bytemuck::cast_slice::<f32, [f32; 3]>(&source.attribute("NORMAL").expect("normals").values)
            .iter()
            .map(|n| n.map(f64::from))
            .collect();
    let mut positions: Vec<[f32; 3]> = source.positions().to_vec();
    let mut known = std::collections::BTreeMap::new();
    let mut out_normals: Vec<[f32; 3]> = normals.iter().map(|n| n.map(|x| x as f32)).collect();
    let mut indices = Vec::with_capacity(source.indices.len() * PARTS * PARTS);
    for t in source.indices.chunks_exact(3) {
        let t = [t[0], t[1], t[2]];
        let mut at = |i: usize, j: usize| {
            let steps = [PARTS - i - j, i, j];
            // A point on an edge depends on that edge alone, lesser vertex first: both sides find the same.
            let mut corners: Vec<(u32, usize)> = t.into_iter().zip(steps).filter(|(_, n)| 0 < *n).collect();
            corners.sort_unstable();
            if let [(only, _)] = corners[..] {
                return only;
            }
            *known.entry(corners.clone()).or_insert_with(|| {
                let weights: Vec<(usize, f64)> =
                    corners.iter().map(|&(v, n)| (v as usize, n as f64 / PARTS as f64)).collect();
                let blend = |of: &dyn Fn(usize) -> [f64; 3]| {
                    weights.iter().fold([0.0; 3], |sum, &(v, w)| [0, 1, 2].map(|x| sum[x] + of(v)[x] * w))
                };
                // The blend of the projections on the corners' planes, three quarters of the way.
                let flat = blend(&|v| points[v]);
                let curved = blend(&|v| {
                    let off: f64 = (0..3).map(|x| (flat[x] - points[v][x]) * normals[v][x]).sum();
                    [0, 1, 2].map(|x| flat[x] - off * normals[v][x])
                });
                positions.push([0, 1, 2].map(|x| (flat[x] * 0.25 + curved[x] * 0.75) as f32));
                let normal = blend(&|v| normals[v]);
                let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
                out_normals.push(normal.map(|x| (x / length) as f32));
                positions.len() as u32 - 1
            })
        };
        for i in 0..PARTS {
            for j in 0..PARTS - i {
                indices.extend([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < PARTS {
                    indices.extend([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    let texcoords: Vec<[f32; 2]> = positions.iter().map(|p| [p[0], p[1]]).collect();
    let attribute = |name: &str, components, values: &[f32]| Attribute {
        name: name.into(),
        components,
        format: Format::F32,
        values: values.to_vec(),
    };
    let attributes = vec![
        attribute("NORMAL", 3, bytemuck::cast_slice(&out_normals)),
        attribute("POSITION", 3, bytemuck::cast_slice(&positions)),
        attribute("TEXCOORD_0", 2, bytemuck::cast_slice(&texcoords)),
    ];
    Mesh { primitives: vec![Primitive { count: positions.len(), attributes, targets: Vec::new(), indices }] }
}
