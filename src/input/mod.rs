//! Log files to [`Recording`] (floor 2): recognise the format, choose columns, units and rate, read in one or two
//! streaming passes.

mod account;
mod arrays;
mod bytes;
mod clock;
mod columns;
mod dataflash;
mod hdf5;
pub mod inspect;
mod mat;
mod mcap;
mod memory;
mod names;
mod npy;
mod number;
mod parquet;
mod records;
mod ros;
mod rosbag;
mod rows;
mod sniff;
mod source;
mod sqlite;
mod table;
mod temperature;
mod text;
mod ulog;

use std::io::Read;
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use self::columns::Choice;
use self::rows::{Batch, Part, Rows, WORTHWHILE};
use self::table::{BLOCK, Table};
use crate::numerics::progress::{checkpoint, lent};
use crate::signal::check::{AxisRange, BackwardStamp, Checker, Finding, FindingKind, Outcome, TimeBase};
use crate::signal::{Axis, Gap, LogCheck, Recording};
use crate::units::{Dimension, Quantity, Unit, plain};

pub use crate::signal::check::InputKind;
pub use temperature::TemperatureColumn;

/// The flags every command that takes LOG has.
#[derive(Clone, Debug, Default)]
pub struct LogOptions {
    /// Names or 1-based numbers.
    pub columns: Option<Vec<String>>,
    /// `NAME`, `NAME:ms`, a 1-based number, or `none`.
    pub time: Option<String>,
    /// Unit of the columns when the header does not say; a flag that contradicts the header is an error.
    pub unit: Option<Unit>,
    /// Hz. With a time column it overrides the stamps (they are then only checked).
    pub rate_hz: Option<f64>,
    /// Seconds from the start of the log.
    pub start_s: Option<f64>,
    pub end_s: Option<f64>,
    /// What the values are: rate (default), increments over one sample, or the running integral. The unit's
    /// dimension must agree.
    pub kind: InputKind,
    /// Prefer this quantity when the log holds both (default angular rate).
    pub quantity: Option<Quantity>,
    /// Which table of a file with several.
    pub topic: Option<String>,
    /// Only [`read`] takes it.
    pub temperature: TemperatureColumn,
    /// Columns beside the axes, of any dimension.
    pub extra: Vec<ExtraColumn>,
    /// Leave out the SHA-256 of the file, which costs about as much as reading it; only [`read`] does.
    pub no_digest: bool,
}

impl LogOptions {
    /// The quantity that the flags say, by name or by the dimension of the unit.
    fn sought(&self) -> Option<Quantity> {
        self.quantity.or_else(|| self.unit.as_ref().and_then(|unit| columns::quantity_of(unit, self.kind)))
    }
}

/// A column that is no axis of the sensor: its empty fields are no fault of the log.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraColumn {
    /// Name or 1-based number.
    pub column: String,
    /// When the header does not say it.
    pub unit: Option<Unit>,
    pub dimension: Dimension,
    /// How the unit is said: "--aid heading=yaw:deg".
    pub flag: String,
}

/// One line: file, line or column, found, expected, what to do.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct InputError {
    pub message: String,
    /// Options that would answer what the log does not say, each with a value that may be right.
    pub missing: Vec<(&'static str, String)>,
}

impl InputError {
    pub fn new(message: impl Into<String>) -> InputError {
        InputError { message: message.into(), missing: Vec::new() }
    }

    fn lacking<T>(mut self, option: &'static str, value: impl Into<String>) -> Result<T, InputError> {
        self.missing.push((option, value.into()));
        Err(self)
    }
}

/// One axis as found in the log.
#[derive(Clone, Debug)]
pub struct AxisInfo {
    pub name: String,
    pub unit: Unit,
}

/// Consecutive samples handed out by [`LogReader::next_block`].
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// Per axis, SI values (NaN: unusable). All the same length.
    pub values: Vec<Vec<f64>>,
    /// The extra columns that were asked for, likewise.
    pub extra: Vec<Vec<f64>>,
    /// Per sample: how many samples are missing right before it (0 nearly always).
    pub missing: Vec<u64>,
    /// Seconds from the first sample of the log, per sample.
    pub time_s: Vec<f64>,
}

