//! Cholesky with a typed failure, symmetry and definiteness checks, nalgebra ↔ faer.

use nalgebra::{DMatrix, DVector};

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LinalgError {
    #[error("matrix is not positive definite: pivot {pivot} is {value:e}")]
    NotPositiveDefinite { pivot: usize, value: f64 },
    #[error("matrix is singular")]
    Singular,
    #[error("matrix is {rows} x {columns}, expected {expected}")]
    Shape { rows: usize, columns: usize, expected: String },
    #[error("no convergence after {iterations} iterations (residual {residual:e})")]
    NoConvergence { iterations: usize, residual: f64 },
}

/// Lower Cholesky factor L of a symmetric positive definite matrix, A = L Lᵀ.
pub fn cholesky(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let _ = a;
    todo!()
}
/// Lower factor of a positive *semi*definite matrix (zero pivots allowed down to −tol·max diagonal).
pub fn cholesky_semidefinite(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let _ = a;
    todo!()
}
/// Solve A X = B for symmetric positive definite A.
pub fn solve_spd(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let _ = (a, b);
    todo!()
}
/// xᵀ A⁻¹ x for symmetric positive definite A.
pub fn mahalanobis(x: &DVector<f64>, a: &DMatrix<f64>) -> Result<f64, LinalgError> {
    let _ = (x, a);
    todo!()
}
/// A ← (A + Aᵀ)/2.
pub fn symmetrise(a: &mut DMatrix<f64>) {
    let _ = a;
    todo!()
}
/// max |A − Aᵀ| / max |A|.
pub fn asymmetry(a: &DMatrix<f64>) -> f64 {
    let _ = a;
    todo!()
}
/// Eigenvalues of a symmetric matrix, ascending.
pub fn symmetric_eigenvalues(a: &DMatrix<f64>) -> Vec<f64> {
    let _ = a;
    todo!()
}
/// Eigenvalues of a general real matrix (faer), as (re, im), by descending modulus.
pub fn eigenvalues(a: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let _ = a;
    todo!()
}
