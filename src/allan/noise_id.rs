//! Power-law type of the noise at one averaging time, by the lag-1 autocorrelation (Riley and Greenhall 2004).

use super::NoiseType;
use crate::signal::correlation::autocorrelation;

/// Fewer averages than this say nothing about the type (Riley 2008, NIST SP 1065, section 5.5.6).
const FEWEST_AVERAGES: usize = 30;

/// Power-law exponent α of the rate spectrum S(f) ∝ f^α (white 0, flicker −1, random walk −2, quantisation +2),
/// real-valued: with z the rate averaged over m samples without its linear trend, differenced d times until
/// `δ = r_1/(1 + r_1)` is below 1/4, `α = −2(δ + d)`.
///
/// `phase`: n + 1 points, unit·s. None with fewer than 30 averages or constant ones.
/// Source: Riley and Greenhall 2004, "Power law noise identification using the lag 1 autocorrelation".
pub fn exponent(phase: &[f64], m: usize) -> Option<f64> {
    exponent_of(remove_trend(averages(phase, m)?))
}

/// The type at averaging factor `m` from `phase` (n + 1 points, unit·s).
///
/// α rounded: 0 white, −1 flicker, −2 random walk, 1 or 2 quantisation (both fall as 1/tau in the Allan deviation); a
/// ramp where the mean step between averages is larger than their scatter. Unknown with fewer than 30 averages, constant
/// ones, and beyond α = −2.
pub fn identify(phase: &[f64], m: usize) -> NoiseType {
    let Some(averages) = averages(phase, m) else { return NoiseType::Unknown };
    if is_ramp(&averages) {
        return NoiseType::Ramp;
    }
    match exponent_of(remove_trend(averages)).map(f64::round) {
        Some(1.0 | 2.0) => NoiseType::Quantization,
        Some(0.0) => NoiseType::White,
        Some(-1.0) => NoiseType::Flicker,
        Some(-2.0) => NoiseType::RandomWalk,
        _ => NoiseType::Unknown,
    }
}

/// Adjoining averages over m samples times m dt, at least [`FEWEST_AVERAGES`] of them.
fn averages(phase: &[f64], m: usize) -> Option<Vec<f64>> {
    let points: Vec<f64> = phase.iter().copied().step_by(m.max(1)).collect();
    let averages: Vec<f64> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
    (averages.len() >= FEWEST_AVERAGES).then_some(averages)
}

/// A ramp makes up most of the Allan variance when the mean step squared is above the variance of the steps.
fn is_ramp(averages: &[f64]) -> bool {
    let steps: Vec<f64> = averages.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let count = steps.len() as f64;
    let mean = steps.iter().sum::<f64>() / count;
    let variance = steps.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count;
    mean * mean > variance
}

/// Least-squares line removed.
fn remove_trend(mut series: Vec<f64>) -> Vec<f64> {
    let count = series.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = series.iter().sum::<f64>() / count;
    let moment: f64 = series.iter().enumerate().map(|(k, v)| (k as f64 - middle) * v).sum();
    let slope = moment * 12.0 / (count * (count * count - 1.0));
    for (k, value) in series.iter_mut().enumerate() {
        *value -= mean + slope * (k as f64 - middle);
    }
    series
}

fn exponent_of(mut series: Vec<f64>) -> Option<f64> {
    const MOST_DIFFERENCES: usize = 2;
    for differences in 0..=MOST_DIFFERENCES {
        let r1 = *autocorrelation(&series, 1).get(1)?;
        let delta = r1 / (1.0 + r1);
        if !delta.is_finite() {
            return None;
        }
        if delta < 0.25 || differences == MOST_DIFFERENCES {
            return Some(-2.0 * (delta + differences as f64));
        }
        series = series.windows(2).map(|pair| pair[1] - pair[0]).collect();
    }
    None
}