/// The rows between `--start` and `--end`: from the first row at or after the start to the last before one beyond
/// the end.
#[derive(Clone, Debug)]
struct Selection {
    start_s: f64,
    end_s: f64,
    /// Rows of the file seen so far.
    seen: u64,
    started: bool,
}

impl Selection {
    fn new(options: &LogOptions) -> Self {
        let (start_s, end_s) = (options.start_s.unwrap_or(f64::NEG_INFINITY), options.end_s.unwrap_or(f64::INFINITY));
        Selection { start_s, end_s, seen: 0, started: false }
    }
    /// The part of a block that is wanted, and whether nothing can follow. `time(i, row)`: seconds of row i of the
    /// block, which is the given row of the file.
    fn take(&mut self, rows: usize, time: impl Fn(usize, u64) -> f64) -> (Range<usize>, bool) {
        let seen = self.seen;
        self.seen += rows as u64;
        let mut first = 0;
        if !self.started {
            match (0..rows).find(|&i| time(i, seen + i as u64) >= self.start_s) {
                Some(i) => first = i,
                None => return (rows..rows, false),
            }
            self.started = true;
        }
        if self.end_s == f64::INFINITY {
            return (first..rows, false);
        }
        let beyond = |i: &usize| time(*i, seen + *i as u64) > self.end_s;
        match (first..rows).find(beyond) {
            Some(end) => (first..end, true),
            None => (first..rows, false),
        }
    }
}

/// An open log with what was decided about it.
struct Log {
    table: Box<dyn Table + Send>,
    choice: Choice,
    options: LogOptions,
    /// What was decided that the flags do not say.
    notes: Vec<Finding>,
}

/// What the first pass found.
struct Scan {
    check: LogCheck,
    gaps: Vec<Gap>,
    /// First sample read, in seconds from the start of the log, and the log's own time there.
    first_s: f64,
    start_s: f64,
}

impl Log {
    fn open(path: &Path, options: &LogOptions) -> Result<Log, InputError> {
        let fail = |what: &str| Err(InputError::new(format!("{}: {what}", path.display())));
        if options.rate_hz.is_some_and(|rate| !rate.is_finite() || rate <= 0.0) {
            return fail("`rate` must be a positive number of Hz");
        }
        if [options.start_s, options.end_s].iter().flatten().any(|t| !t.is_finite() || *t < 0.0) {
            return fail("`start` and `end` are seconds from the start of the log, 0 or more");
        }
        if let (Some(start), Some(end)) = (options.start_s, options.end_s)
            && start >= end
        {
            return fail("`start` must be before `end`");
        }
        let (mut table, note) = source::choose(path, source::open(path)?, options)?;
        let (named, place, rate) = (table.named(), table.place(), table.rate());
        let rate_hz = rate.as_ref().map(|(_, rate)| *rate);
        let choice = columns::Table { heads: &table.heads(), named, place: &place, rate_hz }.choose(options);
        let choice = choice.map_err(|error| clock::offer(error, &mut *table))?;
        let mut notes: Vec<Finding> = note.map(|note| Finding::note(FindingKind::Topic, note)).into_iter().collect();
        let mut options = options.clone();
        if choice.time.is_none()
            && let (None, Some((name, rate))) = (options.rate_hz, rate)
        {
            options.rate_hz = Some(rate);
            notes.push(Finding::note(FindingKind::Rate, format!("{rate} Hz by '{name}' of the file")));
        }
        let beside = choice.temperature.column.as_ref().map(|(column, _)| *column);
        table.select(choice.time.as_ref().map(|(column, _)| *column), &choice.columns, beside);
        Ok(Log { table, choice, options, notes })
    }

    /// Stamps that are used for time.
    fn stamped(&self) -> bool {
        self.choice.time.is_some() && self.options.rate_hz.is_none()
    }

    /// Next wanted rows, stamps in seconds and values in SI; `None` at the end.
    fn next(&mut self, selection: &mut Selection, rows: &mut Rows) -> Result<Option<(Range<usize>, bool)>, InputError> {
        checkpoint();
        if !self.table.next_rows(rows)? {
            return Ok(None);
        }
        match self.choice.to_si(rows, self.stamped()) {
            Some(empty) => Err(self.empty_stamp(rows, empty)),
            None => Ok(Some(self.wanted(selection, rows))),
        }
    }

