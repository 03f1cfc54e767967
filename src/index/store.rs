//! The index as a file: one for each pipeline, in the cache folder. It may be deleted at any time; one that is damaged
//! or of another version counts as empty.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, OnceLock};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::{Entry, Index};
use crate::config::Pipeline;
use crate::key::{ContentHash, Field, JobKey};
use crate::scan::FileStat;

/// Folder of the index files in the cache folder; it carries the version of their format.
pub const FOLDER: &str = "index-v1";

/// First bytes of an index file.
const MAGIC: &[u8; 16] = b"lodbake index 1\n";
/// Magic, BLAKE3 of the rest of the header and of the records, length of the records, length of the facts. Records and
/// facts follow. Facts are read on demand only: a run in which nothing changed does not need them.
const HEADER: usize = MAGIC.len() + 32 + 8 + 8;

/// The index could not be used; everything is looked at again.
#[derive(Debug, thiserror::Error)]
#[error("failed to read the index `{file}`: {cause}; all scenes are read again")]
pub struct IndexWarning {
    /// Index file.
    pub file: String,
    /// What is wrong with it.
    pub cause: String,
}

/// The index could not be written; the next run looks at everything again.
#[derive(Debug, thiserror::Error)]
#[error("failed to write the index `{file}`: {source}; the next run reads all scenes again")]
pub struct IndexError {
    /// Index file.
    pub file: String,
    /// From the operating system.
    pub source: io::Error,
}

/// Where the facts of a scene are in the file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FactsAt {
    /// From the start of all facts.
    offset: u64,
    size: u64,
    content: ContentHash,
}

impl FactsAt {
    /// The place is given when the index is written.
    pub fn of(facts: &[u8]) -> Self {
        Self { offset: 0, size: facts.len() as u64, content: ContentHash(*blake3::hash(facts).as_bytes()) }
    }
}

/// The facts in an index file.
#[derive(Debug)]
pub(super) struct StoredFacts {
    /// Stays readable when the file is replaced.
    file: Mutex<File>,
    start: u64,
    size: u64,
    /// All of them, where many are asked for.
    loaded: OnceLock<Vec<u8>>,
}

impl StoredFacts {
    fn new(file: File, start: u64, size: u64) -> Self {
        Self { file: Mutex::new(file), start, size, loaded: OnceLock::new() }
    }

    /// Reads all of them at once: many single reads would wait for each other.
    pub fn load(&self) {
        let read = || {
            let mut all = vec![0; usize::try_from(self.size).ok()?];
            let mut file = self.file.lock().ok()?;
            file.seek(SeekFrom::Start(self.start)).ok()?;
            file.read_exact(&mut all).ok()?;
            Some(all)
        };
        if self.loaded.get().is_none()
            && let Some(all) = read()
        {
            self.loaded.get_or_init(|| all);
        }
    }

    /// `None` if they are not as they were written.
    pub fn read(&self, at: &FactsAt) -> Option<Vec<u8>> {
        at.offset.checked_add(at.size).filter(|&end| end <= self.size)?;
        if let Some(all) = self.loaded.get() {
            let facts = &all[usize::try_from(at.offset).ok()?..usize::try_from(at.offset + at.size).ok()?];
            return (blake3::hash(facts).as_bytes() == &at.content.0).then(|| facts.to_vec());
        }
        let mut facts = vec![0; usize::try_from(at.size).ok()?];
        let mut file = self.file.lock().ok()?;
        file.seek(SeekFrom::Start(self.start + at.offset)).ok()?;
        file.read_exact(&mut facts).ok()?;
        (blake3::hash(&facts).as_bytes() == &at.content.0).then_some(facts)
    }
}

impl Index {
    /// The index of `pipeline` in the folder `cache`; empty, with a warning, if it cannot be used.
    pub fn open(cache: &Path, pipeline: &Pipeline) -> (Self, Option<IndexWarning>) {
        let file = cache.join(FOLDER).join(file_name(cache, pipeline));
        let (records, stored_facts, cause) = match read(&file) {
            Ok(Some((records, facts))) => (records, Some(facts), None),
            Ok(None) => (Records::default(), None, None),
            Err(cause) => (Records::default(), None, Some(cause)),
        };
        let warning = cause.map(|cause| IndexWarning { file: file.display().to_string(), cause });
        let index = Self {
            file,
            output: pipeline.output.path.clone(),
            entries: records.entries.into_iter().collect(),
            settings: records.settings.into_iter().collect(),
            fresh_facts: BTreeMap::new(),
            stored_facts,
            superseded: Vec::new(),
            started_ns: OnceLock::new(),
            is_changed: false,
        };
        (index, warning)
    }

    /// Writes the index if anything in it has changed. It appears whole or not at all.
    pub fn save(&mut self) -> Result<(), IndexError> {
        if !self.is_changed {
            return Ok(());
        }
        let facts = self.place_facts();
        let Self { settings, entries, .. } = self;
        settings.retain(|key, _| entries.values().any(|entry| entry.settings == *key));
        let records = Borrowed { settings: self.settings.iter().collect(), entries: self.entries.iter().collect() };
        let records = postcard::to_stdvec(&records).expect("plain records can always be written to memory");
        let header = header(&records, facts.len() as u64);
        // Closed before it is replaced, for Windows. What it held is in `facts`, or its entry is gone.
        self.stored_facts = None;
        self.fresh_facts.clear();
        write_whole(&self.file, &[&header, &records, &facts])
            .and_then(|()| File::open(&self.file))
            .map(|file| {
                let (start, size) = ((HEADER + records.len()) as u64, facts.len() as u64);
                self.stored_facts = Some(StoredFacts::new(file, start, size));
                self.is_changed = false;
            })
            .map_err(|source| IndexError { file: self.file.display().to_string(), source })
    }

