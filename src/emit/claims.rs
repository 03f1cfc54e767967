//! Which scene writes which file, so that two never write the same one differently. Touches no files.

use super::EmittedFile;
use super::error::EmitError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What was done for a shared file, once it is done. Locked by whoever is doing it.
pub(super) type Done = Arc<Mutex<Option<EmittedFile>>>;

/// What becomes of a target.
#[derive(Clone, Debug)]
pub(super) enum Whose {
    /// It is written for this scene alone.
    Own,
    /// This file is copied there.
    Copy(PathBuf),
    /// It is written for all scenes, and its name tells its content.
    Library,
}

#[derive(Debug)]
struct Claim {
    /// The scene that came first.
    scene: PathBuf,
    whose: Whose,
    done: Done,
}

/// All targets of a run.
#[derive(Debug, Default)]
pub(super) struct Claims(Mutex<BTreeMap<PathBuf, Claim>>);

impl Claims {
    /// Claims `target` for `scene`. Two scenes may have the same target only if both copy the same file there, or if it is a file
    /// of the library.
    pub(super) fn claim(&self, target: &Path, scene: &Path, whose: Whose) -> Result<Done, EmitError> {
        let mut claims = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let Some(claim) = claims.get(target) else {
            let claim = Claim { scene: scene.to_owned(), whose, done: Done::default() };
            let done = claim.done.clone();
            claims.insert(target.to_owned(), claim);
            return Ok(done);
        };
        let same = match (&claim.whose, &whose) {
            (Whose::Copy(a), Whose::Copy(b)) => a == b || super::same_file(a, b),
            // A scene may be written again, when it changed while it was watched.
            (Whose::Own, Whose::Own) => claim.scene == scene,
            (Whose::Library, Whose::Library) => true,
            _ => false,
        };
        if same {
            return Ok(claim.done.clone());
        }
        // The same words whichever of the two came first.
        let (a, b) = (claim.scene.clone(), scene.to_owned());
        let (first, second) = if a <= b { (a, b) } else { (b, a) };
        Err(EmitError::Taken { target: target.to_owned(), first, second })
    }
}
