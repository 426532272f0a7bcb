//! Noise processes: spectrum, Allan variance (sampled form), autocovariance, state-space realisation, exact sample
//! path (floor 1).
//!
//! One file per process. Every coefficient is SI: with u the unit of the quantity (rad/s or m/s²), `density` u/√Hz,
//! `std_dev` u, `frequency_hz` Hz, `correlation_time` s, rate-random-walk `density` u/√s, `coefficient` of flicker
//! u, of quantisation u·s, `slope` u/s.

mod band_limit;
mod bias_instability;
mod gauss_markov;
mod grid;
mod kind;
mod moving_average;
mod oscillation;
mod quantization;
mod ramp;
mod random_walk;
mod record_mean;
mod second_difference;
mod white;

pub use band_limit::{Filter, FilterError, HIGHEST_ORDER};
pub use grid::Grid;
pub use kind::{Kind, Role};
use nalgebra::{DMatrix, RowDVector};
use rand::rngs::ChaCha8Rng;

use crate::units::digits;

/// Floor of the Allan deviation of flicker over its coefficient B: √(2 ln 2/π) (IEEE Std 952-1997, Annex C).
pub const FLICKER_FLOOR: f64 = 0.664_282_470_267_96;
/// Maximum of the Allan deviation of a Gauss-Markov process over its σ, at τ = 1.892617833 Tc: the maximum of
/// √((2/x)(1 − (3 − 4e^(−x) + e^(−2x))/2x)).
pub const GAUSS_MARKOV_PEAK: f64 = 0.617_364_283_144_44;

/// One noise process with SI coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    Quantization {
        coefficient: f64,
    },
    White {
        density: f64,
    },
    /// `samples` ≥ 2.
    MovingAverage {
        density: f64,
        samples: u32,
    },
    /// White noise of this density behind a filter of gain one at frequency zero.
    BandLimit {
        density: f64,
        filter: Filter,
    },
    Oscillation {
        std_dev: f64,
        frequency_hz: f64,
        correlation_time: f64,
    },
    BiasInstability {
        coefficient: f64,
    },
    GaussMarkov {
        std_dev: f64,
        correlation_time: f64,
    },
    RateRandomWalk {
        density: f64,
    },
    RateRamp {
        slope: f64,
    },
}

