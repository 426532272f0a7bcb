//! Kalman filter on a triangular factor of the covariance, P = S Sᵀ: no difference of large numbers is ever formed, and the digits of P are those of S
//! twice over. Same convention, same results as [`Kalman`](super::Kalman); it goes on where P in double precision has lost its definiteness.
//!
//! Both steps are one orthogonal triangularisation (Householder) of an array whose Gram matrix is the covariance wanted:
//! prediction [F S, Q^½]ᵀ → S⁺ᵀ, and for a scalar measurement [[√r, 0], [Sᵀhᵀ, Sᵀ]] → [[√s, k̄ᵀ], [0, S⁺ᵀ]] with K = k̄/√s.
//! Source: Kailath, Sayed & Hassibi 2000, Linear Estimation, section 12.3.

use nalgebra::{DMatrix, DVector};

use super::kalman::Update;
use crate::model::LinearModel;
use crate::numerics::linalg::{LinalgError, cholesky_semidefinite};

/// State of a running square-root filter.
#[derive(Clone, Debug)]
pub struct SquareRoot {
    pub x: DVector<f64>,
    /// S, lower triangular, P = S Sᵀ.
    factor: DMatrix<f64>,
    f: DMatrix<f64>,
    g: DMatrix<f64>,
    h: DMatrix<f64>,
    r: Vec<f64>,
    /// Root of Q: Q = W Wᵀ.
    noise: DMatrix<f64>,
    /// [F S, W]ᵀ.
    wide: DMatrix<f64>,
    /// [[√r, 0], [Sᵀhᵀ, Sᵀ]].
    square: DMatrix<f64>,
    vector: DVector<f64>,
    reflector: Vec<f64>,
}

impl SquareRoot {
    /// Starts at x0, P0; Q and P0 may be singular. Errors: Q or P0 not positive semidefinite.
    pub fn new(model: &LinearModel) -> Result<SquareRoot, LinalgError> {
        let n = model.x0.len();
        Ok(SquareRoot {
            x: model.x0.clone(),
            factor: cholesky_semidefinite(&model.p0)?,
            f: model.f.clone(),
            g: model.g.clone(),
            h: model.h.clone(),
            r: model.r.diagonal().iter().copied().collect(),
            noise: cholesky_semidefinite(&model.q)?,
            wide: DMatrix::zeros(2 * n, n),
            square: DMatrix::zeros(n + 1, n + 1),
            vector: DVector::zeros(n),
            reflector: vec![0.0; 2 * n + 1],
        })
    }

    /// P = S Sᵀ.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.factor * self.factor.transpose()
    }

    /// S.
    pub fn factor(&self) -> &DMatrix<f64> {
        &self.factor
    }

    /// x ← F x, S ← root of F S Sᵀ Fᵀ + Q.
    pub fn predict(&mut self) {
        let n = self.x.len();
        self.vector.gemv(1.0, &self.f, &self.x, 0.0);
        std::mem::swap(&mut self.vector, &mut self.x);
        for i in 0..n {
            for j in 0..n {
                // S is lower triangular: (F S)_ij runs from column j on
                self.wide[(j, i)] = (j..n).map(|k| self.f[(i, k)] * self.factor[(k, j)]).sum();
                self.wide[(n + j, i)] = self.noise[(i, j)];
            }
        }
        triangularise(&mut self.wide, &mut self.reflector);
        for j in 0..n {
            for i in 0..=j {
                self.factor[(j, i)] = self.wide[(i, j)];
            }
        }
    }

    /// x ← x + G u, as [`Kalman::drive`](super::Kalman::drive).
    pub fn drive(&mut self, u: &[f64]) {
        for (column, u) in self.g.column_iter().zip(u) {
            self.x.axpy(*u, &column, 1.0);
        }
    }

    /// As [`Kalman::update`](super::Kalman::update).
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        let n = self.x.len();
        self.square.fill(0.0);
        self.square[(0, 0)] = self.r[index].sqrt();
        for j in 0..n {
            // (Sᵀhᵀ)_j runs from row j on
            self.square[(j + 1, 0)] = (j..n).map(|k| self.factor[(k, j)] * self.h[(index, k)]).sum();
            for k in j..n {
                self.square[(j + 1, k + 1)] = self.factor[(k, j)];
            }
        }
        triangularise(&mut self.square, &mut self.reflector);
        let root = self.square[(0, 0)];
        let predicted: f64 = (0..n).map(|k| self.h[(index, k)] * self.x[k]).sum();
        let (innovation, variance) = (z - predicted, root * root);
        let nis = innovation * innovation / variance;
        let log_likelihood = -0.5 * ((std::f64::consts::TAU * variance).ln() + nis);
        let accepted = log_likelihood.is_finite() && innovation.abs() <= gate.unwrap_or(f64::INFINITY) * root.abs();
        if accepted {
            for i in 0..n {
                self.x[i] += self.square[(0, i + 1)] / root * innovation;
                for j in 0..=i {
                    self.factor[(i, j)] = self.square[(j + 1, i + 1)];
                }
            }
        }
        Update { innovation, variance, nis, log_likelihood, accepted }
    }
}

/// The upper triangle R with RᵀR = AᵀA in place of the first rows of A (Householder; Golub & Van Loan 2013, section 5.2); the rest is not cleared.
fn triangularise(a: &mut DMatrix<f64>, reflector: &mut [f64]) {
    let (rows, columns) = a.shape();
    for j in 0..columns.min(rows) {
        let norm = (j..rows).map(|i| a[(i, j)] * a[(i, j)]).sum::<f64>().sqrt();
        if norm == 0.0 {
            continue;
        }
        let head = if a[(j, j)] > 0.0 { -norm } else { norm };
        for i in j..rows {
            reflector[i] = a[(i, j)];
        }
        reflector[j] -= head;
        // |v|² = 2 norm (norm + |a_jj|)
        let half = -head * reflector[j];
        for k in j..columns {
            let share = (j..rows).map(|i| reflector[i] * a[(i, k)]).sum::<f64>() / half;
            for i in j..rows {
                a[(i, k)] -= share * reflector[i];
            }
        }
    }
}
