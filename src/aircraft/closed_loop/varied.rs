//! Records of what was varied.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::flown::Paired;

/// What a sweep found.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// lowpass, noise, airspeed, gust, gain, delay.
    pub variable: &'static str,
    pub unit: &'static str,
    pub meaning: &'static str,
    pub points: Vec<Point>,
    /// Where the best feed changes, in words.
    pub changes: Vec<String>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SweepPoint")]
pub struct Point {
    pub value: f64,
    /// Why there is no loop here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub none: Option<String>,
    pub feeds: Vec<FeedPoint>,
    /// Of those that keep every criterion, the one with the least surface rate; null: none keeps them.
    pub best: Option<String>,
}

/// A feed at one value.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeedPoint {
    pub name: String,
    pub stable: bool,
    /// By surface.
    pub disk: BTreeMap<&'static str, f64>,
    /// Least of pitch, and of roll and yaw; 1 without an oscillation.
    pub damping: BTreeMap<&'static str, f64>,
    /// By surface, deg/s.
    pub surface_rate: BTreeMap<String, f64>,
    /// θ and φ, deg.
    pub angle: BTreeMap<String, f64>,
    /// Root of the sum of squares of the surface rates, deg/s.
    pub activity: Option<f64>,
    /// Every criterion is kept.
    pub passes: bool,
}

/// What `spread` found: gains and filters stay, the airplane and its gyros are drawn.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    pub cases: u64,
    pub seed: u64,
    /// Drawn airplanes that do not fly steadily there; no loop was judged of them.
    pub without_trim: u64,
    /// Numbers that were drawn.
    pub drawn: Vec<String>,
    /// One per feed and criterion, and one per feed that all are kept.
    pub kept: Vec<Kept>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    pub feed: String,
    /// Of the criterion with its limit; "stable"; "all criteria".
    pub criterion: String,
    /// Of the cases.
    pub share: f64,
    /// 95 % interval of the share (Wilson 1927).
    pub lower: f64,
    pub upper: f64,
}

/// Before and after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moved {
    pub from: f64,
    pub to: f64,
}

/// What `optimize` found.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Optimized {
    /// What was made least, in words.
    pub cost: String,
    /// What was kept.
    pub kept: String,
    pub feeds: Vec<OptimizedFeed>,
    /// Of those that keep every limit, the one with the least cost.
    pub best: Option<String>,
    /// Gains of the best, as in `autopilot.gains`.
    pub gains: Option<serde_json::Value>,
    /// Nonlinear flights of these designs: differences of the rms of one flight to the raw gyro with the gains as they
    /// were, deg and deg/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flights: Vec<Paired>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OptimizedFeed {
    pub feed: String,
    /// Of its low-pass, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corner: Option<Moved>,
    /// By name, SI.
    pub gains: BTreeMap<&'static str, Moved>,
    pub cost: Moved,
    /// Root of the sum of squares of the rms rates of the surfaces, deg/s.
    pub surface_rate: Moved,
    /// Root of the sum of squares of the rms of pitch and bank, deg.
    pub attitude: Moved,
    /// Least disk margin.
    pub disk: Moved,
    /// Least damping.
    pub damping: Moved,
    /// Every criterion, and the margins of the raw loop but for the share that may be lost.
    pub passes: bool,
    /// The same design in another wind, which the search has not seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    /// kt.
    pub wind_at_20ft: f64,
    pub cost: Moved,
    pub passes: bool,
}
