//! What filter.json holds.

use std::collections::BTreeMap;

use serde_json::Value;

use super::steady_state::SteadyState;
use crate::model::LinearModel;
use crate::params::{AxisParams, Design};
use crate::units::Quantity;

/// The plant that stands in no params.json, since it is made of a flight: every input is a command that is known, every
/// measurement after the first one of another sensor.
pub const AIRPLANE: &str = "airplane";

/// The filter of one axis with its steady state and origin.
#[derive(Clone, Debug)]
pub struct AxisDesign {
    pub name: String,
    pub model: LinearModel,
    pub steady_state: SteadyState,
    /// The terms it was built from, as documented.
    pub noise: AxisParams,
    /// What the model is linear about: values of inputs and measurements (SI) that are taken off before the filter sees
    /// them, by name; zero where there is none.
    pub about: BTreeMap<String, f64>,
}

/// A tuned filter: what `tune` writes and `replay`, `montecarlo` and `export` read.
#[derive(Clone, Debug)]
pub struct FilterDesign {
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    /// "static", "angle", "rate", "vertical", "airplane" or "custom".
    pub plant: String,
    /// The plant and its aids as documented; absent for a sensor at rest.
    pub design: Option<Design>,
    pub axes: Vec<AxisDesign>,
    /// Free-form record of the tuning: method, objective, what moved and by how much.
    pub tuning: Value,
}

#[derive(Clone, Debug, thiserror::Error)]
pub enum FilterError {
    #[error("{path}: cannot read: {reason}")]
    Read { path: String, reason: String },
    /// `key` is the path inside the document: `axes[0].P0`.
    #[error("{path}: {key}: {message}")]
    Invalid { path: String, key: String, message: String },
    #[error("{path}: line {line}, column {column}: not valid JSON: {message}")]
    Syntax { path: String, line: usize, column: usize, message: String },
}
