//! Which renderer draws: a graphics card where there is one, else the reference.
//!
//! Bakes do not ask here: what they decide and record must not depend on the machine, so that they always use the
//! reference, [`Cpu`].

use super::render::{Cpu, Render, RenderError};
use crate::config::Renderer;

/// A renderer and its name.
pub struct Chosen {
    /// Draws.
    pub renderer: Box<dyn Render>,
    /// `cpu` for the reference, else adapter and driver: for records.
    pub name: String,
}

impl Chosen {
    /// The reference.
    pub fn cpu() -> Self {
        Self { renderer: Box::new(Cpu), name: REFERENCE.to_owned() }
    }

    /// Is it the reference?
    pub fn is_reference(&self) -> bool {
        self.name == REFERENCE
    }
}

/// Name of the reference in records.
pub const REFERENCE: &str = "cpu";

/// Opens the renderer that was asked for. `Auto` takes hardware only: a program that acts as a graphics card is slower
/// than the reference; it has to be asked for as `Gpu`.
pub fn open(choice: Renderer) -> Result<Chosen, RenderError> {
    match choice {
        Renderer::Cpu => Ok(Chosen::cpu()),
        Renderer::Auto => Ok(gpu(false).unwrap_or_else(|_| Chosen::cpu())),
        Renderer::Gpu => gpu(true),
    }
}

#[cfg(feature = "render")]
fn gpu(programs: bool) -> Result<Chosen, RenderError> {
    use super::gpu::{Adapters, Gpu};
    let gpu = Gpu::open(if programs { Adapters::Any } else { Adapters::Hardware })?;
    Ok(Chosen { name: gpu.name().to_owned(), renderer: Box::new(gpu) })
}

#[cfg(not(feature = "render"))]
fn gpu(_programs: bool) -> Result<Chosen, RenderError> {
    Err(RenderError::NotBuilt)
}
