//! Strips, fans and lists to clean triangle lists. Knows only numbers.

/// How a primitive's indices make triangles (glTF `mode` 4, 5, 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// Three indices each.
    List,
    /// Each index closes a triangle with the two before it.
    Strip,
    /// Each index closes a triangle with the one before it and the first.
    Fan,
}

/// A triangle list, and what was left out of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriangleList {
    /// Three indices for each triangle, no index twice in one.
    pub indices: Vec<u32>,
    /// Triangles of a list that used an index twice. Strips have such ones on purpose; they are not counted.
    pub degenerate: usize,
    /// Indices at the end that make no whole triangle.
    pub leftover: usize,
}

/// Whether no index is there twice.
pub fn is_whole(t: &[u32; 3]) -> bool {
    t[0] != t[1] && t[1] != t[2] && t[2] != t[0]
}

/// Writes out the triangles, in their order and with their winding.
pub fn triangle_list(mut indices: Vec<u32>, topology: Topology) -> TriangleList {
    let leftover = match topology {
        Topology::List => indices.len() % 3,
        Topology::Strip | Topology::Fan if indices.len() < 3 => indices.len(),
        Topology::Strip | Topology::Fan => 0,
    };
    match topology {
        Topology::List => indices.truncate(indices.len() - leftover),
        Topology::Strip => {
            // Every other triangle is turned round, as the specification has it.
            let triangle = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            indices = indices.windows(3).enumerate().flat_map(triangle).collect();
        }
        Topology::Fan => {
            let first = indices.first().copied().unwrap_or(0);
            indices = indices.get(1..).unwrap_or(&[]).windows(2).flat_map(|w| [w[0], w[1], first]).collect();
        }
    }
    let before = indices.len() / 3;
    if !indices.as_chunks::<3>().0.iter().all(is_whole) {
        indices = indices.as_chunks::<3>().0.iter().copied().filter(is_whole).flatten().collect();
    }
    let degenerate = if topology == Topology::List { before - indices.len() / 3 } else { 0 };
    TriangleList { indices, degenerate, leftover }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(indices: &[u32], topology: Topology) -> (Vec<u32>, usize, usize) {
        let list = triangle_list(indices.to_vec(), topology);
        (list.indices, list.degenerate, list.leftover)
    }

    #[test]
    fn lists_lose_degenerate_triangles_and_leftovers() {
        assert_eq!(list(&[0, 1, 2, 2, 1, 3], Topology::List), (vec![0, 1, 2, 2, 1, 3], 0, 0));
        assert_eq!(list(&[0, 1, 2, 2, 2, 3, 4, 5, 4, 7], Topology::List), (vec![0, 1, 2], 2, 1));
        assert_eq!(list(&[], Topology::List), (vec![], 0, 0));
    }

    /// ```text
    /// 0---2---4
    /// |  /|  /
    /// | / | /
    /// 1---3
    /// ```
    #[test]
    fn strips_keep_their_winding() {
        assert_eq!(list(&[0, 1, 2, 3, 4], Topology::Strip), (vec![0, 1, 2, 1, 3, 2, 2, 3, 4], 0, 0));
        // Stitched: the doubled indices vanish, and the parity still holds.
        assert_eq!(list(&[0, 1, 2, 2, 5, 5, 6, 7], Topology::Strip), (vec![0, 1, 2, 5, 7, 6], 0, 0));
        assert_eq!(list(&[0, 1], Topology::Strip), (vec![], 0, 2));
    }

    #[test]
    fn fans_turn_round_their_first_vertex() {
        assert_eq!(list(&[9, 1, 2, 3], Topology::Fan), (vec![1, 2, 9, 2, 3, 9], 0, 0));
        assert_eq!(list(&[9, 1], Topology::Fan), (vec![], 0, 2));
        assert_eq!(list(&[], Topology::Fan), (vec![], 0, 0));
    }
}