    fn wanted(&self, selection: &mut Selection, rows: &Rows) -> (Range<usize>, bool) {
        let stamped = self.stamped();
        let rate = self.options.rate_hz.unwrap_or(f64::NAN);
        let time = |i: usize, row: u64| if stamped { rows.time[i] } else { row as f64 / rate };
        selection.take(rows.lines.len(), time)
    }

    fn empty_stamp(&self, rows: &Rows, empty: usize) -> InputError {
        let heads = self.table.heads();
        let column = self.choice.time.as_ref().map_or(0, |(column, _)| *column);
        let table = columns::Table { heads: &heads, named: self.table.named(), place: "", rate_hz: None };
        InputError::new(format!(
            "{}, column '{}': the time stamp is empty; choose another with `time`{}, or give `rate` HZ",
            self.table.row_place(rows.line(empty)),
            heads[column].full,
            table.other_times(column)
        ))
    }

    /// The next parts: read, and then made ready on all threads.
    fn gather(&mut self, selection: &mut Selection, batch: &mut Batch) {
        // nothing is read far behind the end that was asked for
        let one = self.options.end_s.is_some();
        (batch.count, batch.last, batch.fault) = (0, false, None);
        let mut read = 0;
        while !batch.last && (batch.count == 0 || !one && (read < WORTHWHILE || self.table.at_hand())) {
            batch.parts.resize_with(batch.parts.len().max(batch.count + 1), Part::default);
            let rows = &mut batch.parts[batch.count].rows;
            match self.table.next_rows(rows) {
                Ok(true) => (batch.count, read) = (batch.count + 1, read + rows.lines.len()),
                Ok(false) => batch.last = true,
                Err(fault) => (batch.last, batch.fault) = (true, Some(fault)),
            }
        }
        let (choice, stamped) = (&self.choice, self.stamped());
        let ready = batch.parts[..batch.count].par_iter_mut().map(|part| choice.to_si(&mut part.rows, stamped));
        let empty: Vec<Option<usize>> = ready.collect();
        for (i, empty) in empty.into_iter().enumerate() {
            let part = &mut batch.parts[i];
            if let Some(empty) = empty {
                (batch.count, batch.last, batch.fault) = (i, true, Some(self.empty_stamp(&part.rows, empty)));
                return;
            }
            part.before = selection.seen;
            let (wanted, last) = self.wanted(selection, &part.rows);
            part.wanted = wanted;
            if last {
                (batch.count, batch.last, batch.fault) = (i + 1, true, None);
                return;
            }
        }
    }

    /// The checking pass; every wanted row is kept in the columns given, if any. Rows are checked and kept while the
    /// next ones are read.
    fn scan(&mut self, kept: &mut [Vec<f64>]) -> Result<Scan, InputError> {
        let mut period = None;
        loop {
            let axes = self.choice.axes.iter().map(|a| (a.name.as_str(), &a.unit));
            let (rate, stamped) = (self.options.rate_hz, self.choice.time.is_some());
            let mut checker = Checker::new(axes, self.choice.quantity, self.options.kind, rate, stamped, period);
            let mut selection = Selection::new(&self.options);
            let (mut batch, mut coming) = (Batch::default(), Batch::default());
            let mut first_s = 0.0;
            self.gather(&mut selection, &mut batch);
            loop {
                let parts = batch.parts();
                if checker.rows() == 0
                    && let Some(part) = parts.iter().find(|part| !part.wanted.is_empty())
                {
                    let start = part.wanted.start;
                    let skipped = part.before + start as u64;
                    first_s = if self.stamped() { part.rows.time[start] } else { skipped as f64 / rate.unwrap_or(1.0) };
                    checker.set_offset(first_s);
                }
                let check = || checker.push(&parts.iter().map(Part::samples).collect::<Vec<_>>());
                let keep = || {
                    kept.par_iter_mut().enumerate().filter(|_| period.is_none()).for_each(|(i, kept)| {
                        parts.iter().for_each(|part| kept.extend_from_slice(&part.rows.values[i][part.wanted.clone()]));
                    });
                };
                let next = || {
                    if !batch.last {
                        self.gather(&mut selection, &mut coming);
                    }
                };
                let ((checked, ()), ()) = rayon::join(|| rayon::join(check, keep), next);
                checked.map_err(|back: BackwardStamp| {
                    let part = &parts[back.part];
                    self.backward(&back, part.rows.line(part.wanted.start + back.row))
                })?;
                if let Some(fault) = batch.fault {
                    return Err(fault);
                }
                if batch.last {
                    break;
                }
                std::mem::swap(&mut batch, &mut coming);
            }
            self.enough(checker.rows(), &selection)?;
            match checker.finish() {
                Outcome::Done { mut check, gaps, axes } => {
                    let damage = self.table.notes().into_iter().map(|note| Finding::note(FindingKind::Damaged, note));
                    let damage = damage.map(|note| Finding { serious: true, ..note });
                    check.findings.splice(0..0, self.notes.iter().cloned().chain(damage));
                    self.usable(&axes, &check)?;
                    let origin = self.choice.time.as_ref().map_or(0.0, |(_, unit)| unit.to_si(self.table.origin()));
                    return Ok(Scan { check, gaps, first_s, start_s: origin + first_s });
                }
                Outcome::NoTime => return self.fail("the time stamps do not advance; give `rate` HZ to ignore them"),
                Outcome::Again { period_s } => {
                    period = Some(period_s);
                    self.table.rewind()?;
                }
            }
        }
    }

