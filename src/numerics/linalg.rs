//! Cholesky with a typed failure, symmetry and definiteness checks, eigenvalues and singular values (nalgebra ↔ faer).

use faer::{Mat, Side};
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

/// `Ok` when `a` has this shape.
pub fn require_shape(a: &DMatrix<f64>, rows: usize, columns: usize) -> Result<(), LinalgError> {
    if a.shape() == (rows, columns) {
        return Ok(());
    }
    Err(LinalgError::Shape { rows: a.nrows(), columns: a.ncols(), expected: format!("{rows} x {columns}") })
}

/// Schur complement a_ij − Σ_{k<j} l_ik l_jk.
fn complement(a: &DMatrix<f64>, l: &DMatrix<f64>, i: usize, j: usize) -> f64 {
    a[(i, j)] - (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum::<f64>()
}

/// Lower Cholesky factor L of a symmetric positive definite matrix, A = L Lᵀ.
///
/// Only the lower triangle is read. Errors: not square, or a pivot that is not positive (its number and value).
pub fn cholesky(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let n = a.nrows();
    require_shape(a, n, n)?;
    let mut l = a.clone();
    l.fill_upper_triangle(0.0, 1);
    cholesky_in_place(l.as_mut_slice(), n)?;
    Ok(l)
}

/// The same by columns of `n` numbers, in place; what is above the diagonal is neither read nor changed.
pub fn cholesky_in_place(a: &mut [f64], n: usize) -> Result<(), LinalgError> {
    for j in 0..n {
        for i in j..n {
            // Schur complement a_ij − Σ_{k<j} l_ik l_jk
            let value = a[i + n * j] - (0..j).map(|k| a[i + n * k] * a[j + n * k]).sum::<f64>();
            if i == j && !(value > 0.0 && value.is_finite()) {
                return Err(LinalgError::NotPositiveDefinite { pivot: j, value });
            }
            a[i + n * j] = if i == j { value.sqrt() } else { value / a[j + n * j] };
        }
    }
    Ok(())
}

/// Lower factor L of a positive *semi*definite matrix, A = L Lᵀ, with a zero column where A has no new direction.
///
/// A pivot counts as zero when it is within rounding (16 n ε) of its own diagonal entry, so mixed units do no harm;
/// the entries below it must then vanish too: s_ij² ≤ 16 n ε · a_ii a_jj. Errors: not square, or indefinite.
pub fn cholesky_semidefinite(a: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let n = a.nrows();
    require_shape(a, n, n)?;
    let rounding = 16.0 * n as f64 * f64::EPSILON;
    let mut l = DMatrix::zeros(n, n);
    for j in 0..n {
        let pivot = complement(a, &l, j, j);
        let indefinite = LinalgError::NotPositiveDefinite { pivot: j, value: pivot };
        if !(pivot.is_finite() && pivot >= -rounding * a[(j, j)].abs()) {
            return Err(indefinite);
        }
        let zero = pivot <= rounding * a[(j, j)].abs();
        for i in j + 1..n {
            let s = complement(a, &l, i, j);
            if !zero {
                l[(i, j)] = s / pivot.sqrt();
            } else if s * s > rounding * (a[(i, i)] * a[(j, j)]).abs() || s.is_nan() {
                return Err(indefinite);
            }
        }
        l[(j, j)] = if zero { 0.0 } else { pivot.sqrt() };
    }
    Ok(l)
}

/// Solve A X = B for symmetric positive definite A (n × n), B n × m.
pub fn solve_spd(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let l = cholesky(a)?;
    require_shape(b, a.nrows(), b.ncols())?;
    let y = l.solve_lower_triangular(b).ok_or(LinalgError::Singular)?;
    l.tr_solve_lower_triangular(&y).ok_or(LinalgError::Singular)
}

/// Solve A X = B for a general square A by LU with partial pivoting.
pub fn solve(a: DMatrix<f64>, b: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    require_shape(&a, b.nrows(), b.nrows())?;
    let x = a.lu().solve(b).ok_or(LinalgError::Singular)?;
    if x.iter().all(|v| v.is_finite()) { Ok(x) } else { Err(LinalgError::Singular) }
}

/// xᵀ A⁻¹ x for symmetric positive definite A.
pub fn mahalanobis(x: &DVector<f64>, a: &DMatrix<f64>) -> Result<f64, LinalgError> {
    require_shape(a, x.len(), x.len())?;
    let y = cholesky(a)?.solve_lower_triangular(x).ok_or(LinalgError::Singular)?;
    Ok(y.norm_squared())
}

/// A ← (A + Aᵀ)/2 of a square matrix.
pub fn symmetrise(a: &mut DMatrix<f64>) {
    for j in 0..a.ncols() {
        for i in j + 1..a.nrows() {
            let mean = 0.5 * (a[(i, j)] + a[(j, i)]);
            a[(i, j)] = mean;
            a[(j, i)] = mean;
        }
    }
}

/// max |A − Aᵀ| / max |A|; 0 for the zero matrix, infinite when A is not square.
pub fn asymmetry(a: &DMatrix<f64>) -> f64 {
    if !a.is_square() {
        return f64::INFINITY;
    }
    let largest = a.amax();
    if largest == 0.0 { 0.0 } else { (a - a.transpose()).amax() / largest }
}

/// max_ij |A_ij| / √(scale_i scale_j): the size of a symmetric difference beside a covariance with diagonal `scale`,
/// whatever units the states have. Rows and columns of zero scale count only where A is not zero (then infinite).
pub fn relative_to_diagonal(a: &DMatrix<f64>, scale: &[f64]) -> f64 {
    let mut largest = 0.0_f64;
    for (j, sj) in scale.iter().enumerate().take(a.ncols()) {
        for (i, si) in scale.iter().enumerate().take(a.nrows()) {
            let value = a[(i, j)].abs();
            if value.is_nan() {
                return f64::NAN;
            }
            if value > 0.0 {
                largest = largest.max(value / (si.sqrt() * sj.sqrt()));
            }
        }
    }
    largest
}

/// Eigenvalues of a symmetric matrix, ascending; NaN when they do not exist (not square, not finite).
pub fn symmetric_eigenvalues(a: &DMatrix<f64>) -> Vec<f64> {
    let solved = finite_square(a).and_then(|a| a.self_adjoint_eigenvalues(Side::Lower).ok());
    solved.unwrap_or_else(|| vec![f64::NAN; a.nrows()])
}

/// Eigenvalues of a general real matrix (faer), as (re, im), by descending modulus; NaN when they do not exist.
pub fn eigenvalues(a: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let solved = finite_square(a).and_then(|a| a.eigenvalues().ok());
    let mut values: Vec<(f64, f64)> = match solved {
        Some(values) => values.iter().map(|z| (z.re, z.im)).collect(),
        None => vec![(f64::NAN, f64::NAN); a.nrows()],
    };
    // Conjugates have equal modulus: the imaginary part makes the order unique.
    values.sort_by(|a, b| b.0.hypot(b.1).total_cmp(&a.0.hypot(a.1)).then(b.1.total_cmp(&a.1)));
    values
}

/// Singular values in descending order with the right singular vectors as columns, A = U diag(s) Vᵀ.
///
/// Errors: entries that are not finite.
pub fn singular_values(a: &DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>), LinalgError> {
    if a.iter().any(|v| !v.is_finite()) {
        return Err(LinalgError::NoConvergence { iterations: 0, residual: f64::NAN });
    }
    let svd = to_faer(a).svd().map_err(|_| LinalgError::NoConvergence { iterations: 0, residual: f64::NAN })?;
    let s = svd.S().column_vector().iter().copied().collect();
    let v = svd.V();
    Ok((s, DMatrix::from_fn(v.nrows(), v.ncols(), |i, j| v[(i, j)])))
}

/// A faer copy.
pub fn to_faer(a: &DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)])
}

