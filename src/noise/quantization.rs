//! Quantisation of the integrated angle (or velocity): y_k = (e_k − e_{k−1})/dt with independent e of standard
//! deviation Q.
//!
//! A quantiser of step D rounds with Q = D/√12. The errors are taken as Gaussian, so that the model is exact for a
//! linear filter and its likelihood; a real quantiser's uniform errors have the same covariances. Rounding the
//! *rate* samples themselves is another thing: it adds white noise of variance D²/12 per sample.

use nalgebra::{dmatrix, dvector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::lag_sum;
use super::{Realisation, SamplePath};
use crate::numerics::random::normal;

/// 4 Q² sin²(π f dt)/dt, which tends to (2πf)² Q² dt.
pub(super) fn psd(coefficient: f64, f_hz: f64, dt: f64) -> f64 {
    let s = 2.0 * coefficient * (std::f64::consts::PI * f_hz * dt).sin();
    s * s / dt
}

/// 3Q²/τ². Source: IEEE Std 952 Annex C.
pub(super) fn allan_variance(coefficient: f64, m: u64, dt: f64) -> f64 {
    3.0 * (coefficient / (m as f64 * dt)).powi(2)
}

pub(super) fn autocovariance(coefficient: f64, lag: u64, dt: f64) -> f64 {
    let variance = (coefficient / dt).powi(2);
    match lag {
        0 => 2.0 * variance,
        1 => -variance,
        _ => 0.0,
    }
}

/// θ is white: Q² where lags coincide.
pub(super) fn second_difference(coefficient: f64, m1: u64, m2: u64, h: i64) -> f64 {
    coefficient * coefficient * lag_sum(m1, m2, h, |l| i128::from(l == 0))
}

/// The errors e_k and e_{k−1}.
pub(super) fn realisation(coefficient: f64, dt: f64) -> Realisation {
    let variance = coefficient * coefficient;
    Realisation {
        phi: dmatrix![0.0, 0.0; 1.0, 0.0],
        q: dmatrix![variance, 0.0; 0.0, 0.0],
        p0: dmatrix![variance, 0.0; 0.0, variance],
        h: dvector![1.0 / dt, -1.0 / dt].transpose(),
        names: vec!["quantization".into(), "quantization.previous".into()],
        exact: true,
    }
}

pub(super) struct Path {
    scale: f64,
    previous: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(coefficient: f64, dt: f64, mut rng: ChaCha8Rng) -> Self {
        Path { scale: coefficient / dt, previous: normal(&mut rng), rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            let error = normal(&mut self.rng);
            *y = self.scale * (error - self.previous);
            self.previous = error;
        }
    }
}
