//! One running filter in any of its forms.

use nalgebra::DVector;

use super::constant_gain::ConstantGain;
use super::design::AxisDesign;
use super::kalman::{Kalman, Update};
use super::square_root::SquareRoot;
use crate::numerics::linalg::LinalgError;

/// How the covariance is carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// P by the form of Bucy and Joseph.
    #[default]
    Joseph,
    /// A triangular factor of P.
    SquareRoot,
    /// Not at all: the gains of the steady state.
    ConstantGain,
}

/// A filter in progress.
#[derive(Clone, Debug)]
pub enum Running {
    Joseph(Box<Kalman>),
    /// With a filter that bridges long gaps.
    SquareRoot(Box<(SquareRoot, Kalman)>),
    ConstantGain(Box<ConstantGain>),
}

impl Running {
    /// Starts at x0, P0. Errors: P0 or Q not positive semidefinite (square root).
    pub fn new(form: Form, design: &AxisDesign) -> Result<Running, LinalgError> {
        let model = &design.model;
        Ok(match form {
            Form::Joseph => Running::Joseph(Box::new(Kalman::new(model))),
            Form::SquareRoot => Running::SquareRoot(Box::new((SquareRoot::new(model)?, Kalman::new(model)))),
            Form::ConstantGain => Running::ConstantGain(Box::new(ConstantGain::new(model, &design.steady_state))),
        })
    }

    pub fn x(&self) -> &DVector<f64> {
        match self {
            Running::Joseph(kalman) => &kalman.x,
            Running::SquareRoot(root) => &root.0.x,
            Running::ConstantGain(constant) => constant.x(),
        }
    }

    /// √P_ii.
    pub fn sigma(&self, i: usize) -> f64 {
        match self {
            Running::Joseph(kalman) => kalman.p[(i, i)].max(0.0).sqrt(),
            Running::SquareRoot(root) => root.0.factor().row(i).norm(),
            Running::ConstantGain(constant) => constant.p()[(i, i)].max(0.0).sqrt(),
        }
    }

    /// d x and √(d P dᵀ).
    pub fn of_row(&self, row: &[f64]) -> (f64, f64) {
        let mean = row.iter().zip(self.x()).map(|(d, x)| d * x).sum();
        let p = match self {
            Running::Joseph(kalman) => &kalman.p,
            Running::ConstantGain(constant) => constant.p(),
            Running::SquareRoot(root) => {
                let factor = root.0.factor();
                let along = |column: usize| row.iter().enumerate().map(|(i, d)| d * factor[(i, column)]).sum::<f64>();
                let sigma = (0..row.len()).map(|column| along(column).powi(2)).sum::<f64>().sqrt();
                return (mean, sigma);
            }
        };
        let mut variance = 0.0;
        for (i, di) in row.iter().enumerate() {
            for (j, dj) in row.iter().enumerate() {
                variance += di * dj * p[(i, j)];
            }
        }
        (mean, variance.max(0.0).sqrt())
    }

    /// As [`Kalman::advance`].
    pub fn advance(&mut self, steps: u64, inputs: Option<&[f64]>) {
        match self {
            Running::Joseph(kalman) => kalman.advance(steps, inputs),
            Running::SquareRoot(both) => {
                let (root, bridge) = &mut **both;
                root.advance(steps, inputs, bridge);
            }
            Running::ConstantGain(constant) => constant.advance(steps, inputs),
        }
    }

    /// As [`Kalman::update`].
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        match self {
            Running::Joseph(kalman) => kalman.update(index, z, gate),
            Running::SquareRoot(root) => root.0.update(index, z, gate),
            Running::ConstantGain(constant) => constant.update(index, z, gate),
        }
    }

    /// As [`Kalman::nudge`].
    pub fn nudge(&mut self, index: usize, innovation: f64) {
        match self {
            Running::Joseph(kalman) => kalman.nudge(index, innovation),
            Running::SquareRoot(root) => root.0.nudge(index, innovation),
            Running::ConstantGain(constant) => constant.nudge(index, innovation),
        }
    }
}
