//! A contact sheet: one row for each view, the source on the left, then each level with its difference eightfold.

use super::drawable::Drawable;
use super::render::{Picture, Render, RenderError, Shot, pictures};
use super::views::{Camera, Frame};
use glam::DVec3;
use image::RgbImage;
use std::io::Cursor;

/// How much differences are stretched.
const STRETCH: i32 = 8;

/// Pixels between two pictures.
const GAP: u32 = 4;

/// Draws a sheet: for each of `directions` the source, then each level and its difference from the source
/// (|source − level| × 8 in each colour, black where they are equal). `size` is the side of one picture in pixels.
pub fn draw(
    renderer: &dyn Render,
    source: &Drawable,
    levels: &[&Drawable],
    frame: Frame,
    directions: &[DVec3],
    size: u32,
) -> Result<RgbImage, RenderError> {
    let cameras = Camera::all(frame, directions);
    let shot = Shot { size, faces: false };
    let source = pictures(renderer, source, &cameras, shot)?;
    let levels: Result<Vec<_>, _> = levels.iter().map(|level| pictures(renderer, level, &cameras, shot)).collect();
    let levels = levels?;
    let columns = 1 + 2 * levels.len() as u32;
    let pitch = size + GAP;
    let mut image = RgbImage::from_pixel(
        columns * pitch - GAP,
        (directions.len() as u32 * pitch).saturating_sub(GAP).max(1),
        image::Rgb([255; 3]),
    );
    for (row, picture) in source.iter().enumerate() {
        let mut put = |column: usize, picture: &Picture| {
            paste(&mut image, picture, column as u32 * pitch, row as u32 * pitch);
        };
        put(0, picture);
        for (i, level) in levels.iter().enumerate() {
            put(1 + 2 * i, &level[row]);
            put(2 + 2 * i, &stretched(picture, &level[row]));
        }
    }
    Ok(image)
}

fn paste(image: &mut RgbImage, picture: &Picture, left: u32, top: u32) {
    for (i, [r, g, b, _]) in picture.pixels.iter().enumerate() {
        let (x, y) = (i as u32 % picture.size, i as u32 / picture.size);
        image.put_pixel(left + x, top + y, image::Rgb([*r, *g, *b]));
    }
}

fn stretched(a: &Picture, b: &Picture) -> Picture {
    let channel = |p: u8, q: u8| ((i32::from(p) - i32::from(q)).abs() * STRETCH).min(255) as u8;
    let pixels = a.pixels.iter().zip(&b.pixels);
    let pixels = pixels.map(|(p, q)| [channel(p[0], q[0]), channel(p[1], q[1]), channel(p[2], q[2]), 255]);
    Picture { size: a.size, pixels: pixels.collect(), faces: Vec::new() }
}

/// A small file for pages: a sheet is for looking, figures come from elsewhere.
pub fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 85);
    image.write_with_encoder(encoder).expect("an image in memory can be written");
    bytes
}

/// All colours as they are.
pub fn png(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).expect("an image in memory can be written");
    bytes
}
