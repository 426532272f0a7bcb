//! One axis: NaN, stuck and saturated values, quantisation, outliers, motion.
//!
//! Rules, for the values of a rate or of increments, and for the differences of an integral:
//! - *Outlier*: in windows of 1000 samples, further than 8 robust standard deviations (1.4826 × median absolute
//!   deviation) from the window's median. A window with more than 1 % of such values is not an accident but motion.
//! - *Stuck*: a run of equal values so long that, with the share p of repeats in this log, chance would make one in
//!   less than 1 of 10⁶ such logs (p^(length − 1) · n < 10⁻⁶), and at least 4.
//! - *Saturated*: the extreme value occurs at least 5 times, over 3 times as often as the next value inside, and
//!   lies more than 2 robust standard deviations from the median.
//! - *Quantised*: 99 % of the distances between neighbouring distinct values are multiples (within 5 %) of one step,
//!   and the step is at least 1 % of the noise.
//! - *Motion*: standard deviation in windows (64 samples or more), as the mean distance from the mean tells it, over
//!   3 times its median and over what correlated noise, whose windows differ as much as their calmer half says,
//!   reaches in one of 10⁶ logs; or the means of the windows spread (5 % to 95 %) over more than 3 deg/s or 0.5
//!   m/s²; or a mean rate above 25 deg/s.

use std::collections::BTreeMap;

use pulp::{Arch, NullaryFnOnce};

use super::calm::AxisWindows;
use super::robust::{Sample, median, median_and_spread, quantile, short};
use super::stamps::Count;
use super::windows::{Extent, Windows, surely_quiet};
use super::{FindingKind, InputKind, Note, Place, Places, unlikely};
use crate::numerics::distribution::chi_square_quantile;
use crate::numerics::optimize::bracketed_root;
use crate::numerics::reduce::Moments;
use crate::units::{LARGEST, Quantity, Unit};

const WINDOW: usize = 1000;
const SHORTEST_WINDOW: usize = 50;
const OUTLIER: f64 = 8.0;
/// A window that moves scatters so many times as much as usual.
const LOUDER: f64 = 3.0;
/// Degrees of freedom from which chance never makes it so.
const MANY: f64 = 25.0;

/// A value at one end of the range, how often, and how often the next one inside.
#[derive(Clone, Debug)]
struct Extreme {
    value: f64,
    count: Count,
    inner: f64,
    inner_count: u64,
}

impl Extreme {
    fn new() -> Self {
        Extreme { value: f64::NEG_INFINITY, count: Count::default(), inner: f64::NEG_INFINITY, inner_count: 0 }
    }
    /// Takes the largest; the smallest is found with the sign turned.
    fn add(&mut self, x: f64, place: Place) {
        if x > self.value {
            (self.inner, self.inner_count) = (self.value, self.count.count);
            (self.value, self.count) = (x, Count::default());
            self.count.add(place);
        } else if x == self.value {
            self.count.add(place);
        } else if x > self.inner {
            (self.inner, self.inner_count) = (x, 1);
        } else if x == self.inner {
            self.inner_count += 1;
        }
    }
}

/// Streaming check of one axis.
#[derive(Clone, Debug)]
pub(super) struct AxisCheck {
    pub(super) name: String,
    unit: Unit,
    quantity: Quantity,
    kind: InputKind,
    pub(super) nan: Count,
    /// Infinite, or made so by the reader since no sensor gives as much.
    pub(super) vast: Count,
    pub(super) usable: u64,
    /// Smallest and largest raw value.
    pub(super) range: (f64, f64),
    pub(super) zeros: u64,
    pub(super) repeats: u64,
    previous: Option<f64>,
    run: (u64, Option<Place>),
    runs: BTreeMap<u64, Count>,
    top: Extreme,
    bottom: Extreme,
    sample: Sample,
    window: Vec<f64>,
    window_places: Vec<Place>,
    scratch: Vec<f64>,
    outliers: Count,
    largest_outlier: f64,
    disturbed: Count,
    /// Far values in the window that has most of them.
    most_far: u64,
    rest: Windows,
}

/// [`AxisCheck::add_parts`] as it is called where the processor can do more at once; every way gives the same.
struct Adding<'a> {
    axis: &'a mut AxisCheck,
    values: &'a [f64],
    places: Places<'a>,
}

impl NullaryFnOnce for Adding<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.axis.add_parts(self.values, self.places);
    }
}

