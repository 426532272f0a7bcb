//! The log check: rate and jitter, gaps, repeated or backward stamps, NaN, stuck and saturated values, quantisation
//! step, motion, outliers; each with count and place. Works in one streaming pass with bounded memory.
//!
//! The rules are stated where they are applied: for time in `stamps`, for one axis in `axis`, for whole rows here:
//! - *Zero row*: every axis exactly 0, more often than independent axes with the zeros of each would make it by
//!   chance (less than 1 in 10⁶).
//! - *Repeated row*: every axis equal to the row before, by the same rule, in more than 1 % of the rows: the sensor
//!   is slower than the log.
//!
//! Nothing is repaired. NaN stays NaN, a gap stays a gap with its number of missing samples, everything else is kept.

mod axis;
mod calm;
mod line;
pub(super) mod robust;
mod stamps;
mod together;
mod windows;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use self::axis::AxisCheck;
use self::robust::short;
use self::stamps::{Count, Stamps, Timing, Verdict};
use self::together::Together;
use super::Gap;
use crate::units::{Quantity, Unit};

/// Hz: no inertial sensor hands out more (32 kHz is the highest output data rate of the ICM-20649 and ICM-42688
/// families).
const FASTEST: f64 = 32_000.0;
/// Seconds: in which no drift can be seen, and hardly noise; stamps in seconds that are read as milliseconds make a
/// log of minutes so short.
const SHORTEST: f64 = 1.0;

/// How time was established.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TimeBase {
    /// No time column: the rate was given.
    Given,
    /// Time column with usable stamps; gaps are found from it.
    Stamps,
    /// Stamps are bursty (host arrival times): only their mean rate is used and gaps inside bursts cannot be seen.
    MeanRate,
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FindingKind {
    /// Stamps scatter about an even grid.
    Jitter,
    /// The unit of the time column looks wrong.
    TimeUnit,
    /// Samples are missing.
    Gap,
    /// A stamp comes again.
    RepeatedStamp,
    /// A stamp is before the one before it.
    BackwardStamp,
    /// The rate is not what something else says.
    Rate,
    /// A row of zeros among others.
    ZeroRow,
    /// A row is that before it.
    RepeatedRow,
    /// Empty or no number.
    Nan,
    /// Beyond what any sensor gives.
    Overflow,
    /// One value over and over.
    Stuck,
    /// At an end of the range for some time.
    Saturated,
    /// Few values, far apart.
    Quantised,
    /// Far from its surroundings.
    Outlier,
    /// The sensor does not rest.
    Motion,
    /// What part of a moving log is at rest.
    Calm,
    /// Which column is the temperature, or why none is.
    Temperature,
    /// Which table of several was read.
    Topic,
    /// A part of the file could not be read.
    Damaged,
}

/// One thing found, with how often and where it is first seen (sample index, 0-based; and seconds from the start).
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Finding {
    pub kind: FindingKind,
    pub axis: Option<String>,
    pub count: u64,
    pub first_index: u64,
    pub first_s: f64,
    /// One sentence for a person, with numbers and units, and what was done about it.
    pub message: String,
    /// True when results cannot be trusted without acting on it.
    pub serious: bool,
}

impl Finding {
    /// What is no fault but should be known.
    pub fn note(kind: FindingKind, message: String) -> Finding {
        Finding { kind, axis: None, count: 1, first_index: 0, first_s: 0.0, message, serious: false }
    }
}

/// What the check of a whole log says.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LogCheck {
    pub samples: u64,
    pub sample_rate_hz: f64,
    pub span_s: f64,
    pub time_base: TimeBase,
    /// Robust spread of the time steps, s (0 without stamps).
    pub jitter_s: f64,
    /// Total number of samples missing in gaps.
    pub missing: u64,
    pub findings: Vec<Finding>,
}

impl LogCheck {
    /// The axis, or the log as a whole, was found not to be at rest.
    pub fn moves(&self, axis: &str) -> bool {
        self.findings.iter().any(|f| f.kind == FindingKind::Motion && f.axis.as_deref().is_none_or(|name| name == axis))
    }

    /// For a log that is meant to move: says nothing of it.
    pub fn expect_motion(&mut self) {
        self.findings.retain(|finding| finding.kind != FindingKind::Motion && finding.kind != FindingKind::Calm);
    }
}

/// What the values of a log are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InputKind {
    /// Angular rate or specific force.
    #[default]
    Rate,
    /// Increments over one sample.
    Increments,
    /// The running integral.
    Angle,
}

/// Where a sample stands: index in what is read, and its stamp in seconds (NaN without stamps).
#[derive(Clone, Copy, Debug)]
struct Place {
    index: u64,
    time_s: f64,
}

