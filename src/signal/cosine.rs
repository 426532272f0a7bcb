//! Discrete cosine transform of a log, on which noise spectra show without leakage.
//!
//! c_j = √(2/n) Σ_k x_k cos(π j (k + ½)/n), j = 1 … n − 1 (DCT-II, orthonormal; j = 0, the mean, is left out), at
//! frequency f_j = j/(2 n dt). The transform reflects the series at its ends, so that a start and an end at
//! different levels are no jump. For white noise and for a random walk of unknown start the coefficients are exactly
//! independent with variance S(f_j)/dt, S the sampled spectrum: the vectors are the eigenvectors of the
//! second-difference matrix with free ends. For a Gauss-Markov process this is true but for terms of relative order
//! Tc/T. Sources: Ahmed, Natarajan & Rao 1974; Strang 1999 (The discrete cosine transform, section 2); fast
//! algorithm: Makhoul 1980.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use rayon::prelude::*;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

use super::fourier::{Roots, Spectrum};

/// Columns of a spectrum taken at once.
const BLOCK: usize = 8;

/// The coefficients c_1 … c_{n−1}; empty for fewer than two samples. Same unit as `x`.
pub fn cosine_transform(x: &[f64]) -> Vec<f64> {
    let n = x.len();
    if n < 2 {
        return Vec::new();
    }
    // the constant part only costs digits
    let level = crate::numerics::reduce::mean(x);
    // even samples, then odd ones backwards
    let entering = |k: usize| if 2 * k < n { x[2 * k] - level } else { x[2 * (n - k) - 1] - level };
    let found = if n.is_multiple_of(2) { of_even(n, entering) } else { of_odd(n, entering) };
    found.unwrap_or_else(|| by_plan(n, entering))
}

/// Two real numbers as one complex one: V_k = E_k + e^{−2πik/n} O_k of the transforms of the even and of the odd ones.
fn of_even(n: usize, entering: impl Fn(usize) -> f64 + Sync) -> Option<Vec<f64>> {
    let m = n / 2;
    let spectrum = Spectrum::new(m, |k| Complex::new(entering(2 * k), entering(2 * k + 1)))?;
    let roots = Roots::new(4 * n);
    let (a, b) = spectrum.shape();
    let fine: Vec<[Complex<f64>; 2]> = (0..a).map(|r| [roots.at(r), roots.at(4 * r)]).collect();
    let scale = (2.0 / n as f64).sqrt();
    // c_k of k below m, c_m, c_{n−k}
    let mut out = vec![0.0; n + 1];
    let (low, high) = out.split_at_mut(m);
    let (middle, high) = high.split_first_mut()?;
    let places = low.par_chunks_mut(a * BLOCK).zip(high.par_rchunks_mut(a * BLOCK)).enumerate();
    places.for_each(|(i, (low, high))| {
        let columns = i * BLOCK..(i * BLOCK + BLOCK).min(b);
        let turns = |c: usize| [roots.at(a * c), roots.at(4 * a * c)];
        let coarse: Vec<[Complex<f64>; 2]> = columns.clone().map(turns).collect();
        let first = columns.start;
        spectrum.pairs(columns, |c, r, here, mirror| {
            let ([quarter, whole], [near, far]) = (coarse[c - first], fine[r]);
            let (even, odd) = (here + mirror.conj(), here - mirror.conj());
            let v = (even + whole * far * Complex::new(odd.im, -odd.re)) * (quarter * near) * 0.5;
            let place = (c - first) * a + r;
            low[place] = scale * v.re;
            high[high.len() - 1 - place] = -scale * v.im;
        });
    });
    let first = spectrum.first();
    *middle = scale * FRAC_1_SQRT_2 * (first.re - first.im);
    out.truncate(n);
    out.remove(0);
    Some(out)
}

/// V_{n−k} is the conjugate of V_k.
fn of_odd(n: usize, entering: impl Fn(usize) -> f64 + Sync) -> Option<Vec<f64>> {
    let spectrum = Spectrum::new(n, |k| Complex::new(entering(k), 0.0))?;
    let roots = Roots::new(4 * n);
    let (a, b) = spectrum.shape();
    let fine: Vec<Complex<f64>> = (0..a).map(|r| roots.at(r)).collect();
    let scale = (2.0 / n as f64).sqrt();
    let mut out = vec![0.0; n];
    out.par_chunks_mut(a * BLOCK).enumerate().for_each(|(i, out)| {
        let columns = i * BLOCK..(i * BLOCK + BLOCK).min(b);
        let coarse: Vec<Complex<f64>> = columns.clone().map(|c| roots.at(a * c)).collect();
        let first = columns.start;
        spectrum.pairs(columns, |c, r, here, _| {
            out[(c - first) * a + r] = scale * (here * (coarse[c - first] * fine[r])).re;
        });
    });
    out.remove(0);
    Some(out)
}

/// The way back: x_k = √(2/n) Σ_j c_j cos(π j (k + ½)/n), j = 1 … n − 1, the series without its mean. By one plan
/// for many series of n samples.
pub struct Inverse {
    samples: usize,
    plan: std::sync::Arc<dyn realfft::ComplexToReal<f64>>,
    /// e^{iπj/2n}/√(2n).
    turns: Vec<Complex<f64>>,
}

