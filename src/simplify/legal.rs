//! Which contractions are allowed: no triangle may turn over.

use crate::mesh::topology::Topology;
use crate::quadric::{cross, dot, sub};

/// No triangle may turn by more than `acos(0.2)` = 78°.
const LEAST_COSINE: f64 = 0.2;

/// True if no triangle that survives the contraction turns by more than 78° when `a` and `b` move to `position`.
/// A triangle that has no area now may turn as it likes; one that has area may not lose all of it.
pub fn turns_gently(surface: &Topology, a: u32, b: u32, position: [f64; 3]) -> bool {
    ring_turns_gently(surface, a, b, position) && ring_turns_gently(surface, b, a, position)
}

fn ring_turns_gently(surface: &Topology, moved: u32, other: u32, position: [f64; 3]) -> bool {
    surface.ring(moved).iter().all(|&id| {
        let face = &surface.faces[id as usize];
        if face.corner(other).is_some() {
            return true;
        }
        let corner = face.corner(moved).expect("a ring holds faces of its vertex");
        let q = surface.positions[face.v[(corner + 1) % 3] as usize];
        let r = surface.positions[face.v[(corner + 2) % 3] as usize];
        let opposite = sub(r, q);
        let before = cross(sub(q, surface.positions[moved as usize]), opposite);
        let after = cross(sub(q, position), opposite);
        let (turned, lengths) = (dot(before, after), dot(before, before) * dot(after, after));
        if dot(before, before) == 0.0 {
            return true;
        }
        turned > 0.0 && turned * turned > LEAST_COSINE * LEAST_COSINE * lengths
    })
}
