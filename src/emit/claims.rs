//! Which scene writes which file, so that two never write the same one differently. Touches no files.

use super::EmittedFile;
use super::error::EmitError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What was done for a shared file, once it is done. Locked by whoever is doing it.
pub(super) type Done = Arc<Mutex<Option<EmittedFile>>>;

#[derive(Debug)]
struct Claim {
    /// The scene that came first.
    scene: PathBuf,
    /// What is copied there; `None`: written for this scene alone.
    origin: Option<PathBuf>,
    done: Done,
}

/// All targets of a run.
#[derive(Debug, Default)]
pub(super) struct Claims(Mutex<BTreeMap<PathBuf, Claim>>);

impl Claims {
    /// Claims `target` for `scene`. Two scenes may have the same target only if both copy the same file there.
    pub(super) fn claim(&self, target: &Path, scene: &Path, origin: Option<&Path>) -> Result<Done, EmitError> {
        let mut claims = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let Some(claim) = claims.get(target) else {
            let claim = Claim { scene: scene.to_owned(), origin: origin.map(Path::to_owned), done: Done::default() };
            let done = claim.done.clone();
            claims.insert(target.to_owned(), claim);
            return Ok(done);
        };
        let same = match (&claim.origin, origin) {
            (Some(a), Some(b)) => a == b || super::same_file(a, b),
            // A scene may be written again, when it changed while it was watched.
            (None, None) => claim.scene == scene,
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
