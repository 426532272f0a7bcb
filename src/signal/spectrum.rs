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

/// Periodogram of the whole series without its mean: `S(f_k) = (dt/n) |Σ_j (x_j − x̄) e^{−2πijk/n}|²`, `f_k = k/(n
/// dt)`.
///
/// `dt` in s. An empty series gives an empty spectrum. Source: Percival and Walden 1993, eq. 196b.
pub fn periodogram(x: &[f64], dt: f64) -> Spectrum {
    averaged(x, dt, &vec![1.0; x.len()], 1)
}

/// Welch's spectrum: the mean of the periodograms of Hann-windowed half-overlapping segments, each without its own
/// mean.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn walk() -> Vec<f64> {
        let uniform = std::iter::successors(Some(16807_u64), |n| Some(16807 * n % 2_147_483_647));
        uniform
            .take(300)
            .scan(0.0, |sum, n| {
                *sum += n as f64 / 2_147_483_647.0 - 0.5;
                Some(*sum)
            })
            .collect()
    }

    fn agree(spectrum: &Spectrum, expected: &[(usize, f64, f64)]) {
        for &(k, frequency, psd) in expected {
            assert!((spectrum.frequency_hz[k] - frequency).abs() < 1e-12, "{k}");
            assert!((spectrum.psd[k] / psd - 1.0).abs() < 1e-10, "{k}: {} and {psd}", spectrum.psd[k]);
        }
    }

    /// scipy 1.17.1 `signal.periodogram(w, fs=50, detrend="constant", return_onesided=False)`.
    #[test]
    fn periodogram_as_scipy() {
        let spectrum = periodogram(&walk(), 0.02);
        assert_eq!(spectrum.psd.len(), 151);
        agree(
            &spectrum,
            &[
                (1, 1.0 / 6.0, 2.475140404392747),
                (2, 1.0 / 3.0, 6.2029832539123015),
                (10, 10.0 / 6.0, 0.01788743815735703),
                (75, 12.5, 0.0004939888442485517),
                (150, 25.0, 3.356405317310971e-05),
            ],
        );
    }

    /// scipy 1.17.1 `signal.welch(w, fs=50, window="hann", nperseg=…, noverlap=nperseg−nperseg//2, detrend="constant",
    /// return_onesided=False)`.
    #[test]
    fn welch_as_scipy() {
        let even = [
            (0, 0.0, 0.06845368654270981),
            (1, 0.78125, 0.25671221008673883),
            (10, 7.8125, 0.0018545124730537164),
            (32, 25.0, 0.00043429612392283464),
        ];
        agree(&welch(&walk(), 0.02, 64), &even);
        let odd = [
            (0, 0.0, 0.16354610276721612),
            (2, 4.0 / 3.0, 0.08790649009594016),
            (37, 37.0 * 50.0 / 75.0, 0.0003508804526843018),
        ];
        agree(&welch(&walk(), 0.02, 75), &odd);
    }

    /// Parseval: the two-sided PSD times the frequency step sums to the variance.
    #[test]
    fn power_is_the_variance() {
        for n in [299, 300] {
            let x = &walk()[..n];
            let level = mean(x);
            let variance = x.iter().map(|v| (v - level).powi(2)).sum::<f64>() / n as f64;
            let spectrum = periodogram(x, 0.02);
            let step = spectrum.frequency_hz[1];
            let nyquist = usize::from(n % 2 == 0);
            let twice: f64 = spectrum.psd[1..spectrum.psd.len() - nyquist].iter().sum::<f64>() * 2.0;
            let last = if nyquist == 1 { spectrum.psd[spectrum.psd.len() - 1] } else { 0.0 };
            assert!(((twice + last) * step / variance - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn short_series_do_not_fail() {
        assert_eq!(periodogram(&[], 1.0).segments, 0);
        assert_eq!(welch(&[], 1.0, 8).segments, 0);
        assert_eq!(welch(&[1.0, 2.0, 4.0], 1.0, 100).segments, 1);
        assert_eq!(welch(&[1.0, 2.0, 4.0], 1.0, 0).segments, 3);
    }
}
