//! SARIF 2.1.0, for code scanning: one run, the worst results first and no more than services take.
//!
//! Written as JSON, since there are a dozen members of it: the crates with types for all of SARIF make them from its
//! schema when they are built. The official schema is held against the result in `tests/clients`.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::{Value, json};

use super::Publication;
use crate::budget::Finding;
use crate::report::Severity;

/// Results of one run that GitHub shows; more are refused by some services.
const MOST: usize = 5_000;

const SCHEMA: &str = "https://json.schemastore.org/sarif-2.1.0.json";

/// What may stand in the path of an address as it is.
const PATH: &AsciiSet = &NON_ALPHANUMERIC.remove(b'/').remove(b'.').remove(b'-').remove(b'_').remove(b'~');

/// The document.
pub fn sarif(publication: &Publication<'_>) -> Value {
    let shown = &publication.findings[..publication.findings.len().min(MOST)];
    let mut rules: Vec<&str> = Vec::new();
    for finding in shown {
        if !rules.contains(&finding.rule.as_str()) {
            rules.push(&finding.rule);
        }
    }
    let result = |finding: &Finding| {
        let index = rules.iter().position(|rule| *rule == finding.rule);
        let help = if finding.help.is_empty() { String::new() } else { format!(". {}", upper_first(&finding.help)) };
        let mut location = json!({
            "physicalLocation": {
                "artifactLocation": { "uri": address(&publication.file_of(finding)), "uriBaseId": "%SRCROOT%" },
                "region": { "startLine": 1 },
            },
        });
        if let Some(mesh) = &finding.mesh {
            let level = finding.level.map(|level| format!("@{level}")).unwrap_or_default();
            let name = format!("{}#{mesh}{level}", finding.scene.as_deref().unwrap_or_default());
            location["logicalLocations"] = json!([{ "name": mesh, "fullyQualifiedName": name, "kind": "object" }]);
        }
        let mut result = json!({
            "ruleId": finding.rule,
            "ruleIndex": index,
            "level": level(finding),
            "message": { "text": format!("{}: {}{help}", finding.place(), finding.message) },
            "locations": [location],
            "partialFingerprints": { "lodbakeFinding/v1": fingerprint(finding) },
            "properties": { "value": finding.value, "limit": finding.limit, "base": finding.base },
        });
        if let Some(line) = finding.line {
            result["relatedLocations"] = json!([{
                "physicalLocation": {
                    "artifactLocation": { "uri": address(&publication.paths.pipeline()), "uriBaseId": "%SRCROOT%" },
                    "region": { "startLine": line },
                },
                "message": { "text": "the limit" },
            }]);
        }
        result
    };
    let results: Vec<Value> = shown.iter().map(result).collect();
    let rules: Vec<Value> = rules.iter().map(|rule| describe(rule)).collect();
    json!({
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": { "name": "lodbake", "version": env!("CARGO_PKG_VERSION"), "rules": rules } },
            "columnKind": "unicodeCodePoints",
            "results": results,
            "properties": { "findings": publication.findings.len() },
        }],
    })
}

fn level(finding: &Finding) -> &'static str {
    if finding.severity == Severity::Error { "error" } else { "warning" }
}

fn describe(rule: &str) -> Value {
    let text = match rule.split_once('/') {
        Some(("budget", fact)) => format!("`{fact}` is beyond its budget"),
        Some(("regression", "vanished")) => "It is not there any more".to_owned(),
        Some(("regression", "broke")) => "It cannot be baked any more".to_owned(),
        Some(("regression", "uglier")) => "It looks less like its source than before".to_owned(),
        Some(("regression", _)) => "It takes more than before".to_owned(),
        Some(("bake", "failed")) => "The scene could not be baked".to_owned(),
        _ => "The scene is odd".to_owned(),
    };
    json!({ "id": rule, "name": rule.replace('/', "-"), "shortDescription": { "text": text } })
}

/// The same for the same finding in another run, whatever the figures.
fn fingerprint(finding: &Finding) -> String {
    blake3::hash(finding.identity().as_bytes()).to_hex()[..32].to_owned()
}

fn address(path: &str) -> String {
    utf8_percent_encode(path, PATH).to_string()
}

fn upper_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}
