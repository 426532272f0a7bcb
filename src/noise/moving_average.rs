//! Moving average: white noise that the sensor's own averaging (anti-alias filter) has correlated over neighbouring
//! samples, w_k = (1/q) Σ_{i<q} n_{k−i} with independent n of variance N²/dt, q from 2. At low frequencies it is
//! white noise of density N. Other names: MA(q − 1), boxcar, sinc filter, band limit.

use nalgebra::{DMatrix, RowDVector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::lag_sum;
use super::{Realisation, SamplePath};
use crate::numerics::random::{fill_normal, normal};

/// N² (sin(π f q dt)/(q sin(π f dt)))².
pub(super) fn psd(density: f64, samples: u32, f_hz: f64, dt: f64) -> f64 {
    let angle = std::f64::consts::PI * f_hz * dt;
    let gain = if angle == 0.0 { 1.0 } else { (f64::from(samples) * angle).sin() / (f64::from(samples) * angle.sin()) };
    (density * gain).powi(2)
}

/// N²/dt (q − lag)/q² for lag < q.
pub(super) fn autocovariance(density: f64, samples: u32, lag: u64, dt: f64) -> f64 {
    let q = u64::from(samples);
    density * density / dt * q.saturating_sub(lag) as f64 / (q * q) as f64
}

/// N² dt (…)/(24 q² m² dt²) with the bracket of [`second_difference`]: N²/τ · (1 − (q² − 1)/(2qm)) for m ≥ q.
pub(super) fn allan_variance(density: f64, samples: u32, m: u64, dt: f64) -> f64 {
    second_difference(density, samples, m, m, 0, dt) / (2.0 * (m as f64 * dt).powi(2))
}

/// Generalised covariance of θ: −(N² dt/2q²) Σ_{|d|<q} (q − |d|) |l + d|. The triangle is the second difference over
/// q of (|l|³ − |l|)/6, so that −(N² dt/12q²) [u(l + q) − 2u(l) + u(l − q)], u = |l|³ − |l|, exact in integers and
/// O(1).
pub(super) fn second_difference(density: f64, samples: u32, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
    let q = i128::from(samples);
    let cube = |l: i128| {
        let l = l.wrapping_abs();
        l.wrapping_mul(l).wrapping_mul(l).wrapping_sub(l)
    };
    let triangle = |l: i128| cube(l + q).wrapping_sub(cube(l).wrapping_mul(2)).wrapping_add(cube(l - q));
    -density * density * dt / (12.0 * (q * q) as f64) * lag_sum(m1, m2, h, triangle)
}

/// The last q draws, newest first; the sample is their mean.
pub(super) fn realisation(density: f64, samples: u32, dt: f64) -> Realisation {
    let q = samples as usize;
    let variance = density * density / dt;
    let mut drive = DMatrix::zeros(q, q);
    drive[(0, 0)] = variance;
    Realisation {
        phi: DMatrix::from_fn(q, q, |i, j| if i == j + 1 { 1.0 } else { 0.0 }),
        q: drive,
        p0: DMatrix::identity(q, q) * variance,
        h: RowDVector::from_element(q, 1.0 / f64::from(samples)),
        names: (1..=q).map(|k| if k == 1 { "moving_average".into() } else { format!("moving_average.{k}") }).collect(),
        exact: true,
    }
}

pub(super) struct Path {
    /// The last q draws, each over q, in a ring.
    draws: Vec<f64>,
    oldest: usize,
    scale: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(density: f64, samples: u32, dt: f64, mut rng: ChaCha8Rng) -> Self {
        let mut draws = vec![0.0; samples as usize];
        // the oldest is replaced before the first sample
        fill_normal(&mut rng, &mut draws[1..]);
        let scale = density / dt.sqrt() / f64::from(samples);
        for draw in &mut draws {
            *draw *= scale;
        }
        Path { draws, oldest: 0, scale, rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            self.draws[self.oldest] = self.scale * normal(&mut self.rng);
            self.oldest = (self.oldest + 1) % self.draws.len();
            *y = self.draws.iter().sum();
        }
    }
}
