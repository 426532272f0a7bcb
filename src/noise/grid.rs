//! The spectrum of a process at many frequencies, again and again: the sines are kept, which are most of the work.

use super::{Term, gauss_markov};

/// Frequencies, Hz, of samples `dt` s apart, with sine and cosine of π f dt.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    frequency_hz: Vec<f64>,
    dt: f64,
    sin: Vec<f64>,
    cos: Vec<f64>,
}

impl Grid {
    pub fn new(frequency_hz: Vec<f64>, dt: f64) -> Grid {
        let (sin, cos) = frequency_hz.iter().map(|f| (std::f64::consts::PI * f * dt).sin_cos()).unzip();
        Grid { frequency_hz, dt, sin, cos }
    }
}

impl Term {
    /// [`Term::psd`] at every frequency of the grid.
    pub fn psd_on(&self, grid: &Grid) -> Vec<f64> {
        match *self {
            Term::GaussMarkov { std_dev, correlation_time } => {
                let spectrum = gauss_markov::Spectrum::new(std_dev, correlation_time, grid.dt);
                grid.sin.iter().map(|sin| spectrum.at(*sin)).collect()
            }
            Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                let spectrum = gauss_markov::Spectrum::new(std_dev, correlation_time, grid.dt);
                let (s0, c0) = (std::f64::consts::PI * frequency_hz * grid.dt).sin_cos();
                // sines of the sum and of the difference: no digits are lost on the line
                let both = |(s, c): (&f64, &f64)| spectrum.at(s * c0 - c * s0) + spectrum.at(s * c0 + c * s0);
                grid.sin.iter().zip(&grid.cos).map(|at| 0.5 * both(at)).collect()
            }
            term => grid.frequency_hz.iter().map(|f| term.psd(*f, grid.dt)).collect(),
        }
    }
}
