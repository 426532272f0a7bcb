//! The spectrum of a process at many frequencies, again and again: the sines are kept, which are most of the work.

use super::{Filter, Term, gauss_markov};

/// Frequencies, Hz, of samples `dt` s apart, with sine and cosine of π f dt.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    frequency_hz: Vec<f64>,
    dt: f64,
    sin: Vec<f64>,
    cos: Vec<f64>,
    /// With which weight these frequencies add, so many at a time; empty when each stands for itself.
    weights: Vec<f64>,
    every: usize,
}

impl Grid {
    pub fn new(frequency_hz: Vec<f64>, dt: f64) -> Grid {
        let (sin, cos) = frequency_hz.iter().map(|f| (std::f64::consts::PI * f * dt).sin_cos()).unzip();
        Grid { frequency_hz, dt, sin, cos, weights: vec![], every: 1 }
    }

    /// Of a series made of samples `dt` s apart: of `every` of them the mean (`averaged`) or the first. All that the
    /// slower series cannot tell apart adds: with k = `every`, S(f) = Σ_{l<k} S₁(f_l) w_l, f_l = f + l/(k dt); w_l =
    /// [sin(π k f_l dt)/(k sin(π f_l dt))]² for means, else 1.
    ///
    /// `frequency_hz`: above 0, at most 1/(2 k dt).
    pub fn thinned(frequency_hz: &[f64], dt: f64, every: usize, averaged: bool) -> Grid {
        let step = 1.0 / (every as f64 * dt);
        let alias = |f: f64, l: usize| {
            let at = f + l as f64 * step;
            // the sampled spectrum is even and has the period 1/dt
            if at * dt > 0.5 { (1.0 / dt - at).abs() } else { at }
        };
        let all: Vec<f64> = frequency_hz.iter().flat_map(|f| (0..every).map(move |l| alias(*f, l))).collect();
        let weight = |f: &f64| {
            let x = std::f64::consts::PI * f * dt;
            if averaged { ((every as f64 * x).sin() / (every as f64 * x.sin())).powi(2) } else { 1.0 }
        };
        let weights = all.iter().map(weight).collect();
        Grid { weights, every, ..Grid::new(all, dt) }
    }

    /// Of a band limit made of area ratios: ∂ ln S by the logarithm of each, at every frequency, and ∂ ln b₀² by it;
    /// `None` where frequencies add.
    pub(crate) fn shape_slopes(&self, ratios: &[f64]) -> Option<Vec<(Vec<f64>, f64)>> {
        self.weights.is_empty().then(|| Filter::slopes(ratios, &self.sin, &self.cos))
    }
}

impl Term {
    /// [`Term::psd`] at every frequency of the grid.
    pub fn psd_on(&self, grid: &Grid) -> Vec<f64> {
        let all: Vec<f64> = match *self {
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
            Term::BandLimit { density, filter } => {
                let at = |(sin, cos): (&f64, &f64)| density * density * filter.power_gain_at(*sin, *cos);
                grid.sin.iter().zip(&grid.cos).map(at).collect()
            }
            term => grid.frequency_hz.iter().map(|f| term.psd(*f, grid.dt)).collect(),
        };
        if grid.weights.is_empty() {
            return all;
        }
        let parts = all.chunks(grid.every).zip(grid.weights.chunks(grid.every));
        parts.map(|(psd, weight)| psd.iter().zip(weight).map(|(p, w)| p * w).sum()).collect()
    }
}
