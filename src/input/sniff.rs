//! What a text log looks like: delimiter, decimal sign, header, first row of numbers; found from the beginning of
//! the file.

use super::account::Account;
use super::names::{Head, is_rate};
use crate::units::plain;

/// How the fields of a line are separated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Delimiter {
    Byte(u8),
    /// Any run of spaces and tabs; leading ones do not count.
    Spaces,
}

/// The form of a text log.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) delimiter: Delimiter,
    pub(super) decimal_comma: bool,
    pub(super) heads: Vec<Head>,
    /// False without a header.
    pub(super) named: bool,
    /// 1-based; 0 without a header.
    pub(super) header_line: u64,
    /// 1-based line from which on every line is a row of numbers, a comment or blank.
    pub(super) first_line: u64,
    /// The sample rate in Hz that a line before the table says, and what it calls it.
    pub(super) rate: Option<(String, f64)>,
}

/// Fields of one line: trimmed, quotes taken off.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    rest: Option<&'a [u8]>,
    delimiter: Delimiter,
}

pub(super) fn fields(line: &[u8], delimiter: Delimiter) -> Fields<'_> {
    Fields { rest: Some(line), delimiter }
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let mut line = self.rest?;
        let space = |b: &u8| *b == b' ' || *b == b'\t';
        let ends = |b: &u8| match self.delimiter {
            Delimiter::Byte(d) => *b == d,
            Delimiter::Spaces => *b == b' ' || *b == b'\t',
        };
        // spaces before a field; a tab that separates is no space
        let lead = line.iter().position(|b| !space(b) || (self.delimiter != Delimiter::Spaces && ends(b)));
        line = &line[lead.unwrap_or(line.len())..];
        if self.delimiter == Delimiter::Spaces && line.is_empty() {
            self.rest = None;
            return None;
        }
        if let [b'"', inner @ ..] = line
            && let Some(close) = closing_quote(inner)
        {
            let after = &inner[close + 1..];
            self.rest = after.iter().position(ends).map(|i| &after[i + 1..]);
            return Some(inner[..close].trim_ascii());
        }
        match line.iter().position(ends) {
            Some(end) => {
                self.rest = Some(&line[end + 1..]);
                Some(line[..end].trim_ascii_end())
            }
            None => {
                self.rest = None;
                Some(line.trim_ascii_end())
            }
        }
    }
}

/// The quote that ends a quoted field; doubled quotes belong to it.
fn closing_quote(inner: &[u8]) -> Option<usize> {
    let mut i = 0;
    while i < inner.len() {
        if inner[i] == b'"' {
            if inner.get(i + 1) != Some(&b'"') {
                return Some(i);
            }
            i += 1;
        }
        i += 1;
    }
    None
}

/// A line that holds no data and no names.
pub(super) fn is_comment(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.starts_with(b"#") || line.starts_with(b"%") || line.starts_with(b"//")
}

/// The number in a field: NaN for an empty field, the usual words for a missing value, and infinity; `None` for
/// other text.
pub(super) fn number(field: &[u8], decimal_comma: bool) -> Option<f64> {
    if field.is_empty() {
        return Some(f64::NAN);
    }
    let mut scratch = [0u8; 64];
    let field = if decimal_comma { with_point(field, &mut scratch)? } else { field };
    match std::str::from_utf8(field).ok()?.parse::<f64>() {
        Ok(x) if x.is_finite() => Some(x),
        Ok(_) => Some(f64::NAN),
        Err(_) => {
            let missing: [&[u8]; 7] = [b"na", b"n/a", b"#n/a", b"null", b"none", b"-nan", b"-nan(ind)"];
            missing.iter().any(|word| field.eq_ignore_ascii_case(word)).then_some(f64::NAN)
        }
    }
}

/// `1,5` as `1.5`. A point would be a thousands separator here, which could be misread: refused.
fn with_point<'a>(field: &'a [u8], scratch: &'a mut [u8; 64]) -> Option<&'a [u8]> {
    let Some(comma) = field.iter().position(|b| *b == b',') else {
        return (!field.contains(&b'.')).then_some(field);
    };
    let digit_after = field.get(comma + 1).is_some_and(u8::is_ascii_digit);
    if !digit_after || field.contains(&b'.') || field.len() > scratch.len() {
        return None;
    }
    let copy = &mut scratch[..field.len()];
    copy.copy_from_slice(field);
    copy[comma] = b'.';
    Some(copy)
}

