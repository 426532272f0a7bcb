//! A log through a design to a verdict (floor 4).
//!
//! [`Replayer`] takes the log block by block and keeps only running sums, so its memory does not grow with the log.
//! Over a gap the filter predicts and nothing else; a sample that is not a number is skipped (prediction only); a sample outside the gate, if there is
//! one, is counted and does not change the state. The statistics use the normalised innovations of accepted samples; see
//! [`verdict`] for what is tested and [`crate::consistency::effect::judge`] for how the verdict on a measured log is reached.

pub mod axes;
pub mod trace;
pub mod verdict;

use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::low_frequency::{LowFrequency, time_constants};
use crate::consistency::whiteness::Autocorrelation;
use crate::consistency::{Test, Verdict};
use crate::filter::kalman::{Kalman, Update};
use crate::filter::{AxisDesign, FilterDesign};
use crate::input::Block;
use crate::numerics::reduce::Sum;
use crate::units::Quantity;

pub use trace::{Point, Trace};

/// Number of autocorrelation lags that are tested.
pub const LAGS: usize = 50;
/// Bins of the NIS histogram, each half a unit wide.
const NIS_BINS: usize = 40;

/// How to replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Family-wise false-alarm probability of the verdict.
    pub alpha: f64,
    /// Reject samples with |ν| > gate·√S.
    pub gate: Option<f64>,
}

impl Default for Options {
    fn default() -> Options {
        Options { alpha: 0.01, gate: None }
    }
}

impl Options {
    /// `alpha` is a probability, `gate` at least one sigma.
    pub fn check(&self) -> Result<(), ReplayError> {
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            return Err(ReplayError::Option { name: "alpha", value: self.alpha, expected: "between 0 and 1" });
        }
        match self.gate {
            Some(gate) if !(gate >= 1.0 && gate.is_finite()) => {
                Err(ReplayError::Option { name: "gate", value: gate, expected: "at least 1 (sigmas)" })
            }
            _ => Ok(()),
        }
    }
}

/// What must be known of a log before its first block.
#[derive(Clone, Debug, PartialEq)]
pub struct LogShape {
    pub axes: Vec<String>,
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReplayError {
    #[error(
        "the log is in {log} but the filter is for {filter}: choose the columns with --columns or --sensor, or give the right filter"
    )]
    Quantity { log: &'static str, filter: &'static str },
    #[error(
        "the log has {log_hz} Hz but the filter is for {filter_hz} Hz ({percent:.2} % apart, 0.5 % are allowed): identify and tune at the log's rate, or correct the rate with --rate"
    )]
    Rate { log_hz: f64, filter_hz: f64, percent: f64 },
    #[error(
        "cannot tell which axis is which: the log has {log}, the filter has {filter}; choose with --columns, in the order of the filter's axes"
    )]
    Axes { log: String, filter: String },
    #[error(
        "axis '{axis}' of the filter has {count} measurements; replay handles filters with one measurement per axis"
    )]
    Measurements { axis: String, count: usize },
    #[error(
        "the filter is for the plant '{plant}'; replay handles sensors at rest (plant static), montecarlo judges this filter on simulated runs"
    )]
    Plant { plant: String },
    #[error("{name} is {value}, expected {expected}")]
    Option { name: &'static str, value: f64, expected: &'static str },
}

/// What the filter said, sample by sample, for one block.
#[derive(Clone, Debug, Default)]
pub struct Estimates {
    /// s from the start of the log.
    pub time_s: Vec<f64>,
    pub axes: Vec<AxisEstimates>,
}

/// One axis of [`Estimates`], SI.
#[derive(Clone, Debug, Default)]
pub struct AxisEstimates {
    /// x(k|k) per state and sample; x(k|k−1) where no measurement was accepted.
    pub states: Vec<Vec<f64>>,
    /// Square root of the diagonal of P, likewise.
    pub sigmas: Vec<Vec<f64>>,
    /// ν, also of rejected samples; NaN where there was no usable measurement.
    pub innovation: Vec<f64>,
    /// √S.
    pub innovation_sigma: Vec<f64>,
    /// ν²/S.
    pub nis: Vec<f64>,
}

