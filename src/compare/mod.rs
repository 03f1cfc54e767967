//! How two surfaces differ: distance, texture deviation, texture stretch.
//!
//! Triangles in one space, whoever made them; both surfaces may come from anywhere. Knows no files, no materials but
//! their numbers, and nothing of how surfaces look (that is `appearance`).

mod surface;
mod texture;

pub use surface::{Distances, SurfaceDistance};
pub use texture::{TextureDeviation, TextureStretch};

/// The corners of a triangle, object space units.
pub type Corners = [[f64; 3]; 3];

/// Triangles with what they share with others: texture coordinates and a material. All lists are of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Soup {
    /// Corners.
    pub corners: Vec<Corners>,
    /// Texture coordinates of the corners; `None` = untextured.
    pub uvs: Vec<Option<[[f64; 2]; 3]>>,
    /// Whose texture the coordinates mean.
    pub materials: Vec<u32>,
}
