//! The filter.json document.

use std::path::Path;

pub use super::steady_state::SteadyState;
use crate::model::LinearModel;
use crate::params::AxisParams;
use crate::units::Quantity;

#[derive(Clone, Debug)]
pub struct AxisDesign {
    pub name: String,
    pub model: LinearModel,
    pub steady_state: SteadyState,
    /// The terms it was built from, as documented.
    pub noise: AxisParams,
}

#[derive(Clone, Debug)]
pub struct FilterDesign {
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    /// "static".
    pub plant: String,
    pub axes: Vec<AxisDesign>,
    /// Free-form record of the tuning: method, objective, what moved and by how much.
    pub tuning: serde_json::Value,
}

#[derive(Clone, Debug, thiserror::Error)]
pub enum FilterError {
    #[error("{path}: cannot read: {reason}")]
    Read { path: String, reason: String },
    #[error("{path}: {key}: {message}")]
    Invalid { path: String, key: String, message: String },
    #[error("{path}: line {line}, column {column}: not valid JSON: {message}")]
    Syntax { path: String, line: usize, column: usize, message: String },
}

impl FilterDesign {
    pub fn from_json(text: &str, path: &str) -> Result<FilterDesign, FilterError> {
        let _ = (text, path);
        todo!()
    }
    pub fn read(path: &Path) -> Result<FilterDesign, FilterError> {
        let _ = path;
        todo!()
    }
    pub fn to_json(&self) -> String {
        todo!()
    }
    pub fn schema() -> serde_json::Value {
        todo!()
    }
}
