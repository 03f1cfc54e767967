//! Checks a TOML document against a schema: unknown keys and names, wrong kinds, values out of range, absent keys.
//!
//! The schema is the one that editors get, so that an editor and lodbake never disagree. Knows no key by name.

use std::ops::Range;

use serde::de::DeserializeOwned;
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{ConfigError, Names, Place, Step};

/// A parsed document that remembers where everything stands.
pub struct Document<'a> {
    file: &'a str,
    text: &'a str,
    root: Spanned<DeTable<'a>>,
    schema: &'a Value,
}

impl<'a> Document<'a> {
    /// Parses and checks `text`; `file` is named in errors.
    pub fn parse(file: &'a str, text: &'a str, schema: &'a Value) -> Result<Self, ConfigError> {
        let root = DeTable::parse(text).map_err(|error| syntax(file, text, &error))?;
        let document = Self { file, text, root, schema };
        document.check_table(document.root.get_ref(), document.root.span(), schema, &Place::default())?;
        Ok(document)
    }

    /// The typed form.
    pub fn typed<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        let deserializer = toml::de::Deserializer::from(self.root.clone());
        T::deserialize(deserializer).map_err(|error| syntax(self.file, self.text, &error))
    }

    /// An error about the value at `place`; the line is that of the innermost part of `place` that exists.
    pub fn invalid(&self, place: &Place, cause: impl Into<String>) -> ConfigError {
        let line = self.line(&self.span(place));
        ConfigError::Invalid { file: self.file.to_owned(), line, place: place.clone(), cause: cause.into() }
    }

    /// The line of the value at `place`, from 1.
    pub fn line_of(&self, place: &Place) -> usize {
        self.line(&self.span(place))
    }

    fn span(&self, place: &Place) -> Range<usize> {
        let mut table = Some(self.root.get_ref());
        let mut array = None;
        let mut span = self.root.span();
        for step in place.steps() {
            let next = match step {
                Step::Key(key) => table.and_then(|t| t.get(key.as_str())),
                Step::Index(index) => array.and_then(|a: &toml::de::DeArray<'_>| a.get(*index)),
            };
            let Some(next) = next else { break };
            span = next.span();
            table = next.get_ref().as_table();
            array = next.get_ref().as_array();
        }
        span
    }

    fn line(&self, span: &Range<usize>) -> usize {
        line(self.text, span)
    }

    /// Follows `$ref`; the referring schema's own ranges stay with the caller.
    fn target<'s>(&'s self, schema: &'s Value) -> &'s Value {
        schema
            .get("$ref")
            .and_then(Value::as_str)
            .and_then(|reference| self.schema.pointer(reference.trim_start_matches('#')))
            .unwrap_or(schema)
    }

    fn check_table(
        &self,
        table: &DeTable<'_>,
        span: Range<usize>,
        schema: &Value,
        place: &Place,
    ) -> Result<(), ConfigError> {
        let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return Ok(()) };
        for (key, value) in table {
            let name: &str = key.get_ref();
            let place = place.key(name);
            let Some(property) = properties.get(name) else {
                return Err(ConfigError::UnknownKey {
                    file: self.file.to_owned(),
                    line: self.line(&key.span()),
                    place,
                    names: Box::new(Names::near(name, properties.keys().cloned().collect())),
                    belongs_to: self.table_with(name),
                });
            };
            self.check_value(value, property, &place)?;
        }
        let required = schema.get("required").and_then(Value::as_array).into_iter().flatten();
        for key in required.filter_map(Value::as_str) {
            if !table.contains_key(key) {
                let line = self.line(&span);
                return Err(ConfigError::Missing { file: self.file.to_owned(), line, place: place.key(key) });
            }
        }
        Ok(())
    }

    fn check_value(&self, value: &Spanned<DeValue<'_>>, schema: &Value, place: &Place) -> Result<(), ConfigError> {
        let schema = self.target(schema);
        if let Some(cases) = schema.get("anyOf").and_then(Value::as_array) {
            return match cases.iter().find(|case| kind_fits(value.get_ref(), self.target(case))) {
                Some(case) => self.check_value(value, case, place),
                None => Err(self.wrong_kind(value, cases, place)),
            };
        }
        if !kind_fits(value.get_ref(), schema) {
            return Err(self.wrong_kind(value, std::slice::from_ref(schema), place));
        }
        match value.get_ref() {
            DeValue::Table(table) => self.check_table(table, value.span(), schema, place),
            DeValue::Array(array) => {
                self.check_range(value, array.len() as f64, schema, place)?;
                let items = schema.get("items").unwrap_or(&Value::Null);
                array.iter().enumerate().try_for_each(|(i, item)| self.check_value(item, items, &place.index(i)))
            }
            DeValue::String(text) => {
                self.check_name(value, text, schema, place)?;
                self.check_range(value, text.chars().count() as f64, schema, place)
            }
            DeValue::Integer(_) | DeValue::Float(_) => {
                let number = number(value.get_ref()).unwrap_or(f64::NAN);
                self.check_range(value, number, schema, place)
            }
            DeValue::Boolean(_) | DeValue::Datetime(_) => Ok(()),
        }
    }

    /// A string against the closed list of names, if its schema has one.
    fn check_name(
        &self,
        value: &Spanned<DeValue<'_>>,
        text: &str,
        schema: &Value,
        place: &Place,
    ) -> Result<(), ConfigError> {
        let known: Vec<String> = schema
            .get("oneOf")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(|case| case.get("const")?.as_str().map(str::to_owned))
            .collect();
        if known.is_empty() || known.iter().any(|name| name == text) {
            return Ok(());
        }
        Err(ConfigError::UnknownValue {
            file: self.file.to_owned(),
            line: self.line(&value.span()),
            place: place.clone(),
            value: text.to_owned(),
            names: Box::new(Names::near(text, known)),
        })
    }

    /// A number, or the length of a string or list, against the schema's bounds.
    fn check_range(
        &self,
        value: &Spanned<DeValue<'_>>,
        number: f64,
        schema: &Value,
        place: &Place,
    ) -> Result<(), ConfigError> {
        let bounds = Bounds::of(schema, value.get_ref(), number);
        if bounds.contain(number) {
            return Ok(());
        }
        let range = if number.is_finite() { bounds.to_string() } else { format!("finite, and {bounds}") };
        match value.get_ref() {
            DeValue::Array(_) => Err(self.invalid(place, format!("has {number} entries: must have {range}"))),
            DeValue::String(_) => Err(self.invalid(place, "is empty".to_owned())),
            _ => Err(ConfigError::OutOfRange {
                file: self.file.to_owned(),
                line: self.line(&value.span()),
                place: place.clone(),
                value: self.text.get(value.span()).unwrap_or_default().to_owned(),
                range,
            }),
        }
    }

    fn wrong_kind(&self, value: &Spanned<DeValue<'_>>, cases: &[Value], place: &Place) -> ConfigError {
        let expected: Vec<&str> = cases.iter().map(|case| kind_in_words(self.target(case))).collect();
        let found = match (value.get_ref(), cases) {
            (DeValue::Table(_), [list]) if list.get("type").is_some_and(|kind| kind == "array") => {
                format!("a table: write `[[{place}]]`")
            }
            (value, _) => found_in_words(value).to_owned(),
        };
        self.invalid(place, format!("must be {}, not {found}", expected.join(" or ")))
    }

    /// The table that has a key of that name: "" is the top of the file. A frequent slip, as a key that stands after
    /// a `[table]` header belongs to that table.
    fn table_with(&self, name: &str) -> Option<String> {
        let top = self.schema.get("properties")?.as_object()?;
        if top.contains_key(name) {
            return Some(String::new());
        }
        let has = |schema: &Value| self.target(schema).pointer("/properties").is_some_and(|p| p.get(name).is_some());
        top.iter().find_map(|(table, schema)| match schema.get("items") {
            Some(items) => has(items).then(|| format!("[{table}]")),
            None => has(schema).then(|| table.clone()),
        })
    }
}

