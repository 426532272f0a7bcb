//! Discrete algebraic Riccati and Lyapunov equations.

use nalgebra::DMatrix;

use super::linalg::LinalgError;

/// Solution of the filter DARE with how it was reached.
#[derive(Clone, Debug)]
pub struct RiccatiSolution {
    /// Predicted covariance P(k|k−1), n × n.
    pub covariance: DMatrix<f64>,
    /// ‖F P Fᵀ − F P Hᵀ S⁻¹ H P Fᵀ + Q − P‖ / ‖P‖ (largest entry).
    pub relative_residual: f64,
    pub iterations: usize,
}

/// Structured doubling for P = F P Fᵀ − F P Hᵀ (H P Hᵀ + R)⁻¹ H P Fᵀ + Q. F n×n, H m×n, Q n×n (semidefinite), R m×m (definite).
/// Source: Chu, Fan, Lin, Wang 2004 (SDA).
pub fn dare_doubling(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<RiccatiSolution, LinalgError> {
    let _ = (f, h, q, r);
    todo!()
}
/// The same by the stable eigenvectors of the symplectic pencil (faer): the independent check.
pub fn dare_eigenvector(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<RiccatiSolution, LinalgError> {
    let _ = (f, h, q, r);
    todo!()
}
/// Discrete Lyapunov equation X = A X Aᵀ + Q by doubling (A stable).
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let _ = (a, q);
    todo!()
}
