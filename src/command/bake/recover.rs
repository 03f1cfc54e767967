//! Instances: finds those that nobody declared in a scene that was read, and makes it the scene that declares them, in the form that
//! is asked for.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use super::parts::take_apart;
use crate::config::{InstanceSettings, Instancing, Recover};
use crate::gltf::dependencies::dependencies;
use crate::gltf::document::DocumentError;
use crate::gltf::fold::{Folded, Sphere, fold};
use crate::gltf::read::from_document;
use crate::gltf::scene::{Scene, SourceMesh};
use crate::gltf::share::{Copy, Note, Sharing, share};
use crate::identify::alike::{Kind, Match, find};
use crate::identify::{SubMesh, sub_meshes};
use crate::mesh::layout::frame;
use crate::report::PartsRecord;

/// A mesh that is another one, moved.
#[derive(Clone, Debug)]
pub struct Instance {
    /// How it was found.
    pub found: Match,
    /// Why its own bytes are written all the same.
    pub kept: Option<&'static str>,
}

/// A scene with the instances that were found in it.
pub struct Recovered {
    /// The source's document if nothing was changed.
    pub scene: Scene,
    /// Of `scene`, by mesh.
    pub sub_meshes: Vec<Vec<SubMesh>>,
    /// By mesh.
    pub instances: BTreeMap<usize, Instance>,
    /// Parts that were taken out of meshes, where that is asked for.
    pub parts: Option<PartsRecord>,
    /// Nodes that became batches, where that is asked for.
    pub folded: Option<Folded>,
    /// Something was changed.
    pub is_changed: bool,
    /// What a user should know.
    pub notes: Vec<Note>,
}

/// Finds instances and declares those that the settings ask for. `base` is the scene's folder.
pub fn recover(scene: Scene, settings: &InstanceSettings, base: &Path) -> Result<Recovered, DocumentError> {
    let mut out = declare(scene, settings, base, usize::MAX)?;
    if settings.split {
        out = take_apart(out, settings, base)?;
    }
    if settings.instancing == Instancing::Gpu {
        let spheres: Vec<Option<Sphere>> = out.scene.meshes.iter().map(sphere).collect();
        let folded = fold(&mut out.scene.document, &mut out.scene.buffers, &spheres, settings)?;
        if 0 < folded.batches {
            out.is_changed = true;
            // A buffer that grew is no file any more.
            out.scene.dependencies = dependencies(&out.scene.document, base);
        }
        out.folded = Some(folded);
    }
    Ok(out)
}

fn sphere(mesh: &SourceMesh) -> Option<Sphere> {
    let (middle, radius) = frame(mesh.triangle_primitives().map(|(_, primitive)| primitive));
    (0 < mesh.triangles()).then(|| (middle.into(), radius))
}

/// Declares instances among the first `count` meshes.
pub(super) fn declare(
    scene: Scene,
    settings: &InstanceSettings,
    base: &Path,
    count: usize,
) -> Result<Recovered, DocumentError> {
    let subs: Vec<Vec<SubMesh>> = scene.meshes.par_iter().map(sub_meshes).collect();
    let instances = BTreeMap::new();
    let (parts, folded, notes) = (None, None, Vec::new());
    let mut out = Recovered { scene, sub_meshes: subs, instances, parts, folded, is_changed: false, notes };
    if settings.recover == Recover::None {
        return Ok(out);
    }
    if let Some(name) = Sharing::unknown_extension(&out.scene.document) {
        let text = format!("`{name}` might refer to geometry, so no instances are looked for");
        out.notes.push(Note { place: "extensionsUsed".to_owned(), text, count: 1 });
        return Ok(out);
    }
    let sharing = Sharing::new(&out.scene.document)?;
    let is_eligible = |mesh| mesh < count && sharing.is_eligible(mesh);
    let found = find(&out.scene.meshes, &out.sub_meshes, settings.tolerance, &is_eligible);
    let mut copies = Vec::new();
    for found in found {
        let copy = Copy { mesh: found.mesh, of: found.of, by: found.by };
        let kept = refused(found.kind, settings.recover).or_else(|| sharing.obstacle(&copy));
        if kept.is_none() {
            copies.push(copy);
        }
        out.instances.insert(found.mesh, Instance { found, kept });
    }
    let Scene { mut document, buffers, meshes, dependencies, warnings } = out.scene;
    let shared = share(&mut document, &buffers, &copies)?;
    if !shared.is_changed {
        return Ok(Recovered { scene: Scene { document, buffers, meshes, dependencies, warnings }, ..out });
    }
    // What was odd in the source is told once, as it stood there.
    let scene = Scene { warnings, ..from_document(document, shared.buffers, base)? };
    let sub_meshes = scene.meshes.par_iter().map(sub_meshes).collect();
    Ok(Recovered { scene, sub_meshes, is_changed: true, notes: shared.notes, ..out })
}

fn refused(kind: Kind, recover: Recover) -> Option<&'static str> {
    let least = match kind {
        Kind::Exact | Kind::Reordered => Recover::Exact,
        Kind::Rigid => Recover::Rigid,
        Kind::Similar => Recover::Similar,
        Kind::Mirrored => Recover::Mirrored,
    };
    let words = match kind {
        Kind::Mirrored => "`recover` does not ask for mirrored ones",
        _ => "`recover` does not ask for it",
    };
    (recover < least).then_some(words)
}
