//! Pictures and models of written scenes for a page. A scene that cannot be shown says so there and stops nothing.

use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use rayon::prelude::*;
use serde_json::Value;

use crate::appearance::drawable::Drawable;
use crate::appearance::render::Cpu;
use crate::appearance::sheet;
use crate::appearance::views::rhombicuboctahedron;
use crate::command::Context;
use crate::evaluation::Subject;
use crate::gltf::document::{Container, Document};
use crate::gltf::uri;
use crate::publish::html::{Asset, Sheet};
use crate::report::SceneRecord;

/// Shows models: three.js with what it needs, in one file (`assets/viewer/`).
pub const VIEWER: &str = include_str!("../../../assets/viewer/viewer.min.js");

/// Pixels on each side of a picture.
const SIZE: u32 = 144;
/// The views of a contact sheet, of the 24: from the front above, and from behind below.
const VIEWS: [usize; 2] = [0, 20];
/// Most levels of a contact sheet: more would be too small to see.
const LEVELS: u64 = 4;
/// Most bytes of a model within a page.
const MODEL: u64 = 20_000_000;

/// Draws and packs scenes that were written to `folder`.
pub fn make(scenes: &[&SceneRecord], folder: &Path, with_models: bool, context: &Context) -> Vec<Asset> {
    let told = std::sync::atomic::AtomicUsize::new(0);
    let made = scenes.par_iter().map(|scene| {
        let asset = asset(scene, folder, with_models);
        let done = 1 + told.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        if context.verbose {
            context.tell(&format!("drawn {done} of {}: {}", scenes.len(), scene.path));
        }
        asset
    });
    made.collect()
}

/// The written scene file, if it is there.
pub fn main_file(scene: &SceneRecord, folder: &Path) -> Option<PathBuf> {
    let is_scene = |path: &str| {
        let path = Path::new(path);
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
    };
    let path = scene.outputs.iter().map(|output| &output.path).rfind(|path| is_scene(path))?;
    Some(folder.join(path)).filter(|path| path.is_file())
}

fn asset(scene: &SceneRecord, folder: &Path, with_model: bool) -> Asset {
    let mut asset = Asset { scene: scene.path.clone(), ..Asset::default() };
    let Some(path) = main_file(scene, folder) else {
        asset.note = Some("its output is not there: nothing to draw".to_owned());
        return asset;
    };
    let levels = scene.meshes.iter().map(|mesh| mesh.levels.len() as u64).max().unwrap_or(0).min(LEVELS);
    match draw(&path, levels) {
        Ok(sheet) => asset.sheet = Some(sheet),
        Err(error) => asset.note = Some(format!("it cannot be drawn: {error}")),
    }
    if with_model {
        match model(&path) {
            Ok(model) => asset.model = Some(model),
            Err(error) => asset.note = Some(format!("no live view: {error}")),
        }
    }
    asset
}

fn draw(path: &Path, levels: u64) -> anyhow::Result<Sheet> {
    let name = path.to_string_lossy();
    let load = |level: u64| Subject::load(&format!("{name}@{level}"));
    let source = load(0)?;
    let subjects = (1..=levels).map(load).collect::<Result<Vec<_>, _>>()?;
    let drawables: Vec<&Drawable> = subjects.iter().map(|subject| &subject.drawable).collect();
    let all = rhombicuboctahedron();
    let views = VIEWS.map(|view| all[view]);
    let picture = sheet::draw(&Cpu, &source.drawable, &drawables, source.drawable.frame(), &views, SIZE)?;
    let size = [picture.width(), picture.height()];
    Ok(Sheet { jpeg: sheet::jpeg(&picture), size, levels: drawables.len() })
}

/// The scene as one file: what it refers to is put into it.
fn model(path: &Path) -> anyhow::Result<Vec<u8>> {
    let bytes = std::fs::read(path)?;
    let base = path.parent().unwrap_or(Path::new(""));
    let mut document = Document::parse(&bytes)?;
    let mut size = bytes.len() as u64;
    let mut is_changed = false;
    for array in ["buffers", "images"] {
        for entry in document.array_mut(array)? {
            let Some(address) = entry.get("uri").and_then(Value::as_str) else { continue };
            if uri::form(address) != uri::Form::Relative {
                continue;
            }
            let file = uri::resolve(address, base, array)?;
            let content = std::fs::read(&file)?;
            size += content.len() as u64;
            entry["uri"] = format!("data:{};base64,{}", media_type(&file), STANDARD.encode(&content)).into();
            is_changed = true;
        }
    }
    if MODEL < size {
        anyhow::bail!("with {} it is too large", crate::progress::quantity::bytes(size));
    }
    if !is_changed {
        return Ok(bytes);
    }
    Ok(if document.container == Container::Glb { document.to_glb_bytes()? } else { document.to_gltf_bytes() })
}

fn media_type(path: &Path) -> &'static str {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "webp" => "image/webp",
        "ktx2" => "image/ktx2",
        _ => "application/octet-stream",
    }
}
