//! Noise parameters to a filter design: augmentation, steady state, predicted sigma(t), error budget (floor 4).
//!
//! `sensor` turns the parameters of an axis into a linear model (merging what no filter can tell apart), `plant`
//! joins it with the documented plant and its aids, `prediction` propagates its covariance over any time,
//! `closed_loop` splits the final variance into its causes and finds the bandwidth, `objective` chooses the physical
//! `parameters`, `insight` says what other parts would buy, `under_truth` says what the design does when the sensor
//! is another.

mod attitude;
mod closed_loop;
mod flicker;
mod insight;
pub mod objective;
mod parameters;
mod plant;
mod prediction;
mod sensor;
mod under_truth;
mod walk_price;

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use crate::filter::steady_state::{SteadyStateError, steady_state};
use crate::filter::{AxisDesign, FilterDesign};
use crate::model::{DRIFT, LinearModel, ModelError};
use crate::noise::TooFast;
use crate::numerics::linalg::LinalgError;
use crate::params::{AxisParams, Design, Params};
use crate::units::Quantity;

pub use attitude::{AtRest, TunedAttitude, tune_attitude};
pub use closed_loop::{Share, bandwidth_hz, error_budget};
pub use flicker::FlickerApproximation;
pub use insight::{FACTORS, Insight, MISTAKES, Mistake, Observed, OutputInsight, WHOLE_SENSOR, Worth, insight};
pub use plant::Joined;
pub use prediction::{Predicted, predicted_sigma};
pub use under_truth::{ErrorOverTime, Tendency, UnderTruth, under_truth};
pub use walk_price::{AidedFilter, SensorDrift, WalkPrice, WalkTrial, shared_walk};

/// Choices of [`tune`].
#[derive(Clone, Debug, PartialEq)]
pub struct TuneOptions {
    /// Instead of the design of the parameters.
    pub design: Option<Design>,
    /// Slowest time constant, s, that the approximation of flicker covers.
    pub flicker_horizon_s: f64,
}

impl Default for TuneOptions {
    fn default() -> TuneOptions {
        TuneOptions { design: None, flicker_horizon_s: 10_000.0 }
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TuneError {
    #[error(
        "axis '{axis}': no measurement noise: the parameters have no 'white' density, so the best filter would follow \
         every sample; \
         give axes[].white.density (its unit is like deg/s/sqrt(Hz))"
    )]
    NoMeasurementNoise { axis: String },
    #[error("axis '{axis}': {line}")]
    TooFast { axis: String, line: TooFast },
    #[error("axis '{axis}': {source}")]
    Model { axis: String, source: ModelError },
    #[error("axis '{axis}': {source}")]
    SteadyState { axis: String, source: SteadyStateError },
    #[error("axis '{axis}': {source}")]
    Linalg { axis: String, source: LinalgError },
    #[error("axis '{axis}': nothing measures the {output}; give an aid, for example `aid` \"2 deg @ 1 Hz\"")]
    NoAid { axis: String, output: String },
    #[error("{source}")]
    Attitude { source: ModelError },
    #[error("the truth has the axes {truth}, the design {design}; expected the same names")]
    TruthAxes { truth: String, design: String },
    #[error("the truth is in {truth}, the design in {design}")]
    TruthQuantity { truth: &'static str, design: &'static str },
}

/// What a design promises for one axis, SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisReport {
    pub name: String,
    /// What the measurements can tell, in sentences.
    pub observability: Vec<String>,
    /// Standard deviations of the estimation errors over time.
    pub predicted: Predicted,
    /// Four time constants of the slowest closed-loop pole of the driven states, s.
    pub settling_time_s: f64,
    /// Time after which the predicted sigma of the whole drift stays within 5 % of its final value; absent when
    /// there is none.
    pub drift_settling_time_s: Option<f64>,
    /// Frequency at which the estimate follows the drift with half the power it has at rest; absent when the filter
    /// follows no drift (no error budget, then), or drift at all frequencies up to half the sample rate.
    pub bandwidth_hz: Option<f64>,
    /// Causes of the final variance of the drift estimate; the shares sum to one. Empty when that variance tends to
    /// zero.
    pub error_budget: Vec<Share>,
    /// The same of every state of the plant; empty for a sensor at rest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub plant_budgets: Vec<PlantBudget>,
    /// Present when flicker is approximated.
    pub flicker: Option<FlickerApproximation>,
    /// What was decided where the parameters left a choice.
    pub warnings: Vec<String>,
}

