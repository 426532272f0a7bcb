//! The oscillation: what other terms have no test for.

use super::*;
use kfdesign::noise::NoiseModel;

#[test]
fn nothing_cancels() {
    for (frequency_hz, correlation_time, m1, m2, h, expected, scale) in vectors::OSCILLATION {
        let term = Term::Oscillation { std_dev: 1.0, frequency_hz, correlation_time };
        let found = term.second_difference_cross_covariance(m1, m2, h, 1.0);
        assert!(
            (found - expected).abs() <= 3e-14 * scale,
            "f0 = {frequency_hz}, Tc = {correlation_time}, m1 = {m1}, m2 = {m2}, h = {h}: {found:e}, expected {expected:e}, \
             off by {:e} of the scale",
            (found - expected) / scale
        );
    }
}

/// σ² e^{−|τ|/Tc} cos(2πf₀τ) as it stands; at frequency zero the Gauss–Markov process.
#[test]
fn is_a_damped_cosine() {
    let (std_dev, frequency_hz, correlation_time) = (0.03, 20.3, 0.5);
    for lag in [0, 1, 2, 5, 37, 400] {
        let tau = lag as f64 * DT;
        let expected =
            (std_dev * std_dev) * (-tau / correlation_time).exp() * (std::f64::consts::TAU * 20.3 * tau).cos();
        let found = LINE.autocovariance(lag, DT).unwrap();
        // the phase of the expected value is rounded: 80 turns at lag 400
        assert!((found - expected).abs() < 1e-12 * std_dev * std_dev, "lag {lag}");
    }
    let slow = Term::GaussMarkov { std_dev, correlation_time };
    let line = |frequency_hz| Term::Oscillation { std_dev, frequency_hz, correlation_time };
    for m in [1, 30, 1000] {
        assert_relative(line(1e-12).allan_variance(m, DT), slow.allan_variance(m, DT), 1e-12, "no frequency");
        assert_relative(line(1e-12).psd(3.0, DT), slow.psd(3.0, DT), 1e-10, "no frequency");
        // an alias has the same samples; its frequency in Hz is rounded to 1e-16
        assert_relative(line(79.7).allan_variance(m, DT), line(20.3).allan_variance(m, DT), 1e-11, "alias");
    }
    assert_relative(
        LINE.psd(20.3, DT),
        std_dev * std_dev * correlation_time,
        1e-3,
        "peak: half the density of both lines",
    );
    assert_eq!(frequency_hz * DT, 0.203);
}

#[test]
fn must_stand_below_half_the_rate() {
    let model = |frequency_hz| NoiseModel {
        terms: vec![WHITE, Term::Oscillation { std_dev: 1.0, frequency_hz, correlation_time: 1.0 }],
    };
    assert!(model(49.99).check_rate(DT).is_ok());
    for frequency_hz in [50.0, 60.0, 1e9] {
        assert!(model(frequency_hz).check_rate(DT).is_err());
    }
    let message = model(60.0).check_rate(DT).unwrap_err().to_string();
    assert!(
        message.contains("60.00 Hz") && message.contains("100.0 Hz") && message.contains("(40.00 Hz)"),
        "{message}"
    );
}

/// Means of y_0 y_k over 20 000 independent paths against the autocovariance r_k: standard error √((r_0² +
/// r_k²)/20000), 5 of them. False alarm 5.7e-7 for each of five lags.
#[test]
fn sample_path_is_stationary_from_the_start() {
    let runs = 20_000;
    let lags = [0, 1, 2, 5, 30];
    let mut sums = [0.0; 5];
    for run in 0..runs {
        let mut y = [0.0; 31];
        LINE.sample_path(DT, rng(run)).fill(&mut y);
        for (sum, lag) in sums.iter_mut().zip(lags) {
            *sum += y[0] * y[lag];
        }
    }
    let r = |lag: usize| LINE.autocovariance(lag as u64, DT).unwrap();
    for (sum, lag) in sums.iter().zip(lags) {
        let deviation = sum / runs as f64 - r(lag);
        let allowed = 5.0 * ((r(0).powi(2) + r(lag).powi(2)) / runs as f64).sqrt();
        assert!(deviation.abs() < allowed, "lag {lag}: off by {deviation}, allowed {allowed}");
    }
}
