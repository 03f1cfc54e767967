//! The fox's fur: one closed surface around all shapes, painted by its vertices, weighted by nearness to the shapes.

use super::skeleton::{JOINTS, Joint, Shape, shapes};
use crate::field;
use crate::noise;
use crate::raster::{blend, hex};
use crate::surface::Surface;
use crate::turn::step;
use glam::DVec3;

/// How softly two shapes grow into each other, in metres.
const SOFT: f64 = 0.035;

/// What is cut out of the left ear's front.
const HOLLOW: Shape = Shape::Blade([[0.13, 0.99, 0.082], [0.187, 1.115, 0.05]], [0.058, 0.014], 1.15);

/// Distance to the fur.
pub fn distance(shapes: &[(Joint, Shape)], p: DVec3) -> f64 {
    let body = shapes.iter().fold(9.0, |near, (_, shape)| field::blend(near, shape.distance(p), SOFT));
    // Ears are hollow in front.
    let ear = DVec3::new(p.x.abs(), p.y, p.z);
    -field::blend(-body, HOLLOW.distance(ear), 0.02)
}

/// The fur's surface, shaded and painted.
pub fn fur(cell: f64) -> Surface {
    let (low, high) = (DVec3::new(-0.46, -0.04, -0.66), DVec3::new(0.46, 1.24, 0.36));
    let shapes = shapes();
    let distance = |p: DVec3| distance(&shapes, p);
    let skin = field::surface(low, high, cell, distance);
    // The soles are flat.
    let mut skin = skin.mapped(|p| DVec3::new(p.x, p.y.max(0.004), p.z)).shaded(180.0);
    for (p, n) in skin.positions.iter().zip(&mut skin.normals) {
        if p.y > 0.01 {
            *n = field::gradient(&distance, *p, 0.004);
        }
    }
    skin.painted(|p, n| {
        let open = distance(p + n * 0.05) / 0.05;
        // Creases and the underside lie in shade.
        let light = (0.62 + 0.38 * step(0.2, 1.0, open)) * (0.86 + 0.14 * step(-0.8, 0.2, n.y));
        (color(p, n) * light).to_array()
    })
}

/// 1 on the white parts: bib, muzzle, cheeks, tip of the tail.
fn white(p: DVec3) -> f64 {
    let (x, rough) = (p.x.abs(), 0.012 * noise::space(p * 28.0, 3));
    let edge = 0.012;
    let soft = |distance: f64| step(edge, -edge, distance + rough);
    let face = if p.y > 0.68 && p.z > -0.06 {
        let brow = 0.782 + 0.075 * step(0.03, 0.15, x) - 0.06 * step(0.25, 0.13, p.z) * step(0.2, 0.1, x);
        soft(p.y - brow)
    } else {
        0.0
    };
    let bib = if p.z > 0.0 && p.y < 0.7 {
        soft(x - 0.085 * step(0.2, 0.36, p.y) - 0.012) * step(0.2, 0.26, p.y)
    } else {
        0.0
    };
    let tip = if p.z < -0.3 { soft(0.6 - p.y + 0.1 * noise::space(p * 14.0, 5)) } else { 0.0 };
    face.max(bib).max(tip)
}

/// 1 on the dark parts: socks, gloves, tips of the ears.
fn dark(p: DVec3) -> f64 {
    let rough = 0.01 * noise::space(p * 30.0, 7);
    let sock = step(0.16, 0.12, p.y + rough) * step(-0.12, -0.08, p.z);
    let glove = step(0.255, 0.285, p.x.abs() + rough) * step(0.55, 0.5, p.y);
    let ear = step(1.075, 1.11, p.y + rough);
    sock.max(glove).max(ear)
}

fn color(p: DVec3, n: DVec3) -> DVec3 {
    let patch = noise::cloud(p * 9.0, 3, 11);
    let strand = noise::cloud(DVec3::new(p.x * 60.0, p.y * 18.0, p.z * 60.0), 2, 12);
    let orange = blend(hex(0xc85a1c), hex(0xf08a35), 0.55 + 0.5 * patch + 0.35 * strand + 0.25 * n.z);
    let cream = blend(hex(0xe9d9c2), hex(0xfdf6ea), 0.6 + 0.5 * strand + 0.3 * n.y);
    let brown = blend(hex(0x2c1a14), hex(0x4d3024), 0.5 + 0.6 * strand);
    let fur = blend(blend(orange, cream, white(p)), brown, dark(p));
    let inside = HOLLOW.distance(DVec3::new(p.x.abs(), p.y, p.z));
    blend(fur, hex(0xf2d3b8), step(0.012, 0.002, inside) * step(0.0, 0.4, n.z))
}

/// Four joints and their weights (in 1/255, summing to 255) for a point of the fur.
pub fn weights(shapes: &[(Joint, Shape)], p: DVec3) -> ([u8; 4], [u8; 4]) {
    let mut near = [f64::MAX; JOINTS.len()];
    for (joint, shape) in shapes {
        let slot = &mut near[*joint as usize];
        *slot = slot.min(shape.distance(p).max(0.0));
    }
    // A joint pulls with the inverse cube of its distance; the offset makes the change soft near a joint.
    let pull = near.map(|d| if d > 0.2 { 0.0 } else { 1.0 / ((d + 0.014) * (d + 0.014) * (d + 0.014)) });
    quantised(&pull)
}

/// The four strongest of all joints' pulls, as bytes.
pub fn quantised(pull: &[f64]) -> ([u8; 4], [u8; 4]) {
    let mut order: Vec<usize> = (0..pull.len()).collect();
    order.sort_by(|a, b| pull[*b].total_cmp(&pull[*a]).then(a.cmp(b)));
    let four = [order[0], order[1], order[2], order[3]];
    let total: f64 = four.iter().map(|j| pull[*j]).sum();
    let mut bytes = four.map(|j| (pull[j] / total * 255.0).round() as i32);
    bytes[0] += 255 - bytes.iter().sum::<i32>();
    let joints = std::array::from_fn(|k| if bytes[k] == 0 { 0 } else { four[k] as u8 });
    (joints, bytes.map(|b| b as u8))
}

/// All of a surface on one joint.
pub fn rigid(joint: Joint) -> ([u8; 4], [u8; 4]) {
    ([joint as u8, 0, 0, 0], [255, 0, 0, 0])
}
