//! Equivalent degrees of freedom of the family, chi-square intervals.
//!
//! Exact for any Gaussian mixture (all but TOTDEV): the estimate is the mean of J squares of a stationary difference u
//! with mean μ and autocovariance ρ_j, so its mean and variance are known and
//! `edf = 2 mean² / variance = (J(ρ_0 + μ²))² / [J ρ_0² + 2 Σ (J−j) ρ_j² + 2μ² (J ρ_0 + 2 Σ (J−j) ρ_j)]`
//! (Satterthwaite matching; μ is not zero only with a rate ramp). Published approximations: TOTDEV (Riley 2008, NIST SP
//! 1065, table 7), always; MDEV (Greenhall and Riley 2003) as long as only a power law is known.

pub use super::covariance::covariance;
use super::{Deviation, NoiseType, deviation, lag_sum};
use crate::noise::{NoiseModel, Term};
use crate::numerics::distribution::chi_square_quantile;
use crate::numerics::progress::checkpoint;

/// Degrees of freedom of the estimate at averaging factor `m` from `samples` rate samples of period `dt` (s) for this
/// noise mixture. Exact; for TOTDEV by the power law that dominates at this averaging time.
///
/// NaN when no difference fits or the mixture is empty; infinite for a ramp without noise.
pub fn degrees_of_freedom(kind: Deviation, samples: usize, m: u64, dt: f64, model: &NoiseModel) -> f64 {
    let terms = deviation::terms(kind, samples, m);
    if terms == 0 || model.terms.is_empty() {
        return f64::NAN;
    }
    let second = |h: i64| autocovariance(model, m, h, dt);
    let mean = mean_second_difference(model, m, dt);
    let third = |h: i64, m: i64| 2.0 * second(h) - second(h - m) - second(h + m);
    let span = m as i64;
    match kind {
        Deviation::Adev => satterthwaite(terms, mean, &[0, 1, 2], |j| second(j * span)),
        Deviation::Oadev => satterthwaite(terms, mean, &[0, span, 2 * span], second),
        Deviation::Hdev => satterthwaite(terms, 0.0, &[0, 1, 2, 3], |j| third(j * span, span)),
        Deviation::Ohdev => satterthwaite(terms, 0.0, &[0, span, 2 * span, 3 * span], |h| third(h, span)),
        Deviation::Mdev => {
            let sum = |h: i64| moving_sum(&second, h, span);
            satterthwaite(terms, mean * m as f64, &[0, span, 2 * span, 3 * span], sum)
        }
        Deviation::Totdev => power_law_degrees_of_freedom(kind, samples, m, dominating(model, m, dt)),
    }
}

/// Degrees of freedom when the noise at this averaging time is one power law. Exact but for MDEV and TOTDEV, where the
/// published formulas are used. A ramp counts as random walk (the noise below the ramp), unknown noise as white.
pub fn power_law_degrees_of_freedom(kind: Deviation, samples: usize, m: u64, noise: NoiseType) -> f64 {
    match kind {
        Deviation::Mdev if m > 1 => greenhall_riley_modified(samples, m, noise),
        // one second difference in the sum: the overlapping ADEV
        Deviation::Mdev => degrees_of_freedom(Deviation::Oadev, samples, m, 1.0, &unit_model(noise)),
        Deviation::Totdev => total(samples, m, noise),
        _ => degrees_of_freedom(kind, samples, m, 1.0, &unit_model(noise)),
    }
}

/// 95 % interval of a deviation: `[σ √(edf/χ²(0.975)), σ √(edf/χ²(0.025))]` (NIST SP 1065, eq. 45).
///
/// Infinite degrees of freedom give an interval of no width; NaN ones give NaN.
pub fn interval(deviation: f64, edf: f64) -> (f64, f64) {
    if edf == f64::INFINITY {
        return (deviation, deviation);
    }
    let factor = |p: f64| (edf / chi_square_quantile(p, edf)).sqrt();
    (deviation * factor(0.975), deviation * factor(0.025))
}

