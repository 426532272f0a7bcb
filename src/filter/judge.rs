//! What is compared when a filter's covariance is held against the truth.

use nalgebra::{DMatrix, DVector};

use super::gains::Epoch;
use crate::model::{LinearModel, Named};
use crate::numerics::linalg::cholesky;

/// The estimation error that is judged: e = A x_truth − B x_filter with the claimed covariance B P Bᵀ.
///
/// Every state when filter and truth have the same states; else the whole measured output H x, the one thing both
/// speak of.
#[derive(Clone, Debug, PartialEq)]
pub struct Judge {
    /// Name and unit of each component of e.
    pub components: Vec<Named>,
    /// A.
    pub of_truth: DMatrix<f64>,
    /// B.
    pub of_estimate: DMatrix<f64>,
}

impl Judge {
    /// All states, unless the models differ in their states or the filter knows some state exactly at one of
    /// `epochs` (no NEES of all states exists then).
    pub fn new(filter: &LinearModel, truth: &LinearModel, epochs: &[Epoch]) -> Judge {
        let same = filter.states == truth.states && filter.h == truth.h;
        if same && epochs.iter().all(|epoch| cholesky(&epoch.covariance).is_ok()) {
            let identity = DMatrix::identity(filter.states.len(), filter.states.len());
            return Judge { components: filter.states.clone(), of_truth: identity.clone(), of_estimate: identity };
        }
        let output = |i: usize, measured: &Named| {
            let name = if filter.measurements.len() == 1 { "drift".into() } else { format!("output {}", i + 1) };
            Named { name, unit: measured.unit.clone() }
        };
        Judge {
            components: filter.measurements.iter().enumerate().map(|(i, m)| output(i, m)).collect(),
            of_truth: truth.h.clone(),
            of_estimate: filter.h.clone(),
        }
    }

    /// Number of components of e.
    pub fn size(&self) -> usize {
        self.components.len()
    }

    /// B P Bᵀ.
    pub fn claimed(&self, p: &DMatrix<f64>) -> DMatrix<f64> {
        &self.of_estimate * p * self.of_estimate.transpose()
    }

    /// A x_truth − B x_filter.
    pub fn error(&self, truth: &[f64], estimate: &[f64]) -> DVector<f64> {
        &self.of_truth * DVector::from_column_slice(truth) - &self.of_estimate * DVector::from_column_slice(estimate)
    }

    /// L⁻¹ of the claimed covariance L Lᵀ: turns the error of a true filter into independent N(0, 1). `None` where
    /// some component is known exactly.
    pub fn whitening(&self, p: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let l = cholesky(&self.claimed(p)).ok()?;
        l.solve_lower_triangular(&DMatrix::identity(l.nrows(), l.nrows()))
    }
}
