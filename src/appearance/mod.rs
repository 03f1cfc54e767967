//! How things look: pictures of scenes and levels, and how far apart two of them are.
//!
//! `looks` holds materials and textures (`image_file` reads their files), `drawable` the triangles and where they stand,
//! `assemble` makes both from a scene; `views` places cameras, `render` draws (`raster` finds what is seen, `shade` its
//! colour), `gpu` does so on a graphics card and `renderer` chooses, `metric` and `ssim` compare, `blame` gives differences back to faces, `sheet` shows. Knows nothing of how
//! levels are made, and is not told which of two drawables is the level.

pub mod assemble;
pub mod blame;
pub mod drawable;
pub mod fingerprint;
#[cfg(feature = "render")]
pub mod gpu;
pub mod image_file;
pub mod images;
pub mod looks;
pub mod material;
pub mod metric;
pub mod raster;
pub mod render;
pub mod renderer;
pub mod shade;
pub mod sheet;
mod skin;
pub mod soup;
pub mod srgb;
pub mod ssim;
#[cfg(test)]
mod tests;
pub mod texture;
pub mod views;
