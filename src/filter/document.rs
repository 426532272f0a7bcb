//! The filter.json document: what a design holds, how it is written, its schema. `reading` reads and checks it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::DMatrix;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde_json::Value;

use super::design::{AxisDesign, FilterDesign, FilterError};
pub use super::steady_state::SteadyState;
use super::{reading, rows};
use crate::model::Named;
use crate::params::{AxisParams, Design, Measured, place};
use crate::units::Quantity;

impl FilterDesign {
    /// Reads filter.json and checks it; every complaint names `path` and the key.
    ///
    /// `steady_state`, `tuning`, `noise`, `inputs` and `G` may be left out (the steady state is then computed); a
    /// steady state that does not belong to the matrices is refused.
    pub fn from_json(text: &str, path: &str) -> Result<FilterDesign, FilterError> {
        let value = place::parse(text).map_err(|e| FilterError::Syntax {
            path: path.into(),
            line: e.line,
            column: e.column,
            message: e.message,
        })?;
        if value.get("format").is_some_and(|format| format == super::attitude::FORMAT) {
            let message = "this is an attitude filter, which is nonlinear: only replay takes it".into();
            return Err(FilterError::Invalid { path: path.into(), key: "format".into(), message });
        }
        reading::design(&place::Place::root(&value)).map_err(|e| FilterError::Invalid {
            path: path.into(),
            key: e.key,
            message: e.message,
        })
    }

    pub fn read(path: &Path) -> Result<FilterDesign, FilterError> {
        let shown = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => FilterDesign::from_json(&text, &shown),
            Err(e) => Err(FilterError::Read { path: shown, reason: e.to_string() }),
        }
    }

    /// JSON with one matrix row per line and a trailing newline; every number reads back as the same double.
    pub fn to_json(&self) -> String {
        rows::to_string(&FilterDocument::from(self))
    }

    /// The published JSON schema.
    pub fn schema() -> Value {
        schemars::schema_for!(FilterDocument).to_value()
    }
}

#[derive(Serialize, JsonSchema)]
enum Format {
    #[serde(rename = "kfdesign-filter/1")]
    Filter1,
}

/// A Kalman filter: x(k+1) = F x(k) + G u(k) + v, z(k) = H x(k) + w, v ~ N(0, Q), w ~ N(0, R), x(0) ~ N(x0, P0).
/// Every number is SI. x0 and P0 belong to the first measurement (no prediction before it); then predict, update.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Filter")]
struct FilterDocument {
    format: Format,
    quantity: Quantity,
    /// Frequency, for example "100 Hz".
    #[schemars(with = "Measured")]
    sample_rate: InUnit,
    /// What is measured beside the sensor's own errors: "static", "angle", "rate", "vertical", "airplane" or "custom".
    plant: String,
    /// The plant and its aids, as in params.json.
    #[serde(skip_serializing_if = "Option::is_none")]
    design: Option<Design>,
    #[schemars(length(min = 1))]
    axes: Vec<AxisDocument>,
    /// Method, objective, what moved and by how much.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    tuning: Value,
}

/// As a [`Measured`] is written.
#[derive(Serialize)]
struct InUnit {
    value: f64,
    unit: &'static str,
}

