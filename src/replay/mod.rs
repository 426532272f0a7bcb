//! A log through a design to a verdict (floor 4).
//!
//! [`Replayer`] takes the log block by block and keeps only running sums, so its memory does not grow with the log.
//! The sensor of a plant is an input or the first measurement; aids are extra columns, and a row without a number is
//! one without that measurement. Measured angles are taken modulo a turn: the innovation is the nearest one. Over a
//! gap the filter predicts and nothing else (an input keeps its last value); a sample that is not a number is
//! skipped (prediction only); a sample outside the gate, if there is one, is counted and does not change the state.
//! The statistics use the normalised innovations of accepted samples; see [`verdict`] for what is tested and
//! [`crate::consistency::effect::judge`] for how the verdict on a measured log is reached.

pub mod attitude;
pub mod axes;
mod axis;
pub mod follow;
pub mod trace;
pub mod verdict;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::{Test, Verdict};
use crate::filter::smoother::{History, Smoothed, smooth};
use crate::filter::{AIRPLANE, AxisDesign, FilterDesign, Form, Running};
use crate::input::{Block, LogReader};
use crate::model::{LinearModel, Named};
use crate::numerics::linalg::LinalgError;
use crate::numerics::progress::checkpoint;
use crate::params::PlantEntry;
use crate::units::Quantity;

use axis::AxisReplay;
use follow::{FollowResult, Following};
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
    /// Such a sample still moves the estimate, as far as one at the gate would.
    pub clip: bool,
    pub form: Form,
    /// The wideband noise is that of the last samples, so many seconds of them; before there are as many, the design
    /// stands for the rest. Only for sensors at rest and [`Form::Joseph`].
    pub follow: Option<f64>,
}

impl Default for Options {
    fn default() -> Options {
        Options { alpha: 0.01, gate: None, clip: false, form: Form::Joseph, follow: None }
    }
}

impl Options {
    /// `alpha` is a probability, `gate` at least one sigma.
    pub fn check(&self) -> Result<(), ReplayError> {
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            return Err(ReplayError::Option { name: "alpha", value: self.alpha, expected: "between 0 and 1" });
        }
        if let Some(value) = self.follow.filter(|follow| !(*follow > 0.0 && follow.is_finite())) {
            return Err(ReplayError::Option { name: "follow", value, expected: "seconds, more than 0" });
        }
        match self.gate {
            Some(gate) if !(gate >= 1.0 && gate.is_finite()) => {
                let name = if self.clip { "clip" } else { "gate" };
                Err(ReplayError::Option { name, value: gate, expected: "at least 1 (sigmas)" })
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
    /// Extra columns, in the order of [`aids`].
    pub aids: usize,
}

impl LogShape {
    /// Of an open log of which so many columns are aids.
    pub fn of(reader: &LogReader, aids: usize) -> LogShape {
        LogShape {
            axes: reader.axes().iter().map(|axis| axis.name.clone()).collect(),
            quantity: reader.quantity(),
            sample_rate_hz: reader.check().sample_rate_hz,
            aids,
        }
    }
}

/// A measurement of a design that is not of its sensor, or an input that is known exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct Aid {
    pub axis: String,
    pub measurement: Named,
}

/// What a log must have beside the sensor, axis by axis: an input that is not the sensor, then the measurements that
/// are not. Errors: a custom plant whose design is not known.
pub fn aids(design: &FilterDesign) -> Result<Vec<Aid>, ReplayError> {
    let mut all = Vec::new();
    for axis in &design.axes {
        let roles = Roles::new(design, &axis.model)?;
        let beside = axis.model.inputs[..roles.known_inputs].iter().chain(&axis.model.measurements[roles.own..]);
        all.extend(beside.map(|named| Aid { axis: axis.name.clone(), measurement: named.clone() }));
    }
    Ok(all)
}

/// What the sensor is to a filter.
#[derive(Clone, Copy, Debug)]
struct Roles {
    /// Measurements that are of the sensor itself: the first, unless the sensor is an input.
    own: usize,
    /// Inputs that are columns of their own: all, unless the sensor is one.
    known_inputs: usize,
}

impl Roles {
    fn new(design: &FilterDesign, model: &LinearModel) -> Result<Roles, ReplayError> {
        let is_input = match design.design.as_ref().map(|design| &design.plant) {
            Some(PlantEntry::Custom(entry)) => model.inputs.iter().any(|input| input.name == entry.sensor),
            _ if design.plant == AIRPLANE => false,
            _ if design.plant == "custom" && model.inputs.len() + model.measurements.len() > 1 => {
                return Err(ReplayError::CustomUntold);
            }
            _ => !model.inputs.is_empty(),
        };
        if is_input && model.inputs.len() > 1 {
            let inputs = model.inputs.iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(ReplayError::Inputs { inputs });
        }
        Ok(Roles { own: usize::from(!is_input), known_inputs: if is_input { 0 } else { model.inputs.len() } })
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReplayError {
    #[error(
        "the log is in {log} but the filter is for {filter}: choose the columns with `columns` or `sensor`, or give \
         the right filter"
    )]
    Quantity { log: &'static str, filter: &'static str },
    #[error(
        "the log has {log_hz} Hz but the filter is for {filter_hz} Hz ({percent:.2} % apart, 0.5 % are allowed): \
         identify and tune at the log's rate, or correct the rate with `rate`"
    )]
    Rate { log_hz: f64, filter_hz: f64, percent: f64 },
    #[error(
        "cannot tell which axis is which: the log has {log}, the filter has {filter}; choose with `columns`, in the \
         order of the filter's axes"
    )]
    Axes { log: String, filter: String },
    #[error(
        "the filter of plant '{plant}' measures {names} beside the sensor, the log gives {found} such columns; name \
         the columns, one per \
         axis: replay `aid` NAME=COLUMN"
    )]
    Aids { plant: String, names: String, found: usize },
    #[error(
        "the filter is for a custom plant, and its 'design' section, which says what the sensor is, is not there; \
         write it with tune"
    )]
    CustomUntold,
    #[error(
        "the plant has the inputs {inputs}, one of them the sensor; replay then handles no other, montecarlo judges \
         this filter on simulated runs"
    )]
    Inputs { inputs: String },
    #[error("axis '{axis}': Q and P0 have no square root: {source}")]
    SquareRoot { axis: String, source: LinalgError },
    #[error("axis '{axis}': its noise cannot be followed: {reason}")]
    Follow { axis: String, reason: String },
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
    /// One per measurement.
    pub updates: Vec<UpdateEstimates>,
}

