//! ArduPilot DataFlash logs (`.bin`).
//!
//! Format: ArduPilot, libraries/AP_Logger: each message is 0xA3, 0x95, its type and its fields; `FMT` messages say
//! how long the messages of a type are and what their fields are called. Bytes that are no message are passed over
//! and counted. Units are those of the message documentation of ArduPilot: rad/s, m/s/s, degC, and time by the name
//! of its field. Batches of raw samples are topics of their own.

mod batch;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::InputError;
use super::account::{Account, Excess};
use super::bytes::Bytes;
use super::names::Head;
use super::number::{Kind, Number, Split};
use super::records::{Field, Messages, PassedOver, RecordSource, failure, head, instance, opened, tally};
use super::table::Topic;
use batch::{Batch, Part};

pub(super) const SIGNATURE: &[u8] = &[0xa3, 0x95, FORMAT];

/// 256 types of messages, some of them of several sensors.
const MOST_TOPICS: usize = 4096;

const FORMAT: u8 = 128;
const FORMAT_SIZE: usize = 89;

/// Messages of one type.
#[derive(Clone, Debug)]
struct Form {
    name: String,
    /// With its three first bytes.
    size: usize,
    fields: Vec<Field>,
    /// The field that tells sensors of one kind apart.
    instance: Option<Field>,
    batch: Option<Part>,
}

/// Opens a log and counts what is in it.
pub(super) fn open(path: &Path, account: &Account) -> Result<RecordSource, InputError> {
    let fail = |what: String| failure(path, &what);
    let over = |excess: Excess| fail(excess.into());
    let mut scanner = Scanner::open(path).map_err(fail)?;
    let mut topics = Topics { list: Vec::new(), places: BTreeMap::new(), account };
    let (mut batch, mut rows) = (Batch::default(), Vec::new());
    while let Some(kind) = scanner.next().map_err(fail)? {
        let Some(form) = &scanner.forms[usize::from(kind)] else { continue };
        match form.batch {
            Some(Part::Header) => {
                batch.begin(form, &scanner.message);
                continue;
            }
            Some(Part::Data(at)) => {
                rows.clear();
                let sensor = batch.samples(form, at, &scanner.message, &mut rows);
                let Some(sensor) = sensor.filter(|_| !rows.is_empty()) else { continue };
                let name = sensor.name();
                let new = || Topic::new(name.clone(), sensor.heads());
                let Some(topic) = topics.place(&name, new).map_err(over)? else { continue };
                let columns = topic.heads.len();
                rows.chunks_exact(columns).for_each(|row| tally(topic, row.first().copied(), 1e-6));
                continue;
            }
            None => {}
        }
        let Some(time) = form.fields.first() else { continue };
        let name = form.topic(&scanner.message);
        let new = || {
            let heads: Vec<Head> = form.fields.iter().map(|field| field.head.clone()).collect();
            let raw = ["GYR", "ACC", "IMU"].iter().any(|sensor| form.name.starts_with(sensor));
            Topic { rank: u8::from(raw), ..Topic::new(name.clone(), heads) }
        };
        let Some(topic) = topics.place(&name, new).map_err(over)? else { continue };
        let unit_s = time.head.unit.as_ref().map_or(f64::NAN, |unit| unit.to_si(1.0));
        tally(topic, unit_s.is_finite().then(|| time.decode(&scanner.message)), unit_s);
    }
    let topics = topics.list;
    if topics.is_empty() {
        return Err(fail("no data in it".into()));
    }
    let (file, names) = (path.to_path_buf(), topics.iter().map(|topic| topic.name.clone()).collect::<Vec<_>>());
    let messages = move |topic: usize| {
        let scanner = Scanner::open(&file)?;
        Ok(Box::new(DataflashTopic { scanner, name: names[topic].clone(), batch: Batch::default() })
            as Box<dyn Messages>)
    };
    let (format, path, account) = ("ArduPilot DataFlash log", path.to_path_buf(), account.clone());
    Ok(RecordSource { format, path, account, topics, messages: Box::new(messages) })
}

/// Topics by name.
struct Topics<'a> {
    list: Vec<Topic>,
    places: BTreeMap<String, usize>,
    account: &'a Account,
}

