//! The filter that never computes a covariance: the gains of the steady state from the first measurement on.

use nalgebra::{DMatrix, DVector};

use super::kalman::{Kalman, Update};
use super::steady_state::SteadyState;
use crate::model::LinearModel;

/// x ← F x + G u, x ← x + K_i ν: a gain per measurement, that of a sample at which all are taken, one after the other.
///
/// Where measurements have several rates the true gains differ a little from sample to sample. A state that nothing
/// drives (a constant bias) has gain zero and keeps its x0; until the filter has settled its error is larger than
/// the sigma it claims, that of the steady state.
#[derive(Clone, Debug)]
pub struct ConstantGain {
    /// Holds x, and the claimed P.
    kalman: Kalman,
    f: DMatrix<f64>,
    h: DMatrix<f64>,
    /// x of the sample before.
    before: DVector<f64>,
    /// Gain and S of every measurement.
    gains: Vec<(DVector<f64>, f64)>,
}

impl ConstantGain {
    /// Starts at x0.
    pub fn new(model: &LinearModel, steady: &SteadyState) -> ConstantGain {
        let mut kalman = Kalman::new(model);
        kalman.p.copy_from(&steady.predicted_covariance);
        let mut gains = Vec::with_capacity(model.measurements.len());
        for (i, h) in model.h.row_iter().enumerate() {
            let variance = (h * &kalman.p * h.transpose())[(0, 0)] + model.r[(i, i)];
            gains.push((&kalman.p * h.transpose() / variance, variance));
            kalman.update(i, 0.0, None);
        }
        // what nothing drives stays as uncertain as it was
        for i in (0..model.x0.len()).filter(|&i| steady.predicted_covariance[(i, i)] == 0.0) {
            kalman.p[(i, i)] = model.p0[(i, i)];
        }
        kalman.x.copy_from(&model.x0);
        ConstantGain { kalman, f: model.f.clone(), h: model.h.clone(), before: model.x0.clone(), gains }
    }

    pub fn x(&self) -> &DVector<f64> {
        &self.kalman.x
    }

    /// The claimed covariance: P(k|k) of the steady state, P0 of what nothing drives.
    pub fn p(&self) -> &DMatrix<f64> {
        &self.kalman.p
    }

    /// K and S of a measurement.
    pub fn gain(&self, index: usize) -> (&DVector<f64>, f64) {
        let (gain, variance) = &self.gains[index];
        (gain, *variance)
    }

    /// As [`Kalman::drive`].
    pub fn drive(&mut self, u: &[f64]) {
        self.kalman.drive(u);
    }

    /// As [`Kalman::advance`], x alone.
    pub fn advance(&mut self, steps: u64, inputs: Option<&[f64]>) {
        if steps == 1 {
            self.before.copy_from(&self.kalman.x);
            self.kalman.x.gemv(1.0, &self.f, &self.before, 0.0);
            if let Some(u) = inputs {
                self.kalman.drive(u);
            }
            return;
        }
        // over a gap, with the powers of F that the filter has
        let claimed = self.kalman.p.clone();
        self.kalman.advance(steps, inputs);
        self.kalman.p = claimed;
    }

    /// As [`Kalman::update`] with the constant gain and S.
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        let (gain, variance) = &self.gains[index];
        let innovation = z - self.h.row(index).transpose().dot(&self.kalman.x);
        let update = Update::new(innovation, *variance, gate.unwrap_or(f64::INFINITY));
        if update.accepted {
            self.kalman.x.axpy(innovation, gain, 1.0);
        }
        update
    }

    /// As [`Kalman::nudge`].
    pub fn nudge(&mut self, index: usize, innovation: f64) {
        self.kalman.x.axpy(innovation, &self.gains[index].0, 1.0);
    }
}
