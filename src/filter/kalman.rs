//! Predict and update on a [`LinearModel`](crate::model::LinearModel), Joseph form, no allocation per step.
//!
//! Convention: x0, P0 belong to the first measurement (no prediction before it); then predict, update.

use nalgebra::{DMatrix, DVector};

use crate::model::LinearModel;

/// One scalar-measurement update's results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// ν = z − H x(k|k−1), SI.
    pub innovation: f64,
    /// S = H P Hᵀ + R.
    pub variance: f64,
    /// ν²/S.
    pub nis: f64,
    /// −½ (ln 2πS + ν²/S).
    pub log_likelihood: f64,
    /// False when it was gated out (the state was not changed).
    pub accepted: bool,
}

/// State of a running filter.
#[derive(Clone, Debug)]
pub struct Kalman {
    pub x: DVector<f64>,
    pub p: DMatrix<f64>,
}

impl Kalman {
    /// Starts at x0, P0.
    pub fn new(model: &LinearModel) -> Kalman {
        let _ = model;
        todo!()
    }
    /// x ← F x, P ← F P Fᵀ + Q.
    pub fn predict(&mut self) {
        todo!()
    }
    /// n predictions with no measurement between (a gap); cost grows with log n.
    pub fn predict_many(&mut self, n: u64) {
        let _ = n;
        todo!()
    }
    /// Update with measurement `index` (a row of H). `gate`: reject when |ν| > gate·√S.
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        let _ = (index, z, gate);
        todo!()
    }
}
