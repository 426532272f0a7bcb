//! Discrete algebraic Riccati and Lyapunov equations.

use nalgebra::{Complex, DMatrix};

use super::linalg::{
    LinalgError, cholesky_semidefinite, relative_to_diagonal, require_shape, solve, solve_spd, symmetrise, to_faer,
};

/// Doublings before giving up: 2^64 steps of the filter.
const MAX_DOUBLINGS: usize = 64;

/// Solution of the filter DARE with how it was reached.
#[derive(Clone, Debug)]
pub struct RiccatiSolution {
    /// Predicted covariance P(k|k−1), n × n.
    pub covariance: DMatrix<f64>,
    /// Largest |F P Fᵀ − F P Hᵀ S⁻¹ H P Fᵀ + Q − P|_ij / √(P_ii P_jj).
    pub relative_residual: f64,
    pub iterations: usize,
}

/// Structured doubling for P = F P Fᵀ − F P Hᵀ (H P Hᵀ + R)⁻¹ H P Fᵀ + Q. F n×n, H m×n, Q n×n (semidefinite), R m×m
/// (definite).
///
/// Needs (F, H) detectable and no undriven mode on or outside the unit circle; then step k equals 2^k steps of the
/// filter. One Newton step follows. Errors: shapes, R not definite, or no convergence (the closed loop does not
/// decay). Source: Chu, Fan, Lin, Wang 2004, "Structure-preserving algorithms for periodic discrete-time algebraic
/// Riccati equations", Int. J. Control 77 (SDA).
pub fn dare_doubling(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<RiccatiSolution, LinalgError> {
    let (p, iterations) = Flow::one_step(f, h, q, r)?.settled()?;
    let covariance = newton(f, h, q, r, &p)?;
    let relative_residual = residual(f, h, q, r, &covariance)?;
    Ok(RiccatiSolution { covariance, relative_residual, iterations })
}

/// The Riccati recursion over some steps, P → X + Aᵀ P (I + G P)⁻¹ A: A is the transposed closed-loop transition
/// from P = 0, X the covariance reached from P = 0, G the information gathered about the start.
#[derive(Clone, Debug)]
pub struct Flow {
    a: DMatrix<f64>,
    g: DMatrix<f64>,
    x: DMatrix<f64>,
}

impl Flow {
    /// Checks the shapes; one step.
    pub fn one_step(
        f: &DMatrix<f64>,
        h: &DMatrix<f64>,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Result<Flow, LinalgError> {
        Ok(Flow { a: f.transpose(), g: information(f, h, q, r)?, x: q.clone() })
    }

    /// One step without a measurement. Errors: shapes.
    pub fn prediction(f: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<Flow, LinalgError> {
        let n = f.nrows();
        require_shape(f, n, n)?;
        require_shape(q, n, n)?;
        Ok(Flow { a: f.transpose(), g: DMatrix::zeros(n, n), x: q.clone() })
    }

    /// No step at all.
    pub fn none(n: usize) -> Flow {
        Flow { a: DMatrix::identity(n, n), g: DMatrix::zeros(n, n), x: DMatrix::zeros(n, n) }
    }

    /// These steps, then those of `next`. With W = I + G' X: A W⁻¹ A', G + A W⁻¹ G' Aᵀ, X' + A'ᵀ X W⁻¹ A'.
    pub fn then(&self, next: &Flow) -> Result<Flow, LinalgError> {
        let n = self.a.nrows();
        let w = DMatrix::<f64>::identity(n, n) + &next.g * &self.x;
        let w_a = solve(w.clone(), &next.a)?;
        let w_g = solve(w, &next.g)?;
        let mut x = &next.x + next.a.transpose() * &self.x * &w_a;
        symmetrise(&mut x);
        let mut g = &self.g + &self.a * w_g * self.a.transpose();
        symmetrise(&mut g);
        Ok(Flow { a: &self.a * w_a, g, x })
    }

    /// These steps `count` times.
    pub fn times(&self, count: u64) -> Result<Flow, LinalgError> {
        let mut result = Flow::none(self.a.nrows());
        let mut power = self.clone();
        for bit in 0..u64::BITS - count.leading_zeros() {
            if bit > 0 {
                power.double()?;
            }
            if count >> bit & 1 == 1 {
                result = result.then(&power)?;
            }
        }
        Ok(result)
    }

    /// The covariance that these steps, over and over, lead to from P = 0, and the doublings it took.
    fn settled(mut self) -> Result<(DMatrix<f64>, usize), LinalgError> {
        let mut change = f64::INFINITY;
        for iteration in 0..MAX_DOUBLINGS {
            let step = self.double()?;
            change = relative_to_diagonal(&step, self.x.diagonal().as_slice());
            // The closed loop must have died out as well: an unstable or undriven mode can sit at zero change.
            if change <= f64::EPSILON && self.a.iter().all(|v| v.abs() < 1.0) {
                return Ok((self.x, iteration + 1));
            }
        }
        Err(LinalgError::NoConvergence { iterations: MAX_DOUBLINGS, residual: change })
    }

    /// The covariance P(k|k−1) that repeats after these steps: periodic Riccati equation P = X + Aᵀ P (I + G P)⁻¹ A,
    /// by doubling and one Newton step. Conditions and errors as of [`dare_doubling`].
    pub fn periodic(&self) -> Result<RiccatiSolution, LinalgError> {
        let n = self.a.nrows();
        let (p, iterations) = self.clone().settled()?;
        let closed = self.closed_loop(&p)?;
        let mut driven = &closed * &p * &self.g * &p * closed.transpose() + &self.x;
        symmetrise(&mut driven);
        let covariance = stationary(closed - DMatrix::<f64>::identity(n, n), driven)?;
        let relative_residual = self.residual(&covariance)?;
        Ok(RiccatiSolution { covariance, relative_residual, iterations })
    }

    /// Largest entry of X + Aᵀ P (I + G P)⁻¹ A − P, relative to √(P_ii P_jj).
    fn residual(&self, p: &DMatrix<f64>) -> Result<f64, LinalgError> {
        let difference = &self.x + self.closed_loop(p)? * p * &self.a - p;
        Ok(relative_to_diagonal(&difference, p.diagonal().as_slice()))
    }

    /// How an error at the start lives on over these steps when the filter starts with `p`: Aᵀ (I + P G)⁻¹.
    pub fn closed_loop(&self, p: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
        let n = self.a.nrows();
        require_shape(p, n, n)?;
        let w = DMatrix::<f64>::identity(n, n) + &self.g * p;
        Ok(solve(w, &self.a)?.transpose())
    }

    /// The same by eigenvectors, see [`dare_eigenvector`]. States that forget everything within the steps make
    /// eigenvalues of zero that cannot be told apart: the residual says so.
    pub fn periodic_eigenvector(&self) -> Result<RiccatiSolution, LinalgError> {
        let covariance = eigenvector_solution(&self.a.transpose(), &self.g, &self.x)?;
        let relative_residual = self.residual(&covariance)?;
        Ok(RiccatiSolution { covariance, relative_residual, iterations: 1 })
    }

    /// P(k|k−1) after these steps from P(0|−1) = `p0` = L Lᵀ: X + Aᵀ L (I + Lᵀ G L)⁻¹ Lᵀ A. Errors: P0 indefinite.
    pub fn apply(&self, p0: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
        let l = cholesky_semidefinite(p0)?;
        let inner = DMatrix::<f64>::identity(l.nrows(), l.nrows()) + l.transpose() * &self.g * &l;
        let l_a = l.transpose() * &self.a;
        let mut p = &self.x + l_a.transpose() * solve_spd(&inner, &l_a)?;
        symmetrise(&mut p);
        Ok(p)
    }

    /// Twice as many steps; returns what was added to X.
    pub fn double(&mut self) -> Result<DMatrix<f64>, LinalgError> {
        let n = self.a.nrows();
        let w = DMatrix::<f64>::identity(n, n) + &self.g * &self.x;
        let w_a = solve(w.clone(), &self.a)?;
        let w_g = solve(w, &self.g)?;
        let mut step = self.a.transpose() * &self.x * &w_a;
        symmetrise(&mut step);
        self.g += &self.a * w_g * self.a.transpose();
        symmetrise(&mut self.g);
        self.x += &step;
        self.a = &self.a * w_a;
        Ok(step)
    }
}

/// The same by the stable eigenvectors of the symplectic pencil (faer): the independent check.
///
/// [Fᵀ 0; −Q I] v = λ [I HᵀR⁻¹H; 0 F] v, P = U₂ U₁⁻¹ from the n eigenvectors with |λ| < 1.
/// Loses digits as the closed-loop poles crowd the unit circle.
/// Source: Pappas, Laub, Sandell 1980, IEEE Trans. Automatic Control 25.
pub fn dare_eigenvector(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<RiccatiSolution, LinalgError> {
    let covariance = eigenvector_solution(f, &information(f, h, q, r)?, q)?;
    let relative_residual = residual(f, h, q, r, &covariance)?;
    Ok(RiccatiSolution { covariance, relative_residual, iterations: 1 })
}

/// [`dare_eigenvector`] with G = Hᵀ R⁻¹ H.
fn eigenvector_solution(f: &DMatrix<f64>, g: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let n = f.nrows();
    // P = s P̃ makes the two quadratic blocks equally large: Q/s and s G.
    let scale = if g.amax() > 0.0 && q.amax() > 0.0 { (q.amax() / g.amax()).sqrt() } else { 1.0 };
    let mut left = DMatrix::zeros(2 * n, 2 * n);
    let mut right = DMatrix::identity(2 * n, 2 * n);
    left.view_mut((0, 0), (n, n)).copy_from(&f.transpose());
    left.view_mut((n, 0), (n, n)).copy_from(&(q / -scale));
    left.view_mut((n, n), (n, n)).fill_with_identity();
    right.view_mut((0, n), (n, n)).copy_from(&(g * scale));
    right.view_mut((n, n), (n, n)).copy_from(f);

    let failure = || LinalgError::NoConvergence { iterations: 1, residual: f64::NAN };
    let pencil = to_faer(&left).generalized_eigen(to_faer(&right)).map_err(|_| failure())?;
    let numerators = pencil.S_a().column_vector();
    let denominators = pencil.S_b().column_vector();
    let modulus: Vec<f64> = (0..2 * n).map(|i| numerators[i].norm() / denominators[i].norm()).collect();
    let mut order: Vec<usize> = (0..2 * n).collect();
    order.sort_by(|&i, &j| modulus[i].total_cmp(&modulus[j]));
    if order.get(n.wrapping_sub(1)).is_some_and(|&last| modulus[last] >= 1.0 || modulus[last].is_nan()) {
        return Err(failure());
    }
    let vectors = pencil.U();
    let block = |first: usize| DMatrix::from_fn(n, n, |i, j| vectors[(first + i, order[j])]);
    let (u1, u2): (DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) = (block(0), block(n));
    // P U₁ = U₂, so U₁ᵀ Pᵀ = U₂ᵀ.
    let p = u1.transpose().lu().solve(&u2.transpose()).ok_or(LinalgError::Singular)?;
    let mut covariance = DMatrix::from_fn(n, n, |i, j| scale * p[(j, i)].re);
    if covariance.iter().any(|v| !v.is_finite()) {
        return Err(LinalgError::Singular);
    }
    symmetrise(&mut covariance);
    Ok(covariance)
}

/// Discrete Lyapunov equation X = A X Aᵀ + Q by doubling (A stable, Q symmetric semidefinite): a sum of semidefinite
/// terms.
///
/// Errors: shapes, or no convergence (A has a pole on or outside the unit circle).
/// Source: Smith 1968, SIAM J. Applied Mathematics 16 (squared form).
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let n = a.nrows();
    require_shape(a, n, n)?;
    require_shape(q, n, n)?;
    stationary(a - DMatrix::<f64>::identity(n, n), q.clone())
}

/// X = (I + D) X (I + D)ᵀ + Q. Squaring I + D as D ← 2D + D² keeps the distance of slow poles from one:
/// squaring A itself would lose as many digits as that distance has zeros.
fn stationary(mut d: DMatrix<f64>, mut x: DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let identity = DMatrix::<f64>::identity(d.nrows(), d.nrows());
    let mut change = f64::INFINITY;
    for _ in 0..MAX_DOUBLINGS {
        let power = &identity + &d;
        let mut step = &power * &x * power.transpose();
        symmetrise(&mut step);
        x += &step;
        d = &d * 2.0 + &d * &d;
        change = relative_to_diagonal(&step, x.diagonal().as_slice());
        if change <= f64::EPSILON && power.amax() < 1.0 {
            return Ok(x);
        }
    }
    Err(LinalgError::NoConvergence { iterations: MAX_DOUBLINGS, residual: change })
}

/// One Newton step: the covariance of the filter that uses the gain of `p`. Squares what error is left,
/// and recovers the digits that doubling loses when the closed loop is slow.
/// Source: Kleinman 1968, IEEE Trans. Automatic Control 13; Hewer 1971 (discrete time).
fn newton(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    p: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let s = h * p * h.transpose() + r;
    let f_k = f * solve_spd(&s, &(h * p))?.transpose();
    let d = (f - DMatrix::<f64>::identity(f.nrows(), f.nrows())) - &f_k * h;
    let mut driven = &f_k * r * f_k.transpose() + q;
    symmetrise(&mut driven);
    stationary(d, driven)
}

/// Checks the shapes and returns Hᵀ R⁻¹ H.
fn information(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, LinalgError> {
    let (n, m) = (f.nrows(), h.nrows());
    require_shape(f, n, n)?;
    require_shape(h, m, n)?;
    require_shape(q, n, n)?;
    require_shape(r, m, m)?;
    let mut g = h.transpose() * solve_spd(r, h)?;
    symmetrise(&mut g);
    Ok(g)
}

/// Largest entry of F P Fᵀ − F P Hᵀ S⁻¹ H P Fᵀ + Q − P, relative to √(P_ii P_jj).
fn residual(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    p: &DMatrix<f64>,
) -> Result<f64, LinalgError> {
    let s = h * p * h.transpose() + r;
    let h_p = h * p;
    let updated = p - h_p.transpose() * solve_spd(&s, &h_p)?;
    let difference = f * updated * f.transpose() + q - p;
    Ok(relative_to_diagonal(&difference, p.diagonal().as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(v: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, v)
    }

    #[test]
    fn scalar_solution_is_the_root_of_the_quadratic() {
        // P² + P(R(1−a²) − q) − qR = 0 for a = 0.9, q = 0.2, R = 1.
        let (a, q, r) = (0.9_f64, 0.2, 1.0);
        let half = (r * (1.0 - a * a) - q) / 2.0;
        let root = -half + (half * half + q * r).sqrt();
        for solve in [dare_doubling, dare_eigenvector] {
            let solution = solve(&scalar(a), &scalar(1.0), &scalar(q), &scalar(r)).unwrap();
            assert!((solution.covariance[(0, 0)] - root).abs() < 1e-15, "{} {root}", solution.covariance[(0, 0)]);
            assert!(solution.relative_residual < 1e-14);
        }
    }

    #[test]
    fn unstable_or_undriven_modes_are_an_error_not_a_wrong_answer() {
        // x doubles each step, is not driven, and is not seen: no stabilising solution.
        let result = dare_doubling(&scalar(2.0), &scalar(0.0), &scalar(0.0), &scalar(1.0));
        assert!(matches!(result, Err(LinalgError::NoConvergence { .. } | LinalgError::Singular)), "{result:?}");
        let result = dare_doubling(&scalar(1.0), &scalar(1.0), &scalar(0.0), &scalar(1.0));
        assert!(matches!(result, Err(LinalgError::NoConvergence { .. })), "{result:?}");
        assert!(lyapunov(&scalar(1.0), &scalar(1.0)).is_err());
        assert!(matches!(
            dare_doubling(&scalar(0.5), &scalar(1.0), &scalar(1.0), &scalar(-1.0)),
            Err(LinalgError::NotPositiveDefinite { .. })
        ));
        assert!(matches!(
            dare_doubling(&DMatrix::zeros(2, 2), &scalar(1.0), &scalar(1.0), &scalar(1.0)),
            Err(LinalgError::Shape { .. })
        ));
    }

    #[test]
    fn lyapunov_of_a_slow_scalar_is_the_stationary_variance() {
        // x' = a x + v has variance q/(1 − a²); a² in exact arithmetic of the doubles used.
        let a = 1.0 - 1e-9;
        let x = lyapunov(&scalar(a), &scalar(2.0)).unwrap()[(0, 0)];
        let expected = 2.0 / ((1.0 - a) * (1.0 + a));
        assert!((x / expected - 1.0).abs() < 1e-12, "{x} {expected}");
    }

    #[test]
    fn slow_scalar_filter_keeps_its_digits() {
        // Tc = 10⁵ s at 1 kHz: poles 10⁻⁸ from one. The quadratic's root, with 1 − a² free of cancellation.
        let (distance, q, r) = (2.0_f64.powi(-27), 1e-16, 1.0);
        let a = 1.0 - distance;
        let half = (r * distance * (2.0 - distance) - q) / 2.0;
        let root = q * r / (half + (half * half + q * r).sqrt());
        let solution = dare_doubling(&scalar(a), &scalar(1.0), &scalar(q), &scalar(r)).unwrap();
        assert!((solution.covariance[(0, 0)] / root - 1.0).abs() < 1e-13, "{} {root}", solution.covariance[(0, 0)]);
    }
}
