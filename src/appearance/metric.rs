//! How far apart two drawables look: `d_RMS`, silhouettes and structure over a set of views.
//!
//! Cameras are those of the reference for both. Differences are summed as integers, view by view, so that the order
//! of threads cannot change a figure.

use super::drawable::Drawable;
use super::render::{Picture, Render, RenderError, Shot};
use super::srgb::{LUMINANCE_UNIT, luminance};
use super::ssim;
use super::views::{Camera, Frame};
use glam::DVec3;
use rayon::prelude::*;

/// A drawable's own pictures, made once, for any number of candidates.
#[derive(Clone, Debug)]
pub struct Reference {
    /// One for each view.
    pub cameras: Vec<Camera>,
    /// One for each view.
    pub pictures: Vec<Picture>,
    /// Pixels a side.
    pub size: u32,
}

/// How a candidate differs in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewDifference {
    /// Root of the mean squared difference of luminance over all pixels, 0…255.
    pub rms: f64,
    /// Share of the pixels covered by either that only one of them covers, 0…1.
    pub silhouette: f64,
    /// Structural similarity, 1 for equal pictures; `None` if it was not asked for.
    pub ssim: Option<f64>,
    /// Sum of squared differences of luminance, in squares of its unit.
    squares: u128,
    covered: [u64; 2],
    /// Mean is over this many pixels.
    similar: u64,
}

/// How a candidate differs from a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// `d_RMS`: root of the mean squared difference of luminance over all pixels of all views, 0…255.
    pub rms: f64,
    /// Number of the view with the largest difference.
    pub worst: usize,
    /// Share of the pixels covered by either that only one of them covers, over all views, 0…1.
    pub silhouette: f64,
    /// Mean structural similarity over the pixels covered by either, 1 for equal pictures; see [`ssim`].
    pub ssim: Option<f64>,
    /// One for each view.
    pub views: Vec<ViewDifference>,
}

impl Reference {
    /// Draws `drawable` from `directions`, framed by `frame` (its own, in general).
    pub fn new(
        renderer: &dyn Render,
        drawable: &Drawable,
        frame: Frame,
        directions: &[DVec3],
        shot: Shot,
    ) -> Result<Self, RenderError> {
        let cameras = Camera::all(frame, directions);
        let pictures = super::render::pictures(renderer, drawable, &cameras, shot)?;
        Ok(Self { cameras, pictures, size: shot.size })
    }

    /// Draws `candidate` from the same places and compares, keeping no picture. Structure costs about as much as
    /// drawing and is left out unless `structure`.
    pub fn compare(
        &self,
        renderer: &dyn Render,
        candidate: &Drawable,
        structure: bool,
    ) -> Result<Comparison, RenderError> {
        let prepared = renderer.prepare(candidate)?;
        let shot = Shot { size: self.size, faces: false };
        let views: Result<Vec<ViewDifference>, RenderError> = self
            .cameras
            .par_iter()
            .zip(&self.pictures)
            .with_max_len(1)
            .map(|(camera, picture)| Ok(difference(picture, &prepared.draw(camera, shot)?, structure)))
            .collect();
        Ok(self.sum_up(views?))
    }

    /// Compares pictures that were drawn from this reference's cameras, one for each.
    ///
    /// # Panics
    /// If they are of another size or number.
    pub fn compare_pictures(&self, pictures: &[Picture], structure: bool) -> Comparison {
        assert_eq!(pictures.len(), self.pictures.len(), "one picture for each view");
        let pairs = self.pictures.par_iter().zip(pictures).with_max_len(1);
        self.sum_up(pairs.map(|(a, b)| difference(a, b, structure)).collect())
    }

    /// Root of the mean over all pixels of all views, from the sum of squares in luminance's unit.
    pub(super) fn root_mean(&self, squares: u128) -> f64 {
        root_mean(squares, f64::from(self.size) * f64::from(self.size) * self.cameras.len() as f64)
    }

    fn sum_up(&self, views: Vec<ViewDifference>) -> Comparison {
        let squares: u128 = views.iter().map(|v| v.squares).sum();
        let [either, one] = views.iter().fold([0, 0], |sum, v| [sum[0] + v.covered[0], sum[1] + v.covered[1]]);
        // The first of equals, so that the number does not depend on luck.
        let worst = (0..views.len()).rev().max_by_key(|&i| views[i].squares).unwrap_or(0);
        let similar: u64 = views.iter().map(|v| v.similar).sum();
        let weighted = views.iter().map(|v| Some(v.ssim? * v.similar as f64)).sum::<Option<f64>>();
        let ssim = weighted.map(|sum| if similar == 0 { 1.0 } else { sum / similar as f64 });
        Comparison {
            rms: self.root_mean(squares),
            worst,
            silhouette: share(one, either),
            ssim: ssim.filter(|_| !views.is_empty()),
            views,
        }
    }
}

fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

fn root_mean(squares: u128, pixels: f64) -> f64 {
    if pixels == 0.0 { 0.0 } else { (squares as f64 / pixels).sqrt() / LUMINANCE_UNIT }
}

/// Luminance of each pixel.
pub(super) fn luminances(picture: &Picture) -> Vec<i32> {
    picture.pixels.iter().map(|&[r, g, b, _]| luminance([r, g, b])).collect()
}

fn difference(a: &Picture, b: &Picture, structure: bool) -> ViewDifference {
    assert_eq!((a.size, a.pixels.len()), (b.size, b.pixels.len()), "pictures of one size");
    let (mut squares, mut either, mut one) = (0u128, 0, 0);
    for (p, q) in a.pixels.iter().zip(&b.pixels) {
        let (drawn_a, drawn_b) = (p[3] != 0, q[3] != 0);
        either += u64::from(drawn_a | drawn_b);
        one += u64::from(drawn_a != drawn_b);
        if p != q {
            let off = i64::from(luminance([p[0], p[1], p[2]]) - luminance([q[0], q[1], q[2]]));
            squares += (off * off) as u128;
        }
    }
    let similarity = structure.then(|| ssim::between(a, b));
    ViewDifference {
        rms: root_mean(squares, a.pixels.len() as f64),
        silhouette: share(one, either),
        ssim: similarity,
        squares,
        covered: [either, one],
        similar: either,
    }
}
