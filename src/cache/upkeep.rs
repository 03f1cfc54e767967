//! Looking after a cache folder: how much is in it, taking out what was not used for long, checking every entry.
//!
//! Touches only what the cache makes: a folder that somebody named by mistake keeps its other files.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use super::local::{CACHEDIR_TAG, GITIGNORE, LOCK, TEMPORARY};
use super::{Bucket, Damage, entry};

/// Folders in the cache without their `-v1`: buckets of any version of lodbake, and the index.
const FOLDERS: [&str; 3] = ["sequences", "chains", "index"];
/// Not evicted: it is one small file for each pipeline, and losing it makes a run read every scene.
const INDEX: &str = "index";

/// Upkeep is not possible.
#[derive(Debug, thiserror::Error)]
pub enum UpkeepError {
    /// A bake, or another upkeep, is at work.
    #[error("the cache `{folder}` is in use by another lodbake")]
    InUse {
        /// Folder of the cache.
        folder: String,
    },
    /// Something could not be read or removed.
    #[error("failed to look after the cache `{path}`: {source}")]
    Io {
        /// File or folder.
        path: String,
        /// From the operating system.
        source: io::Error,
    },
}

/// How much is in a cache.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Stats {
    /// One for each folder, by name; those of other versions too.
    pub buckets: Vec<BucketStats>,
    /// Files that killed processes have left, or that others are writing now.
    pub unfinished: u64,
}

/// How much is in one folder of a cache.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct BucketStats {
    /// Folder, as `sequences-v1`.
    pub name: String,
    /// Files.
    pub entries: u64,
    /// Bytes of all files.
    pub bytes: u64,
}

/// What was taken out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Removed {
    /// Files.
    pub entries: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// What a check of all entries found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verified {
    /// Entries that are as they were put.
    pub entries: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Files that are not; they were removed.
    pub damaged: Vec<(PathBuf, Damage)>,
}

impl Stats {
    /// Counts the files of the cache in `folder`. Needs no lock.
    pub fn of(folder: &Path) -> Result<Self, UpkeepError> {
        let mut stats = Self::default();
        for name in folders(folder)? {
            let files = files_below(&folder.join(&name))?;
            let (unfinished, entries): (Vec<_>, Vec<_>) = files.into_iter().partition(CacheFile::is_unfinished);
            stats.unfinished += unfinished.len() as u64;
            let bytes = entries.iter().map(|file| file.size).sum();
            stats.buckets.push(BucketStats { name, entries: entries.len() as u64, bytes });
        }
        Ok(stats)
    }

    /// Bytes of all folders.
    pub fn bytes(&self) -> u64 {
        self.buckets.iter().map(|bucket| bucket.bytes).sum()
    }
}

/// A cache that nobody else uses meanwhile.
#[derive(Debug)]
pub struct Upkeep {
    folder: PathBuf,
    /// Dropped before the folder is removed: see [`Upkeep::clean`].
    lock: Option<File>,
}

impl Upkeep {
    /// Takes the cache in `folder` for itself. A folder that is not there is an empty cache.
    pub fn begin(folder: &Path) -> Result<Self, UpkeepError> {
        let path = folder.join(LOCK);
        let lock = match File::options().write(true).open(&path) {
            Ok(file) => match file.try_lock() {
                Ok(()) => Some(file),
                Err(TryLockError::WouldBlock) => {
                    return Err(UpkeepError::InUse { folder: folder.display().to_string() });
                }
                // File systems without locks do without.
                Err(TryLockError::Error(_)) => None,
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(failed(&path)(error)),
        };
        Ok(Self { folder: folder.to_path_buf(), lock })
    }

    /// Takes out everything, and the folder itself if nothing else is in it.
    pub fn clean(self) -> Result<Removed, UpkeepError> {
        let mut removed = Removed::default();
        for name in folders(&self.folder)? {
            let folder = self.folder.join(name);
            for file in files_below(&folder)? {
                removed.add(&file);
            }
            fs::remove_dir_all(&folder).map_err(failed(&folder))?;
        }
        drop(self.lock);
        for name in [CACHEDIR_TAG.0, GITIGNORE.0, LOCK] {
            let path = self.folder.join(name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(&path)(error)),
                _ => {}
            }
        }
        match fs::remove_dir(&self.folder) {
            Err(error) if !is_harmless(&error) => Err(failed(&self.folder)(error)),
            _ => Ok(removed),
        }
    }

