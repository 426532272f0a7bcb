//! Many lines of a text log at once, column by column, where all lines of a piece are alike: every one has a field
//! for each column, no quotes.
//!
//! A field that is not a plain number is handed to [`sniff::number`], and the lines of a piece that are not alike to
//! [`Form::take`], so that every form is read, and refused, as the plain way does it.

use super::super::Rows;
use super::super::sniff::{self, Delimiter};
use super::digits::{self, Bytes, Eight, LEAD, Words, eight, inexact, is_exact, joined, signed_ten};
use super::row::{Fault, Form, Slot, since, stamp};

/// Lines are looked at in pieces that stay in the nearest cache.
const PIECE: usize = 1 << 14;
/// Room that a text needs behind its lines.
pub(super) const ROOM: usize = 64;

/// Reads lines into rows; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Lines {
    /// Of all fields of a piece.
    ends: Vec<u32>,
}

/// Lines to be read: `text[LEAD..end]`, each with its end, and [`ROOM`] bytes behind them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) end: usize,
    /// The file has no line end after the last line.
    pub(super) unended: bool,
}

impl Lines {
    /// The lines into `rows`, numbered from 1. Returns how many there are; the fault is that of the line behind them.
    pub(super) fn read(&mut self, form: &Form, text: Text, rows: &mut Rows) -> (u64, Option<Fault>) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V4::try_new() {
            return simd.vectorize(Reading { lines: self, form, text, rows, simd });
        } else if let Some(simd) = pulp::x86::V3::try_new() {
            return simd.vectorize(Reading { lines: self, form, text, rows, simd });
        }
        self.read_by(Words, form, text, rows)
    }

    #[inline(always)]
    pub(super) fn read_by(
        &mut self,
        simd: impl Bytes,
        form: &Form,
        text: Text,
        rows: &mut Rows,
    ) -> (u64, Option<Fault>) {
        let Text { bytes, end, unended } = text;
        let mut lines = 0;
        let mut from = LEAD;
        while from < end {
            let near = end.min(from + PIECE);
            let last = match bytes[from..near].iter().rposition(|b| *b == b'\n') {
                Some(last) => from + last,
                None => bytes[near..end].iter().position(|b| *b == b'\n').map_or(end - 1, |next| near + next),
            };
            let whole = rows.lines.len();
            // no closures here: they would not be compiled for the instructions of `simd`
            let fields = match self.ends(simd, form.delimiter, bytes, from, last + 1) {
                Some((lines, count)) => Fields::new(form, bytes, lines, &self.ends[..count]),
                None => None,
            };
            let read = match &fields {
                Some(fields) if fields.numbers(simd, rows) => fields.rows as u64,
                _ => 0,
            };
            if read > 0 {
                rows.lines.extend(lines + 1..=lines + read);
                lines += read;
            } else {
                truncate(rows, whole);
                let piece = Text { bytes: &bytes[from..last], end: last - from, unended: unended && last + 1 == end };
                if let Err(fault) = plainly(form, piece, &mut lines, rows) {
                    return (lines, Some(fault));
                }
            }
            from = last + 1;
        }
        (lines, None)
    }

    /// Where the fields of these lines end, behind where they begin less one; how many
    /// lines there are, and how many of these places. `None` if there is a quote.
    #[inline(always)]
    fn ends(
        &mut self,
        simd: impl Bytes,
        delimiter: Delimiter,
        text: &[u8],
        from: usize,
        end: usize,
    ) -> Option<(usize, usize)> {
        let separators = match delimiter {
            Delimiter::Byte(byte) => [byte, byte],
            Delimiter::Spaces => [b' ', b'\t'],
        };
        self.ends.resize(self.ends.len().max(end - from + 81), 0);
        self.ends[0] = from as u32 - 1;
        let (mut lines, mut count) = (0, 1);
        for (at, block) in (from..end).step_by(64).zip(text[from..].as_chunks::<64>().0) {
            let inside = if end - at < 64 { (1 << (end - at)) - 1 } else { !0 };
            let (ends, feeds, quotes) = simd.ends(block, separators);
            let ends = ends & inside;
            lines += (feeds & inside).count_ones() as usize;
            if quotes & inside != 0 {
                return None;
            }
            let places = self.ends[count..].first_chunk_mut::<80>()?;
            count += ends.count_ones() as usize;
            simd.places(ends, at as u32, places);
        }
        Some((lines, count))
    }
}