    /// All facts in the order of the entries. An entry whose facts are damaged is dropped: its scene is baked again.
    fn place_facts(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        let Self { entries, fresh_facts, stored_facts, .. } = self;
        entries.retain(|relative, entry| {
            let stored = || stored_facts.as_ref()?.read(&entry.facts);
            let Some(facts) = fresh_facts.remove(relative).or_else(stored) else { return false };
            entry.facts.offset = all.len() as u64;
            all.extend_from_slice(&facts);
            true
        });
        all
    }
}

/// A sorted list loads faster than a map and is the same in the file.
#[derive(Default, Deserialize)]
struct Records {
    settings: Vec<(JobKey, Vec<Field>)>,
    entries: Vec<(String, Entry)>,
}

#[derive(Serialize)]
struct Borrowed<'a> {
    settings: Vec<(&'a JobKey, &'a Vec<Field>)>,
    entries: Vec<(&'a String, &'a Entry)>,
}

pub(super) fn header(records: &[u8], facts_size: u64) -> Vec<u8> {
    let sizes = [(records.len() as u64).to_le_bytes(), facts_size.to_le_bytes()].concat();
    let hash = blake3::Hasher::new().update(&sizes).update_rayon(records).finalize();
    [MAGIC.as_slice(), hash.as_bytes(), &sizes].concat()
}

/// `None`: there is no index yet. The error says what is wrong with it.
fn read(path: &Path) -> Result<Option<(Records, StoredFacts)>, String> {
    let mut file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.to_string()),
    };
    let size = file.metadata().map_err(|error| error.to_string())?.len();
    let cut_off = |_| "it is cut off".to_owned();
    let mut start = [0; HEADER];
    file.read_exact(&mut start).map_err(cut_off)?;
    if !start.starts_with(MAGIC) {
        return Err("it is not an index of this version".to_owned());
    }
    let number = |at: usize| u64::from_le_bytes(start[at..at + 8].try_into().expect("eight bytes of the header"));
    let (records_size, facts_size) = (number(HEADER - 16), number(HEADER - 8));
    let expected = records_size.checked_add(facts_size).and_then(|sum| sum.checked_add(HEADER as u64));
    if expected != Some(size) {
        return Err("its length is wrong".to_owned());
    }
    let mut records = vec![0; usize::try_from(records_size).map_err(|error| error.to_string())?];
    file.read_exact(&mut records).map_err(cut_off)?;
    if header(&records, facts_size) != start {
        return Err("it is damaged".to_owned());
    }
    let records = postcard::from_bytes(&records).map_err(|error| error.to_string())?;
    let facts = StoredFacts::new(file, HEADER as u64 + records_size, facts_size);
    Ok(Some((records, facts)))
}

fn write_whole(file: &Path, parts: &[&[u8]]) -> io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tmp-");
    #[cfg(unix)]
    {
        // Temporary files are for their owner alone, but a project may be shared: as far as the user's umask allows.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut temporary = builder.tempfile_in(folder)?;
    parts.iter().try_for_each(|part| temporary.write_all(part))?;
    temporary.persist(file).map_err(|error| error.error)?;
    Ok(())
}

/// The time as the file system stamps it: that of a file made now beside the index. A read-only cache has no such file,
/// but then the index cannot be written either.
pub(super) fn file_system_time(file: &Path) -> i64 {
    let stamp = || {
        let folder = file.parent()?;
        fs::create_dir_all(folder).ok()?;
        let temporary = tempfile::Builder::new().prefix(".tmp-").tempfile_in(folder).ok()?;
        FileStat::of(temporary.path()).ok().map(|stat| stat.mtime_ns)
    };
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64);
    stamp().unwrap_or_else(clock)
}

/// One name for each output folder and pipeline file. As seen from the cache, so that a project that is moved or
/// restored elsewhere with its cache keeps its index.
fn file_name(cache: &Path, pipeline: &Pipeline) -> String {
    let mut hasher = blake3::Hasher::new();
    for path in [&pipeline.output.path, Path::new(&pipeline.file)] {
        let seen = seen_from(&plain(cache), &plain(path));
        hasher.update(&(seen.len() as u64).to_le_bytes()).update(seen.as_bytes());
    }
    format!("{}.bin", &hasher.finalize().to_hex()[..16])
}

/// Absolute, with links resolved as far as it exists.
fn plain(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut existing = absolute.as_path();
    loop {
        if let (Ok(resolved), Ok(rest)) = (existing.canonicalize(), absolute.strip_prefix(existing)) {
            return resolved.join(rest);
        }
        match existing.parent() {
            Some(parent) => existing = parent,
            None => return absolute,
        }
    }
}

fn seen_from(from: &Path, to: &Path) -> String {
    let (from, to): (Vec<Component<'_>>, Vec<Component<'_>>) = (from.components().collect(), to.components().collect());
    let shared = std::iter::zip(&from, &to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..".into(), from.len() - shared);
    let down = to[shared..].iter().map(|part| part.as_os_str().to_string_lossy());
    up.chain(down).collect::<Vec<_>>().join("/")
}