/// One measurement of [`AxisEstimates`], SI.
#[derive(Clone, Debug, Default)]
pub struct UpdateEstimates {
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
    /// Of the filter; with the measurement behind it where there are several ("z.heading").
    pub name: String,
    /// Of the filter.
    pub axis: String,
    /// Whether the sensor is part of a plant; else it rests.
    pub of_plant: bool,
    /// What was measured.
    pub measurement: String,
    /// SI unit of it.
    pub unit: String,
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
    /// The whole drift at the end of the log: what the filter expects a sensor at rest to show, but for noise of the
    /// measurement. Of a plant, its first state.
    pub final_output: FinalState,
    pub final_state: Vec<FinalState>,
    /// Absent when too few samples were accepted.
    pub nis: Option<Nis>,
    pub whiteness: Option<WhitenessSummary>,
    pub low_frequency: Vec<LowFrequencySummary>,
    pub start: Option<Start>,
    /// Where the noise was followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub follow: Option<FollowResult>,
    /// For figures; not part of the document.
    #[serde(skip)]
    pub curves: Curves,
}

/// What figures of one axis show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
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
    /// Checks quantity, rate and axes (see [`axes::assign`]) and that every aid has a column, and starts every
    /// filter at x0, P0.
    pub fn new(design: &FilterDesign, log: &LogShape, options: Options) -> Result<Replayer, ReplayError> {
        options.check()?;
        let needed = aids(design)?;
        if needed.len() != log.aids {
            let mut names: Vec<String> = needed.into_iter().map(|aid| aid.measurement.name).collect();
            names.dedup();
            return Err(ReplayError::Aids { plant: design.plant.clone(), names: names.join(", "), found: log.aids });
        }
        let assigned = axes::assign(design, log)?;
        let start = |axis: &AxisDesign| {
            let filter = Running::new(options.form, axis)
                .map_err(|source| ReplayError::SquareRoot { axis: axis.name.clone(), source })?;
            let following =
                options.follow.map(|memory_s| following(design, axis, options.form, memory_s)).transpose()?;
            Ok(AxisReplay::new(axis, filter, Roles::new(design, &axis.model)?, &options, following))
        };
        let axes = design.axes.iter().map(start).collect::<Result<Vec<_>, ReplayError>>()?;
        Ok(Replayer {
            options,
            log_axes: assigned.iter().map(|&i| log.axes[i].clone()).collect(),
            assigned,
            axes,
            design: design.clone(),
        })
    }

    /// Names of the log's axes in the order of the design's axes.
    pub fn log_axes(&self) -> &[String] {
        &self.log_axes
    }

    /// The next block of the log; its estimates replace what is in `estimates`, if wanted.
    pub fn push(&mut self, block: &Block, estimates: Option<&mut Estimates>) {
        checkpoint();
        let values_of = |column: usize| block.values.get(column).map_or(&[][..], Vec::as_slice);
        let mut done = vec![false; self.axes.len()];
        if estimates.is_none() {
            let axes = self.axes.par_iter_mut().zip(&self.assigned).zip(&mut done);
            axes.for_each(|((axis, column), done)| {
                *done = axis.rows(values_of(*column), &block.missing, &block.time_s);
            });
        }
        let mut outputs = estimates.map(|estimates| {
            estimates.time_s.clone_from(&block.time_s);
            estimates.axes.resize_with(self.axes.len(), AxisEstimates::default);
            estimates.axes.iter_mut()
        });
        let mut extra = block.extra.iter();
        for ((axis, &column), done) in self.axes.iter_mut().zip(&self.assigned).zip(done) {
            let aids: Vec<&[f64]> = extra.by_ref().take(axis.aids()).map(Vec::as_slice).collect();
            let mut output = outputs.as_mut().and_then(Iterator::next);
            if let Some(output) = &mut output {
                output.clear(axis.filter.x().len(), axis.channels.len());
            }
            let values = values_of(column);
            if done {
                continue;
            }
            for (row, ((z, missing), time)) in values.iter().zip(&block.missing).zip(&block.time_s).enumerate() {
                axis.step(*z, *missing, *time, aids.iter().map(|aid| aid.get(row).copied().unwrap_or(f64::NAN)));
                if let Some(output) = &mut output {
                    output.push(axis);
                }
            }
        }
    }

    /// From here on every row is kept, for [`smoothed`](Replayer::smoothed): 40 bytes per row and axis, and 16 per
    /// measurement.
    pub fn remember(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.history = Some(History::default()));
    }

    /// Filtered and smoothed estimates of every row that was remembered, per axis.
    pub fn smoothed(&self) -> Vec<Smoothed> {
        let of = |(axis, design): (&AxisReplay, &AxisDesign)| {
            axis.history.as_ref().map(|history| smooth(&design.model, history)).unwrap_or_default()
        };
        self.axes.par_iter().zip(&self.design.axes).map(of).collect()
    }

    /// The statistics and the verdict.
    pub fn finish(mut self) -> ReplayResult {
        self.axes.iter_mut().for_each(AxisReplay::flush);
        verdict::conclude(self)
    }
}

