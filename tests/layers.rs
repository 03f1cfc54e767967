//! The rules of the house that the compiler does not check: modules use only those above them in `src/lib.rs`, some
//! crates and some of `std` belong to one room, files open with their purpose and stay short.
//!
//! Works on tokens of the source text (comments and strings removed), so it knows no types: a path counts by how it
//! is written. Each rule has a test below that shows it failing.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Longest file, in lines. The style asks for 500; the rest is grace for tests at the end of a file.
const MAX_LINES: usize = 600;

/// Files that may be longer, each with the reason.
const LONG_FILES: &[(&str, &str)] = &[];

/// The first module that may touch the world: all above it are pure.
const FIRST_IMPURE: &str = "config";

/// Rooms that talk to people.
const SPEAKERS: &[&str] = &["progress", "command", "cli"];

/// Crates that belong to some rooms only (a room is a top-level module), with the reason.
const CRATES: &[(&str, &[&str], &str)] = &[
    ("meshopt", &["gltf", "lod"], "the codec belongs to gltf, cache order to lod"),
    ("draco_core", &["gltf"], "only gltf decodes"),
    ("tobj", &["obj"], "only obj reads OBJ"),
    ("basisu", &["appearance"], "only appearance looks into images"),
    ("image", &["appearance"], "only appearance looks into images"),
    ("wgpu", &["appearance"], "only appearance draws"),
    ("pollster", &["appearance"], "only appearance waits for a graphics card"),
    ("anyhow", &["command", "cli"], "errors elsewhere carry typed facts"),
    ("indicatif", &["progress"], "only progress draws bars"),
    ("clap", &["cli", "command"], "only the command line knows flags"),
];

/// What the pure modules may not use: same input, same bytes, on any machine.
const WORLD: &[&str] = &[
    "std::fs",
    "std::net",
    "std::process",
    "std::env",
    "std::io::stdin",
    "std::time::SystemTime",
    "std::time::Instant",
    "std::collections::hash_map::RandomState",
    "std::hash::RandomState",
    "tempfile",
    "ignore",
    "rand",
];

/// Macros and handles that print.
const PRINTING: &[&str] = &["println", "print", "eprintln", "eprint"];
const HANDLES: &[&str] = &["std::io::stdout", "std::io::stderr"];

/// One file of the project: its path from the root, with `/`, and its text.
struct Source {
    path: String,
    text: String,
}

#[derive(Debug, Clone, PartialEq)]
struct Token {
    text: String,
    line: usize,
}

/// A path as written (`crate::mesh::Mesh`), its braces expanded, and where it stands.
#[derive(Debug, PartialEq)]
struct Use {
    path: Vec<String>,
    line: usize,
    /// How many inline `mod name { .. }` stand round it.
    depth: usize,
}

#[test]
fn modules_keep_to_their_layer_and_room() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    for folder in ["src", "tests", "examples", "benches"] {
        collect(root, &root.join(folder), &mut sources);
    }
    assert!(sources.iter().any(|source| source.path == "src/lib.rs"), "src/lib.rs not found");
    let found = violations(&sources);
    let list = found.iter().fold(String::new(), |mut list, one| {
        writeln!(list, "  {one}").expect("a String takes any text");
        list
    });
    assert!(found.is_empty(), "{} violation(s) of the layers:\n{list}", found.len());
}

/// Every `.rs` file below `folder`, sorted by path; `node_modules` and hidden folders aside.
fn collect(root: &Path, folder: &Path, sources: &mut Vec<Source>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("a readable folder").path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "node_modules" && !name.starts_with('.') {
            collect(root, &path, sources);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let relative = path.strip_prefix(root).expect("walked from the root");
            let text = fs::read_to_string(&path).expect("a readable source file");
            sources.push(Source { path: relative.to_string_lossy().replace('\\', "/"), text });
        }
    }
}