/// Where consecutive samples stand: the index of the first, and their stamps if they have any.
#[derive(Clone, Copy, Debug)]
struct Places<'a> {
    first: u64,
    times: &'a [f64],
}

impl<'a> Places<'a> {
    fn at(&self, i: usize) -> Place {
        Place { index: self.first + i as u64, time_s: self.times.get(i).copied().unwrap_or(f64::NAN) }
    }
    fn skip(self, count: usize) -> Places<'a> {
        Places { first: self.first + count as u64, times: self.times.get(count..).unwrap_or_default() }
    }
}

/// Consecutive rows: stamps in s (as many as rows, or none), and for each axis (more columns may follow) values in SI.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    pub times: &'a [f64],
    pub axes: Vec<&'a [f64]>,
}

/// Time that goes back, at this row of this part of what was pushed.
#[derive(Clone, Copy, Debug)]
pub struct BackwardStamp {
    pub part: usize,
    pub row: usize,
    pub from_s: f64,
    pub to_s: f64,
}

/// What is known of one axis after the pass: values in SI.
#[derive(Clone, Debug)]
pub struct AxisRange {
    pub name: String,
    /// Neither empty nor NaN.
    pub usable: u64,
    pub smallest: f64,
    pub largest: f64,
}

/// The result of [`Checker::finish`].
#[derive(Debug)]
pub enum Outcome {
    Done {
        check: LogCheck,
        gaps: Vec<Gap>,
        axes: Vec<AxisRange>,
    },
    /// The beginning of the log was not typical of its rate: make the pass again with this period, s.
    Again {
        period_s: f64,
    },
    /// The stamps do not advance.
    NoTime,
}

/// The check in the making: push blocks, then finish.
#[derive(Debug)]
pub struct Checker {
    axes: Vec<AxisCheck>,
    stamps: Option<Stamps>,
    rate_hz: Option<f64>,
    /// Seconds from the start of the log to the first sample pushed.
    offset_s: f64,
    rows: u64,
    together: Together,
}

