//! Parameters to a sensor stream with truth (floor 3).
//!
//! measured = true rate + bias + every noise term, then rounded and limited if asked. Exact discrete sample paths of
//! each term come from [`crate::noise`]; every term of every axis draws from a stream of its own.
//!
//! # Stream addresses
//!
//! A stream is addressed by (seed, run, axis, term): axis is the position in `params.json` from 0, term is
//!
//! | what | term number |
//! | --- | --- |
//! | turn-on bias | 1 |
//! | quantisation | 0x1_0000 + i |
//! | white | 0x2_0000 + i |
//! | bias instability | 0x3_0000 + i |
//! | Gauss–Markov | 0x4_0000 + i |
//! | rate random walk | 0x5_0000 + i |
//! | rate ramp (draws nothing) | 0x6_0000 + i |
//! | oscillation | 0x7_0000 + i |
//! | moving average | 0x8_0000 + i |
//!
//! with i counting the terms of that kind on the axis from 0. Adding an axis, a term of another kind or a later term of
//! the same kind changes no other number.

mod flight;

use schemars::JsonSchema;
use serde::Serialize;

use crate::noise::{Kind, SamplePath};
use crate::numerics::progress::checkpoint;
use crate::numerics::random::{StreamId, normal, stream};
use crate::params::{AxisParams, Params};
use crate::units::Quantity;

pub use flight::{Flight, FlightBlock};

/// More is refused: 300 years at 100 Hz.
pub const MAX_SAMPLES: u64 = 1_000_000_000_000;

/// The true rate the sensor sees, SI.
#[derive(Clone, Debug, PartialEq)]
pub enum TrueRate {
    Rest,
    Constant(f64),
    /// amplitude · sin(2π f t), the same on every axis.
    Sinusoid {
        amplitude: f64,
        frequency_hz: f64,
    },
    /// Sampled at the simulation's own rate: one list for all axes, or one for each.
    Samples(Vec<Vec<f64>>),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    pub seed: u64,
    pub run: u64,
    pub samples: u64,
    pub rate_hz: f64,
    pub true_rate: TrueRate,
    /// Draw the turn-on bias of each axis (normal, standard deviation `turn_on_bias`) and add it to the constant bias.
    pub turn_on: bool,
    /// ± limit, SI.
    pub saturation: Option<f64>,
    /// Step of the output, SI: every sample is rounded to a multiple of it.
    pub quantisation: Option<f64>,
}

/// One clear line: what is wrong with the scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct SimulateError(String);

/// One axis' samples of a block: measured and its truth, SI.
#[derive(Clone, Debug, Default)]
pub struct AxisBlock {
    pub measured: Vec<f64>,
    pub true_rate: Vec<f64>,
    /// Constant bias, with the turn-on bias if it was drawn.
    pub bias: f64,
    /// Sum of all drift terms ([`Kind::is_drift`]): everything that is neither true rate, constant bias nor noise of
    /// the measurement.
    pub drift: Vec<f64>,
    /// Per term of the axis (order of `AxisParams::terms`), its contribution.
    pub terms: Vec<Vec<f64>>,
}

/// Streaming simulator: the same numbers for any block size, memory of one block.
pub struct Simulator {
    axes: Vec<AxisGenerator>,
    scenario: Scenario,
    next: u64,
}

struct AxisGenerator {
    bias: f64,
    terms: Vec<(Kind, Box<dyn SamplePath + Send>)>,
}

/// Term part of a stream address; see the table above.
pub fn term_number(kind: Kind, index: u32) -> u32 {
    let code = match kind {
        Kind::Quantization => 1,
        Kind::White => 2,
        Kind::BiasInstability => 3,
        Kind::GaussMarkov => 4,
        Kind::RateRandomWalk => 5,
        Kind::RateRamp => 6,
        // later kinds come after the earlier ones, whose numbers stay
        Kind::Oscillation => 7,
        Kind::MovingAverage => 8,
        Kind::BandLimit => 9,
    };
    (code << 16) + index
}

/// Term number of the turn-on bias.
pub const TURN_ON_BIAS: u32 = 1;

impl Scenario {
    /// Whether it can be run for that many axes.
    pub fn check(&self, axes: usize) -> Result<(), SimulateError> {
        let fail = |message: String| Err(SimulateError(message));
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !positive(self.rate_hz) {
            return fail(format!("sample rate {} Hz: expected a positive number", self.rate_hz));
        }
        if self.samples == 0 {
            return fail("no sample fits into the duration; make it longer or the rate higher".into());
        }
        if self.samples > MAX_SAMPLES {
            return fail(format!("{} samples are more than the limit of {MAX_SAMPLES}", self.samples));
        }
        if let Some(limit) = self.saturation.filter(|x| !positive(*x)) {
            return fail(format!("saturation at {limit}: expected a positive limit"));
        }
        if let Some(step) = self.quantisation.filter(|x| !positive(*x)) {
            return fail(format!("quantisation step {step}: expected a positive step"));
        }
        match &self.true_rate {
            TrueRate::Rest => Ok(()),
            TrueRate::Constant(rate) if rate.is_finite() => Ok(()),
            TrueRate::Constant(rate) => fail(format!("true rate {rate}: expected a finite number")),
            TrueRate::Sinusoid { amplitude, frequency_hz } => {
                if amplitude.is_finite() && positive(*frequency_hz) {
                    return Ok(());
                }
                fail(format!("sinusoid of amplitude {amplitude} at {frequency_hz} Hz: expected a positive frequency"))
            }
            TrueRate::Samples(columns) => {
                if columns.len() != 1 && columns.len() != axes {
                    return fail(format!("true rate on {} axes: expected 1 or {axes}", columns.len()));
                }
                for column in columns {
                    if (column.len() as u64) < self.samples {
                        return fail(format!("true rate has {} samples, {} are needed", column.len(), self.samples));
                    }
                    if let Some(k) = column.iter().position(|x| !x.is_finite()) {
                        return fail(format!("true rate: sample {} is not a finite number", k + 1));
                    }
                }
                Ok(())
            }
        }
    }
}

