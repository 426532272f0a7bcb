//! Rate random walk: y_{k+1} = y_k + K √dt n_k, starting at 0.

use nalgebra::{dmatrix, dvector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::lag_sum;
use super::{Realisation, SamplePath};
use crate::numerics::random::normal;

/// K² dt² / (4 sin²(π f dt)), which tends to K²/(2πf)².
pub(super) fn psd(density: f64, f_hz: f64, dt: f64) -> f64 {
    let s = 2.0 * (std::f64::consts::PI * f_hz * dt).sin();
    (density * dt / s).powi(2)
}

/// K² dt (2m² + 1)/(6m): the continuous K²τ/3 times 1 + 1/(2m²).
pub(super) fn allan_variance(density: f64, m: u64, dt: f64) -> f64 {
    let m = m as f64;
    density * density * dt * (m / 3.0 + 1.0 / (6.0 * m))
}

/// Generalised covariance of θ: K² dt³ (|l|³ − |l|)/12, exact in integers.
pub(super) fn second_difference(density: f64, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
    let sum = lag_sum(m1, m2, h, |l| {
        let l = l.wrapping_abs();
        l.wrapping_mul(l).wrapping_mul(l).wrapping_sub(l)
    });
    density * density * dt.powi(3) / 12.0 * sum
}

/// One state that starts at 0; where it starts in truth is the turn-on bias.
pub(super) fn realisation(density: f64, dt: f64) -> Realisation {
    Realisation {
        phi: dmatrix![1.0],
        q: dmatrix![density * density * dt],
        p0: dmatrix![0.0],
        h: dvector![1.0].transpose(),
        names: vec!["rate_random_walk".into()],
        exact: true,
    }
}

pub(super) struct Path {
    value: f64,
    step: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(density: f64, dt: f64, rng: ChaCha8Rng) -> Self {
        Path { value: 0.0, step: density * dt.sqrt(), rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = self.value;
            self.value += self.step * normal(&mut self.rng);
        }
    }
}
