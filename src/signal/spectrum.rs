//! Periodogram and Welch spectrum: two-sided PSD in unit²/Hz, given for 0 ≤ f ≤ 1/(2 dt).
//!
//! White noise of density N shows as N² at every frequency; the integral over −1/(2 dt) … 1/(2 dt) is the variance.

use std::f64::consts::PI;

use realfft::{RealFftPlanner, RealToComplex};
use std::sync::Arc;

use crate::numerics::reduce::mean;

/// A spectrum on the Fourier frequencies of its segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Hz, from 0 to the Nyquist frequency (or the last one below it).
    pub frequency_hz: Vec<f64>,
    /// Two-sided, unit²/Hz.
    pub psd: Vec<f64>,
    /// Number of segments that were averaged (1 for a periodogram).
    pub segments: usize,
}

/// Periodogram of the whole series without its mean: `S(f_k) = (dt/n) |Σ_j (x_j − x̄) e^{−2πijk/n}|²`, `f_k = k/(n dt)`.
///
/// `dt` in s. An empty series gives an empty spectrum. Source: Percival and Walden 1993, eq. 196b.
pub fn periodogram(x: &[f64], dt: f64) -> Spectrum {
    averaged(x, dt, &vec![1.0; x.len()], 1)
}

/// Welch's spectrum: the mean of the periodograms of Hann-windowed half-overlapping segments, each without its own mean.
///
/// `segment`: samples per segment, at most the length (longer is cut to it). Source: Welch 1967.
pub fn welch(x: &[f64], dt: f64, segment: usize) -> Spectrum {
    let segment = segment.clamp(1, x.len().max(1));
    // the periodic Hann window: half-overlapping copies add to a constant
    let window: Vec<f64> = (0..segment).map(|k| (PI * k as f64 / segment as f64).sin().powi(2)).collect();
    let window = if segment == 1 { vec![1.0] } else { window };
    averaged(x, dt, &window, (segment / 2).max(1))
}

fn averaged(x: &[f64], dt: f64, window: &[f64], step: usize) -> Spectrum {
    let length = window.len();
    if x.is_empty() || length == 0 {
        return Spectrum { frequency_hz: Vec::new(), psd: Vec::new(), segments: 0 };
    }
    let forward: Arc<dyn RealToComplex<f64>> = RealFftPlanner::new().plan_fft_forward(length);
    let (mut time, mut frequency) = (forward.make_input_vec(), forward.make_output_vec());
    let mut psd = vec![0.0; frequency.len()];
    let mut segments = 0;
    for part in x.windows(length).step_by(step) {
        let level = mean(part);
        for (t, (v, w)) in time.iter_mut().zip(part.iter().zip(window)) {
            *t = (v - level) * w;
        }
        // fails only on buffers of a wrong length, and these are its own
        if forward.process(&mut time, &mut frequency).is_ok() {
            segments += 1;
            for (sum, bin) in psd.iter_mut().zip(&frequency) {
                *sum += bin.norm_sqr();
            }
        }
    }
    let power: f64 = window.iter().map(|w| w * w).sum();
    let scale = dt / (power * segments as f64);
    for value in &mut psd {
        *value *= scale;
    }
    let frequency_hz = (0..psd.len()).map(|k| k as f64 / (length as f64 * dt)).collect();
    Spectrum { frequency_hz, psd, segments }
}
