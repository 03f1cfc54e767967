//! Recorded facts against the limits of `[[budget]]`: what is beyond them, and what would help.
//!
//! Knows no files and no clock: records in, findings out. Also the type of a finding, whoever found it.

mod advice;
mod facts;
#[cfg(test)]
pub(crate) mod tests;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use facts::{amount, figure, level_facts, mesh_facts, scene_facts};

use crate::config::{Bounds, Budget, Fact, Limit};
use crate::report::{MeshRecord, Problem, SceneRecord, Severity};

/// What is beyond a limit, has become worse, or is broken: one line of a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// An error makes a check fail.
    pub severity: Severity,
    /// What kind it is, the same for all findings of the kind, e.g. `budget/triangles` or `regression/vanished`.
    pub rule: String,
    /// Scene file, relative to its input folder; none if it is not one scene's.
    pub scene: Option<String>,
    /// The mesh, by name, else by number.
    pub mesh: Option<String>,
    /// The level; 0 is the source.
    pub level: Option<u64>,
    /// The fact as it is.
    pub value: Option<f64>,
    /// The fact as it was, for limits on growth.
    pub base: Option<f64>,
    /// The limit, in the unit of `value`.
    pub limit: Option<f64>,
    /// What is wrong, without the place.
    pub message: String,
    /// What would help.
    pub help: String,
    /// Line of the limit in `pipeline.toml`.
    pub line: Option<u64>,
    /// How far beyond: 1 is at the limit, 2 twice as much. Sorts findings.
    pub excess: f64,
}

impl Finding {
    /// Where it is, for people: ``props/lamp.glb: mesh `shade`, level 2``.
    pub fn place(&self) -> String {
        let mesh = self.mesh.as_ref().map(|mesh| format!("mesh `{mesh}`"));
        let level = self.level.map(|level| if level == 0 { "source".to_owned() } else { format!("level {level}") });
        let inside = [mesh, level].into_iter().flatten().collect::<Vec<_>>().join(", ");
        let scene = self.scene.as_deref().unwrap_or("all scenes");
        if inside.is_empty() { scene.to_owned() } else { format!("{scene}: {inside}") }
    }

    /// The same text for the same finding in another run, whatever its value: for fingerprints.
    pub fn identity(&self) -> String {
        let level = self.level.map(|level| level.to_string()).unwrap_or_default();
        let (scene, mesh) = (self.scene.as_deref().unwrap_or_default(), self.mesh.as_deref().unwrap_or_default());
        [self.rule.as_str(), scene, mesh, &level].join("\n")
    }

    /// Of a scene that could not be baked, or is odd.
    pub fn of_problem(problem: &Problem) -> Self {
        let place = if problem.place.is_empty() { String::new() } else { format!("{}: ", problem.place) };
        let rule = if problem.severity == Severity::Error { "bake/failed" } else { "bake/odd" };
        Self {
            severity: problem.severity,
            rule: rule.to_owned(),
            scene: problem.scene.clone(),
            mesh: None,
            level: None,
            value: None,
            base: None,
            limit: None,
            message: format!("{place}{}", problem.cause),
            help: problem.hint.clone().unwrap_or_default(),
            line: None,
            excess: if problem.severity == Severity::Error { f64::MAX } else { 1.0 },
        }
    }
}

/// Errors first, those furthest beyond their limits first, then by place.
pub fn sort(findings: &mut [Finding]) {
    findings.sort_by(|a, b| {
        let key = |f: &Finding| (f.severity, f.scene.clone(), f.mesh.clone(), f.level, f.rule.clone());
        a.severity.cmp(&b.severity).then(b.excess.total_cmp(&a.excess)).then_with(|| key(a).cmp(&key(b)))
    });
}

/// How a mesh is called: by its name, else by its number.
pub fn mesh_name(mesh: &MeshRecord) -> String {
    mesh.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("meshes[{}]", mesh.index))
}

/// The meshes of two records of one scene that are the same: by name where it occurs once, else by number.
pub fn matching<'a>(base: &'a [MeshRecord], head: &[MeshRecord]) -> BTreeMap<u64, &'a MeshRecord> {
    let count = |all: &[MeshRecord], name: &Option<String>| all.iter().filter(|mesh| mesh.name == *name).count();
    let same = |mesh: &MeshRecord| {
        let is_unique = mesh.name.is_some() && count(base, &mesh.name) == 1 && count(head, &mesh.name) == 1;
        let found = base.iter().find(|other| {
            if is_unique { other.name == mesh.name } else { other.index == mesh.index && other.name == mesh.name }
        });
        Some((mesh.index, found?))
    };
    head.iter().filter_map(same).collect()
}

