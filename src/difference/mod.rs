//! Two records of the same pipeline: what grew, shrank, looks worse or better, appeared, vanished, broke.
//!
//! Records in, changes out; knows no files and no revisions. Changes below the noise floor are no changes.

#[cfg(test)]
mod tests;
mod words;

pub use words::{by, title};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::budget::{Finding, level_facts, matching, mesh_name, scene_facts};
use crate::config::Fact;
use crate::report::{MeshRecord, Report, SceneRecord, Severity, Status};

/// Looks and distances that change by less than this share do not count: another order of equally cheap contractions
/// moves them that much (3 % of one asset, measured over eight assets).
pub const LOOKS_NOISE: f64 = 0.03;

/// Nor do changes of d_RMS below this many steps of luminance: nobody sees them.
pub const LOOKS_STEP: f64 = 0.05;

/// Nor do distances that change by less than this share of the radius.
pub const SURFACE_STEP: f64 = 0.0005;

/// Nor do sizes that change by less than this share: a name or a time in a header.
pub const SIZE_NOISE: f64 = 0.001;

/// The JSON schema of `diff --json`.
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(Difference).to_value()
}

/// What is too much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Growth of any fact of a scene, in percent.
    pub growth: f64,
    /// Growth of any sum over all scenes, in percent. `None`: new scenes may make it grow.
    pub sum: Option<f64>,
    /// Growth of an image difference or a distance, in percent.
    pub looks: f64,
    /// Scenes may vanish.
    pub may_vanish: bool,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self { growth: 5.0, sum: None, looks: 10.0, may_vanish: false }
    }
}

/// What happened to a fact, or to a scene, mesh or level as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It was baked and now cannot be.
    Broke,
    /// It is not there any more.
    Vanished,
    /// It looks less like its source, or lies further from it.
    Uglier,
    /// It takes more.
    Grew,
    /// It was not there.
    Appeared,
    /// It looks more like its source, or lies closer to it.
    Better,
    /// It takes less.
    Shrank,
    /// It could not be baked and now is.
    Mended,
}

/// One change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    /// What happened.
    pub kind: Kind,
    /// Scene file, relative to its input folder; none for sums.
    pub scene: Option<String>,
    /// The mesh, by name, else by number; none for the scene itself.
    pub mesh: Option<String>,
    /// The level; 0 is the source.
    pub level: Option<u64>,
    /// What has changed; none where the whole scene, mesh or level has.
    pub fact: Option<Fact>,
    /// As it was.
    pub base: Option<f64>,
    /// As it is.
    pub head: Option<f64>,
    /// Past a threshold.
    pub is_regression: bool,
}

/// Everything that changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Difference {
    /// The worst first: regressions, then by kind and size.
    pub changes: Vec<Change>,
    /// Sums over all scenes, changed or not.
    pub sums: Vec<Sum>,
    /// Scenes that are the same in both.
    pub unchanged: u64,
}

/// A fact summed over all scenes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sum {
    /// What is summed.
    pub fact: Fact,
    /// As it was.
    pub base: f64,
    /// As it is.
    pub head: f64,
}

/// Facts of scenes that are compared: those that say the same about a change are left out.
const SCENE_FACTS: [Fact; 8] = [
    Fact::SceneTriangles,
    Fact::DrawCalls,
    Fact::Materials,
    Fact::TextureSize,
    Fact::FileBytes,
    Fact::GeometryBytes,
    Fact::TextureBytes,
    Fact::Undeclared,
];

/// Facts that are summed over all scenes.
const SUMS: [Fact; 5] =
    [Fact::FileBytes, Fact::GeometryBytes, Fact::TextureBytes, Fact::SceneTriangles, Fact::DrawCalls];