/// Every broken rule, with file and line.
fn violations(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    let order = sources
        .iter()
        .find(|source| source.path == "src/lib.rs")
        .map(|lib| module_order(&lib.text))
        .unwrap_or_default();
    for source in sources {
        form(source, &mut found);
        if let Some(room) = room(&source.path) {
            let tokens = tokens(&source.text);
            let uses = uses(&tokens);
            layer(source, &room, &order, &uses, &mut found);
            rooms(source, &room, &order, &uses, &mut found);
            printing(source, &room, &tokens, &uses, &mut found);
        }
    }
    found
}

/// The modules in the order of `src/lib.rs`.
fn module_order(text: &str) -> Vec<String> {
    let tokens = tokens(text);
    tokens
        .windows(3)
        .filter(|three| three[0].text == "mod" && three[2].text == ";")
        .map(|three| three[1].text.clone())
        .collect()
}

/// The module path of a file below `src`: `["gltf", "read"]`; `None` for the roots and for files elsewhere.
fn module_path(path: &str) -> Option<Vec<String>> {
    let inner = path.strip_prefix("src/")?.strip_suffix(".rs")?;
    let inner = inner.strip_suffix("/mod").unwrap_or(inner);
    (!matches!(inner, "lib" | "main")).then(|| inner.split('/').map(String::from).collect())
}

/// The top-level module that a file belongs to.
fn room(path: &str) -> Option<String> {
    module_path(path)?.first().cloned()
}

/// Purpose first, and short enough to read.
fn form(source: &Source, found: &mut Vec<String>) {
    if !source.text.starts_with("//!") {
        found.push(format!(
            "{}:1: does not open with `//!`: say what the file does and what it does not know",
            source.path
        ));
    }
    let lines = source.text.lines().count();
    if lines > MAX_LINES && !LONG_FILES.iter().any(|(path, _)| *path == source.path) {
        found.push(format!("{}:{lines}: {lines} lines, more than {MAX_LINES}: split it by noun", source.path));
    }
}

/// A module uses only those above it.
fn layer(source: &Source, room: &str, order: &[String], uses: &[Use], found: &mut Vec<String>) {
    let place = |name: &str| order.iter().position(|module| module == name);
    let Some(own) = place(room) else {
        found.push(format!("{}:1: module `{room}` is not in src/lib.rs", source.path));
        return;
    };
    let depth = module_path(&source.path).map_or(0, |path| path.len());
    for used in uses {
        let Some(target) = top_module(used, depth) else { continue };
        if place(target).is_some_and(|place| place > own) {
            found.push(format!(
                "{}:{}: `{room}` uses `{target}`, which stands below it in src/lib.rs",
                source.path, used.line
            ));
        }
    }
}

/// The top-level module a path leads to, through `crate` or through enough `super`s.
fn top_module(used: &Use, file_depth: usize) -> Option<&str> {
    let supers = used.path.iter().take_while(|part| *part == "super").count();
    match used.path.first()?.as_str() {
        "crate" => used.path.get(1).map(String::as_str),
        "super" if supers == file_depth + used.depth => used.path.get(supers).map(String::as_str),
        _ => None,
    }
}

/// Crates stay in their rooms, and the pure modules away from the world.
fn rooms(source: &Source, room: &str, order: &[String], uses: &[Use], found: &mut Vec<String>) {
    let pure = order.iter().take_while(|module| *module != FIRST_IMPURE).any(|module| module == room);
    for used in uses {
        for (name, allowed, reason) in CRATES {
            if used.path[0] == *name && used.path.len() > 1 && !allowed.contains(&room) {
                found.push(format!(
                    "{}:{}: `{name}` belongs to {}: {reason}",
                    source.path,
                    used.line,
                    allowed.join(", ")
                ));
            }
        }
        if let Some(world) = WORLD.iter().find(|world| pure && leads_to(used, world)) {
            found.push(format!("{}:{}: `{room}` is pure and may not use `{world}`", source.path, used.line));
        }
    }
}

