//! What was seen last time, per scene: enough to tell, by file facts alone, that nothing needs to be done.
//!
//! Trusted as git trusts its index: a file with the same facts has the same content, unless it is so young that it could
//! have been changed after it was read without its time stamp telling. Such files, and files that were only touched, are
//! hashed once more and then trusted again. Knows nothing of what is inside a scene: facts are opaque bytes to it.

mod reason;
mod store;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::config::SceneSettings;
use crate::key::{ContentHash, Field, JobKey, diff, fields_of, key_of};
use crate::mesh::hash::MeshHash;
use crate::scan::{FileStat, SceneFile};

pub use reason::Reason;
pub use store::{FOLDER, IndexError, IndexWarning};

/// Settings of an entry whose scene could not be baked since: no settings have this key.
const FAILED: JobKey = JobKey([0; 32]);

/// A file as it was when its content was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seen {
    /// Taken before the content was read.
    pub stat: FileStat,
    /// Of the whole content.
    pub content: ContentHash,
}

impl Seen {
    /// Reads the file at `path`.
    pub fn read(path: &Path) -> io::Result<Self> {
        let stat = FileStat::of(path)?;
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(File::open(path)?)?;
        Ok(Self { stat, content: ContentHash(*hasher.finalize().as_bytes()) })
    }

    /// For a content that is in memory; `stat` was taken before it was read.
    pub fn of(stat: FileStat, content: &[u8]) -> Self {
        Self { stat, content: ContentHash(*blake3::hash(content).as_bytes()) }
    }
}

/// A file that a scene refers to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dependency {
    /// Path from the scene's folder, with `/` as separator, decoded.
    pub relative: String,
    /// `None`: it was not there.
    pub seen: Option<Seen>,
}

/// A file that was written for a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Path below the output folder, with `/` as separator.
    pub relative: String,
    /// As it was written.
    pub seen: Seen,
}

/// Settings of a scene and their key.
#[derive(Clone, Debug)]
pub struct SettingsKey {
    key: JobKey,
    settings: SceneSettings,
}

impl SettingsKey {
    /// The key of these settings.
    pub fn of(settings: SceneSettings) -> Self {
        Self { key: key_of(&settings), settings }
    }

    /// Equal for settings that give equal outputs.
    pub fn key(&self) -> JobKey {
        self.key
    }

    /// As text, for the reason of a change. Made on demand: most scenes have not changed.
    pub fn fields(&self) -> Vec<Field> {
        fields_of(&self.settings)
    }
}

/// All that is known of a scene that was baked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// The scene file.
    pub scene: Seen,
    /// Key of the settings of that bake; [`Index::fields`] has the text.
    pub settings: JobKey,
    /// Sorted by path.
    pub dependencies: Vec<Dependency>,
    /// Distinct sub-meshes, in the order of the scene.
    pub meshes: Vec<MeshHash>,
    /// Files written for it.
    pub outputs: Vec<Output>,
    facts: store::FactsAt,
    /// When the contents were read; files that are not older than that are not trusted. Set by [`Index::record`].
    read_ns: i64,
}

/// What a bake of a scene has read and written.
#[derive(Clone, Debug)]
pub struct Bake {
    /// The scene file; its facts are those of the scan.
    pub scene: Seen,
    /// Files that it refers to.
    pub dependencies: Vec<Dependency>,
    /// Distinct sub-meshes, in the order of the scene.
    pub meshes: Vec<MeshHash>,
    /// Files written for it.
    pub outputs: Vec<Output>,
    /// What a report says of it, so that an unchanged scene need not be read for a report.
    pub facts: Vec<u8>,
}

