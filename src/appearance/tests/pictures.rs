//! What is seen where: textures, holes, sides, faces, and figures of the metric.

use super::*;
use crate::appearance::drawable::{Instance, NO_FACE};
use crate::appearance::material::Alpha;
use crate::appearance::metric::Reference;
use crate::appearance::render::{RenderError, pictures};
use crate::appearance::shade::BACKGROUND;
use crate::appearance::sheet::{draw, png};
use crate::appearance::views::{fibonacci, rhombicuboctahedron};
use glam::DMat4;

#[test]
fn textures_are_the_right_way_up() {
    let quarters = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [9, 9, 9, 255]];
    let material = Material { base_texture: laid(0), unlit: true, ..matte() };
    let square = one(square(), looks(material, vec![image(2, &quarters, Encoding::Color)]));
    let picture = view(&square, DVec3::Z);
    // The square spans pixels 15 to 48 or so.
    assert_eq!(pixel(&picture, 18, 18), [255, 0, 0, 255]);
    assert_eq!(pixel(&picture, 45, 18), [0, 255, 0, 255]);
    assert_eq!(pixel(&picture, 18, 45), [0, 0, 255, 255]);
    assert_eq!(pixel(&picture, 45, 45), [9, 9, 9, 255]);
    assert_eq!(pixel(&picture, 2, 2), [BACKGROUND[0], BACKGROUND[1], BACKGROUND[2], 0]);
    assert_eq!([45 * 64 + 18, 18 * 64 + 45, 0].map(|i: usize| picture.faces[i]), [0, 1, NO_FACE]);
}

#[test]
fn masks_cut_and_blending_thins_out() {
    let texture = || image(2, &[[255, 255, 255, 0], [255; 4]], Encoding::Color);
    let with = |alpha, base_texture, opacity| {
        let mut material = Material { base_texture, alpha, ..matte() };
        material.base.w = opacity;
        covered(&view(&one(square(), looks(material, vec![texture()])), DVec3::Z))
    };
    let whole = with(Alpha::Opaque, laid(0), 1.0);
    let half = with(Alpha::Mask(0.5), laid(0), 1.0);
    assert!((2 * half).abs_diff(whole) <= 40, "{half} of {whole}");
    assert_eq!(with(Alpha::Mask(0.5), None, 0.4), 0);
    assert_eq!(with(Alpha::Blend, None, 1.0), whole);
    assert_eq!(with(Alpha::Blend, None, 0.0), 0);
    let quarter = with(Alpha::Blend, None, 0.25);
    assert!((4 * quarter).abs_diff(whole) <= whole / 10, "{quarter} of {whole}");
}

#[test]
fn back_faces_are_seen_where_the_material_says_so_and_are_lit() {
    let from = |double_sided, direction| {
        view(&one(square(), looks(Material { double_sided, ..matte() }, Vec::new())), direction)
    };
    let front = from(false, DVec3::Z);
    assert!(covered(&front) > 900);
    assert_eq!(covered(&from(false, -DVec3::Z)), 0);
    let back = from(true, -DVec3::Z);
    // Pixels on an edge fall to the other side in the mirror.
    assert!(covered(&back).abs_diff(covered(&front)) <= 64);
    assert_eq!(pixel(&back, 32, 32), pixel(&front, 32, 32));
}

#[test]
fn mirrored_instances_show_the_same_side() {
    let mut square = one(square(), looks(matte(), Vec::new()));
    let front = view(&square, DVec3::Z);
    square.instances[0].transform = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mirrored = view(&square, DVec3::Z);
    assert_eq!(pixel(&mirrored, 30, 32), pixel(&front, 30, 32));
    assert_eq!(covered(&view(&square, -DVec3::Z)), 0);
}

#[test]
fn identity_is_exactly_zero_and_threads_do_not_matter() {
    let ball = one(sphere(16), looks(matte(), Vec::new()));
    let coarse = one(sphere(6), looks(matte(), Vec::new()));
    let measure = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let shot = Shot { size: 64, faces: false };
            let reference = Reference::new(&Cpu, &ball, ball.frame(), &rhombicuboctahedron(), shot).unwrap();
            let same = reference.compare(&Cpu, &ball, true).unwrap();
            let other = reference.compare(&Cpu, &coarse, true).unwrap();
            (same, other, reference.pictures)
        })
    };
    let (same, other, pictures) = measure(1);
    assert_eq!((same.rms, same.silhouette, same.ssim, same.worst), (0.0, 0.0, Some(1.0), 0));
    assert_eq!(same.views.len(), 24);
    assert!(other.rms > 1.0 && other.silhouette > 0.01 && other.ssim.unwrap() < 0.999, "{other:?}");
    assert!(other.views.iter().all(|v| v.rms <= other.views[other.worst].rms));
    let mean = other.views.iter().map(|v| v.rms * v.rms).sum::<f64>() / 24.0;
    assert!((mean.sqrt() - other.rms).abs() < 1e-9);
    assert_eq!(measure(2), (same, other, pictures));
}

