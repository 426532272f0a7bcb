//! The part of a log that Allan and spectral methods use: per axis the longest stretch without gaps and unusable
//! samples, as rate whatever the log holds; or a longer one whose short holes are filled.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;

use crate::compare::LogAxis;
use crate::filter;
use crate::input::InputKind;
use crate::signal::{Axis, Gap, Recording, bridge, upsets};
use crate::units::Unit;

/// One axis, SI.
#[derive(Clone, Debug)]
pub(crate) struct Stretch {
    pub(crate) name: String,
    /// Unit of the rate in the spelling of the log.
    pub(crate) unit: Unit,
    /// Uniform and finite.
    pub(crate) rate: Vec<f64>,
    /// The integral itself when the log holds it: one value more than `rate`.
    pub(crate) phase: Option<Vec<f64>>,
    /// Samples of the log outside the stretch.
    pub(crate) left_out: usize,
    /// How many of `rate` are filled in.
    pub(crate) filled: usize,
    /// Which of `rate` stand in the place of outliers.
    pub(crate) outliers: Vec<usize>,
    /// Where the stretch is in the log, or in its pieces laid out with their holes.
    range: Range<usize>,
    /// The whole log: how many samples are missing before, then samples, of which some may not be finite; empty
    /// where `rate` is all.
    whole: Vec<(u64, Vec<f64>)>,
}

impl Stretch {
    /// Takes a longer stretch, if there is one whose holes are few and short enough to be filled in.
    pub(crate) fn bridge(&mut self) {
        if self.whole.is_empty() {
            return;
        }
        let Some(found) = laid_out(&self.whole).and_then(|all| bridge::bridge(&all)) else { return };
        let seen = found.samples.len() - found.filled;
        let usable = self.whole.iter().flat_map(|(_, own)| own).filter(|v| v.is_finite()).count();
        self.left_out = usable - seen;
        self.range = found.start..found.start + found.samples.len();
        (self.rate, self.filled) = (found.samples, found.filled);
        // the integral has no values in holes
        self.phase = None;
    }

    /// Outliers count as missing; how many there are in all. Methods that cannot do without a sample get the median
    /// of its surroundings.
    pub(crate) fn drop_outliers(&mut self) -> usize {
        if self.whole.is_empty() {
            self.whole = vec![(0, self.rate.clone())];
        }
        let mut count = 0;
        for (_, samples) in &mut self.whole {
            for index in upsets::outliers(samples) {
                samples[index] = f64::NAN;
                count += 1;
            }
        }
        self.outliers = upsets::fill_outliers(&mut self.rate);
        // the integral would carry an outlier on
        self.phase = None;
        count
    }

    /// To hold a noise model against, with short holes filled in at rest: what a motion did in a hole is not known.
    /// And what is left out of curves and spectra, in words.
    pub(crate) fn into_log_axis(mut self, at_rest: bool) -> (LogAxis, Option<String>) {
        if at_rest {
            self.bridge();
        }
        let note = self.left_out_note("stands for the log in curves and spectra");
        let Stretch { name, rate, filled, left_out, whole, .. } = self;
        (LogAxis { name, rate, filled, left_out, whole }, note)
    }

    /// What of the log is outside the stretch, if anything is; `role`: of the stretch.
    pub(crate) fn left_out_note(&self, role: &str) -> Option<String> {
        let (used, left_out) = (self.rate.len(), self.left_out);
        let note = || match self.filled {
            0 => format!(
                "the longest stretch without gaps and unusable samples {role}: {used} samples, {left_out} left out"
            ),
            filled => format!(
                "a stretch with short holes {role}: {used} samples, {filled} of them missing and filled in there with \
                 noise as elsewhere in the log, {left_out} left out"
            ),
        };
        (left_out + self.filled > 0).then(note)
    }

    /// What stands beside the samples of the axis in the log: beside the stretch, and piece by piece as
    /// [`Stretch::pieces`].
    pub(crate) fn beside(&self, values: &[f64], gaps: &[Gap], kind: InputKind) -> (Vec<f64>, Vec<Vec<f64>>) {
        if self.whole.is_empty() || (self.left_out == 0 && self.filled == 0) {
            let own = beside(values.get(self.range.clone()).unwrap_or_default(), kind);
            return (own.clone(), vec![own]);
        }
        let whole = pieces(values, gaps, kind, |own| beside(own, kind));
        let own = match self.filled {
            0 => beside(values.get(self.range.clone()).unwrap_or_default(), kind),
            _ => {
                let mut own = laid_out(&whole).unwrap_or_default().get(self.range.clone()).unwrap_or_default().to_vec();
                // straight on over a hole: it is no longer than a hundredth of the log
                let mut last = own.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
                own.iter_mut().for_each(|v| {
                    last = if v.is_finite() { *v } else { last };
                    *v = last;
                });
                own
            }
        };
        (own, whole.into_iter().map(|(_, own)| own).collect())
    }