impl Checker {
    /// `rate_hz`: given by the user, in Hz; stamps are then only looked at. `period_s`: from [`Outcome::Again`].
    pub fn new<'a>(
        axes: impl IntoIterator<Item = (&'a str, &'a Unit)>,
        quantity: Quantity,
        kind: InputKind,
        rate_hz: Option<f64>,
        stamped: bool,
        period_s: Option<f64>,
    ) -> Self {
        let axes: Vec<AxisCheck> =
            axes.into_iter().map(|(name, unit)| AxisCheck::new(name, unit, quantity, kind)).collect();
        Checker {
            together: Together::new(axes.len()),
            axes,
            stamps: stamped.then(|| Stamps::new(period_s)),
            rate_hz,
            offset_s: 0.0,
            rows: 0,
        }
    }

    /// Samples so far.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Seconds from the start of the log to the first sample, where stamps do not say it.
    pub fn set_offset(&mut self, seconds: f64) {
        self.offset_s = seconds;
    }

    /// Further rows, part by part. Backward time is an error unless the rate was given.
    pub fn push(&mut self, parts: &[Samples]) -> Result<(), BackwardStamp> {
        let axes = self.axes.len();
        let placed: Vec<(Places, &[&[f64]])> = parts
            .iter()
            .map(|part| {
                let places = Places { first: self.rows, times: part.times };
                let columns = part.axes.get(..axes).unwrap_or_default();
                self.rows += columns.first().map_or(0, |column| column.len()) as u64;
                (places, columns)
            })
            .collect();
        let (axes, together, stamps) = (&mut self.axes, &mut self.together, self.stamps.as_mut());
        let strict = self.rate_hz.is_none();
        let each_axis = || {
            axes.par_iter_mut().enumerate().for_each(|(i, axis)| {
                placed.iter().for_each(|(places, columns)| axis.add_all(columns[i], *places));
            });
        };
        let all_axes = || placed.iter().for_each(|(places, columns)| together.add_all(columns, *places));
        let time = || {
            stamps.and_then(|stamps| {
                placed.iter().enumerate().find_map(|(part, (places, _))| {
                    let (row, from_s) = stamps.add_all(*places, strict)?;
                    Some(BackwardStamp { part, row, from_s, to_s: places.at(row).time_s })
                })
            })
        };
        let (back, _) = rayon::join(time, || rayon::join(each_axis, all_axes));
        back.map_or(Ok(()), Err)
    }

    pub fn finish(mut self) -> Outcome {
        let mut notes = Vec::new();
        let looked = self.stamps.as_ref().map(|stamps| stamps.clone().finish());
        let (base, rate_hz, timing) = match (self.rate_hz, looked) {
            (Some(rate), looked) => {
                if let Some(stamps) = &self.stamps {
                    overridden(rate, stamps, looked.as_ref(), &mut notes);
                }
                (TimeBase::Given, rate, None)
            }
            (None, Some(Verdict::LookAgain(period_s))) => return Outcome::Again { period_s },
            (None, Some(Verdict::Timing(timing))) => {
                let base = if timing.usable { TimeBase::Stamps } else { TimeBase::MeanRate };
                (base, 1.0 / timing.period, Some(timing))
            }
            (None, None | Some(Verdict::NoTime)) => return Outcome::NoTime,
        };
        let clock = Clock { stamped: base == TimeBase::Stamps, rate_hz, offset_s: self.offset_s };
        let mut findings: Vec<Finding> = notes.into_iter().map(|note| clock.finding(None, note)).collect();
        if let (Some(timing), Some(stamps)) = (&timing, &self.stamps) {
            findings.extend(time_notes(timing, stamps, rate_hz, self.rows).into_iter().map(|n| clock.finding(None, n)));
        }
        findings.extend(self.row_notes().into_iter().map(|note| clock.finding(None, note)));
        let mut axes = Vec::with_capacity(self.axes.len());
        for axis in &mut self.axes {
            let (smallest, largest) = axis.range;
            axes.push(AxisRange { name: axis.name.clone(), usable: axis.usable, smallest, largest });
            let name = axis.name.clone();
            findings.extend(axis.findings(rate_hz).into_iter().map(|note| clock.finding(Some(&name), note)));
        }
        if findings.iter().any(|finding| finding.kind == FindingKind::Motion) {
            let windows: Vec<_> = self.axes.iter().map(|axis| axis.calmness(rate_hz)).collect();
            findings.extend(calm::note(&windows, self.rows, &clock).map(|note| clock.finding(None, note)));
        }
        let (jitter_s, gaps) = timing.map_or((0.0, Vec::new()), |t| (t.spread, t.gaps));
        let missing = gaps.iter().map(|g| g.missing).sum();
        let span_s = (self.rows + missing) as f64 / rate_hz;
        let check = LogCheck {
            samples: self.rows,
            sample_rate_hz: rate_hz,
            span_s,
            time_base: base,
            jitter_s,
            missing,
            findings,
        };
        Outcome::Done { check, gaps, axes }
    }

    fn row_notes(&self) -> Vec<Note> {
        let mut notes = Vec::new();
        let rows = self.rows as f64;
        if self.axes.len() < 2 {
            return notes; // one axis cannot be told from its own values
        }
        // rows by chance if the axes are independent: each axis' share is taken from the rows in which some other
        // axis differs
        let by_chance = |count: u64, alike: &dyn Fn(&AxisCheck) -> u64, alone: &[u64]| {
            let share = |(axis, alone): (&AxisCheck, &u64)| {
                (alike(axis) - count) as f64 / (rows - (count + alone) as f64).max(1.0)
            };
            rows * self.axes.iter().zip(alone).map(share).product::<f64>()
        };
        let together = &self.together;
        if let Count { count, first: Some(first) } = together.zero.rows
            && unlikely(count as f64, by_chance(count, &|axis| axis.zeros, &together.zero.all_but))
        {
            notes.push(Note {
                kind: FindingKind::ZeroRow,
                count,
                first: Some(first),
                message: format!("{count} of {} rows are zero on every axis; kept", self.rows),
                serious: count > 2 && count as f64 > 1e-3 * rows,
            });
        }
        if let Count { count, first: Some(first) } = together.repeated.rows
            && count as f64 > 0.01 * rows
            && unlikely(count as f64, by_chance(count, &|axis| axis.repeats, &together.repeated.all_but))
        {
            notes.push(Note {
                kind: FindingKind::RepeatedRow,
                count,
                first: Some(first),
                message: format!(
                    "{count} of {} rows repeat the row before on every axis: the sensor is slower than the log; kept",
                    self.rows
                ),
                serious: count as f64 > 0.1 * rows,
            });
        }
        notes
    }
}

/// A finding before its place is put into words; no place if it is about the whole log.
struct Note {
    kind: FindingKind,
    count: u64,
    first: Option<Place>,
    message: String,
    serious: bool,
}

/// Seconds from the start of the log of a sample.
struct Clock {
    stamped: bool,
    rate_hz: f64,
    offset_s: f64,
}

impl Clock {
    fn seconds(&self, place: Place) -> f64 {
        let by_stamp = self.stamped && place.time_s.is_finite();
        if by_stamp { place.time_s } else { self.offset_s + place.index as f64 / self.rate_hz }
    }

