//! Plants, augmentation with noise states, discretisation, observability (floor 2).

pub mod augment;
pub mod discretize;
pub mod observability;
pub mod plant;

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};

use crate::noise::{Kind, TooFast};
use crate::numerics::linalg::{cholesky, cholesky_semidefinite, relative_to_diagonal};

pub use augment::{Attached, Augmented, InitialBias, Port, aid_errors, augment, sensor_errors};
pub use plant::Plant;

/// Largest asymmetry of a covariance, relative to √(P_ii P_jj), that counts as rounding of a printed number.
const SYMMETRY_TOLERANCE: f64 = 1e-9;

/// A state, input or measurement with its SI unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    pub name: String,
    pub unit: String,
}

/// A named combination of states, SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    pub name: String,
    pub unit: String,
    /// One number per state.
    pub row: Vec<f64>,
}

/// Name of the output that is the drift of the sensor.
pub const DRIFT: &str = "drift";

/// A named discrete-time linear model x_{k+1} = F x_k + G u_k + v, z_k = H x_k + w, v ~ N(0,Q), w ~ N(0,R), x_0 ~
/// N(x0, P0). SI.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearModel {
    pub dt: f64,
    pub states: Vec<Named>,
    pub inputs: Vec<Named>,
    pub measurements: Vec<Named>,
    /// Measurement taken every n-th sample, per measurement.
    pub every: Vec<usize>,
    /// What the filter is for: the plant's states and the sensor's drift. Empty for a sensor at rest: its drift alone.
    pub outputs: Vec<Output>,
    pub f: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub h: DMatrix<f64>,
    pub q: DMatrix<f64>,
    pub r: DMatrix<f64>,
    pub x0: DVector<f64>,
    pub p0: DMatrix<f64>,
}