impl AxisCheck {
    pub(super) fn new(name: &str, unit: &Unit, quantity: Quantity, kind: InputKind) -> Self {
        AxisCheck {
            name: name.to_string(),
            unit: unit.times_time(0), // the physical unit: 1/131 deg/s is shown in deg/s
            quantity,
            kind,
            nan: Count::default(),
            vast: Count::default(),
            usable: 0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
            zeros: 0,
            repeats: 0,
            previous: None,
            run: (0, None),
            runs: BTreeMap::new(),
            top: Extreme::new(),
            bottom: Extreme::new(),
            sample: Sample::new(1 << 14),
            window: Vec::with_capacity(WINDOW),
            window_places: Vec::with_capacity(WINDOW),
            scratch: Vec::with_capacity(WINDOW),
            outliers: Count::default(),
            largest_outlier: 0.0,
            disturbed: Count::default(),
            most_far: 0,
            rest: Windows::new(),
        }
    }

    /// The next values (SI): many at once where they are finite, with the same result as one by one.
    pub(super) fn add_all(&mut self, values: &[f64], places: Places) {
        Arch::new().dispatch(Adding { axis: self, values, places });
    }

    #[inline(always)]
    fn add_parts(&mut self, mut values: &[f64], mut places: Places) {
        while !values.is_empty() {
            // up to the end of the window in which outliers are sought
            let (part, rest) = values.split_at(values.len().min(WINDOW - self.window.len()));
            let extent = Extent::of(part);
            if self.kind == InputKind::Angle || !extent.finite {
                part.iter().enumerate().for_each(|(i, x)| self.add(*x, places.at(i)));
            } else {
                self.add_finite(part, extent, places);
            }
            (values, places) = (rest, places.skip(part.len()));
        }
    }

    #[inline(always)]
    fn add_finite(&mut self, part: &[f64], extent: Extent, places: Places) {
        let Extent { smallest, largest, zeros, .. } = extent;
        self.usable += part.len() as u64;
        self.range = (self.range.0.min(smallest), self.range.1.max(largest));
        self.zeros += zeros;
        let previous = self.previous.replace(part[part.len() - 1]);
        let alike = |pair: &[f64]| pair[0] == pair[1];
        if previous == Some(part[0]) || part.windows(2).fold(false, |any, pair| any | alike(pair)) {
            let mut previous = previous;
            for (i, x) in part.iter().enumerate() {
                self.follow(previous.replace(*x) == Some(*x), places.at(i));
            }
        } else {
            self.end_run();
            self.run = (1, Some(places.at(part.len() - 1)));
        }
        if largest >= self.top.inner {
            part.iter().enumerate().for_each(|(i, x)| self.top.add(*x, places.at(i)));
        }
        if -smallest >= self.bottom.inner {
            part.iter().enumerate().for_each(|(i, x)| self.bottom.add(-*x, places.at(i)));
        }
        self.look(part, places);
    }

    /// The next value (SI).
    #[inline(never)]
    fn add(&mut self, value: f64, place: Place) {
        if !value.is_finite() {
            if value.is_nan() {
                self.nan.add(place)
            } else {
                self.vast.add(place)
            }
            self.end_run();
            self.previous = None;
            return;
        }
        self.usable += 1;
        self.range = (self.range.0.min(value), self.range.1.max(value));
        self.zeros += u64::from(value == 0.0);
        let previous = self.previous.replace(value);
        self.follow(previous == Some(value), place);
        let places = Places { first: place.index, times: &[place.time_s] };
        match (self.kind, previous) {
            (InputKind::Angle, Some(previous)) => self.look(&[value - previous], places),
            (InputKind::Angle, None) => {}
            _ => {
                self.top.add(value, place);
                self.bottom.add(-value, place);
                self.look(&[value], places);
            }
        }
    }

    /// The run of equal values goes on, or the next one begins.
    fn follow(&mut self, repeated: bool, place: Place) {
        if repeated {
            self.repeats += 1;
            self.run.0 += 1;
        } else {
            self.end_run();
            self.run = (1, Some(place));
        }
    }

    fn end_run(&mut self) {
        if let (length @ 3.., Some(place)) = self.run {
            self.runs.entry(length).or_default().add(place);
        }
        self.run = (0, None);
    }

    /// Values that do not reach beyond the window.
    #[inline(always)]
    fn look(&mut self, x: &[f64], places: Places) {
        self.sample.add_all(x);
        self.rest.add_all(x, places);
        if x.len() == WINDOW {
            return self.judge(x, |i| places.at(i));
        }
        self.window.extend_from_slice(x);
        self.window_places.extend((0..x.len()).map(|i| places.at(i)));
        if self.window.len() == WINDOW {
            self.close_window();
        }
    }

