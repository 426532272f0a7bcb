//! What an experiment says: the verdict document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::consistency::{Test, Verdict};

/// Runs `first`, `first` + 1, …, `end` − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Runs {
    pub first: u64,
    pub end: u64,
}

impl Runs {
    pub fn count(self) -> u64 {
        self.end - self.first
    }
}

/// The verdict with everything it rests on.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Outcome {
    pub verdict: Verdict,
    /// A sentence.
    pub meaning: String,
    /// Family-wise false-alarm probability of the verdict, all tests and axes together.
    pub alpha: f64,
    pub runs: Runs,
    /// Samples per run.
    pub steps: u64,
    pub duration_s: f64,
    pub seed: u64,
    /// A test fails when its p-value is at or below this; set so that a true filter fails some test with probability
    /// alpha. Null in a document of interrupted work.
    #[schemars(with = "Option<f64>")]
    pub critical_p_value: f64,
    /// Measured; absent where it was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub false_alarm_rate: Option<FalseAlarmRate>,
    /// How surely this gate rejects the given truth; absent when the design is its own truth, or the truth is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rejection: Option<Rejection>,
    /// Mistuning that the gate sees with 90 % probability, of the design as it is.
    pub detects: Vec<Detectable>,
    /// Adjusted p-values are family-wise.
    pub tests: Vec<Test>,
    pub axes: Vec<AxisOutcome>,
}

/// Curves of one axis. Errors are those of all states, or of the whole drift where filter and truth have different
/// states.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisOutcome {
    pub name: String,
    pub nees: NeesCurve,
    pub nees_average: NeesAverage,
    pub credibility: Option<Credibility>,
    /// One per component of the error.
    pub errors: Vec<Component>,
    /// One per measurement.
    pub innovations: Vec<Innovations>,
}

/// Mean NEES over the runs, divided by the number of components: 1 when the covariance is right.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NeesCurve {
    pub time_s: Vec<f64>,
    pub mean: Vec<f64>,
    /// What it is on average with this truth, by covariance analysis.
    pub expected: Vec<f64>,
    /// The whole curve lies in [lower, upper] unless the gate rejects: a simultaneous band at the critical p-value.
    pub lower: f64,
    pub upper: f64,
}

/// NEES averaged over runs and evenly spread times.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NeesAverage {
    pub mean: f64,
    /// What it is on average with this truth.
    pub expected: f64,
    pub lower: f64,
    pub upper: f64,
    /// Independent errors that one run is worth, from the filter's own closed-loop transitions.
    pub effective_epochs: f64,
}

/// Indices of Li and Zhao (2005), averaged over evenly spread times.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Credibility {
    /// Noncredibility index, dB: 0 for a perfect covariance; sampling alone gives a little.
    pub nci_db: f64,
    /// Inclination, dB: positive when the filter is optimistic, negative when it is pessimistic.
    pub inclination_db: f64,
    /// Of the inclination.
    pub standard_error_db: f64,
    pub meaning: String,
}

/// Errors of one component at the times of the NEES curve; SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Component {
    pub name: String,
    pub unit: String,
    /// Mean over the runs.
    pub mean: Vec<f64>,
    /// Root mean square over the runs.
    pub rms: Vec<f64>,
    /// The filter's own.
    pub predicted_sigma: Vec<f64>,
    /// Share of the runs within 1, 2, 3 predicted sigma; 0.6827, 0.9545, 0.9973 for a true filter.
    pub within_1_sigma: Vec<f64>,
    pub within_2_sigma: Vec<f64>,
    pub within_3_sigma: Vec<f64>,
}

/// Normalised innovations ν/√S of one measurement over all runs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Innovations {
    pub name: String,
    pub updates: u64,
    /// Mean square.
    pub nis: f64,
    /// What it is on average with this truth.
    pub expected_nis: f64,
    pub mean: f64,
    /// Lags 1, 2, …
    pub autocorrelation: Vec<f64>,
    /// No lag is beyond ± this unless the gate rejects.
    pub autocorrelation_bound: f64,
    pub low_frequency: Vec<LowFrequency>,
    pub cumulative_periodogram: Periodogram,
    pub nis_histogram: Histogram,
}

/// Power of innovations averaged over blocks, relative to what the filter says.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LowFrequency {
    pub averaging_s: f64,
    pub ratio: f64,
    pub lower: f64,
    pub upper: f64,
}

/// Share of the power of block means at or below each frequency.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Periodogram {
    pub frequency_hz: Vec<f64>,
    pub share: Vec<f64>,
    /// Half width of the band around the straight line; null where there are too few blocks.
    #[schemars(with = "Option<f64>")]
    pub half_width: f64,
}

/// Shares of the NIS values between edges, the last bin open to the right.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Histogram {
    pub edges: Vec<f64>,
    pub observed: Vec<f64>,
    /// χ² with one degree of freedom.
    pub expected: Vec<f64>,
}

/// How often the gate rejects a true filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FalseAlarmRate {
    /// Share of the replicates that were called inconsistent.
    pub value: f64,
    /// 95 % interval of the probability (Wilson 1927).
    pub interval: [f64; 2],
    pub replicates: u64,
    pub method: Method,
    /// Each test alone at level alpha.
    pub tests: Vec<TestRate>,
}

/// How replicates were made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The statistics are drawn from their law for a true filter.
    Law,
    /// Every replicate is a whole experiment with the design as its own truth.
    Experiments,
}

/// False alarms of one test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TestRate {
    pub axis: String,
    pub name: String,
    /// Share of the replicates in which this test alone would reject at level alpha.
    pub value: f64,
    /// Share in which its p-value was at or below the critical one.
    pub rejected: f64,
}

/// How often a wrong filter was caught.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Caught {
    pub caught: u64,
    pub of: u64,
}

/// The smallest size of one mistuning that the gate sees with 90 % probability.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Detectable {
    pub axis: String,
    /// `gauss_markov.std_dev`, `P0 of bias` (its root), `x0 of bias`.
    pub parameter: String,
    pub measure: Measure,
    /// The filter's value is this many times the true one, more than 1; absent when no factor up to 1000 is seen. Of
    /// x0: in sigmas.
    pub too_large: Option<Sighting>,
    /// The filter's value is this many times the true one, less than 1.
    pub too_small: Option<Sighting>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The filter's value over the true one.
    Factor,
    /// The filter's x0 minus the true mean, in sigmas of the claimed P0.
    Sigmas,
}

/// A size that is seen, and by which test.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Sighting {
    pub size: f64,
    pub test: String,
    /// By simulation, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirmed: Option<Caught>,
}

/// How surely the gate rejects the truth that was given.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Rejection {
    /// Predicted probability, that of the most powerful test: at least this.
    pub probability: f64,
    pub axis: String,
    pub test: String,
    /// By simulation, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirmed: Option<Caught>,
}
