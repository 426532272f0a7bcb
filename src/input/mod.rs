//! Log files to [`Recording`] (floor 2): recognise the format, choose columns, units and rate, read in one or two streaming passes.

pub mod columns;
pub mod npy;
pub mod text;

use std::path::Path;

use crate::signal::{LogCheck, Recording};
use crate::units::{Quantity, Unit};

/// The flags every command that takes LOG has.
#[derive(Clone, Debug, Default)]
pub struct LogOptions {
    /// Names or 1-based numbers.
    pub columns: Option<Vec<String>>,
    pub time: Option<String>,
    /// Unit of the columns when the header does not say; a flag that contradicts the header is an error.
    pub unit: Option<Unit>,
    /// Hz. With a time column it overrides the stamps (they are then only checked).
    pub rate_hz: Option<f64>,
    /// Seconds from the start of the log.
    pub start_s: Option<f64>,
    pub end_s: Option<f64>,
    /// What the values are: rate (default), increments over one sample, or the running integral. The unit's dimension must agree.
    pub kind: InputKind,
    /// Prefer this quantity when the log holds both (default angular rate).
    pub quantity: Option<Quantity>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InputKind {
    #[default]
    Rate,
    Increments,
    Angle,
}

/// One line: file, line or column, found, expected, what to do.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct InputError {
    pub message: String,
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
    /// Per sample: how many samples are missing right before it (0 nearly always).
    pub missing: Vec<u64>,
    /// Seconds from the first sample of the log, per sample.
    pub time_s: Vec<f64>,
}

/// A log opened for streaming with bounded memory: one checking pass is made at `open`, blocks are then read in a second pass.
pub struct LogReader {
    _private: (),
}

impl LogReader {
    pub fn open(path: &Path, options: &LogOptions) -> Result<LogReader, InputError> {
        let _ = (path, options);
        todo!()
    }
    pub fn axes(&self) -> &[AxisInfo] {
        todo!()
    }
    pub fn quantity(&self) -> Quantity {
        todo!()
    }
    /// The check of the whole log (made at open); its `sample_rate_hz` is the rate used.
    pub fn check(&self) -> &LogCheck {
        todo!()
    }
    pub fn sha256(&self) -> &str {
        todo!()
    }
    /// False at the end.
    pub fn next_block(&mut self, block: &mut Block) -> Result<bool, InputError> {
        let _ = block;
        todo!()
    }
}

/// The whole log in memory with its check.
pub fn read(path: &Path, options: &LogOptions) -> Result<(Recording, LogCheck), InputError> {
    let _ = (path, options);
    todo!()
}
