//! What hangs together in a mesh: triangles with a position in common, directly or through others.
//!
//! Positions are compared bit for bit (with one zero). Sorting does the work, so the time is near-linear for any input.

use crate::gltf::scene::SourceMesh;
use crate::gltf::split::Part;
use crate::mesh::hash::positive_zero;

/// The parts of a mesh in the order of their first triangles; none if all of it is one primitive without triangles.
pub(super) fn components(mesh: &SourceMesh) -> Vec<Part> {
    let primitives: Vec<_> = mesh.triangle_primitives().collect();
    let mut sorted: Vec<([u32; 3], u32)> = Vec::with_capacity(primitives.iter().map(|(_, p)| p.count).sum());
    let mut starts = Vec::with_capacity(primitives.len());
    for (_, primitive) in &primitives {
        starts.push(sorted.len());
        let first = sorted.len() as u32;
        sorted.extend((first..).zip(primitive.positions()).map(|(i, p)| (p.map(positive_zero), i)));
    }
    sorted.sort_unstable();
    let mut place = vec![0u32; sorted.len()];
    let mut places = 0u32;
    for run in sorted.chunk_by(|a, b| a.0 == b.0) {
        for &(_, vertex) in run {
            place[vertex as usize] = places;
        }
        places += 1;
    }
    drop(sorted);
    let mut parents: Vec<u32> = (0..places).collect();
    let corner = |start: usize, vertex: u32| place[start + vertex as usize];
    for (&start, (_, primitive)) in starts.iter().zip(&primitives) {
        for t in primitive.indices.as_chunks::<3>().0 {
            let [a, b, c] = t.map(|v| corner(start, v));
            join(&mut parents, a, b);
            join(&mut parents, b, c);
        }
    }
    // Numbers of the parts by their roots, in the order of their first triangles.
    let mut numbers = vec![u32::MAX; places as usize];
    let mut parts: Vec<Part> = Vec::new();
    for (&start, &(index, primitive)) in starts.iter().zip(&primitives) {
        for (number, t) in (0..).zip(primitive.indices.as_chunks::<3>().0) {
            let root = find(&mut parents, corner(start, t[0])) as usize;
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

/// The root of a set, halving the path to it.
fn find(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}
