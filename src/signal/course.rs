//! A log over time, beside its moving average.

use super::smoothing::moving_average;
use super::{Axis, LogCheck, Recording};

/// Samples in the moving average: the seed paper's hundred, and one to have a middle.
pub const AVERAGED: usize = 101;

/// A log over time.
#[derive(Clone, Debug)]
pub struct Course {
    pub recording: Recording,
    pub check: LogCheck,
    /// Moving average of every axis, SI; NaN where the log has not enough on either side.
    pub averages: Vec<Vec<f64>>,
}

impl Course {
    pub fn of(recording: Recording, check: LogCheck) -> Course {
        let half = AVERAGED / 2;
        let average = |axis: &Axis| {
            let mut smooth = moving_average(&axis.values, &recording.gaps, half);
            let last = smooth.len().saturating_sub(half);
            smooth.iter_mut().enumerate().filter(|(i, _)| *i < half || *i >= last).for_each(|(_, v)| *v = f64::NAN);
            smooth
        };
        let averages = recording.axes.iter().map(average).collect();
        Course { recording, check, averages }
    }
}
