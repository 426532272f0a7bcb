//! Noise processes: spectrum, Allan variance (sampled form), autocovariance, state-space realisation, exact sample path (floor 1).
//!
//! One file per process. Every coefficient is SI: with u the unit of the quantity (rad/s or m/s²),
//! `density` u/√Hz, `std_dev` u, `correlation_time` s, rate-random-walk `density` u/√s, `coefficient` of flicker u,
//! of quantisation u·s, `slope` u/s.

pub mod bias_instability;
pub mod gauss_markov;
pub mod quantization;
pub mod ramp;
pub mod random_walk;
pub mod white;

use nalgebra::{DMatrix, DVector, RowDVector};
use rand::rngs::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The kinds of term, in the fixed order used everywhere (documents, tables, random streams).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    Quantization,
    White,
    BiasInstability,
    GaussMarkov,
    RateRandomWalk,
    RateRamp,
}

/// One noise process with SI coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    Quantization { coefficient: f64 },
    White { density: f64 },
    BiasInstability { coefficient: f64 },
    GaussMarkov { std_dev: f64, correlation_time: f64 },
    RateRandomWalk { density: f64 },
    RateRamp { slope: f64 },
}

/// Independent processes that add.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoiseModel {
    pub terms: Vec<Term>,
}

/// x_{k+1} = phi x_k + v, v ~ N(0, q); contribution to the sample h x_k; x_0 ~ N(0, p0) (stationary where it exists).
/// `exact` is false for flicker (a chain of Gauss-Markov states).
#[derive(Clone, Debug)]
pub struct Realisation {
    pub phi: DMatrix<f64>,
    pub q: DMatrix<f64>,
    pub p0: DMatrix<f64>,
    pub h: RowDVector<f64>,
    /// State names without axis prefix: "gauss_markov", "gauss_markov.2", "rate_random_walk", …
    pub names: Vec<String>,
    pub exact: bool,
}

/// A generator of consecutive samples of one process.
pub trait SamplePath {
    /// Fill with the next samples (SI); calling twice with n equals once with 2n.
    fn fill(&mut self, out: &mut [f64]);
}

impl Term {
    pub fn kind(&self) -> Kind {
        todo!()
    }
    /// Two-sided PSD of the *sampled* process at f (Hz), unit²/Hz, |f| ≤ 1/(2 dt). 0 for the ramp.
    pub fn psd(&self, f_hz: f64, dt: f64) -> f64 {
        let _ = (f_hz, dt);
        todo!()
    }
    /// Allan variance of the sampled process at averaging factor m (tau = m dt): formulas of the sampled form.
    pub fn allan_variance(&self, m: u64, dt: f64) -> f64 {
        let _ = (m, dt);
        todo!()
    }
    /// Autocovariance at an integer lag; None for non-stationary terms (random walk, ramp, flicker).
    pub fn autocovariance(&self, lag: u64, dt: f64) -> Option<f64> {
        let _ = (lag, dt);
        todo!()
    }
    /// r_h = cov(z_k, z_{k+h}), z_k = θ_{k+2m} − 2θ_{k+m} + θ_k with θ the running sum of samples times dt: what the exact
    /// degrees of freedom need. `r_0 = 2 m² dt² · allan_variance(m)`. Numerically sound for all m, h (no catastrophic cancellation).
    pub fn second_difference_autocovariance(&self, m: u64, h: u64, dt: f64) -> f64 {
        let _ = (m, h, dt);
        todo!()
    }
    /// cov(z^{(m1)}_k, z^{(m2)}_{k+h}) for any signed h: the covariance between two Allan points.
    pub fn second_difference_cross_covariance(&self, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
        let _ = (m1, m2, h, dt);
        todo!()
    }
    /// State-space form for the filter; None for white noise (it is measurement noise, variance density²/dt).
    /// `horizon_s` is used by flicker only: slowest time constant covered.
    pub fn realisation(&self, dt: f64, horizon_s: f64) -> Option<Realisation> {
        let _ = (dt, horizon_s);
        todo!()
    }
    /// Exact discrete path with stationary start.
    pub fn sample_path(&self, dt: f64, rng: ChaCha8Rng) -> Box<dyn SamplePath + Send> {
        let _ = (dt, rng);
        todo!()
    }
}

impl NoiseModel {
    pub fn psd(&self, f_hz: f64, dt: f64) -> f64 {
        self.terms.iter().map(|t| t.psd(f_hz, dt)).sum()
    }
    pub fn allan_variance(&self, m: u64, dt: f64) -> f64 {
        self.terms.iter().map(|t| t.allan_variance(m, dt)).sum()
    }
    /// Total white density (root of the sum of squares), 0 if there is none.
    pub fn white_density(&self) -> f64 {
        self.terms
            .iter()
            .map(|t| if let Term::White { density } = t { density * density } else { 0.0 })
            .sum::<f64>()
            .sqrt()
    }
}

/// Kept so that the signature types are used before the bodies exist.
pub type StateVector = DVector<f64>;
