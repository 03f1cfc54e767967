//! Which contractions are allowed: no triangle may turn over.

use crate::mesh::topology::{NEXT, PREVIOUS, Topology};
use crate::quadric::{cross, dot, sub};

/// No triangle may turn by more than `acos(0.2)` = 78°.
const LEAST_COSINE: f64 = 0.2;

/// True if no triangle that survives the contraction turns by more than 78° when `a` and `b` move to `position`.
/// A triangle that has no area now may turn as it likes; one that has area may not lose all of it.
pub fn turns_gently(surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> bool {
    ring_turns_gently(surface, a, b, position) && ring_turns_gently(surface, b, a, position)
}

fn ring_turns_gently(surface: &Topology, moved: u32, other: u32, position: [f64; 3]) -> bool {
    let here = surface.positions[moved as usize];
    surface.ring(moved).iter().all(|corner| {
        let face = &surface.faces[corner.face()];
        let (second, third) = (face.v[NEXT[corner.at()]], face.v[PREVIOUS[corner.at()]]);
        if second == other || third == other {
            return true;
        }
        let q = surface.positions[second as usize];
        let opposite = sub(surface.positions[third as usize], q);
        let before = cross(sub(q, here), opposite);
        let after = cross(sub(q, position), opposite);
        let size = dot(before, before);
        let turned = dot(before, after);
        size == 0.0 || (turned > 0.0 && turned * turned > LEAST_COSINE * LEAST_COSINE * (size * dot(after, after)))
    })
}
