//! Sampled data: the [`Recording`], its sampling checks, autocorrelation and spectrum (floor 1).

pub mod bridge;
pub mod check;
pub mod correlation;
pub mod cosine;
pub mod course;
pub(crate) mod fourier;
pub mod lines;
pub mod smoothing;
pub mod spectrum;
pub mod upsets;

use crate::units::{Quantity, Unit};

pub use check::LogCheck;

/// One axis of a recording; `values` are SI (rad/s or m/s², or rad / m/s when the log holds increments or an integral).
#[derive(Clone, Debug)]
pub struct Axis {
    pub name: String,
    /// The unit of the log, in which results are shown; `values` are already SI.
    pub unit: Unit,
    pub values: Vec<f64>,
}

/// A stretch with no samples: `missing` samples are absent right before sample `index`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    pub index: usize,
    pub missing: u64,
}

/// Uniformly sampled data on several axes. All axes have the same length. NaN marks a sample that is there but
/// unusable.
#[derive(Clone, Debug)]
pub struct Recording {
    /// File name, for provenance.
    pub name: String,
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    /// Time of the first sample, s (0 if the log has no time column).
    pub start_s: f64,
    pub axes: Vec<Axis>,
    /// Ascending by index; found from the time column by a stated rule, never repaired.
    pub gaps: Vec<Gap>,
    /// As long as the axes, if the log has it and it was asked for: readings times the factor of their unit (degC
    /// counts from 0 degC), of which only differences are used. NaN where it is missing.
    pub temperature: Option<Axis>,
    /// Hex SHA-256 of the file's bytes (as stored), if it came from a file.
    pub sha256: Option<String>,
}

impl Recording {
    pub fn len(&self) -> usize {
        self.axes.first().map_or(0, |a| a.values.len())
    }
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    pub fn dt(&self) -> f64 {
        1.0 / self.sample_rate_hz
    }
    /// Seconds from the first to the last sample inclusive of gaps: (n + missing)·dt.
    pub fn span_s(&self) -> f64 {
        let missing: u64 = self.gaps.iter().map(|g| g.missing).sum();
        (self.len() as f64 + missing as f64) * self.dt()
    }
    /// The longest stretch without gaps, as an index range: what the Allan and spectral methods use (they say so).
    pub fn longest_contiguous(&self) -> std::ops::Range<usize> {
        let mut best = 0..0;
        let mut start = 0;
        for end in self.gaps.iter().map(|g| g.index).chain([self.len()]) {
            if end - start > best.len() {
                best = start..end;
            }
            start = end;
        }
        best
    }
}