/// A matrix, row by row.
type Matrix = Vec<Vec<f64>>;

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AxisFilter")]
struct AxisDocument {
    name: String,
    /// In the order of x.
    states: Vec<NamedDocument>,
    /// In the order of u.
    #[serde(default)]
    inputs: Vec<NamedDocument>,
    /// In the order of z.
    measurements: Vec<MeasurementDocument>,
    /// What the filter is for: the states of the plant and the sensor's drift, as combinations of states.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    outputs: Vec<OutputDocument>,
    /// Transition, states by states.
    #[serde(rename = "F")]
    f: Matrix,
    /// Input, states by inputs.
    #[serde(rename = "G", default)]
    g: Matrix,
    /// Measurement, measurements by states.
    #[serde(rename = "H")]
    h: Matrix,
    /// Process noise covariance per sample, symmetric positive semidefinite.
    #[serde(rename = "Q")]
    q: Matrix,
    /// Measurement noise covariance, diagonal, positive.
    #[serde(rename = "R")]
    r: Matrix,
    /// Estimate before the first measurement.
    x0: Vec<f64>,
    /// Its covariance, symmetric positive semidefinite.
    #[serde(rename = "P0")]
    p0: Matrix,
    #[schemars(with = "Option<SteadyStateDocument>")]
    steady_state: SteadyStateDocument,
    /// The terms it was built from, as in params.json.
    #[schemars(with = "Option<AxisParams>")]
    noise: AxisParams,
    /// What the model is linear about: values of inputs and measurements that are taken off before the filter sees
    /// them, by name; zero where there is none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    about: BTreeMap<String, f64>,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Named")]
struct NamedDocument {
    name: String,
    /// SI unit.
    unit: String,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Measurement")]
struct MeasurementDocument {
    name: String,
    /// SI unit.
    unit: String,
    /// Taken every n-th sample.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    every: usize,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Output")]
struct OutputDocument {
    name: String,
    /// SI unit.
    unit: String,
    /// One number per state.
    row: Vec<f64>,
}

fn one() -> usize {
    1
}

fn first(period: &u64) -> bool {
    *period == 1
}

fn every_sample() -> u64 {
    1
}

/// The filter after a long time, at a sample at which every measurement is taken.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SteadyState")]
struct SteadyStateDocument {
    /// Samples after which the pattern of measurements repeats.
    #[serde(default = "every_sample", skip_serializing_if = "first")]
    #[schemars(range(min = 1))]
    period: u64,
    /// K, states by measurements.
    gain: Matrix,
    /// P(k|k-1).
    predicted_covariance: Matrix,
    /// S.
    innovation_covariance: Matrix,
    /// Eigenvalues of (I - K H) F as [re, im]; with a longer period the principal roots, per sample, of those of a
    /// whole period.
    poles: Vec<[f64; 2]>,
    /// Four time constants of the slowest closed-loop pole of the driven states.
    #[schemars(with = "Measured")]
    settling_time: InUnit,
    /// Largest relative residual of the Riccati equation.
    residual: f64,
    /// Largest relative difference to the eigenvector solution; null when that one does not exist.
    eigenvector_difference: Option<f64>,
}

fn rows_of(a: &DMatrix<f64>) -> Matrix {
    a.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn named(named: &Named) -> NamedDocument {
    NamedDocument { name: named.name.clone(), unit: named.unit.clone() }
}

impl JsonSchema for FilterDesign {
    fn schema_name() -> Cow<'static, str> {
        "FilterDesign".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        FilterDocument::json_schema(generator)
    }
}

impl From<&FilterDesign> for FilterDocument {
    fn from(design: &FilterDesign) -> Self {
        FilterDocument {
            format: Format::Filter1,
            quantity: design.quantity,
            sample_rate: InUnit { value: design.sample_rate_hz, unit: "Hz" },
            plant: design.plant.clone(),
            design: design.design.clone(),
            axes: design.axes.iter().map(AxisDocument::from).collect(),
            tuning: design.tuning.clone(),
        }
    }
}

impl From<&AxisDesign> for AxisDocument {
    fn from(axis: &AxisDesign) -> Self {
        let model = &axis.model;
        let measurements = model.measurements.iter().zip(&model.every);
        AxisDocument {
            name: axis.name.clone(),
            states: model.states.iter().map(named).collect(),
            inputs: model.inputs.iter().map(named).collect(),
            measurements: measurements
                .map(|(m, &every)| MeasurementDocument { name: m.name.clone(), unit: m.unit.clone(), every })
                .collect(),
            outputs: model
                .outputs
                .iter()
                .map(|o| OutputDocument { name: o.name.clone(), unit: o.unit.clone(), row: o.row.clone() })
                .collect(),
            f: rows_of(&model.f),
            g: rows_of(&model.g),
            h: rows_of(&model.h),
            q: rows_of(&model.q),
            r: rows_of(&model.r),
            x0: model.x0.iter().copied().collect(),
            p0: rows_of(&model.p0),
            steady_state: SteadyStateDocument::from(&axis.steady_state),
            noise: axis.noise.clone(),
            about: axis.about.clone(),
        }
    }
}

impl From<&SteadyState> for SteadyStateDocument {
    fn from(steady: &SteadyState) -> Self {
        SteadyStateDocument {
            period: steady.period,
            gain: rows_of(&steady.gain),
            predicted_covariance: rows_of(&steady.predicted_covariance),
            innovation_covariance: rows_of(&steady.innovation_covariance),
            poles: steady.poles.iter().map(|&(re, im)| [re, im]).collect(),
            settling_time: InUnit { value: steady.settling_time, unit: "s" },
            residual: steady.residual,
            eigenvector_difference: Some(steady.eigenvector_difference).filter(|d| d.is_finite()),
        }
    }
}
