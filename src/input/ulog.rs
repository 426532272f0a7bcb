//! PX4 ULog.
//!
//! Format: PX4 user guide, "ULog File Format", version 1. Messages are read one by one. A file that ends inside a
//! message is read up to there; where a message makes no sense, reading goes on behind the next synchronisation
//! message, and a note says how many bytes were passed over. Data that was appended after a crash is found by the
//! offsets in the flag message.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::InputError;
use super::account::{Account, Excess, LONGEST_NAME, STEP, deeper};
use super::bytes::Bytes;
use super::names::Head;
use super::number::{Kind, Number, Split};
use super::records::{Field, Messages, PassedOver, RecordSource, failure, head, instance, opened, tally};
use super::table::Topic;

pub(super) const SIGNATURE: &[u8] = b"ULog\x01\x12\x35";

const SYNC: &[u8] = &[0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
const KINDS: &[u8] = b"BFIMPQARDLCSO";
/// A message has at most 65,535 bytes; that of the most fields, some hundred.
const MOST_FIELDS: usize = 1 << 13;
/// Of all topics.
const MOST_COLUMNS: usize = 1 << 16;
/// Topics are numbered by 16 bits.
const MOST_TOPICS: usize = 1 << 16;

/// Field of a topic, its name as a column, its unit.
type Known = (&'static str, &'static str, &'static str);

/// Topics with the output of a sensor.
const SENSORS: [(&str, &[Known]); 7] = [
    ("sensor_gyro", &[("x", "gyro_x", "rad/s"), ("y", "gyro_y", "rad/s"), ("z", "gyro_z", "rad/s")]),
    ("sensor_accel", &[("x", "accel_x", "m/s^2"), ("y", "accel_y", "m/s^2"), ("z", "accel_z", "m/s^2")]),
    (
        "sensor_combined",
        &[
            ("gyro_rad[0]", "gyro_x", "rad/s"),
            ("gyro_rad[1]", "gyro_y", "rad/s"),
            ("gyro_rad[2]", "gyro_z", "rad/s"),
            ("accelerometer_m_s2[0]", "accel_x", "m/s^2"),
            ("accelerometer_m_s2[1]", "accel_y", "m/s^2"),
            ("accelerometer_m_s2[2]", "accel_z", "m/s^2"),
        ],
    ),
    ("vehicle_imu", &[]),
    ("sensor_gyro_fifo", &[]),
    ("sensor_accel_fifo", &[]),
    // after calibration and filters
    (
        "vehicle_angular_velocity",
        &[("xyz[0]", "gyro_x", "rad/s"), ("xyz[1]", "gyro_y", "rad/s"), ("xyz[2]", "gyro_z", "rad/s")],
    ),
];
const FILTERED: &str = "vehicle_angular_velocity";

/// How the messages of a topic become rows.
#[derive(Clone, Debug)]
enum Layout {
    Fields(Vec<Field>),
    Fifo(Box<Fifo>),
}

/// Many samples in a message.
#[derive(Clone, Debug)]
struct Fifo {
    /// Of the last sample.
    time: Field,
    step_us: Field,
    samples: Field,
    /// Step of the converter.
    scale: Field,
    /// The first sample of each axis.
    axes: [Field; 3],
}

impl Layout {
    /// Of a message, at most.
    fn numbers(&self) -> u64 {
        match self {
            Layout::Fields(fields) => fields.len() as u64,
            Layout::Fifo(_) => 4 * 32,
        }
    }
    /// Appends the rows of a message; columns are as many as heads.
    fn decode(&self, message: &[u8], row: &mut Vec<Split>) {
        match self {
            Layout::Fields(fields) => row.extend(fields.iter().map(|field| field.decode(message))),
            Layout::Fifo(fifo) => {
                let Fifo { time, step_us, samples, scale, axes } = &**fifo;
                let number = |field: &Field| {
                    let (whole, part) = field.decode(message);
                    whole as f64 + part
                };
                let (time, _) = time.decode(message);
                let (count, step, scale) = (number(samples).clamp(0.0, 32.0) as usize, number(step_us), number(scale));
                for i in 0..count {
                    row.push((time, -step * (count - 1 - i) as f64));
                    for axis in axes {
                        let at = axis.at + i * axis.number.size();
                        let sample = message.get(at..at + axis.number.size()).map(|bytes| axis.number.decode(bytes));
                        row.push((0, sample.map_or(f64::NAN, |(whole, part)| (whole as f64 + part) * scale)));
                    }
                }
            }
        }
    }
}

/// Opens a log and counts what is in it.
pub(super) fn open(path: &Path, account: &Account) -> Result<RecordSource, InputError> {
    let fail = |what: String| failure(path, &what);
    let mut scanner = Scanner::open(path).map_err(fail)?;
    let mut formats: BTreeMap<String, String> = BTreeMap::new();
    let over = |excess: Excess| fail(excess.into());
    let (mut topics, mut layouts): (Vec<Topic>, Vec<Layout>) = (Vec::new(), Vec::new());
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    // the number of a message is given anew where a topic ends
    let mut numbers: BTreeMap<u16, usize> = BTreeMap::new();
    let (mut row, mut columns) = (Vec::new(), 0);
    while let Some(kind) = scanner.next().map_err(fail)? {
        let mut content = Bytes(&scanner.message);
        match kind {
            b'F' => {
                if let Some((name, fields)) = Bytes::text(content.0).split_once(':') {
                    account.hold((128 + name.len() + fields.len()) as u64).map_err(over)?;
                    formats.insert(name.into(), fields.into());
                }
            }
            b'A' => {
                let (Ok(multi), Ok(number)) = (content.u8(), content.u16()) else { continue };
                let format = Bytes::text(content.0);
                let name = instance(&format, u64::from(multi));
                if let Some(&at) = known.get(&name) {
                    numbers.insert(number, at);
                } else if let Some((layout, heads)) = layout(&format, &formats, account).map_err(over)?
                    && topics.len() < MOST_TOPICS
                    && columns + heads.len() <= MOST_COLUMNS
                {
                    columns += heads.len();
                    account.name(name.len()).map_err(over)?;
                    known.insert(name.clone(), topics.len());
                    let rank = match SENSORS.iter().any(|(sensor, _)| *sensor == format) {
                        true => 1 + u8::from(format != FILTERED),
                        false => 0,
                    };
                    numbers.insert(number, topics.len());
                    topics.push(Topic { rank, ..Topic::new(name, heads) });
                    layouts.push(layout);
                }
            }
            b'D' => {
                let Some(&topic) = content.u16().ok().and_then(|number| numbers.get(&number)) else { continue };
                row.clear();
                account.work(layouts[topic].numbers() * STEP / 8).map_err(over)?;
                layouts[topic].decode(content.0, &mut row);
                let columns = topics[topic].heads.len();
                for row in row.chunks_exact(columns) {
                    tally(&mut topics[topic], row.first().copied(), 1e-6);
                }
            }
            _ => {}
        }
    }
    // a topic that was only announced
    let used: Vec<usize> = (0..topics.len()).filter(|&i| topics[i].rows.is_some()).collect();
    if used.is_empty() {
        return Err(fail("no data in it".into()));
    }
    let (file, drawn) = (path.to_path_buf(), account.clone());
    let names: Vec<String> = used.iter().map(|&i| topics[i].name.clone()).collect();
    let layouts: Vec<Layout> = used.iter().map(|&i| layouts[i].clone()).collect();
    let topics = used.iter().map(|&i| topics[i].clone()).collect();
    let messages = move |topic: usize| {
        let (scanner, account) = (Scanner::open(&file)?, drawn.clone());
        let (name, layout) = (names[topic].clone(), layouts[topic].clone());
        Ok(Box::new(UlogTopic { scanner, account, name, layout, numbers: BTreeSet::new() }) as Box<dyn Messages>)
    };
    let (path, account) = (path.to_path_buf(), account.clone());
    Ok(RecordSource { format: "PX4 ULog", path, account, topics, messages: Box::new(messages) })
}

/// Name, first byte, type.
type Place = (String, usize, Number);

/// The fields of a format, those inside others too.
fn flatten(
    format: &str,
    formats: &BTreeMap<String, String>,
    depth: usize,
    account: &Account,
) -> Result<Option<Vec<Place>>, Excess> {
    let mut fields = Vec::new();
    let mut at = 0;
    let Some(format) = formats.get(format) else { return Ok(None) };
    for field in format.split(';').filter(|field| !field.is_empty()) {
        let Some((kind, name)) = field.trim().split_once(' ') else { return Ok(None) };
        let (kind, count) = match kind.split_once('[').map(|(kind, count)| (kind, count.strip_suffix(']'))) {
            Some((kind, count)) => match count.and_then(|count| count.parse::<usize>().ok()) {
                Some(count) => (kind, Some(count)),
                None => return Ok(None),
            },
            None => (kind, None),
        };
        for i in 0..count.unwrap_or(1) {
            let name = if count.is_some() { format!("{name}[{i}]") } else { name.to_string() };
            if fields.len() > MOST_FIELDS || at > MOST_FIELDS {
                return Ok(None);
            }
            if name.len() > LONGEST_NAME {
                return Err(Excess::Name(name.len()));
            }
            account.work(4 * STEP)?;
            let kind = match kind {
                "float" => Kind::Float(4),
                "double" => Kind::Float(8),
                "int8_t" => Kind::Signed(1),
                "int16_t" => Kind::Signed(2),
                "int32_t" => Kind::Signed(4),
                "int64_t" => Kind::Signed(8),
                "uint8_t" | "bool" | "char" => Kind::Unsigned(1),
                "uint16_t" => Kind::Unsigned(2),
                "uint32_t" => Kind::Unsigned(4),
                "uint64_t" => Kind::Unsigned(8),
                inner if formats.contains_key(inner) => {
                    let Some(inner) = flatten(inner, formats, deeper(depth)?, account)? else { return Ok(None) };
                    let Some(end) = inner.iter().map(|(_, at, number)| at + number.size()).max() else {
                        return Ok(None);
                    };
                    let longest = inner.iter().map(|(field, ..)| name.len() + 1 + field.len()).max();
                    if let Some(longest) = longest.filter(|longest| *longest > LONGEST_NAME) {
                        return Err(Excess::Name(longest));
                    }
                    fields.extend(
                        inner.into_iter().map(|(field, byte, kind)| (format!("{name}.{field}"), at + byte, kind)),
                    );
                    at += end;
                    continue;
                }
                _ => return Ok(None),
            };
            let number = Number { kind, big_endian: false };
            fields.push((name, at, number));
            at += number.size();
        }
    }
    Ok(Some(fields))
}

/// Layout and columns of a format.
fn layout(
    format: &str,
    formats: &BTreeMap<String, String>,
    account: &Account,
) -> Result<Option<(Layout, Vec<Head>)>, Excess> {
    let Some(fields) = flatten(format, formats, 0, account)? else { return Ok(None) };
    // as heads and in the layout, twice each
    fields.iter().try_for_each(|(name, ..)| account.columns(2, name.len()))?;
    Ok(columns(format, &fields))
}

/// Of these fields.
fn columns(format: &str, fields: &[(String, usize, Number)]) -> Option<(Layout, Vec<Head>)> {
    // of fields of one name the first
    let places: BTreeMap<&str, (usize, Number)> =
        fields.iter().rev().map(|(name, at, number)| (name.as_str(), (*at, *number))).collect();
    let field = |name: &str, unit: Option<&str>, head_name: &str| {
        let (at, number) = places.get(name)?;
        let head = head(name, head_name, unit);
        Some(Field { head, at: *at, number: *number, factor: 1.0, over_us: None })
    };
    if let Some(stem) = format.strip_suffix("_fifo").and_then(|stem| stem.strip_prefix("sensor_")) {
        let unit = if stem == "gyro" { "rad/s" } else { "m/s^2" };
        let time = field("timestamp_sample", Some("us"), "timestamp_sample")?;
        let axis = |axis: &str| field(&format!("{axis}[0]"), Some(unit), &format!("{stem}_{axis}"));
        let axes = [axis("x")?, axis("y")?, axis("z")?];
        let mut heads = vec![head("timestamp_sample", "timestamp", Some("us"))];
        heads.extend(["x", "y", "z"].iter().map(|axis| head(axis, &format!("{stem}_{axis}"), Some(unit))));
        let (step_us, samples) = (field("dt", None, "dt")?, field("samples", None, "samples")?);
        let scale = field("scale", None, "scale")?;
        return Some((Layout::Fifo(Box::new(Fifo { time, step_us, samples, scale, axes })), heads));
    }
    let known = SENSORS.iter().find(|(name, _)| *name == format).map_or(&[][..], |(_, fields)| *fields);
    let mut columns: Vec<Field> = Vec::new();
    for (name, ..) in fields.iter().filter(|(name, ..)| !name.contains("_padding")) {
        let unit = match known.iter().find(|(field, ..)| field == name) {
            Some((_, name, unit)) => (*name, Some(*unit)),
            None if name == "timestamp" || name == "timestamp_sample" => (name.as_str(), Some("us")),
            None if name == "temperature" && !known.is_empty() => (name.as_str(), Some("degC")),
            None => (name.as_str(), None),
        };
        columns.extend(field(name, unit.1, unit.0));
    }
    // increments over a length of time that each message says
    if format == "vehicle_imu" {
        let increments = [("delta_angle", "gyro", "rad/s"), ("delta_velocity", "accel", "m/s^2")];
        for (increment, sensor, unit) in increments {
            let length = [format!("{increment}_dt"), "dt".into()];
            let Some(length) = length.iter().find_map(|name| field(name, None, name)) else { continue };
            for (i, axis) in ["x", "y", "z"].iter().enumerate() {
                let Some(increment) = field(&format!("{increment}[{i}]"), None, "") else { continue };
                let name = format!("{sensor}_{axis}");
                let over_us = Some((length.at, length.number));
                columns.push(Field { head: head(&name, &name, Some(unit)), over_us, ..increment });
            }
        }
    }
    let heads = columns.iter().map(|column| column.head.clone()).collect::<Vec<_>>();
    (!heads.is_empty()).then_some((Layout::Fields(columns), heads))
}

/// The messages of one topic.
struct UlogTopic {
    scanner: Scanner,
    account: Account,
    name: String,
    layout: Layout,
    /// Numbers under which the topic is logged at this place of the file.
    numbers: BTreeSet<u16>,
}

impl Messages for UlogTopic {
    fn rewind(&mut self) -> Result<(), String> {
        self.numbers.clear();
        self.scanner.rewind()
    }
    fn next(&mut self, row: &mut Vec<Split>) -> Result<bool, String> {
        while let Some(kind) = self.scanner.next()? {
            let mut content = Bytes(&self.scanner.message);
            match kind {
                b'A' => {
                    let (Ok(multi), Ok(number)) = (content.u8(), content.u16()) else { continue };
                    match instance(&Bytes::text(content.0), u64::from(multi)) == self.name {
                        true => self.numbers.insert(number),
                        false => self.numbers.remove(&number),
                    };
                }
                b'D' => {
                    let Ok(number) = content.u16() else { continue };
                    if self.numbers.contains(&number) {
                        self.account.work(self.layout.numbers() * STEP / 8)?;
                        self.layout.decode(content.0, row);
                        return Ok(true);
                    }
                }
                _ => {}
            }
        }
        Ok(false)
    }
    fn damage(&self) -> Option<String> {
        self.scanner.damage()
    }
}

/// Message after message of the file.
struct Scanner {
    reader: BufReader<File>,
    at: u64,
    length: u64,
    /// Where sections begin that were appended later: a message before may be cut there.
    appended: VecDeque<u64>,
    passed_over: PassedOver,
    message: Vec<u8>,
}

impl Scanner {
    fn open(path: &Path) -> Result<Scanner, String> {
        let (reader, length) = opened(path)?;
        let mut scanner = Scanner {
            reader,
            at: 0,
            length,
            appended: VecDeque::new(),
            passed_over: PassedOver::default(),
            message: Vec::new(),
        };
        scanner.rewind()?;
        Ok(scanner)
    }

    fn rewind(&mut self) -> Result<(), String> {
        self.appended.clear();
        self.passed_over = PassedOver::default();
        self.jump(16)
    }

    fn jump(&mut self, at: u64) -> Result<(), String> {
        self.at = at;
        self.reader.seek(SeekFrom::Start(at)).map_err(|error| format!("cannot read: {error}"))?;
        Ok(())
    }

    fn damage(&self) -> Option<String> {
        self.passed_over.sentence(self.length)
    }

    /// The kind of the next message, whose content is in `message`.
    fn next(&mut self) -> Result<Option<u8>, String> {
        let io = |error: std::io::Error| format!("cannot read on: {error}");
        loop {
            let section = self.appended.front().copied().unwrap_or(self.length).min(self.length);
            let mut header = [0; 3];
            let whole = self.at + 3 <= section;
            if whole {
                self.reader.read_exact(&mut header).map_err(io)?;
            }
            let size = u64::from(u16::from_le_bytes([header[0], header[1]]));
            if whole && size > 0 && KINDS.contains(&header[2]) && self.at + 3 + size <= section {
                self.message.resize(size as usize, 0);
                self.reader.read_exact(&mut self.message).map_err(io)?;
                self.at += 3 + size;
                if header[2] == b'B' {
                    self.flags();
                }
                return Ok(Some(header[2]));
            }
            // the section ends inside a message, or this is no message
            let cut = !whole || (size > 0 && KINDS.contains(&header[2]));
            if cut && let Some(next) = self.appended.pop_front() {
                self.jump(next)?;
                continue;
            }
            if self.at >= self.length {
                return Ok(None);
            }
            if !self.resynchronise()? {
                return Ok(None);
            }
        }
    }

    /// Offsets of appended sections.
    fn flags(&mut self) {
        let mut content = Bytes(&self.message);
        let Ok(flags) = content.take(16) else { return };
        if flags[8] & 1 == 1 {
            let offsets = (0..3).filter_map(|_| content.number(8).ok());
            self.appended = offsets.filter(|&at| at > self.at && at < self.length).collect();
        }
    }

    /// Goes on behind the next synchronisation message.
    fn resynchronise(&mut self) -> Result<bool, String> {
        let from = self.at;
        self.jump(from + 1)?;
        let mut matched = 0;
        let mut at = from + 1;
        loop {
            let buffer = self.reader.fill_buf().map_err(|error| format!("cannot read on: {error}"))?;
            if buffer.is_empty() {
                self.passed_over.count(from, self.length - from);
                self.at = self.length;
                return Ok(false);
            }
            let mut used = 0;
            for &byte in buffer {
                used += 1;
                matched = if byte == SYNC[matched] { matched + 1 } else { usize::from(byte == SYNC[0]) };
                if matched == SYNC.len() {
                    break;
                }
            }
            at += used as u64;
            self.reader.consume(used);
            if matched == SYNC.len() {
                self.passed_over.count(from, at - from);
                self.at = at;
                while self.appended.front().is_some_and(|&next| next < at) {
                    self.appended.pop_front();
                }
                return Ok(true);
            }
        }
    }
}
