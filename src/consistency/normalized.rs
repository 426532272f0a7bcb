//! Means of normalised squared errors against chi-square bounds: NEES across runs, NIS over time.

use super::effect::{Effect, NIS_TOLERANCE};
use super::{Test, TestKind};
use crate::numerics::distribution::{chi_square_cdf, chi_square_quantile, chi_square_sf, normal_cdf, normal_quantile};

/// A mean of normalised squares with its bounds under the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanTest {
    /// Number of values in the mean.
    pub count: u64,
    pub mean: f64,
    /// Expectation of the mean when the model is true.
    pub expected: f64,
    /// [lower, upper] contains the mean with probability 1 − alpha when the model is true.
    pub lower: f64,
    pub upper: f64,
    /// Two-sided.
    pub p_value: f64,
}

/// Two-sided p-value of a chi-square statistic, 2·min(P(χ² ≤ x), P(χ² ≥ x)), at most 1.
pub fn two_sided_p(x: f64, dof: f64) -> f64 {
    (2.0 * chi_square_cdf(x, dof).min(chi_square_sf(x, dof))).min(1.0)
}

/// The mean of `count` independent χ²(`dof`) values whose sum is `sum`: bounds χ²(α/2, dof·count)/count … χ²(1−α/2,
/// dof·count)/count.
///
/// NIS with m measurements has dof = m, NEES with n states dof = n. Source: Bar-Shalom, Li & Kirubarajan 2001,
/// section 5.4.2.
pub fn mean_of_chi_squares(sum: f64, count: u64, dof: f64, alpha: f64) -> MeanTest {
    moment_matched(sum, count, dof, 2.0 * dof, alpha)
}

/// Values of independent runs at one epoch (NEES per epoch): see [`mean_of_chi_squares`].
pub fn across_runs(values: &[f64], dof: f64, alpha: f64) -> MeanTest {
    mean_of_chi_squares(crate::numerics::reduce::mean(values) * values.len() as f64, values.len() as u64, dof, alpha)
}

/// ANEES over `runs` independent runs of `epochs` correlated epochs each: χ² with dof·runs·n_eff degrees of freedom.
///
/// `mean` is the mean NEES over all runs and epochs, `rho` the lag-one correlation of the NEES sequence (λ² for a
/// closed-loop pole λ). Exact in mean and variance for one state; for several states with the slowest pole it is
/// conservative.
pub fn over_time(mean: f64, runs: u64, epochs: u64, dof: f64, rho: f64, alpha: f64) -> MeanTest {
    let effective = runs as f64 * effective_samples(epochs, rho);
    let total = dof * effective;
    MeanTest {
        count: runs * epochs,
        mean,
        expected: dof,
        lower: chi_square_quantile(alpha / 2.0, total) / effective,
        upper: chi_square_quantile(1.0 - alpha / 2.0, total) / effective,
        p_value: two_sided_p(mean * effective, total),
    }
}

/// Effective sample size of the mean of `n` values with lag-h correlation rho^h: n / [1 + 2 Σ_{h<n} (1 − h/n) rho^h].
///
/// For n ≫ 1/(1 − rho) this is n(1 − rho)/(1 + rho). NaN for rho outside [0, 1].
pub fn effective_samples(n: u64, rho: f64) -> f64 {
    if n == 0 || !(0.0..=1.0).contains(&rho) {
        return f64::NAN;
    }
    let count = n as f64;
    if rho == 0.0 {
        return count;
    }
    let one_minus = 1.0 - rho;
    if count * one_minus < 1e-4 {
        // first order in 1 − ρ: the closed form below cancels
        return count / (count - one_minus * (count * count - 1.0) / 3.0);
    }
    // Σ_{h=1}^{n-1} (1 − h/n) ρ^h = ρ/(1−ρ) − ρ(1−ρⁿ)/(n(1−ρ)²)
    let one_minus_power = -(count * rho.ln()).exp_m1();
    let tail = rho / one_minus - rho * one_minus_power / (count * one_minus * one_minus);
    count / (1.0 + 2.0 * tail)
}