/// The mean NIS with its bounds under the design.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Nis {
    pub mean: f64,
    /// 1; less behind a gate.
    pub expected: f64,
    /// The mean lies in [lower, upper] with probability 1 − alpha when the design is true.
    pub lower: f64,
    pub upper: f64,
    pub p_value: f64,
}

/// Autocorrelation of the normalised innovations.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct WhitenessSummary {
    pub max_abs_autocorrelation: f64,
    /// Samples.
    pub lag: usize,
    /// Of `max_abs_autocorrelation`, simultaneous over all lags, confidence 1 − alpha.
    pub interval: [f64; 2],
    /// Statistic over `lags` lags.
    pub ljung_box: f64,
    /// P(χ² > statistic).
    pub ljung_box_p_value: f64,
    pub lags: usize,
}

/// Innovations averaged over blocks of one length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LowFrequencySummary {
    pub block_s: f64,
    pub blocks: u64,
    /// Power over what the filter predicts.
    pub ratio: f64,
    /// The ratio lies in [lower, upper] with probability 1 − alpha when the design is true.
    pub lower: f64,
    pub upper: f64,
    pub p_value: f64,
    /// For the true ratio, confidence 1 − alpha.
    pub interval: [f64; 2],
    /// Ratios at or beyond these are seen with 90 % probability.
    pub detects: [f64; 2],
}

/// The innovations of the start, along the direction in which x0 is uncertain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Start {
    /// Where the log starts: distance of its first bias from x0, in standard deviations of P0.
    pub sigmas: f64,
    pub p_value: f64,
}

/// A state at the end of the log.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FinalState {
    pub name: String,
    pub unit: String,
    pub value: f64,
    pub sigma: f64,
}

/// One axis of [`ReplayResult`], SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisResult {
    /// Of the filter.
    pub name: String,
    pub log_axis: String,
    /// Samples in the log.
    pub samples: u64,
    /// Samples that updated the filter.
    pub accepted: u64,
    /// Samples that are not numbers.
    pub unusable: u64,
    pub gaps: u64,
    /// Samples missing in the gaps.
    pub missing: u64,
    /// Samples outside the gate.
    pub rejected: u64,
    /// Σ −½(ln 2πS + ν²/S) over every accepted sample.
    pub log_likelihood: f64,
    /// The whole drift at the end of the log: what the filter expects a sensor at rest to show, but for noise of the measurement.
    pub final_output: FinalState,
    pub final_state: Vec<FinalState>,
    /// Absent when too few samples were accepted.
    pub nis: Option<Nis>,
    pub whiteness: Option<WhitenessSummary>,
    pub low_frequency: Vec<LowFrequencySummary>,
    pub start: Option<Start>,
    /// For figures; not part of the document.
    #[serde(skip)]
    pub sight: Sight,
}

/// What figures of one axis show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sight {
    pub trace: Vec<Point>,
    pub samples_per_point: u64,
    /// Lags 1, 2, …
    pub autocorrelation: Vec<f64>,
    /// Bound of one autocorrelation at level alpha.
    pub autocorrelation_bound: f64,
    /// Frequency in Hz and share of the power up to it, of the block-averaged innovations.
    pub cumulative_periodogram: Vec<(f64, f64)>,
    /// Bound of its distance from the straight line at level alpha.
    pub periodogram_bound: f64,
    /// Accepted samples with ν²/S in [i/2, (i+1)/2); the last bin has all above.
    pub nis_histogram: Vec<u64>,
}

/// The whole replay.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ReplayResult {
    /// "kfdesign-replay/1".
    pub format: String,
    pub verdict: Verdict,
    /// The verdict in words.
    pub meaning: String,
    /// Family-wise false-alarm probability.
    pub alpha: f64,
    /// File name and SHA-256 of the log, if it came from a file.
    pub log: Option<String>,
    pub log_sha256: Option<String>,
    pub gate: Option<f64>,
    pub quantity: Quantity,
    pub sample_rate: f64,
    pub axes: Vec<AxisResult>,
    pub tests: Vec<Test>,
}

