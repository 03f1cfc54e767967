//! Looks over OBJ and MTL text before the parser sees it.
//!
//! The parser multiplies indices before it compares them and insists on three numbers of a colour: what would
//! overflow or panic there is refused here, with the line.

/// What is wrong with an OBJ file, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {kind} {index} is out of range (there are {count})")]
pub struct OutOfRange {
    /// From 1.
    line: usize,
    /// `vertex`, `texture coordinate` or `normal`.
    kind: &'static str,
    /// As written: from 1, or negative and counted back.
    index: i64,
    /// How many there are; for negative ones up to that line.
    count: i64,
}

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Do all faces and lines refer to something in the file? Words that are no numbers are left to the parser.
pub fn check_references(text: &str) -> Result<(), OutOfRange> {
    let mut counts = [0i64; 3];
    // The largest index of each kind and its line: positive ones may refer to what only follows.
    let mut largest = [(0i64, 0usize); 3];
    for (number, line) in (1..).zip(text.lines()) {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f" | "l") => {
                for (kind, index) in words.flat_map(|word| (0..3).zip(word.split('/'))) {
                    let Ok(index) = index.parse::<i64>() else { continue };
                    if index < 0 && index < -counts[kind] {
                        return Err(OutOfRange { line: number, kind: KINDS[kind], index, count: counts[kind] });
                    }
                    if index > largest[kind].0 {
                        largest[kind] = (index, number);
                    }
                }
            }
            _ => {}
        }
    }
    for kind in 0..3 {
        let (index, line) = largest[kind];
        // Without any texture coordinates or normals, indices of them are ignored; real files have such.
        if index > counts[kind] && (kind == 0 || counts[kind] > 0 || index > i64::from(u32::MAX)) {
            return Err(OutOfRange { line, kind: KINDS[kind], index, count: counts[kind] });
        }
    }
    Ok(())
}

/// The first line of an MTL file that names a colour by fewer than three words.
pub fn short_colour(text: &str) -> Option<usize> {
    let is_short = |line: &str| {
        let mut words = line.split_whitespace();
        matches!(words.next(), Some("Ka" | "Kd" | "Ks" | "Ke")) && words.count() < 3
    };
    text.lines().position(is_short).map(|at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references() {
        let check = |faces: &str| {
            let text = format!("v 0 0 0\nv 1 0 0\nvn 0 0 1\n{faces}v 0 1 0\n");
            check_references(&text).map_err(|e| e.to_string())
        };
        assert_eq!(check("f 1/7/1 2//-1 3\n"), Ok(()));
        assert_eq!(check("f -1 -2 1\nl 1 2\nf a/b/c x\n"), Ok(()));
        assert_eq!(check("f 1 2 4\n"), Err("line 4: vertex 4 is out of range (there are 3)".to_owned()));
        assert_eq!(check("\nf 1 2 -3\n"), Err("line 5: vertex -3 is out of range (there are 2)".to_owned()));
        assert_eq!(check("f 1//2 2 3\n"), Err("line 4: normal 2 is out of range (there are 1)".to_owned()));
        assert_eq!(
            check("f 1/-1 2 3\n"),
            Err("line 4: texture coordinate -1 is out of range (there are 0)".to_owned())
        );
        assert!(check("f 9223372036854775807 2 3\n").is_err());
        assert!(check("f -9223372036854775808 2 3\n").is_err());
        assert!(check("f 1/9223372036854775807 2 3\n").is_err());
    }

    #[test]
    fn colours() {
        assert_eq!(short_colour("newmtl a\nKd 1 1 1\nd 1\n"), None);
        assert_eq!(short_colour("newmtl a\nKd 1 1\n"), Some(2));
        assert_eq!(short_colour("Ke"), Some(1));
    }
}
