//! Many simulated runs through a design: does its covariance tell the truth? (floor 5)
//!
//! An [`Experiment`] is design, truth, length, seed and level. Its [`Course`] holds what no random number changes
//! (gains, epochs, block lengths); the engine adds up what the gate looks at over any range of runs, exactly;
//! `conclusion` makes tests of the sums; `gate` and `law` know how these tests behave together for a true filter, so
//! that the verdict has the false-alarm probability it states.
//!
//! The truth is a linear model: x(0) ~ N(x0, P0), exact process and measurement noise. Every random number is
//! addressed by (seed, run, axis, source).

pub mod calibration;
mod conclusion;
pub mod course;
mod credibility;
pub mod document;
pub mod engine;
pub mod every_step;
pub mod experiment;
pub mod gate;
mod kernels;
mod lanes;
mod law;
pub mod outcome;
pub mod power;
mod scratch;
mod sentences;
mod spread;
pub mod sums;

use std::ops::Range;

pub use engine::{Course, Path, Trace};
pub use experiment::Experiment;
pub use outcome::{AxisOutcome, Outcome, Runs};
pub use sums::Totals;

use crate::consistency::Verdict;
use crate::filter::FilterDesign;
use crate::numerics::linalg::LinalgError;
use crate::tune::TuneError;
use gate::Gate;

/// Replicates that set the critical value of the quick verification.
const QUICK_REPLICATES: u64 = 4_000;

/// Size of a quick verification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    pub runs: u64,
    /// Samples per run.
    pub steps: u64,
    pub seed: u64,
    /// Probability that a true design is called inconsistent (all tests and axes together).
    pub alpha: f64,
}

impl Plan {
    /// 100 runs of 600 s (at least 2000, at most 60 000 samples), seed 1, false alarm 1e-3.
    pub fn quick(sample_rate_hz: f64) -> Plan {
        let steps = (600.0 * sample_rate_hz).round().clamp(2000.0, 60_000.0);
        Plan { runs: 100, steps: steps as u64, seed: 1, alpha: 1e-3 }
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MonteCarloError {
    #[error("{name} is {value}, expected {expected}")]
    Plan { name: &'static str, value: f64, expected: String },
    #[error(
        "axis '{axis}': measurement '{name}' is taken every {every} samples, but a run has {steps}; expected two in a \
         run: make the duration \
         longer"
    )]
    Updates { axis: String, name: String, every: u64, steps: u64 },
    #[error("axis '{axis}': {what} of the truth: {source}")]
    Truth { axis: String, what: &'static str, source: LinalgError },
    #[error("the truth: {source}")]
    Parameters { source: TuneError },
    #[error("axis '{axis}': the truth has {truth}, the filter {filter}")]
    Mismatch { axis: String, truth: String, filter: String },
    #[error(
        "the truth has the axes {truth}, the filter {filter}; expected the same names: tune a filter for the axes of \
         the truth"
    )]
    Axes { truth: String, filter: String },
    #[error("the truth is {truth}, the filter {filter}")]
    Quantity { truth: &'static str, filter: &'static str },
    #[error(
        "axis '{axis}': no parameter has an interval to draw from; give them in the truth's parameters (\"interval\": \
         [lower, upper]), as identify does"
    )]
    NoIntervals { axis: String },
    #[error("{path}: {key}: {message}")]
    Document { path: String, key: String, message: String },
}

/// Runs the design on its own model: is its covariance what its errors are?
///
/// The tests are those of the gate ([`gate::Kind`]); the family-wise false-alarm probability is `plan.alpha`.
/// Who waits hears of each run of each axis. Same design, plan and version: same outcome for any number of threads.
pub fn verify(design: &FilterDesign, plan: &Plan) -> Result<Outcome, MonteCarloError> {
    verify_against(design, design, plan)
}

/// The same with another truth: `truth` must have the axes and sample rate of `design`; with other states than the
/// filter's, the error that is judged is that of the whole drift.
pub fn verify_against(design: &FilterDesign, truth: &FilterDesign, plan: &Plan) -> Result<Outcome, MonteCarloError> {
    experiment::check(plan.steps, plan.alpha)?;
    if plan.runs < 2 {
        return Err(MonteCarloError::Plan { name: "runs", value: plan.runs as f64, expected: "at least 2".into() });
    }
    if design.axes.len() != truth.axes.len() {
        let names = |d: &FilterDesign| d.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(MonteCarloError::Axes { truth: names(truth), filter: names(design) });
    }
    if design.sample_rate_hz != truth.sample_rate_hz {
        let rate = |d: &FilterDesign| format!("a sample rate of {} Hz", d.sample_rate_hz);
        let axis = design.axes.first().map_or_else(String::new, |axis| axis.name.clone());
        return Err(MonteCarloError::Mismatch { axis, truth: rate(truth), filter: rate(design) });
    }
    let course = experiment::course_of(design, course::own_models(truth), plan.steps, plan.seed)?;
    let totals = course.sums(0..plan.runs);
    let gate = calibration::gate(&course, plan.runs, plan.alpha, QUICK_REPLICATES);
    Ok(conclude(&course, &totals, 0..plan.runs, &gate))
}

/// Verdict on the sums of `runs`.
pub fn conclude(course: &Course, totals: &[Totals], runs: Range<u64>, gate: &Gate) -> Outcome {
    let count = runs.end - runs.start;
    let (mut axes, mut tests) = (Vec::new(), Vec::new());
    for (number, (axis, totals)) in course.axes.iter().zip(totals).enumerate() {
        let (outcome, own) = conclusion::conclude(number, axis, totals, count, gate);
        axes.push(outcome);
        tests.extend(own);
    }
    let verdict = if tests.iter().all(|t| t.pass()) { Verdict::Consistent } else { Verdict::Inconsistent };
    let mut outcome = Outcome {
        verdict,
        meaning: String::new(),
        alpha: gate.alpha,
        runs: Runs { first: runs.start, end: runs.end },
        steps: course.steps,
        duration_s: course.steps as f64 * course.dt,
        seed: course.seed,
        critical_p_value: gate.critical,
        false_alarm_rate: None,
        rejection: None,
        detects: Vec::new(),
        tests,
        axes,
    };
    outcome.meaning = sentences::verdict(&outcome) + &sentences::unsettled(course);
    outcome
}