/// Line by line; `piece` has no end of the last line.
#[inline(never)]
fn plainly(form: &Form, piece: Text, lines: &mut u64, rows: &mut Rows) -> Result<(), Fault> {
    let mut form = form.clone();
    let mut left = Some(piece.bytes);
    while let Some(text) = left {
        let end = text.iter().position(|b| *b == b'\n');
        left = end.map(|end| &text[end + 1..]);
        let line = &text[..end.unwrap_or(text.len())];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if !Form::is_empty(line) {
            form.take(line, *lines + 1, piece.unended && left.is_none(), rows)?;
        }
        *lines += 1;
    }
    Ok(())
}

fn truncate(rows: &mut Rows, whole: usize) {
    rows.time.truncate(whole);
    rows.values.iter_mut().for_each(|column| column.truncate(whole));
}

/// [`Lines::read_by`] as it is called where the processor has these instructions.
#[cfg(target_arch = "x86_64")]
struct Reading<'a, S> {
    lines: &'a mut Lines,
    form: &'a Form,
    text: Text<'a>,
    rows: &'a mut Rows,
    simd: S,
}

#[cfg(target_arch = "x86_64")]
impl<S: Bytes> pulp::NullaryFnOnce for Reading<'_, S> {
    type Output = (u64, Option<Fault>);

    #[inline(always)]
    fn call(self) -> Self::Output {
        self.lines.read_by(self.simd, self.form, self.text, self.rows)
    }
}

/// Lines that are alike.
struct Fields<'a> {
    form: &'a Form,
    text: &'a [u8],
    /// The byte before the first line, and the end of every field.
    ends: &'a [u32],
    rows: usize,
    /// Of one row: one more than columns where a separator stands behind each row.
    count: usize,
    point: u8,
}

/// Sign, digits before the point, digits behind it, and how many.
struct Decimal {
    negative: bool,
    whole: u64,
    fraction: u64,
    count: usize,
}

impl Decimal {
    #[inline(always)]
    fn value(&self) -> f64 {
        let m = joined(self.whole, self.fraction, self.count);
        if is_exact(m) {
            m as f64 / signed_ten(self.count, self.negative)
        } else {
            let value = inexact(m, self.count);
            if self.negative { -value } else { value }
        }
    }
    #[inline(always)]
    fn since(&self, origin: (i64, f64)) -> f64 {
        let whole = if self.negative { -(self.whole as i64) } else { self.whole as i64 };
        since(origin, whole, self.fraction as f64 / signed_ten(self.count, self.negative))
    }
}

/// What the fields of a column are.
#[derive(Clone, Copy)]
enum Kind {
    /// `beside`: text is a missing value.
    Number {
        beside: bool,
    },
    Stamp {
        origin: (i64, f64),
    },
}

/// So many values more.
#[inline(always)]
fn extended(values: &mut Vec<f64>, more: usize) -> &mut [f64] {
    let before = values.len();
    values.resize(before + more, 0.0);
    &mut values[before..]
}