fn syntax(file: &str, text: &str, error: &toml::de::Error) -> ConfigError {
    let line = error.span().map_or(1, |span| line(text, &span));
    let mut cause = error.message().trim().replace('\n', ", ");
    if cause == "duplicate key"
        && let Some(key) = error.span().and_then(|span| text.get(span))
    {
        cause = format!("{cause} `{key}`");
    }
    ConfigError::Syntax { file: file.to_owned(), line, cause }
}

/// Counted from 1.
fn line(text: &str, span: &Range<usize>) -> usize {
    1 + text.as_bytes().iter().take(span.start).filter(|&&byte| byte == b'\n').count()
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix()).ok().map(|i| i as f64),
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

fn kind_fits(value: &DeValue<'_>, schema: &Value) -> bool {
    match schema.get("type").and_then(Value::as_str) {
        Some("string") => value.is_str(),
        Some("boolean") => value.is_bool(),
        Some("integer") => value.is_integer(),
        Some("number") => value.is_integer() || value.is_float(),
        Some("array") => value.is_array(),
        Some("object") => value.is_table(),
        _ if schema.get("oneOf").is_some() => value.is_str(),
        _ => true,
    }
}

fn kind_in_words(schema: &Value) -> &'static str {
    match schema.get("type").and_then(Value::as_str) {
        Some("boolean") => "`true` or `false`",
        Some("integer") => "a whole number",
        Some("number") => "a number",
        Some("array") => "a list",
        Some("object") => "a table",
        _ => "a string",
    }
}

