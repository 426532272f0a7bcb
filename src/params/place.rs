//! A JSON document read key by key, so that every complaint names its place: `axes[0].white.density`.
//!
//! Keys that are not known are refused by name, keys that stand twice are refused by the parser.

use std::path::Path;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::units::plain;

/// What is wrong at one place of a document.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct KeyError {
    pub key: String,
    pub message: String,
}

/// Text that is not JSON.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: not valid JSON: {message}")]
pub struct SyntaxError {
    pub line: usize,
    pub column: usize,
    pub message: String,
}

/// A document that cannot be used; the key is the path inside it.
#[derive(Clone, Debug, thiserror::Error)]
pub enum DocumentError {
    #[error("{path}: cannot read: {reason}")]
    Read { path: String, reason: String },
    #[error("{path}: {error}")]
    Syntax { path: String, error: SyntaxError },
    #[error("{path}: {error}")]
    Key { path: String, error: KeyError },
}

/// A document from its text by the reader of its root; every complaint names `path` and the key.
pub fn document<T>(
    text: &str,
    path: &str,
    read: impl FnOnce(&Place<'_>) -> Result<T, KeyError>,
) -> Result<T, DocumentError> {
    let value = parse(text).map_err(|error| DocumentError::Syntax { path: path.into(), error })?;
    read(&Place::root(&value)).map_err(|error| DocumentError::Key { path: path.into(), error })
}

/// The same from a file.
pub fn read<T>(path: &Path, read: impl FnOnce(&Place<'_>) -> Result<T, KeyError>) -> Result<T, DocumentError> {
    let (text, shown) = file(path)?;
    document(&text, &shown, read)
}

/// The text of a file and its path as messages show it. Errors: it cannot be read.
pub fn file(path: &Path) -> Result<(String, String), DocumentError> {
    let shown = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => Ok((text, shown)),
        Err(e) => Err(DocumentError::Read { path: shown, reason: e.to_string() }),
    }
}

/// Parse JSON in which no object has a key twice. Its keys and texts are [`plain`] from here on.
pub fn parse(text: &str) -> Result<Value, SyntaxError> {
    let text = text.trim_start_matches('\u{feff}');
    serde_json::from_str::<Strict>(text).map(|strict| strict.0).map_err(|error| SyntaxError {
        line: error.line(),
        column: error.column(),
        message: in_words(&error),
    })
}

/// What the parser says, without its place and its own jargon.
fn in_words(error: &serde_json::Error) -> String {
    let said = error.to_string();
    match said.split(" at line ").next().unwrap_or_default() {
        _ if error.is_eof() => "the text ends too early: a bracket or a quotation mark is not closed".into(),
        "expected ident" | "expected value" => {
            "expected a number, a text in quotation marks, true, false, null, a list or an object".into()
        }
        "trailing characters" => "something follows the end of the document".into(),
        "key must be a string" => "a key stands in quotation marks".into(),
        other => other.to_string(),
    }
}

/// `did you mean 'x'? `, where a known name is near the one that was found; else nothing.
pub fn meant<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    nearest(found, &known).map(|name| format!("did you mean '{name}'? ")).unwrap_or_default()
}

/// A value and where it stands.
#[derive(Clone, Debug)]
pub struct Place<'a> {
    key: String,
    value: &'a Value,
}

/// An object all of whose keys are known.
#[derive(Clone, Debug)]
pub struct Object<'a> {
    key: String,
    map: &'a Map<String, Value>,
}