impl Difference {
    /// What changed from `base` to `head`.
    pub fn between(base: &Report, head: &Report, thresholds: &Thresholds) -> Self {
        let mut found = Finder { thresholds, changes: Vec::new() };
        let by_path = |report: &'_ Report| -> BTreeMap<String, SceneRecord> {
            let present = report.scenes.iter().filter(|scene| scene.status != Status::Skipped);
            present.map(|scene| (scene.path.clone(), scene.clone())).collect()
        };
        let (old, new) = (by_path(base), by_path(head));
        let mut unchanged = 0;
        for (path, scene) in &new {
            match old.get(path) {
                None => found.whole(Kind::Appeared, path, None, None),
                Some(before) if before == scene => unchanged += 1,
                Some(before) => {
                    let count = found.changes.len();
                    found.scene(before, scene);
                    unchanged += u64::from(found.changes.len() == count);
                }
            }
        }
        for path in old.keys().filter(|path| !new.contains_key(*path)) {
            found.whole(Kind::Vanished, path, None, None);
        }
        let total =
            |scenes: &BTreeMap<String, SceneRecord>, fact| -> f64 { scenes.values().map(|s| fact_of(s, fact)).sum() };
        let sums: Vec<Sum> =
            SUMS.map(|fact| Sum { fact, base: total(&old, fact), head: total(&new, fact) }).into_iter().collect();
        for sum in sums.iter().filter(|sum| thresholds.sum.is_some_and(|by| is_past(sum.base, sum.head, by))) {
            found.changes.push(Change {
                kind: Kind::Grew,
                scene: None,
                mesh: None,
                level: None,
                fact: Some(sum.fact),
                base: Some(sum.base),
                head: Some(sum.head),
                is_regression: true,
            });
        }
        let mut changes = found.changes;
        changes.sort_by(|a, b| {
            let place = |c: &Change| (c.scene.clone(), c.mesh.clone(), c.level, c.fact);
            (b.is_regression, a.kind)
                .cmp(&(a.is_regression, b.kind))
                .then(b.ratio().total_cmp(&a.ratio()))
                .then_with(|| place(a).cmp(&place(b)))
        });
        Self { changes, sums, unchanged }
    }

    /// The changes past a threshold, as findings. The worst first.
    pub fn findings(&self) -> Vec<Finding> {
        self.changes.iter().filter(|change| change.is_regression).map(Change::finding).collect()
    }
}

/// More than `percent` above what it was.
fn is_past(base: f64, head: f64, percent: f64) -> bool {
    base * (1.0 + percent / 100.0) < head
}

/// A fact of a whole scene, shown as its source; 0 where the record does not tell.
fn fact_of(scene: &SceneRecord, fact: Fact) -> f64 {
    let found = scene_facts(scene, 0).into_iter().find(|(f, _, _)| *f == fact);
    found.map_or(0.0, |(_, _, value)| value)
}

struct Finder<'a> {
    thresholds: &'a Thresholds,
    changes: Vec<Change>,
}

struct Place<'a> {
    scene: &'a str,
    mesh: Option<&'a str>,
    level: Option<u64>,
}