fn found_in_words(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) => "a number",
        DeValue::Float(_) => "a number with a point",
        DeValue::Boolean(_) => "`true` or `false`",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// The bounds that a schema sets for a number or a length.
#[derive(Default)]
struct Bounds {
    min: Option<f64>,
    max: Option<f64>,
    more_than: Option<f64>,
    less_than: Option<f64>,
}

impl Bounds {
    fn of(schema: &Value, value: &DeValue<'_>, number: f64) -> Self {
        let get = |key: &str| schema.get(key).and_then(Value::as_f64);
        match value {
            DeValue::Array(_) => Self { min: get("minItems"), max: get("maxItems"), ..Self::default() },
            DeValue::String(_) => Self { min: get("minLength"), ..Self::default() },
            _ => {
                // Named only to those who reach it.
                let widest = Some(f64::from(u32::MAX))
                    .filter(|&widest| schema.get("format").is_some_and(|f| f == "uint32") && number > widest);
                Self {
                    min: get("minimum"),
                    max: get("maximum").or(widest),
                    more_than: get("exclusiveMinimum"),
                    less_than: get("exclusiveMaximum"),
                }
            }
        }
    }

    fn contain(&self, number: f64) -> bool {
        number.is_finite()
            && self.min.is_none_or(|min| number >= min)
            && self.max.is_none_or(|max| number <= max)
            && self.more_than.is_none_or(|limit| number > limit)
            && self.less_than.is_none_or(|limit| number < limit)
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.min, self.more_than, self.max, self.less_than) {
            (_, Some(low), _, Some(high)) => write!(f, "between {low} and {high}, exclusive"),
            (_, Some(low), Some(high), _) => write!(f, "more than {low} and at most {high}"),
            (Some(low), _, Some(high), _) => write!(f, "between {low} and {high}, both inclusive"),
            (_, Some(low), None, None) => write!(f, "more than {low}"),
            (Some(low), None, None, _) => write!(f, "{low} or more"),
            _ => f.write_str("a finite number"),
        }
    }
}