fn following(design: &FilterDesign, axis: &AxisDesign, form: Form, memory_s: f64) -> Result<Following, ReplayError> {
    let failed = |reason: String| ReplayError::Follow { axis: axis.name.clone(), reason };
    if design.plant != "static" {
        return Err(failed(format!(
            "the plant is '{}', and only of a sensor at rest is all that is measured noise",
            design.plant
        )));
    }
    if form != Form::Joseph {
        return Err(failed("only the form joseph takes new noise".into()));
    }
    Following::new(axis, design.quantity, memory_s).map_err(failed)
}

impl AxisEstimates {
    fn clear(&mut self, states: usize, measurements: usize) {
        for columns in [&mut self.states, &mut self.sigmas] {
            columns.resize_with(states, Vec::new);
            columns.iter_mut().for_each(Vec::clear);
        }
        self.updates.resize_with(measurements, UpdateEstimates::default);
        for update in &mut self.updates {
            for column in [&mut update.innovation, &mut update.innovation_sigma, &mut update.nis] {
                column.clear();
            }
        }
    }

    fn push(&mut self, axis: &AxisReplay) {
        let x = axis.filter.x();
        for (i, (states, sigmas)) in self.states.iter_mut().zip(&mut self.sigmas).enumerate() {
            states.push(x[i]);
            sigmas.push(axis.filter.sigma(i));
        }
        for (update, channel) in self.updates.iter_mut().zip(&axis.channels) {
            let (innovation, sigma, nis) =
                channel.last.map_or((f64::NAN, f64::NAN, f64::NAN), |u| (u.innovation, u.variance.sqrt(), u.nis));
            update.innovation.push(innovation);
            update.innovation_sigma.push(sigma);
            update.nis.push(nis);
        }
    }
}
