//! A surface and its texture: which contractions keep the texture's charts as they are, and what changes within them.
//!
//! J. Cohen, M. Olano, D. Manocha, 1998, and P. Sander, J. Snyder, S. Gortler, H. Hoppe, *Texture mapping progressive meshes*,
//! 2001: no triangle turns over in the texture, and seams and borders are contracted along themselves alone, where they are
//! straight in the texture. Prices nothing.
//!
//! The texture is the first set of texture coordinates; the others follow it. Faces without it, or without an area in it,
//! correspond to themselves by their corners. Where the texture is folded (faces that lie both ways round one vertex) nothing
//! is contracted: neither source says what corresponds there.

use super::overlay::{Patch, orientation};
use super::parts::Classes;
use crate::mesh::layout::{FieldKind, Layout};
use crate::mesh::topology::{Contraction, EdgeKind, NEXT, PREVIOUS, Topology};

/// The texture of a surface.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    /// First column of the texture coordinates.
    offset: Option<usize>,
    /// Whether a wedge has them.
    textured: Vec<bool>,
    /// How far a vertex between two edges of a seam may lie off the line between the others, as a share of its length.
    straight: f64,
}

/// What a contraction changes in one chart.
#[derive(Clone, Debug)]
pub(super) struct Star {
    /// Faces around, as they are; all those that move or vanish.
    pub old: Vec<Patch>,
    /// Those that stay, as they will be.
    pub new: Vec<Patch>,
    /// How the faces lie in the texture; 0: they have no area there, and correspond by their corners.
    pub sign: i8,
    /// How far the seam is off the line that replaces it, in the texture.
    pub off: f64,
}

/// A contraction that the texture allows.
#[derive(Clone, Debug)]
pub(super) struct Change {
    /// Chart by chart.
    pub stars: Vec<Star>,
    /// Texture coordinates of the wedges at the merged vertex.
    pub uvs: Vec<(u32, [f64; 2])>,
}

impl Domain {
    /// Of the first set of texture coordinates.
    pub fn new(surface: &Topology, layout: &Layout, wedge_primitive: &[u32], straight: f64) -> Self {
        let field = layout.fields.iter().find(|f| f.kind == FieldKind::Texcoord && f.components == 2);
        let has = |&primitive: &u32| field.is_some_and(|f| f.scale[primitive as usize] > 0.0);
        let textured = wedge_primitive[..surface.wedge_vertex.len()].iter().map(has).collect();
        Self { offset: field.map(|f| f.offset), textured, straight }
    }

    fn uv(&self, surface: &Topology, wedge: u32) -> [f64; 2] {
        match self.offset {
            Some(at) if self.textured[wedge as usize] => [0, 1].map(|k| f64::from(surface.value(wedge)[at + k])),
            _ => [0.0; 2],
        }
    }

    /// Sets the texture coordinates of wedges that are still there.
    pub fn set(&self, surface: &mut Topology, uvs: &[(u32, [f64; 2])], done: &Contraction) {
        let Some(at) = self.offset else { return };
        for &(wedge, uv) in uvs {
            let gone = done.merged.iter().any(|merged| merged[1] == wedge);
            if self.textured[wedge as usize] && !gone {
                let values = surface.value_mut(wedge);
                (0..2).for_each(|k| values[at + k] = uv[k] as f32);
            }
        }
    }

    /// The other ends of seams and borders at a vertex, once each.
    fn seams(surface: &Topology, vertex: u32) -> Vec<u32> {
        let mut out = Vec::new();
        for corner in surface.ring(vertex) {
            let face = &surface.faces[corner.face()];
            let (next, previous) = (NEXT[corner.at()], PREVIOUS[corner.at()]);
            for (edge, end) in [(corner.at(), next), (previous, previous)] {
                let is_seam = matches!(surface.kinds[corner.face()][edge], EdgeKind::Seam | EdgeKind::Border);
                if is_seam && !out.contains(&face.v[end]) {
                    out.push(face.v[end]);
                }
            }
        }
        out
    }

    /// Whether no seam and no border passes through a vertex.
    pub fn is_inner(surface: &Topology, vertex: u32) -> bool {
        Self::seams(surface, vertex).is_empty()
    }