/// Causes of the final variance of the estimate of a state of the plant.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PlantBudget {
    pub state: String,
    /// SI.
    pub unit: String,
    pub error_budget: Vec<Share>,
}

/// A design with what it promises.
#[derive(Clone, Debug)]
pub struct Tuned {
    pub design: FilterDesign,
    pub reports: Vec<AxisReport>,
}

/// The augmented Kalman filter of every axis of `params`.
///
/// States are the constant bias and those of each process, discretised exactly; R = N²/dt; P0 of the bias is the
/// turn-on bias, that of a process its stationary variance. A rate random walk has the same dynamics as the constant
/// bias and shares its state; flicker is a chain of Gauss-Markov states. Lines, moving averages and quantisation are
/// noise of the measurement: they have states, but are no part of the drift.
///
/// The plant is that of `options`, else that of the parameters, else the sensor rests. Errors: no white noise, a
/// line not below half the sample rate, a plant that does not fit, or a model without a steady state.
pub fn tune(params: &Params, options: &TuneOptions) -> Result<Tuned, TuneError> {
    let chosen = options.design.clone().or_else(|| params.design.clone()).unwrap_or_default();
    let mut axes = Vec::with_capacity(params.axes.len());
    for axis in &params.axes {
        axes.push(tune_axis(axis, params.quantity, params.sample_rate_hz, &chosen, options)?);
    }
    Ok(Tuned::new(
        params,
        chosen.plant.name(),
        Some(chosen.clone()).filter(|chosen| *chosen != Design::default()),
        axes,
    ))
}

impl Tuned {
    /// The axes as one design, with the record of how it was made. `plant` and `design`: as in [`FilterDesign`].
    pub fn new(params: &Params, plant: &str, design: Option<Design>, axes: Vec<(AxisDesign, AxisReport)>) -> Tuned {
        let (axes, reports): (Vec<AxisDesign>, Vec<AxisReport>) = axes.into_iter().unzip();
        let decisions: Vec<_> = reports.iter().map(|r| json!({ "axis": r.name, "decisions": r.warnings })).collect();
        let mut tuning = json!({
            "method": "exact discretisation of the documented noise terms; nothing is fitted",
            "objective": "nominal",
            "criterion": "least mean square error of every state",
            "axes": decisions,
        });
        record_check(params, &mut tuning);
        let (quantity, sample_rate_hz) = (params.quantity, params.sample_rate_hz);
        Tuned { design: FilterDesign { quantity, sample_rate_hz, plant: plant.into(), design, axes, tuning }, reports }
    }
}

/// Key of the record of the tuning: what check the log behind the parameters has failed.
pub const FAILED_CHECK: &str = "failed_check";
/// Key of the record of the tuning: how the log behind the parameters was read.
pub const READING: &str = "reading";

fn record_check(params: &Params, tuning: &mut serde_json::Value) {
    if let Some(reading) = params.source.as_ref().and_then(|source| source.reading.as_ref()) {
        tuning[READING] = serde_json::to_value(reading).unwrap_or_default();
    }
    if let Some(failed) = params.failed_check() {
        tuning[FAILED_CHECK] = failed.into();
    }
}

/// The linear model that [`tune`] builds a filter on, with which such a sensor in its plant can also be simulated;
/// `dt` in s. The plant is that of `options`; without one the sensor rests.
///
/// Errors: no white noise, `dt` or the flicker horizon out of range, a plant that does not fit.
pub fn sensor_model(
    axis: &AxisParams,
    quantity: Quantity,
    dt: f64,
    options: &TuneOptions,
) -> Result<LinearModel, TuneError> {
    let design = options.design.clone().unwrap_or_default();
    Ok(plant::build(axis, quantity, dt, &design, options)?.model)
}

