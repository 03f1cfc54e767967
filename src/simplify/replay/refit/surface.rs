//! The surface of a level, on which points of the source find their places.

use rayon::prelude::*;

use super::around::{Around, Corner};
use super::samples::Sample;
use super::{Face, unit};
use crate::mesh::weld::NONE;
use crate::quadric::{cross, dot, nearest_on_triangle, sub};

/// The level's surface.
pub(super) struct Surface<'a> {
    pub(super) faces: &'a [Face],
    pub(super) positions: Vec<[f64; 3]>,
    turned: Vec<Turned>,
    around: Around,
}

/// How a face lies.
#[derive(Clone, Copy, Debug)]
struct Turned {
    /// Unit normal; zero without an area.
    flat: [f64; 3],
    /// Middle and radius: most faces are further off than the best one, which this tells soon.
    ball: [f64; 4],
    /// Square of a distance below which a point right above or below has found its face.
    right_above: f64,
}

/// A sample on its face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// [`NONE`]: on no face.
    pub(super) face: u32,
    /// Shares of the face's corners, which sum to 1.
    pub(super) shares: [f64; 3],
}

impl Placed {
    /// On no face.
    pub(super) const NOWHERE: Self = Self { face: NONE, shares: [0.0; 3] };
}

/// A sample may lie on a face that is turned from its own by less than this: cosine of 72°.
const SAME_SIDE: f64 = 0.31;

/// Longest walk over the level in search of the nearest face, in vertices.
const MOST_STEPS: usize = 8;

/// A sample is right above or below a face whose area, times this, is more than its squared distance.
const RIGHT_ABOVE: f64 = 0.01;

/// Samples that one thread places one after the other: each begins where the one before it lay.
const RUN: usize = 1 << 10;

/// A search for one sample's face.
#[derive(Default)]
struct Search {
    tried: Vec<u32>,
    /// One bit for some of their numbers: most faces are new, which this tells at once.
    bits: u64,
    best: Option<Placed>,
    /// Squared distance of the best, and the distance.
    squared: f64,
    reach: f64,
}

impl<'a> Surface<'a> {
    /// Of `faces` over `positions`.
    pub(super) fn new(faces: &'a [Face], positions: Vec<[f64; 3]>) -> Self {
        let around = Around::new(faces.len() as u32, positions.len(), |face| faces[face as usize].v);
        let mut out = Self { faces, positions, turned: Vec::new(), around };
        out.turn();
        out
    }

    /// Corner positions of a face.
    #[inline]
    pub(super) fn corners(&self, face: u32) -> [[f64; 3]; 3] {
        self.faces[face as usize].v.map(|v| self.positions[v as usize])
    }

    /// Brings what is known of the faces up to date with the positions.
    pub(super) fn turn(&mut self) {
        let turned = |face: u32| {
            let p = self.corners(face);
            let across = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            let area = dot(across, across).sqrt() / 2.0;
            let middle = [0, 1, 2].map(|axis| (p[0][axis] + p[1][axis] + p[2][axis]) / 3.0);
            let squared = p.map(|p| sub(p, middle)).map(|off| dot(off, off)).into_iter().fold(0.0, f64::max);
            Turned {
                flat: unit(across).unwrap_or([0.0; 3]),
                ball: [middle[0], middle[1], middle[2], squared.sqrt()],
                right_above: RIGHT_ABOVE * area,
            }
        };
        self.turned = (0..self.faces.len() as u32).map(turned).collect();
    }

    /// Finds the place of each sample; `placed` tells on which faces to look first.
    pub(super) fn place_all(&self, samples: &[Sample], placed: &mut [Placed]) {
        let run = |(samples, placed): (&[Sample], &mut [Placed])| {
            let mut search = Search::default();
            let mut last = NONE;
            for (sample, placed) in samples.iter().zip(placed) {
                let hint = if placed.face == NONE { last } else { placed.face };
                *placed = self.place(sample, hint, &mut search);
                last = placed.face;
            }
        };
        samples.par_chunks(RUN).zip(placed.par_chunks_mut(RUN)).for_each(run);
    }

    /// The corners at a vertex.
    #[inline]
    pub(super) fn ring(&self, vertex: u32) -> &[Corner] {
        self.around.of(vertex)
    }

    /// The face of the sample's primitive, turned like it, that is nearest to it on a walk downhill from the face `hint`
    /// and what became of the sample's own corners. A face that has the sample right above or below it ends the walk.
    fn place(&self, sample: &Sample, hint: u32, search: &mut Search) -> Placed {
        search.tried.clear();
        (search.bits, search.best) = (0, None);
        (search.squared, search.reach) = (f64::INFINITY, f64::INFINITY);
        if hint != NONE && self.ask(hint, sample, search) {
            return search.best.unwrap_or(Placed::NOWHERE);
        }
        let near = sample.near;
        for (at, vertex) in near.into_iter().enumerate() {
            if !near[..at].contains(&vertex) && self.ask_around(vertex, sample, search) {
                return search.best.unwrap_or(Placed::NOWHERE);
            }
        }
        for _ in 0..MOST_STEPS {
            let Some(placed) = search.best else { break };
            let least = search.squared;
            for vertex in self.faces[placed.face as usize].v {
                if self.ask_around(vertex, sample, search) {
                    return search.best.unwrap_or(Placed::NOWHERE);
                }
            }
            if least <= search.squared {
                break;
            }
        }
        search.best.unwrap_or(Placed::NOWHERE)
    }

    /// [`Self::ask`] for all faces at a vertex.
    #[inline]
    fn ask_around(&self, vertex: u32, sample: &Sample, search: &mut Search) -> bool {
        self.ring(vertex).iter().any(|corner| self.ask(corner.face(), sample, search))
    }

    /// Holds a face against the best one so far. Whether no other need be asked.
    #[inline]
    fn ask(&self, face: u32, sample: &Sample, search: &mut Search) -> bool {
        let bit = 1 << (face & 63);
        if search.bits & bit != 0 && search.tried.contains(&face) {
            return false;
        }
        search.bits |= bit;
        search.tried.push(face);
        let turned = &self.turned[face as usize];
        let [x, y, z, radius] = turned.ball;
        let off = sub([x, y, z], sample.at);
        let most = search.reach + radius;
        if dot(off, off) > most * most
            || self.faces[face as usize].primitive != sample.primitive
            || dot(turned.flat, sample.flat) < SAME_SIDE
        {
            return false;
        }
        let (squared, shares) = nearest_on_triangle(sample.at, self.corners(face));
        if search.squared <= squared {
            return false;
        }
        search.best = Some(Placed { face, shares });
        (search.squared, search.reach) = (squared, squared.sqrt());
        squared < turned.right_above && shares.iter().all(|&share| 0.0 < share)
    }
}
