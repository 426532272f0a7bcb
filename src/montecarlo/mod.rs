//! Many simulated runs through a design (floor 5): the quick verification that tune makes; the full gate comes later.
//!
//! The truth is a linear model, by default the design's own: x0 ~ N(x0, P0), exact process and measurement noise. The filter's covariances do not
//! depend on the data, so they are computed once and many runs go through the gains. Every random number is addressed by (seed, run, axis).

mod engine;
mod summary;

use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::{Test, Verdict, multiplicity};
use crate::filter::FilterDesign;
use crate::numerics::linalg::LinalgError;

/// Size of a verification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    pub runs: u64,
    /// Samples per run.
    pub steps: u64,
    pub seed: u64,
    /// Probability that a true design is called inconsistent, at most (all tests and axes together).
    pub alpha: f64,
}

impl Plan {
    /// 100 runs of 600 s (at least 2000, at most 60 000 samples), seed 1, false alarm at most 1e-3.
    pub fn quick(sample_rate_hz: f64) -> Plan {
        let steps = (600.0 * sample_rate_hz).round().clamp(2000.0, 60_000.0);
        Plan { runs: 100, steps: steps as u64, seed: 1, alpha: 1e-3 }
    }
}

/// Estimation errors of all runs at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Epoch {
    /// s from the first measurement.
    pub time_s: f64,
    /// Mean NEES over the runs, divided by the number of states: 1 when the covariance is right.
    pub anees: f64,
    /// `anees` lies in [lower, upper] with probability 1 − alpha when the design is true.
    pub lower: f64,
    pub upper: f64,
}

/// One axis of [`Outcome`].
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisOutcome {
    pub name: String,
    pub epochs: Vec<Epoch>,
    /// Mean NIS over all runs and steps.
    pub nis: f64,
}

/// What the runs say.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Outcome {
    pub verdict: Verdict,
    /// Bound of the false-alarm probability of the verdict.
    pub alpha: f64,
    pub runs: u64,
    pub steps: u64,
    pub seed: u64,
    pub axes: Vec<AxisOutcome>,
    pub tests: Vec<Test>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MonteCarloError {
    #[error("{name} is {value}, expected {expected}")]
    Plan { name: &'static str, value: f64, expected: &'static str },
    #[error("axis '{axis}': {what} of the truth: {source}")]
    Truth { axis: String, what: &'static str, source: LinalgError },
    #[error("axis '{axis}': the truth has {truth}, the filter {filter}")]
    Mismatch { axis: String, truth: String, filter: String },
    #[error("axis '{axis}' has {count} measurements; one is handled")]
    Measurements { axis: String, count: usize },
}

/// Runs the design on its own model: is its covariance what its errors are?
///
/// Tests per axis: NEES over the runs at five times (never summed over one run), the mean error at the first and the last, mean NIS,
/// correlation of neighbouring innovations, and their low-frequency power. Holm's adjustment over all tests and axes keeps the
/// false-alarm probability of the verdict at or below `plan.alpha`. `progress` is called with the number of runs just finished (all axes).
/// Same design, plan and version: same outcome for any number of threads.
pub fn verify(design: &FilterDesign, plan: &Plan, progress: &(dyn Fn(u64) + Sync)) -> Result<Outcome, MonteCarloError> {
    verify_against(design, design, plan, progress)
}

/// The same with another truth: `truth` must have the axes and sample rate of `design`; with other states than the filter's, the error
/// that is judged is that of the whole drift.
pub fn verify_against(
    design: &FilterDesign,
    truth: &FilterDesign,
    plan: &Plan,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Outcome, MonteCarloError> {
    check_plan(plan)?;
    if design.axes.len() != truth.axes.len() || design.sample_rate_hz != truth.sample_rate_hz {
        return Err(MonteCarloError::Mismatch {
            axis: design.axes.first().map_or_else(String::new, |a| a.name.clone()),
            truth: format!("{} axes at {} Hz", truth.axes.len(), truth.sample_rate_hz),
            filter: format!("{} axes at {} Hz", design.axes.len(), design.sample_rate_hz),
        });
    }
    let mut tests = Vec::new();
    let mut axes = Vec::new();
    for (number, (filter, truth)) in design.axes.iter().zip(&truth.axes).enumerate() {
        let axis = engine::Axis::new(filter, &truth.model, plan)?;
        let sums = engine::run(&axis, number as u32, plan, progress);
        let (outcome, its_tests) = summary::conclude(&filter.name, &axis, &sums, plan);
        axes.push(outcome);
        tests.extend(its_tests);
    }
    let verdict = multiplicity::judge(&mut tests, plan.alpha);
    Ok(Outcome { verdict, alpha: plan.alpha, runs: plan.runs, steps: plan.steps, seed: plan.seed, axes, tests })
}

fn check_plan(plan: &Plan) -> Result<(), MonteCarloError> {
    let wrong = |name, value, expected| Err(MonteCarloError::Plan { name, value, expected });
    if plan.runs < 2 {
        return wrong("runs", plan.runs as f64, "at least 2");
    }
    if !(16..=1_000_000).contains(&plan.steps) {
        return wrong("steps", plan.steps as f64, "16 to 1 000 000");
    }
    if !(plan.alpha > 0.0 && plan.alpha < 1.0) {
        return wrong("alpha", plan.alpha, "between 0 and 1");
    }
    Ok(())
}
