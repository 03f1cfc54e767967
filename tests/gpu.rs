//! The renderer of graphics cards against the reference: the same pictures, the same figures within one in a hundred,
//! the same bits each time. Needs an adapter; Mesa's program that acts as one will do, and CI installs it.

#![cfg(feature = "render")]

mod corpus;

use std::path::Path;
use std::sync::Arc;

use corpus::corpus;
use glam::{DMat4, DQuat, DVec3, DVec4, Vec2, Vec3, Vec4};
use lodbake::appearance::assemble;
use lodbake::appearance::drawable::{Drawable, Instance, Part};
use lodbake::appearance::gpu::{Adapters, Gpu};
use lodbake::appearance::looks::Looks;
use lodbake::appearance::material::{Alpha, Material, TextureUse, Transform};
use lodbake::appearance::metric::Reference;
use lodbake::appearance::render::{Cpu, Picture, Render, RenderError, Shot, pictures};
use lodbake::appearance::texture::{Encoding, Texture, Wrap};
use lodbake::appearance::views::{Camera, fibonacci, rhombicuboctahedron};
use lodbake::obj;

#[expect(clippy::print_stdout, reason = "a test that skips must say so")]
fn gpu() -> Option<Gpu> {
    match Gpu::open(Adapters::Any) {
        Ok(gpu) => Some(gpu),
        Err(RenderError::NoAdapter) if std::env::var_os("CI").is_none() => {
            println!("SKIPPED: there is no adapter; Mesa's Vulkan driver is one");
            None
        }
        Err(error) => panic!("no adapter: {error}"),
    }
}

/// A texture that has no symmetry; `odd` makes its sides no powers of two.
fn texture(encoding: Encoding, odd: u32) -> Texture {
    let (width, height) = (32 - odd, 16 + odd);
    let texel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let smooth = [(x * 8) as u8, (y * 14) as u8, ((x * y) % 256) as u8, ((x * 23 + y * 7) % 256) as u8];
        match encoding {
            Encoding::Color => smooth,
            Encoding::Data => [96 + smooth[0] / 4, 96 + smooth[1] / 4, 200 + smooth[2] / 8, 255],
        }
    };
    Texture::new(width, height, (0..width * height).map(texel).collect(), encoding).expect("has texels")
}

/// A ball of bands with normals, tangents, colours and two sets of texture coordinates, far from the origin.
fn ball(bands: u32) -> Part {
    let mut part = Part { uvs: vec![Vec::new(), Vec::new()], ..Part::default() };
    let (mut tangents, mut colors) = (Vec::new(), Vec::new());
    for i in 0..=bands {
        for j in 0..=2 * bands {
            let (a, b) = (f64::from(i) / f64::from(bands), f64::from(j) / f64::from(2 * bands));
            let (lat, lon) = (a * std::f64::consts::PI, b * std::f64::consts::TAU);
            let n = DVec3::new(libm::sin(lat) * libm::cos(lon), libm::cos(lat), -libm::sin(lat) * libm::sin(lon));
            part.positions.push((n + DVec3::X * 20.0).as_vec3());
            part.normals.push(n.as_vec3());
            tangents.push(Vec4::new(-libm::sin(lon) as f32, 0.0, -libm::cos(lon) as f32, 1.0));
            colors.push(Vec4::new(1.0, a as f32, b as f32, 0.2 + 0.8 * b as f32));
            part.uvs[0].push(Vec2::new(b as f32 * 3.0 - 1.0, a as f32 * 2.0 - 0.5));
            part.uvs[1].push(Vec2::new(a as f32, b as f32));
        }
    }
    let row = 2 * bands + 1;
    for (i, j) in (0..bands).flat_map(|i| (0..2 * bands).map(move |j| (i, j))) {
        let [a, b, c, d] = [i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1];
        part.indices.extend([a, b, c, a, c, d]);
    }
    part.tangents = Some(tangents);
    part.colors = Some(colors);
    part
}

/// Balls of every kind of material, turned, mirrored, stretched and repeated.
fn everything(bands: u32) -> Drawable {
    let laid = |texture: usize, set: usize, wrap: [Wrap; 2]| Some(TextureUse { texture, set, wrap, transform: None });
    let turned = Transform { u: Vec2::new(0.8, -0.6), v: Vec2::new(1.2, 1.6), offset: Vec2::new(0.3, -7.0) };
    let plain = Material { metallic: 0.0, roughness: 0.4, ..Material::default() };
    let bumpy = Material {
        base_texture: laid(0, 0, [Wrap::Repeat, Wrap::Mirror]),
        metallic_roughness_texture: laid(2, 1, [Wrap::Clamp; 2]),
        normal_texture: laid(1, 0, [Wrap::Mirror, Wrap::Repeat]),
        normal_scale: 0.7,
        ..Material::default()
    };
    let holes = Material {
        base_texture: Some(TextureUse { texture: 3, set: 1, wrap: [Wrap::Mirror; 2], transform: Some(turned) }),
        alpha: Alpha::Mask(0.5),
        double_sided: true,
        emissive: Vec3::new(0.0, 0.1, 0.3),
        emissive_texture: laid(3, 0, [Wrap::Clamp, Wrap::Repeat]),
        ..plain.clone()
    };
    let glass = Material { alpha: Alpha::Blend, ..plain.clone() };
    let flat = Material { unlit: true, base: Vec4::new(0.2, 0.5, 0.9, 1.0), ..plain.clone() };
    let materials = vec![plain, bumpy, holes, glass, flat];
    let textures = vec![
        texture(Encoding::Color, 0),
        texture(Encoding::Data, 0),
        texture(Encoding::Data, 5),
        texture(Encoding::Color, 3),
    ];
    let parts: Vec<Arc<Part>> = (0..materials.len())
        .map(|material| {
            let mut part = Part { material, ..ball(bands) };
            if material % 2 == 0 {
                part.tangents = None;
            }
            if material == 0 || material == 4 {
                part.colors = None;
            }
            Arc::new(part)
        })
        .collect();
    let place = |i: usize| {
        let angle = DQuat::from_vec4(DVec4::new(0.1 * i as f64, 0.3, -0.2, 1.0).normalize_or_zero());
        let scale = DVec3::new(1.0, 1.0 + 0.3 * (i % 3) as f64, if i % 4 == 1 { -1.0 } else { 1.0 });
        let at = DVec3::new((i % 4) as f64 * 2.0, (i / 4) as f64 * 2.3, (i % 3) as f64);
        DMat4::from_scale_rotation_translation(scale, angle, at) * DMat4::from_translation(DVec3::X * -20.0)
    };
    // Each part twice in a row, so that neighbours are drawn at once.
    let instances = (0..2 * parts.len()).map(|i| Instance { part: i / 2, transform: place(i) }).collect();
    Drawable { parts, instances, looks: Arc::new(Looks { materials, textures, notes: Vec::new() }) }
}