#[test]
fn figures_are_those_of_their_definition() {
    let unlit = |gray: f32| {
        let material = Material { base: glam::Vec4::new(gray, gray, gray, 1.0), unlit: true, ..matte() };
        one(square(), looks(material, Vec::new()))
    };
    // Light 1 is 255, light 0 is 0: 255 apart wherever the square is.
    let (white, black) = (unlit(1.0), unlit(0.0));
    let frame = Frame { center: DVec3::ZERO, radius: 1.5 };
    let shot = Shot { size: 64, faces: false };
    let reference = Reference::new(&Cpu, &white, frame, &[DVec3::Z, -DVec3::Z], shot).unwrap();
    let count = covered(&reference.pictures[0]);
    let difference = reference.compare(&Cpu, &black, false).unwrap();
    let expected = |pixels: f64| 255.0 * (count as f64 / pixels).sqrt();
    assert!((difference.views[0].rms - expected(4096.0)).abs() < 1e-9);
    assert!((difference.rms - expected(8192.0)).abs() < 1e-9);
    assert_eq!((difference.views[1].rms, difference.worst, difference.silhouette), (0.0, 0, 0.0));
    let nothing = reference.compare(&Cpu, &Drawable::default(), false).unwrap();
    assert_eq!(nothing.silhouette, 1.0);
    assert!((nothing.views[0].rms * 64.0 - 63.0 * (count as f64).sqrt()).abs() < 1e-9);
    let drawn = pictures(&Cpu, &black, &reference.cameras, shot).unwrap();
    assert_eq!(reference.compare_pictures(&drawn, false), difference);
}

#[test]
fn faces_are_numbered_through_parts_and_shared_by_instances() {
    let square = Arc::new(square());
    let mut drawable = Drawable::of_parts(vec![Arc::clone(&square), square], looks(matte(), Vec::new()));
    let at = |x: f64| DMat4::from_translation(DVec3::X * x) * DMat4::from_scale(DVec3::splat(0.3));
    drawable.instances = [(0, -1.0), (1, 0.0), (1, 1.0)].map(|(part, x)| Instance { part, transform: at(x) }).to_vec();
    let picture = view(&drawable, DVec3::Z);
    let row = &picture.faces[32 * 64 + 4..32 * 64 + 60];
    let seen: Vec<u32> = row.iter().copied().filter(|f| *f != NO_FACE).map(|f| f / 2).collect();
    let mut steps = seen.clone();
    steps.dedup();
    assert_eq!(steps, [0, 1]);
    assert!(seen.iter().filter(|f| **f == 1).count() > seen.iter().filter(|f| **f == 0).count());
}

#[test]
fn differences_go_to_the_faces_seen_there() {
    let looks = looks(matte(), Vec::new());
    let square = Arc::new(square());
    let whole = Drawable::of_parts(vec![Arc::clone(&square)], Arc::clone(&looks));
    let mut half = Part::clone(&square);
    half.indices.truncate(3);
    let half = Drawable::of_parts(vec![Arc::new(half)], looks);
    let frame = Frame { center: DVec3::ZERO, radius: 1.5 };
    let shot = Shot { size: 64, faces: true };
    let reference = Reference::new(&Cpu, &whole, frame, &[DVec3::Z], shot).unwrap();
    let blame = reference.blame(&Cpu, &half, 2).unwrap();
    // The second face is missing: all of the difference is its.
    let rms = reference.compare(&Cpu, &half, false).unwrap().rms;
    assert_eq!((blame.squares[0], blame.nowhere, blame.rms), (0.0, 0.0, rms));
    assert!((blame.squares[1] / 4096.0 - rms * rms).abs() < 1e-3 * rms * rms);
    assert_eq!(blame.pixels.iter().sum::<u32>() as usize, covered(&reference.pictures[0]));
    // The other way round, the candidate's pixels lie within reach of the reference's face or nowhere.
    let reference = Reference::new(&Cpu, &half, frame, &[DVec3::Z], shot).unwrap();
    let blame = reference.blame(&Cpu, &whole, 1).unwrap();
    let sum = (blame.squares[0] + blame.nowhere) / 4096.0;
    assert!(blame.squares[0] > 0.0 && blame.nowhere > blame.squares[0] && (sum - rms * rms).abs() < 1e-3 * sum);
}

#[test]
fn sizes_and_odd_input_are_answered() {
    let ball = one(sphere(4), looks(matte(), Vec::new()));
    let camera = Camera::new(ball.frame(), DVec3::Z);
    let draw = |size| Cpu.prepare(&ball).unwrap().draw(&camera, Shot { size, faces: false });
    assert_eq!(draw(0).unwrap_err(), RenderError::Size(0));
    assert_eq!(draw(5000).unwrap_err().to_string(), "pictures have 1 to 4096 pixels a side, not 5000");
    assert_eq!(draw(1).unwrap().pixels.len(), 1);
    // A camera inside, coordinates that are no numbers, transforms that flatten: no picture to be proud of, no panic.
    let inside = Camera::new(Frame { center: DVec3::ZERO, radius: 0.1 }, DVec3::Y);
    assert!(Cpu.prepare(&ball).unwrap().draw(&inside, Shot { size: 64, faces: true }).is_ok());
    let mut odd = sphere(4);
    odd.positions[7] = Vec3::NAN;
    odd.normals[9] = Vec3::ZERO;
    odd.normals[10] = Vec3::NAN;
    let mut odd = one(odd, looks(matte(), Vec::new()));
    for transform in [DMat4::IDENTITY, DMat4::ZERO, DMat4::NAN, DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))] {
        odd.instances[0].transform = transform;
        view(&odd, DVec3::ONE);
        assert!(odd.frame().radius > 0.0);
    }
}

#[test]
fn sheets_have_a_row_for_each_view_and_two_columns_for_each_level() {
    let (ball, coarse) = (one(sphere(9), looks(matte(), Vec::new())), one(sphere(4), looks(matte(), Vec::new())));
    let bytes = png(&draw(&Cpu, &ball, &[&ball, &coarse], ball.frame(), &fibonacci(3), 32).unwrap());
    let image = image::load_from_memory(&bytes).unwrap().into_rgb8();
    assert_eq!(image.dimensions(), (5 * 36 - 4, 3 * 36 - 4));
    let black = |column: u32| (0..32).all(|i| image.get_pixel(column * 36 + i, i).0 == [0; 3]);
    assert!(black(2) && !black(4));
}
