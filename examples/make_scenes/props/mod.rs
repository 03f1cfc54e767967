//! Single objects, each a scene of its own. Metres; each stands on y = 0.

pub mod barrel;
pub mod books;
pub mod boulder;
pub mod crates;
pub mod fern;
pub mod vase;

use crate::File;

/// The files of `scenes/props/`.
pub fn files() -> Vec<File> {
    let mut files = vec![
        File::new("props/vase.glb", vase::scene().glb()),
        File::new("props/boulder.glb", boulder::scene().glb()),
        File::new("props/fern.glb", fern::scene().glb()),
        File::new("props/books.glb", books::scene().glb()),
        File::new("props/apple crate.glb", crates::scene().glb()),
    ];
    files.extend(
        barrel::scene()
            .gltf("oak barrel")
            .into_iter()
            .map(|(name, bytes)| File::new(&format!("props/barrel/{name}"), bytes)),
    );
    files
}
