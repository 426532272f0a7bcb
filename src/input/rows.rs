//! Rows of a log on their way from the file to the check and the analysis.

use std::ops::Range;

use super::InputError;
use super::columns::Choice;
use crate::numerics::reduce::by_eight;
use crate::signal::check::Samples;
use crate::units::{LARGEST, Unit};

/// Rows of the selected columns as they stand in the file.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// Since the first stamp of the file, in the file's unit; empty without a time column.
    pub(super) time: Vec<f64>,
    pub(super) values: Vec<Vec<f64>>,
    /// Where each row stands in the file (line or row, from 1), less `before`.
    pub(super) lines: Vec<u64>,
    pub(super) before: u64,
}

impl Rows {
    pub(super) fn clear(&mut self, axes: usize) {
        self.time.clear();
        self.lines.clear();
        self.before = 0;
        self.values.resize_with(axes, Vec::new);
        self.values.iter_mut().for_each(Vec::clear);
    }
    pub(super) fn line(&self, row: usize) -> u64 {
        self.before + self.lines[row]
    }
}

/// Rows that a table handed out at once, stamps in seconds and values in SI.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub(super) rows: Rows,
    pub(super) wanted: Range<usize>,
    /// Rows of the file before it.
    pub(super) before: u64,
}

impl Part {
    pub(super) fn samples(&self) -> Samples<'_> {
        let times = self.rows.time.get(self.wanted.clone()).unwrap_or_default();
        Samples { times, axes: self.rows.values.iter().map(|column| &column[self.wanted.clone()]).collect() }
    }
}

/// Parts that are checked and kept together, while the next are read.
#[derive(Debug, Default)]
pub(super) struct Batch {
    /// Those that are in use, and behind them memory for more.
    pub(super) parts: Vec<Part>,
    pub(super) count: usize,
    /// Nothing follows that is wanted.
    pub(super) last: bool,
    /// Behind the parts.
    pub(super) fault: Option<InputError>,
}

impl Batch {
    pub(super) fn parts(&self) -> &[Part] {
        &self.parts[..self.count]
    }
}

/// So many rows are worth the change from one thread to another.
pub(super) const WORTHWHILE: usize = 1 << 15;

impl Choice {
    /// Seconds and SI values; the first row without a stamp, if stamps are needed.
    pub(super) fn to_si(&self, rows: &mut Rows, stamped: bool) -> Option<usize> {
        if let Some((_, unit)) = &self.time {
            to_si(unit, &mut rows.time);
        }
        let beside = self.temperature.column.as_ref().map(|(_, info)| &info.unit);
        let units = self.stored.iter().chain(&self.extra).chain(beside);
        for (column, unit) in rows.values.iter_mut().zip(units) {
            // what no sensor gives would spoil every sum it enters
            let within = |x: f64| if x.abs() > LARGEST { f64::INFINITY.copysign(x) } else { x };
            column.iter_mut().for_each(|x| *x = within(unit.to_si(*x)));
        }
        // 0 x is NaN for what is not finite
        let empty = stamped && by_eight(&rows.time, |t| 0.0 * t) != 0.0;
        if empty { rows.time.iter().position(|t| !t.is_finite()) } else { None }
    }
}

fn to_si(unit: &Unit, values: &mut [f64]) {
    if unit.to_si(1.0) != 1.0 {
        values.iter_mut().for_each(|x| *x = unit.to_si(*x));
    }
}