/// What the index says of a scene.
#[derive(Debug)]
pub enum Status<'a> {
    /// Nothing needs to be read or written.
    Unchanged(&'a Entry),
    /// By file facts alone it cannot be told; [`Index::recheck`] can.
    Touched(&'a Entry),
    /// It has to be baked again.
    Changed(Vec<Reason>),
    /// It was not baked by this pipeline yet.
    New,
}

/// What hashing again says of a touched scene.
#[derive(Debug)]
pub struct Recheck {
    /// Bytes that were read for it.
    pub read_bytes: u64,
    /// Nothing needs to be written if empty: hand the entry to [`Index::refresh`].
    pub reasons: Vec<Reason>,
    /// With the facts as they are now.
    pub entry: Entry,
}

/// The memory of one pipeline.
#[derive(Debug)]
pub struct Index {
    file: PathBuf,
    output: PathBuf,
    entries: BTreeMap<String, Entry>,
    /// Text of the settings, shared by the many scenes that have the same.
    settings: BTreeMap<JobKey, Vec<Field>>,
    /// Facts of the scenes that were baked in this run; all others are still in the file.
    fresh_facts: BTreeMap<String, Vec<u8>>,
    stored_facts: Option<store::StoredFacts>,
    /// Outputs of scenes that were baked in this run and have them no more.
    superseded: Vec<Output>,
    /// The file system's time before any content was read in this run.
    started_ns: OnceLock<i64>,
    is_changed: bool,
}

impl Index {
    /// The entry of a scene.
    pub fn entry(&self, relative: &str) -> Option<&Entry> {
        self.entries.get(relative)
    }

    /// All entries, by path.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &Entry)> {
        self.entries.iter().map(|(relative, entry)| (relative.as_str(), entry))
    }

    /// The settings of an entry's bake as text.
    pub fn fields(&self, entry: &Entry) -> &[Field] {
        self.settings.get(&entry.settings).map_or(&[], Vec::as_slice)
    }

    /// What a report says of a scene, as it was recorded. `None`: the scene is not known, or the file is damaged there;
    /// baking the scene again mends it.
    pub fn facts(&self, relative: &str) -> Option<Vec<u8>> {
        if let Some(facts) = self.fresh_facts.get(relative) {
            return Some(facts.clone());
        }
        self.stored_facts.as_ref()?.read(&self.entries.get(relative)?.facts)
    }

    /// Reads the facts of all scenes at once, for those who will ask for most of them.
    pub fn load_facts(&self) {
        if let Some(stored) = &self.stored_facts {
            stored.load();
        }
    }

    /// Looks at file facts only. Call it before the scene is read: it notes the time of the run's first reading.
    pub fn status(&self, scene: &SceneFile, settings: &SettingsKey) -> Status<'_> {
        let status = self.look(scene, settings, true);
        if !matches!(status, Status::Unchanged(_)) {
            self.started_ns.get_or_init(|| store::file_system_time(&self.file));
        }
        status
    }

    /// As [`Self::status`], for what is remembered of a scene and not for its outputs: they may be gone. Writes nothing.
    pub fn knows(&self, scene: &SceneFile, settings: &SettingsKey) -> Status<'_> {
        self.look(scene, settings, false)
    }

    fn look(&self, scene: &SceneFile, settings: &SettingsKey, with_outputs: bool) -> Status<'_> {
        let Some(entry) = self.entries.get(&scene.relative).filter(|entry| entry.settings != FAILED) else {
            return Status::New;
        };
        let mut reasons = Vec::new();
        if entry.settings != settings.key {
            reasons.extend(diff(self.fields(entry), &settings.fields()).into_iter().map(Reason::Settings));
        }
        let mut is_sure = true;
        match compare(&entry.scene, Some(scene.stat), Some(entry.read_ns)) {
            Compared::Same => {}
            Compared::Unsure => is_sure = false,
            Compared::Differs | Compared::Gone => reasons.push(Reason::Scene),
        }
        for dependency in &entry.dependencies {
            let now = FileStat::of(&dependency_path(scene, dependency)).ok();
            match &dependency.seen {
                Some(seen) => match compare(seen, now, Some(entry.read_ns)) {
                    Compared::Same => {}
                    Compared::Unsure => is_sure = false,
                    Compared::Differs => reasons.push(Reason::DependencyChanged(dependency.relative.clone())),
                    Compared::Gone => reasons.push(Reason::DependencyGone(dependency.relative.clone())),
                },
                None if now.is_some() => reasons.push(Reason::DependencyAppeared(dependency.relative.clone())),
                None => {}
            }
        }
        for output in entry.outputs.iter().filter(|_| with_outputs) {
            // Outputs are younger than the run that wrote them, and nothing else should write them: never too young.
            match compare(&output.seen, FileStat::of(&self.output.join(&output.relative)).ok(), None) {
                Compared::Same => {}
                Compared::Unsure => is_sure = false,
                Compared::Differs => reasons.push(Reason::OutputChanged(output.relative.clone())),
                Compared::Gone => reasons.push(Reason::OutputMissing(output.relative.clone())),
            }
        }
        match (reasons.is_empty(), is_sure) {
            (true, true) => Status::Unchanged(entry),
            (true, false) => Status::Touched(entry),
            (false, _) => Status::Changed(reasons),
        }
    }

    /// Hashes what [`Status::Touched`] could not tell. Errors of reading count as a change: the bake will tell them.
    pub fn recheck(&self, scene: &SceneFile, entry: &Entry) -> Recheck {
        self.rehash(scene, entry, true)
    }

    /// As [`Self::recheck`], for a scene that [`Self::knows`] is not sure of. Its outputs are not read.
    pub fn recheck_sources(&self, scene: &SceneFile, entry: &Entry) -> Recheck {
        self.rehash(scene, entry, false)
    }

    fn rehash(&self, scene: &SceneFile, entry: &Entry, with_outputs: bool) -> Recheck {
        let mut checked = Recheck { read_bytes: 0, reasons: Vec::new(), entry: entry.clone() };
        let (read_bytes, reasons) = (&mut checked.read_bytes, &mut checked.reasons);
        let mut same = |path: &Path, seen: &mut Seen, read_ns: Option<i64>| {
            let now = FileStat::of(path).ok();
            if matches!(compare(seen, now, read_ns), Compared::Same) {
                return true;
            }
            *read_bytes += now.map_or(0, |stat| stat.size);
            let before = seen.content;
            let read = Seen::read(path);
            read.is_ok_and(|read| {
                *seen = read;
                seen.content == before
            })
        };
        let entry = &mut checked.entry;
        if !same(&scene.path, &mut entry.scene, Some(entry.read_ns)) {
            reasons.push(Reason::Scene);
        }
        for dependency in &mut entry.dependencies {
            let path = dependency_path(scene, dependency);
            if let Some(seen) = &mut dependency.seen
                && !same(&path, seen, Some(entry.read_ns))
            {
                reasons.push(Reason::DependencyChanged(dependency.relative.clone()));
            }
        }
        for output in entry.outputs.iter_mut().filter(|_| with_outputs) {
            if !same(&self.output.join(&output.relative), &mut output.seen, None) {
                reasons.push(Reason::OutputChanged(output.relative.clone()));
            }
        }
        // What was not read again was older than the earlier reading, and so it is older than this one.
        entry.read_ns = self.started_ns();
        checked
    }

    /// Takes the entry of a recheck that found no reason.
    pub fn refresh(&mut self, relative: &str, entry: Entry) {
        self.entries.insert(relative.to_owned(), entry);
        self.is_changed = true;
    }

    /// A scene was baked.
    pub fn record(&mut self, relative: &str, settings: &SettingsKey, bake: Bake) {
        let Bake { scene, mut dependencies, meshes, outputs, facts } = bake;
        dependencies.sort_by(|a, b| a.relative.cmp(&b.relative));
        let (read_ns, settings_key) = (self.started_ns(), settings.key);
        let facts_at = store::FactsAt::of(&facts);
        self.fresh_facts.insert(relative.to_owned(), facts);
        let entry = Entry { scene, settings: settings_key, dependencies, meshes, outputs, facts: facts_at, read_ns };
        let outputs: BTreeSet<String> = entry.outputs.iter().map(|output| output.relative.clone()).collect();
        let before = self.entries.insert(relative.to_owned(), entry);
        let gone = before.into_iter().flat_map(|before| before.outputs).filter(|o| !outputs.contains(&o.relative));
        self.superseded.extend(gone);
        self.settings.entry(settings_key).or_insert_with(|| settings.fields());
        self.is_changed = true;
    }

    /// A scene could not be baked: the next run tries again. Its outputs of before are still there, and so is what they refer to: they
    /// stay known.
    pub fn forget(&mut self, relative: &str) {
        if let Some(entry) = self.entries.get_mut(relative) {
            entry.settings = FAILED;
            self.is_changed = true;
        }
    }

    /// Takes out the outputs that scenes had before they were baked in this run, and have no more. Another scene may have them.
    pub fn take_superseded(&mut self) -> Vec<Output> {
        std::mem::take(&mut self.superseded)
    }

    /// Takes out the entries of scenes that are no longer there (or are skipped now), for their outputs.
    pub fn take_vanished<'a>(&mut self, present: impl IntoIterator<Item = &'a str>) -> Vec<(String, Entry)> {
        let present: BTreeSet<&str> = present.into_iter().collect();
        let vanished: Vec<String> =
            self.entries.keys().filter(|relative| !present.contains(relative.as_str())).cloned().collect();
        self.is_changed |= !vanished.is_empty();
        vanished.into_iter().filter_map(|relative| self.entries.remove_entry(&relative)).collect()
    }

    /// Without a noted start nothing is trusted.
    fn started_ns(&self) -> i64 {
        self.started_ns.get().copied().unwrap_or(i64::MIN)
    }
}

fn dependency_path(scene: &SceneFile, dependency: &Dependency) -> PathBuf {
    scene.path.parent().unwrap_or(Path::new("")).join(&dependency.relative)
}

enum Compared {
    Same,
    /// Same length, but other facts, or too young.
    Unsure,
    Differs,
    Gone,
}

/// `read_ns`: when the content was read, for files that others write. A file changed at that time or later may have
/// changed again within the same tick of the clock. The time of the last change of any kind says it best, since nobody
/// can set it; where it is not known, that of the content has to do.
fn compare(seen: &Seen, now: Option<FileStat>, read_ns: Option<i64>) -> Compared {
    let Some(now) = now else { return Compared::Gone };
    let changed_ns = if now.ctime_ns == 0 { now.mtime_ns } else { now.ctime_ns };
    if now.size != seen.stat.size {
        Compared::Differs
    } else if now != seen.stat || read_ns.is_some_and(|read_ns| changed_ns >= read_ns) {
        Compared::Unsure
    } else {
        Compared::Same
    }
}
