//! Autocovariance and autocorrelation of a series, directly for few lags and by FFT for many.
//!
//! The estimator is the usual one of time-series analysis, divided by n at every lag (Box, Jenkins and Reinsel 2008,
//! eq. 2.1.11): it is biased towards zero at long lags but positive semidefinite.

use realfft::RealFftPlanner;

use crate::numerics::reduce::mean;

/// Lags 0 … `max_lag` of the sample autocovariance `c_h = (1/n) Σ_{k=0}^{n−1−h} (x_k − x̄)(x_{k+h} − x̄)`, unit² of
/// `x`.
///
/// Lags at or beyond the length are 0; an empty series gives an empty vector; a NaN anywhere gives NaN everywhere.
pub fn autocovariance(x: &[f64], max_lag: usize) -> Vec<f64> {
    if x.is_empty() {
        return Vec::new();
    }
    let mean = mean(x);
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let lags = max_lag.min(x.len() - 1);
    let mut c = if direct_is_cheaper(x.len(), lags) { direct(&centred, lags) } else { by_fft(&centred, lags) };
    c.resize(max_lag + 1, 0.0);
    c
}

/// Lags 0 … `max_lag` of the sample autocorrelation `r_h = c_h / c_0` (so `r_0 = 1`).
///
/// A constant series has no autocorrelation: every lag is NaN.
pub fn autocorrelation(x: &[f64], max_lag: usize) -> Vec<f64> {
    let mut r = autocovariance(x, max_lag);
    let variance = r.first().copied().unwrap_or(f64::NAN);
    let scale = if variance > 0.0 { 1.0 / variance } else { f64::NAN };
    for value in &mut r {
        *value *= scale;
    }
    if let Some(first) = r.first_mut().filter(|_| variance > 0.0) {
        *first = 1.0;
    }
    r
}

/// Lags 0 … `max_lag` of the sums Σ_k a_{k+h} b_k, without a mean taken off; 0 where nothing overlaps. `a` and `b`
/// have the same length.
pub fn lagged_products(a: &[f64], b: &[f64], max_lag: usize) -> Vec<f64> {
    let lags = max_lag.min(a.len().saturating_sub(1));
    let direct = |h: usize| a.get(h..).unwrap_or_default().iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let length = fast_length(a.len() + lags);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let transform = |x: &[f64]| {
        let (mut time, mut frequency) = (forward.make_input_vec(), forward.make_output_vec());
        time[..x.len()].copy_from_slice(x);
        forward.process(&mut time, &mut frequency).ok().map(|()| frequency)
    };
    let by_fft = || {
        let (mut product, other) = (transform(a)?, transform(b)?);
        product.iter_mut().zip(&other).for_each(|(a, b)| *a *= b.conj());
        let mut time = inverse.make_output_vec();
        inverse.process(&mut product, &mut time).ok()?;
        Some(time[..=lags].iter().map(|sum| sum / length as f64).collect::<Vec<f64>>())
    };
    let cheap = a.len() < 2 || direct_is_cheaper(a.len(), lags);
    // the transforms only fail on buffers of a wrong length, which cannot be here
    let fast = if cheap { None } else { by_fft() };
    let mut sums = fast.unwrap_or_else(|| (0..=lags).map(direct).collect());
    sums.resize(max_lag + 1, 0.0);
    sums
}

/// The FFT costs about as much as this many lags done directly.
fn direct_is_cheaper(n: usize, lags: usize) -> bool {
    let stages = (2 * n).ilog2() as usize;
    lags < 4 * stages
}

fn direct(centred: &[f64], lags: usize) -> Vec<f64> {
    let n = centred.len() as f64;
    (0..=lags)
        .map(|h| {
            let later = centred.get(h..).unwrap_or_default();
            centred.iter().zip(later).map(|(a, b)| a * b).sum::<f64>() / n
        })
        .collect()
}

