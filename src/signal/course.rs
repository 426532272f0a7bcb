//! A log over time, beside its moving average.

use super::smoothing::moving_average;
use super::{LogCheck, Recording};

/// Samples in the moving average: the seed paper's hundred, and one to have a middle.
pub const AVERAGED: usize = 101;

/// A log over time.
#[derive(Clone, Debug)]
pub struct Course {
    pub recording: Recording,
    pub check: LogCheck,
    /// Moving average of every axis, SI.
    pub averages: Vec<Vec<f64>>,
}

impl Course {
    pub fn of(recording: Recording, check: LogCheck) -> Course {
        let axes = recording.axes.iter();
        let averages = axes.map(|axis| moving_average(&axis.values, &recording.gaps, AVERAGED / 2)).collect();
        Course { recording, check, averages }
    }
}
