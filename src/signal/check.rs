//! The log check: rate and jitter, gaps, repeated or backward stamps, NaN, stuck and saturated values, quantisation step,
//! motion, outliers; each with count and place. Works in one streaming pass with bounded memory.

use schemars::JsonSchema;
use serde::Serialize;

/// How time was established.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TimeBase {
    /// No time column: the rate was given.
    Given,
    /// Time column with usable stamps; gaps are found from it.
    Stamps,
    /// Stamps are bursty (host arrival times): only their mean rate is used and gaps inside bursts cannot be seen.
    MeanRate,
}

/// One thing found, with how often and where it is first seen (sample index, 0-based; and seconds from the start).
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Finding {
    /// Short code: "gap", "repeated-stamp", "backward-stamp", "nan", "stuck", "saturated", "quantised", "motion", "outlier", "jitter", "zero-row" …
    pub kind: String,
    pub axis: Option<String>,
    pub count: u64,
    pub first_index: u64,
    pub first_s: f64,
    /// One sentence for a person, with numbers and units, and what was done about it.
    pub message: String,
    /// True when results cannot be trusted without acting on it.
    pub serious: bool,
}

/// What the check of a whole log says.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LogCheck {
    pub samples: u64,
    pub sample_rate_hz: f64,
    pub span_s: f64,
    pub time_base: TimeBase,
    /// Robust spread of the time steps, s (0 without stamps).
    pub jitter_s: f64,
    /// Total number of samples missing in gaps.
    pub missing: u64,
    pub findings: Vec<Finding>,
}
