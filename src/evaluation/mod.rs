//! Any scene or mesh against any other, whoever made them: looks, surfaces, textures, sizes.
//!
//! The frame of all pictures and the unit of all relative lengths come from the reference. Reads the files that it is
//! given; knows nothing of pipelines and bakes.

mod subject;
mod table;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::appearance::metric::{Comparison, Reference};
use crate::appearance::render::{Render, RenderError, Shot};
use crate::appearance::soup::soup;
use crate::appearance::views::rhombicuboctahedron;
use crate::compare::{Soup, SurfaceDistance, TextureDeviation, TextureStretch};

pub use subject::{Subject, SubjectError};

/// Version of the record.
pub const FORMAT: u32 = 1;

/// How a reference and candidates were compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Evaluation {
    /// Version of this record.
    pub format: u32,
    /// Program and version that measured.
    pub tool: String,
    /// What drew the pictures: `cpu` is the reference path; a graphics adapter is named.
    pub renderer: String,
    /// Pixels on each side of the pictures.
    pub size: u32,
    /// Points sampled on each surface.
    pub samples: u64,
    /// Radius of the sphere round the reference, in its units: the frame of all pictures.
    pub radius: f64,
    /// What the others are compared with.
    pub reference: Facts,
    /// One for each candidate, in the order given.
    pub candidates: Vec<Candidate>,
}

/// What one file (or one level of it) is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Facts {
    /// As it was given: path, with `@LEVEL` if a level was asked for.
    pub name: String,
    /// Level drawn, 0 is the finest.
    pub level: u64,
    /// Triangles drawn, with every instance.
    pub triangles: u64,
    /// Triangles stored: every primitive once, however often it is drawn.
    pub triangles_stored: u64,
    /// Vertices stored.
    pub vertices: u64,
    /// Bytes of the file and its buffers (with all levels), not of images.
    pub bytes: u64,
    /// Stretch of its textures over its surface; absent if it has none.
    pub stretch: Option<TextureStretch>,
    /// What could not be shown, e.g. an image that cannot be read.
    pub notes: Vec<String>,
}

/// One candidate and how it differs from the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Candidate {
    /// What it is.
    #[serde(flatten)]
    pub facts: Facts,
    /// d_RMS: root mean square of luminance differences (0 to 255) over all pixels of 24 views.
    pub d_rms: f64,
    /// The same of each view.
    pub views: Vec<f64>,
    /// Number of the view that differs most, from 0.
    pub worst_view: u64,
    /// Share of the pixels covered by either that only one of them covers, 0 to 1.
    pub silhouette: f64,
    /// Mean structural similarity over the pixels covered by either, 1 for equal pictures.
    pub ssim: f64,
    /// Sampled distances between the surfaces, in units of the reference; absent if one of them has no area.
    pub surface: Option<SurfaceDistance>,
    /// How far textures moved over the surface, in units of the reference; absent without a shared texture.
    pub texture: Option<TextureDeviation>,
}

/// How carefully to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Pixels on each side of the pictures.
    pub size: u32,
    /// Points on each surface.
    pub samples: usize,
}

impl Default for Options {
    /// 512 pixels, as in the definition of d_RMS; 50,000 points.
    fn default() -> Self {
        Self { size: 512, samples: 50_000 }
    }
}

/// A reference, drawn once, for any number of candidates.
pub struct Evaluator<'a> {
    renderer: &'a dyn Render,
    options: Options,
    reference: &'a Subject,
    pictures: Reference,
    soup: Soup,
}

impl<'a> Evaluator<'a> {
    /// Draws the reference.
    pub fn new(renderer: &'a dyn Render, reference: &'a Subject, options: Options) -> Result<Self, RenderError> {
        let drawable = &reference.drawable;
        let shot = Shot { size: options.size, faces: false };
        let pictures = Reference::new(renderer, drawable, drawable.frame(), &rhombicuboctahedron(), shot)?;
        Ok(Self { renderer, options, reference, pictures, soup: soup(drawable) })
    }

    /// Compares one candidate.
    pub fn candidate(&self, candidate: &Subject) -> Result<Candidate, RenderError> {
        let Comparison { rms, worst, silhouette, ssim, views } =
            self.pictures.compare(self.renderer, &candidate.drawable, true)?;
        let other = soup(&candidate.drawable);
        Ok(Candidate {
            facts: candidate.facts(&other),
            d_rms: rms,
            views: views.iter().map(|view| view.rms).collect(),
            worst_view: worst as u64,
            silhouette,
            ssim: ssim.unwrap_or(1.0),
            surface: SurfaceDistance::measure(&self.soup.corners, &other.corners, self.options.samples),
            texture: TextureDeviation::measure(&self.soup, &other, self.options.samples),
        })
    }

    /// The record of this reference and the candidates that were compared with it.
    pub fn record(&self, renderer: &str, candidates: Vec<Candidate>) -> Evaluation {
        Evaluation {
            format: FORMAT,
            tool: concat!("lodbake ", env!("CARGO_PKG_VERSION")).to_owned(),
            renderer: renderer.to_owned(),
            size: self.options.size,
            samples: self.options.samples as u64,
            radius: self.reference.drawable.frame().radius,
            reference: self.reference.facts(&self.soup),
            candidates,
        }
    }
}

/// The JSON schema of [`Evaluation`].
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Evaluation).to_value()
}
