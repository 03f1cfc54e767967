//! Files of one scene on their way: written to temporary files, then renamed together. Dropped before that, nothing
//! has happened.

use super::EmittedFile;
use super::error::EmitError;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile};

/// Large enough to make system calls rare, small enough for the stack's neighbours in the cache.
const BLOCK: usize = 1 << 16;

/// Where the bytes of a file come from.
#[derive(Clone, Copy)]
pub(super) enum Origin<'a> {
    /// From memory.
    Bytes(&'a [u8]),
    /// From another file, which is never held in memory.
    File(&'a Path),
}

/// One file: `temporary` is `None` where the target has the right bytes already.
struct Staged {
    target: PathBuf,
    bytes: u64,
    temporary: Option<NamedTempFile>,
}

/// All files of one scene.
#[derive(Default)]
pub(super) struct Stage(Vec<Staged>);

impl Stage {
    /// Prepares `target`, behind the files that were added before.
    pub(super) fn add(&mut self, target: &Path, origin: Origin<'_>) -> Result<(), EmitError> {
        let bytes = match origin {
            Origin::Bytes(bytes) => bytes.len() as u64,
            Origin::File(path) => fs::metadata(path).map_err(EmitError::io("read", path))?.len(),
        };
        match fs::symlink_metadata(target) {
            Ok(there) if there.is_dir() => {
                return Err(EmitError::InTheWay { path: target.to_owned(), what: "a folder" });
            }
            // A link is replaced like any other file: writing through it would change what lies elsewhere.
            Ok(there) if there.is_file() && there.len() == bytes && is_equal(target, origin)? => {
                self.0.push(Staged { target: target.to_owned(), bytes, temporary: None });
                return Ok(());
            }
            _ => {}
        }
        let temporary = Some(write_temporary(target, origin)?);
        self.0.push(Staged { target: target.to_owned(), bytes, temporary });
        Ok(())
    }

    /// Renames all files, in the order in which they were added.
    pub(super) fn commit(self) -> Result<Vec<EmittedFile>, EmitError> {
        let mut folders = BTreeSet::new();
        let mut emitted = Vec::new();
        for Staged { target, bytes, temporary } in self.0 {
            let written = temporary.is_some();
            if let Some(temporary) = temporary {
                temporary.persist(&target).map_err(|e| EmitError::io("write", &target)(e.error))?;
                folders.extend(target.parent().map(Path::to_owned));
            }
            emitted.push(EmittedFile { path: target, bytes, written });
        }
        for folder in folders {
            sync_folder(&folder);
        }
        Ok(emitted)
    }
}

fn write_temporary(target: &Path, origin: Origin<'_>) -> Result<NamedTempFile, EmitError> {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(EmitError::io("create the folder", folder))?;
    let mut temporary = open_temporary(folder).map_err(EmitError::io("write", target))?;
    match origin {
        Origin::Bytes(bytes) => temporary.write_all(bytes).map_err(EmitError::io("write", target))?,
        Origin::File(path) => {
            let mut file = File::open(path).map_err(EmitError::io("read", path))?;
            io::copy(&mut file, temporary.as_file_mut()).map_err(EmitError::io("write", target))?;
        }
    }
    temporary.as_file().sync_all().map_err(EmitError::io("write", target))?;
    Ok(temporary)
}

/// Temporary files are private by default; an output is as public as the user's other files.
fn open_temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(".lodbake-").suffix(".tmp");
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666))
    };
    builder.tempfile_in(folder)
}

/// A rename survives a power cut only when the folder is on the disk too. Some file systems cannot do this; the files
/// are whole without it, so a refusal is no fault.
fn sync_folder(folder: &Path) {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

/// Has `target`, which is as long as the origin, the same bytes?
fn is_equal(target: &Path, origin: Origin<'_>) -> Result<bool, EmitError> {
    let Ok(mut there) = File::open(target) else {
        return Ok(false); // unreadable: it will be replaced, or that fails with its own words
    };
    let mut block = vec![0; BLOCK];
    match origin {
        Origin::Bytes(bytes) => {
            for expected in bytes.chunks(BLOCK) {
                let found = &mut block[..expected.len()];
                if there.read_exact(found).is_err() || found != expected {
                    return Ok(false);
                }
            }
            Ok(true)
        }
        Origin::File(path) => {
            let mut source = File::open(path).map_err(EmitError::io("read", path))?;
            let mut expected = vec![0; BLOCK];
            loop {
                let count = source.read(&mut expected).map_err(EmitError::io("read", path))?;
                if count == 0 {
                    return Ok(true);
                }
                if there.read_exact(&mut block[..count]).is_err() || block[..count] != expected[..count] {
                    return Ok(false);
                }
            }
        }
    }
}