/// Mean of the variance that [`deviation::variance`] estimates, for this mixture, unit². Exact with three remarks: a
/// random walk, flicker and Gauss-Markov in their sampled forms; TOTDEV is taken as the Allan variance that it
/// approximates (it falls below by up to tau/T × 0.48 for flicker, 0.75 for random walk: NIST SP 1065, table 7).
pub fn expected_variance(kind: Deviation, m: u64, dt: f64, model: &NoiseModel) -> f64 {
    let (span, tau) = (m as i64, m as f64 * dt);
    let second = |h: i64| autocovariance(model, m, h, dt);
    let mean = mean_second_difference(model, m, dt);
    match kind {
        Deviation::Adev | Deviation::Oadev | Deviation::Totdev => model.allan_variance(m, dt),
        Deviation::Mdev => (moving_sum(&second, 0, span) / (m as f64).powi(2) + mean * mean) / (2.0 * tau * tau),
        Deviation::Hdev | Deviation::Ohdev => 2.0 * (second(0) - second(span)) / (6.0 * tau * tau),
    }
}

/// Autocovariance at `lag` of the moving sum over m second differences: `Σ_{|u|<m} (m − |u|) r_{lag+u}`.
fn moving_sum(second: &impl Fn(i64) -> f64, lag: i64, m: i64) -> f64 {
    let kinks = [-2 * m, -m, 0, m, 2 * m].map(|edge| edge - lag);
    lag_sum::sum(-m..=m, &kinks, &[0], |u| (m - u.abs()) as f64 * second(lag + u))
}

/// Which power law the mixture follows around this averaging time: by the local slope of its Allan variance.
pub fn dominating(model: &NoiseModel, m: u64, dt: f64) -> NoiseType {
    let slope = (model.allan_variance(2 * m, dt) / model.allan_variance(m, dt)).log2();
    match slope {
        s if s.is_nan() => NoiseType::Unknown,
        s if s < -1.5 => NoiseType::Quantization,
        s if s < -0.5 => NoiseType::White,
        s if s < 0.5 => NoiseType::Flicker,
        s if s < 1.5 => NoiseType::RandomWalk,
        _ => NoiseType::Ramp,
    }
}

/// Autocovariance of the second difference, the ramp left out: it is a mean, not noise.
fn autocovariance(model: &NoiseModel, m: u64, lag: i64, dt: f64) -> f64 {
    let lag = lag.unsigned_abs();
    random_terms(model).map(|term| term.second_difference_autocovariance(m, lag, dt)).sum()
}

fn random_terms(model: &NoiseModel) -> impl Iterator<Item = &Term> {
    model.terms.iter().filter(|term| !matches!(term, Term::RateRamp { .. }))
}

/// Mean of θ_{k+2m} − 2θ_{k+m} + θ_k: a ramp of slope R gives R m² dt².
fn mean_second_difference(model: &NoiseModel, m: u64, dt: f64) -> f64 {
    let slope: f64 = model.terms.iter().map(|t| if let Term::RateRamp { slope } = t { *slope } else { 0.0 }).sum();
    slope * (m as f64 * dt).powi(2)
}

/// `edf` of the mean of `terms` squares of a stationary Gaussian series with this mean and autocovariance.
fn satterthwaite(terms: u64, mean: f64, kinks: &[i64], autocovariance: impl Fn(i64) -> f64) -> f64 {
    // the sum over the lags of one averaging time takes milliseconds
    checkpoint();
    let count = terms as f64;
    let variance = autocovariance(0);
    let square = mean * mean;
    // half weight at lag 0 and zero weight at the last one: twice the sum is over all signed lags
    let sum = 2.0
        * lag_sum::sum(0..=terms as i64, kinks, &[], |h| {
            let r = autocovariance(h) / variance;
            (count - h as f64) * (r * r + 2.0 * square / variance * r)
        });
    if variance == 0.0 {
        return if mean == 0.0 { f64::NAN } else { f64::INFINITY };
    }
    (count * (1.0 + square / variance)).powi(2) / sum
}