impl Simulator {
    /// A simulator at its first sample. Errors: the scenario does not fit, or a line is not below half its sample rate.
    pub fn new(params: &Params, scenario: &Scenario) -> Result<Simulator, SimulateError> {
        Simulator::of_axes(params, scenario, 0)
    }

    /// The same for a sensor beside others: its axes have the numbers `first`, `first + 1`, … in the addresses of
    /// streams.
    pub fn of_axes(params: &Params, scenario: &Scenario, first: u32) -> Result<Simulator, SimulateError> {
        scenario.check(params.axes.len())?;
        let dt = 1.0 / scenario.rate_hz;
        for axis in &params.axes {
            axis.noise().check_rate(dt).map_err(|e| SimulateError(format!("axis '{}': {e}", axis.name)))?;
        }
        let axes = (first..).zip(&params.axes).map(|(i, axis)| AxisGenerator::new(axis, i, scenario, dt)).collect();
        Ok(Simulator { axes, scenario: scenario.clone(), next: 0 })
    }

    /// Next at most `n` samples per axis; 0 at the end.
    pub fn next_block(&mut self, n: usize, axes: &mut Vec<AxisBlock>) -> usize {
        checkpoint();
        let left = self.scenario.samples - self.next;
        let n = usize::try_from(left).map_or(n, |left| left.min(n));
        axes.resize_with(self.axes.len(), AxisBlock::default);
        for (i, (generator, block)) in self.axes.iter_mut().zip(axes.iter_mut()).enumerate() {
            block.true_rate.resize(n, 0.0);
            self.scenario.true_rate.fill(i, self.next, 1.0 / self.scenario.rate_hz, &mut block.true_rate);
            generator.fill(n, block);
            sense(&self.scenario, &mut block.measured);
        }
        self.next += n as u64;
        n
    }
}

impl AxisGenerator {
    fn new(axis: &AxisParams, number: u32, scenario: &Scenario, dt: f64) -> Self {
        let address = |term: u32| stream(scenario.seed, StreamId { run: scenario.run, axis: number, term });
        let mut bias = axis.bias.as_ref().map_or(0.0, |b| b.si());
        if let Some(spread) = axis.turn_on_bias.as_ref().filter(|_| scenario.turn_on) {
            bias += spread.si() * normal(&mut address(TURN_ON_BIAS));
        }
        let model = axis.noise();
        let terms = model
            .terms
            .iter()
            .enumerate()
            .map(|(i, term)| {
                let kind = term.kind();
                let before = model.terms.iter().take(i).filter(|t| t.kind() == kind).count();
                (kind, term.sample_path(dt, address(term_number(kind, before as u32))))
            })
            .collect();
        AxisGenerator { bias, terms }
    }

    fn fill(&mut self, n: usize, block: &mut AxisBlock) {
        block.bias = self.bias;
        block.terms.resize_with(self.terms.len(), Vec::new);
        block.drift.clear();
        block.drift.resize(n, 0.0);
        block.measured.clear();
        block.measured.extend(block.true_rate.iter().map(|rate| rate + self.bias));
        for ((kind, path), values) in self.terms.iter_mut().zip(&mut block.terms) {
            values.resize(n, 0.0);
            path.fill(values);
            for (measured, value) in block.measured.iter_mut().zip(values.iter()) {
                *measured += value;
            }
            if kind.is_drift() {
                for (drift, value) in block.drift.iter_mut().zip(values.iter()) {
                    *drift += value;
                }
            }
        }
    }
}

impl TrueRate {
    /// Samples `first`, `first + 1`, … of one axis.
    fn fill(&self, axis: usize, first: u64, dt: f64, out: &mut [f64]) {
        match self {
            TrueRate::Rest => out.fill(0.0),
            TrueRate::Constant(rate) => out.fill(*rate),
            TrueRate::Sinusoid { amplitude, frequency_hz } => {
                for (k, x) in (first..).zip(out) {
                    let cycles = frequency_hz * dt * k as f64;
                    *x = amplitude * (2.0 * std::f64::consts::PI * cycles.fract()).sin();
                }
            }
            TrueRate::Samples(columns) => {
                let column = columns.get(axis).or(columns.first()).map_or(&[][..], Vec::as_slice);
                let from = usize::try_from(first).map_or(column.len(), |k| k.min(column.len()));
                for (x, rate) in out.iter_mut().zip(&column[from..]) {
                    *x = *rate;
                }
            }
        }
    }
}

/// Rounding to the output step, then the limit.
fn sense(scenario: &Scenario, measured: &mut [f64]) {
    if let Some(step) = scenario.quantisation {
        for x in measured.iter_mut() {
            *x = (*x / step).round() * step;
        }
    }
    if let Some(limit) = scenario.saturation {
        for x in measured {
            *x = x.clamp(-limit, limit);
        }
    }
}

/// What `simulate --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// "kfdesign-simulation/1".
    pub format: &'static str,
    pub log: String,
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    pub samples: u64,
    pub duration_s: f64,
    pub seed: u64,
    pub run: u64,
    pub unit: String,
    pub axes: Vec<AxisSummary>,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisSummary {
    /// Name of the column.
    pub name: String,
    /// Constant bias with the turn-on draw, in `unit`.
    pub bias: f64,
    /// Of the measured column, in `unit`.
    pub mean: f64,
    pub std_dev: f64,
    /// Samples at the limit.
    pub saturated: u64,
}
