//! The linear-quadratic regulator: u = −K x makes ∫ xᵀQx + uᵀRu least.

use nalgebra::DMatrix;

use crate::numerics::linalg::{LinalgError, eigenvalues, require_shape, solve, solve_spd, symmetrise};

/// Steps of Newton's iteration for the sign; it doubles its digits once it is near.
const STEPS: usize = 100;

/// A regulator.
#[derive(Clone, Debug)]
pub struct Regulator {
    /// K = R⁻¹BᵀX, m × n.
    pub gain: DMatrix<f64>,
    /// The solution of AᵀX + XA − XBR⁻¹BᵀX + Q = 0.
    pub cost: DMatrix<f64>,
    /// Largest entry of the left side over the largest of Q.
    pub relative_residual: f64,
}

/// Of ẋ = A x + B u. A n×n, B n×m, Q n×n semidefinite, R m×m definite; (A, B) stabilisable and no undetected mode on
/// the imaginary axis.
///
/// By the sign of the Hamiltonian (Roberts 1980, Int. J. Control 32) with determinants for scale (Byers 1987), then one
/// step of Newton's method. Errors: shapes, R not definite, or no stabilising solution.
pub fn regulator(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<Regulator, LinalgError> {
    let (n, m) = (a.nrows(), b.ncols());
    require_shape(a, n, n)?;
    require_shape(b, n, m)?;
    require_shape(q, n, n)?;
    require_shape(r, m, m)?;
    let r_b = solve_spd(r, &b.transpose())?;
    let mut sign = DMatrix::zeros(2 * n, 2 * n);
    sign.view_mut((0, 0), (n, n)).copy_from(a);
    sign.view_mut((0, n), (n, n)).copy_from(&-(b * &r_b));
    sign.view_mut((n, 0), (n, n)).copy_from(&-q);
    sign.view_mut((n, n), (n, n)).copy_from(&-a.transpose());
    let mut change = f64::INFINITY;
    for _ in 0..STEPS {
        let inverse = solve(sign.clone(), &DMatrix::identity(2 * n, 2 * n))?;
        let scale = sign.determinant().abs().powf(-1.0 / (2 * n) as f64);
        // far from the sign the scale speeds it up, near it is one
        let scale = if change > 1e-2 && scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        let next = (&sign * scale + inverse / scale) * 0.5;
        let before = change;
        change = (&next - &sign).norm() / next.norm();
        sign = next;
        // as near as rounding lets it come: the change no longer falls
        if (change < 1e-8 && change >= 0.5 * before) || change < 1e-15 {
            break;
        }
    }
    if change.is_nan() || change >= 1e-6 {
        return Err(LinalgError::NoConvergence { iterations: STEPS, residual: change });
    }
    // [W12; W22 + I] X = −[W11 + I; W21]
    let one = DMatrix::<f64>::identity(n, n);
    let mut left = DMatrix::zeros(2 * n, n);
    left.view_mut((0, 0), (n, n)).copy_from(&sign.view((0, n), (n, n)));
    left.view_mut((n, 0), (n, n)).copy_from(&(sign.view((n, n), (n, n)) + &one));
    let mut right = DMatrix::zeros(2 * n, n);
    right.view_mut((0, 0), (n, n)).copy_from(&-(sign.view((0, 0), (n, n)) + &one));
    right.view_mut((n, 0), (n, n)).copy_from(&-sign.view((n, 0), (n, n)));
    let mut x = solve(left.transpose() * &left, &(left.transpose() * right))?;
    symmetrise(&mut x);
    for _ in 0..3 {
        x = newton(a, b, q, r, &r_b, &x)?;
    }
    let slowest = eigenvalues(&(a - b * &r_b * &x)).into_iter().map(|e| e.0).fold(f64::NEG_INFINITY, f64::max);
    if slowest.is_nan() || slowest >= 0.0 {
        // an unstable motion that the inputs do not reach
        return Err(LinalgError::NoConvergence { iterations: STEPS, residual: slowest });
    }
    let residual = a.transpose() * &x + &x * a - &x * b * &r_b * &x + q;
    Ok(Regulator { gain: &r_b * &x, relative_residual: residual.amax() / q.amax(), cost: x })
}

/// The cost of the gain of `x`: (A − BK)ᵀX + X(A − BK) + Q + KᵀRK = 0 (Kleinman 1968), as one linear system of n²
/// numbers.
fn newton(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    r_b: &DMatrix<f64>,
    x: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let n = a.nrows();
    let k = r_b * x;
    let closed = (a - b * &k).transpose();
    let one = DMatrix::<f64>::identity(n, n);
    let system = one.kronecker(&closed) + closed.kronecker(&one);
    let driven = -(q + k.transpose() * r * &k);
    let solved = solve(system, &DMatrix::from_column_slice(n * n, 1, driven.as_slice()))?;
    let mut cost = DMatrix::from_column_slice(n, n, solved.as_slice());
    symmetrise(&mut cost);
    Ok(cost)
}
