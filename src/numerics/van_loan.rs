//! From a continuous model ẋ = A x + w, w white of density Qc, to x_{k+1} = F x_k + v, v ~ N(0, Qd), exactly.

use nalgebra::DMatrix;

use super::linalg::{LinalgError, require_shape, symmetrise};

/// Transition F = exp(A dt) and noise Qd = ∫₀^dt exp(A s) Qc exp(Aᵀ s) ds. A and Qc n × n, Qc symmetric (two-sided
/// density).
///
/// One matrix exponential over a step short enough that ‖A‖ step ≤ 1, then doubling Qd ← Qd + F Qd Fᵀ, F ← F²: a sum of
/// semidefinite terms, so nothing cancels when dt is long. Errors: shapes, or entries that are not finite.
/// Source: Van Loan 1978, IEEE Trans. Automatic Control 23, equation 2.3.
pub fn van_loan(a: &DMatrix<f64>, qc: &DMatrix<f64>, dt: f64) -> Result<(DMatrix<f64>, DMatrix<f64>), LinalgError> {
    let n = a.nrows();
    require_shape(a, n, n)?;
    require_shape(qc, n, n)?;
    let norm = a.amax() * n as f64 * dt.abs();
    if !norm.is_finite() || qc.iter().any(|v| !v.is_finite()) {
        return Err(LinalgError::NoConvergence { iterations: 0, residual: norm });
    }
    let doublings = norm.log2().ceil().max(0.0) as i32;
    let step = dt / 2.0_f64.powi(doublings);
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&(a * -step));
    block.view_mut((0, n), (n, n)).copy_from(&(qc * step));
    block.view_mut((n, n), (n, n)).copy_from(&(a.transpose() * step));
    let exponential = block.exp();
    let mut f = exponential.view((n, n), (n, n)).transpose();
    let mut qd = &f * exponential.view((0, n), (n, n));
    symmetrise(&mut qd);
    for _ in 0..doublings {
        qd = &qd + &f * &qd * f.transpose();
        symmetrise(&mut qd);
        f = &f * &f;
    }
    Ok((f, qd))
}