/// Mean and variance of y² for y ~ N(0, 1) truncated to |y| ≤ g: what the NIS of accepted innovations has behind a
/// gate of g sigmas.
///
/// E(y²) = 1 − 2gφ(g)/p and E(y⁴) = 3 − 2(g³ + 3g)φ(g)/p with p = P(|y| ≤ g).
pub fn gated_moments(gate: f64) -> (f64, f64) {
    let inside = 2.0 * normal_cdf(gate) - 1.0;
    let density = (-0.5 * gate * gate).exp() / std::f64::consts::TAU.sqrt();
    let second = 1.0 - 2.0 * gate * density / inside;
    let fourth = 3.0 - 2.0 * (gate.powi(3) + 3.0 * gate) * density / inside;
    (second, fourth - second * second)
}

/// Mean of `count` independent non-negative values with known mean and variance each: bounds by the scaled
/// chi-square with the same two moments (exact when the values are χ², an approximation of order 1/count otherwise).
pub fn moment_matched(sum: f64, count: u64, mean: f64, variance: f64, alpha: f64) -> MeanTest {
    let n = count as f64;
    // c·χ²(d) with c·d = n·mean and 2c²·d = n·variance
    let scale = variance / (2.0 * mean);
    let dof = n * mean / scale;
    MeanTest {
        count,
        mean: sum / n,
        expected: mean,
        lower: scale * chi_square_quantile(alpha / 2.0, dof) / n,
        upper: scale * chi_square_quantile(1.0 - alpha / 2.0, dof) / n,
        p_value: two_sided_p(sum / scale, dof),
    }
}

impl MeanTest {
    /// Whether the covariance is too small (optimistic), too large (pessimistic) or neither, at `alpha`.
    pub fn tendency(&self) -> &'static str {
        if self.mean > self.upper {
            "optimistic"
        } else if self.mean < self.lower {
            "pessimistic"
        } else {
            "as predicted"
        }
    }

    /// The test record of a mean NEES.
    pub fn nees(&self, axis: &str) -> Test {
        let ratio = (self.mean / self.expected).sqrt();
        let meaning = match self.tendency() {
            "optimistic" => format!(
                "the filter is optimistic: its errors are {ratio:.3} times as large as its covariance says (P, Q or R \
                 too small, or states missing)"
            ),
            "pessimistic" => format!(
                "the filter is pessimistic: its errors are only {ratio:.3} times as large as its covariance says (P, Q \
                 or R too large)"
            ),
            _ => "the estimation errors are as large as the covariance says".to_string(),
        };
        Test::new(axis, TestKind::Nees, self.mean, [self.lower, self.upper], self.p_value, meaning)
    }

    /// The test record of a mean NIS; `deviation_error` is the standard error of the mean estimated from the data
    /// themselves (their own spread and correlation), `alpha` the level of the effect's interval.
    pub fn nis(&self, axis: &str, deviation_error: f64, alpha: f64) -> Test {
        let deviation = self.mean / self.expected - 1.0;
        let half_width = normal_quantile(1.0 - alpha / 2.0) * deviation_error / self.expected;
        let sigma = 100.0 * ((1.0 + deviation).max(0.0).sqrt() - 1.0).abs();
        let meaning = match self.tendency() {
            "optimistic" => format!(
                "the filter is optimistic: innovations are {sigma:.2} % larger than sqrt(S) says; mostly the white \
                 noise (R) is too small"
            ),
            "pessimistic" => format!(
                "the filter is pessimistic: innovations are {sigma:.2} % smaller than sqrt(S) says; mostly the white \
                 noise (R) is too large"
            ),
            _ => "the innovations are as large as the filter says".to_string(),
        };
        Test::new(axis, TestKind::Nis, self.mean, [self.lower, self.upper], self.p_value, meaning).with_effect(
            Effect::new(
                "relative_nis_deviation",
                deviation,
                [deviation - half_width, deviation + half_width],
                [-NIS_TOLERANCE, NIS_TOLERANCE],
            ),
        )
    }
}
