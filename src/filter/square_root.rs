//! Kalman filter on a triangular factor of the covariance, P = S Sᵀ: no difference of large numbers is ever formed,
//! and the digits of P are those of S twice over. Same convention, same results as [`Kalman`]; it goes on where P in
//! double precision has lost its definiteness.
//!
//! Both steps are one orthogonal triangularisation (Householder) of an array whose Gram matrix is the covariance
//! wanted: prediction [F S, Q^½]ᵀ → S⁺ᵀ, and for a scalar measurement [[√r, 0], [Sᵀhᵀ, Sᵀ]] → [[√s, k̄ᵀ], [0, S⁺ᵀ]]
//! with K = k̄/√s. Source: Kailath, Sayed & Hassibi 2000, Linear Estimation, section 12.3.

use nalgebra::{DMatrix, DVector, RealField, convert, convert_unchecked};

use super::kalman::{Kalman, Update};
use crate::model::LinearModel;
use crate::numerics::linalg::{LinalgError, cholesky_semidefinite};

/// Beyond so many steps a gap is bridged by the covariance itself.
const STEPPED_GAP: u64 = 1000;

/// State of a running square-root filter, in numbers of type `T`.
#[derive(Clone, Debug)]
pub struct SquareRoot<T: RealField + Copy = f64> {
    pub x: DVector<T>,
    /// S, lower triangular, P = S Sᵀ.
    factor: DMatrix<T>,
    f: DMatrix<T>,
    g: DMatrix<T>,
    h: DMatrix<T>,
    r: Vec<T>,
    /// Root of Q: Q = W Wᵀ.
    noise: DMatrix<T>,
    /// [F S, W]ᵀ.
    wide: DMatrix<T>,
    /// [[√r, 0], [Sᵀhᵀ, Sᵀ]].
    square: DMatrix<T>,
    vector: DVector<T>,
    reflector: Vec<T>,
}

impl<T: RealField + Copy> SquareRoot<T> {
    /// Starts at x0, P0; Q and P0 may be singular. Errors: Q or P0 not positive semidefinite.
    pub fn new(model: &LinearModel) -> Result<SquareRoot<T>, LinalgError> {
        let n = model.x0.len();
        let matrix = |a: &DMatrix<f64>| a.map(convert::<f64, T>);
        Ok(SquareRoot {
            x: model.x0.map(convert),
            factor: matrix(&cholesky_semidefinite(&model.p0)?),
            f: matrix(&model.f),
            g: matrix(&model.g),
            h: matrix(&model.h),
            r: model.r.diagonal().iter().map(|r| convert(*r)).collect(),
            noise: matrix(&cholesky_semidefinite(&model.q)?),
            wide: DMatrix::zeros(2 * n, n),
            square: DMatrix::zeros(n + 1, n + 1),
            vector: DVector::zeros(n),
            reflector: vec![T::zero(); 2 * n + 1],
        })
    }

    /// P = S Sᵀ.
    pub fn covariance(&self) -> DMatrix<T> {
        &self.factor * self.factor.transpose()
    }

    /// S.
    pub fn factor(&self) -> &DMatrix<T> {
        &self.factor
    }

    /// x ← F x, S ← root of F S Sᵀ Fᵀ + Q.
    pub fn predict(&mut self) {
        let n = self.x.len();
        self.vector.gemv(T::one(), &self.f, &self.x, T::zero());
        std::mem::swap(&mut self.vector, &mut self.x);
        for i in 0..n {
            for j in 0..n {
                // S is lower triangular: (F S)_ij runs from column j on
                self.wide[(j, i)] = sum((j..n).map(|k| self.f[(i, k)] * self.factor[(k, j)]));
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
            self.x.axpy(convert(*u), &column, T::one());
        }
    }

    /// As [`Kalman::update`](super::Kalman::update); the numbers it returns are of the precision of `T`.
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        let n = self.x.len();
        self.measure(index);
        let root = self.square[(0, 0)];
        let predicted = sum((0..n).map(|k| self.h[(index, k)] * self.x[k]));
        let step: T = convert::<f64, T>(z) - predicted;
        let (innovation, wide): (f64, f64) = (convert_unchecked(step), convert_unchecked(root));
        let variance = wide * wide;
        let update = Update::new(innovation, variance, gate.unwrap_or(f64::INFINITY));
        if update.accepted {
            for i in 0..n {
                self.x[i] += self.square[(0, i + 1)] / root * step;
                for j in 0..=i {
                    self.factor[(i, j)] = self.square[(j + 1, i + 1)];
                }
            }
        }
        update
    }

    /// As [`Kalman::nudge`].
    pub fn nudge(&mut self, index: usize, innovation: f64) {
        self.measure(index);
        let root = self.square[(0, 0)];
        for i in 0..self.x.len() {
            self.x[i] += self.square[(0, i + 1)] / root * convert::<f64, T>(innovation);
        }
    }

    /// The triangle of a measurement: [[√s, k̄ᵀ], [0, S⁺ᵀ]].
    fn measure(&mut self, index: usize) {
        let n = self.x.len();
        self.square.fill(T::zero());
        self.square[(0, 0)] = self.r[index].sqrt();
        for j in 0..n {
            // (Sᵀhᵀ)_j runs from row j on
            self.square[(j + 1, 0)] = sum((j..n).map(|k| self.factor[(k, j)] * self.h[(index, k)]));
            for k in j..n {
                self.square[(j + 1, k + 1)] = self.factor[(k, j)];
            }
        }
        triangularise(&mut self.square, &mut self.reflector);
    }
}

impl SquareRoot {
    /// As [`Kalman::advance`]; over a long gap by way of `bridge`, a filter of the same model.
    pub fn advance(&mut self, steps: u64, inputs: Option<&[f64]>, bridge: &mut Kalman) {
        if steps > STEPPED_GAP {
            bridge.x.copy_from(&self.x);
            bridge.p = self.covariance();
            bridge.advance(steps, inputs);
            if let Ok(factor) = cholesky_semidefinite(&bridge.p) {
                self.x.copy_from(&bridge.x);
                self.factor = factor;
                return;
            }
        }
        for _ in 0..steps {
            self.predict();
            if let Some(u) = inputs {
                self.drive(u);
            }
        }
    }
}

fn sum<T: RealField>(terms: impl Iterator<Item = T>) -> T {
    terms.fold(T::zero(), |sum, term| sum + term)
}

/// The upper triangle R with RᵀR = AᵀA in place of the first rows of A (Householder; Golub & Van Loan 2013, section
/// 5.2); the rest is not cleared.
fn triangularise<T: RealField + Copy>(a: &mut DMatrix<T>, reflector: &mut [T]) {
    let (rows, columns) = a.shape();
    for j in 0..columns.min(rows) {
        let norm = sum((j..rows).map(|i| a[(i, j)] * a[(i, j)])).sqrt();
        if norm == T::zero() {
            continue;
        }
        let head = if a[(j, j)] > T::zero() { -norm } else { norm };
        for i in j..rows {
            reflector[i] = a[(i, j)];
        }
        reflector[j] -= head;
        // |v|² = 2 norm (norm + |a_jj|)
        let half = -head * reflector[j];
        for k in j..columns {
            let share = sum((j..rows).map(|i| reflector[i] * a[(i, k)])) / half;
            for i in j..rows {
                let step = share * reflector[i];
                a[(i, k)] -= step;
            }
        }
    }
}