    fn fail<T>(&self, what: impl std::fmt::Display) -> Result<T, InputError> {
        Err(InputError::new(format!("{}: {what}", self.table.place())))
    }

    fn enough(&self, rows: u64, selection: &Selection) -> Result<(), InputError> {
        match rows {
            0 if selection.seen > 0 => self.fail("no sample lies between `start` and `end`"),
            0 => self.fail("no rows of numbers"),
            1 => self.fail("there is only one sample; at least two are needed"),
            _ => Ok(()),
        }
    }

    fn backward(&self, back: &BackwardStamp, line: u64) -> InputError {
        InputError::new(format!(
            "{}: time goes back from {:.6} s to {:.6} s after the start of the log; stop before it with `end`, or give \
             `rate` HZ to ignore the stamps",
            self.table.row_place(line),
            back.from_s,
            back.to_s
        ))
    }

    /// Refuses an axis in which nothing can be analysed.
    fn usable(&self, axes: &[AxisRange], check: &LogCheck) -> Result<(), InputError> {
        for (axis, info) in axes.iter().zip(&self.choice.axes) {
            if axis.usable == 0 {
                let of_it =
                    |found: &&Finding| found.kind == FindingKind::Overflow && found.axis.as_ref() == Some(&axis.name);
                let why = check.findings.iter().find(of_it).map(|found| format!(": {}", found.message));
                let (name, rows) = (&axis.name, check.samples);
                return self.fail(format!("column '{name}' holds no number in {rows} rows{}", why.unwrap_or_default()));
            }
            if axis.smallest == axis.largest {
                let value = info.unit.from_si(axis.smallest);
                return self.fail(format!(
                    "column '{}' is constant: {value} {} in all {} usable rows; is it the right column?",
                    axis.name, info.unit, axis.usable
                ));
            }
        }
        Ok(())
    }
}

/// A log opened for streaming with bounded memory: one checking pass is made at `open`, blocks are then read in a
/// second pass.
pub struct LogReader {
    log: Log,
    scan: Scan,
    sha256: String,
    selection: Selection,
    rows: Rows,
    /// Samples handed out, and gaps passed.
    index: u64,
    gap: usize,
    ended: bool,
}

