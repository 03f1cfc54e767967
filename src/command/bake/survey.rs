//! Which scenes have to be read: by the index alone, without opening what is unchanged.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Session;
use super::record::{self, SceneFacts};
use crate::config::SceneSettings;
use crate::index::{Entry, Index, Reason, SettingsKey, Status};
use crate::progress::Event;
use crate::report::{Problem, Severity};
use crate::scan::{Scan, SceneFile};

/// A scene that has to be read.
#[derive(Clone, Debug)]
pub struct Todo {
    pub file: SceneFile,
    pub settings: SceneSettings,
    pub key: SettingsKey,
    /// Why, in words.
    pub reason: String,
}

/// What the survey found.
pub struct Survey {
    pub todo: Vec<Todo>,
}

impl Session<'_> {
    /// Takes over what the scan could not take or found odd.
    pub fn take_scan(&mut self, found: &Scan) {
        for problem in &found.problems {
            self.undone += 1;
            let cause = problem.to_string();
            self.context.reporter.event(&Event::ScanFailed { error: cause.clone() });
            let (scene, place, hint) = (None, String::new(), None);
            self.problems.push(Problem { scene, severity: Severity::Error, place, cause, hint });
        }
        for warning in &found.warnings {
            self.warn_run(&warning.to_string());
        }
    }

    /// Sorts scenes into those that are done, those that are skipped and those to read.
    pub fn survey(&mut self, found: &Scan) -> Survey {
        let mut keys: BTreeMap<Vec<u8>, SettingsKey> = BTreeMap::new();
        let mut planned = Vec::new();
        for file in &found.files {
            let settings = self.pipeline.settings_for(&file.relative);
            if settings.skip {
                self.summary.skipped += 1;
                self.scenes.insert(file.relative.clone(), SceneFacts::skipped(file));
                continue;
            }
            let text = serde_json::to_vec(&settings).expect("settings are plain data");
            let key = keys.entry(text).or_insert_with(|| SettingsKey::of(settings.clone())).clone();
            planned.push((file, settings, key));
        }
        let index = &self.index;
        let looked: Vec<Looked> = planned.par_iter().map(|(file, _, key)| look(index, file, key)).collect();
        let mut todo = Vec::new();
        for ((file, settings, key), looked) in planned.into_iter().zip(looked) {
            self.summary.scene_bytes_read += looked.read_bytes;
            if let Some(entry) = looked.refreshed {
                self.index.refresh(&file.relative, entry);
            }
            match looked.facts {
                Some(facts) => self.take_unchanged(file, facts),
                None => todo.push(Todo { file: file.clone(), settings, key, reason: looked.reason }),
            }
        }
        Survey { todo }
    }

    fn take_unchanged(&mut self, file: &SceneFile, facts: SceneFacts) {
        self.summary.unchanged += 1;
        self.context.reporter.event(&Event::SceneUnchanged { path: file.relative.clone() });
        self.scenes.insert(file.relative.clone(), facts);
    }
}

/// What the index says of one scene.
struct Looked {
    facts: Option<SceneFacts>,
    refreshed: Option<Entry>,
    read_bytes: u64,
    reason: String,
}

fn look(index: &Index, file: &SceneFile, key: &SettingsKey) -> Looked {
    let nothing = Looked { facts: None, refreshed: None, read_bytes: 0, reason: String::new() };
    match index.status(file, key) {
        Status::Unchanged(_) => with_facts(index, file, nothing),
        Status::Touched(entry) => {
            let checked = index.recheck(file, entry);
            let nothing = Looked { read_bytes: checked.read_bytes, ..nothing };
            if !checked.reasons.is_empty() {
                return Looked { reason: words(&checked.reasons), ..nothing };
            }
            let looked = with_facts(index, file, nothing);
            Looked { refreshed: looked.facts.is_some().then_some(checked.entry), ..looked }
        }
        Status::Changed(reasons) => Looked { reason: words(&reasons), ..nothing },
        Status::New => Looked { reason: "it was not baked yet".to_owned(), ..nothing },
    }
}

/// Facts of another version of the record are as good as none: the scene is read again.
fn with_facts(index: &Index, file: &SceneFile, nothing: Looked) -> Looked {
    match index.facts(&file.relative).as_deref().and_then(record::from_bytes) {
        Some(facts) => Looked { facts: Some(facts), ..nothing },
        None => Looked { reason: "what is remembered of it is of another version".to_owned(), ..nothing },
    }
}

fn words(reasons: &[Reason]) -> String {
    reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}
