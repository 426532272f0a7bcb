//! White noise: independent samples of variance N²/dt.
//! Other names: angle or velocity random walk (of the integral), wideband noise, noise density, output noise.

use rand::rngs::ChaCha8Rng;

use super::SamplePath;
use super::second_difference::lag_sum;
use crate::numerics::random::fill_normal;

/// N² at every frequency.
pub(super) fn psd(density: f64) -> f64 {
    density * density
}

/// N²/τ. Source: IEEE Std 952 Annex C.
pub(super) fn allan_variance(density: f64, m: u64, dt: f64) -> f64 {
    density * density / (m as f64 * dt)
}

pub(super) fn autocovariance(density: f64, lag: u64, dt: f64) -> f64 {
    if lag == 0 { density * density / dt } else { 0.0 }
}

/// θ is a random walk, generalised covariance −N² dt |l|/2: the differences of |l| are exact in integers.
pub(super) fn second_difference(density: f64, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
    -0.5 * density * density * dt * lag_sum(m1, m2, h, i128::wrapping_abs)
}

/// N/√dt times independent normal numbers.
pub(super) struct Path {
    scale: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(density: f64, dt: f64, rng: ChaCha8Rng) -> Self {
        Path { scale: density / dt.sqrt(), rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        fill_normal(&mut self.rng, out);
        for y in out {
            *y *= self.scale;
        }
    }
}