    /// Takes out what was not used for `max_age` before `now`, then what was not used for longest until at most
    /// `max_bytes` are left. What killed processes have left goes too.
    pub fn collect(
        &self,
        max_bytes: Option<u64>,
        max_age: Option<Duration>,
        now: SystemTime,
    ) -> Result<Removed, UpkeepError> {
        let mut removed = Removed::default();
        let mut kept = Vec::new();
        for name in folders(&self.folder)? {
            for file in files_below(&self.folder.join(&name))? {
                if file.is_unfinished() {
                    removed.remove(&file)?;
                } else if !name.starts_with(INDEX) {
                    kept.push(file);
                }
            }
        }
        kept.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
        let mut left: u64 = kept.iter().map(|file| file.size).sum();
        for file in &kept {
            let age = now.duration_since(file.used).unwrap_or_default();
            if max_age.is_some_and(|max_age| age > max_age) || max_bytes.is_some_and(|max_bytes| left > max_bytes) {
                removed.remove(file)?;
                left -= file.size;
            }
        }
        Ok(removed)
    }

    /// Reads every entry of this version and removes the damaged ones.
    pub fn verify(&self) -> Result<Verified, UpkeepError> {
        let mut verified = Verified::default();
        for bucket in Bucket::ALL {
            for file in files_below(&self.folder.join(bucket.folder()))? {
                if file.is_unfinished() {
                    continue;
                }
                let read = match entry::key_of_path(&file.path) {
                    None => Err(Damage::Foreign),
                    Some(key) => File::open(&file.path)
                        .map_err(|error| Damage::Unreadable(error.kind()))
                        .and_then(|mut opened| entry::read(&mut opened, &key)),
                };
                match read {
                    Ok(_) => {
                        verified.entries += 1;
                        verified.bytes += file.size;
                    }
                    Err(damage) => {
                        fs::remove_file(&file.path).map_err(failed(&file.path))?;
                        verified.damaged.push((file.path, damage));
                    }
                }
            }
        }
        Ok(verified)
    }
}

impl Removed {
    fn add(&mut self, file: &CacheFile) {
        self.entries += 1;
        self.bytes += file.size;
    }

    fn remove(&mut self, file: &CacheFile) -> Result<(), UpkeepError> {
        fs::remove_file(&file.path).map_err(failed(&file.path))?;
        self.add(file);
        Ok(())
    }
}

#[derive(Debug)]
struct CacheFile {
    path: PathBuf,
    size: u64,
    /// Time of last use, to the day.
    used: SystemTime,
}

impl CacheFile {
    fn is_unfinished(&self) -> bool {
        self.path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(TEMPORARY))
    }
}

fn failed(path: &Path) -> impl Fn(io::Error) -> UpkeepError {
    let path = path.display().to_string();
    move |source| UpkeepError::Io { path: path.clone(), source }
}

fn is_harmless(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::DirectoryNotEmpty)
}

/// The cache's own folders that are there, by name.
fn folders(cache: &Path) -> Result<Vec<String>, UpkeepError> {
    let entries = match fs::read_dir(cache) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(failed(cache))?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(failed(cache))?;
        let Some(name) = entry.file_name().to_str().map(str::to_owned) else { continue };
        let is_own = name.rsplit_once("-v").is_some_and(|(kind, version)| {
            FOLDERS.contains(&kind) && !version.is_empty() && version.bytes().all(|byte| byte.is_ascii_digit())
        });
        if is_own && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// All files of one folder and its sub-folders, by path. Links are not followed.
fn files_below(folder: &Path) -> Result<Vec<CacheFile>, UpkeepError> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        let entries = match fs::read_dir(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            entries => entries.map_err(failed(&folder))?,
        };
        for entry in entries {
            let entry = entry.map_err(failed(&folder))?;
            let path = entry.path();
            // Gone meanwhile: another process has renamed or removed it.
            let Ok(metadata) = entry.metadata() else { continue };
            if metadata.is_dir() {
                open.push(path);
            } else {
                let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
                files.push(CacheFile { path, size: metadata.len(), used });
            }
        }
    }
    files.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(files)
}
