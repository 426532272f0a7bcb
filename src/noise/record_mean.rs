//! How far the mean of a log strays from the constant bias.

use nalgebra::Complex;

use super::{NoiseModel, Term};

impl Term {
    /// Variance of the mean of `samples` consecutive samples, unit², T their span.
    ///
    /// N²/T for wideband noise; 2σ²Tc/T·(1 − (Tc/T)(1 − e^(−T/Tc))) for Gauss-Markov, of an oscillation the real
    /// part at 1/Tc − i2πf₀ in place of 1/Tc; 2(Q/T)² for quantisation, the error of an integral over its length. A
    /// random walk, flicker or ramp has no mean; for these it is the variance of the difference between this mean
    /// and that of an equally long next log, twice their Allan variance at T.
    pub fn mean_variance(&self, samples: u64, dt: f64) -> f64 {
        let span = samples as f64 * dt;
        match *self {
            Term::White { density } | Term::MovingAverage { density, .. } | Term::BandLimit { density, .. } => {
                density * density / span
            }
            Term::GaussMarkov { std_dev, correlation_time } => {
                let x = correlation_time / span;
                2.0 * std_dev * std_dev * x * (1.0 + x * (-1.0 / x).exp_m1())
            }
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                let x = Complex::new(span / correlation_time, -std::f64::consts::TAU * frequency_hz * span).inv();
                2.0 * std_dev * std_dev * (x * (x * ((-x.inv()).exp() - 1.0) + 1.0)).re
            }
            Term::Quantization { coefficient } => 2.0 * (coefficient / span).powi(2),
            other => 2.0 * other.allan_variance(samples, dt),
        }
    }
}

impl NoiseModel {
    /// [`Term::mean_variance`] of the sum.
    pub fn mean_variance(&self, samples: u64, dt: f64) -> f64 {
        self.terms.iter().map(|term| term.mean_variance(samples, dt)).sum()
    }
}
