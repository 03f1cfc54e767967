//! Addresses in a document: data URIs, and paths relative to the scene. Reads no files but asks whether one exists.

use super::error::{DocumentError, Problem};
use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Exporters disagree about padding, and some leave stray bits in the last digit.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_allow_trailing_bits(true)
        .with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// What an address is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `data:…`: the bytes are in the document.
    Data,
    /// A path relative to the scene.
    Relative,
    /// A path from the root, a drive, or another scheme (`http:`, `file:`).
    Absolute,
}

/// Tells the forms apart without looking at the disk.
pub fn form(uri: &str) -> Form {
    if uri.get(..5).is_some_and(|s| s.eq_ignore_ascii_case("data:")) {
        return Form::Data;
    }
    let scheme = uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    if scheme || uri.starts_with(['/', '\\']) { Form::Absolute } else { Form::Relative }
}

/// The file a relative address names, below or beside `base`, the scene's folder. Unencoded spaces and backslashes
/// are common and understood; a name that exists only as written, percent signs included, is taken as written.
pub fn resolve(uri: &str, base: &Path, place: impl Display) -> Result<PathBuf, DocumentError> {
    let refuse = |reason: &str| {
        let problem = Problem::Uri { uri: shorten(uri), reason: reason.to_owned() };
        Err(DocumentError::new(&place, problem))
    };
    if form(uri) != Form::Relative {
        return refuse("is not relative to the scene");
    }
    let Ok(decoded) = percent_decode_str(uri).decode_utf8() else {
        return refuse("is not UTF-8 when percent-decoded");
    };
    // Decoding may bring out what the check above could not see: `%2Fetc`.
    if decoded.is_empty() || decoded.contains('\0') || form(&decoded) != Form::Relative {
        return refuse("does not name a file beside the scene");
    }
    let as_path = |text: Cow<'_, str>| base.join(text.replace('\\', "/"));
    let path = as_path(decoded);
    if uri.contains('%') && !path.exists() {
        let literal = as_path(Cow::Borrowed(uri));
        if literal.exists() {
            return Ok(literal);
        }
    }
    Ok(path)
}

/// The bytes of a data URI.
pub fn decode_data(uri: &str, place: impl Display) -> Result<Vec<u8>, DocumentError> {
    let refuse = |reason: String| DocumentError::new(&place, Problem::Uri { uri: shorten(uri), reason });
    let (header, data) = uri.split_once(',').ok_or_else(|| refuse("has no comma before its data".to_owned()))?;
    let base64 = header.rsplit(';').next().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
    let plain: Cow<'_, [u8]> =
        if data.contains('%') || !base64 { percent_decode_str(data).into() } else { Cow::Borrowed(data.as_bytes()) };
    if !base64 {
        return Ok(plain.into_owned());
    }
    let white = plain.iter().any(u8::is_ascii_whitespace);
    let digits =
        if white { Cow::Owned(plain.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect()) } else { plain };
    BASE64.decode(&digits[..]).map_err(|e| refuse(format!("is not valid base64: {}", lowercase(&e.to_string()))))
}

/// For messages: data URIs may have megabytes.
pub fn shorten(uri: &str) -> String {
    const LONGEST: usize = 60;
    if uri.chars().count() <= LONGEST {
        return uri.to_owned();
    }
    uri.chars().take(LONGEST - 1).chain(['…']).collect()
}

fn lowercase(words: &str) -> String {
    let mut chars = words.trim_end_matches('.').chars();
    chars.next().map(|first| first.to_lowercase().chain(chars).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms() {
        for uri in ["a.bin", "dir/a b.bin", "../a%20b.bin", "./x", "a/b:c.bin", "ünï.bin", ""] {
            assert_eq!(form(uri), Form::Relative, "{uri}");
        }
        for uri in ["/etc/x", "\\\\host\\x", "C:\\x.bin", "file:///x", "http://x/y", "blob:1"] {
            assert_eq!(form(uri), Form::Absolute, "{uri}");
        }
        assert_eq!(form("DATA:,x"), Form::Data);
    }

    #[test]
    fn relative_addresses_are_decoded() {
        let base = Path::new("scenes/street");
        let path = |uri| resolve(uri, base, "buffers[0].uri").unwrap();
        assert_eq!(path("a%20b.bin"), base.join("a b.bin"));
        assert_eq!(path("a b.bin"), base.join("a b.bin"));
        assert_eq!(path("tex\\a.png"), base.join("tex/a.png"));
        assert_eq!(path("../shared/x.bin"), base.join("../shared/x.bin"));
        for uri in ["", "/etc/passwd", "%2Fetc%2Fpasswd", "http://x", "file:x", "a%00b", "a%FFb", "c%3Ax"] {
            let words = resolve(uri, base, "buffers[0].uri").unwrap_err().to_string();
            assert!(words.starts_with(&format!("buffers[0].uri: uri `{uri}` ")), "{words}");
        }
    }

    #[test]
    fn data() {
        let decode = |uri| decode_data(uri, "images[1].uri");
        assert_eq!(decode("data:application/octet-stream;base64,AQID").unwrap(), [1, 2, 3]);
        assert_eq!(decode("data:;base64,AQ").unwrap(), [1]);
        assert_eq!(decode("data:;base64,AQ%3D%3D").unwrap(), [1]);
        assert_eq!(decode("data:;base64,A\nQ = =").unwrap(), [1]);
        assert_eq!(decode("data:text/plain,a%20b").unwrap(), b"a b");
        assert_eq!(decode("data:").unwrap_err().to_string(), "images[1].uri: uri `data:` has no comma before its data");
        assert!(decode("data:;base64,A*ID").unwrap_err().to_string().contains("is not valid base64: invalid symbol"));
        let long = format!("data:;base64,{}", "*".repeat(100_000));
        assert!(decode(&long).unwrap_err().to_string().len() < 200);
    }
}
