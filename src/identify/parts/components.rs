//! What hangs together in a mesh: triangles with a position in common, directly or through others.

use crate::gltf::scene::SourceMesh;
use crate::gltf::split::Part;
use crate::identify::places::places;
use crate::mesh::sets::Sets;

/// The parts of a mesh in the order of their first triangles; none if all of it is one primitive without triangles.
pub(super) fn components(mesh: &SourceMesh) -> Vec<Part> {
    let primitives: Vec<_> = mesh.triangle_primitives().collect();
    let mut starts = Vec::with_capacity(primitives.len());
    let mut count = 0;
    for (_, primitive) in &primitives {
        starts.push(count);
        count += primitive.positions().len();
    }
    let (place, keys) = places(primitives.iter().flat_map(|(_, primitive)| primitive.positions()));
    let mut sets = Sets::new(keys.len());
    let corner = |start: usize, vertex: u32| place[start + vertex as usize] as usize;
    for (&start, (_, primitive)) in starts.iter().zip(&primitives) {
        for t in primitive.indices.as_chunks::<3>().0 {
            let [a, b, c] = t.map(|v| corner(start, v));
            sets.join(a, b);
            sets.join(b, c);
        }
    }
    // Numbers of the parts by their roots, in the order of their first triangles.
    let mut numbers = vec![u32::MAX; keys.len()];
    let mut parts: Vec<Part> = Vec::new();
    for (&start, &(index, primitive)) in starts.iter().zip(&primitives) {
        for (number, t) in (0..).zip(primitive.indices.as_chunks::<3>().0) {
            let root = sets.root(corner(start, t[0]));
            if numbers[root] == u32::MAX {
                numbers[root] = parts.len() as u32;
                parts.push(Part { mesh: mesh.index, triangles: Vec::new() });
            }
            let own = &mut parts[numbers[root] as usize].triangles;
            match own.last_mut() {
                Some((last, triangles)) if *last == index => triangles.push(number),
                _ => own.push((index, vec![number])),
            }
        }
    }
    parts
}
