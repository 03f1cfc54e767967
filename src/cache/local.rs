//! The cache in a folder of this machine.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

use super::{Bucket, CacheWarning, Lookup, entry};
use crate::key::JobKey;

/// In use while its lock is held shared, in upkeep while it is held exclusively.
pub(super) const LOCK: &str = "lock";

/// Prefix of files that are being written.
pub(super) const TEMPORARY: &str = ".tmp-";

/// How old the time of last use may be before a hit renews it: a write a day, not one for each hit.
const USE_STAMP: Duration = Duration::from_secs(24 * 60 * 60);

/// <https://bford.info/cachedir/>
pub(super) const CACHEDIR_TAG: (&str, &str) = (
    "CACHEDIR.TAG",
    "Signature: 8a477f597d28d172789f06886806bc55\n\
     # Results that lodbake has computed. This folder may be deleted at any time.\n",
);
pub(super) const GITIGNORE: (&str, &str) = (".gitignore", "*\n");

#[derive(Debug)]
pub(super) struct Local {
    folder: PathBuf,
    /// Made on the first put; an error of making it is kept, and told once.
    lock: OnceLock<Option<File>>,
    told: AtomicBool,
    /// Dropped last: on Windows a folder with an open lock cannot be removed.
    temporary: Option<tempfile::TempDir>,
}

impl Local {
    pub fn open(folder: &Path) -> Self {
        let local =
            Self { folder: folder.to_path_buf(), lock: OnceLock::new(), told: AtomicBool::new(false), temporary: None };
        // A folder that is there is locked at once: upkeep must not take out what this run has looked up.
        if let Ok(file) = File::open(folder.join(LOCK)) {
            local.lock.get_or_init(|| shared(file));
        }
        local
    }

    pub fn temporary() -> io::Result<Self> {
        let temporary = tempfile::Builder::new().prefix("lodbake-").tempdir()?;
        let mut local = Self::open(temporary.path());
        local.temporary = Some(temporary);
        Ok(local)
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn get(&self, bucket: Bucket, key: &JobKey) -> Lookup {
        let path = self.folder.join(entry::relative_path(bucket, key));
        let damaged = |cause| Lookup::Damaged(CacheWarning::Damaged { file: path.display().to_string(), cause });
        let mut file = match File::open(&path) {
            Ok(file) => file,
            // The folder of the cache may be a file, or not be there: nothing is stored in it either way.
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                return Lookup::Miss;
            }
            Err(error) => return damaged(super::Damage::Unreadable(error.kind())),
        };
        match entry::read(&mut file, key) {
            Ok(bytes) => {
                stamp_use(&file);
                Lookup::Hit(bytes)
            }
            Err(cause) => damaged(cause),
        }
    }

    pub fn put(&self, bucket: Bucket, key: &JobKey, bytes: &[u8]) -> Result<(), CacheWarning> {
        match self.store(bucket, key, bytes) {
            Err(source) if !self.told.swap(true, Ordering::Relaxed) => {
                Err(CacheWarning::NotStored { folder: self.folder.display().to_string(), source })
            }
            _ => Ok(()),
        }
    }

    fn store(&self, bucket: Bucket, key: &JobKey, bytes: &[u8]) -> io::Result<()> {
        self.prepare()?;
        let path = self.folder.join(entry::relative_path(bucket, key));
        let folder = path.parent().unwrap_or(&self.folder);
        fs::create_dir_all(folder)?;
        // Removed when it is dropped, so a full disk leaves nothing behind.
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY);
        #[cfg(unix)]
        {
            // Temporary files are for their owner alone, but a cache may be shared: as far as the user's umask allows.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let mut temporary = builder.tempfile_in(folder)?;
        entry::write(&mut temporary, key, bytes)?;
        temporary.persist(&path).map_err(|error| error.error)?;
        Ok(())
    }

    /// The folder with its marks and its lock.
    fn prepare(&self) -> io::Result<()> {
        if self.lock.get().is_some() {
            return Ok(());
        }
        fs::create_dir_all(&self.folder)?;
        for (name, text) in [CACHEDIR_TAG, GITIGNORE] {
            let path = self.folder.join(name);
            if !path.exists() {
                fs::write(path, text)?;
            }
        }
        let file = File::options().create(true).truncate(false).write(true).open(self.folder.join(LOCK))?;
        self.lock.get_or_init(|| shared(file));
        Ok(())
    }
}

/// Waits while upkeep is at work. File systems without locks do without.
fn shared(file: File) -> Option<File> {
    file.lock_shared().is_ok().then_some(file)
}

/// The time of last change stands for that of last use. Fails on a read-only cache, which nobody cleans up either.
fn stamp_use(file: &File) {
    let now = SystemTime::now();
    let old = file.metadata().and_then(|metadata| metadata.modified());
    if old.is_ok_and(|old| now.duration_since(old).is_ok_and(|age| age > USE_STAMP)) {
        let stamped = file.set_modified(now);
        drop(stamped);
    }
}
