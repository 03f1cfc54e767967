//! Is one mesh the other, moved? Told by rebuilding it: each triangle of the one must have its own triangle in the
//! other, with the same winding, and all that is at its corners.

use super::shape::{Shape, fixed_values};
use crate::gltf::similarity::Similarity;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is left between a mesh and its rebuilt form: the largest of all corners.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residual {
    /// Distance of positions, as a fraction of the radius.
    pub position: f64,
    /// Distance of the tips of unit normals; 0 where there are none.
    pub normal: f64,
    /// The same of tangents.
    pub tangent: f64,
}

impl Residual {
    /// The largest part.
    pub fn worst(&self) -> f64 {
        self.position.max(self.normal).max(self.tangent)
    }
}

/// A triangle by the places of its corners, turned so that they read least, and its number.
type Keyed = ([u32; 3], u32);

fn keyed(places: [u32; 3], number: u32) -> Keyed {
    let [a, b, c] = places;
    // Two corners may stand at one place, so the first corner alone does not tell.
    ([a, b, c].min([b, c, a]).min([c, a, b]), number)
}

/// `None`: no match. `tolerance` is that of normals and tangents; positions have that of their shapes.
pub(super) fn verify(from: &Shape<'_>, to: &Shape<'_>, by: &Similarity, tolerance: f64) -> Option<Residual> {
    if from.corners.len() != to.corners.len() {
        return None;
    }
    let mut places = vec![0u32; from.spots.len()];
    for (place, &spot) in places.iter_mut().zip(&from.spots) {
        *place = to.place_near(by.point(spot), to.reach, None)?;
    }
    let spot_of = spots_of_corners(from);
    let mut mine: Vec<Keyed> = (0..)
        .zip(spot_of.as_chunks::<3>().0)
        .map(|(i, t)| {
            let [a, b, c] = t.map(|spot| places[spot as usize]);
            keyed(if by.mirror { [a, c, b] } else { [a, b, c] }, i)
        })
        .collect();
    let mut theirs: Vec<Keyed> = (0..).zip(to.corner_places.as_chunks::<3>().0).map(|(i, t)| keyed(*t, i)).collect();
    mine.sort_unstable();
    theirs.sort_unstable();
    let compared = Compared { from, to, by, tolerance };
    let mut residual = Residual::default();
    let mut rest = theirs.as_slice();
    for run in mine.chunk_by(|a, b| a.0 == b.0) {
        let (same, after) = rest.split_at_checked(run.len())?;
        if same.iter().any(|t| t.0 != run[0].0) || after.first().is_some_and(|t| t.0 == run[0].0) {
            return None;
        }
        rest = after;
        compared.run(run, same, &mut residual)?;
    }
    Some(residual)
}

/// Spot of each corner: spots are different positions in the order of their bits.
fn spots_of_corners(shape: &Shape<'_>) -> Vec<u32> {
    let key = |p: DVec3| [p.x, p.y, p.z].map(|c| crate::mesh::hash::positive_zero(c as f32));
    let at = |corner: usize| {
        let wanted = key(shape.position(corner));
        shape.spots.partition_point(|&spot| key(spot) < wanted) as u32
    };
    (0..shape.corners.len()).map(at).collect()
}

struct Compared<'s, 'a> {
    from: &'s Shape<'a>,
    to: &'s Shape<'a>,
    by: &'s Similarity,
    tolerance: f64,
}

impl Compared<'_, '_> {
    /// Gives each triangle of `mine` one of `theirs`.
    fn run(&self, mine: &[Keyed], theirs: &[Keyed], residual: &mut Residual) -> Option<()> {
        let mut left: Vec<u32> = theirs.iter().map(|t| t.1).collect();
        for &(_, triangle) in mine {
            let found = left.iter().enumerate().find_map(|(i, &other)| Some((i, self.triangle(triangle, other)?)));
            let (i, worst) = found?;
            left.remove(i);
            residual.position = residual.position.max(worst.position);
            residual.normal = residual.normal.max(worst.normal);
            residual.tangent = residual.tangent.max(worst.tangent);
        }
        Some(())
    }

    /// In any of the three turns.
    fn triangle(&self, mine: u32, theirs: u32) -> Option<Residual> {
        let (mine, theirs) = (mine as usize * 3, theirs as usize * 3);
        let order = if self.by.mirror { [0, 2, 1] } else { [0, 1, 2] };
        (0..3).find_map(|turn| {
            let mut worst = Residual::default();
            for (i, corner) in order.into_iter().enumerate() {
                self.corner(mine + corner, theirs + (i + turn) % 3, &mut worst)?;
            }
            Some(worst)
        })
    }

    fn corner(&self, mine: usize, theirs: usize, worst: &mut Residual) -> Option<()> {
        let (from, to) = (self.from, self.to);
        let distance = self.by.point(from.position(mine)).distance(to.position(theirs)) / to.radius;
        worst.position = worst.position.max(distance);
        for (name, largest) in [("NORMAL", &mut worst.normal), ("TANGENT", &mut worst.tangent)] {
            match (from.vector(mine, name), to.vector(theirs, name)) {
                (Some(a), Some(b)) => *largest = largest.max(self.by.direction(a).distance(b)),
                (None, None) => {}
                _ => return None,
            }
        }
        // All values are finite: readers refuse others.
        let slack = from.slack.max(to.slack);
        if slack < worst.position || self.tolerance < worst.normal.max(worst.tangent) {
            return None;
        }
        let ((p, v), (q, w)) = (from.corners[mine], to.corners[theirs]);
        let equal =
            p == q && fixed_values(from.primitives[p as usize], v).eq(fixed_values(to.primitives[q as usize], w));
        equal.then_some(())
    }
}