    /// What contracting `a` and `b` changes when the merged vertex goes to `position`, `t` of the way from `a` to `b` in the
    /// texture: 0 and 1 are the ends. `None` = the texture forbids it.
    pub fn change(&self, surface: &Topology, a: u32, b: u32, position: [f64; 3], t: f64) -> Option<Change> {
        let mut classes = Classes::new(surface, a, b)?;
        classes.join(|x, y| {
            surface.same_chart(x, y) && surface.wedge_vertex[x as usize] == surface.wedge_vertex[y as usize]
        });
        // The end of a seam: its sides, which lie apart in the texture, would become one.
        let apart = |(x, y): (&(u32, bool, usize), &(u32, bool, usize))| {
            x.1 == y.1 && x.2 == y.2 && !surface.same_chart(x.0, y.0)
        };
        if classes.wedges.iter().any(|x| classes.wedges.iter().any(|y| apart((x, y)))) {
            return None;
        }
        let moved: &[u32] = match t {
            0.0 => &[b],
            1.0 => &[a],
            _ => &[a, b],
        };
        let mut seam = None;
        for &vertex in moved {
            let other = if vertex == a { b } else { a };
            let seams = Self::seams(surface, vertex);
            match seams[..] {
                [] => {}
                [x, y] if moved.len() == 1 && (x == other || y == other) => {
                    seam = Some(if x == other { y } else { x });
                }
                _ => return None,
            }
        }
        let mut change = Change { stars: Vec::new(), uvs: Vec::new() };
        for class in 0..classes.count {
            let at = |second: bool| classes.wedges.iter().find(|w| w.2 == class && w.1 == second).map(|w| w.0);
            let (first, second) = (at(false), at(true));
            let uv = match (first, second) {
                (Some(first), Some(second)) => {
                    let (p, q) = (self.uv(surface, first), self.uv(surface, second));
                    match t {
                        0.0 => p,
                        1.0 => q,
                        _ => [0, 1].map(|k| p[k] + (q[k] - p[k]) * t),
                    }
                }
                // A chart at the end that stays only: nothing changes in it.
                (Some(_), None) if !moved.contains(&a) => continue,
                (None, Some(_)) if !moved.contains(&b) => continue,
                _ => return None,
            };
            let star = self.star(surface, [a, b], moved, &classes, class, position, uv, seam)?;
            change.stars.push(star);
            change.uvs.extend(classes.of(class).map(|wedge| (wedge, uv)));
        }
        Some(change)
    }

    #[expect(clippy::too_many_arguments, reason = "one contraction, one chart of it")]
    fn star(
        &self,
        surface: &Topology,
        pair: [u32; 2],
        moved: &[u32],
        classes: &Classes,
        class: usize,
        position: [f64; 3],
        uv: [f64; 2],
        seam: Option<u32>,
    ) -> Option<Star> {
        let mut star = Star { old: Vec::new(), new: Vec::new(), sign: 0, off: 0.0 };
        let (mut flat, mut lying) = (false, [false; 2]);
        let mut past = None;
        for &vertex in moved {
            let other = if vertex == pair[0] { pair[1] } else { pair[0] };
            for corner in surface.ring(vertex) {
                let face = &surface.faces[corner.face()];
                if classes.class(face.w[corner.at()]) != Some(class) {
                    continue;
                }
                if let Some(end) = seam.and_then(|seam| face.corner(seam)) {
                    past = Some((self.uv(surface, face.w[end]), self.uv(surface, face.w[corner.at()])));
                }
                let dies = face.corner(other).is_some();
                if dies && vertex == pair[1] && moved.len() == 2 {
                    // It was met at the other end.
                    continue;
                }
                let patch = Patch {
                    face: corner.face() as u32,
                    p: surface.corners(face),
                    uv: face.w.map(|wedge| self.uv(surface, wedge)),
                };
                match orientation(&patch.uv) {
                    0 => flat = true,
                    sign => lying[usize::from(sign > 0)] = true,
                }
                star.old.push(patch);
                if !dies {
                    let mut patch = patch;
                    (patch.p[corner.at()], patch.uv[corner.at()]) = (position, uv);
                    star.new.push(patch);
                }
            }
        }
        star.sign = match (flat, lying) {
            (_, [false, false]) => 0,
            (false, [true, false]) => -1,
            (false, [false, true]) => 1,
            // Folded, or without area in places.
            _ => return None,
        };
        if star.sign != 0 && star.new.iter().any(|patch| orientation(&patch.uv) != star.sign) {
            return None;
        }
        if let Some((from, here)) = past.filter(|_| star.sign != 0) {
            star.off = self.off_line(from, here, uv)?;
        } else if seam.is_some() && star.sign != 0 {
            return None;
        }
        Some(star)
    }

    /// How far `here` is from the line `from … to`; `None`: too far, or not between them.
    fn off_line(&self, from: [f64; 2], here: [f64; 2], to: [f64; 2]) -> Option<f64> {
        let along = [to[0] - from[0], to[1] - from[1]];
        let at = [here[0] - from[0], here[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let off = (along[0] * at[1] - along[1] * at[0]).abs() / length;
        let way = (along[0] * at[0] + along[1] * at[1]) / length;
        (off <= self.straight * length && 0.0 <= way && way <= length).then_some(off)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seams_are_straight_within_their_tolerance() {
        let domain = Domain { offset: None, textured: Vec::new(), straight: 0.01 };
        assert_eq!(domain.off_line([0.0, 0.0], [1.0, 0.0], [3.0, 0.0]), Some(0.0));
        assert!(domain.off_line([0.0, 0.0], [1.0, 0.02], [3.0, 0.0]).is_some_and(|off| (off - 0.02).abs() < 1e-12));
        assert_eq!(domain.off_line([0.0, 0.0], [1.0, 0.04], [3.0, 0.0]), None, "bent");
        assert_eq!(domain.off_line([0.0, 0.0], [4.0, 0.0], [3.0, 0.0]), None, "beyond the end");
        assert_eq!(domain.off_line([0.0, 0.0], [1.0, 0.0], [0.0, 0.0]), None, "no line");
    }
}
