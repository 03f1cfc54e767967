//! Annotations as GitHub's runner reads them from a step's output.

use super::Publication;
use crate::budget::Finding;
use crate::report::Severity;

/// GitHub shows no more of each kind for one step.
const MOST: usize = 10;

/// One line for each: the worst errors, then the worst warnings, then how many there are beside them.
pub fn annotations(publication: &Publication<'_>) -> String {
    let mut text = String::new();
    for (severity, word) in [(Severity::Error, "error"), (Severity::Warning, "warning")] {
        let of = publication.findings.iter().filter(|finding| finding.severity == severity);
        text.extend(of.take(MOST).map(|finding| line(publication, finding, word)));
    }
    let shown = |severity| (publication.count(severity) as usize).min(MOST);
    let hidden = publication.findings.len() - shown(Severity::Error) - shown(Severity::Warning);
    if 0 < hidden {
        let hidden = hidden.to_string();
        text.extend(["::notice title=lodbake::and ", &hidden, " more findings: they are in the summary\n"]);
    }
    text
}

fn line(publication: &Publication<'_>, finding: &Finding, word: &str) -> String {
    let help = if finding.help.is_empty() { String::new() } else { format!("\n{}", finding.help) };
    let message = data(&format!("{}: {}{help}", finding.place(), finding.message));
    let (file, title) = (property(&publication.file_of(finding)), property(&format!("lodbake {}", finding.rule)));
    format!("::{word} file={file},title={title}::{message}\n")
}

/// As the runner's own toolkit escapes it.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}
