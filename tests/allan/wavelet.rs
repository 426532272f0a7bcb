//! Haar wavelet variance: the coefficients themselves, closed forms.

use kfdesign::allan::wavelet;

use super::*;

/// The pyramid of the maximum-overlap transform with the Haar filters ½(1, −1) and ½(1, 1), without the coefficients
/// that the start of the log touches; rounding.
#[test]
fn mean_square_of_the_coefficients() {
    let rate = walk();
    let curve = allan::curve(&rate, 0.01, Deviation::Oadev, TauGrid::Octave).unwrap();
    let levels = wavelet::levels(&curve);
    assert_eq!(levels.len(), 10, "2000 samples hold wavelets of up to 1024");
    let mut smooth = rate.clone();
    for (j, level) in (1..).zip(&levels) {
        let step = 1 << (j - 1);
        let pairs: Vec<(f64, f64)> = (step..smooth.len()).map(|k| (smooth[k], smooth[k - step])).collect();
        let squares: f64 = pairs.iter().map(|(now, before)| (0.5 * (now - before)).powi(2)).sum();
        assert_eq!((level.level, level.samples, level.terms), (j, 2 * step as u64, pairs.len() as u64));
        let expected = squares / pairs.len() as f64;
        assert!((level.variance / expected - 1.0).abs() < 1e-11, "level {j}: {} and {expected}", level.variance);
        assert!(level.lower < level.variance && level.variance < level.upper);
        smooth = pairs.iter().map(|(now, before)| 0.5 * (now + before)).collect();
    }
    let other = allan::curve(&rate, 0.01, Deviation::Mdev, TauGrid::Octave).unwrap();
    assert!(wavelet::levels(&other).is_empty());
}

/// As printed for the method of wavelet moments (Guerrier et al. 2013, table 1; the same in the R package), τ = 2^j
/// samples: white s²/τ; quantisation 6Q²/τ²; first-order autoregression υ²[(φ² − 1)τ + 2φ(φ^τ − 4φ^{τ/2} + 3)]/((φ −
/// 1)³(φ + 1)τ²); random walk γ²(τ² + 2)/(12τ); drift ω²τ²/16.
#[test]
fn closed_forms() {
    let dt = 0.25_f64;
    let rate: Vec<f64> = congruential(16807, 300);
    let curve = allan::curve(&rate, dt, Deviation::Oadev, TauGrid::Octave).unwrap();
    let phi: f64 = (-dt / 3.0_f64).exp();
    let innovation = 0.3 * 0.3 * (1.0 - phi * phi);
    for level in wavelet::levels(&curve) {
        let tau = level.samples as f64;
        let autoregression = innovation
            * ((phi * phi - 1.0) * tau + 2.0 * phi * (phi.powf(tau) - 4.0 * phi.powf(tau / 2.0) + 3.0))
            / ((phi - 1.0).powi(3) * (phi + 1.0) * tau * tau);
        let step = 0.02 * dt.sqrt();
        let forms = [
            (Term::White { density: 0.1 }, 0.01 / dt / tau),
            (Term::Quantization { coefficient: 0.2 }, 6.0 * (0.2 / dt / tau).powi(2)),
            (gauss_markov(0.3, 3.0), autoregression),
            (Term::RateRandomWalk { density: 0.02 }, step * step * (tau * tau + 2.0) / (12.0 * tau)),
            (Term::RateRamp { slope: -0.5 }, (0.5 * dt * tau).powi(2) / 16.0),
        ];
        for (term, expected) in forms {
            let found = wavelet::expected(&model(&[term]), &level, dt);
            // the printed autoregression cancels
            assert!((found / expected - 1.0).abs() < 1e-9, "{term:?}, {tau}: {found} and {expected}");
        }
    }
}