/// Why a model cannot be built or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// `part` is the matrix letter or list of the model: `F`, `states[1].name`.
    #[error("{part}: {message}")]
    Part { part: String, message: String },
    #[error("there is no white noise: a filter needs a measurement noise density greater than zero")]
    NoMeasurementNoise,
    #[error(transparent)]
    TooFast(#[from] TooFast),
    #[error("{name} is {value}; expected a number greater than zero")]
    NotPositive { name: &'static str, value: f64 },
}

impl ModelError {
    fn part(part: impl Into<String>, message: impl Into<String>) -> Self {
        ModelError::Part { part: part.into(), message: message.into() }
    }
}

impl LinearModel {
    /// Times x it is the whole drift of the sensor, which is subtracted from what it measures: the output "drift";
    /// where there is none, the first row of H without quantisation, moving averages, band limits and oscillations,
    /// which are noise although they need states.
    pub fn drift_row(&self) -> DMatrix<f64> {
        if let Some(output) = self.outputs.iter().find(|output| output.name == DRIFT) {
            return DMatrix::from_row_slice(1, output.row.len(), &output.row);
        }
        let noise = |j: usize| Kind::of_state(&self.states[j].name).is_some_and(|kind| !kind.is_drift());
        DMatrix::from_fn(1, self.states.len(), |_, j| if noise(j) { 0.0 } else { self.h[(0, j)] })
    }

    /// The states `kept` alone, without outputs.
    pub fn part(&self, kept: &[usize]) -> LinearModel {
        let block = |a: &DMatrix<f64>| a.select_rows(kept).select_columns(kept);
        LinearModel {
            states: kept.iter().map(|&i| self.states[i].clone()).collect(),
            outputs: Vec::new(),
            f: block(&self.f),
            g: self.g.select_rows(kept),
            h: self.h.select_columns(kept),
            q: block(&self.q),
            x0: self.x0.select_rows(kept),
            p0: block(&self.p0),
            ..self.clone()
        }
    }

    /// Checks that names are unique, shapes fit, numbers are finite, Q and P0 are symmetric positive semidefinite and
    /// R is diagonal and positive (measurements are taken one at a time).
    ///
    /// Errors: the first fault, with the part it is in, what was found and what was expected.
    pub fn check(&self) -> Result<(), ModelError> {
        if !(self.dt > 0.0 && self.dt.is_finite()) {
            return Err(ModelError::NotPositive { name: "dt", value: self.dt });
        }
        for (list, names) in [("states", &self.states), ("inputs", &self.inputs), ("measurements", &self.measurements)]
        {
            check_names(list, names)?;
        }
        let (n, m) = (self.states.len(), self.measurements.len());
        for (list, count) in [("states", n), ("measurements", m)] {
            if count == 0 {
                return Err(ModelError::part(list, "there is none; at least one is needed"));
            }
        }
        if self.every.len() != m {
            return Err(ModelError::part("every", format!("{} entries for {m} measurements", self.every.len())));
        }
        if let Some(i) = self.every.iter().position(|&every| every == 0) {
            return Err(ModelError::part(
                format!("measurements[{i}].every"),
                "found 0; expected a whole number from 1 (every sample)",
            ));
        }
        let states = count(n, "state");
        let measured = count(m, "measurement");
        let given = count(self.inputs.len(), "input");
        check_matrix("F", &self.f, n, n, &states, &states)?;
        check_matrix("G", &self.g, n, self.inputs.len(), &states, &given)?;
        check_matrix("H", &self.h, m, n, &measured, &states)?;
        check_matrix("Q", &self.q, n, n, &states, &states)?;
        check_matrix("R", &self.r, m, m, &measured, &measured)?;
        check_matrix("P0", &self.p0, n, n, &states, &states)?;
        if self.x0.len() != n {
            return Err(ModelError::part(
                "x0",
                format!("found {} numbers; expected {n}, one per state", self.x0.len()),
            ));
        }
        if let Some(i) = self.x0.iter().position(|v| !v.is_finite()) {
            return Err(ModelError::part(format!("x0[{i}]"), format!("{} is not a finite number", self.x0[i])));
        }
        for (i, output) in self.outputs.iter().enumerate() {
            if output.row.len() != n || output.row.iter().any(|v| !v.is_finite()) {
                let message = format!("found {} numbers; expected {n} finite ones, one per state", output.row.len());
                return Err(ModelError::part(format!("outputs[{i}].row"), message));
            }
        }
        for (letter, matrix) in [("Q", &self.q), ("R", &self.r), ("P0", &self.p0)] {
            check_covariance(letter, matrix)?;
        }
        check_measurement_noise(&self.r)
    }
}

fn check_names(list: &str, names: &[Named]) -> Result<(), ModelError> {
    let mut seen = BTreeSet::new();
    for (i, named) in names.iter().enumerate() {
        if named.name.trim().is_empty() {
            return Err(ModelError::part(format!("{list}[{i}].name"), "is empty"));
        }
        if !seen.insert(named.name.as_str()) {
            return Err(ModelError::part(
                format!("{list}[{i}].name"),
                format!("'{}' appears twice; names must be unique", named.name),
            ));
        }
    }
    Ok(())
}

fn count(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

fn check_matrix(
    letter: &str,
    a: &DMatrix<f64>,
    rows: usize,
    columns: usize,
    per_row: &str,
    per_column: &str,
) -> Result<(), ModelError> {
    if a.shape() != (rows, columns) {
        return Err(ModelError::part(
            letter,
            format!("found {} x {}; expected {rows} x {columns} ({per_row} by {per_column})", a.nrows(), a.ncols()),
        ));
    }
    for i in 0..rows {
        for j in 0..columns {
            if !a[(i, j)].is_finite() {
                return Err(ModelError::part(
                    format!("{letter}[{i}][{j}]"),
                    format!("{} is not a finite number", a[(i, j)]),
                ));
            }
        }
    }
    Ok(())
}

fn check_covariance(letter: &str, a: &DMatrix<f64>) -> Result<(), ModelError> {
    for i in 0..a.nrows() {
        if a[(i, i)] < 0.0 {
            return Err(ModelError::part(
                format!("{letter}[{i}][{i}]"),
                format!("found {:e}; a variance cannot be negative", a[(i, i)]),
            ));
        }
    }
    let scale: Vec<f64> = a.diagonal().iter().copied().collect();
    for i in 0..a.nrows() {
        for j in 0..i {
            let difference = (a[(i, j)] - a[(j, i)]).abs();
            if difference > SYMMETRY_TOLERANCE * (scale[i] * scale[j]).sqrt() {
                return Err(ModelError::part(
                    letter,
                    format!("is not symmetric: [{i}][{j}] is {:e} but [{j}][{i}] is {:e}", a[(i, j)], a[(j, i)]),
                ));
            }
        }
    }
    if cholesky_semidefinite(a).is_err() {
        return Err(ModelError::part(
            letter,
            "is not positive semidefinite: some combination of states would have a negative variance",
        ));
    }
    Ok(())
}

fn check_measurement_noise(r: &DMatrix<f64>) -> Result<(), ModelError> {
    if cholesky(r).is_err() {
        return Err(ModelError::part("R", "is not positive definite; every measurement needs noise"));
    }
    let off_diagonal = r - DMatrix::from_diagonal(&r.diagonal());
    if relative_to_diagonal(&off_diagonal, r.diagonal().as_slice()) > 0.0 {
        return Err(ModelError::part("R", "is not diagonal; measurements are processed one at a time"));
    }
    Ok(())
}