    fn close_window(&mut self) {
        let (mut window, mut places) = (std::mem::take(&mut self.window), std::mem::take(&mut self.window_places));
        self.judge(&window, |i| places[i]);
        window.clear();
        places.clear();
        (self.window, self.window_places) = (window, places);
    }

    /// Outliers of a window.
    #[inline(always)]
    fn judge(&mut self, window: &[f64], place: impl Fn(usize) -> Place) {
        if !surely_quiet(window, OUTLIER * 1.4826) {
            self.outliers_of(window, place);
        }
    }

    #[inline(never)]
    fn outliers_of(&mut self, window: &[f64], place: impl Fn(usize) -> Place) {
        self.scratch.clear();
        self.scratch.extend_from_slice(window);
        let (center, mut spread) = median_and_spread(&mut self.scratch);
        if spread == 0.0 {
            // more than half are equal: measure in steps of the values
            spread = self.scratch.iter().copied().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
        }
        let bound = OUTLIER * spread;
        let far = window.iter().enumerate().filter(|(_, x)| (*x - center).abs() > bound);
        let count = far.clone().count();
        if count * 100 > window.len() {
            self.disturbed.add(place(0));
            self.most_far = self.most_far.max(count as u64);
        } else {
            for (i, x) in far {
                self.outliers.add(place(i));
                if (x - center).abs() > self.largest_outlier.abs() {
                    self.largest_outlier = x - center;
                }
            }
        }
    }

    /// `12.3 deg/s`
    fn show(&self, x: f64) -> String {
        format!("{} {}", short(self.unit.from_si(x)), self.unit)
    }

    pub(super) fn findings(&mut self, rate_hz: f64) -> Vec<Note> {
        self.end_run();
        if self.window.len() >= SHORTEST_WINDOW {
            self.close_window();
        }
        let mut sample = self.sample.values();
        let step = quantisation_step(&mut sample);
        let (center, noise) = self.noise(&mut sample);
        let mut out = Vec::new();
        self.nan_finding(&mut out);
        self.stuck(step, noise, &mut out);
        self.saturated(center, noise, &mut out);
        self.quantised(step, noise, &mut out);
        self.outlier(&mut out);
        self.motion(rate_hz, &mut out);
        out
    }

    /// Median, and the robust noise: the median standard deviation of the windows, else the spread of all.
    fn noise(&self, sample: &mut [f64]) -> (f64, f64) {
        let (center, spread) = median_and_spread(sample);
        let mut deviations: Vec<f64> = self.rest.done.iter().map(|(m, _)| m.variance().sqrt()).collect();
        if deviations.len() < 3 { (center, spread) } else { (center, median(&mut deviations)) }
    }

    fn nan_finding(&self, out: &mut Vec<Note>) {
        let all = self.usable + self.nan.count + self.vast.count;
        let kinds = [
            (FindingKind::Nan, self.nan, "empty or not a number; skipped, not replaced".to_string()),
            (
                FindingKind::Overflow,
                self.vast,
                format!("infinite or beyond {LARGEST:e} in SI, which no sensor gives; skipped, not replaced"),
            ),
        ];
        for (kind, Count { count, first }, what) in kinds {
            if first.is_some() {
                let message = format!("{count} {} {what}", are(count, "value is", "values are"));
                out.push(Note { kind, count, first, message, serious: count * 100 > all });
            }
        }
    }

    fn stuck(&self, step: Option<f64>, noise: f64, out: &mut Vec<Note>) {
        let total = self.usable as f64;
        let share = self.repeats as f64 / total;
        if share <= 0.0 || share >= 1.0 || step.is_some_and(|step| step > 2.0 * noise && share < 0.999) {
            return; // where the steps are coarser than the noise, equal values are the rule
        }
        let shortest = (1.0 + (1e6 * total).ln() / -share.ln()).ceil().max(4.0);
        let long = self.runs.iter().filter(|(length, _)| **length as f64 >= shortest);
        let (mut runs, mut samples, mut longest, mut first) = (0, 0, 0, None::<Place>);
        for (length, count) in long {
            runs += count.count;
            samples += length * count.count;
            longest = longest.max(*length);
            first = [first, count.first].into_iter().flatten().min_by_key(|p| p.index);
        }
        if let Some(first) = first {
            out.push(Note {
                kind: FindingKind::Stuck,
                count: samples,
                first: Some(first),
                message: format!(
                    "{samples} samples in {runs} {} of equal values, the longest {longest}; chance explains runs up to \
                     {}",
                    are(runs, "run", "runs"),
                    shortest - 1.0
                ),
                serious: samples as f64 > 1e-3 * total,
            });
        }
    }

