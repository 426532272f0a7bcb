//! The part of a log that Allan and spectral methods use: per axis the longest stretch without gaps and unusable
//! samples, as rate whatever the log holds.

use std::ops::Range;

use crate::input::InputKind;
use crate::signal::Recording;
use crate::units::Unit;

/// One axis, SI.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) name: String,
    /// Unit of the rate in the spelling of the log.
    pub(super) unit: Unit,
    /// Uniform and finite.
    pub(super) rate: Vec<f64>,
    /// The integral itself when the log holds it: one value more than `rate`.
    pub(super) phase: Option<Vec<f64>>,
    /// Samples of the log outside the stretch.
    pub(super) left_out: usize,
}

/// The stretches of all axes; increments are divided by the sample period, angles differenced and divided.
pub(super) fn stretches(recording: &Recording, kind: InputKind) -> Vec<Stretch> {
    let dt = recording.dt();
    let cuts: Vec<usize> = recording.gaps.iter().map(|gap| gap.index).collect();
    recording
        .axes
        .iter()
        .map(|axis| {
            let range = longest(&axis.values, &cuts);
            let left_out = axis.values.len() - range.len();
            let values = axis.values.get(range).unwrap_or_default();
            let (rate, phase) = match kind {
                InputKind::Rate => (values.to_vec(), None),
                InputKind::Increments => (values.iter().map(|v| v / dt).collect(), None),
                InputKind::Angle => {
                    (values.windows(2).map(|pair| (pair[1] - pair[0]) / dt).collect(), Some(values.to_vec()))
                }
            };
            let unit = if kind == InputKind::Rate { axis.unit.clone() } else { axis.unit.times_time(-2) };
            Stretch { name: axis.name.clone(), unit, rate, phase, left_out }
        })
        .collect()
}

/// Longest run of finite values that does not reach over a cut (index of the first sample after it).
fn longest(values: &[f64], cuts: &[usize]) -> Range<usize> {
    let mut best = 0..0;
    let mut start = 0;
    let mut cuts = cuts.iter().copied().peekable();
    for (index, value) in values.iter().enumerate() {
        if cuts.next_if_eq(&index).is_some() {
            start = index;
        }
        if !value.is_finite() {
            start = index + 1;
        } else if index + 1 - start > best.len() {
            best = start..index + 1;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longest_run_ends_at_gaps_and_nan() {
        let nan = f64::NAN;
        assert_eq!(longest(&[], &[]), 0..0);
        assert_eq!(longest(&[nan, nan], &[1]), 0..0);
        assert_eq!(longest(&[1.0, 2.0, 3.0], &[]), 0..3);
        assert_eq!(longest(&[1.0, 2.0, 3.0, 4.0, 5.0], &[2]), 2..5);
        assert_eq!(longest(&[1.0, 2.0, 3.0, nan, 5.0, 6.0], &[0, 5]), 0..3);
        assert_eq!(longest(&[1.0, nan, 3.0, 4.0, 5.0, 6.0], &[1, 4]), 2..4);
    }
}