impl Finder<'_> {
    fn whole(&mut self, kind: Kind, scene: &str, mesh: Option<&str>, level: Option<u64>) {
        let is_regression = match kind {
            Kind::Broke => true,
            Kind::Vanished => !self.thresholds.may_vanish,
            _ => false,
        };
        let (scene, mesh) = (Some(scene.to_owned()), mesh.map(str::to_owned));
        self.changes.push(Change { kind, scene, mesh, level, fact: None, base: None, head: None, is_regression });
    }

    fn scene(&mut self, base: &SceneRecord, head: &SceneRecord) {
        let path = head.path.as_str();
        match (base.status, head.status) {
            (Status::Failed, Status::Failed) => return,
            (_, Status::Failed) => return self.whole(Kind::Broke, path, None, None),
            (Status::Failed, _) => return self.whole(Kind::Mended, path, None, None),
            _ => {}
        }
        let place = Place { scene: path, mesh: None, level: None };
        let has_costs = base.costs.is_some() && head.costs.is_some();
        for fact in SCENE_FACTS {
            let is_plain = matches!(fact, Fact::SceneTriangles | Fact::FileBytes | Fact::Undeclared);
            if is_plain || has_costs {
                self.fact(&place, fact, fact_of(base, fact), fact_of(head, fact));
            }
        }
        let same = matching(&base.meshes, &head.meshes);
        for mesh in &head.meshes {
            match same.get(&mesh.index) {
                Some(before) => self.mesh(path, before, mesh),
                None => self.whole(Kind::Appeared, path, Some(&mesh_name(mesh)), None),
            }
        }
        for mesh in base.meshes.iter().filter(|mesh| !same.values().any(|old| old.index == mesh.index)) {
            self.whole(Kind::Vanished, path, Some(&mesh_name(mesh)), None);
        }
    }

    fn mesh(&mut self, scene: &str, base: &MeshRecord, head: &MeshRecord) {
        let name = mesh_name(head);
        let has = |mesh: &MeshRecord, number| mesh.levels.iter().any(|level| level.number == number);
        for level in base.levels.iter().filter(|level| !has(head, level.number)) {
            self.whole(Kind::Vanished, scene, Some(&name), Some(level.number));
        }
        for level in head.levels.iter().filter(|level| !has(base, level.number)) {
            self.whole(Kind::Appeared, scene, Some(&name), Some(level.number));
        }
        for (level, fact, value) in level_facts(head).filter(|(_, fact, _)| *fact != Fact::Vertices) {
            let before = level_facts(base).find(|(l, f, _)| (*l, *f) == (level, fact));
            let place = Place { scene, mesh: Some(&name), level: Some(level) };
            if let Some((_, _, before)) = before {
                self.fact(&place, fact, before, value);
            }
        }
    }

    fn fact(&mut self, place: &Place<'_>, fact: Fact, base: f64, head: f64) {
        let is_look = matches!(fact, Fact::DRms | Fact::Surface);
        let by = (head - base).abs();
        let is_noise = match fact {
            Fact::DRms => by < LOOKS_STEP || by < LOOKS_NOISE * base,
            Fact::Surface => by < SURFACE_STEP || by < LOOKS_NOISE * base,
            _ => by == 0.0 || by < SIZE_NOISE * base,
        };
        if is_noise {
            return;
        }
        let kind = match (is_look, base < head) {
            (true, true) => Kind::Uglier,
            (true, false) => Kind::Better,
            (false, true) => Kind::Grew,
            (false, false) => Kind::Shrank,
        };
        let percent = if is_look { self.thresholds.looks } else { self.thresholds.growth };
        let is_regression = is_past(base, head, percent);
        self.changes.push(Change {
            kind,
            scene: Some(place.scene.to_owned()),
            mesh: place.mesh.map(str::to_owned),
            level: place.level,
            fact: Some(fact),
            base: Some(base),
            head: Some(head),
            is_regression,
        });
    }
}

impl Change {
    /// How many times as much it is; 1 where it is about the whole.
    fn ratio(&self) -> f64 {
        let ratio = self.head.zip(self.base).map_or(1.0, |(head, base)| head / base);
        let ratio = if ratio.is_nan() { 1.0 } else { ratio };
        ratio.max(1.0 / ratio)
    }

    /// As a finding: what it says, and what would help.
    pub fn finding(&self) -> Finding {
        let (rule, help) = match self.kind {
            Kind::Broke => ("regression/broke", "bake it to see why; its last good output stays"),
            Kind::Vanished => {
                ("regression/vanished", "if it was meant: take a new baseline, or pass `--allow-vanished`")
            }
            Kind::Uglier => {
                ("regression/uglier", "`lodbake evaluate` shows the difference; more triangles, or `effort = \"best\"`")
            }
            _ => ("regression/grew", "if it was meant: take a new baseline"),
        };
        Finding {
            severity: Severity::Error,
            rule: rule.to_owned(),
            scene: self.scene.clone(),
            mesh: self.mesh.clone(),
            level: self.level,
            value: self.head,
            base: self.base,
            limit: None,
            message: self.message(),
            help: help.to_owned(),
            line: None,
            excess: match self.kind {
                Kind::Broke | Kind::Vanished => f64::MAX,
                _ => self.ratio().min(f64::MAX),
            },
        }
    }

    /// What changed, without the place: `level 2 …` is in [`Finding::place`].
    pub fn message(&self) -> String {
        words::message(self)
    }

    /// Where it is.
    pub fn place(&self) -> String {
        self.finding().place()
    }
}