/// How many fields a line has, and whether the last one is empty (`1,2,` or `1,2, `).
fn shape(line: &[u8], delimiter: Delimiter) -> (usize, bool) {
    let (mut count, mut last_empty) = (0, false);
    for field in fields(line, delimiter) {
        count += 1;
        last_empty = field.is_empty();
    }
    (count, last_empty)
}

const CANDIDATES: [(Delimiter, bool); 7] = [
    (Delimiter::Byte(b'\t'), false),
    (Delimiter::Byte(b'\t'), true),
    (Delimiter::Byte(b';'), false),
    (Delimiter::Byte(b';'), true),
    (Delimiter::Byte(b','), false),
    (Delimiter::Spaces, false),
    (Delimiter::Spaces, true),
];

struct Line<'a> {
    number: u64,
    text: &'a [u8],
}

/// The form of the log that begins with `sample` (without byte-order mark; `whole`: nothing follows), or why it is
/// none.
pub(super) fn layout(sample: &[u8], whole: bool, account: &Account) -> Result<Layout, String> {
    const LINES: usize = 4000;
    let (mut body, mut comments) = (Vec::new(), Vec::new());
    let mut lines: Vec<&[u8]> = sample.split(|b| *b == b'\n').collect();
    if !whole {
        lines.pop(); // cut off somewhere
    }
    for (i, text) in lines.into_iter().enumerate().take(LINES) {
        let line = Line { number: i as u64 + 1, text: text.strip_suffix(b"\r").unwrap_or(text) };
        if is_comment(line.text) {
            comments.push(line);
        } else if !line.text.trim_ascii().is_empty() {
            body.push(line);
        }
    }
    if body.is_empty() {
        return Err("no data: only comments and blank lines".into());
    }
    // the separator and number of fields that make the most numbers; the first in the list on a tie
    let mut best: Option<(usize, Delimiter, bool, usize)> = None;
    for (delimiter, decimal_comma) in CANDIDATES {
        for (count, score) in scores(&body, delimiter, decimal_comma) {
            if best.is_none_or(|(most, ..)| score > most) {
                best = Some((score, delimiter, decimal_comma, count));
            }
        }
    }
    let Some((_, delimiter, decimal_comma, usual)) = best.filter(|(numbers, ..)| *numbers > 0 || body.len() == 1)
    else {
        return Err("no rows of numbers found".into());
    };
    describe(&body, &comments, delimiter, decimal_comma, usual, account)
}

/// For each number of fields a line has: how many cells of such lines are numbers.
fn scores(body: &[Line], delimiter: Delimiter, decimal_comma: bool) -> Vec<(usize, usize)> {
    let mut scores: Vec<(usize, usize)> = Vec::new();
    for line in body {
        let (mut count, mut numbers) = (0, 0);
        for field in fields(line.text, delimiter) {
            count += 1;
            numbers += usize::from(!field.is_empty() && number(field, decimal_comma).is_some());
        }
        match scores.iter_mut().find(|(c, _)| *c == count) {
            Some((_, total)) => *total += numbers,
            None => scores.push((count, numbers)),
        }
    }
    scores
}