/// A mixture of one term of size one.
fn unit_model(noise: NoiseType) -> NoiseModel {
    let term = match noise {
        NoiseType::Quantization => Term::Quantization { coefficient: 1.0 },
        NoiseType::White | NoiseType::Unknown => Term::White { density: 1.0 },
        NoiseType::Flicker => Term::BiasInstability { coefficient: 1.0 },
        NoiseType::RandomWalk | NoiseType::Ramp => Term::RateRandomWalk { density: 1.0 },
    };
    NoiseModel { terms: vec![term] }
}

/// Modified Allan variance by the generalised autocovariance of Greenhall and Riley 2003 (filter factor F = 1, stride
/// m, second differences): `edf = M s_z(0)² / Σ_{|j|<J} (1 − |j|/M) s_z(j/m)²`, `J = min(M, 3m)`, with
/// `s_z = 6 s_x(t) − 4 s_x(t ± 1) + s_x(t ± 2)`, `s_x = 2 s_w(t) − s_w(t ± 1)`, and s_w per power law.
fn greenhall_riley_modified(samples: usize, m: u64, noise: NoiseType) -> f64 {
    let terms = deviation::terms(Deviation::Mdev, samples, m);
    if terms == 0 {
        return f64::NAN;
    }
    let s_w = |t: f64| {
        let t = t.abs();
        match noise {
            NoiseType::Quantization => -t,
            NoiseType::White | NoiseType::Unknown => t.powi(3),
            NoiseType::Flicker if t == 0.0 => 0.0,
            NoiseType::Flicker => -t.powi(4) * t.ln(),
            NoiseType::RandomWalk | NoiseType::Ramp => -t.powi(5),
        }
    };
    let s_x = |t: f64| 2.0 * s_w(t) - s_w(t - 1.0) - s_w(t + 1.0);
    let s_z = |t: f64| 6.0 * s_x(t) - 4.0 * (s_x(t - 1.0) + s_x(t + 1.0)) + s_x(t - 2.0) + s_x(t + 2.0);
    let span = m as i64;
    let kinks = [0, span, 2 * span, 3 * span];
    let last = (3 * span).min(terms as i64);
    let (count, scale) = (terms as f64, s_z(0.0));
    let sum = 2.0
        * lag_sum::sum(0..=last, &kinks, &[], |j| {
            (1.0 - j as f64 / count) * (s_z(j as f64 / span as f64) / scale).powi(2)
        });
    count / sum
}

/// TOTDEV: `b T/tau − c` (NIST SP 1065, table 7) for white, flicker and random walk, which holds for large m; at
/// small m it is reduced as the exact edf of the overlapping ADEV is. Quantisation has no published value: that of
/// overlapping ADEV.
fn total(samples: usize, m: u64, noise: NoiseType) -> f64 {
    let oadev = |samples: u64, m: u64| {
        power_law_degrees_of_freedom(Deviation::Oadev, usize::try_from(samples).unwrap_or(usize::MAX), m, noise)
    };
    let (b, c) = match noise {
        NoiseType::Quantization => return oadev(samples as u64, m),
        NoiseType::White | NoiseType::Unknown => (1.500, 0.0),
        NoiseType::Flicker => (1.168, 0.222),
        NoiseType::RandomWalk | NoiseType::Ramp => (0.927, 0.358),
    };
    if deviation::terms(Deviation::Totdev, samples, m) == 0 {
        return f64::NAN;
    }
    const LARGE: u64 = 1024;
    let small_m = if m < LARGE { oadev(1000 * m, m) / oadev(1000 * LARGE, LARGE) } else { 1.0 };
    (b * samples as f64 / m as f64 - c) * small_m
}
