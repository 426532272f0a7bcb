//! One line of a text log, field by field: the plain way, which takes every form that is read at all.

use super::super::Rows;
use super::super::bytes::printable;
use super::super::sniff::{self, Delimiter};

/// What a column is wanted for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slot {
    Skip,
    Time,
    Axis(usize),
    /// The same, but text is a missing value.
    Beside(usize),
}

/// How the rows of a log are read.
#[derive(Clone, Debug)]
pub(super) struct Form {
    pub(super) delimiter: Delimiter,
    pub(super) decimal_comma: bool,
    /// One for each column.
    pub(super) slots: Vec<Slot>,
    /// First stamp of the file, whole and fraction.
    pub(super) origin: Option<(i64, f64)>,
}

/// Why a line is no row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// The beginning of the field in this column.
    NoNumber {
        column: usize,
        text: String,
    },
    /// So many fields are another number than there are columns. `cut`: the file ends inside this line.
    Fields {
        count: usize,
        cut: bool,
    },
    TooLong,
    Unreadable(String),
}

impl Form {
    pub(super) fn columns_of_values(&self) -> usize {
        self.slots.iter().filter(|slot| matches!(slot, Slot::Axis(_) | Slot::Beside(_))).count()
    }

    /// No row: a comment or nothing but blanks.
    pub(super) fn is_empty(line: &[u8]) -> bool {
        line.iter().all(u8::is_ascii_whitespace) || sniff::is_comment(line)
    }

    /// The fields of the line into the wanted columns, or into none of them. The first stamp becomes the origin.
    pub(super) fn take(&mut self, line: &[u8], number: u64, unended: bool, rows: &mut Rows) -> Result<(), Fault> {
        let taken = self.fields(line, unended, rows);
        match taken {
            Ok(()) => rows.lines.push(number),
            Err(_) => {
                let whole = rows.lines.len();
                rows.time.truncate(whole);
                rows.values.iter_mut().for_each(|column| column.truncate(whole));
            }
        }
        taken
    }

    fn fields(&mut self, line: &[u8], unended: bool, rows: &mut Rows) -> Result<(), Fault> {
        let mut count = 0;
        let mut last_empty = false;
        let comma = self.decimal_comma;
        for field in sniff::fields(line, self.delimiter) {
            last_empty = field.is_empty();
            let good = match self.slots.get(count) {
                None | Some(Slot::Skip) => true,
                Some(Slot::Axis(axis)) => match sniff::number(field, comma) {
                    Some(x) => {
                        rows.values[*axis].push(x);
                        true
                    }
                    None => false,
                },
                Some(Slot::Beside(place)) => {
                    rows.values[*place].push(sniff::number(field, comma).unwrap_or(f64::NAN));
                    true
                }
                Some(Slot::Time) => match stamp(field, comma) {
                    Some((whole, fraction)) => {
                        let origin = match self.origin {
                            None if fraction.is_finite() => *self.origin.insert((whole, fraction)),
                            known => known.unwrap_or((0, 0.0)),
                        };
                        rows.time.push(since(origin, whole, fraction));
                        true
                    }
                    None => false,
                },
            };
            if !good {
                let text = printable(&field[..field.len().min(40)]);
                return Err(Fault::NoNumber { column: count, text });
            }
            count += 1;
        }
        let wanted = self.slots.len();
        if count != wanted && !(count == wanted + 1 && last_empty) {
            return Err(Fault::Fields { count, cut: unended });
        }
        Ok(())
    }
}

/// From the origin to a stamp, in the unit of the file.
#[inline]
pub(super) fn since(origin: (i64, f64), whole: i64, fraction: f64) -> f64 {
    let seconds = match whole.checked_sub(origin.0) {
        Some(difference) => difference as f64,
        None => (i128::from(whole) - i128::from(origin.0)) as f64,
    };
    seconds + (fraction - origin.1)
}

/// Whole and fraction apart, so that nanoseconds since 1970 keep their last digits.
pub(super) fn stamp(field: &[u8], decimal_comma: bool) -> Option<(i64, f64)> {
    let text = std::str::from_utf8(field).ok()?;
    let point = if decimal_comma { ',' } else { '.' };
    let (whole, fraction) = text.split_once(point).unwrap_or((text, ""));
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    let unsigned = whole.strip_prefix('-').unwrap_or(whole);
    if !unsigned.is_empty()
        && digits(unsigned)
        && digits(fraction)
        && fraction.len() < 19
        && let Ok(whole_part) = whole.parse::<i64>()
    {
        let part = fraction.bytes().fold(0u64, |sum, b| sum * 10 + u64::from(b - b'0')) as f64;
        let part = part / 10f64.powi(fraction.len() as i32);
        return Some((whole_part, if whole.starts_with('-') { -part } else { part }));
    }
    sniff::number(field, decimal_comma).map(|x| (0, x))
}
