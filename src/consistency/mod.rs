//! NEES, NIS, whiteness, the low-frequency innovation test, multiplicity and the verdict record (floor 3).

pub mod low_frequency;
pub mod multiplicity;
pub mod normalized;
pub mod whiteness;

use schemars::JsonSchema;
use serde::Serialize;

/// The outcome of a command that judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    Consistent,
    Inconsistent,
    Inconclusive,
}

/// One test of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Test {
    pub axis: String,
    /// "nis", "whiteness", "low_frequency", "nees", "innovation_mean" …
    pub name: String,
    pub statistic: f64,
    pub lower: f64,
    pub upper: f64,
    pub p_value: f64,
    pub adjusted_p_value: f64,
    pub pass: bool,
    /// A sentence.
    pub meaning: String,
}
