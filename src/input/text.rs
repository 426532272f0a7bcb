//! Delimited text, plain or gzip.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use super::names::Head;
use super::sniff::{self, Layout};
use super::{BLOCK, InputError, Rows, Table};

/// A longer line is no row of a log.
const LONGEST_LINE: u64 = 1 << 20;
/// What is looked at to find the form of the log.
const SAMPLE: usize = 1 << 18;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// What a column is wanted for.
#[derive(Clone, Copy, Debug)]
enum Slot {
    Skip,
    Time,
    Axis(usize),
    /// The same, but text is a missing value.
    Beside(usize),
}

pub(super) struct TextTable {
    path: PathBuf,
    layout: Layout,
    reader: Box<dyn BufRead + Send>,
    slots: Vec<Slot>,
    line_number: u64,
    line: Vec<u8>,
    /// The line just read has no end: the file stops there.
    unended: bool,
    /// First stamp of the file, whole and fraction.
    origin: Option<(i64, f64)>,
}

fn fail<T>(path: &Path, what: impl std::fmt::Display) -> Result<T, InputError> {
    Err(InputError { message: format!("{}: {what}", path.display()) })
}

fn open(path: &Path) -> Result<Box<dyn BufRead + Send>, InputError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) => return fail(path, format!("cannot read: {error}")),
    };
    let mut reader = BufReader::with_capacity(1 << 18, file);
    match reader.fill_buf() {
        Ok([0x1f, 0x8b, ..]) => Ok(Box::new(BufReader::with_capacity(1 << 18, MultiGzDecoder::new(reader)))),
        Ok(_) => Ok(Box::new(reader)),
        Err(error) => fail(path, format!("cannot read: {error}")),
    }
}

impl TextTable {
    pub(super) fn open(path: &Path) -> Result<TextTable, InputError> {
        let mut sample = Vec::new();
        if let Err(error) = open(path)?.take(SAMPLE as u64).read_to_end(&mut sample) {
            return fail(path, format!("cannot read: {error}"));
        }
        let whole = sample.len() < SAMPLE;
        let text = sample.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&sample);
        if text.is_empty() {
            return fail(path, "the file is empty");
        }
        if let Some(what) = not_text(text) {
            return fail(path, what);
        }
        let layout = match sniff::layout(text, whole) {
            Ok(layout) => layout,
            Err(why) => return fail(path, why),
        };
        let slots = vec![Slot::Skip; layout.heads.len()];
        let reader = open(path)?;
        let path = path.to_path_buf();
        Ok(TextTable { path, layout, reader, slots, line_number: 0, line: Vec::new(), unended: false, origin: None })
    }

    fn fail<T>(&self, what: impl std::fmt::Display) -> Result<T, InputError> {
        fail(&self.path, format!("line {}{what}", self.line_number))
    }

    /// The next line without its end; false at the end of the file.
    fn next_line(&mut self) -> Result<bool, InputError> {
        self.line.clear();
        self.line_number += 1;
        let read = (&mut self.reader).take(LONGEST_LINE).read_until(b'\n', &mut self.line);
        match read {
            Ok(0) => return Ok(false),
            Ok(_) => {}
            Err(error) => return self.fail(format!(": cannot read on: {error}")),
        }
        self.unended = self.line.last() != Some(&b'\n');
        if !self.unended {
            self.line.pop();
        } else if self.line.len() as u64 >= LONGEST_LINE {
            return self.fail(" is longer than 1 MiB: this is no text log");
        }
        if self.line.last() == Some(&b'\r') {
            self.line.pop();
        }
        Ok(true)
    }

    /// Reads one row's fields into the wanted columns.
    fn take_row(&mut self, rows: &mut Rows) -> Result<(), InputError> {
        let mut count = 0;
        let mut last_empty = false;
        let comma = self.layout.decimal_comma;
        for field in sniff::fields(&self.line, self.layout.delimiter) {
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
                        let since = i128::from(whole) - i128::from(origin.0);
                        rows.time.push(since as f64 + (fraction - origin.1));
                        true
                    }
                    None => false,
                },
            };
            if !good {
                let name = &self.layout.heads[count].full;
                let text = String::from_utf8_lossy(&field[..field.len().min(40)]);
                return self.fail(format!(", column '{name}': '{text}' is not a number"));
            }
            count += 1;
        }
        let wanted = self.slots.len();
        if count != wanted && !(count == wanted + 1 && last_empty) {
            let fields = if count == 1 { "1 field" } else { &format!("{count} fields") };
            let cut = if self.unended {
                " (the file ends inside this line: remove it, or stop before it with --end)"
            } else {
                ""
            };
            return self.fail(format!(": {fields} where {wanted} are expected{cut}"));
        }
        rows.lines.push(self.line_number);
        Ok(())
    }
}