impl LogReader {
    pub fn open(path: &Path, options: &LogOptions) -> Result<LogReader, InputError> {
        let path = &source::resolve(path)?;
        let mut log = Log::open(path, options)?;
        let (sha256, scan) = rayon::join(|| sha256(path), || log.scan(&mut []));
        let (scan, sha256) = (scan?, sha256?);
        log.table.rewind()?;
        let selection = Selection::new(options);
        Ok(LogReader { log, scan, sha256, selection, rows: Rows::default(), index: 0, gap: 0, ended: false })
    }
    pub fn axes(&self) -> &[AxisInfo] {
        &self.log.choice.axes
    }
    pub fn quantity(&self) -> Quantity {
        self.log.choice.quantity
    }
    /// The check of the whole log (made at open); its `sample_rate_hz` is the rate used.
    pub fn check(&self) -> &LogCheck {
        &self.scan.check
    }
    /// Hex SHA-256 of the file as stored.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }
    /// False at the end.
    pub fn next_block(&mut self, block: &mut Block) -> Result<bool, InputError> {
        block.missing.clear();
        block.time_s.clear();
        block.values.resize_with(self.axes().len(), Vec::new);
        block.extra.resize_with(self.log.choice.extra.len(), Vec::new);
        block.values.iter_mut().chain(&mut block.extra).for_each(Vec::clear);
        while !self.ended {
            let Some((wanted, last)) = self.log.next(&mut self.selection, &mut self.rows)? else {
                self.ended = true;
                break;
            };
            self.ended = last;
            if wanted.is_empty() {
                continue;
            }
            for (out, column) in block.values.iter_mut().chain(&mut block.extra).zip(&self.rows.values) {
                out.extend_from_slice(&column[wanted.clone()]);
            }
            let stamped = self.scan.check.time_base == TimeBase::Stamps;
            for row in wanted {
                let gap = self.scan.gaps.get(self.gap).filter(|gap| gap.index as u64 == self.index);
                self.gap += usize::from(gap.is_some());
                block.missing.push(gap.map_or(0, |gap| gap.missing));
                block.time_s.push(if stamped {
                    self.rows.time[row]
                } else {
                    self.scan.first_s + self.index as f64 / self.scan.check.sample_rate_hz
                });
                self.index += 1;
            }
            return Ok(true);
        }
        Ok(false)
    }
}

/// The whole log in memory with its check.
pub fn read(path: &Path, options: &LogOptions) -> Result<(Recording, LogCheck), InputError> {
    let path = &source::resolve(path)?;
    let mut log = Log::open(path, options)?;
    let beside = usize::from(log.choice.temperature.column.is_some());
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); log.choice.axes.len() + beside];
    if let (Some(rows), None, None) = (log.table.about(), options.start_s, options.end_s) {
        // once for all, so that nothing is moved; without that room the columns grow
        values.iter_mut().for_each(|column| drop(column.try_reserve_exact(rows as usize)));
    }
    let (sha256, scan) =
        rayon::join(|| (!options.no_digest).then(|| sha256(path)).transpose(), || log.scan(&mut values));
    let (mut scan, sha256) = (scan?, sha256?);
    let axis = |(info, mut values): (AxisInfo, Vec<f64>)| {
        values.shrink_to_fit();
        Axis { name: info.name, unit: info.unit, values }
    };
    let beside = values.split_off(log.choice.axes.len()).pop();
    let (temperature, note) = temperature::usable(log.choice.temperature.clone(), beside, options)
        .or_else(|what| log.fail(what))
        .map(|(found, note)| (found.map(axis), note))?;
    scan.check.findings.extend(note);
    let axes = log.choice.axes.into_iter().zip(values).map(axis);
    let recording = Recording {
        name: path.file_name().map_or_else(|| path.display().to_string(), |n| plain(&n.to_string_lossy()).into_owned()),
        quantity: log.choice.quantity,
        sample_rate_hz: scan.check.sample_rate_hz,
        start_s: scan.start_s,
        axes: axes.collect(),
        gaps: scan.gaps,
        temperature,
        sha256,
    };
    Ok((recording, scan.check))
}

/// Hex SHA-256 of the file's bytes as stored, or of the numbers of a log in memory.
pub fn sha256(path: &Path) -> Result<String, InputError> {
    if let Some(samples) = lent(path) {
        return Ok(memory::sha256(&*samples));
    }
    let fail = |error: std::io::Error| InputError::new(format!("{}: cannot read: {error}", path.display()));
    let mut file = std::fs::File::open(path).map_err(fail)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0u8; 1 << 16];
    loop {
        checkpoint();
        match file.read(&mut buffer).map_err(fail)? {
            0 => return Ok(hex(&hash.finalize())),
            n => hash.update(&buffer[..n]),
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