/// Share of pixels that differ by more than `step` in a channel, and of those that show another face.
fn off(a: &[Picture], b: &[Picture], step: u8) -> [f64; 2] {
    let mut out = [0.0; 2];
    let mut pixels = 0.0;
    for (a, b) in a.iter().zip(b) {
        assert_eq!((a.size, a.pixels.len(), a.faces.len()), (b.size, b.pixels.len(), b.faces.len()));
        pixels += a.pixels.len() as f64;
        let far = |(p, q): &(&[u8; 4], &[u8; 4])| (0..4).any(|i| p[i].abs_diff(q[i]) > step);
        out[0] += a.pixels.iter().zip(&b.pixels).filter(far).count() as f64;
        out[1] += a.faces.iter().zip(&b.faces).filter(|(p, q)| p != q).count() as f64;
    }
    out.map(|count| count / pixels)
}

#[test]
fn pictures_are_those_of_the_reference() {
    let Some(gpu) = gpu() else { return };
    let drawable = everything(12);
    let cameras = Camera::all(drawable.frame(), &fibonacci(5));
    let shot = Shot { size: 160, faces: true };
    let own = pictures(&gpu, &drawable, &cameras, shot).expect("drawn");
    let reference = pictures(&Cpu, &drawable, &cameras, shot).expect("drawn");
    assert!(reference[0].faces.iter().filter(|face| **face != u32::MAX).count() > 2000);
    let [colors, faces] = off(&own, &reference, 2);
    assert!(colors < 0.002 && faces < 0.002, "{colors} of the colours and {faces} of the faces differ");
}

#[test]
fn pictures_are_the_same_each_time() {
    let Some(gpu) = gpu() else { return };
    let drawable = everything(6);
    let cameras = Camera::all(drawable.frame(), &fibonacci(4));
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| pictures(&gpu, &drawable, &cameras, Shot { size: 96, faces: true }).expect("drawn"))
    };
    assert_eq!(draw(1), draw(2));
    let reference = Reference::new(&gpu, &drawable, drawable.frame(), &fibonacci(2), Shot { size: 64, faces: false });
    assert_eq!(reference.expect("drawn").compare(&gpu, &drawable, false).expect("drawn").rms, 0.0);
}

#[test]
fn nothing_is_drawn_of_nothing() {
    let Some(gpu) = gpu() else { return };
    let empty = Drawable::default();
    let camera = Camera::new(empty.frame(), DVec3::Z);
    let prepared = gpu.prepare(&empty).expect("ready");
    let picture = prepared.draw(&camera, Shot { size: 9, faces: true }).expect("drawn");
    assert!(picture.pixels.iter().all(|pixel| pixel[3] == 0) && picture.faces.iter().all(|face| *face == u32::MAX));
    assert_eq!(prepared.draw(&camera, Shot { size: 0, faces: false }), Err(RenderError::Size(0)));
}

/// d_RMS between a scene and the same with its vertices on a coarse grid: an error of many pixels' size.
fn figure(renderer: &dyn Render, file: &Path) -> f64 {
    let scene = obj::read_any(file).expect("a scene");
    let looks = assemble::looks(&scene, file.parent().expect("a file is in a folder"));
    let source = assemble::scene(&scene, looks, 0).expect("level 0");
    let mut coarse = source.clone();
    for part in &mut coarse.parts {
        let step = part.positions.iter().fold(0.0f32, |most, p| most.max(p.abs().max_element())) / 60.0;
        let positions = part.positions.iter().map(|p| (*p / step).round() * step).collect();
        *part = Arc::new(Part { positions, ..Part::clone(part) });
    }
    let shot = Shot { size: 128, faces: false };
    let reference = Reference::new(renderer, &source, source.frame(), &rhombicuboctahedron(), shot).expect("drawn");
    reference.compare(renderer, &coarse, false).expect("drawn").rms
}

#[test]
fn figures_are_within_one_in_a_hundred_of_the_reference() {
    let (Some(gpu), Some(corpus)) = (gpu(), corpus()) else { return };
    let mut seen = 0;
    for folder in ["damaged-helmet", "les-paul", "suzanne", "water-bottle"] {
        for file in corpus::scenes(&corpus.join("quality").join(folder)) {
            let (own, reference) = (figure(&gpu, &file), figure(&Cpu, &file));
            assert!(reference > 1.0, "{}: {reference}", file.display());
            assert!((own / reference - 1.0).abs() < 0.01, "{}: {own} against {reference}", file.display());
            seen += 1;
        }
    }
    assert!(seen >= 4);
}