/// Holds one scene against all budgets of its pipeline; `base` is its record in the baseline.
pub fn check(scene: &SceneRecord, budgets: &[Budget], min_triangles: u64, base: Option<&SceneRecord>) -> Vec<Finding> {
    let own: Vec<&Budget> = budgets.iter().rev().filter(|budget| budget.matches(&scene.path)).collect();
    if own.is_empty() || scene.outputs.is_empty() {
        return Vec::new();
    }
    let limit = |fact, level| own.iter().find_map(|budget| budget.limit(fact, level));
    let mut found = Vec::new();
    let levels = scene.meshes.iter().map(|mesh| mesh.levels.len() as u64).max().unwrap_or(0);
    let before: BTreeMap<(Fact, Option<u64>), f64> =
        base.into_iter().flat_map(|base| scene_facts(base, levels)).map(|(f, l, value)| ((f, l), value)).collect();
    for (fact, level, value) in scene_facts(scene, levels) {
        let Some(limit) = limit(fact, level) else { continue };
        let help = |bound| advice::scene(scene, fact, bound);
        let base = before.get(&(fact, level)).copied();
        // The scene as its source needs no word for it.
        let level = level.filter(|&level| level != 0);
        found.extend(beyond(limit, value, base).map(|b| b.finding(scene, None, level, help)));
    }
    let same = base.map(|base| matching(&base.meshes, &scene.meshes)).unwrap_or_default();
    for mesh in &scene.meshes {
        let base = same.get(&mesh.index).copied();
        for (fact, value) in mesh_facts(mesh) {
            let Some(limit) = limit(fact, None) else { continue };
            if fact == Fact::MinLevels && mesh.triangles < min_triangles {
                continue;
            }
            let help = |bound| advice::mesh(mesh, fact, bound);
            let base = base.and_then(|base| mesh_facts(base).find(|(f, _)| *f == fact)).map(|(_, value)| value);
            found.extend(beyond(limit, value, base).map(|b| b.finding(scene, Some(mesh), None, help)));
        }
        for (level, fact, value) in level_facts(mesh) {
            let Some(limit) = limit(fact, Some(level)) else { continue };
            let help = |bound| advice::level(mesh, level, fact, bound);
            let base = base.and_then(|base| level_facts(base).find(|(l, f, _)| (*l, *f) == (level, fact)));
            let base = base.map(|(_, _, value)| value);
            found.extend(beyond(limit, value, base).map(|b| b.finding(scene, Some(mesh), Some(level), help)));
        }
    }
    found
}

/// Whether any limit is on growth, so that a baseline is needed.
pub fn needs_baseline(budgets: &[Budget]) -> bool {
    budgets.iter().flat_map(Budget::limits).any(|limit| limit.grow_percent.is_some() || limit.grow_by.is_some())
}

/// How a value is beyond its limit.
struct Beyond<'a> {
    limit: &'a Limit,
    severity: Severity,
    value: f64,
    base: Option<f64>,
    /// In the unit of `value`.
    bound: f64,
    message: String,
}

impl Beyond<'_> {
    fn finding(
        self,
        scene: &SceneRecord,
        mesh: Option<&MeshRecord>,
        level: Option<u64>,
        help: impl Fn(f64) -> String,
    ) -> Finding {
        let ratio = if self.limit.fact.is_least() { self.bound / self.value } else { self.value / self.bound };
        Finding {
            severity: self.severity,
            rule: format!("budget/{}", self.limit.fact.key()),
            scene: Some(scene.path.clone()),
            mesh: mesh.map(mesh_name),
            level,
            value: Some(self.value),
            base: self.base,
            limit: Some(self.bound),
            message: self.message,
            help: help(self.bound),
            line: Some(self.limit.line as u64),
            // A limit of 0 is infinitely exceeded, which JSON cannot tell.
            excess: if ratio.is_finite() { ratio } else { f64::MAX },
        }
    }
}

/// The worst way in which a value is beyond a limit: errors before warnings, the fact before its growth.
fn beyond<'a>(limit: &'a Limit, value: f64, base: Option<f64>) -> Option<Beyond<'a>> {
    let fact = limit.fact;
    let past = |bound: f64| if fact.is_least() { value < bound } else { bound < value };
    let grown = base.filter(|base| *base < value);
    let by_percent = |percent: f64| grown.map(|base| base * (1.0 + percent / 100.0)).filter(|&bound| bound < value);
    let by = |more: f64| grown.map(|base| base + more).filter(|&bound| bound < value);
    let one = |severity: Severity, pick: fn(&Bounds) -> Option<f64>| -> Option<Beyond<'a>> {
        let made = |bound: f64, message: String| Beyond { limit, severity, value, base, bound, message };
        let told = amount(fact, value);
        if let Some(bound) = pick(&limit.at).filter(|&bound| past(bound)) {
            let kind = if fact.is_least() { "at least" } else { "limit" };
            let mut over = String::new();
            if !fact.is_least() && 0.0 < bound {
                let times = value / bound;
                over = if times < 2.0 {
                    format!(", {} over", percent(times - 1.0))
                } else {
                    format!(", {times:.1} times that")
                };
            }
            return Some(made(bound, format!("{told}; {kind} {}{over}", figure(fact, bound))));
        }
        let before = figure(fact, base?);
        if let Some((allowed, bound)) = pick(&limit.grow_percent).and_then(|p| Some((p, by_percent(p)?))) {
            let grown = if base == Some(0.0) { String::new() } else { format!(", {}", percent(value / base? - 1.0)) };
            return Some(made(bound, format!("{told}{grown} more than the baseline's {before}; limit {allowed} %")));
        }
        let (allowed, bound) = pick(&limit.grow_by).and_then(|p| Some((p, by(p)?)))?;
        let (more, allowed) = (figure(fact, value - base?), figure(fact, allowed));
        Some(made(bound, format!("{told}, {more} more than the baseline's {before}; limit {allowed}")))
    };
    one(Severity::Error, |bounds| bounds.error).or_else(|| one(Severity::Warning, |bounds| bounds.warn))
}

/// `12 %`, `0.4 %`, `230 %`.
fn percent(share: f64) -> String {
    crate::report::percent(share)
}
