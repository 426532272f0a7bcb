//! The YAML of parameter files: `key: value` lines nested by their indentation.
//!
//! Not YAML at large: OpenCV's first line `%YAML:1.0` is none of it, and these files hold numbers under names. Lists
//! and matrices are passed over.

use super::Problem;

/// `key: value` with where it stands.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    /// Keys above it, outermost first.
    pub(super) above: Vec<String>,
    pub(super) key: String,
    /// Without quotes and comment.
    pub(super) value: String,
    /// From 1.
    pub(super) line: usize,
}

impl Entry {
    /// `Gyr.x-axis.gyr_n`, for messages.
    pub(super) fn path(&self) -> String {
        let keys: Vec<&str> = self.above.iter().chain([&self.key]).map(String::as_str).collect();
        keys.join(".")
    }

    pub(super) fn problem(&self, message: impl Into<String>) -> Problem {
        Problem::at(self.line, format!("{}: {}", self.path(), message.into()))
    }

    /// A finite number of at least zero.
    pub(super) fn number(&self) -> Result<f64, Problem> {
        match self.value.parse::<f64>() {
            Ok(number) if number.is_finite() && number >= 0.0 => Ok(number),
            _ => Err(self.problem(format!("found '{}', expected a number of at least 0", self.value))),
        }
    }
}

/// Every key that has a value, in the order of the file. Errors: a key that stands twice, a line that is none.
pub(super) fn entries(text: &str) -> Result<Vec<Entry>, Problem> {
    let mut entries: Vec<Entry> = Vec::new();
    // indentation and key of what is open
    let mut open: Vec<(usize, String)> = Vec::new();
    let mut brackets = 0_i64;
    for (number, raw) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
        let content = without_comment(raw);
        let line = content.trim();
        let goes_on = brackets > 0;
        let opened = line.matches(['[', '{']).count() as i64 - line.matches([']', '}']).count() as i64;
        brackets = (brackets + opened).max(0);
        let is_list = line == "-" || line.starts_with("- ");
        if goes_on || line.is_empty() || is_list || line.starts_with('%') || matches!(line, "---" | "...") {
            continue;
        }
        let indent = content.len() - content.trim_start().len();
        if content[..indent].contains('\t') {
            return Err(Problem::at(number, "a tab indents the line; YAML takes spaces"));
        }
        let Some((key, value)) = split(line) else {
            let shown: String = line.chars().take(40).collect();
            return Err(Problem::at(number, format!("found '{shown}', expected 'key: value'")));
        };
        while open.last().is_some_and(|(at, _)| *at >= indent) {
            open.pop();
        }
        let above: Vec<String> = open.iter().map(|(_, key)| key.clone()).collect();
        let entry = Entry { above, key: unquoted(key).into(), value: unquoted(value).into(), line: number };
        if let Some(earlier) = entries.iter().find(|e| e.key == entry.key && e.above == entry.above) {
            return Err(entry.problem(format!("stands in line {} too", earlier.line)));
        }
        open.push((indent, entry.key.clone()));
        if !entry.value.is_empty() {
            entries.push(entry);
        }
    }
    Ok(entries)
}

/// Up to a `#` outside quotes that begins the line or follows a space.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    let mut before = ' ';
    for (at, c) in line.char_indices() {
        match quote {
            Some(q) if c == q => quote = None,
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == '#' && before.is_whitespace() => return &line[..at],
            Some(_) | None => {}
        }
        before = c;
    }
    line
}

/// At the first colon before a space or at the end, so that `a::b: 1` and `/topic:x` are whole.
fn split(line: &str) -> Option<(&str, &str)> {
    let at = line.match_indices(':').map(|(at, _)| at).find(|at| {
        let rest = &line[at + 1..];
        rest.is_empty() || rest.starts_with(char::is_whitespace)
    })?;
    let (key, value) = (line[..at].trim(), line[at + 1..].trim());
    (!key.is_empty()).then_some((key, value))
}

fn unquoted(text: &str) -> &str {
    let inside = |q: char| text.strip_prefix(q).and_then(|t| t.strip_suffix(q));
    inside('"').or_else(|| inside('\'')).unwrap_or(text)
}