impl Inverse {
    pub fn new(samples: usize) -> Inverse {
        let n = samples.max(1);
        let scale = (0.5 / n as f64).sqrt();
        let turn = |j: usize| Complex::from_polar(scale, PI * j as f64 / (2 * n) as f64);
        Inverse { samples: n, plan: RealFftPlanner::new().plan_fft_inverse(n), turns: (0..=n / 2).map(turn).collect() }
    }

    /// Of n − 1 coefficients; empty for another number of them.
    pub fn series(&self, coefficients: &[f64]) -> Vec<f64> {
        let n = self.samples;
        let (mut frequency, mut time) = (self.plan.make_input_vec(), self.plan.make_output_vec());
        if coefficients.len() + 1 != n || n < 2 {
            return Vec::new();
        }
        // V_j = e^{iπj/2n} (c_j − i c_{n−j}), as the transform has it
        for (j, (bin, turn)) in frequency.iter_mut().zip(&self.turns).enumerate().skip(1) {
            *bin = turn * Complex::new(coefficients[j - 1], -coefficients[n - j - 1]);
        }
        if n.is_multiple_of(2) {
            frequency[n / 2].im = 0.0;
        }
        // fails only on buffers of a wrong length, and these are its own
        if self.plan.process(&mut frequency, &mut time).is_err() {
            return Vec::new();
        }
        (0..n).map(|k| if k % 2 == 0 { time[k / 2] } else { time[n - 1 - k / 2] }).collect()
    }
}

fn by_plan(n: usize, entering: impl Fn(usize) -> f64) -> Vec<f64> {
    let forward = RealFftPlanner::new().plan_fft_forward(n);
    let (mut time, mut frequency) = (forward.make_input_vec(), forward.make_output_vec());
    time.iter_mut().enumerate().for_each(|(k, v)| *v = entering(k));
    // fails only on buffers of a wrong length, and these are its own
    if forward.process(&mut time, &mut frequency).is_err() {
        return Vec::new();
    }
    let scale = (2.0 / n as f64).sqrt();
    let mut out = vec![0.0; n - 1];
    for (j, bin) in frequency.iter().enumerate().skip(1) {
        let (sin, cos) = (PI * j as f64 / (2 * n) as f64).sin_cos();
        // real part of e^{−iπj/2n} V_j; its imaginary part is the coefficient n − j
        out[j - 1] = scale * (cos * bin.re + sin * bin.im);
        out[n - j - 1] = -scale * (cos * bin.im - sin * bin.re);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(n: usize) -> Vec<f64> {
        (0..n).map(|k| ((k * k) as f64 * 0.37).sin() + 0.01 * k as f64).collect()
    }

    /// Even, odd, prime lengths against the defining sum; rounding of n terms of size 1.
    #[test]
    fn is_the_defining_sum() {
        for n in [2, 3, 8, 9, 31, 100] {
            let x = series(n);
            let fast = cosine_transform(&x);
            assert_eq!(fast.len(), n - 1);
            for (j, c) in (1..).zip(&fast) {
                let sum: f64 =
                    x.iter().enumerate().map(|(k, x)| x * (PI * j as f64 * (k as f64 + 0.5) / n as f64).cos()).sum();
                let slow = (2.0 / n as f64).sqrt() * sum;
                assert!((c - slow).abs() < 1e-12 * n as f64, "{n}, {j}: {c} and {slow}");
            }
        }
    }

    /// Long series are transformed in parts; by one plan the same: coefficients are of size one, rounding of log n
    /// additions.
    #[test]
    fn parts_are_the_whole() {
        for n in [16_384, 18_000, 2 * 8209, 2 * 9001, 9001, 10_007, 10_125] {
            let x = series(n);
            let level = crate::numerics::reduce::mean(&x);
            let plain = by_plan(n, |k| if 2 * k < n { x[2 * k] - level } else { x[2 * (n - k) - 1] - level });
            let fast = cosine_transform(&x);
            assert_eq!(fast.len(), n - 1);
            let largest = plain.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
            for (j, (c, slow)) in fast.iter().zip(&plain).enumerate() {
                assert!((c - slow).abs() < 1e-14 * largest, "{n}, {j}: {c} and {slow}");
            }
        }
    }

    /// Orthonormal: the sum of squares is that of the series about its mean.
    #[test]
    fn keeps_the_variance() {
        let x = series(1000);
        let level = x.iter().sum::<f64>() / 1000.0;
        let expected: f64 = x.iter().map(|x| (x - level).powi(2)).sum();
        let found: f64 = cosine_transform(&x).iter().map(|c| c * c).sum();
        assert!((found / expected - 1.0).abs() < 1e-12);
    }

    /// There and back: the series about its mean.
    #[test]
    fn inverse_gives_the_series_back() {
        for n in [2, 3, 8, 9, 31, 100, 16_384] {
            let x = series(n);
            let level = x.iter().sum::<f64>() / n as f64;
            let back = Inverse::new(n).series(&cosine_transform(&x));
            assert_eq!(back.len(), n);
            let apart = x.iter().zip(&back).map(|(x, b)| (x - level - b).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-12 * (1.0 + n as f64 * 0.01), "{n}: {apart}");
        }
    }

    #[test]
    fn of_nothing_is_nothing() {
        assert!(cosine_transform(&[]).is_empty() && cosine_transform(&[1.0]).is_empty());
    }
}
