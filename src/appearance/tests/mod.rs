//! Small things whose pictures are known beforehand.

mod pictures;
mod scenes;
mod shading;

use super::drawable::{Drawable, Part};
use super::looks::Looks;
use super::material::{Material, TextureUse};
use super::render::{Cpu, Picture, Render as _, Shot};
use super::texture::{Encoding, Texture, Wrap};
use super::views::{Camera, Frame};
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

/// A square of side 2 in z = 0 that faces +z; the texture's top is at the top.
fn square() -> Part {
    Part {
        positions: [[-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: vec![vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X]],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Part::default()
    }
}

/// A matte dielectric.
fn matte() -> Material {
    Material { metallic: 0.0, ..Material::default() }
}

/// Material 0 and the textures it refers to.
fn looks(material: Material, textures: Vec<Texture>) -> Arc<Looks> {
    Arc::new(Looks { materials: vec![material, Material::default()], textures, notes: Vec::new() })
}

fn image(width: u32, texels: &[[u8; 4]], encoding: Encoding) -> Texture {
    Texture::new(width, texels.len() as u32 / width, texels.to_vec(), encoding).unwrap()
}

#[expect(clippy::unnecessary_wraps, reason = "materials want an option")]
fn laid(texture: usize) -> Option<TextureUse> {
    Some(TextureUse { texture, set: 0, wrap: [Wrap::Clamp; 2], transform: None })
}

fn one(part: Part, looks: Arc<Looks>) -> Drawable {
    Drawable::of_parts(vec![Arc::new(part)], looks)
}

/// A picture of 64 pixels that fits a sphere of radius 1.5 round the origin.
fn view(drawable: &Drawable, from: DVec3) -> Picture {
    let camera = Camera::new(Frame { center: DVec3::ZERO, radius: 1.5 }, from.normalize_or_zero());
    Cpu.prepare(drawable).unwrap().draw(&camera, Shot { size: 64, faces: true }).unwrap()
}

fn pixel(picture: &Picture, x: u32, y: u32) -> [u8; 4] {
    picture.pixels[(y * picture.size + x) as usize]
}

fn covered(picture: &Picture) -> usize {
    picture.pixels.iter().filter(|p| p[3] != 0).count()
}

/// Sum of the brightness of all covered pixels.
fn brightness(picture: &Picture) -> u64 {
    picture.pixels.iter().filter(|p| p[3] != 0).map(|p| u64::from(p[1])).sum()
}

/// A sphere of radius 1 with smooth normals, `n` slices.
fn sphere(n: usize) -> Part {
    let mut part = Part::default();
    for i in 0..=n {
        for j in 0..=2 * n {
            let (a, b) = (std::f64::consts::PI * i as f64 / n as f64, std::f64::consts::PI * j as f64 / n as f64);
            let p = DVec3::new(libm::sin(a) * libm::cos(b), libm::cos(a), -libm::sin(a) * libm::sin(b));
            part.positions.push(p.as_vec3());
            part.normals.push(p.as_vec3());
        }
    }
    let row = 2 * n as u32 + 1;
    for i in 0..n as u32 {
        for j in 0..2 * n as u32 {
            let (a, b) = (i * row + j, (i + 1) * row + j);
            part.indices.extend([a, b, b + 1, a, b + 1, a + 1]);
        }
    }
    part
}