    /// All of the log, piece by piece.
    pub(crate) fn pieces(&self) -> Vec<filter::likelihood::Stretch<'_>> {
        let piece = |missing, samples| filter::likelihood::Stretch { missing, samples };
        match &self.whole[..] {
            [] => vec![piece(0, &self.rate)],
            whole => whole.iter().map(|(missing, samples)| piece(*missing, samples)).collect(),
        }
    }
}

/// The stretches of all axes; increments are divided by the sample period, angles differenced and divided.
pub(crate) fn stretches(recording: &Recording, kind: InputKind) -> Vec<Stretch> {
    let of = |axis: &Axis| stretch(&axis.name, &axis.unit, Cow::Borrowed(&axis.values), recording, kind);
    recording.axes.par_iter().map(of).collect()
}

/// The same, leaving no axes: a rate in one piece is not copied.
pub(crate) fn into_stretches(recording: &mut Recording, kind: InputKind) -> Vec<Stretch> {
    let axes = std::mem::take(&mut recording.axes);
    let of = |axis: Axis| stretch(&axis.name, &axis.unit, Cow::Owned(axis.values), recording, kind);
    axes.into_par_iter().map(of).collect()
}

fn stretch(name: &str, unit: &Unit, values: Cow<'_, [f64]>, recording: &Recording, kind: InputKind) -> Stretch {
    let (dt, gaps) = (recording.dt(), &recording.gaps);
    let cuts: Vec<usize> = gaps.iter().map(|gap| gap.index).collect();
    let range = longest(&values, &cuts);
    let left_out = values.len() - range.len();
    let of = |values: &[f64]| rate(values, kind, dt);
    let whole = if left_out > 0 { pieces(&values, gaps, kind, of) } else { Vec::new() };
    let own = &values[range.clone()];
    let phase = (kind == InputKind::Angle).then(|| own.to_vec());
    let unit = if kind == InputKind::Rate { unit.clone() } else { unit.times_time(-2) };
    let rate = if kind == InputKind::Rate && left_out == 0 { values.into_owned() } else { of(own) };
    Stretch { name: name.to_string(), unit, rate, phase, left_out, filled: 0, outliers: Vec::new(), range, whole }
}

/// Increments and angles as rate.
pub(crate) fn rate(values: &[f64], kind: InputKind, dt: f64) -> Vec<f64> {
    match kind {
        InputKind::Rate => values.to_vec(),
        InputKind::Increments => values.iter().map(|v| v / dt).collect(),
        InputKind::Angle => values.windows(2).map(|pair| (pair[1] - pair[0]) / dt).collect(),
    }
}

/// What was beside the values from which a rate is made: a difference of angles has the mean of two.
fn beside(values: &[f64], kind: InputKind) -> Vec<f64> {
    match kind {
        InputKind::Rate | InputKind::Increments => values.to_vec(),
        InputKind::Angle => values.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect(),
    }
}

/// The log between its gaps, as `of` makes it. A difference of angles over a gap is lost.
fn pieces(values: &[f64], gaps: &[Gap], kind: InputKind, of: impl Fn(&[f64]) -> Vec<f64>) -> Vec<(u64, Vec<f64>)> {
    let starts = std::iter::once((0, 0)).chain(gaps.iter().map(|gap| (gap.index, gap.missing)));
    let ends = gaps.iter().map(|gap| gap.index).chain([values.len()]);
    let lost = u64::from(kind == InputKind::Angle);
    let pieces = starts.zip(ends).filter(|((start, _), end)| start < end).map(|((start, missing), end)| {
        let own = &values[start..end];
        let missing = if missing > 0 { missing + lost } else { 0 };
        (missing, of(own))
    });
    pieces.collect()
}