/// Zero-padded to at least n + lags so that the circular correlation does not wrap.
fn by_fft(centred: &[f64], lags: usize) -> Vec<f64> {
    let length = fast_length(centred.len() + lags);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let mut time = forward.make_input_vec();
    time[..centred.len()].copy_from_slice(centred);
    let mut frequency = forward.make_output_vec();
    // both calls only fail on buffers of a wrong length or a complex first bin; neither can be here
    if forward.process(&mut time, &mut frequency).is_err() {
        return direct(centred, lags);
    }
    for bin in &mut frequency {
        *bin = bin.norm_sqr().into();
    }
    if inverse.process(&mut frequency, &mut time).is_err() {
        return direct(centred, lags);
    }
    let scale = 1.0 / (length as f64 * centred.len() as f64);
    time.truncate(lags + 1);
    for value in &mut time {
        *value *= scale;
    }
    time
}

/// The smallest even length of the form 2^a 3^b that is not below `at_least`: fast in any FFT.
fn fast_length(at_least: usize) -> usize {
    let mut best = at_least.next_power_of_two().max(2);
    let mut three = 3;
    while three < best {
        let mut candidate = 2 * three;
        while candidate < at_least {
            candidate *= 2;
        }
        best = best.min(candidate);
        three *= 3;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(n: usize) -> Vec<f64> {
        (0..n).map(|k| ((k * k) as f64 * 0.37).sin() + 0.2 * (k as f64 * 0.01).cos()).collect()
    }

    #[test]
    fn both_ways_agree() {
        for n in [2, 3, 17, 1000, 4097] {
            let x = series(n);
            let lags = n - 1;
            for (a, b) in direct(&x, lags).iter().zip(by_fft(&x, lags)) {
                assert!((a - b).abs() < 1e-13, "n = {n}: {a} and {b}");
            }
        }
    }

    #[test]
    fn products_at_lags_are_sums_of_products() {
        for n in [1, 2, 100, 3000] {
            let (a, b) = (series(n), series(n + 7)[7..].to_vec());
            let lags = n / 2;
            let found = lagged_products(&a, &b, lags + 1);
            for (h, found) in found.iter().enumerate() {
                let sum: f64 = (h..n).map(|k| a[k] * b[k - h]).sum();
                assert!((found - sum).abs() < 1e-10, "n = {n}, lag {h}: {found} and {sum}");
            }
        }
    }

    /// 300 steps of a random walk from the congruential generator of NIST SP 1065.
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

    /// statsmodels 0.15.0: `acovf(w, adjusted=False, fft=False, nlag=4)`, `acf(w, adjusted=False, fft=False,
    /// nlags=200)`.
    #[test]
    fn independent_values() {
        let w = walk();
        let expected =
            [3.367182141361066, 3.3183977027916622, 3.268332092872426, 3.225967184928152, 3.1806259312352263];
        for (ours, theirs) in autocovariance(&w, 4).iter().zip(expected) {
            assert!((ours / theirs - 1.0).abs() < 1e-12, "{ours} and {theirs}");
        }
        let r = autocorrelation(&w, 200);
        for (lag, theirs) in [
            (0, 1.0),
            (1, 0.9855117910106032),
            (2, 0.9706430943326745),
            (50, 0.058449710566269276),
            (200, -0.23061208761050192),
        ] {
            assert!((r[lag] - theirs).abs() < 1e-12, "lag {lag}: {} and {theirs}", r[lag]);
        }
    }

    #[test]
    fn empty_constant_and_short_series() {
        assert!(autocovariance(&[], 3).is_empty());
        assert!(autocorrelation(&[2.0; 10], 3).iter().all(|r| r.is_nan()));
        assert_eq!(autocovariance(&[1.0, 3.0], 4), [1.0, -0.5, 0.0, 0.0, 0.0]);
        assert!(autocovariance(&[1.0, f64::NAN, 2.0], 2).iter().all(|c| c.is_nan()));
    }

    #[test]
    fn fast_lengths_have_only_factors_two_and_three() {
        for n in 1..5000_usize {
            let mut m = fast_length(n);
            assert!(m >= n && m.is_multiple_of(2) && m < 2 * n.max(2), "{n} gives {m}");
            for p in [2, 3] {
                while m.is_multiple_of(p) {
                    m /= p;
                }
            }
            assert_eq!(m, 1);
        }
    }
}