/// Below `command`, nothing prints.
fn printing(source: &Source, room: &str, tokens: &[Token], uses: &[Use], found: &mut Vec<String>) {
    if SPEAKERS.contains(&room) {
        return;
    }
    for pair in tokens.windows(2) {
        if pair[1].text == "!" && PRINTING.contains(&pair[0].text.as_str()) {
            found.push(format!(
                "{}:{}: `{}!` in `{room}`: only {} print",
                source.path,
                pair[0].line,
                pair[0].text,
                SPEAKERS.join(", ")
            ));
        }
    }
    for used in uses {
        if let Some(handle) = HANDLES.iter().find(|handle| leads_to(used, handle)) {
            found.push(format!(
                "{}:{}: `{handle}` in `{room}`: only {} print",
                source.path,
                used.line,
                SPEAKERS.join(", ")
            ));
        }
    }
}

/// Whether a path is `name` or lies inside it; `use std::time;` followed by `time::Instant` counts by its written end.
fn leads_to(used: &Use, name: &str) -> bool {
    let parts: Vec<_> = name.split("::").collect();
    let starts =
        |path: &[String], parts: &[&str]| path.len() >= parts.len() && path.iter().zip(parts).all(|(a, b)| a == b);
    // A crate's name alone may be a variable's; a path through it is not.
    let whole = starts(&used.path, &parts) && (parts.len() > 1 || used.path.len() > 1);
    // `std::io::stdout` after `use std::io;` is written `io::stdout`.
    let short = parts.len() > 2 && starts(&used.path, &parts[1..]);
    // Everything of a module, `use std::time::*`, may be that.
    let all = used.path.last().is_some_and(|last| last == "*")
        && used.path.len() == parts.len()
        && starts(&parts_before_last(used), &parts[..parts.len() - 1]);
    whole || short || all
}

fn parts_before_last(used: &Use) -> Vec<String> {
    used.path[..used.path.len() - 1].to_vec()
}

/// Words, `::`, `*`, and other single signs; no comments, strings, characters or lifetimes.
fn tokens(text: &str) -> Vec<Token> {
    let chars: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let (mut at, mut line) = (0, 1);
    while at < chars.len() {
        let end = skip(&chars, at).unwrap_or(at);
        if end > at {
            line += chars[at..end].iter().filter(|c| **c == '\n').count();
            at = end;
        } else if chars[at].is_alphanumeric() || chars[at] == '_' {
            let end =
                (at..chars.len()).find(|i| !chars[*i].is_alphanumeric() && chars[*i] != '_').unwrap_or(chars.len());
            tokens.push(Token { text: chars[at..end].iter().collect(), line });
            at = end;
        } else {
            let double = chars[at] == ':' && chars.get(at + 1) == Some(&':');
            tokens.push(Token { text: if double { "::".into() } else { chars[at].to_string() }, line });
            at += if double { 2 } else { 1 };
        }
    }
    tokens
}