impl<'a> Fields<'a> {
    /// `None` if the lines are not alike.
    #[inline(always)]
    fn new(form: &'a Form, text: &'a [u8], lines: usize, ends: &'a [u32]) -> Option<Self> {
        let columns = form.slots.len();
        let is_last = |end: &u32| text[*end as usize] == b'\n';
        let count = ends.iter().skip(1).take(columns + 1).position(is_last)? + 1;
        if count < columns || !(ends.len() - 1).is_multiple_of(count) {
            return None;
        }
        let rows = (ends.len() - 1) / count;
        let point = if form.decimal_comma { b',' } else { b'.' };
        let fields = Fields { form, text, ends, rows, count, point };
        if lines != rows || !ends[1..].chunks_exact(count).all(|row| row.last().is_some_and(is_last)) {
            return None;
        }
        let comment = matches!(form.slots[0], Slot::Skip);
        if !comment && count == columns && form.delimiter != Delimiter::Spaces {
            return Some(fields);
        }
        for row in 0..rows {
            if count > columns && !fields.field(row, columns).trim_ascii().is_empty() {
                return None;
            }
            // several blanks are one separator
            let is_empty = |column: usize| fields.field(row, column).trim_ascii().is_empty();
            if form.delimiter == Delimiter::Spaces && (0..count).any(is_empty) {
                return None;
            }
            // no comment and nothing before the first field; what is no number is found there
            if comment
                && matches!(fields.field(row, 0).first(), None | Some(b'#' | b'%' | b'/' | b' ' | b'\t' | b'\r' | 0x0c))
            {
                return None;
            }
        }
        Some(fields)
    }

    fn field(&self, row: usize, column: usize) -> &[u8] {
        let i = row * self.count + column;
        &self.text[self.ends[i] as usize + 1..self.ends[i + 1] as usize]
    }

    /// Beginning and end of a field.
    #[inline(always)]
    fn place(&self, at: usize) -> (usize, usize) {
        self.ends[at..].first_chunk::<2>().map_or((0, 0), |[before, end]| (*before as usize + 1, *end as usize))
    }

    /// All wanted columns; false if some field shows that the line is not alike.
    #[inline(always)]
    fn numbers(&self, simd: impl Bytes, rows: &mut Rows) -> bool {
        for (column, slot) in self.form.slots.iter().enumerate() {
            let read = match *slot {
                Slot::Skip => true,
                Slot::Axis(axis) | Slot::Beside(axis) => {
                    let values = extended(&mut rows.values[axis], self.rows);
                    self.column(simd, column, Kind::Number { beside: matches!(slot, Slot::Beside(_)) }, values)
                }
                Slot::Time => {
                    // so that no difference from it overflows
                    let Some(origin) = self.form.origin.filter(|(whole, _)| whole.unsigned_abs() < 1 << 62) else {
                        return false;
                    };
                    self.column(simd, column, Kind::Stamp { origin }, extended(&mut rows.time, self.rows))
                }
            };
            if !read {
                return false;
            }
        }
        true
    }

    #[inline(always)]
    fn column(&self, simd: impl Bytes, column: usize, kind: Kind, values: &mut [f64]) -> bool {
        let (eights, rest) = values.as_chunks_mut::<8>();
        let mut at = column;
        for eight in eights {
            let good = match self.eight(at) {
                Some(fields) => match kind {
                    Kind::Number { .. } => simd.numbers(&fields, self.point),
                    Kind::Stamp { origin } => simd.stamps(&fields, self.point, origin),
                },
                None => None,
            };
            let good = match good {
                Some((numbers, good)) => {
                    *eight = numbers;
                    good
                }
                None => 0,
            };
            if good != !0 && !self.one_by_one(simd, at, kind, good, eight) {
                return false;
            }
            at += 8 * self.count;
        }
        self.one_by_one(simd, at, kind, 0, rest)
    }

    /// Values of consecutive rows from this field on, but for those that are good.
    #[inline(always)]
    fn one_by_one(&self, simd: impl Bytes, mut at: usize, kind: Kind, good: u8, values: &mut [f64]) -> bool {
        for (i, value) in values.iter_mut().enumerate() {
            if good >> i & 1 == 0 {
                let (from, end) = self.place(at);
                let read = match kind {
                    Kind::Number { beside } => match self.decimal(simd, from, end) {
                        Some(decimal) => Some(decimal.value()),
                        None => self.other_number(from, end, beside),
                    },
                    Kind::Stamp { origin } => match self.decimal(simd, from, end) {
                        Some(decimal) => Some(decimal.since(origin)),
                        None => self.other_stamp(from, end, origin),
                    },
                };
                match read {
                    Some(read) => *value = read,
                    None => return false,
                }
            }
            at += self.count;
        }
        true
    }