fn finite_square(a: &DMatrix<f64>) -> Option<Mat<f64>> {
    (a.is_square() && a.iter().all(|v| v.is_finite())).then(|| to_faer(a))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(rows: &[&[f64]]) -> DMatrix<f64> {
        DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
    }

    #[test]
    fn cholesky_of_a_textbook_matrix_is_exact() {
        let a = matrix(&[&[4.0, 12.0, -16.0], &[12.0, 37.0, -43.0], &[-16.0, -43.0, 98.0]]);
        let l = cholesky(&a).unwrap();
        assert_eq!(l, matrix(&[&[2.0, 0.0, 0.0], &[6.0, 1.0, 0.0], &[-8.0, 5.0, 3.0]]));
        // A⁻¹ b and bᵀ A⁻¹ b follow from the factor: x = (1, 2, 3) solves A x = (−20, −43, 192).
        let b = DVector::from_vec(vec![-20.0, -43.0, 192.0]);
        let x = solve_spd(&a, &DMatrix::from_column_slice(3, 1, b.as_slice())).unwrap();
        assert!((x - matrix(&[&[1.0], &[2.0], &[3.0]])).amax() < 1e-12);
        assert!((mahalanobis(&b, &a).unwrap() - 470.0).abs() < 1e-9);
    }

    #[test]
    fn cholesky_names_the_pivot_that_fails() {
        let a = matrix(&[&[1.0, 2.0], &[2.0, 1.0]]);
        assert_eq!(cholesky(&a), Err(LinalgError::NotPositiveDefinite { pivot: 1, value: -3.0 }));
        assert!(matches!(cholesky_semidefinite(&a), Err(LinalgError::NotPositiveDefinite { pivot: 1, .. })));
        assert!(matches!(cholesky(&DMatrix::zeros(2, 3)), Err(LinalgError::Shape { .. })));
        assert!(matches!(cholesky(&matrix(&[&[f64::NAN]])), Err(LinalgError::NotPositiveDefinite { .. })));
    }

    #[test]
    fn semidefinite_factor_reproduces_rank_deficient_matrices_in_mixed_units() {
        // Rank 1 with entries twelve decades apart, and a zero row.
        let v = DVector::from_vec(vec![1e-6, 0.0, 3.0]);
        let a = &v * v.transpose();
        let l = cholesky_semidefinite(&a).unwrap();
        assert!(relative_to_diagonal(&(&l * l.transpose() - &a), &[1e-12, 0.0, 9.0]) < 1e-15);
        assert_eq!(l[(1, 1)], 0.0);
        assert_eq!(l[(2, 2)], 0.0);
        // A zero variance with a covariance beside it is no covariance matrix.
        assert!(cholesky_semidefinite(&matrix(&[&[0.0, 1e-3], &[1e-3, 1.0]])).is_err());
    }

    #[test]
    fn eigenvalues_are_ordered_and_total() {
        let values = eigenvalues(&matrix(&[&[0.0, -2.0, 0.0], &[2.0, 0.0, 0.0], &[0.0, 0.0, 3.0]]));
        let expected = [(3.0, 0.0), (0.0, 2.0), (0.0, -2.0)];
        for (v, e) in values.iter().zip(expected) {
            assert!((v.0 - e.0).abs() < 1e-14 && (v.1 - e.1).abs() < 1e-14, "{values:?}");
        }
        let symmetric = symmetric_eigenvalues(&matrix(&[&[2.0, 1.0], &[1.0, 2.0]]));
        assert!((symmetric[0] - 1.0).abs() < 1e-15 && (symmetric[1] - 3.0).abs() < 1e-15);
        assert!(symmetric_eigenvalues(&matrix(&[&[f64::NAN]]))[0].is_nan());
        assert!(eigenvalues(&matrix(&[&[f64::INFINITY]]))[0].0.is_nan());
        assert!(eigenvalues(&DMatrix::zeros(0, 0)).is_empty());
        assert_eq!(eigenvalues(&matrix(&[&[0.5]])), vec![(0.5, 0.0)]);
    }

    #[test]
    fn singular_values_give_the_null_direction() {
        let (s, v) = singular_values(&matrix(&[&[1.0, 1.0], &[1.0, 1.0], &[1.0, 1.0]])).unwrap();
        assert!((s[0] - 6.0_f64.sqrt()).abs() < 1e-14 && s[1] < 1e-15);
        assert!((v[(0, 1)] + v[(1, 1)]).abs() < 1e-15, "null direction is (1, −1)");
        assert!(singular_values(&matrix(&[&[f64::NAN]])).is_err());
    }

    #[test]
    fn symmetry_is_measured_and_restored() {
        let mut a = matrix(&[&[1.0, 2.0], &[4.0, 8.0]]);
        assert_eq!(asymmetry(&a), 0.25);
        symmetrise(&mut a);
        assert_eq!(a, matrix(&[&[1.0, 3.0], &[3.0, 8.0]]));
        assert_eq!(asymmetry(&DMatrix::zeros(2, 2)), 0.0);
        assert!(asymmetry(&DMatrix::zeros(2, 3)).is_infinite());
    }
}