/// The end of the white space, comment, string, character or lifetime that starts at `at`, if one does.
fn skip(chars: &[char], at: usize) -> Option<usize> {
    let find =
        |from: usize, what: &[char]| (from..chars.len()).find(|i| chars[*i..].starts_with(what)).unwrap_or(chars.len());
    match (chars[at], chars.get(at + 1)) {
        (c, _) if c.is_whitespace() => Some(at + 1),
        ('/', Some('/')) => Some(find(at, &['\n'])),
        ('/', Some('*')) => Some(block_comment(chars, at)),
        ('r', Some('"' | '#')) if at == 0 || !is_word(chars[at - 1]) => raw_string(chars, at),
        ('"', _) => Some(quoted(chars, at, '"')),
        ('\'', Some('\\')) => Some(quoted(chars, at, '\'')),
        ('\'', Some(_)) if chars.get(at + 2) == Some(&'\'') => Some(at + 3),
        ('\'', Some(_)) => Some((at + 1..chars.len()).find(|i| !is_word(chars[*i])).unwrap_or(chars.len())),
        _ => None,
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn block_comment(chars: &[char], at: usize) -> usize {
    let (mut i, mut open) = (at, 0);
    while i < chars.len() {
        match (chars[i], chars.get(i + 1)) {
            ('/', Some('*')) => (open, i) = (open + 1, i + 2),
            ('*', Some('/')) => (open, i) = (open - 1, i + 2),
            _ => i += 1,
        }
        if open == 0 {
            break;
        }
    }
    i
}

fn quoted(chars: &[char], at: usize, quote: char) -> usize {
    let mut i = at + 1;
    while i < chars.len() && chars[i] != quote {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// `r"..."`, `r#"..."#`; `None` where it is a raw identifier such as `r#type`.
fn raw_string(chars: &[char], at: usize) -> Option<usize> {
    let hashes = chars[at + 1..].iter().take_while(|c| **c == '#').count();
    if chars.get(at + 1 + hashes) != Some(&'"') {
        return None;
    }
    let mut close = vec!['"'];
    close.extend(std::iter::repeat_n('#', hashes));
    let end = (at + 2 + hashes..chars.len()).find(|i| chars[*i..].starts_with(&close));
    Some(end.map_or(chars.len(), |end| end + close.len()))
}

/// Every path in a file that starts with a word and goes on with `::`, braces expanded.
fn uses(tokens: &[Token]) -> Vec<Use> {
    let mut found = Vec::new();
    let mut modules: Vec<bool> = Vec::new(); // for each open brace: is it a module's?
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at].text.as_str() {
            "{" => modules.push(at >= 2 && tokens[at - 2].text == "mod"),
            "}" => drop(modules.pop()),
            _ if starts_path(tokens, at) => {
                let depth = modules.iter().filter(|is_module| **is_module).count();
                let mut paths = Vec::new();
                let end = tree(tokens, at, &[], &mut paths);
                let paths = paths.into_iter().filter(|path| path.len() > 1);
                found.extend(paths.map(|path| Use { path, line: tokens[at].line, depth }));
                at = end;
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    found
}

fn starts_path(tokens: &[Token], at: usize) -> bool {
    let word = tokens[at].text.starts_with(is_word);
    let goes_on = tokens.get(at + 1).is_some_and(|next| next.text == "::");
    word && goes_on && (at == 0 || tokens[at - 1].text != "::")
}

/// Reads one use tree from `at`, adds its paths to `paths`, returns where it ends.
fn tree(tokens: &[Token], mut at: usize, prefix: &[String], paths: &mut Vec<Vec<String>>) -> usize {
    let text = |i: usize| tokens.get(i).map_or("", |token| token.text.as_str());
    let mut path = prefix.to_vec();
    loop {
        if text(at) == "{" {
            at += 1;
            while at < tokens.len() && text(at) != "}" {
                at = if text(at) == "," { at + 1 } else { tree(tokens, at, &path, paths) };
            }
            return at + 1;
        }
        if text(at) != "self" || path.is_empty() {
            path.push(text(at).to_string());
        }
        at += 1;
        let next = text(at + 1);
        if text(at) != "::" || !(next == "{" || next == "*" || next.starts_with(is_word)) {
            break;
        }
        at += 1;
    }
    if text(at) == "as" {
        at += 2;
    }
    paths.push(path);
    at
}

#[cfg(test)]
mod rules {
    use super::{MAX_LINES, Source, tokens, uses, violations};

    const LIB: &str =
        "//! The order.\npub mod mesh;\npub mod simplify;\npub mod config;\npub mod gltf;\npub mod command;\n";

    /// The violations of one file beside a small `lib.rs`.
    fn check(path: &str, body: &str) -> Vec<String> {
        let file = |path: &str, text: &str| Source { path: path.into(), text: text.into() };
        violations(&[file("src/lib.rs", LIB), file(path, &format!("//! A file.\n{body}"))])
    }

    fn fails(path: &str, body: &str, expected: &str) {
        let found = check(path, body);
        assert!(found.len() == 1 && found[0].contains(expected), "{expected:?} expected, got {found:?}");
    }

    #[test]
    fn upward_uses_pass() {
        assert!(check("src/gltf/read.rs", "use crate::mesh::Mesh;\nuse crate::{config, gltf::json};").is_empty());
        assert!(check("src/mesh/hash.rs", "use super::Mesh;\nmod tests { use super::super::Mesh; }").is_empty());
    }

    #[test]
    fn downward_uses_fail_with_file_and_line() {
        fails("src/mesh/hash.rs", "\nuse crate::simplify::Queue;", "src/mesh/hash.rs:3: `mesh` uses `simplify`");
        fails("src/mesh/mod.rs", "use crate::{\n    mesh,\n    gltf::read,\n};", "`mesh` uses `gltf`");
        fails("src/simplify/mod.rs", "fn f() { crate::command::run() }", "`simplify` uses `command`");
    }

    #[test]
    fn downward_uses_through_super_fail() {
        fails("src/mesh/hash.rs", "use super::super::gltf::read;", "`mesh` uses `gltf`");
        fails("src/mesh/mod.rs", "mod tests { use super::super::gltf::read; }", "`mesh` uses `gltf`");
    }

    #[test]
    fn unlisted_modules_fail() {
        fails("src/helpers.rs", "", "module `helpers` is not in src/lib.rs");
    }

    #[test]
    fn comments_and_strings_do_not_count() {
        let body = "// crate::gltf::read\n/* crate::gltf /* nested */ */\nconst A: &str = \"crate::gltf::x\\\"\";\nconst B: &str = r#\"crate::gltf::\"x\"#;\nconst C: char = '\"';\nfn f<'a>(x: &'a str) {}";
        assert!(check("src/mesh/mod.rs", body).is_empty());
        fails(
            "src/mesh/mod.rs",
            "const C: char = '\"'; use crate::gltf::x; const D: char = '\\'';",
            "`mesh` uses `gltf`",
        );
    }

    #[test]
    fn crates_stay_in_their_rooms() {
        fails("src/mesh/mod.rs", "use meshopt::ffi;", "`meshopt` belongs to gltf, lod");
        fails("src/config.rs", "use anyhow::Context;", "`anyhow` belongs to command, cli");
        assert!(check("src/gltf/decode.rs", "use meshopt::ffi;").is_empty());
        assert!(check("src/command/bake.rs", "use anyhow::Context;").is_empty());
    }

    #[test]
    fn pure_modules_touch_no_world() {
        fails("src/mesh/mod.rs", "fn f() { std::fs::read(\"a\") }", "may not use `std::fs`");
        fails("src/mesh/mod.rs", "use std::{fmt, fs::File};", "may not use `std::fs`");
        fails("src/simplify/mod.rs", "use std::time::{Duration, Instant};", "may not use `std::time::Instant`");
        fails(
            "src/simplify/mod.rs",
            "use std::time;\nfn f() { time::SystemTime::now(); }",
            "may not use `std::time::SystemTime`",
        );
        assert!(check("src/gltf/mod.rs", "use std::fs;").is_empty());
        assert!(check("src/mesh/mod.rs", "use std::time::Duration;").is_empty());
    }

    #[test]
    fn nothing_prints_below_command() {
        fails("src/gltf/mod.rs", "fn f() { eprintln!(\"x\"); }", "src/gltf/mod.rs:2: `eprintln!` in `gltf`");
        fails("src/gltf/mod.rs", "use std::io;\nfn f() { io::stdout(); }", "`std::io::stdout` in `gltf`");
        assert!(check("src/command/bake.rs", "fn f() { println!(\"x\"); }").is_empty());
    }

    #[test]
    fn files_say_their_purpose_and_stay_short() {
        let source = Source { path: "src/mesh/mod.rs".into(), text: "use std::fmt;".into() };
        let lib = Source { path: "src/lib.rs".into(), text: LIB.into() };
        assert!(violations(&[lib, source])[0].contains("does not open with `//!`"));
        fails("src/mesh/mod.rs", &"\n".repeat(MAX_LINES), "split it by noun");
    }

    #[test]
    fn use_trees_expand() {
        let expand = |text: &str| uses(&tokens(text)).into_iter().map(|used| used.path.join("::")).collect::<Vec<_>>();
        assert_eq!(
            expand("use crate::{a, b::{self, c as d}, e::*};"),
            ["crate::a", "crate::b", "crate::b::c", "crate::e::*"]
        );
        assert_eq!(expand("x.y::<f64>(); Vec::<u8>::new();"), Vec::<String>::new(), "turbofish is no path");
    }
}
