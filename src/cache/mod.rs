//! [`JobKey`] → bytes: results that were computed once, kept in a folder for every later run and every other pipeline.
//! The only room that touches that folder, but for the index.
//!
//! An entry names its key and hash itself, so a damaged one is a miss and a warning, never a wrong result. Entries appear
//! by renaming a finished file: several processes may use one cache, and a killed one leaves nothing behind that
//! anybody reads. Knows nothing of what the bytes mean. Nothing here fails a run: without a cache it is only slower.

mod entry;
mod local;
mod upkeep;
#[cfg(test)]
mod tests;

use std::fmt;
use std::io;
use std::path::Path;

use crate::key::JobKey;

pub use upkeep::{BucketStats, Removed, Stats, Upkeep, UpkeepError, Verified};

/// The kinds of results, a folder each. The version of the format is in the folder's name, so that another version of
/// lodbake never reads what it does not understand:
///
/// ```text
/// .lodbake/
/// ├─ CACHEDIR.TAG        backup programs leave the folder out
/// ├─ .gitignore          and so does git
/// ├─ lock                shared while in use, exclusive during upkeep
/// ├─ index-v1/           what was seen last time (see `index`)
/// ├─ sequences-v1/
/// │  └─ ab/              first two digits of the key
/// │     └─ cdef….bin     the other 62
/// ├─ chains-v2/
/// │  └─ ab/cdef….bin
/// └─ looks-v1/
///    └─ ab/cdef….bin
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Bucket {
    /// Contraction sequences of sub-meshes.
    Sequences,
    /// Levels of meshes.
    Chains,
    /// Figures of how levels look.
    Looks,
}

impl Bucket {
    /// Every bucket.
    pub const ALL: [Self; 3] = [Self::Sequences, Self::Chains, Self::Looks];

    /// Folder in the cache.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Sequences => "sequences-v1",
            Self::Chains => "chains-v2",
            Self::Looks => "looks-v1",
        }
    }
}

/// What a look-up found.
#[derive(Debug)]
pub enum Lookup {
    /// The bytes as they were put.
    Hit(Vec<u8>),
    /// Nothing.
    Miss,
    /// An entry that cannot be used; as good as a miss.
    Damaged(CacheWarning),
}

/// The cache is not what it should be; the run goes on.
#[derive(Debug, thiserror::Error)]
pub enum CacheWarning {
    /// An entry does not hold what was put.
    #[error("cache entry `{file}` is damaged: {cause}; it is computed again")]
    Damaged {
        /// File of the entry.
        file: String,
        /// What is wrong.
        cause: Damage,
    },
    /// Results cannot be stored: read-only, full, or no folder at all. Told once for each cache.
    #[error("failed to store results in the cache `{folder}`: {source}; they are computed again next time")]
    NotStored {
        /// Folder of the cache.
        folder: String,
        /// From the operating system.
        source: io::Error,
    },
}

/// How an entry is damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// Shorter or longer than it says, as after a power cut.
    Length,
    /// No entry of this format.
    Foreign,
    /// The entry of another key.
    OtherKey,
    /// The bytes do not have the hash that they had.
    Hash,
    /// The disk could not read it.
    Unreadable(io::ErrorKind),
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length => f.write_str("its length is wrong"),
            Self::Foreign => f.write_str("it is no cache entry"),
            Self::OtherKey => f.write_str("it belongs to another key"),
            Self::Hash => f.write_str("its hash is wrong"),
            Self::Unreadable(kind) => kind.fmt(f),
        }
    }
}

/// A cache in a folder. Shared by all threads.
#[derive(Debug)]
pub struct Cache {
    local: local::Local,
}

impl Cache {
    /// The cache in `folder`, which is made when the first result is put.
    pub fn open(folder: &Path) -> Self {
        Self { local: local::Local::open(folder) }
    }

    /// An empty cache that is removed when it is dropped: the same code path for those who want none.
    pub fn temporary() -> io::Result<Self> {
        Ok(Self { local: local::Local::temporary()? })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        self.local.folder()
    }

    /// Looks a result up.
    pub fn get(&self, bucket: Bucket, key: &JobKey) -> Lookup {
        self.local.get(bucket, key)
    }

    /// Stores a result. Two writers of one key are fine: they have the same bytes.
    pub fn put(&self, bucket: Bucket, key: &JobKey, bytes: &[u8]) -> Result<(), CacheWarning> {
        self.local.put(bucket, key, bytes)
    }
}
