//! Pictures of drawables: what a renderer gives, and the one that needs no graphics card.
//!
//! The CPU path is the reference: scalar arithmetic without fused operations, one thread for each picture, so that a
//! picture is the same bit for bit on every machine.

use super::drawable::{Drawable, NO_FACE};
use super::material::Alpha;
use super::raster::{Facing, LARGEST_SIZE, Visibility, project};
use super::shade::{BACKGROUND, Placed, Shader};
use super::srgb::Srgb;
use super::views::Camera;
use rayon::prelude::*;

/// One view of a drawable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width and height, in pixels.
    pub size: u32,
    /// sRGB, rows from the top. Alpha is 255 where something is drawn, else 0 over [`BACKGROUND`].
    pub pixels: Vec<[u8; 4]>,
    /// The face seen in each pixel, numbered as in [`Drawable::first_faces`], or [`NO_FACE`]; empty if not asked for.
    pub faces: Vec<u32>,
}

/// A picture could not be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// A size that cannot be drawn.
    #[error("pictures have 1 to {LARGEST_SIZE} pixels a side, not {0}")]
    Size(u32),
    /// Nothing that could draw but the reference.
    #[error("no graphics card was found")]
    NoAdapter,
    /// This program was built without the feature `render`.
    #[error("this build of lodbake has no renderer for graphics cards (feature `render`)")]
    NotBuilt,
    /// From the graphics card's driver.
    #[error("the graphics card failed: {0}")]
    Device(String),
    /// More than the card can read at once.
    #[error("the scene needs {bytes} bytes in one piece, the graphics card has room for {most}")]
    TooLarge {
        /// Of the largest array.
        bytes: u64,
        /// That the card takes.
        most: u64,
    },
}

impl RenderError {
    /// Could the reference draw what this renderer could not?
    pub fn is_of_device(&self) -> bool {
        !matches!(self, Self::Size(_))
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Size(_) => None,
            Self::NoAdapter => {
                Some("install its Vulkan driver (Mesa's draws without a card), or use the renderer `cpu`")
            }
            Self::NotBuilt | Self::Device(_) | Self::TooLarge { .. } => Some("use the renderer `cpu`"),
        }
    }
}

/// What a picture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Pixels a side, 1…4096.
    pub size: u32,
    /// Note which face is seen in each pixel.
    pub faces: bool,
}

/// Something that draws.
pub trait Render: Sync {
    /// Makes a drawable ready for any number of pictures.
    fn prepare<'a>(&'a self, drawable: &'a Drawable) -> Result<Box<dyn Prepared + 'a>, RenderError>;
}

/// A drawable that is ready.
pub trait Prepared: Sync {
    /// Draws one view.
    fn draw(&self, camera: &Camera, shot: Shot) -> Result<Picture, RenderError>;
}

/// Draws all views, in parallel, in order.
pub fn pictures(
    renderer: &dyn Render,
    drawable: &Drawable,
    cameras: &[Camera],
    shot: Shot,
) -> Result<Vec<Picture>, RenderError> {
    let prepared = renderer.prepare(drawable)?;
    cameras.par_iter().with_max_len(1).map(|camera| prepared.draw(camera, shot)).collect()
}

/// The renderer that needs nothing: the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Render for Cpu {
    fn prepare<'a>(&'a self, drawable: &'a Drawable) -> Result<Box<dyn Prepared + 'a>, RenderError> {
        let placed = drawable.instances.iter().map(|instance| Placed::new(instance.transform)).collect();
        Ok(Box::new(CpuScene { drawable, placed, first_faces: drawable.first_faces() }))
    }
}

struct CpuScene<'a> {
    drawable: &'a Drawable,
    /// One for each instance.
    placed: Vec<Placed>,
    first_faces: Vec<u32>,
}

impl Prepared for CpuScene<'_> {
    fn draw(&self, camera: &Camera, shot: Shot) -> Result<Picture, RenderError> {
        let size = shot.size;
        if size == 0 || size > LARGEST_SIZE {
            return Err(RenderError::Size(size));
        }
        let shader = Shader { looks: &self.drawable.looks, eye: camera.eye, srgb: Srgb::new() };
        let visibility = self.visibility(camera, size, &shader);
        let [r, g, b] = BACKGROUND;
        let count = size as usize * size as usize;
        let mut pixels = vec![[r, g, b, 0]; count];
        let mut faces = if shot.faces { vec![NO_FACE; count] } else { Vec::new() };
        for row in 0..size {
            let y = size - 1 - row;
            for x in 0..size {
                let Some(setup) = visibility.seen(x, y) else { continue };
                let at = (row * size + x) as usize;
                let instance = &self.drawable.instances[setup.instance as usize];
                let part = &self.drawable.parts[instance.part];
                let placed = &self.placed[setup.instance as usize];
                let [r, g, b] = shader.color(part, placed, setup, x as i32, y as i32);
                pixels[at] = [r, g, b, 255];
                if shot.faces {
                    faces[at] = self.first_faces[instance.part] + setup.triangle;
                }
            }
        }
        Ok(Picture { size, pixels, faces })
    }
}

impl CpuScene<'_> {
    fn visibility(&self, camera: &Camera, size: u32, shader: &Shader<'_>) -> Visibility {
        let mut visibility = Visibility::new(size);
        let mut corners = Vec::new();
        for (number, (instance, placed)) in self.drawable.instances.iter().zip(&self.placed).enumerate() {
            let part = &self.drawable.parts[instance.part];
            let material = &self.drawable.looks.materials[part.material];
            project(part, &(camera.clip * instance.transform), size, &mut corners);
            let facing = Facing { mirrored: placed.mirrored, double_sided: material.double_sided };
            let holes = material.alpha != Alpha::Opaque;
            visibility
                .draw(number as u32, part, &corners, facing, holes, |setup, x, y| shader.passes(part, setup, x, y));
        }
        visibility
    }
}
