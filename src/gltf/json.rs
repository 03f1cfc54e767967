//! Careful look-ups in JSON values: any shape is answered with a value or with an error that names the place,
//! never with a panic. Knows nothing of glTF but its habit of integers written as floats.
//!
//! `place` is the JSON place of the object that is asked, such as `nodes[3]`; it is only written out on an error, so
//! pass `format_args!("nodes[{i}]")` in loops.

use super::error::{DocumentError, Problem};
use serde_json::{Map, Value};
use std::fmt::Display;

/// The JSON type of a value, with its article.
pub fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

fn mismatch(place: impl Display, key: &str, expected: &'static str, found: &Value) -> DocumentError {
    let problem = Problem::Type { expected, found: type_name(found) };
    DocumentError::new(format_args!("{place}.{key}"), problem)
}

/// A non-negative integer, also one written as a float (`2.0`).
pub fn integer(value: &Value) -> Option<u64> {
    value.as_u64().or_else(|| {
        let float = value.as_f64()?;
        // 2⁵³: above it a float no longer names one integer.
        ((0.0..=9007199254740992.0).contains(&float) && float.fract() == 0.0).then_some(float as u64)
    })
}

/// `value` as an object.
pub fn object(value: &Value, place: impl Display) -> Result<&Map<String, Value>, DocumentError> {
    value
        .as_object()
        .ok_or_else(|| DocumentError::new(place, Problem::Type { expected: "an object", found: type_name(value) }))
}

/// The non-negative integer `key` of the object `value`.
pub fn uint(value: &Value, key: &str, place: impl Display) -> Result<Option<u64>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    integer(found).map(Some).ok_or_else(|| mismatch(place, key, "a non-negative integer", found))
}

/// The reference `key` of the object `value`: an index into an array of the document.
pub fn index(value: &Value, key: &str, place: impl Display) -> Result<Option<usize>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    let number = integer(found).and_then(|n| usize::try_from(n).ok());
    number.map(Some).ok_or_else(|| mismatch(place, key, "an index", found))
}

/// The finite number `key` of the object `value`.
pub fn number(value: &Value, key: &str, place: impl Display) -> Result<Option<f64>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    found.as_f64().map(Some).ok_or_else(|| mismatch(place, key, "a number", found))
}

/// The text `key` of the object `value`.
pub fn string<'a>(value: &'a Value, key: &str, place: impl Display) -> Result<Option<&'a str>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    found.as_str().map(Some).ok_or_else(|| mismatch(place, key, "a string", found))
}

/// The truth value `key` of the object `value`.
pub fn boolean(value: &Value, key: &str, place: impl Display) -> Result<Option<bool>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    found.as_bool().map(Some).ok_or_else(|| mismatch(place, key, "a boolean", found))
}

/// The array `key` of the object `value`; empty if absent.
pub fn array<'a>(value: &'a Value, key: &str, place: impl Display) -> Result<&'a [Value], DocumentError> {
    let Some(found) = value.get(key) else { return Ok(&[]) };
    found.as_array().map(Vec::as_slice).ok_or_else(|| mismatch(place, key, "an array", found))
}

/// The object `key` of the object `value`.
pub fn child<'a>(value: &'a Value, key: &str, place: impl Display) -> Result<Option<&'a Value>, DocumentError> {
    let Some(found) = value.get(key) else { return Ok(None) };
    if found.is_object() { Ok(Some(found)) } else { Err(mismatch(place, key, "an object", found)) }
}

/// The object of extension `name` on `value`; `None` if there is none or it is no object.
pub fn extension<'a>(value: &'a Value, name: &str) -> Option<&'a Value> {
    value.get("extensions")?.get(name).filter(|e| e.is_object())
}
