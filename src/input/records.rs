//! Logs of messages: flight logs and bags. The fields of one kind of message are the columns of one table.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::account::Account;
use super::names::Head;
use super::number::{Number, Split, since};
use super::table::{Source, Topic};
use super::{BLOCK, InputError, Rows, Table};
use crate::units::Unit;

/// The messages of one topic, read from the beginning as often as needed.
pub(super) trait Messages: Send {
    fn rewind(&mut self) -> Result<(), String>;
    /// Appends the rows of the next message, one number per column; false at the end.
    fn next(&mut self, row: &mut Vec<Split>) -> Result<bool, String>;
    /// What of the file could not be read, after a pass.
    fn damage(&self) -> Option<String>;
}

/// A field of a message, and what it is as a column.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) head: Head,
    /// First byte in the message.
    pub(super) at: usize,
    pub(super) number: Number,
    /// What a stored number is multiplied with.
    pub(super) factor: f64,
    /// A length of time in the message, in microseconds, that the number is divided by: increments become a rate.
    pub(super) over_us: Option<(usize, Number)>,
}

impl Field {
    pub(super) fn end(&self) -> usize {
        self.at + self.number.size()
    }
    pub(super) fn decode(&self, message: &[u8]) -> Split {
        let number = |at: usize, number: Number| match message.get(at..at + number.size()) {
            Some(bytes) => number.decode(bytes),
            None => (0, f64::NAN),
        };
        let (whole, part) = number(self.at, self.number);
        match self.over_us {
            None if self.factor == 1.0 => (whole, part),
            None => (0, (whole as f64 + part) * self.factor),
            Some((at, kind)) => {
                let (us, fraction) = number(at, kind);
                (0, (whole as f64 + part) / ((us as f64 + fraction) * 1e-6))
            }
        }
    }
}

/// A column whose meaning the format says. Without a unit its name is not taken for a sensor's.
pub(super) fn head(full: &str, name: &str, unit: Option<&str>) -> Head {
    let unit = unit.and_then(|unit| Unit::parse(unit).ok());
    Head { full: full.into(), name: name.into(), unit_text: None, silent: unit.is_none(), unit }
}

/// The name of a topic of which there may be several.
pub(super) fn instance(name: &str, instance: u64) -> String {
    format!("{name}:{instance}")
}

/// A file that is read from the beginning, and its length.
pub(super) fn opened(path: &Path) -> Result<(BufReader<File>, u64), String> {
    let io = |error: std::io::Error| format!("cannot read: {error}");
    let file = File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    Ok((BufReader::with_capacity(1 << 16, file), length))
}

/// Bytes of a file that are no message.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PassedOver {
    first: Option<u64>,
    bytes: u64,
}

impl PassedOver {
    pub(super) fn count(&mut self, at: u64, bytes: u64) {
        self.first.get_or_insert(at);
        self.bytes += bytes;
    }
    /// What to say of it, of a file of so many bytes.
    pub(super) fn sentence(&self, length: u64) -> Option<String> {
        let first = self.first?;
        Some(format!("damaged at byte {first}: {} of {length} bytes were passed over", self.bytes))
    }
}

/// What the first pass counts of a topic.
pub(super) fn tally(topic: &mut Topic, stamp: Option<Split>, unit_s: f64) {
    topic.rows = Some(topic.rows.unwrap_or(0) + 1);
    if let Some((whole, part)) = stamp.filter(|(_, part)| part.is_finite()) {
        let time_s = (whole as f64 + part) * unit_s;
        topic.span_s = Some(topic.span_s.map_or((time_s, time_s), |(first, _)| (first, time_s)));
    }
}

/// The messages of a topic, by its number.
pub(super) type OpenTopic = Box<dyn Fn(usize) -> Result<Box<dyn Messages>, String> + Send>;

/// A file of messages whose topics are known.
pub(super) struct RecordSource {
    pub(super) format: &'static str,
    pub(super) path: PathBuf,
    pub(super) account: Account,
    pub(super) topics: Vec<Topic>,
    pub(super) messages: OpenTopic,
}

impl Source for RecordSource {
    fn format(&self) -> &'static str {
        self.format
    }
    fn topics(&self) -> &[Topic] {
        &self.topics
    }
    fn table(&mut self, topic: usize) -> Result<Box<dyn Table + Send>, InputError> {
        let messages = (self.messages)(topic).map_err(|what| failure(&self.path, &what))?;
        let topic = self.topics[topic].clone();
        Ok(Box::new(RecordTable {
            path: self.path.clone(),
            account: self.account.clone(),
            topic,
            messages,
            time: None,
            axes: Vec::new(),
            origin: None,
            row: Vec::new(),
            at: 0,
        }))
    }
}

pub(super) fn failure(path: &Path, what: &str) -> InputError {
    InputError::new(format!("{}: {what}", path.display()))
}

struct RecordTable {
    path: PathBuf,
    account: Account,
    topic: Topic,
    messages: Box<dyn Messages>,
    time: Option<usize>,
    /// The axes and what is beside them.
    axes: Vec<usize>,
    /// First stamp.
    origin: Option<Split>,
    row: Vec<Split>,
    /// Rows handed out.
    at: u64,
}

impl Table for RecordTable {
    fn heads(&self) -> Vec<&Head> {
        self.topic.heads.iter().collect()
    }
    fn named(&self) -> bool {
        true
    }
    fn place(&self) -> String {
        format!("{}: {}", self.path.display(), self.topic.name)
    }
    fn row_place(&self, row: u64) -> String {
        format!("{}: {}: row {row}", self.path.display(), self.topic.name)
    }
    fn rows(&self) -> Option<u64> {
        None
    }
    fn notes(&self) -> Vec<String> {
        self.messages.damage().into_iter().collect()
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.time = time;
        self.axes = axes.iter().copied().chain(beside).collect();
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.at = 0;
        self.account.renew();
        self.messages.rewind().map_err(|what| failure(&self.path, &what))
    }
    fn origin(&self) -> f64 {
        self.origin.map_or(0.0, |(whole, part)| whole as f64 + part)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.axes.len());
        while rows.lines.len() < BLOCK {
            self.row.clear();
            if !self.messages.next(&mut self.row).map_err(|what| failure(&self.path, &what))? {
                break;
            }
            for row in self.row.chunks_exact(self.topic.heads.len()) {
                self.at += 1;
                rows.lines.push(self.at);
                if let Some(column) = self.time {
                    rows.time.push(since(&mut self.origin, row[column]));
                }
                for (values, &column) in rows.values.iter_mut().zip(&self.axes) {
                    let (whole, part) = row[column];
                    let value = whole as f64 + part;
                    values.push(if value.is_finite() { value } else { f64::NAN });
                }
            }
        }
        Ok(!rows.lines.is_empty())
    }
}