fn describe(
    body: &[Line],
    comments: &[Line],
    delimiter: Delimiter,
    decimal_comma: bool,
    usual: usize,
    account: &Account,
) -> Result<Layout, String> {
    // a separator behind the last field of every row makes no further column
    let dangling = usual > 1 && body.iter().map(|l| shape(l.text, delimiter)).all(|(n, empty)| n != usual || empty);
    let columns = if dangling { usual - 1 } else { usual };
    account.columns(columns as u64, Head::numbered(columns).full.len())?;
    let fits = |text: &[u8]| {
        let (n, last_empty) = shape(text, delimiter);
        n == columns || (n == columns + 1 && last_empty)
    };
    let numeric = |text: &[u8]| -> Vec<bool> {
        fields(text, delimiter).take(columns).map(|f| !f.is_empty() && number(f, decimal_comma).is_some()).collect()
    };
    let says_rate = |l: &Line| said_rate(&String::from_utf8_lossy(l.text)).is_some();
    let Some(start) = body.iter().position(|l| fits(l.text) && !says_rate(l)) else {
        return Err("no rows of numbers found".into());
    };
    let table = &body[start..];
    let names = |text: &[u8]| -> Result<Vec<Head>, String> {
        fields(text, delimiter).take(columns).try_for_each(|name| account.columns(1, name.len()))?;
        let mut heads: Vec<Head> = fields(text, delimiter)
            .take(columns)
            .map(|f| Head::parse(&String::from_utf8_lossy(f).replace("\"\"", "\"").replace('"', "")))
            .collect();
        heads.resize_with(columns, || Head::parse(""));
        Ok(heads)
    };
    let first = numeric(table[0].text);
    // names stand above numbers: some cell is text where the next row that fits has a number, or no cell is a number
    let below = table.iter().skip(1).find(|l| fits(l.text)).map(|l| numeric(l.text));
    let has_text =
        fields(table[0].text, delimiter).take(columns).any(|f| !f.is_empty() && number(f, decimal_comma).is_none());
    let is_header = has_text
        && (!first.contains(&true)
            || below.as_ref().is_some_and(|b| first.iter().zip(b).any(|(top, below)| !top && *below)));
    if !is_header && !first.contains(&true) {
        return Err("no rows of numbers found".into());
    }
    let mut layout = Layout {
        delimiter,
        decimal_comma,
        heads: (1..=columns).map(Head::numbered).collect(),
        named: false,
        header_line: 0,
        first_line: table[0].number,
        rate: None,
    };
    if is_header {
        layout.heads = names(table[0].text)?;
        layout.named = true;
        layout.header_line = table[0].number;
        layout.first_line = table[0].number + 1;
        // a row of units below the names
        if let Some(units) = table.get(1).filter(|l| fits(l.text) && is_unit_row(l.text, delimiter)) {
            for (head, unit) in layout.heads.iter_mut().zip(fields(units.text, delimiter)) {
                head.set_unit_below(&String::from_utf8_lossy(unit));
            }
            layout.first_line = units.number + 1;
        }
        if !table.iter().any(|l| l.number >= layout.first_line) {
            return Err(format!("line {}: a header, but no row of numbers below it", layout.header_line));
        }
    } else if let Some(comment) = comments.iter().rfind(|c| c.number < table[0].number) {
        // the names may stand in the comment right above the numbers (EuRoC, rostopic)
        let text = comment.text.trim_ascii_start();
        let text = &text[text.iter().position(|b| !b"#%/ \t".contains(b)).unwrap_or(text.len())..];
        let letters = fields(text, delimiter).any(|f| f.iter().any(u8::is_ascii_alphabetic));
        if columns > 1 && letters && shape(text, delimiter).0 == columns {
            layout.heads = names(text)?;
            layout.named = true;
            layout.header_line = comment.number;
        }
    }
    let before = comments.iter().filter(|line| line.number < layout.first_line).chain(&body[..start]);
    layout.rate = before.filter_map(|line| said_rate(&String::from_utf8_lossy(line.text))).next();
    Ok(layout)
}

/// `// Update Rate: 100.0Hz`, `Sample rate (Hz),100`; `Fs,100` means hertz, as in the files of arrays. Other names
/// must say it.
fn said_rate(line: &str) -> Option<(String, f64)> {
    let (name, value) = line.trim_matches(|c: char| "#%/\" \t".contains(c)).split_once([':', '=', ',', ';', '\t'])?;
    let (name, value) = (name.trim_matches([' ', '"']), value.trim_matches([' ', '"', ',', ';', '\t']));
    let lower = value.to_ascii_lowercase();
    let number = match lower.strip_suffix("hz") {
        Some(number) => number.trim_end(),
        None if name.to_ascii_lowercase().trim_end_matches([')', ']']).ends_with("hz") => &lower,
        None if name.eq_ignore_ascii_case("fs") => &lower,
        None => return None,
    };
    let stem = name.split(['(', '[']).next().unwrap_or(name);
    let rate = number.parse::<f64>().ok().filter(|rate| rate.is_finite() && *rate > 0.0)?;
    (is_rate(name) || is_rate(stem)).then(|| (plain(name).into_owned(), rate))
}

/// Units or nothing in every cell.
fn is_unit_row(text: &[u8], delimiter: Delimiter) -> bool {
    let mut units = 0;
    for field in fields(text, delimiter) {
        let cell = String::from_utf8_lossy(field);
        let bare = cell.trim_start_matches(['(', '[']).trim_end_matches([')', ']']);
        if number(field, false).is_some_and(|x| !x.is_nan()) {
            return false;
        }
        if crate::units::Unit::parse(bare).is_ok() {
            units += 1;
        } else if !bare.is_empty() && bare != "-" {
            return false;
        }
    }
    units > 0
}
