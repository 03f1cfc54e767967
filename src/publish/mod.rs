//! A record and its findings for those who read them elsewhere: comments, CI services, trackers, a page of its own.
//!
//! One file for each format. Text in memory out; knows no files. Formats agree on what comes first: the worst finding.

mod github;
pub mod html;
mod junit;
mod markdown;
mod sarif;
#[cfg(test)]
mod tests;
mod trackers;

pub use github::annotations;
pub use junit::junit;
pub use markdown::{MARK, markdown};
pub use sarif::sarif;
pub use trackers::{bencher, benchmark};

use crate::budget::Finding;
use crate::difference::Difference;
use crate::progress::quantity::plural;
use crate::report::{Report, SceneRecord, Severity, Status};

/// What is published.
#[derive(Clone, Copy, Debug)]
pub struct Publication<'a> {
    /// The record.
    pub report: &'a Report,
    /// Problems, violations of budgets and regressions: the worst first.
    pub findings: &'a [Finding],
    /// What changed since the baseline, if there is one.
    pub difference: Option<&'a Difference>,
    /// Paths of scenes from the top of the repository.
    pub paths: &'a dyn ScenePaths,
}

/// Where source files are, as services of code hosts want it.
pub trait ScenePaths: std::fmt::Debug + Sync {
    /// A scene, given its path below its input folder.
    fn scene(&self, relative: &str) -> String;
    /// The pipeline.
    fn pipeline(&self) -> String;
}

impl Publication<'_> {
    fn count(&self, severity: Severity) -> u64 {
        self.findings.iter().filter(|finding| finding.severity == severity).count() as u64
    }

    /// `2 errors, 1 warning`, or that there are none.
    pub fn verdict(&self) -> String {
        match (self.count(Severity::Error), self.count(Severity::Warning)) {
            (0, 0) => "nothing to complain about".to_owned(),
            (0, warnings) => plural(warnings, "warning"),
            (errors, 0) => plural(errors, "error"),
            (errors, warnings) => format!("{}, {}", plural(errors, "error"), plural(warnings, "warning")),
        }
    }

    /// Where a finding is, from the top of the repository.
    fn file_of(&self, finding: &Finding) -> String {
        finding.scene.as_ref().map_or_else(|| self.paths.pipeline(), |scene| self.paths.scene(scene))
    }
}

/// The scenes, those with the worst findings first; those that were left out are not among them.
pub fn by_severity<'a>(publication: &Publication<'a>) -> Vec<&'a SceneRecord> {
    let all = scenes_by_severity(publication).into_iter().map(|(scene, _)| scene);
    all.filter(|scene| !scene.outputs.is_empty()).collect()
}

/// Worst first among the scenes: those with findings in the order of these, then the others by path.
fn scenes_by_severity<'a>(publication: &Publication<'a>) -> Vec<(&'a SceneRecord, Vec<&'a Finding>)> {
    let mut scenes: Vec<(&SceneRecord, Vec<&Finding>)> =
        publication.report.scenes.iter().map(|scene| (scene, Vec::new())).collect();
    let mut rank = vec![usize::MAX; scenes.len()];
    for (number, finding) in publication.findings.iter().enumerate() {
        let Some(path) = &finding.scene else { continue };
        if let Ok(at) = scenes.binary_search_by(|(scene, _)| scene.path.cmp(path)) {
            scenes[at].1.push(finding);
            rank[at] = rank[at].min(number);
        }
    }
    let mut order: Vec<usize> = (0..scenes.len()).collect();
    order.sort_by_key(|&at| (rank[at], at));
    order.into_iter().map(|at| (scenes[at].0, std::mem::take(&mut scenes[at].1))).collect()
}

/// The largest image difference among a scene's levels.
fn worst_look(scene: &SceneRecord) -> Option<f64> {
    scene.meshes.iter().flat_map(|mesh| &mesh.levels).filter_map(|level| level.d_rms).reduce(f64::max)
}

/// Triangles of a scene with every instance.
fn triangles(scene: &SceneRecord) -> u64 {
    scene.meshes.iter().map(|mesh| mesh.triangles * mesh.instances).sum()
}

/// In a word.
fn status(status: Status) -> &'static str {
    match status {
        Status::Baked => "baked",
        Status::Copied => "copied",
        Status::Failed => "failed",
        Status::Skipped => "skipped",
    }
}