/// One axis in progress.
#[derive(Clone, Debug)]
struct AxisReplay {
    kalman: Kalman,
    every: u64,
    drift: Vec<f64>,
    gate: Option<f64>,
    /// Steps since the first sample.
    step: u64,
    started: bool,
    start: StartTest,
    autocorrelation: Autocorrelation,
    low_frequency: LowFrequency,
    log_likelihood: Sum,
    samples: u64,
    unusable: u64,
    gaps: u64,
    missing: u64,
    rejected: u64,
    trace: Trace,
    nis_histogram: [u64; NIS_BINS],
}

/// The score test of x0: a second filter, shifted at the start by one standard deviation of P0 in the direction that the first
/// measurement sees, shows how innovations answer to such a shift; they are projected on that answer.
#[derive(Clone, Debug)]
struct StartTest {
    shifted: Option<Kalman>,
    /// Steps after which the answer has died away.
    until: u64,
    /// Σ d ν/S and Σ d²/S, d = difference of the innovations.
    score: f64,
    information: f64,
}

/// Streams a log through a design.
#[derive(Clone, Debug)]
pub struct Replayer {
    options: Options,
    design: FilterDesign,
    log_axes: Vec<String>,
    /// Index of the log axis for each design axis.
    assigned: Vec<usize>,
    axes: Vec<AxisReplay>,
}

impl Replayer {
    /// Checks quantity, rate and axes (see [`axes::assign`]) and starts every filter at x0, P0.
    pub fn new(design: &FilterDesign, log: &LogShape, options: Options) -> Result<Replayer, ReplayError> {
        options.check()?;
        let assigned = axes::assign(design, log)?;
        Ok(Replayer {
            options,
            log_axes: assigned.iter().map(|&i| log.axes[i].clone()).collect(),
            assigned,
            axes: design.axes.iter().map(|axis| AxisReplay::new(axis, options.gate)).collect(),
            design: design.clone(),
        })
    }

    /// Names of the log's axes in the order of the design's axes.
    pub fn log_axes(&self) -> &[String] {
        &self.log_axes
    }

    /// The next block of the log; its estimates replace what is in `estimates`, if wanted.
    pub fn push(&mut self, block: &Block, estimates: Option<&mut Estimates>) {
        let mut outputs = estimates.map(|estimates| {
            estimates.time_s.clone_from(&block.time_s);
            estimates.axes.resize_with(self.axes.len(), AxisEstimates::default);
            estimates.axes.iter_mut()
        });
        for (axis, &column) in self.axes.iter_mut().zip(&self.assigned) {
            let mut output = outputs.as_mut().and_then(Iterator::next);
            if let Some(output) = &mut output {
                output.clear(axis.kalman.x.len());
            }
            let values = block.values.get(column).map_or(&[][..], Vec::as_slice);
            for ((z, missing), time) in values.iter().zip(&block.missing).zip(&block.time_s) {
                let update = axis.step(*z, *missing, *time);
                if let Some(output) = &mut output {
                    output.push(&axis.kalman, update);
                }
            }
        }
    }

    /// The statistics and the verdict.
    pub fn finish(self) -> ReplayResult {
        verdict::conclude(self)
    }
}

impl AxisReplay {
    fn new(design: &AxisDesign, gate: Option<f64>) -> AxisReplay {
        let model = &design.model;
        let settling = design.steady_state.settling_time / model.dt;
        let gain = (model.h.row(0) * design.steady_state.gain.column(0))[0];
        AxisReplay {
            kalman: Kalman::new(model),
            every: model.every.first().copied().unwrap_or(1).max(1) as u64,
            drift: model.drift_row().iter().copied().collect(),
            gate,
            step: 0,
            started: false,
            start: StartTest::new(model, settling),
            autocorrelation: Autocorrelation::new(LAGS),
            low_frequency: LowFrequency::new(&time_constants(&design.steady_state.poles), gain),
            log_likelihood: Sum::default(),
            samples: 0,
            unusable: 0,
            gaps: 0,
            missing: 0,
            rejected: 0,
            trace: Trace::new(),
            nis_histogram: [0; NIS_BINS],
        }
    }