fn tune_axis(
    axis: &AxisParams,
    quantity: Quantity,
    sample_rate_hz: f64,
    chosen: &Design,
    options: &TuneOptions,
) -> Result<(AxisDesign, AxisReport), TuneError> {
    let dt = 1.0 / sample_rate_hz;
    let mut sensor = plant::build(axis, quantity, dt, chosen, options)?;
    if !axis.noise().terms.iter().any(|term| term.kind().is_drift()) {
        sensor.warnings.push(
            "the parameters have no drift process: the filter averages for ever and its gain tends to zero; a real \
             sensor drifts"
                .into(),
        );
    }
    if chosen.plant.name() == "static" {
        sensor.warnings.extend(lost_in_double(&sensor.model, quantity));
    }
    designed(axis, sensor)
}

/// The filter of a model of the sensor `axis` in its plant, and what it promises. Errors: a model without a steady
/// state.
pub fn designed(axis: &AxisParams, sensor: Joined) -> Result<(AxisDesign, AxisReport), TuneError> {
    let steady =
        steady_state(&sensor.model).map_err(|source| TuneError::SteadyState { axis: axis.name.clone(), source })?;
    let failed = |source: LinalgError| TuneError::Linalg { axis: axis.name.clone(), source };
    let budget_of = |row: &DMatrix<f64>| error_budget(&sensor.model, &steady, row, &sensor.noise).map_err(failed);
    let drift_budget = budget_of(&sensor.model.drift_row())?;
    let mut plant_budgets = Vec::new();
    for output in sensor.model.outputs.iter().filter(|output| output.name != DRIFT) {
        plant_budgets.push(PlantBudget {
            state: output.name.clone(),
            unit: output.unit.clone(),
            error_budget: budget_of(&DMatrix::from_row_slice(1, output.row.len(), &output.row))?,
        });
    }
    let final_sigma = drift_budget.iter().map(|s| s.variance_si).sum::<f64>().sqrt();
    let predicted = predicted_sigma(&sensor.model, steady.settling_time).map_err(failed)?;
    let drift_settling_time_s =
        prediction::drift_settling_time(&sensor.model, &predicted, final_sigma).map_err(failed)?;
    let report = AxisReport {
        name: axis.name.clone(),
        observability: sensor::observability_sentences(&sensor.model).map_err(failed)?,
        predicted,
        settling_time_s: steady.settling_time,
        drift_settling_time_s,
        bandwidth_hz: bandwidth_hz(&sensor.model, &steady),
        error_budget: drift_budget,
        plant_budgets,
        flicker: sensor.flicker,
        warnings: sensor.warnings,
    };
    let design = AxisDesign {
        name: axis.name.clone(),
        model: sensor.model,
        steady_state: steady,
        noise: axis.clone(),
        about: BTreeMap::new(),
    };
    Ok((design, report))
}

/// After the first sample the covariance has entries of the size of h P0 hᵀ, whose sum along h is R, and the errors
/// of that sum are judged by its inverse. At 4·10³ ε the mean NEES of the first epoch, two states, is 57 instead of
/// 1; at 3·10⁴ ε it is 1.
const LEAST_VARIANCE_RATIO: f64 = 3e4 * f64::EPSILON;

/// What must be said where the covariance after one sample cannot be held in double precision.
fn lost_in_double(model: &LinearModel, quantity: Quantity) -> Option<String> {
    let prior = (&model.h * &model.p0 * model.h.transpose())[(0, 0)];
    let ratio = model.r[(0, 0)] / prior;
    (ratio < LEAST_VARIANCE_RATIO && prior > 0.0).then(|| {
        format!(
            "the white noise of a sample is {:.1e} of the drift and turn-on bias before it, less than the {:.1e} that \
             one covariance in \
             double precision can hold: the first epochs may look inconsistent; from a density of {:.3e} {}/sqrt(Hz) \
             on they do not (a \
             sensor that rounds has the noise of its step)",
            ratio.sqrt(),
            LEAST_VARIANCE_RATIO.sqrt(),
            (LEAST_VARIANCE_RATIO * prior * model.dt).sqrt(),
            quantity.si_unit()
        )
    })
}
