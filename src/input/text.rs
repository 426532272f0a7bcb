//! Delimited text, plain or gzip.

mod ahead;
mod digits;
#[cfg(target_arch = "x86_64")]
mod eights;
mod fast;
mod row;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;

use self::ahead::{Ahead, CHUNK};
use self::row::{Fault, Form, Slot};
use super::account::{Account, Metered};
use super::names::Head;
use super::sniff::{self, Layout};
use super::{BLOCK, InputError, Rows, Table};

/// A longer line is no row of a log.
const LONGEST_LINE: u64 = 1 << 20;
/// What is looked at to find the form of the log.
const SAMPLE: usize = 1 << 18;
/// So many rows are read line by line before chunks of lines are read ahead.
const FIRST: usize = 256;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

pub(super) struct TextTable {
    path: PathBuf,
    account: Account,
    layout: Layout,
    form: Form,
    source: Source,
    /// Lines handed out or read.
    line_number: u64,
    line: Vec<u8>,
    /// The line just read has no end: the file stops there.
    unended: bool,
    /// Of a line behind rows that were handed out.
    fault: Option<Fault>,
    /// From the row on from which chunks are read.
    ahead: Option<Ahead>,
    /// Bytes of a chunk; none: line by line to the end.
    chunk: Option<usize>,
    /// By the lines at the beginning, where the length of the file says something.
    about: Option<u64>,
}

/// The bytes of the log.
struct Source {
    reader: Box<dyn BufRead + Send>,
    /// The most that is asked for at once: of compressed bytes always through the buffer, so that one that is
    /// damaged is read as far whoever reads.
    step: usize,
}

fn fail<T>(path: &Path, what: impl std::fmt::Display) -> Result<T, InputError> {
    Err(InputError::new(format!("{}: {what}", path.display())))
}

fn open(path: &Path, account: &Account) -> Result<Source, InputError> {
    // less than a chunk, which is then read without a copy
    const BUFFER: usize = 1 << 16;
    const UNPACKED: usize = 1 << 18;
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) => return fail(path, format!("cannot read: {error}")),
    };
    let mut reader = BufReader::with_capacity(BUFFER, file);
    match reader.fill_buf() {
        Ok([0x1f, 0x8b, ..]) => {
            let unpacked = Metered { inner: MultiGzDecoder::new(reader), account: account.clone() };
            let reader = Box::new(BufReader::with_capacity(UNPACKED, unpacked));
            Ok(Source { reader, step: UNPACKED / 2 })
        }
        Ok(_) => Ok(Source { reader: Box::new(reader), step: usize::MAX }),
        Err(error) => fail(path, format!("cannot read: {error}")),
    }
}