    /// One sample; `None` when there was no usable measurement.
    fn step(&mut self, z: f64, missing: u64, time_s: f64) -> Option<Update> {
        self.samples += 1;
        if self.started {
            self.advance(missing);
        }
        self.started = true;
        if !self.step.is_multiple_of(self.every) {
            return None;
        }
        if !z.is_finite() {
            self.unusable += 1;
            self.autocorrelation.skip(1);
            return None;
        }
        let update = self.kalman.update(0, z, self.gate);
        let y = update.innovation / update.variance.sqrt();
        if !update.accepted {
            if self.gate.is_some_and(|gate| y.abs() > gate) {
                self.rejected += 1;
            } else {
                self.unusable += 1;
            }
            self.autocorrelation.skip(1);
            return Some(update);
        }
        self.start.update(self.step, z, &update);
        self.log_likelihood.add(update.log_likelihood);
        self.autocorrelation.push(y);
        self.low_frequency.push(y);
        let (estimate, sigma) = self.output();
        self.trace.push(time_s, z, estimate, sigma, y);
        self.nis_histogram[((2.0 * update.nis) as usize).min(NIS_BINS - 1)] += 1;
        Some(update)
    }

    /// Predictions to the next sample, with `missing` samples in between.
    fn advance(&mut self, missing: u64) {
        let steps = missing.saturating_add(1);
        if missing == 0 {
            self.kalman.predict();
        } else {
            self.gaps += 1;
            self.missing = self.missing.saturating_add(missing);
            self.kalman.predict_many(steps);
            self.autocorrelation.skip(missing / self.every);
        }
        self.start.predict(steps);
        self.step = self.step.saturating_add(steps);
    }

    /// d x and √(d P dᵀ), d the row of the whole drift.
    fn output(&self) -> (f64, f64) {
        let (x, p) = (&self.kalman.x, &self.kalman.p);
        let (mut mean, mut variance) = (0.0, 0.0);
        for (i, di) in self.drift.iter().enumerate() {
            mean += di * x[i];
            for (j, dj) in self.drift.iter().enumerate() {
                variance += di * dj * p[(i, j)];
            }
        }
        (mean, variance.max(0.0).sqrt())
    }
}

impl StartTest {
    fn new(model: &crate::model::LinearModel, settling: f64) -> StartTest {
        let direction = &model.p0 * model.h.row(0).transpose();
        let size = (model.h.row(0) * &direction)[0].sqrt();
        let shifted = (size.is_finite() && size > 0.0).then(|| {
            let mut kalman = Kalman::new(model);
            kalman.x += direction / size;
            kalman
        });
        // a filter that never settles is watched for as long as a float counts exactly
        let until = if settling.is_finite() { settling.clamp(1.0, 1e9) as u64 } else { 1_000_000_000 };
        StartTest { shifted, until, score: 0.0, information: 0.0 }
    }

    fn predict(&mut self, steps: u64) {
        if let Some(kalman) = &mut self.shifted {
            match steps {
                1 => kalman.predict(),
                n => kalman.predict_many(n),
            }
        }
    }

    /// The same measurement that the filter accepted.
    fn update(&mut self, step: u64, z: f64, update: &Update) {
        let Some(kalman) = &mut self.shifted else { return };
        // ν of the shifted filter is ν − d
        let difference = update.innovation - kalman.update(0, z, None).innovation;
        self.score += difference * update.innovation / update.variance;
        self.information += difference * difference / update.variance;
        if step >= self.until {
            self.shifted = None;
        }
    }
}

impl AxisEstimates {
    fn clear(&mut self, states: usize) {
        for columns in [&mut self.states, &mut self.sigmas] {
            columns.resize_with(states, Vec::new);
            columns.iter_mut().for_each(Vec::clear);
        }
        for column in [&mut self.innovation, &mut self.innovation_sigma, &mut self.nis] {
            column.clear();
        }
    }

    fn push(&mut self, kalman: &Kalman, update: Option<Update>) {
        for (i, (states, sigmas)) in self.states.iter_mut().zip(&mut self.sigmas).enumerate() {
            states.push(kalman.x[i]);
            sigmas.push(kalman.p[(i, i)].max(0.0).sqrt());
        }
        let (innovation, sigma, nis) =
            update.map_or((f64::NAN, f64::NAN, f64::NAN), |u| (u.innovation, u.variance.sqrt(), u.nis));
        self.innovation.push(innovation);
        self.innovation_sigma.push(sigma);
        self.nis.push(nis);
    }
}
