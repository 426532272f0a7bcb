//! Records of flights of all feeds.

use schemars::JsonSchema;
use serde::Serialize;

/// Nonlinear flights with common random numbers.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flown {
    pub runs: u64,
    pub duration_s: f64,
    pub seed: u64,
    /// Of every interval.
    pub level: f64,
    /// By which part a rms may grow and still be called not worse.
    pub margin: f64,
    /// Flights of this length after which every rms of the raw loop is known to 1 % (95 %), by the exact covariances.
    pub needed_for_one_percent: u64,
    /// Root mean squares, exact and flown, deg and deg/s.
    pub linear: Vec<Linear>,
    /// Of the Kalman filters in the loop.
    pub consistency: Vec<Consistency>,
    /// Differences of the rms of one flight, deg and deg/s.
    #[serde(skip)]
    pub paired: Vec<Paired>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    pub feed: String,
    pub quantity: String,
    pub linear: f64,
    pub simulated: f64,
    pub lower: f64,
    pub upper: f64,
    /// The exact value lies in the interval of the flown one.
    pub inside: bool,
}

/// Mean over time and flights over its expectation, with its interval; 1 for a true filter.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Consistency {
    pub feed: String,
    /// pitch or roll_yaw.
    pub half: &'static str,
    /// [mean, lower, upper] of NIS per measurement.
    pub nis: Option<[f64; 3]>,
    /// The same of NEES per state of the airframe.
    pub nees: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Paired {
    pub feed: String,
    pub against: String,
    pub quantity: String,
    /// Of the rms, this feed less the other, in the same gusts and noise.
    pub difference: f64,
    pub lower: f64,
    pub upper: f64,
    /// Non-inferiority: the whole interval is below `margin` of the other's rms.
    pub not_worse: bool,
    /// The whole interval is below zero: a test of its own.
    pub better: bool,
}