impl TextTable {
    pub(super) fn open(path: &Path, account: &Account) -> Result<TextTable, InputError> {
        let mut sample = Vec::new();
        if let Err(error) = open(path, account)?.reader.take(SAMPLE as u64).read_to_end(&mut sample) {
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
        let layout = match sniff::layout(text, whole, account) {
            Ok(layout) => layout,
            Err(why) => return fail(path, why),
        };
        let slots = vec![Slot::Skip; layout.heads.len()];
        let form = Form { delimiter: layout.delimiter, decimal_comma: layout.decimal_comma, slots, origin: None };
        let lines = text.iter().filter(|b| **b == b'\n').count() as u64;
        let length = std::fs::metadata(path).map_or(0, |file| file.len());
        let source = open(path, account)?;
        let about = (source.step == usize::MAX && lines > 0).then(|| length / (text.len() as u64 / lines).max(1) + 1);
        Ok(TextTable {
            path: path.to_path_buf(),
            account: account.clone(),
            layout,
            form,
            source,
            line_number: 0,
            line: Vec::new(),
            unended: false,
            fault: None,
            ahead: None,
            chunk: Some(CHUNK),
            about,
        })
    }

    /// What is wrong with the line.
    fn refuse(&self, fault: Fault) -> InputError {
        let what = match fault {
            Fault::NoNumber { column, text } => {
                format!(", column '{}': '{text}' is not a number", self.layout.heads[column].full)
            }
            Fault::Fields { count, cut } => {
                let fields = if count == 1 { "1 field" } else { &format!("{count} fields") };
                let wanted = self.form.slots.len();
                let cut =
                    if cut { " (the file ends inside this line: remove it, or stop before it with `end`)" } else { "" };
                format!(": {fields} where {wanted} are expected{cut}")
            }
            Fault::TooLong => " is longer than 1 MiB: this is no text log".into(),
            Fault::Unreadable(error) => format!(": cannot read on: {error}"),
        };
        InputError::new(format!("{}: line {}{what}", self.path.display(), self.line_number))
    }

    /// The next line without its end; false at the end of the file.
    fn next_line(&mut self) -> Result<bool, Fault> {
        self.line.clear();
        self.line_number += 1;
        let read = (&mut self.source.reader).take(LONGEST_LINE).read_until(b'\n', &mut self.line);
        match read {
            Ok(0) => return Ok(false),
            Ok(_) => {}
            Err(error) => return Err(Fault::Unreadable(error.to_string())),
        }
        self.unended = self.line.last() != Some(&b'\n');
        if !self.unended {
            self.line.pop();
        } else if self.line.len() as u64 >= LONGEST_LINE {
            return Err(Fault::TooLong);
        }
        if self.line.last() == Some(&b'\r') {
            self.line.pop();
        }
        Ok(true)
    }

    /// Up to so many rows, line by line.
    fn plain_rows(&mut self, most: usize, rows: &mut Rows) -> Result<(), Fault> {
        while rows.lines.len() < most && self.next_line()? {
            if self.line_number == 1 && self.line.starts_with(BYTE_ORDER_MARK) {
                self.line.drain(..BYTE_ORDER_MARK.len());
            }
            if self.line_number >= self.layout.first_line && !Form::is_empty(&self.line) {
                self.form.take(&self.line, self.line_number, self.unended, rows)?;
            }
        }
        Ok(())
    }

    /// The rows of the next chunk that has any; none at the end of the file.
    fn chunk_rows(&mut self, ahead: &mut Ahead, rows: &mut Rows) -> Result<(), Fault> {
        while let Some(mut chunk) = ahead.next(&mut *self.source.reader, self.source.step, &self.form) {
            std::mem::swap(rows, &mut chunk.rows);
            rows.before = self.line_number;
            self.line_number += chunk.lines;
            let fault = chunk.fault.take();
            ahead.give_back(chunk);
            if let Some(fault) = fault {
                self.line_number += 1;
                return Err(fault);
            }
            if !rows.lines.is_empty() {
                break;
            }
        }
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
    fn about(&self) -> Option<u64> {
        self.about
    }
    fn at_hand(&self) -> bool {
        self.ahead.as_ref().is_some_and(Ahead::at_hand)
    }
    fn named(&self) -> bool {
        self.layout.named
    }
    fn rate(&self) -> Option<(String, f64)> {
        self.layout.rate.clone()
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
        let slots = &mut self.form.slots;
        slots.fill(Slot::Skip);
        for (axis, &column) in axes.iter().enumerate() {
            slots[column] = Slot::Axis(axis);
        }
        if let Some(column) = beside {
            slots[column] = Slot::Beside(axes.len());
        }
        if let Some(column) = time {
            slots[column] = Slot::Time;
        }
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.account.renew();
        self.source = open(&self.path, &self.account)?;
        (self.line_number, self.fault, self.ahead) = (0, None, None);
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.form.origin.map_or(0.0, |(whole, fraction)| whole as f64 + fraction)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        if let Some(fault) = self.fault.take() {
            return Err(self.refuse(fault));
        }
        rows.clear(self.form.columns_of_values());
        let read = match (self.ahead.take(), self.chunk) {
            (Some(mut ahead), _) => {
                let read = self.chunk_rows(&mut ahead, rows);
                self.ahead = Some(ahead);
                read
            }
            (None, None) => self.plain_rows(BLOCK, rows),
            (None, Some(size)) => {
                let read = self.plain_rows(FIRST, rows);
                let timed = self.form.slots.iter().any(|slot| matches!(slot, Slot::Time));
                if !rows.lines.is_empty() && (self.form.origin.is_some() || !timed) {
                    // parsed, checked and on their way, and a quarter for what else there is
                    self.ahead = Some(Ahead::new(size, self.account.left() / 4));
                }
                read
            }
        };
        match read {
            Ok(()) => {}
            // the rows before it may be all that is wanted
            Err(fault) if !rows.lines.is_empty() => self.fault = Some(fault),
            Err(fault) => return Err(self.refuse(fault)),
        }
        Ok(!rows.lines.is_empty())
    }
}

/// Why this is no text log, if the first bytes say so.
fn not_text(bytes: &[u8]) -> Option<String> {
    const KNOWN: [(&[u8], &str); 14] = [
        (b"\x89HDF", "an HDF5 file, compressed as a whole"),
        (b"MATLAB ", "a MATLAB file, compressed as a whole"),
        (b"ULog\x01\x12\x35", "a PX4 ULog, compressed as a whole"),
        (b"#ROSBAG V", "a ROS bag of another version than 2.0, or compressed as a whole"),
        (b"\x89MCAP", "an MCAP file, compressed as a whole"),
        (b"SQLite format 3", "a database, compressed as a whole"),
        (b"\xa3\x95", "an ArduPilot DataFlash log that does not begin with a message, or is compressed as a whole"),
        (b"H Product:Blackbox", "a Betaflight blackbox log, of which blackbox_decode makes a csv"),
        (b"PAR1", "a Parquet file, compressed as a whole"),
        (b"rosbag2_bagfile_information", "the description of a ROS 2 bag, not the bag: give the folder it lies in"),
        (b"{", "a JSON document"),
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
        "this is {what}; text (csv, also .gz), .npy, MATLAB, HDF5, Parquet, ULog, DataFlash .bin, ROS bags and MCAP \
         are read"
    ))
}

#[cfg(test)]
mod tests;
