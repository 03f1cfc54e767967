//! Which faces of the reference look wrong: each pixel's difference goes to the face that the reference shows there.
//!
//! For loops that simplify again with other weights. Sums are of integers, so that no order of views or threads counts.

use super::drawable::{Drawable, NO_FACE};
use super::metric::Reference;
use super::render::{Picture, Render, RenderError, Shot};
use super::srgb::{LUMINANCE_UNIT, luminance};
use rayon::prelude::*;

/// A pixel where only the candidate is seen counts for the nearest face of the reference within this many pixels.
const REACH: i32 = 5;

/// What each face of a reference has to do with a candidate's differences.
#[derive(Clone, Debug, PartialEq)]
pub struct Blame {
    /// Sum over the face's pixels of the squared difference of luminance (0…255), by number of the face.
    pub squares: Vec<f64>,
    /// Pixels of all views in which the face is seen.
    pub pixels: Vec<u32>,
    /// Sum over the pixels that no face is near to.
    pub nowhere: f64,
    /// `d_RMS` of the candidate, as [`Reference::compare`] finds it.
    pub rms: f64,
}

impl Reference {
    /// Draws `candidate` from this reference's cameras and shares out the difference among the `faces` (see
    /// [`Drawable::first_faces`]) of the drawable that the reference was made from.
    ///
    /// # Panics
    /// If the reference's pictures do not know their faces, or know more than `faces`.
    pub fn blame(&self, renderer: &dyn Render, candidate: &Drawable, faces: usize) -> Result<Blame, RenderError> {
        let prepared = renderer.prepare(candidate)?;
        let shot = Shot { size: self.size, faces: false };
        let offsets = offsets();
        let views: Result<Vec<View>, RenderError> = self
            .cameras
            .par_iter()
            .zip(&self.pictures)
            .with_max_len(1)
            .map(|(camera, picture)| Ok(shares(picture, &prepared.draw(camera, shot)?, &offsets)))
            .collect();
        let mut squares = vec![0u64; faces];
        let mut nowhere = 0u64;
        let mut whole = 0u128;
        for view in views? {
            nowhere += view.nowhere;
            whole += view.whole;
            for (face, square) in view.shares {
                squares[face as usize] += square;
            }
        }
        let light = |squares: u64| squares as f64 / (LUMINANCE_UNIT * LUMINANCE_UNIT / SCALE as f64);
        Ok(Blame {
            squares: squares.into_iter().map(light).collect(),
            pixels: self.seen(faces),
            nowhere: light(nowhere),
            rms: self.root_mean(whole),
        })
    }

    /// In how many pixels of all views each face is seen.
    ///
    /// # Panics
    /// As [`Self::blame`].
    pub fn seen(&self, faces: usize) -> Vec<u32> {
        let mut pixels = vec![0u32; faces];
        for picture in &self.pictures {
            assert_eq!(picture.faces.len(), picture.pixels.len(), "pictures that know their faces");
            for face in picture.faces.iter().filter(|face| **face != NO_FACE) {
                pixels[*face as usize] += 1;
            }
        }
        pixels
    }
}

/// Squares are divided by this, so that the sum over any number of views fits: 1/2000 of a step of luminance is lost.
const SCALE: u64 = 25;

struct View {
    shares: Vec<(u32, u64)>,
    nowhere: u64,
    /// All of it, unscaled.
    whole: u128,
}

fn shares(reference: &Picture, candidate: &Picture, offsets: &[(i32, i32)]) -> View {
    let size = reference.size as i32;
    let near = |at: usize| {
        let (x, y) = (at as i32 % size, at as i32 / size);
        let inside = offsets.iter().map(|(dx, dy)| (x + dx, y + dy));
        let inside = inside.filter(|(x, y)| (0..size).contains(x) && (0..size).contains(y));
        inside.map(|(x, y)| reference.faces[(y * size + x) as usize]).find(|face| *face != NO_FACE)
    };
    let mut view = View { shares: Vec::new(), nowhere: 0, whole: 0 };
    for (at, (p, q)) in reference.pixels.iter().zip(&candidate.pixels).enumerate() {
        let off = i64::from(luminance([p[0], p[1], p[2]]) - luminance([q[0], q[1], q[2]]));
        if off == 0 {
            continue;
        }
        view.whole += (off * off) as u128;
        let square = (off * off) as u64 / SCALE;
        match near(at) {
            Some(face) => view.shares.push((face, square)),
            None => view.nowhere += square,
        }
    }
    view
}

/// Pixels within reach, the nearest first: the pixel itself before all others.
fn offsets() -> Vec<(i32, i32)> {
    let all = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy)));
    let mut offsets: Vec<(i32, i32)> = all.filter(|(x, y)| x * x + y * y <= REACH * REACH).collect();
    offsets.sort_by_key(|(x, y)| (x * x + y * y, *y, *x));
    offsets
}