impl Table for TextTable {
    fn heads(&self) -> Vec<&Head> {
        self.layout.heads.iter().collect()
    }
    fn rows(&self) -> Option<u64> {
        None
    }
    fn named(&self) -> bool {
        self.layout.named
    }
    fn place(&self) -> String {
        match self.layout.header_line {
            0 => format!("{}: line {}", self.path.display(), self.layout.first_line),
            line => format!("{}: line {line}", self.path.display()),
        }
    }
    fn row_place(&self, line: u64) -> String {
        format!("{}: line {line}", self.path.display())
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.slots.fill(Slot::Skip);
        for (axis, &column) in axes.iter().enumerate() {
            self.slots[column] = Slot::Axis(axis);
        }
        if let Some(column) = beside {
            self.slots[column] = Slot::Beside(axes.len());
        }
        if let Some(column) = time {
            self.slots[column] = Slot::Time;
        }
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.reader = open(&self.path)?;
        self.line_number = 0;
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.origin.map_or(0.0, |(whole, fraction)| whole as f64 + fraction)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.slots.iter().filter(|s| matches!(s, Slot::Axis(_) | Slot::Beside(_))).count());
        while rows.lines.len() < BLOCK && self.next_line()? {
            if self.line_number == 1 && self.line.starts_with(BYTE_ORDER_MARK) {
                self.line.drain(..BYTE_ORDER_MARK.len());
            }
            let skip = self.line_number < self.layout.first_line
                || self.line.iter().all(u8::is_ascii_whitespace)
                || sniff::is_comment(&self.line);
            if !skip {
                self.take_row(rows)?;
            }
        }
        Ok(!rows.lines.is_empty())
    }
}

/// Whole and fraction apart, so that nanoseconds since 1970 keep their last digits.
fn stamp(field: &[u8], decimal_comma: bool) -> Option<(i64, f64)> {
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

/// Why this is no text log, if the first bytes say so.
fn not_text(bytes: &[u8]) -> Option<String> {
    const KNOWN: [(&[u8], &str); 12] = [
        (b"\x89HDF", "an HDF5 file, compressed as a whole"),
        (b"MATLAB ", "a MATLAB file, compressed as a whole"),
        (b"ULog\x01\x12\x35", "a PX4 ULog, compressed as a whole"),
        (b"#ROSBAG V", "a ROS bag of another version than 2.0, or compressed as a whole"),
        (b"\x89MCAP", "an MCAP file, compressed as a whole"),
        (b"SQLite format 3", "a database, compressed as a whole"),
        (b"\xa3\x95", "an ArduPilot DataFlash log that does not begin with a message, or is compressed as a whole"),
        (b"H Product:Blackbox", "a Betaflight blackbox log"),
        (b"PAR1", "a Parquet file"),
        (b"PK\x03\x04", "a zip archive (npz, xlsx?)"),
        (b"\x28\xb5\x2f\xfd", "compressed with zstd"),
        (b"\x93NUMPY", "a NumPy array, compressed"),
    ];
    let what = match KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        Some((_, what)) => what,
        None if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) => "UTF-16 text; save it as UTF-8",
        None if bytes.contains(&0) => "a binary file",
        None => return None,
    };
    Some(format!(
        "this is {what}; text (csv, also .gz), .npy, MATLAB, HDF5, ULog, DataFlash .bin, ROS bags and MCAP are read"
    ))
}
