//! One entry as a file: a header that says what it must be, then the bytes. Nothing is believed that is not checked.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{Bucket, Damage};
use crate::key::JobKey;

/// Magic with version, key, length of the bytes, BLAKE3 of the bytes.
const MAGIC: &[u8; 16] = b"lodbake entry 1\n";
const HEADER: usize = MAGIC.len() + 32 + 8 + 32;

/// From this size on hashing is shared among cores.
const PARALLEL_BYTES: usize = 1 << 20;

/// Extension of entries; files without it are never read.
const EXTENSION: &str = "bin";

/// Path below the cache folder.
pub(super) fn relative_path(bucket: Bucket, key: &JobKey) -> PathBuf {
    let name = key.to_string();
    let (first, rest) = name.split_at(2);
    Path::new(bucket.folder()).join(first).join(format!("{rest}.{EXTENSION}"))
}

/// The key that an entry's path stands for; `None` if it is no entry's path.
pub(super) fn key_of_path(path: &Path) -> Option<JobKey> {
    let first = path.parent()?.file_name()?.to_str()?;
    let rest = path.file_name()?.to_str()?.strip_suffix(EXTENSION)?.strip_suffix('.')?;
    if first.len() != 2 {
        return None;
    }
    format!("{first}{rest}").parse().ok()
}

fn hash(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    if bytes.len() >= PARALLEL_BYTES {
        hasher.update_rayon(bytes)
    } else {
        hasher.update(bytes)
    };
    *hasher.finalize().as_bytes()
}

/// Writes header and bytes.
pub(super) fn write(mut to: impl Write, key: &JobKey, bytes: &[u8]) -> io::Result<()> {
    let header = [MAGIC.as_slice(), &key.0, &(bytes.len() as u64).to_le_bytes(), &hash(bytes)].concat();
    to.write_all(&header)?;
    to.write_all(bytes)
}

/// Reads and checks an entry.
pub(super) fn read(file: &mut File, key: &JobKey) -> Result<Vec<u8>, Damage> {
    let unreadable = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => Damage::Length,
        kind => Damage::Unreadable(kind),
    };
    let size = file.metadata().map_err(unreadable)?.len();
    let mut header = [0; HEADER];
    file.read_exact(&mut header).map_err(unreadable)?;
    let (magic, rest) = header.split_at(MAGIC.len());
    let (own_key, rest) = rest.split_at(32);
    let (length, own_hash) = rest.split_at(8);
    if magic != MAGIC {
        return Err(Damage::Foreign);
    }
    if own_key != key.0 {
        return Err(Damage::OtherKey);
    }
    let length = u64::from_le_bytes(length.try_into().expect("eight bytes of the header"));
    // Checked before memory is taken for it: a damaged length may be any number.
    if length.checked_add(HEADER as u64) != Some(size) {
        return Err(Damage::Length);
    }
    let mut bytes = vec![0; usize::try_from(length).map_err(|_| Damage::Length)?];
    file.read_exact(&mut bytes).map_err(unreadable)?;
    if hash(&bytes) == own_hash { Ok(bytes) } else { Err(Damage::Hash) }
}
