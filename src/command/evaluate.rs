//! `lodbake evaluate REFERENCE CANDIDATE…`: how scenes differ from another one, whoever made them. Writes nothing but
//! the contact sheet it is asked for.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};

use super::failure::UsageError;
use super::{Context, Exit};
use crate::appearance::drawable::Drawable;
use crate::appearance::render::RenderError;
use crate::appearance::renderer::{self, Chosen};
use crate::appearance::sheet;
use crate::appearance::views::rhombicuboctahedron;
use crate::config::Renderer;
use crate::evaluation::{Candidate, Evaluator, Options, Subject};

/// Measure how scenes or levels differ from a reference: looks, surfaces, textures, sizes
#[derive(Clone, Debug, clap::Args)]
pub struct Evaluate {
    /// What the others are compared with (`.glb`, `.gltf`, `.obj`; `FILE@2` is level 2 of its `MSFT_lod` groups)
    #[arg(value_name = "REFERENCE")]
    reference: String,
    /// Files or levels to compare with it, by any program
    #[arg(required = true, value_name = "CANDIDATE")]
    candidates: Vec<String>,
    /// Pixels on each side of the pictures
    #[arg(long, value_name = "PIXELS", default_value_t = Options::default().size,
          value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// What draws them: `auto` takes a graphics card where there is one, `cpu` is the reference
    #[arg(long, value_name = "NAME", default_value_t = Renderer::default(),
          value_parser = PossibleValuesParser::new(Renderer::ALL.iter().map(|r| r.name())).try_map(|name| named(&name)))]
    renderer: Renderer,
    /// Points sampled on each surface
    #[arg(long, value_name = "N", default_value_t = Options::default().samples)]
    samples: usize,
    /// Write a contact sheet (PNG): reference, candidates and differences × 8
    #[arg(long, value_name = "FILE")]
    sheet: Option<PathBuf>,
    /// Views on the contact sheet, of the 24
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "0,5,10,20", requires = "sheet",
          value_parser = clap::value_parser!(u8).range(0..24))]
    views: Vec<u8>,
}

impl Evaluate {
    /// A table, or one JSON document. A candidate that cannot be read does not stop the others.
    pub fn run(&self, context: &Context) -> anyhow::Result<Exit> {
        let jobs = context.jobs.map_or(0, std::num::NonZeroUsize::get);
        let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build().context("failed to start threads")?;
        threads.install(|| {
            let chosen = renderer::open(self.renderer)?;
            match self.evaluate(context, &chosen) {
                // All of it again, so that no figure compares pictures of two renderers.
                Err(error) if self.renderer == Renderer::Auto && !chosen.is_reference() && is_of_device(&error) => {
                    self.evaluate(context, &Chosen::cpu())
                }
                done => done,
            }
        })
    }

    fn evaluate(&self, context: &Context, chosen: &Chosen) -> anyhow::Result<Exit> {
        if self.samples == 0 {
            let message = "`--samples` must be 1 or more".to_owned();
            return Err(UsageError { message, hint: None }.into());
        }
        let renderer = &*chosen.renderer;
        let reference = Subject::load(&self.reference)?;
        let options = Options { size: self.size, samples: self.samples };
        let evaluator = Evaluator::new(renderer, &reference, options)?;
        let mut exit = Exit::Fine;
        let mut subjects: Vec<Subject> = Vec::new();
        let mut compared: Vec<Candidate> = Vec::new();
        for name in &self.candidates {
            match Subject::load(name) {
                Ok(subject) => {
                    compared.push(evaluator.candidate(&subject)?);
                    if self.sheet.is_some() {
                        subjects.push(subject);
                    }
                }
                Err(error) => {
                    context.error(&error.into());
                    exit = Exit::Undone;
                }
            }
        }
        let evaluation = evaluator.record(&chosen.name, compared);
        if let Some(path) = &self.sheet {
            let levels: Vec<&Drawable> = subjects.iter().map(|subject| &subject.drawable).collect();
            let all = rhombicuboctahedron();
            let views: Vec<_> = self.views.iter().map(|&view| all[usize::from(view)]).collect();
            let drawable = &reference.drawable;
            // As large as fits a screen with one candidate.
            let sheet = sheet::draw(renderer, drawable, &levels, drawable.frame(), &views, self.size.min(512))?;
            let png = sheet::png(&sheet);
            std::fs::write(path, png).with_context(|| format!("failed to write `{}`", path.display()))?;
        }
        if context.json {
            context.print(&format!("{}\n", serde_json::to_string_pretty(&evaluation)?))?;
        } else {
            context.print(&evaluation.to_text())?;
        }
        Ok(exit)
    }
}

fn named(name: &str) -> Result<Renderer, String> {
    Renderer::ALL.iter().copied().find(|renderer| renderer.name() == name).ok_or_else(|| "no such renderer".to_owned())
}

/// Could the reference do what failed?
fn is_of_device(error: &anyhow::Error) -> bool {
    error.chain().filter_map(|cause| cause.downcast_ref::<RenderError>()).any(RenderError::is_of_device)
}
