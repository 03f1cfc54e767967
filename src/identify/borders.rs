//! Which primitives touch: those with a vertex position in common that lies on a border of both.
//!
//! Sorting does all the work, so the time is near-linear for any input and the result does not depend on chance.

use super::places::{Key, places};
use crate::mesh::Primitive;
use crate::mesh::sets::Sets;

/// Groups of primitives that touch, directly or through others; members ascending, groups by first member.
pub fn groups(primitives: &[&Primitive]) -> Vec<Vec<usize>> {
    if primitives.len() < 2 {
        return (0..primitives.len()).map(|i| vec![i]).collect();
    }
    let mut border: Vec<(Key, usize)> = Vec::new();
    for i in near_others(primitives) {
        border.extend(border_positions(primitives[i]).into_iter().map(|key| (key, i)));
    }
    border.sort_unstable();
    let mut sets = Sets::new(primitives.len());
    for pair in border.windows(2) {
        if pair[0].0 == pair[1].0 {
            sets.join(pair[0].1, pair[1].1);
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); primitives.len()];
    for i in 0..primitives.len() {
        groups[sets.root(i)].push(i);
    }
    // The smaller index always becomes the root, so the groups already stand in order.
    groups.retain(|group| !group.is_empty());
    groups
}

/// Primitives whose bounding box touches another one's; the rest need no closer look. Sweeps along x.
fn near_others(primitives: &[&Primitive]) -> Vec<usize> {
    let boxes: Vec<[[f32; 3]; 2]> = primitives.iter().map(|p| bounds(p)).collect();
    let mut order: Vec<usize> = (0..primitives.len()).collect();
    order.sort_by(|&a, &b| boxes[a][0][0].total_cmp(&boxes[b][0][0]).then(a.cmp(&b)));
    let touch =
        |a: usize, b: usize| (0..3).all(|k| boxes[a][0][k] <= boxes[b][1][k] && boxes[b][0][k] <= boxes[a][1][k]);
    let mut near = vec![false; primitives.len()];
    let mut open: Vec<usize> = Vec::new();
    for &i in &order {
        open.retain(|&other| boxes[other][1][0] >= boxes[i][0][0]);
        for &other in &open {
            // Once both are known to be near something, nothing more is to be learnt from them.
            if !(near[i] && near[other]) && touch(i, other) {
                near[i] = true;
                near[other] = true;
            }
        }
        open.push(i);
    }
    (0..primitives.len()).filter(|&i| near[i]).collect()
}

/// Least and greatest corner of all vertices.
fn bounds(primitive: &Primitive) -> [[f32; 3]; 2] {
    let mut corners = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for position in primitive.positions() {
        for k in 0..3 {
            corners[0][k] = corners[0][k].min(position[k]);
            corners[1][k] = corners[1][k].max(position[k]);
        }
    }
    corners
}

/// Positions of vertices on border edges: edges of a single triangle, once vertices at the same place are one.
fn border_positions(primitive: &Primitive) -> Vec<Key> {
    let (weld, keys) = places(primitive.positions());
    let mut edges: Vec<(u32, u32)> = Vec::with_capacity(primitive.indices.len());
    for triangle in primitive.indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|i| weld[i as usize]);
        if a != b && b != c && c != a {
            edges.extend([(a.min(b), a.max(b)), (b.min(c), b.max(c)), (c.min(a), c.max(a))]);
        }
    }
    edges.sort_unstable();
    let mut on_border = vec![false; keys.len()];
    for same in edges.chunk_by(|a, b| a == b) {
        if let [(a, b)] = same {
            on_border[*a as usize] = true;
            on_border[*b as usize] = true;
        }
    }
    keys.into_iter().zip(on_border).filter_map(|(key, border)| border.then_some(key)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Attribute, Format};

    fn primitive(positions: &[[f32; 3]], indices: &[u32]) -> Primitive {
        let values = positions.as_flattened().to_vec();
        let position = Attribute { name: "POSITION".into(), components: 3, format: Format::F32, values };
        Primitive { count: positions.len(), attributes: vec![position], targets: vec![], indices: indices.to_vec() }
    }

    /// Two triangles over a unit square whose lower left corner is at `(x, y)`.
    fn square(x: f32, y: f32) -> Primitive {
        let corner = |dx, dy| [x + dx, y + dy, 0.0];
        primitive(&[corner(0., 0.), corner(1., 0.), corner(0., 1.), corner(1., 1.)], &[0, 1, 2, 2, 1, 3])
    }

    fn tetrahedron(x: f32) -> Primitive {
        let corners = [[x, 0., 0.], [x + 1., 0., 0.], [x, 1., 0.], [x, 0., 1.]];
        primitive(&corners, &[0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3])
    }

    fn grouped(primitives: &[Primitive]) -> Vec<Vec<usize>> {
        groups(&primitives.iter().collect::<Vec<_>>())
    }

    /// ```text
    /// +---+---+     +---+
    /// | 0 | 2 |     | 1 |
    /// +---+---+     +---+
    ///         | 3 |
    ///         +---+
    /// ```
    #[test]
    fn neighbours_are_one_group_also_at_a_corner() {
        let all = [square(0., 0.), square(9., 0.), square(1., 0.), square(2., -1.)];
        assert_eq!(grouped(&all), [vec![0, 2, 3], vec![1]]);
    }

    #[test]
    fn zero_has_one_sign_and_order_does_not_matter() {
        let mut left = square(-1., 0.);
        for value in &mut left.attributes[0].values {
            if *value == 0.0 {
                *value = -0.0;
            }
        }
        assert_eq!(grouped(&[square(0., 0.), left.clone()]), [[0, 1]]);
        assert_eq!(grouped(&[left, square(0., 0.)]), [[0, 1]]);
    }

    #[test]
    fn closed_surfaces_have_no_border() {
        assert_eq!(grouped(&[tetrahedron(0.), tetrahedron(0.)]), [[0], [1]]);
        assert_eq!(grouped(&[tetrahedron(0.), square(0., 0.)]), [[0], [1]]);
    }

    #[test]
    fn seams_within_a_primitive_are_no_border() {
        // A tetrahedron whose every triangle has vertices of its own.
        let closed = tetrahedron(0.);
        let corners: Vec<[f32; 3]> = closed.indices.iter().map(|&i| closed.positions()[i as usize]).collect();
        let split = primitive(&corners, &(0..12).collect::<Vec<_>>());
        assert_eq!(grouped(&[split, square(0., 0.)]), [[0], [1]]);
    }

    #[test]
    fn interior_contact_does_not_count() {
        // A fan around (0.5, 0.5), and a triangle whose corner stands on that inner point.
        let fan = primitive(
            &[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.5, 0.5, 0.]],
            &[0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4],
        );
        let spike = primitive(&[[0.5, 0.5, 0.], [0.5, 0.5, 1.], [0.6, 0.5, 1.]], &[0, 1, 2]);
        assert_eq!(grouped(&[fan, spike]), [[0], [1]]);
    }

    #[test]
    fn one_and_none() {
        assert_eq!(grouped(&[square(0., 0.)]), [[0]]);
        assert!(grouped(&[]).is_empty());
    }

    #[test]
    fn a_row_of_many_is_joined_from_both_ends() {
        let row: Vec<Primitive> = (0..500).map(|i| square(((i * 7) % 500) as f32, 0.)).collect();
        assert_eq!(grouped(&row).len(), 1);
        let apart: Vec<Primitive> = (0..500).map(|i| square(i as f32 * 2., 0.)).collect();
        assert_eq!(grouped(&apart).len(), 500);
    }
}