    /// The note with its place in words.
    fn finding(&self, axis: Option<&str>, note: Note) -> Finding {
        let first = note.first.unwrap_or(Place { index: 0, time_s: f64::NAN });
        let first_s = self.seconds(first);
        let axis_name = axis.map(|name| format!("{name}: ")).unwrap_or_default();
        let place = match note.first {
            Some(first) => format!("; first at sample {} ({} s)", first.index, short(first_s)),
            None => String::new(),
        };
        let message = format!("{axis_name}{}{place}", note.message);
        Finding {
            kind: note.kind,
            axis: axis.map(str::to_string),
            count: note.count,
            first_index: first.index,
            first_s,
            message,
            serious: note.serious,
        }
    }
}

/// Notes about stamps that decide the rate.
fn time_notes(timing: &Timing, stamps: &Stamps, rate_hz: f64, rows: u64) -> Vec<Note> {
    let mut notes = Vec::new();
    if !timing.usable {
        let message = format!(
            "the steps of the time stamps are too uneven for the sensor's clock (longest {} s, mean {} s): their mean \
             rate {} Hz is used, and gaps cannot be seen",
            short(stamps.longest),
            short(timing.period),
            short(rate_hz)
        );
        notes.push(Note { kind: FindingKind::Jitter, count: rows, first: None, message, serious: false });
    } else if timing.spread > 0.05 * timing.period {
        let percent = short(100.0 * timing.spread / timing.period);
        let message = format!("time steps scatter by {} s, {percent} % of the period", short(timing.spread));
        notes.push(Note { kind: FindingKind::Jitter, count: rows, first: None, message, serious: false });
    }
    if let Some(gap) = timing.gaps.first() {
        let missing: u64 = timing.gaps.iter().map(|g| g.missing).sum();
        let count = timing.gaps.len() as u64;
        let message = format!(
            "{count} {}, {missing} samples missing, the longest step {} s; left open",
            if count == 1 { "gap" } else { "gaps" },
            short(timing.longest_gap)
        );
        let first = Place { index: gap.index as u64, time_s: timing.first_gap_s };
        notes.push(Note {
            kind: FindingKind::Gap,
            count,
            first: Some(first),
            message,
            serious: missing as f64 > 0.1 * rows as f64,
        });
    }
    repeated(stamps, &mut notes);
    let span = rows as f64 * timing.period;
    if rate_hz > FASTEST || span < SHORTEST {
        let message = format!(
            "the time stamps say {} Hz over {} s: is the unit of the time column right? `time` NAME:UNIT says another \
             where the header has none, `rate` HZ takes the place of the stamps",
            short(rate_hz),
            short(span)
        );
        notes.push(Note { kind: FindingKind::TimeUnit, count: 1, first: None, message, serious: true });
    }
    notes
}

fn repeated(stamps: &Stamps, notes: &mut Vec<Note>) {
    if let Count { count, first: Some(first) } = stamps.repeated {
        let message = format!("{count} rows have the time stamp of the row before; kept, evenly spaced");
        notes.push(Note { kind: FindingKind::RepeatedStamp, count, first: Some(first), message, serious: false });
    }
}

/// Notes about stamps that a given rate replaces.
fn overridden(rate_hz: f64, stamps: &Stamps, looked: Option<&Verdict>, notes: &mut Vec<Note>) {
    let stamped = match looked {
        Some(Verdict::Timing(timing)) => 1.0 / timing.period,
        _ => 1.0 / stamps.mean_period(),
    };
    if stamped.is_finite() && (stamped / rate_hz - 1.0).abs() > 0.01 && stamps.backward.count == 0 {
        let message =
            format!("the rate given, {} Hz, replaces the {} Hz of the time stamps", short(rate_hz), short(stamped));
        notes.push(Note { kind: FindingKind::Rate, count: 1, first: None, message, serious: true });
    }
    if let Count { count, first: Some(first) } = stamps.backward {
        let message =
            format!("time goes back {count} {}; the stamps are not used", if count == 1 { "time" } else { "times" });
        notes.push(Note { kind: FindingKind::BackwardStamp, count, first: Some(first), message, serious: false });
    }
    if let Count { count, first: Some(first) } = stamps.repeated {
        let message = format!("{count} rows have the time stamp of the row before; the stamps are not used");
        notes.push(Note { kind: FindingKind::RepeatedStamp, count, first: Some(first), message, serious: false });
    }
}

/// True if a Poisson count of this mean would be so large in less than one of 10⁶ cases (Chernoff's bound).
fn unlikely(count: f64, mean: f64) -> bool {
    count > mean && (mean == 0.0 || count - mean - count * (count / mean).ln() < 1e-6f64.ln())
}

#[cfg(test)]
#[path = "check/tests.rs"]
mod tests;
