//! The words of a competitor's command, with places for file names and targets. Runs nothing.

use std::path::Path;

/// What a word may hold between braces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placeholder {
    /// The source.
    In,
    /// The file to write.
    Out,
    /// Share of the triangles.
    Ratio,
    /// Number of triangles.
    Triangles,
}

impl Placeholder {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::In, Self::Out, Self::Ratio, Self::Triangles];

    /// Between the braces.
    pub fn name(self) -> &'static str {
        match self {
            Self::In => "in",
            Self::Out => "out",
            Self::Ratio => "ratio",
            Self::Triangles => "triangles",
        }
    }
}

/// A command with placeholders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Template(Vec<Vec<Piece>>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    Place(Placeholder),
}

/// What placeholders stand for in one run.
#[derive(Clone, Copy, Debug)]
pub struct Values<'a> {
    /// The source.
    pub source: &'a Path,
    /// The file to write.
    pub out: &'a Path,
    /// Share of the triangles.
    pub ratio: f64,
    /// Number of triangles.
    pub triangles: u64,
}

impl Template {
    /// The error is the name of a placeholder that does not exist.
    pub fn new(words: &[String]) -> Result<Self, String> {
        words.iter().map(|word| pieces(word)).collect::<Result<_, _>>().map(Self)
    }

    /// The first word, if it is plain.
    pub fn program(&self) -> Option<&str> {
        match self.0.first()?.as_slice() {
            [Piece::Text(text)] => Some(text),
            _ => None,
        }
    }

    /// Does a word hold it?
    pub fn has(&self, placeholder: Placeholder) -> bool {
        self.0.iter().flatten().any(|piece| *piece == Piece::Place(placeholder))
    }

    /// The words of one run.
    pub fn fill(&self, values: Values<'_>) -> Vec<std::ffi::OsString> {
        let word = |pieces: &Vec<Piece>| {
            let mut word = std::ffi::OsString::new();
            for piece in pieces {
                match piece {
                    Piece::Text(text) => word.push(text),
                    Piece::Place(Placeholder::In) => word.push(values.source),
                    Piece::Place(Placeholder::Out) => word.push(values.out),
                    Piece::Place(Placeholder::Ratio) => word.push(values.ratio.to_string()),
                    Piece::Place(Placeholder::Triangles) => word.push(values.triangles.to_string()),
                }
            }
            word
        };
        self.0.iter().map(word).collect()
    }
}

/// As written in the file.
impl std::fmt::Display for Template {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, word) in self.0.iter().enumerate() {
            f.write_str(if i == 0 { "" } else { " " })?;
            for piece in word {
                match piece {
                    Piece::Text(text) => f.write_str(text)?,
                    Piece::Place(place) => write!(f, "{{{}}}", place.name())?,
                }
            }
        }
        Ok(())
    }
}

/// `a{in}b` is text, a placeholder, text. A brace that opens no name is text.
fn pieces(word: &str) -> Result<Vec<Piece>, String> {
    let mut pieces = Vec::new();
    let mut rest = word;
    while let Some((before, after)) = rest.split_once('{') {
        let Some((name, behind)) = after.split_once('}') else { break };
        if !before.is_empty() {
            pieces.push(Piece::Text(before.to_owned()));
        }
        let known = Placeholder::ALL.into_iter().find(|p| p.name() == name);
        pieces.push(Piece::Place(known.ok_or_else(|| name.to_owned())?));
        rest = behind;
    }
    if !rest.is_empty() {
        pieces.push(Piece::Text(rest.to_owned()));
    }
    Ok(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn template(line: &str) -> Template {
        Template::new(&line.split(' ').map(str::to_owned).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn words_are_filled_and_stay_words() {
        let template = template("tool -i {in} --out={out} -r {ratio}:{triangles} {");
        assert_eq!(template.program(), Some("tool"));
        let values =
            Values { source: Path::new("a b.glb"), out: Path::new("/c d/e.glb"), ratio: 0.25, triangles: 1234 };
        let filled = template.fill(values);
        assert_eq!(filled, ["tool", "-i", "a b.glb", "--out=/c d/e.glb", "-r", "0.25:1234", "{"]);
        assert_eq!(template.to_string(), "tool -i {in} --out={out} -r {ratio}:{triangles} {");
        assert!(template.has(Placeholder::Ratio) && !self::template("a {in}").has(Placeholder::Out));
    }

    #[test]
    fn unknown_placeholders_are_named() {
        assert_eq!(Template::new(&["x".into(), "{rato}".into()]), Err("rato".to_owned()));
    }
}