impl Topics<'_> {
    /// A topic, which is made if it is new; none where there are too many.
    fn place(&mut self, name: &str, new: impl FnOnce() -> Topic) -> Result<Option<&mut Topic>, Excess> {
        let at = match self.places.get(name) {
            Some(&at) => at,
            None if self.list.len() == MOST_TOPICS => return Ok(None),
            None => {
                let topic = new();
                self.account.name(name.len())?;
                topic.heads.iter().try_for_each(|head| self.account.columns(1, head.full.len()))?;
                self.places.insert(name.into(), self.list.len());
                self.list.push(topic);
                self.list.len() - 1
            }
        };
        Ok(self.list.get_mut(at))
    }
}

impl Form {
    /// What a `FMT` message says: the type and its form.
    fn parse(message: &[u8]) -> Option<(u8, Form)> {
        let mut bytes = Bytes(message);
        let (kind, size) = (bytes.u8().ok()?, usize::from(bytes.u8().ok()?));
        let name = Bytes::text(bytes.take(4).ok()?);
        let codes = Bytes::text(bytes.take(16).ok()?);
        let labels = Bytes::text(bytes.take(64).ok()?);
        let (mut fields, mut blocks, mut instance, mut at) = (Vec::<Field>::new(), Vec::new(), None, 0);
        for (code, label) in codes.chars().zip(labels.split(',')) {
            use Kind::{Float, Signed, Unsigned};
            let (kind, factor) = match code {
                'b' => (Signed(1), 1.0),
                'B' | 'M' => (Unsigned(1), 1.0),
                'h' => (Signed(2), 1.0),
                'H' => (Unsigned(2), 1.0),
                'i' => (Signed(4), 1.0),
                'I' => (Unsigned(4), 1.0),
                'q' => (Signed(8), 1.0),
                'Q' => (Unsigned(8), 1.0),
                'g' => (Float(2), 1.0),
                'f' => (Float(4), 1.0),
                'd' => (Float(8), 1.0),
                'c' => (Signed(2), 0.01),
                'C' => (Unsigned(2), 0.01),
                'e' => (Signed(4), 0.01),
                'E' => (Unsigned(4), 0.01),
                'L' => (Signed(4), 1e-7),
                // text, and blocks of numbers
                'n' | 'N' | 'Z' | 'a' => {
                    if code == 'a' {
                        blocks.push((label.to_string(), at));
                    }
                    at += match code {
                        'n' => 4,
                        'N' => 16,
                        _ => 64,
                    };
                    continue;
                }
                _ => return None,
            };
            let number = Number { kind, big_endian: false };
            let field = Field { head: column(&name, label), at, number, factor, over_us: None };
            at = field.end();
            if label == "I" && code == 'B' {
                instance = Some(field.clone());
            }
            fields.push(field);
        }
        let mut form = Form { name, size, fields, instance, batch: None };
        form.batch = Part::of(&form, &blocks);
        (at + 3 <= size).then_some((kind, form))
    }

    fn field(&self, label: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.head.full == label)
    }

    /// The name of the topic of a message.
    fn topic(&self, message: &[u8]) -> String {
        match &self.instance {
            Some(field) => instance(&self.name, field.decode(message).0 as u64),
            None => self.name.clone(),
        }
    }
}

/// A field as a column. Only the messages of the sensors themselves are known by name.
fn column(message: &str, label: &str) -> Head {
    let sensor = |name: &str| message.trim_end_matches(|c: char| c.is_ascii_digit()) == name;
    let unit = match label {
        "GyrX" | "GyrY" | "GyrZ" if sensor("IMU") || sensor("GYR") => Some("rad/s"),
        "AccX" | "AccY" | "AccZ" if sensor("IMU") || sensor("ACC") => Some("m/s^2"),
        "T" | "Temp" if sensor("IMU") => Some("degC"),
        "TimeUS" | "SampleUS" => Some("us"),
        "TimeMS" => Some("ms"),
        _ => None,
    };
    match label {
        "TimeUS" | "TimeMS" => head(label, "time", unit),
        "T" if unit.is_some() => head(label, "temperature", unit),
        _ => head(label, label, unit),
    }
}

/// The messages of one topic.
struct DataflashTopic {
    scanner: Scanner,
    name: String,
    batch: Batch,
}