impl<'a> Place<'a> {
    /// The whole document.
    pub fn root(value: &'a Value) -> Place<'a> {
        Place::at("", value)
    }
    /// A value that stands at `key` of a larger document.
    pub fn at(key: &str, value: &'a Value) -> Place<'a> {
        Place { key: key.to_string(), value }
    }
    pub fn key(&self) -> &str {
        if self.key.is_empty() { "document" } else { &self.key }
    }
    pub fn value(&self) -> &'a Value {
        self.value
    }
    pub fn error(&self, message: impl Into<String>) -> KeyError {
        KeyError { key: self.key().to_string(), message: message.into() }
    }
    /// An object with no other keys than these.
    pub fn object(&self, known: &[&str]) -> Result<Object<'a>, KeyError> {
        let Value::Object(map) = self.value else {
            return Err(self.error(format!(
                "expected an object with {}, found {}",
                known.join(", "),
                describe(self.value)
            )));
        };
        let object = Object { key: self.key.clone(), map };
        if let Some(unknown) = map.keys().find(|k| !known.contains(&k.as_str())) {
            let meant = meant(unknown, known.iter().copied());
            let message = format!("unknown key; {meant}known here: {}", known.join(", "));
            return Err(KeyError { key: object.path(unknown), message });
        }
        Ok(object)
    }
    /// The elements of a list.
    pub fn list(&self) -> Result<Vec<Place<'a>>, KeyError> {
        let Value::Array(values) = self.value else {
            return Err(self.error(format!("expected a list, found {}", describe(self.value))));
        };
        Ok(values.iter().enumerate().map(|(i, v)| Place { key: format!("{}[{i}]", self.key), value: v }).collect())
    }
    /// The elements of a list, or the one object that stands for a list of one; what is neither stands for itself, so
    /// that its reader says what it expects.
    pub fn one_or_many(&self) -> Result<Vec<Place<'a>>, KeyError> {
        if self.value.is_array() { self.list() } else { Ok(vec![self.clone()]) }
    }
    /// The entries of an object with any keys.
    pub fn entries(&self) -> Result<Vec<(&'a str, Place<'a>)>, KeyError> {
        let Value::Object(map) = self.value else {
            return Err(self.error(format!("expected an object, found {}", describe(self.value))));
        };
        Ok(map.iter().map(|(name, value)| (&name[..], Place { key: format!("{}.{name}", self.key), value })).collect())
    }
    pub fn text(&self) -> Result<&'a str, KeyError> {
        self.value.as_str().ok_or_else(|| self.error(format!("expected a text, found {}", describe(self.value))))
    }
    /// A finite number.
    pub fn number(&self) -> Result<f64, KeyError> {
        self.value
            .as_f64()
            .filter(|x| x.is_finite())
            .ok_or_else(|| self.error(format!("expected a number, found {}", describe(self.value))))
    }
    /// A plain number: 0.23 or "0.23".
    pub fn plain(&self) -> Result<f64, KeyError> {
        let text = self.value.as_str().and_then(|text| text.trim().parse::<f64>().ok()).filter(|x| x.is_finite());
        text.map_or_else(|| self.number(), Ok)
    }
    /// A whole number, not negative.
    pub fn count(&self) -> Result<u64, KeyError> {
        self.value
            .as_u64()
            .ok_or_else(|| self.error(format!("expected a whole number of at least 0, found {}", describe(self.value))))
    }
    /// Checks the `format` key and returns the document's object.
    pub fn document(&self, format: &str, what: &str, known: &[&str]) -> Result<Object<'a>, KeyError> {
        let expected = format!("{what} has \"format\": \"{format}\"");
        let at = |message: String| KeyError { key: "format".into(), message };
        match self.value.get("format") {
            Some(Value::String(found)) if found == format => self.object(known),
            Some(found) => Err(at(format!("found {}, but {expected}", describe(found)))),
            None if self.value.is_object() => Err(at(format!("missing; {expected}"))),
            None => Err(self.error(format!("found {}; {expected}", describe(self.value)))),
        }
    }
}

impl<'a> Object<'a> {
    /// The value of a key that must be there.
    pub fn required(&self, key: &str) -> Result<Place<'a>, KeyError> {
        self.optional(key).ok_or_else(|| KeyError { key: self.path(key), message: "missing".into() })
    }
    /// The value of a key that may be absent (or null).
    pub fn optional(&self, key: &str) -> Option<Place<'a>> {
        let value = self.map.get(key).filter(|v| !v.is_null())?;
        Some(Place { key: self.path(key), value })
    }
    fn path(&self, key: &str) -> String {
        if self.key.is_empty() { key.to_string() } else { format!("{}.{key}", self.key) }
    }
}

/// "the text \"abc\"", "the number 3", "a list": what a message says was found.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Null => "null".into(),
        Value::Bool(b) => format!("{b}"),
        Value::Number(n) => format!("the number {n}"),
        Value::String(s) if s.chars().count() <= 60 => format!("the text \"{s}\""),
        Value::String(_) => "a long text".into(),
        Value::Array(a) if a.is_empty() => "an empty list".into(),
        Value::Array(_) => "a list".into(),
        Value::Object(_) => "an object".into(),
    }
}

/// The known key that a misspelt one most likely means.
fn nearest<'k>(found: &str, known: &[&'k str]) -> Option<&'k str> {
    let found = found.to_lowercase();
    let limit = (found.chars().count() / 3).max(1) + 1;
    known
        .iter()
        .map(|k| (if k.starts_with(&found) || found.starts_with(k) { 1 } else { edits(&found, k) }, *k))
        .filter(|(distance, _)| *distance <= limit)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}

/// Levenshtein distance.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substitution = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substitution.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// JSON without repeated keys.
struct Strict(Value);

impl<'de> Deserialize<'de> for Strict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StrictVisitor).map(Strict)
    }
}

struct StrictVisitor;

impl<'de> Visitor<'de> for StrictVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a JSON value")
    }
    fn visit_bool<E>(self, v: bool) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_i64<E>(self, v: i64) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_u64<E>(self, v: u64) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_f64<E>(self, v: f64) -> Result<Value, E> {
        Ok(v.into())
    }
    fn visit_str<E>(self, v: &str) -> Result<Value, E> {
        Ok(plain(v).into_owned().into())
    }
    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Strict(value)) = seq.next_element()? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = access.next_key::<String>()? {
            let Strict(value) = access.next_value()?;
            let key = plain(&key).into_owned();
            if map.contains_key(&key) {
                return Err(A::Error::custom(format!("key '{key}' stands twice")));
            }
            map.insert(key, value);
        }
        Ok(Value::Object(map))
    }
}
