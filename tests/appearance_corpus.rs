//! Every scene of the corpus can be drawn, at every level it has, and looks exactly like itself.

mod corpus;

use corpus::{corpus, files};
use lodbake::appearance::assemble;
use lodbake::appearance::metric::Reference;
use lodbake::appearance::render::{Cpu, Shot};
use lodbake::appearance::views::fibonacci;
use lodbake::obj;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Pixels that something is seen in; `None` if the file cannot be read or has nothing to draw.
fn draw(file: &Path) -> Option<usize> {
    let scene = obj::read_any(file).ok()?;
    let looks = assemble::looks(&scene, file.parent().expect("a file is in a folder"));
    let drawable = assemble::scene(&scene, looks.clone(), 0).ok()?;
    if drawable.triangles() == 0 {
        return None;
    }
    let shot = Shot { size: 48, faces: true };
    let reference = Reference::new(&Cpu, &drawable, drawable.frame(), &fibonacci(3), shot).expect("drawn");
    let same = reference.compare(&Cpu, &drawable, true).expect("drawn");
    assert_eq!((same.rms, same.silhouette, same.ssim), (0.0, 0.0, Some(1.0)), "{}", file.display());
    for level in 1..3 {
        let level = assemble::scene(&scene, looks.clone(), level).expect("levels");
        reference.compare(&Cpu, &level, false).expect("drawn");
    }
    let faces = *drawable.first_faces().last()?;
    let seen = reference.pictures.iter().flat_map(|p| p.faces.iter().copied().filter(|f| *f != u32::MAX));
    Some(seen.inspect(|face| assert!(*face < faces)).count())
}

#[test]
fn every_scene_is_drawn_and_equals_itself() {
    let Some(corpus) = corpus() else { return };
    let all = files(&corpus, &["glb", "gltf", "obj"]);
    let drawn: Vec<(PathBuf, usize)> =
        all.into_par_iter().filter_map(|file| Some((file.clone(), draw(&file)?))).collect();
    assert!(drawn.len() > 90, "only {} scenes were drawn", drawn.len());
    let empty: Vec<_> = drawn.iter().filter(|(_, seen)| *seen == 0).map(|(file, _)| file.display()).collect();
    // Flat things may be seen edge-on or from behind; few are.
    assert!(empty.len() < 5, "nothing is seen of {empty:?}");
}
