//! Every file a document refers to, also from extensions nobody here knows. Opens none of them.

use super::document::Document;
use super::uri;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a dependency is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DependencyKind {
    /// Bytes of `buffers`.
    Buffer,
    /// An image, or another form of it in an extension.
    Image,
    /// Something an extension or `extras` names; it need not exist.
    Other,
    /// Read while the scene was, and all of it is in the document now (materials of an OBJ file).
    Source,
}

/// A file beside the scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Dependency {
    /// As written in the document.
    pub uri: String,
    /// Where that is, from the scene's folder on.
    pub path: PathBuf,
    /// Its use; the first in order if it has several.
    pub kind: DependencyKind,
}

/// All external files of a document, sorted by address, each once. `base` is the scene's folder. Addresses that are
/// no relative paths are left out.
pub fn dependencies(document: &Document, base: &Path) -> Vec<Dependency> {
    let mut found = BTreeMap::new();
    if let Some(root) = document.json.as_object() {
        for (key, value) in root {
            let kind = match key.as_str() {
                "buffers" => DependencyKind::Buffer,
                "images" => DependencyKind::Image,
                _ => DependencyKind::Other,
            };
            collect(value, kind, &mut found);
        }
    }
    let resolved = found.into_iter().filter_map(|(uri, kind)| {
        let path = uri::resolve(uri, base, "").ok()?;
        Some(Dependency { uri: uri.to_owned(), path, kind })
    });
    resolved.collect()
}

/// The parser bounds the depth. `schemaUri` and its like follow the same naming as `uri`.
fn collect<'a>(value: &'a Value, kind: DependencyKind, found: &mut BTreeMap<&'a str, DependencyKind>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| collect(item, kind, found)),
        Value::Object(entries) => {
            for (key, entry) in entries {
                match entry {
                    Value::String(text) if key == "uri" || key.ends_with("Uri") => {
                        let known = found.entry(text).or_insert(kind);
                        *known = kind.min(*known);
                    }
                    _ => collect(entry, kind, found),
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use serde_json::json;

    #[test]
    fn files_anywhere_are_found_once_and_sorted() {
        let mut document = Document::new(Container::Gltf, "test");
        document.json["buffers"] = json!([{ "byteLength": 1, "uri": "z.bin" }, { "uri": "data:,x" }]);
        document.json["images"] = json!([
            { "uri": "a%20b.png", "extensions": { "VENDOR_x": { "variants": [{ "uri": "a.ktx2" }] } } },
            { "uri": "http://x/y.png" },
            { "uri": "a%20b.png" },
        ]);
        document.json["extensions"] = json!({ "A": { "uri": "a.ktx2", "schemaUri": "s.json", "uris": 4 } });
        let found = dependencies(&document, Path::new("base"));
        let expected = [
            ("a%20b.png", "base/a b.png", DependencyKind::Image),
            ("a.ktx2", "base/a.ktx2", DependencyKind::Image),
            ("s.json", "base/s.json", DependencyKind::Other),
            ("z.bin", "base/z.bin", DependencyKind::Buffer),
        ];
        let expected = expected.map(|(uri, path, kind)| Dependency { uri: uri.into(), path: path.into(), kind });
        assert_eq!(found, expected);
    }
}
