//! Covariance of overlapping Allan points against quadratic forms, degrees of freedom and Monte Carlo.

use super::*;

#[test]
fn equals_the_quadratic_forms() {
    let n = 60;
    let mixture = model(&[
        Term::White { density: 0.7 },
        gauss_markov(1.3, 9.0),
        Term::RateRandomWalk { density: 0.2 },
        Term::Quantization { coefficient: 0.5 },
        Term::RateRamp { slope: 0.05 },
    ]);
    let factors = [1, 2, 5, 12, 30];
    let got = edf::covariance(&factors, n, 1.0, &mixture);
    let (covariance, mean) = quadratic_form::samples(&mixture, n, 1.0);
    let forms = factors.map(|m| quadratic_form::form(Deviation::Oadev, n, m as usize));
    for i in 0..factors.len() {
        for j in 0..factors.len() {
            let (a, b) = (&forms[i], &forms[j]);
            let full = 2.0 * (a * &covariance * b * &covariance).trace()
                + 4.0 * (mean.transpose() * a * &covariance * b * &mean)[0];
            assert!((got[(i, j)] / full - 1.0).abs() < 1e-7, "{i} {j}: {} and {full}", got[(i, j)]);
        }
    }
}

/// The diagonal is 2σ⁴/edf, also for a long log where both use few lags; the matrix is positive definite.
#[test]
fn diagonal_is_the_degrees_of_freedom() {
    let (n, dt) = (1_000_000, 0.01);
    let mixture = model(&[
        Term::White { density: 0.0562 },
        gauss_markov(0.02806, 193.93),
        Term::BiasInstability { coefficient: 1e-3 },
    ]);
    let factors = tau::averaging_factors(TauGrid::Log(4), 300_000);
    let matrix = edf::covariance(&factors, n, dt, &mixture);
    for (i, m) in factors.iter().enumerate() {
        let variance = mixture.allan_variance(*m, dt);
        let expected = 2.0 * variance.powi(2) / edf::degrees_of_freedom(Deviation::Oadev, n, *m, dt, &mixture);
        assert!((matrix[(i, i)] / expected - 1.0).abs() < 1e-4, "m = {m}: {} and {expected}", matrix[(i, i)]);
    }
    let scale = matrix.map_diagonal(|v| 1.0 / v.sqrt());
    let correlation = DMatrix::from_diagonal(&scale) * &matrix * DMatrix::from_diagonal(&scale);
    assert!(correlation.clone().symmetric_eigenvalues().min() > 0.0);
    assert!(edf::covariance(&[1, 9], 10, 1.0, &mixture)[(1, 0)].is_nan());
}

/// 2000 simulated logs: every entry within 6 standard errors (estimated from the products themselves), every mean
/// within 5. False alarm below 1e-5: fifteen entries and five means, normal tails 2e-9 and 6e-7 each, widened for
/// skewness.
#[test]
fn monte_carlo() {
    let (n, dt, runs) = (1000, 0.1, 2000);
    let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
    let factors = [1, 5, 25, 100, 300];
    let expected = edf::covariance(&factors, n, dt, &mixture);
    let estimates: Vec<[f64; 5]> = (0..runs)
        .map(|run| {
            let phase = deviation::phase(&path(&mixture, dt, n, 2, run), dt);
            factors.map(|m| deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap().variance)
        })
        .collect();
    let count = runs as f64;
    for i in 0..5 {
        let truth = mixture.allan_variance(factors[i], dt);
        let mean = estimates.iter().map(|e| e[i]).sum::<f64>() / count;
        let error = (expected[(i, i)] / count).sqrt();
        assert!((mean - truth).abs() < 5.0 * error, "mean at m = {}: {mean} and {truth}", factors[i]);
        for j in 0..=i {
            let truth_j = mixture.allan_variance(factors[j], dt);
            let products: Vec<f64> = estimates.iter().map(|e| (e[i] - truth) * (e[j] - truth_j)).collect();
            let mean = products.iter().sum::<f64>() / count;
            let spread = products.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (count - 1.0);
            let z = (mean - expected[(i, j)]) / (spread / count).sqrt();
            assert!(z.abs() < 6.0, "m = {} and {}: z = {z}", factors[i], factors[j]);
        }
    }
}