    /// The fields of eight rows.
    #[inline(always)]
    fn eight(&self, at: usize) -> Option<Eight> {
        let mut eight = Eight { words: [[0; 8]; 3], lengths: [0; 8] };
        for i in 0..8 {
            let (from, end) = self.place(at + i * self.count);
            let near: &[u8; 24] = self.text.get(end.wrapping_sub(24)..end)?.first_chunk()?;
            let [third, second, first] = near.as_chunks::<8>().0 else { return None };
            eight.words[0][i] = u64::from_le_bytes(*first);
            eight.words[1][i] = u64::from_le_bytes(*second);
            eight.words[2][i] = u64::from_le_bytes(*third);
            eight.lengths[i] = (end - from) as u64;
        }
        Some(eight)
    }

    /// The field, if it is a sign or none, 1 to 8 digits, a decimal point, and 1 to 16 digits.
    #[inline(always)]
    fn decimal(&self, simd: impl Bytes, from: usize, end: usize) -> Option<Decimal> {
        let near: &[u8; 32] = self.text.get(end.wrapping_sub(32)..end)?.first_chunk()?;
        let length = end - from;
        if length.wrapping_sub(1) >= 32 {
            return None;
        }
        // the first bit is that of the first byte of the field
        let others = simd.others(near) >> (32 - length);
        let negative = near[32 - length] == b'-';
        let point = others & !u32::from(negative);
        let at = point.trailing_zeros() as usize;
        let (whole, count) = (at.wrapping_sub(usize::from(negative)), length.wrapping_sub(at + 1));
        let one = (point != 0) & (point & point.wrapping_sub(1) == 0);
        if !(one & (count.wrapping_sub(1) < 16) & (near[31_usize.wrapping_sub(count) & 31] == self.point)) {
            return None;
        }
        let digits = near.last_chunk::<16>()?;
        let before = match whole {
            1 => u64::from(near[30_usize.wrapping_sub(count) & 31] & 15),
            2..=8 if whole + count <= 19 => eight(self.text, end - count - 1, whole),
            _ => return None,
        };
        Some(Decimal { negative, whole: before, fraction: simd.sixteen(digits, count), count })
    }

    /// Any field without blanks around; `None` if this is no row.
    fn trimmed(&self, from: usize, end: usize) -> Option<&[u8]> {
        let field = &self.text[from..end];
        let lead = field.iter().position(|b| *b != b' ' && *b != b'\t').unwrap_or(field.len());
        let field = field[lead..].trim_ascii_end();
        // between blanks there are no empty fields; an empty line and a comment are no rows
        let first = from == self.ends[0] as usize + 1 || self.text[from - 1] == b'\n';
        let none = match field.first() {
            None => first || self.form.delimiter == Delimiter::Spaces,
            Some(b'#' | b'%' | b'/') => first,
            Some(_) => false,
        };
        (!none).then_some(field)
    }

    #[inline(never)]
    fn other_number(&self, from: usize, end: usize, beside: bool) -> Option<f64> {
        let comma = self.form.decimal_comma;
        let field = self.trimmed(from, end)?;
        let value = digits::number(field, comma).or_else(|| sniff::number(field, comma));
        value.or(beside.then_some(f64::NAN))
    }

    #[inline(never)]
    fn other_stamp(&self, from: usize, end: usize, origin: (i64, f64)) -> Option<f64> {
        let comma = self.form.decimal_comma;
        let field = self.trimmed(from, end)?;
        let (whole, part) = digits::integer(field).map(|whole| (whole, 0.0)).or_else(|| stamp(field, comma))?;
        Some(since(origin, whole, part))
    }
}
