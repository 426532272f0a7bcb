//! From a continuous model ẋ = A x + w, w white of density Qc, to x_{k+1} = F x_k + v, v ~ N(0, Qd), exactly.

use nalgebra::Matrix2;

pub use crate::numerics::van_loan::van_loan;

/// Angle error and first-order Gauss-Markov drift of a gyro whose rate is integrated, states [θ, b]:
/// θ̇ = u − b − w, ḃ = −b/Tc + w_b. Returns F and Qd over one step.
///
/// With x = dt/Tc and om = 1 − e^−x: F = [[1, −Tc om], [0, 1 − om]], Q22 = σ²(1 − e^−2x), Q12 = −σ² Tc om², Q11 = N²
/// dt + 2 σ² Tc² (x − 2 om + (1 − e^−2x)/2). The bracket of Q11 is ∫₀^x (1 − e^−s)² ds, about x³/3: below x = 1.5 it
/// is summed as a series, since its terms cancel. `density` N in u/√Hz, `std_dev` σ in u, `correlation_time` Tc and
/// `dt` in s.
pub fn angle_and_drift(density: f64, std_dev: f64, correlation_time: f64, dt: f64) -> (Matrix2<f64>, Matrix2<f64>) {
    let x = dt / correlation_time;
    let om = -(-x).exp_m1();
    let om2 = -(-2.0 * x).exp_m1();
    let bracket = if x < 1.5 { drift_bracket_series(x) } else { x - 2.0 * om + 0.5 * om2 };
    let variance = std_dev * std_dev;
    let f = Matrix2::new(1.0, -correlation_time * om, 0.0, 1.0 - om);
    let q11 = density * density * dt + 2.0 * variance * correlation_time * correlation_time * bracket;
    let q12 = -variance * correlation_time * om * om;
    (f, Matrix2::new(q11, q12, q12, variance * om2))
}

/// ∫₀^x (1 − e^−s)² ds = Σ_{n≥3} (−1)^(n+1) (2^(n−1) − 2) xⁿ/n!.
fn drift_bracket_series(x: f64) -> f64 {
    let mut sum = 0.0;
    let mut term = x * x / 2.0; // xⁿ/n!
    let mut power = 2.0; // 2^(n−1)
    for n in 3..40 {
        term *= -x / f64::from(n);
        power *= 2.0;
        sum += term * (2.0 - power);
    }
    sum
}
