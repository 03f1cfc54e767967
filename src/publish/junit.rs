//! JUnit XML: a test case for each scene, failed by its errors, in error if it could not be baked.

use quick_junit::{NonSuccessKind, Report as Suites, TestCase, TestCaseStatus, TestSuite};

use super::{Publication, scenes_by_severity};
use crate::budget::Finding;
use crate::report::{Severity, Status};

/// The file.
pub fn junit(publication: &Publication<'_>) -> String {
    let mut suites = Suites::new("lodbake");
    let mut suite = TestSuite::new("budgets and regressions");
    let is_elsewhere = |finding: &&Finding| {
        let scenes = &publication.report.scenes;
        finding.scene.as_ref().is_none_or(|path| scenes.binary_search_by(|scene| scene.path.cmp(path)).is_err())
    };
    // What is about no scene of the record: sums, and scenes that vanished.
    let mut elsewhere: Vec<(String, Vec<&Finding>)> = Vec::new();
    for finding in publication.findings.iter().filter(is_elsewhere) {
        let name = publication.file_of(finding);
        match elsewhere.iter_mut().find(|(other, _)| *other == name) {
            Some((_, findings)) => findings.push(finding),
            None => elsewhere.push((name, vec![finding])),
        }
    }
    // The worst first: what is elsewhere comes first where it is worse than the first with a scene.
    let place = |finding: &Finding| publication.findings.iter().position(|other| other == finding);
    let mut cases: Vec<(Option<usize>, TestCase)> =
        elsewhere.iter().map(|(name, findings)| (place(findings[0]), case(name, findings, false))).collect();
    for (scene, findings) in scenes_by_severity(publication) {
        if scene.status == Status::Skipped {
            continue;
        }
        let rank = findings.first().and_then(|first| place(first));
        cases.push((rank, case(&publication.paths.scene(&scene.path), &findings, scene.status == Status::Failed)));
    }
    cases.sort_by_key(|(rank, _)| rank.unwrap_or(usize::MAX));
    suite.add_test_cases(cases.into_iter().map(|(_, case)| case));
    suites.add_test_suite(suite);
    suites.to_string().expect("text in memory can be written")
}

fn case(name: &str, findings: &[&Finding], is_failed: bool) -> TestCase {
    let lines = |severity: Severity| -> Vec<String> {
        let own = findings.iter().filter(|finding| finding.severity == severity);
        own.map(|finding| {
            let help = if finding.help.is_empty() { String::new() } else { format!("\n  {}", finding.help) };
            format!("{}: {}{help}", finding.place(), finding.message)
        })
        .collect()
    };
    let (errors, warnings) = (lines(Severity::Error), lines(Severity::Warning));
    let status = match findings.iter().find(|finding| finding.severity == Severity::Error) {
        None => TestCaseStatus::success(),
        Some(first) => {
            let kind = if is_failed { NonSuccessKind::Error } else { NonSuccessKind::Failure };
            let mut status = TestCaseStatus::non_success(kind);
            status.set_type(first.rule.clone());
            status.set_message(format!("{}: {}", first.place(), first.message));
            status.set_description(errors.join("\n"));
            status
        }
    };
    let mut case = TestCase::new(name, status);
    case.set_classname("lodbake");
    if !warnings.is_empty() {
        case.set_system_out(warnings.join("\n"));
    }
    case
}