/// A line that a log of this rate cannot show where it is.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "oscillation at {} Hz is not below half the sample rate of {} Hz; give the frequency at which it stands in the log \
     ({} Hz), \
     or a higher rate",
    digits(*.frequency_hz), digits(1.0 / .dt), digits((.frequency_hz - (.frequency_hz * .dt).round() / .dt).abs())
)]
pub struct TooFast {
    pub frequency_hz: f64,
    /// s.
    pub dt: f64,
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
        match self {
            Term::Quantization { .. } => Kind::Quantization,
            Term::White { .. } => Kind::White,
            Term::MovingAverage { .. } => Kind::MovingAverage,
            Term::BandLimit { .. } => Kind::BandLimit,
            Term::Oscillation { .. } => Kind::Oscillation,
            Term::BiasInstability { .. } => Kind::BiasInstability,
            Term::GaussMarkov { .. } => Kind::GaussMarkov,
            Term::RateRandomWalk { .. } => Kind::RateRandomWalk,
            Term::RateRamp { .. } => Kind::RateRamp,
        }
    }

    /// Two-sided PSD of the *sampled* process at f (Hz), unit²/Hz, |f| ≤ 1/(2 dt). 0 for the ramp.
    pub fn psd(&self, f_hz: f64, dt: f64) -> f64 {
        match *self {
            Term::Quantization { coefficient } => quantization::psd(coefficient, f_hz, dt),
            Term::White { density } => white::psd(density),
            Term::MovingAverage { density, samples } => moving_average::psd(density, samples, f_hz, dt),
            Term::BandLimit { density, filter } => band_limit::psd(density, &filter, f_hz, dt),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                oscillation::psd(std_dev, frequency_hz, correlation_time, f_hz, dt)
            }
            Term::BiasInstability { coefficient } => bias_instability::psd(coefficient, f_hz, dt),
            Term::GaussMarkov { std_dev, correlation_time } => gauss_markov::psd(std_dev, correlation_time, f_hz, dt),
            Term::RateRandomWalk { density } => random_walk::psd(density, f_hz, dt),
            Term::RateRamp { .. } => 0.0,
        }
    }

    /// Allan variance of the sampled process at averaging factor m ≥ 1 (tau = m dt), unit². For all terms but the
    /// ramp it equals 4 ∫₀^{1/2dt} S(f) sin⁴(πfm dt)/(m² sin²(πf dt)) df with S from [`Term::psd`].
    pub fn allan_variance(&self, m: u64, dt: f64) -> f64 {
        match *self {
            Term::Quantization { coefficient } => quantization::allan_variance(coefficient, m, dt),
            Term::White { density } => white::allan_variance(density, m, dt),
            Term::MovingAverage { density, samples } => moving_average::allan_variance(density, samples, m, dt),
            Term::BandLimit { density, filter } => band_limit::allan_variance(density, &filter, m, dt),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                oscillation::allan_variance(std_dev, frequency_hz, correlation_time, m, dt)
            }
            Term::BiasInstability { coefficient } => bias_instability::allan_variance(coefficient, m),
            Term::GaussMarkov { std_dev, correlation_time } => {
                gauss_markov::allan_variance(std_dev, correlation_time, m, dt)
            }
            Term::RateRandomWalk { density } => random_walk::allan_variance(density, m, dt),
            Term::RateRamp { slope } => ramp::allan_variance(slope, m, dt),
        }
    }

    /// Autocovariance at an integer lag, unit²; None for terms without a stationary one (random walk, ramp, flicker).
    pub fn autocovariance(&self, lag: u64, dt: f64) -> Option<f64> {
        match *self {
            Term::Quantization { coefficient } => Some(quantization::autocovariance(coefficient, lag, dt)),
            Term::White { density } => Some(white::autocovariance(density, lag, dt)),
            Term::MovingAverage { density, samples } => Some(moving_average::autocovariance(density, samples, lag, dt)),
            Term::BandLimit { density, filter } => Some(band_limit::autocovariance(density, &filter, lag, dt)),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                Some(oscillation::autocovariance(std_dev, frequency_hz, correlation_time, lag, dt))
            }
            Term::GaussMarkov { std_dev, correlation_time } => {
                Some(gauss_markov::autocovariance(std_dev, correlation_time, lag, dt))
            }
            Term::BiasInstability { .. } | Term::RateRandomWalk { .. } | Term::RateRamp { .. } => None,
        }
    }

    /// r_h = cov(z_k, z_{k+h}), z_k = θ_{k+2m} − 2θ_{k+m} + θ_k with θ the running sum of samples times dt: what the
    /// exact degrees of freedom need. r_0 = 2 m² dt² · allan_variance(m), except for the ramp: it has no covariance
    /// (0), z_k is the constant slope · m² dt². Error below 1e-10 r_0 for all m, h below 10¹², of an oscillation
    /// with whole turns in m relative to its other r_0.
    pub fn second_difference_autocovariance(&self, m: u64, h: u64, dt: f64) -> f64 {
        self.second_difference_cross_covariance(m, m, h.min(i64::MAX as u64) as i64, dt)
    }

    /// cov(z^{(m1)}_k, z^{(m2)}_{k+h}) for any signed h: the covariance between two Allan points. O(1).
    pub fn second_difference_cross_covariance(&self, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
        match *self {
            Term::Quantization { coefficient } => quantization::second_difference(coefficient, m1, m2, h),
            Term::White { density } => white::second_difference(density, m1, m2, h, dt),
            Term::MovingAverage { density, samples } => {
                moving_average::second_difference(density, samples, m1, m2, h, dt)
            }
            Term::BandLimit { density, filter } => {
                band_limit::second_differences(density, &filter, m1, m2, &[h], dt)[0]
            }
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                oscillation::second_difference([std_dev, frequency_hz, correlation_time], m1, m2, h, dt)
            }
            Term::BiasInstability { coefficient } => bias_instability::second_difference(coefficient, m1, m2, h, dt),
            Term::GaussMarkov { std_dev, correlation_time } => {
                gauss_markov::second_difference(std_dev, correlation_time, m1, m2, h, dt)
            }
            Term::RateRandomWalk { density } => random_walk::second_difference(density, m1, m2, h, dt),
            Term::RateRamp { .. } => 0.0,
        }
    }

    /// [`Term::second_difference_cross_covariance`] at each of these lags.
    pub fn second_difference_cross_covariances(&self, m1: u64, m2: u64, lags: &[i64], dt: f64) -> Vec<f64> {
        match *self {
            Term::GaussMarkov { std_dev, correlation_time } => {
                gauss_markov::second_differences(std_dev, correlation_time, m1, m2, lags, dt)
            }
            Term::BandLimit { density, filter } => band_limit::second_differences(density, &filter, m1, m2, lags, dt),
            term => lags.iter().map(|h| term.second_difference_cross_covariance(m1, m2, *h, dt)).collect(),
        }
    }

    /// State-space form for the filter; None for white noise (it is measurement noise, variance density²/dt).
    /// `horizon_s` is used by flicker only: its Allan variance is right to 1 % up to there.
    pub fn realisation(&self, dt: f64, horizon_s: f64) -> Option<Realisation> {
        match *self {
            Term::Quantization { coefficient } => Some(quantization::realisation(coefficient, dt)),
            Term::White { .. } => None,
            Term::MovingAverage { density, samples } => Some(moving_average::realisation(density, samples, dt)),
            Term::BandLimit { density, filter } => Some(band_limit::realisation(density, &filter, dt)),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                Some(oscillation::realisation(std_dev, frequency_hz, correlation_time, dt))
            }
            Term::BiasInstability { coefficient } => Some(bias_instability::realisation(coefficient, dt, horizon_s)),
            Term::GaussMarkov { std_dev, correlation_time } => {
                Some(gauss_markov::realisation(std_dev, correlation_time, dt))
            }
            Term::RateRandomWalk { density } => Some(random_walk::realisation(density, dt)),
            Term::RateRamp { slope } => Some(ramp::realisation(slope, dt)),
        }
    }

    /// Discrete path, exact in law, with stationary start; the random walk and the ramp start at 0. Flicker is a sum of
    /// Gauss–Markov paths whose Allan variance is right to 1e-3.
    pub fn sample_path(&self, dt: f64, rng: ChaCha8Rng) -> Box<dyn SamplePath + Send> {
        match *self {
            Term::Quantization { coefficient } => Box::new(quantization::Path::new(coefficient, dt, rng)),
            Term::White { density } => Box::new(white::Path::new(density, dt, rng)),
            Term::MovingAverage { density, samples } => Box::new(moving_average::Path::new(density, samples, dt, rng)),
            Term::BandLimit { density, filter } => Box::new(band_limit::Path::new(density, &filter, dt, rng)),
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                Box::new(oscillation::Path::new(std_dev, frequency_hz, correlation_time, dt, rng))
            }
            Term::BiasInstability { coefficient } => Box::new(bias_instability::Path::new(coefficient, rng)),
            Term::GaussMarkov { std_dev, correlation_time } => {
                Box::new(gauss_markov::Path::new(std_dev, correlation_time, dt, rng))
            }
            Term::RateRandomWalk { density } => Box::new(random_walk::Path::new(density, dt, rng)),
            Term::RateRamp { slope } => Box::new(ramp::Path::new(slope, dt)),
        }
    }
}

