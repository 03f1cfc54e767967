//! The corners of faces, by what they have: vertices, or wedges.

/// One corner of one face of a level.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corner(u32);

impl Corner {
    /// The face.
    #[inline]
    pub(super) fn face(self) -> u32 {
        self.0 >> 2
    }

    /// Which of its corners, 0…2.
    #[inline]
    pub(super) fn at(self) -> usize {
        (self.0 & 3) as usize
    }
}

/// For each vertex, or wedge, the corners that have it, faces in order.
pub(super) struct Around {
    start: Vec<u32>,
    corners: Vec<Corner>,
}

impl Around {
    /// `of` tells what the three corners of each face have, numbers below `count`.
    pub(super) fn new(faces: u32, count: usize, of: impl Fn(u32) -> [u32; 3]) -> Self {
        // Counted two places on, so that filling moves each start to its own place.
        let mut start = vec![0u32; count + 2];
        for own in (0..faces).flat_map(&of) {
            start[own as usize + 2] += 1;
        }
        for at in 2..start.len() {
            start[at] += start[at - 1];
        }
        let mut corners = vec![Corner::default(); faces as usize * 3];
        for face in 0..faces {
            for (at, own) in (0..).zip(of(face)) {
                let to = &mut start[own as usize + 1];
                corners[*to as usize] = Corner(face << 2 | at);
                *to += 1;
            }
        }
        Self { start, corners }
    }

    /// Those of one.
    #[inline]
    pub(super) fn of(&self, own: u32) -> &[Corner] {
        &self.corners[self.start[own as usize] as usize..self.start[own as usize + 1] as usize]
    }
}