    fn saturated(&self, center: f64, noise: f64, out: &mut Vec<Note>) {
        for (end, sign, word) in [(&self.top, 1.0, "largest"), (&self.bottom, -1.0, "smallest")] {
            let Count { count, first: Some(first) } = end.count else { continue };
            let far = (sign * end.value - center).abs() > 2.0 * noise;
            if count >= 5 && count > 3 * end.inner_count && far && self.range.0 < self.range.1 {
                let value = self.show(sign * end.value);
                out.push(Note {
                    kind: FindingKind::Saturated,
                    count,
                    first: Some(first),
                    message: format!(
                        "{count} samples stand at the {word} value {value} ({} at the next one): the sensor was at its \
                         limit",
                        end.inner_count
                    ),
                    serious: true,
                });
            }
        }
    }

    fn quantised(&self, step: Option<f64>, noise: f64, out: &mut Vec<Note>) {
        let Some(step) = step.filter(|step| *step >= 0.01 * noise) else { return };
        let coarse = step > 2.0 * noise;
        let share = if noise > 0.0 { format!(", {} of the noise", short(step / noise)) } else { String::new() };
        let meaning = if coarse { ": the noise is hidden below the steps, and its density cannot be read" } else { "" };
        out.push(Note {
            kind: FindingKind::Quantised,
            count: self.usable,
            first: None,
            message: format!("values come in steps of {}{share}{meaning}", self.show(step)),
            serious: coarse,
        });
    }

    fn outlier(&self, out: &mut Vec<Note>) {
        let Count { count, first: Some(first) } = self.outliers else { return };
        out.push(Note {
            kind: FindingKind::Outlier,
            count,
            first: Some(first),
            message: format!(
                "{count} {} more than {OUTLIER} robust standard deviations from the samples around, the furthest by \
                 {}; kept",
                are(count, "sample lies", "samples lie"),
                self.show(self.largest_outlier)
            ),
            serious: count as f64 > 1e-4 * self.usable as f64,
        });
    }

    /// The largest spread of the means of windows, and the largest mean, of a sensor at rest.
    fn at_rest(&self) -> (f64, f64) {
        match self.quantity {
            Quantity::AngularRate => (3f64.to_radians(), 25f64.to_radians()),
            Quantity::SpecificForce => (0.5, f64::INFINITY),
        }
    }

    /// What the calmest part of the log is looked for in.
    pub(super) fn calmness(&self, rate_hz: f64) -> AxisWindows<'_> {
        let from_rate = if self.kind == InputKind::Rate { 1.0 } else { 1.0 / rate_hz };
        let (most_spread, most_mean) = self.at_rest();
        AxisWindows {
            windows: &self.rest,
            step: quantisation_step(&mut self.sample.values()),
            most_mean: most_mean * from_rate,
            most_spread: most_spread * from_rate,
        }
    }

    fn motion(&self, rate_hz: f64, out: &mut Vec<Note>) {
        let windows = &self.rest.done;
        if windows.len() < 3 {
            return;
        }
        // increments and differences of an integral are one period long
        let to_rate = if self.kind == InputKind::Rate { 1.0 } else { rate_hz };
        let show = |x: f64| format!("{} {}", short(self.rate_unit().from_si(x * to_rate)), self.rate_unit());
        let variances = self.rest.variances();
        let mut sorted = variances.clone();
        let usual = median(&mut sorted);
        sorted.sort_unstable_by(f64::total_cmp);
        let limit = LOUDER * LOUDER * usual.max(0.0);
        let limit = limit.max(usual * largest_by_chance(quantile(&sorted, 0.25) / usual, windows.len()));
        let largest = sorted.last().copied().unwrap_or(0.0).sqrt();
        let moving: Vec<&(Moments, Place)> =
            windows.iter().zip(&variances).filter(|(_, v)| usual > 0.0 && **v > limit).map(|(w, _)| w).collect();
        let mut means: Vec<f64> = windows.iter().map(|(m, _)| m.mean).collect();
        means.sort_unstable_by(f64::total_cmp);
        let spread = quantile(&means, 0.95) - quantile(&means, 0.05);
        let (most_spread, most_mean) = self.at_rest();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let seconds = self.rest.size as f64 / rate_hz;
        let finding = |count: u64, first: Option<Place>, what: String| Note {
            kind: FindingKind::Motion,
            count,
            first,
            message: format!("not at rest: {what}"),
            serious: true,
        };
        if let Some((_, first)) = moving.first() {
            let what = format!(
                "in {} of {} windows of {} s the values scatter over {} times as much as usual (up to {}, usually {})",
                moving.len(),
                windows.len(),
                short(seconds),
                short((limit / usual).sqrt()),
                show(largest),
                show(usual.sqrt())
            );
            out.push(finding(moving.len() as u64 * self.rest.size, Some(*first), what));
        } else if spread * to_rate > most_spread {
            let what = format!("the means over {} s spread over {}", short(seconds), show(spread));
            out.push(finding(self.usable, None, what));
        } else if mean.abs() * to_rate > most_mean {
            out.push(finding(self.usable, None, format!("the mean is {}", show(mean))));
        } else if let Count { count, first: Some(first) } = self.disturbed
            && unlikely(self.most_far as f64, self.usually_far(count))
        {
            let what = format!("{count} windows of {WINDOW} samples hold more than 1 % of far values");
            out.push(finding(count * WINDOW as u64, Some(first), what));
        }
    }

    /// Far values that a window has on average, but for the `disturbed` windows.
    fn usually_far(&self, disturbed: u64) -> f64 {
        let others = self.usable.saturating_sub(disturbed * WINDOW as u64).max(1);
        (self.outliers.count * WINDOW as u64) as f64 / others as f64
    }

    fn rate_unit(&self) -> Unit {
        if self.kind == InputKind::Rate { self.unit.clone() } else { self.unit.times_time(-2) }
    }
}