impl NoiseModel {
    /// Every line is below half the sample rate 1/dt. The sampled forms hold above it too, but a document with a
    /// line up there is most likely in error.
    pub fn check_rate(&self, dt: f64) -> Result<(), TooFast> {
        let fast = self.terms.iter().find_map(|term| match *term {
            Term::Oscillation { frequency_hz, .. } if frequency_hz * dt >= 0.5 => Some(frequency_hz),
            _ => None,
        });
        fast.map_or(Ok(()), |frequency_hz| Err(TooFast { frequency_hz, dt }))
    }
    /// The terms that count samples, "moving_average over 2 samples and quantization": at another sample rate each
    /// is another process, and all others are the same. None if there is none.
    pub fn of_samples(&self) -> Option<String> {
        let counted: Vec<String> = self
            .terms
            .iter()
            .filter_map(|term| match term {
                Term::MovingAverage { samples, .. } => Some(format!("moving_average over {samples} samples")),
                Term::BandLimit { .. } => Some("band_limit".into()),
                Term::Quantization { .. } => Some("quantization".into()),
                _ => None,
            })
            .collect();
        (!counted.is_empty()).then(|| counted.join(" and "))
    }
    pub fn psd(&self, f_hz: f64, dt: f64) -> f64 {
        self.terms.iter().map(|t| t.psd(f_hz, dt)).sum()
    }
    pub fn allan_variance(&self, m: u64, dt: f64) -> f64 {
        self.terms.iter().map(|t| t.allan_variance(m, dt)).sum()
    }
    /// Root of the density at low frequencies of all that is white there: white noise, moving averages and band limits.
    pub fn wideband_density(&self) -> f64 {
        let square = |term: &Term| match *term {
            Term::White { density } | Term::MovingAverage { density, .. } | Term::BandLimit { density, .. } => {
                density * density
            }
            _ => 0.0,
        };
        self.terms.iter().map(square).sum::<f64>().sqrt()
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
