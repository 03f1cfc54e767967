//! Brightness against formulas worked out by hand.

use super::*;
use crate::appearance::shade::{EVEN, LAMP};
use glam::Vec4;

/// sRGB of some light, 0…255.
fn encoded(light: f64) -> f64 {
    255.0 * if light <= 0.0031308 { light * 12.92 } else { 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055 }
}

#[test]
fn a_matte_sphere_has_its_analytic_brightness() {
    let material = Material { base: Vec4::new(0.5, 0.5, 0.5, 1.0), ..matte() };
    let ball = one(sphere(96), looks(material, Vec::new()));
    let picture = view(&ball, DVec3::new(1.0, 0.2, 0.4));
    // Radius 1, distance 1.5 · 1.02 / sin 22.5°.
    let distance = 1.5 * 1.02 / libm::sin(std::f64::consts::PI / 8.0);
    let mut checked = 0;
    for x in 32..64 {
        let [_, g, _, alpha] = pixel(&picture, x, 32);
        let [u, v] =
            [(f64::from(x) + 0.5 - 32.0) / 32.0, -0.5 / 32.0].map(|c| c * libm::tan(std::f64::consts::PI / 8.0));
        let slope = libm::hypot(u, v);
        // The angle at the surface has the sine distance · sin(angle at the eye) / radius.
        let sine = distance * slope / (1.0 + slope * slope).sqrt();
        if sine > 0.98 {
            assert!(sine < 1.03 || alpha == 0);
            continue;
        }
        let facing = (1.0 - sine * sine).sqrt();
        let (lamp, even) = (f64::from(LAMP), f64::from(EVEN));
        // At roughness 1 the lamp's highlight is 1/4, the even light's 0.47 of the specular colour less 0.0024 or so.
        let light = 0.5 * 0.96 * (lamp * facing + even) + 0.04 * lamp * 0.25 + even * (0.04 * 0.4524 - 0.0024);
        assert!((f64::from(g) - encoded(light)).abs() < 1.5, "{x}: {g} for {}", encoded(light));
        checked += 1;
    }
    assert!(checked > 10);
}

#[test]
fn flat_normal_maps_change_nothing_and_bumps_turn_towards_their_side() {
    let with = |texel: [u8; 4], direction: DVec3| {
        let material = Material { normal_texture: laid(0), ..matte() };
        let flat = one(square(), looks(material, vec![image(1, &[texel], Encoding::Data)]));
        brightness(&view(&flat, direction))
    };
    let bare = |direction| brightness(&view(&one(square(), looks(matte(), Vec::new())), direction));
    let (right, left) = (DVec3::new(1.0, 0.0, 1.0), DVec3::new(-1.0, 0.0, 1.0));
    let (above, below) = (DVec3::new(0.0, 1.0, 1.0), DVec3::new(0.0, -1.0, 1.0));
    let near = |a: u64, b: u64| a.abs_diff(b) * 100 < a;
    assert!(near(with([128, 128, 255, 255], right), bare(right)));
    // Red leans towards +u, green towards the image's top.
    let (red, green) = ([218, 128, 218, 255], [128, 218, 218, 255]);
    assert!(with(red, right) > bare(right) && bare(left) > with(red, left));
    assert!(with(green, above) > bare(above) && bare(below) > with(green, below));
    assert!(near(with(red, above), with(red, below)));
}

#[test]
fn tangents_of_vertices_are_used() {
    let mut part = square();
    // Turned by a quarter: red now leans up.
    part.tangents = Some(vec![Vec4::new(0.0, 1.0, 0.0, 1.0); 4]);
    let material = Material { normal_texture: laid(0), ..matte() };
    let turned = one(part, looks(material, vec![image(1, &[[218, 128, 218, 255]], Encoding::Data)]));
    let from = |x: f64, y: f64| brightness(&view(&turned, DVec3::new(x, y, 1.0)));
    assert!(from(0.0, 1.0) > from(0.0, -1.0) * 11 / 10);
    assert!(from(1.0, 0.0).abs_diff(from(-1.0, 0.0)) * 50 < from(1.0, 0.0));
}

#[test]
fn factors_textures_and_vertex_colours_multiply() {
    let light = |material: Material, colors: Option<Vec<Vec4>>| {
        let part = Part { colors, ..square() };
        let gray = image(1, &[[188, 188, 188, 255]], Encoding::Color);
        pixel(&view(&one(part, looks(Material { unlit: true, ..material }, vec![gray])), DVec3::Z), 32, 32)[0]
    };
    let half = Vec4::new(0.5, 0.5, 0.5, 1.0);
    assert_eq!(light(matte(), None), 255);
    assert_eq!(light(Material { base_texture: laid(0), ..matte() }, None), 188);
    assert_eq!(light(Material { base: half, ..matte() }, None), 188);
    assert_eq!(light(matte(), Some(vec![half; 4])), 188);
    let both = light(Material { base: half, base_texture: laid(0), ..matte() }, None);
    // A quarter of the light.
    assert_eq!(both, 137);
}

#[test]
fn metal_is_not_black_and_emission_shines() {
    let metal = Material { metallic: 1.0, roughness: 0.1, ..Material::default() };
    let ball = one(sphere(48), looks(metal, Vec::new()));
    let picture = view(&ball, DVec3::Z);
    // Half way to the rim there is no highlight any more.
    let side = pixel(&picture, 42, 32);
    assert!((60..140).contains(&side[0]), "{side:?}");
    assert_eq!(pixel(&picture, 32, 32)[0], 255);
    let glow = Material { base: Vec4::new(0.0, 0.0, 0.0, 1.0), emissive: Vec3::new(0.0, 0.5, 0.0), ..matte() };
    let [r, g, b, _] = pixel(&view(&one(square(), looks(glow, Vec::new())), DVec3::Z), 32, 32);
    assert!((188..=194).contains(&g) && r == b && r < 40, "{r} {g} {b}");
}

#[test]
fn scaled_and_shifted_things_look_the_same() {
    let ball = one(sphere(24), looks(matte(), Vec::new()));
    let mut far = ball.clone();
    let shift = DVec3::new(4.0e6, -7.0e5, 1.0e6);
    far.instances[0].transform = glam::DMat4::from_translation(shift) * glam::DMat4::from_scale(DVec3::splat(1e-3));
    let draw = |drawable: &Drawable| {
        let camera = Camera::new(drawable.frame(), DVec3::new(0.6, 0.0, 0.8));
        Cpu.prepare(drawable).unwrap().draw(&camera, Shot { size: 64, faces: false }).unwrap()
    };
    let (a, b) = (draw(&ball), draw(&far));
    let off = a.pixels.iter().zip(&b.pixels).filter(|(p, q)| p[0].abs_diff(q[0]) > 1).count();
    assert!(off < 20, "{off}");
}