/// Pieces one after the other, what is missing between them not a number; a gap that is too long to be filled counts
/// as one that is just that. `None` where that would be more than is there: bursts, each for itself.
fn laid_out(pieces: &[(u64, Vec<f64>)]) -> Option<Vec<f64>> {
    let samples: usize = pieces.iter().map(|(_, own)| own.len()).sum();
    // of a log that is as much longer as holes make it
    let most = bridge::longest_hole(samples) as u64 * 2 + 1;
    let missing: usize = pieces.iter().map(|(missing, _)| (*missing).min(most) as usize).sum();
    if missing > samples {
        return None;
    }
    let mut all = Vec::with_capacity(samples + missing);
    for (missing, own) in pieces {
        if !all.is_empty() {
            all.resize(all.len() + (*missing).min(most) as usize, f64::NAN);
        }
        all.extend_from_slice(own);
    }
    Some(all)
}

/// Longest run of finite values that does not reach over a cut (index of the first sample after it).
fn longest(values: &[f64], cuts: &[usize]) -> Range<usize> {
    if cuts.is_empty() && values.iter().fold(true, |all, value| all & value.is_finite()) {
        return 0..values.len();
    }
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
    fn pieces_are_what_lies_between_gaps() {
        let gaps = [Gap { index: 2, missing: 7 }, Gap { index: 3, missing: 1 }];
        let values = [1.0, 3.0, 4.0, 8.0, 9.0];
        let of = |kind| pieces(&values, &gaps, kind, |own| rate(own, kind, 0.5));
        assert_eq!(of(InputKind::Rate), [(0, vec![1.0, 3.0]), (7, vec![4.0]), (1, vec![8.0, 9.0])]);
        assert_eq!(of(InputKind::Increments), [(0, vec![2.0, 6.0]), (7, vec![8.0]), (1, vec![16.0, 18.0])]);
        assert_eq!(of(InputKind::Angle), [(0, vec![4.0]), (8, vec![]), (2, vec![2.0])]);
        assert_eq!(
            pieces(&values, &[Gap { index: 0, missing: 3 }], InputKind::Rate, <[f64]>::to_vec),
            [(3, values.to_vec())]
        );
        let kind = InputKind::Angle;
        assert_eq!(
            pieces(&values, &gaps, kind, |own| beside(own, kind)),
            [(0, vec![2.0]), (8, vec![]), (2, vec![8.5])]
        );
    }

    /// Holes up to as long as the log itself; a long gap counts as a fiftieth of the log.
    #[test]
    fn bursts_are_not_laid_out() {
        let bursts = |count: usize, missing: u64| vec![(missing, vec![1.0; 100]); count];
        assert_eq!(laid_out(&bursts(100, u64::MAX)), None);
        assert_eq!(laid_out(&bursts(10, 90)).unwrap().len(), 10 * 100 + 9 * 21);
        let all = laid_out(&bursts(40, 3)).unwrap();
        assert_eq!((all.len(), all.iter().filter(|v| v.is_nan()).count()), (4117, 117));
        assert!(all[100..103].iter().all(|v| v.is_nan()) && all[103] == 1.0);
    }

    /// Fifty samples, a gap too long to fill, then two short holes: what is beside the axis is moved as the axis is,
    /// and goes straight on over a hole.
    #[test]
    fn beside_what_is_filled_in_stands_what_was_there() {
        let mut rate: Vec<f64> = (0..3050_u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761) >> 8)).collect();
        rate[2000] = f64::NAN;
        let gaps = [Gap { index: 50, missing: 1000 }, Gap { index: 1000, missing: 5 }];
        let kind = InputKind::Rate;
        let whole = pieces(&rate, &gaps, kind, <[f64]>::to_vec);
        let unit = Unit::parse("rad/s").unwrap();
        let (rate, range) = (Vec::new(), 0..0);
        let (name, outliers) = ("x".into(), Vec::new());
        let mut own = Stretch { name, unit, rate, phase: None, left_out: 1, filled: 0, outliers, range, whole };
        own.bridge();
        assert_eq!((own.rate.len(), own.filled, own.left_out), (3005, 6, 50));
        let index: Vec<f64> = (0..3050).map(f64::from).collect();
        let (all, parts) = own.beside(&index, &gaps, kind);
        let seen = (50..1000).chain([999; 5]).chain(1000..3050).map(f64::from);
        assert_eq!(all, seen.collect::<Vec<_>>());
        assert_eq!(parts.concat(), index);
    }

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
