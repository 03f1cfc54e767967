//! What a level looks like beside its source, whoever made it: the evaluator's figures, and how fast it is drawn.
//!
//! The renderer is the reference one, which needs no graphics card; so the figures are the same on every machine, and
//! frames per second are those of that renderer on one thread.

use std::path::Path;
use std::time::Instant;

use super::record::{DistanceFacts, LevelFacts};
use super::statistics::Summary;
use crate::appearance::drawable::Drawable;
use crate::appearance::render::{Render, RenderError, Shot};
use crate::appearance::soup::soup;
use crate::appearance::views::{Camera, rhombicuboctahedron};
use crate::compare::Corners;
use crate::evaluation::{Evaluator, Options, Subject, SubjectError};

/// Samples of equal surfaces are this far apart at most, as a fraction of the diagonal: positions have 24 bits.
const NO_DISTANCE: f64 = 1e-8;

/// Why something could not be looked at.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// It cannot be read, or shows nothing.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// It cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// A source, its pictures taken once for all levels.
pub struct Source<'a> {
    evaluator: Evaluator<'a>,
    cameras: Vec<Camera>,
    renderer: &'a dyn Render,
    size: u32,
    diagonal: f64,
    /// Drawn triangles.
    pub triangles: u64,
    /// Stored vertices.
    pub vertices: u64,
    /// Seconds to draw one view.
    pub frame_seconds: Option<Summary>,
}

/// Reads a file; `level` chooses from its levels, 0 is what it shows without any.
pub fn open(file: &Path, level: usize) -> Result<Subject, SubjectError> {
    match level {
        0 => Subject::load(&file.display().to_string()),
        level => Subject::load(&format!("{}@{level}", file.display())),
    }
}

impl<'a> Source<'a> {
    /// Draws a source; views have `size` pixels a side.
    pub fn new(renderer: &'a dyn Render, subject: &'a Subject, size: u32) -> Result<Self, EvaluateError> {
        let drawable = &subject.drawable;
        let cameras = Camera::all(drawable.frame(), &rhombicuboctahedron());
        Ok(Self {
            evaluator: Evaluator::new(renderer, subject, Options { size, ..Options::default() })?,
            frame_seconds: frame_seconds(renderer, drawable, &cameras, size)?,
            cameras,
            renderer,
            size,
            diagonal: diagonal(&soup(drawable).corners),
            triangles: drawable.triangles(),
            vertices: drawable.parts.iter().map(|part| part.positions.len() as u64).sum(),
        })
    }

    /// Measures a file against this source.
    pub fn measure(&self, file: &Path, level: usize) -> Result<LevelFacts, EvaluateError> {
        let subject = open(file, level)?;
        let found = self.evaluator.candidate(&subject)?;
        Ok(LevelFacts {
            triangles: found.facts.triangles,
            vertices: found.facts.vertices,
            d_rms: found.d_rms,
            worst_view: found.views.get(found.worst_view as usize).copied().unwrap_or(0.0),
            silhouette: found.silhouette,
            ssim: found.ssim,
            distance: found.surface.filter(|_| 0.0 < self.diagonal).map(|surface| DistanceFacts {
                mean: self.share(f64::midpoint(surface.forward.mean, surface.backward.mean)),
                rms: self.share(surface.forward.rms.max(surface.backward.rms)),
                max: self.share(surface.max()),
            }),
            frame_seconds: frame_seconds(self.renderer, &subject.drawable, &self.cameras, self.size)?,
        })
    }

    /// A distance as a fraction of the diagonal. What is left of rounding between equal surfaces is none.
    fn share(&self, distance: f64) -> f64 {
        let share = distance / self.diagonal;
        if share < NO_DISTANCE { 0.0 } else { share }
    }
}

/// One view after the other on this thread, so that each has the machine for itself.
fn frame_seconds(
    renderer: &dyn Render,
    drawable: &Drawable,
    cameras: &[Camera],
    size: u32,
) -> Result<Option<Summary>, RenderError> {
    let prepared = renderer.prepare(drawable)?;
    let shot = Shot { size, faces: false };
    let mut seconds = Vec::with_capacity(cameras.len());
    for camera in cameras {
        let began = Instant::now();
        std::hint::black_box(prepared.draw(camera, shot)?);
        seconds.push(began.elapsed().as_secs_f64());
    }
    Ok(Summary::of(&seconds))
}

/// Of the bounding box.
fn diagonal(surface: &[Corners]) -> f64 {
    let points = || surface.iter().flatten();
    let extent = [0, 1, 2].map(|axis| {
        let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let high = points().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        high - low
    });
    extent.iter().map(|side| side * side).sum::<f64>().sqrt()
}
