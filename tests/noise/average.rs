//! The moving average: what other terms have no test for.

use super::*;
use kfdesign::noise::NoiseModel;

/// N²/τ (1 − (q² − 1)/(2qm)) for m ≥ q: white noise less what the average takes; at m = 1 the variance times 1 − 1/q.
#[test]
fn allan_curve_in_closed_form() {
    for samples in [2, 3, 7, 64] {
        let term = Term::MovingAverage { density: 0.0562, samples };
        let q = f64::from(samples);
        for m in [64, 1000, 1_000_000_000_000] {
            let missing = (q * q - 1.0) / (2.0 * q * m as f64);
            let expected = WHITE.allan_variance(m, DT) * (1.0 - missing);
            assert_relative(term.allan_variance(m, DT), expected, 1e-14, &format!("q = {samples}, m = {m}"));
        }
        let (variance, next) = (term.autocovariance(0, DT).unwrap(), term.autocovariance(1, DT).unwrap());
        assert_relative(variance, 0.0562 * 0.0562 / DT / q, 1e-14, "variance");
        assert_relative(
            term.allan_variance(1, DT),
            variance - next,
            1e-14,
            "half the square of neighbours' difference",
        );
        assert_eq!(term.autocovariance(u64::from(samples), DT), Some(0.0));
        assert_eq!(term.psd(0.0, DT), 0.0562 * 0.0562);
        // the first zero
        assert!(term.psd(1.0 / (q * DT), DT) < 1e-30);
        // windows that lie further apart than the average is long share no draw
        assert_eq!(term.second_difference_cross_covariance(10, 20, 20 + i64::from(samples) - 1, DT), 0.0);
        assert_ne!(term.second_difference_cross_covariance(10, 20, 20 + i64::from(samples) - 2, DT), 0.0);
    }
}

#[test]
fn wideband_density_is_that_of_low_frequencies() {
    let model = NoiseModel { terms: vec![WHITE, AVERAGE, GAUSS_MARKOV] };
    assert_eq!(model.white_density(), 0.0562);
    assert_relative(model.wideband_density(), 0.0562 * 2f64.sqrt(), 1e-15, "root of the sum of squares");
}

/// Means over 400 000 samples of y_k y_{k+l}; Bartlett: the variance of such a mean is Σ_j (r_j² + r_{j+l}
/// r_{j−l})/n, 5 standard errors. False alarm 5.7e-7 for each of five lags.
#[test]
fn sample_path_has_the_autocovariance() {
    let n = 400_000;
    let mut y = vec![0.0; n];
    AVERAGE.sample_path(DT, rng(5)).fill(&mut y);
    let r = |lag: i64| AVERAGE.autocovariance(lag.unsigned_abs(), DT).unwrap();
    for lag in 0..5i64 {
        let mean = y.iter().zip(&y[lag as usize..]).map(|(a, b)| a * b).sum::<f64>() / n as f64;
        let variance: f64 = (-6..=6).map(|j| r(j).powi(2) + r(j + lag) * r(j - lag)).sum::<f64>() / n as f64;
        let allowed = 5.0 * variance.sqrt();
        assert!((mean - r(lag)).abs() < allowed, "lag {lag}: {mean:e}, expected {:e} ± {allowed:e}", r(lag));
    }
}

/// The draws before the first sample are there: Var y_0 over 20 000 paths; chi-square, false alarm 1e-6.
#[test]
fn sample_path_starts_in_its_stationary_law() {
    use kfdesign::numerics::distribution::chi_square_quantile;
    let runs = 20_000;
    let mut sum = 0.0;
    for run in 0..runs {
        let mut y = [0.0];
        AVERAGE.sample_path(DT, rng(run)).fill(&mut y);
        sum += y[0] * y[0];
    }
    let ratio = sum / AVERAGE.autocovariance(0, DT).unwrap();
    let dof = runs as f64;
    assert!(
        (chi_square_quantile(5e-7, dof)..chi_square_quantile(1.0 - 5e-7, dof)).contains(&ratio),
        "{ratio} of {dof}"
    );
}
