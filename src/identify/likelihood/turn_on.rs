//! How far the bias moves from one start to the next, from the biases of several logs.

use crate::filter::likelihood::LogLikelihood;
use crate::numerics::distribution::NORMAL_95;
use crate::params::Measured;
use crate::units::Unit;

/// Biases b_i ~ N(μ, σ² + v_i) of independent starts, v_i the variance with which log i gives its bias.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spread {
    pub(super) mean: f64,
    pub(super) mean_sigma: f64,
    pub(super) sigma: f64,
    /// 95 %.
    pub(super) interval: [f64; 2],
}

/// Points of the search over ln σ: a grid, for the likelihood of few logs may have two maxima.
const POINTS: usize = 4000;

/// Restricted maximum likelihood of σ, interval where 2 ln L has fallen by χ²₁(0.95); `None` for fewer than two logs.
///
/// ln L(σ) = −½ [Σ ln(σ² + v_i) + Σ (b_i − μ̂)²/(σ² + v_i) + ln Σ 1/(σ² + v_i)], μ̂ the weighted mean.
/// Source: Patterson & Thompson 1971.
pub(super) fn spread(biases: &[LogLikelihood]) -> Option<Spread> {
    if biases.len() < 2 {
        return None;
    }
    let weighted = |variance: f64| {
        let weights = biases.iter().map(|b| (b.bias, 1.0 / (variance + b.bias_variance)));
        let (sum, of) = weights.fold((0.0, 0.0), |(sum, of), (b, w)| (sum + w, of + w * b));
        (of / sum, 1.0 / sum)
    };
    let likelihood = |sigma: f64| {
        let variance = sigma * sigma;
        let (mean, of_mean) = weighted(variance);
        let one = |b: &LogLikelihood| {
            let v = variance + b.bias_variance;
            v.ln() + (b.bias - mean).powi(2) / v
        };
        -0.5 * (biases.iter().map(one).sum::<f64>() - of_mean.ln())
    };
    let (low, high) =
        biases.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), b| (l.min(b.bias), h.max(b.bias)));
    let least = biases.iter().map(|b| b.bias_variance.sqrt()).fold(f64::INFINITY, f64::min);
    let (from, to) = ((0.01 * least.min(high - low)).ln(), (100.0 * (high - low).max(least)).ln());
    if !(from.is_finite() && to > from) {
        return None;
    }
    let grid: Vec<(f64, f64)> = (0..=POINTS)
        .map(|i| (from + (to - from) * i as f64 / POINTS as f64).exp())
        .map(|sigma| (sigma, likelihood(sigma)))
        .collect();
    let best = grid.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let inside = |point: &&(f64, f64)| 2.0 * (best.1 - point.1) <= NORMAL_95 * NORMAL_95;
    let first = grid.iter().position(|p| inside(&p))?;
    let last = grid.iter().rposition(|p| inside(&p))?;
    let (mean, variance) = weighted(best.0 * best.0);
    // down to the end of the grid: no spread beyond what the logs themselves leave open
    let lower = if first == 0 { 0.0 } else { grid[first].0 };
    Some(Spread { mean, mean_sigma: variance.sqrt(), sigma: best.0, interval: [lower, grid[last].0] })
}

impl Spread {
    /// Mean and spread as documents hold them.
    pub(super) fn measured(&self, display: &Unit) -> (Measured, Option<Measured>) {
        let half = NORMAL_95 * self.mean_sigma;
        let mean = Measured::from_si(self.mean, Some([self.mean - half, self.mean + half]), display.times_time(0));
        (mean, Some(Measured::from_si(self.sigma, Some(self.interval), display.times_time(0))))
    }
}