impl Messages for DataflashTopic {
    fn rewind(&mut self) -> Result<(), String> {
        self.batch = Batch::default();
        self.scanner.rewind()
    }
    fn next(&mut self, row: &mut Vec<Split>) -> Result<bool, String> {
        while let Some(kind) = self.scanner.next()? {
            let Some(form) = &self.scanner.forms[usize::from(kind)] else { continue };
            match form.batch {
                Some(Part::Header) => self.batch.begin(form, &self.scanner.message),
                Some(Part::Data(at)) => {
                    let sensor = self.batch.samples(form, at, &self.scanner.message, row);
                    if sensor.is_some_and(|sensor| sensor.name() == self.name) && !row.is_empty() {
                        return Ok(true);
                    }
                    row.clear();
                }
                None => {}
            }
            if form.batch.is_none()
                && self.name.starts_with(&form.name)
                && form.topic(&self.scanner.message) == self.name
            {
                row.extend(form.fields.iter().map(|field| field.decode(&self.scanner.message)));
                return Ok(true);
            }
        }
        Ok(false)
    }
    fn damage(&self) -> Option<String> {
        let of_batches = || self.batch.damage().filter(|_| self.name.starts_with("ISB_"));
        self.scanner.damage().or_else(of_batches)
    }
}

/// Message after message of the file.
struct Scanner {
    reader: BufReader<File>,
    length: u64,
    /// Bytes of the file before the window.
    read: u64,
    /// What was read and is not yet used.
    window: Vec<u8>,
    at: usize,
    forms: Vec<Option<Form>>,
    passed_over: PassedOver,
    message: Vec<u8>,
}

impl Scanner {
    fn open(path: &Path) -> Result<Scanner, String> {
        let (reader, length) = opened(path)?;
        let mut scanner = Scanner {
            reader,
            length,
            read: 0,
            window: Vec::new(),
            at: 0,
            forms: Vec::new(),
            passed_over: PassedOver::default(),
            message: Vec::new(),
        };
        scanner.rewind()?;
        Ok(scanner)
    }

    fn rewind(&mut self) -> Result<(), String> {
        self.reader.seek(SeekFrom::Start(0)).map_err(|error| format!("cannot read: {error}"))?;
        self.window.clear();
        (self.at, self.read, self.passed_over) = (0, 0, PassedOver::default());
        self.forms = vec![None; 256];
        Ok(())
    }

    fn damage(&self) -> Option<String> {
        self.passed_over.sentence(self.length)
    }

    /// At least `count` bytes in the window, if the file has them.
    fn fill(&mut self, count: usize) -> Result<bool, String> {
        if self.window.len() - self.at < count {
            self.window.drain(..self.at);
            self.read += self.at as u64;
            self.at = 0;
            let wanted = (1 << 16) as u64;
            let read = (&mut self.reader).take(wanted).read_to_end(&mut self.window);
            read.map_err(|error| format!("cannot read on: {error}"))?;
        }
        Ok(self.window.len() - self.at >= count)
    }

    /// The type of the next message that is not a `FMT`; its fields are in `message`.
    fn next(&mut self) -> Result<Option<u8>, String> {
        loop {
            if !self.fill(3)? {
                self.pass_over(self.window.len() - self.at);
                return Ok(None);
            }
            let start = &self.window[self.at..];
            let kind = start[2];
            let size = match &self.forms[usize::from(kind)] {
                _ if start[..2] != [0xa3, 0x95] => None,
                _ if kind == FORMAT => Some(FORMAT_SIZE),
                form => form.as_ref().map(|form| form.size),
            };
            let Some(size) = size else {
                self.pass_over(1);
                continue;
            };
            if !self.fill(size)? {
                // the file ends inside it, or it is none
                self.pass_over(1);
                continue;
            }
            self.message.clear();
            self.message.extend_from_slice(&self.window[self.at + 3..self.at + size]);
            self.at += size;
            if kind == FORMAT {
                if let Some((kind, form)) = Form::parse(&self.message) {
                    self.forms[usize::from(kind)] = Some(form);
                }
                continue;
            }
            return Ok(Some(kind));
        }
    }

    fn pass_over(&mut self, bytes: usize) {
        if bytes > 0 {
            self.passed_over.count(self.read + self.at as u64, bytes as u64);
            self.at += bytes;
        }
    }
}