/// The largest of so many windows' variances over their median that correlated normal noise reaches by chance in one
/// of 10⁶ logs; `quartile`: the lower one over the median. A window has as many degrees of freedom ν as make its
/// quartile what it is (Welch 1938, Satterthwaite 1946); the upper half, in which motion would be, is not looked at.
/// The variance is a weighted sum of squares, of which the largest weight is at most 1/√ν of all, and it is that
/// which makes the tail: χ²₁/√ν.
fn largest_by_chance(quartile: f64, windows: usize) -> f64 {
    let ratio = |dof: f64| chi_square_quantile(0.25, dof) / chi_square_quantile(0.5, dof);
    // the ratio grows with the degrees of freedom; of the white noise of 64 samples it is 0.89, and one sinusoid
    // that comes and goes has one
    if quartile.is_nan() || quartile >= ratio(MANY) {
        return 0.0;
    }
    let dof = bracketed_root(|ln| ratio(ln.exp()) - quartile, 0.0, MANY.ln(), 1e-6).map_or(1.0, f64::exp);
    chi_square_quantile(1.0 - 1e-6 / windows as f64, 1.0) / dof.sqrt() * dof / chi_square_quantile(0.5, dof)
}

fn are<'a>(count: u64, one: &'a str, many: &'a str) -> &'a str {
    if count == 1 { one } else { many }
}

/// The step of which all values are multiples, apart from an offset and from rounding in print; `None` if there is
/// none.
fn quantisation_step(sample: &mut [f64]) -> Option<f64> {
    sample.sort_unstable_by(f64::total_cmp);
    let spread = quantile(sample, 0.75) - quantile(sample, 0.25);
    let range = sample.last()? - sample.first()?;
    // closer values differ by the arithmetic that made them, not by the sensor
    let same = 1e-6 * if spread > 0.0 { spread } else { range };
    let gaps: Vec<f64> = sample.windows(2).map(|w| w[1] - w[0]).filter(|gap| *gap > same).collect();
    if gaps.is_empty() || gaps.len() * 2 > sample.len() {
        return None; // hardly any value occurs twice
    }
    let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let (mut total, mut steps, mut fits) = (0.0, 0.0, 0);
    for gap in &gaps {
        let multiple = (gap / smallest).round();
        // a wide gap carries the rounding of the smallest one many times: it says nothing
        if multiple > 20.0 || (gap / smallest - multiple).abs() <= 0.05 {
            fits += 1;
            if multiple <= 20.0 {
                total += gap;
                steps += multiple;
            }
        }
    }
    (fits * 100 >= gaps.len() * 99).then_some(total / steps)
}

#[cfg(test)]
#[path = "axis_tests.rs"]
mod tests;
