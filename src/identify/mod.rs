//! Logs to noise parameters (floor 4): the paper's graphical recipe, the weighted Allan fit; likelihood methods have their place here.

pub mod allan_fit;
pub mod graphical;

use schemars::JsonSchema;
use serde::Serialize;

use crate::allan::AllanCurve;
use crate::noise::{Kind, NoiseModel};
use crate::params::{AxisParams, NotIdentified};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    Graphical,
    Allan,
}

/// Which terms may be in the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    Auto,
    /// `white+gm+gm+rrw+flicker+quantization+ramp`
    Terms(Vec<Kind>),
}

/// One candidate of the model choice, for the table that is shown.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Candidate {
    pub model: String,
    pub parameters: usize,
    /// Weighted sum of squares of the fit.
    pub chi_square: f64,
    pub dof: f64,
    pub score: f64,
    pub chosen: bool,
}

/// What one axis gave.
#[derive(Clone, Debug)]
pub struct Identified {
    pub params: AxisParams,
    /// SI.
    pub model: NoiseModel,
    /// The measured overlapping Allan curve with exact intervals for the model.
    pub curve: AllanCurve,
    pub candidates: Vec<Candidate>,
    pub not_identified: Vec<NotIdentified>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
    /// Graphical recipe: its steps with numbers and what each costs.
    pub steps: Vec<graphical::Step>,
    /// p-value of the chosen model's fit (NaN for graphical).
    pub fit_p_value: f64,
}

#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct IdentifyError {
    pub message: String,
}

/// Identify one axis. `rate` SI, contiguous, finite; `display` the unit results are written in.
pub fn identify_axis(
    name: &str,
    rate: &[f64],
    dt: f64,
    display: &crate::units::Unit,
    method: Method,
    choice: &ModelChoice,
) -> Result<Identified, IdentifyError> {
    let _ = (name, rate, dt, display, method, choice);
    todo!()
}

/// Parses `auto` or `white+gm+…`.
pub fn parse_model(text: &str) -> Result<ModelChoice, IdentifyError> {
    let _ = text;
    todo!()
}
