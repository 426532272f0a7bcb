//! Predict, update, gaps, definiteness.

use kfdesign::filter::Kalman;
use kfdesign::model::LinearModel;
use kfdesign::numerics::linalg::{asymmetry, cholesky, mahalanobis, relative_to_diagonal, symmetric_eigenvalues};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{bias_and_drift, model};

#[test]
fn scalar_steps_follow_the_textbook_recursion() {
    // P0 = 4, R = 1: S = 5, K = 0.8, P = 0.8; then F = 0.5, Q = 1: P = 1.2, S = 2.2, K = 6/11, P = 6/11.
    let mut kalman = Kalman::new(&model(&[&[0.5]], &[1.0], &[&[1.0]], 1.0, &[1.0], &[&[4.0]]));
    let first = kalman.update(0, 3.0, None);
    assert_eq!((first.innovation, first.variance, first.nis), (2.0, 5.0, 0.8));
    assert!((first.log_likelihood() + 0.5 * ((std::f64::consts::TAU * 5.0).ln() + 0.8)).abs() < 1e-15);
    assert!((kalman.x[0] - 2.6).abs() < 1e-15 && (kalman.p[(0, 0)] - 0.8).abs() < 1e-15);
    kalman.predict();
    assert!((kalman.x[0] - 1.3).abs() < 1e-15 && (kalman.p[(0, 0)] - 1.2).abs() < 1e-15);
    let second = kalman.update(0, 1.3, None);
    assert!(second.innovation.abs() < 1e-15);
    assert!((kalman.p[(0, 0)] - 6.0 / 11.0).abs() < 1e-15);
}

#[test]
fn a_gap_equals_that_many_predictions() {
    let model = model(
        &[&[1.0, -0.01, 0.0], &[0.0, 0.99994, 0.1], &[0.0, -0.1, 0.9]],
        &[1.0, 0.0, 1.0],
        &[&[1e-3, 1e-5, 0.0], &[1e-5, 1e-6, 0.0], &[0.0, 0.0, 1e-2]],
        0.3,
        &[1.0, -2.0, 0.5],
        &[&[1.0, 0.1, 0.0], &[0.1, 2.0, 0.0], &[0.0, 0.0, 0.1]],
    );
    for n in [0_u64, 1, 2, 3, 7, 64, 1000, 12345] {
        let (mut one_by_one, mut at_once) = (Kalman::new(&model), Kalman::new(&model));
        (0..n).for_each(|_| one_by_one.predict());
        at_once.predict_many(n);
        let scale = one_by_one.p.diagonal();
        for i in 0..3 {
            let size = one_by_one.x.amax();
            assert!((one_by_one.x[i] - at_once.x[i]).abs() <= 1e-12 * size, "x, n = {n}");
            for j in 0..3 {
                let difference = (one_by_one.p[(i, j)] - at_once.p[(i, j)]).abs();
                assert!(difference <= 1e-12 * (scale[i] * scale[j]).sqrt(), "P, n = {n}: {difference:e}");
            }
        }
        assert_eq!(asymmetry(&at_once.p), 0.0);
    }
}

#[test]
fn a_century_of_silence_keeps_the_closed_form() {
    // P(n) = a^2n P0 + q (1 − a^2n)/(1 − a²) with 1 − a = 2^-40: only the distance from one carries the digits.
    let distance = 2.0_f64.powi(-40);
    let (q, p0) = (1e-6, 3.0);
    let model = model(&[&[1.0 - distance]], &[1.0], &[&[q]], 1.0, &[1.0], &[&[p0]]);
    for n in [1_000_000_u64, 300_000_000_000, 3_000_000_000_000_000] {
        let mut kalman = Kalman::new(&model);
        kalman.predict_many(n);
        let log_a = (-distance).ln_1p();
        let decay = (2.0 * n as f64 * log_a).exp_m1();
        let expected = p0 * (1.0 + decay) - q * decay / (distance * (2.0 - distance));
        assert!((kalman.p[(0, 0)] / expected - 1.0).abs() < 1e-13, "n = {n}: {} {expected}", kalman.p[(0, 0)]);
        assert!((kalman.x[0] - (n as f64 * log_a).exp()).abs() < 1e-13);
    }
}

#[test]
fn a_gated_or_missing_measurement_changes_nothing() {
    let mut kalman = Kalman::new(&bias_and_drift());
    let before = kalman.clone();
    for (z, gate) in [(f64::NAN, None), (f64::INFINITY, None), (10.0, Some(3.0)), (1e300, None)] {
        let update = kalman.update(0, z, gate);
        assert!(!update.accepted, "z = {z}");
        assert_eq!((&kalman.x, &kalman.p), (&before.x, &before.p));
    }
    // |ν| just outside and just inside three sigma: √S = √(1.0009 + 0.315844).
    assert!(!kalman.update(0, 3.0 * 1.316744_f64.sqrt() * 1.0001, Some(3.0)).accepted);
    assert!(kalman.update(0, 3.0 * 1.316744_f64.sqrt() * 0.9999, Some(3.0)).accepted);
}

/// Smallest eigenvalue of P scaled to unit diagonal; symmetric exactly.
fn smallest_scaled_eigenvalue(p: &DMatrix<f64>) -> f64 {
    assert_eq!(asymmetry(p), 0.0);
    let d = p.diagonal().map(f64::sqrt);
    symmetric_eigenvalues(&DMatrix::from_fn(p.nrows(), p.ncols(), |i, j| p[(i, j)] / (d[i] * d[j])))[0]
}

/// So many steps with a measurement each, then as many without: the smallest scaled eigenvalue of P met in each part.
/// A constant bias beside the drift is the worst case: its variance falls like 1/t for ever.
fn smallest_eigenvalues(steps: u32) -> [f64; 2] {
    let mut kalman = Kalman::new(&bias_and_drift());
    kalman.update(0, 0.0, None);
    [true, false].map(|measured| {
        let mut smallest = f64::INFINITY;
        for step in 1..=steps {
            kalman.predict();
            if measured {
                kalman.update(0, 0.0, None);
            }
            if step % (steps / 20) == 0 {
                smallest = smallest.min(smallest_scaled_eigenvalue(&kalman.p));
            }
        }
        smallest
    })
}

#[test]
fn covariances_stay_positive_definite_over_ten_million_steps() {
    let found = smallest_eigenvalues(10_000_000);
    assert!(found.iter().all(|v| *v > 1e-3), "{found:?}");
}

#[test]
#[ignore = "takes long; its figures are in docs/validation.md"]
fn covariances_stay_positive_definite_over_a_hundred_million_steps() {
    let found = smallest_eigenvalues(100_000_000);
    println!("smallest eigenvalue of P, unit diagonal: measured {:.4}, silent {:.4}", found[0], found[1]);
    assert!(found.iter().all(|v| *v > 1e-3), "{found:?}");
}

/// Two coupled states with correlated noise.
fn two_states() -> LinearModel {
    model(
        &[&[0.98, 0.05], &[-0.1, 0.9]],
        &[1.0, 0.4],
        &[&[0.02, 0.005], &[0.005, 0.03]],
        0.25,
        &[0.5, -0.2],
        &[&[1.0, 0.3], &[0.3, 0.5]],
    )
}

/// Fifty numbers between −1 and 1 that every language computes alike.
fn measurements() -> Vec<f64> {
    (0..50).map(|k| f64::from((k * 37) % 101) / 50.0 - 1.0).collect()
}

/// Runs the measurements through the filter: (ν, S, log-likelihood) per sample.
fn run(kalman: &mut Kalman, z: &[f64]) -> Vec<[f64; 3]> {
    let step = |(k, z): (usize, &f64)| {
        if k > 0 {
            kalman.predict();
        }
        let update = kalman.update(0, *z, None);
        [update.innovation, update.variance, update.log_likelihood()]
    };
    z.iter().enumerate().map(step).collect()
}

#[test]
fn innovations_and_likelihood_equal_an_independent_filter() {
    // statsmodels 0.15.0, statespace.kalman_filter.KalmanFilter, initialize_known(x0, P0), tolerance 0:
    // forecasts_error, forecasts_error_cov, llf_obs at these samples; llf; filtered_state(_cov) at the last.
    let expected = [
        (0, [-1.42, 1.57, -1.7866419479803224]),
        (1, [0.4896280254777068, 0.4700079363057324, -0.796469253324345]),
        (2, [0.9846536855902933, 0.38521399565032577, -1.7004075119351467]),
        (10, [0.3211886325404252, 0.3398444021648995, -0.5310833157995082]),
        (49, [0.9312177222045924, 0.33920268146833055, -1.6566021199546608]),
    ];
    let mut kalman = Kalman::new(&two_states());
    let steps = run(&mut kalman, &measurements());
    let close = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    for (k, expected) in expected {
        steps[k].iter().zip(expected).for_each(|(found, expected)| close(*found, expected));
    }
    close(steps.iter().map(|s| s[2]).sum(), -52.05223482619979);
    close(kalman.x[0], 0.17911295741986807);
    close(kalman.x[1], 0.13639662927385834);
    close(kalman.p[(0, 0)], 0.06438076311702864);
    close(kalman.p[(0, 1)], -0.029886374625142098);
    close(kalman.p[(1, 1)], 0.15795448563880457);
}

#[test]
fn likelihood_is_the_density_of_the_whole_batch() {
    // z is jointly Gaussian: mean H F^k x0, covariance H F^(k−j) P_j Hᵀ for j ≤ k, plus R on the diagonal.
    let model = two_states();
    let z = &measurements()[..30];
    let n = z.len();
    let mut prior = vec![(model.x0.clone(), model.p0.clone())];
    for k in 1..n {
        let (x, p) = &prior[k - 1];
        prior.push((&model.f * x, &model.f * p * model.f.transpose() + &model.q));
    }
    let mut covariance = DMatrix::zeros(n, n);
    for j in 0..n {
        let mut cross = &prior[j].1 * model.h.transpose();
        for k in j..n {
            covariance[(k, j)] = (&model.h * &cross)[0];
            covariance[(j, k)] = covariance[(k, j)];
            cross = &model.f * cross;
        }
        covariance[(j, j)] += model.r[0];
    }
    let residual = DVector::from_fn(n, |k, _| z[k] - (&model.h * &prior[k].0)[0]);
    let log_determinant: f64 = 2.0 * cholesky(&covariance).unwrap().diagonal().map(f64::ln).sum();
    let quadratic = mahalanobis(&residual, &covariance).unwrap();
    let density = -0.5 * (n as f64 * std::f64::consts::TAU.ln() + log_determinant + quadratic);

    let sum: f64 = run(&mut Kalman::new(&model), z).iter().map(|s| s[2]).sum();
    assert!((sum / density - 1.0).abs() < 1e-13, "{sum} {density}");
}

/// A random model of 1 to 6 states with ‖F‖∞ ≤ 1, Q and P0 possibly of low rank, R over eight decades.
fn random_model() -> impl Strategy<Value = LinearModel> {
    (1_usize..=6, -8.0..0.5_f64).prop_flat_map(|(n, log_r)| {
        let entries = |count: usize| prop::collection::vec(-1.0..1.0_f64, count);
        (entries(n * n), entries(n * n), entries(n * n), entries(n), 1..=n).prop_map(move |(f, q, p, h, rank)| {
            let f = DMatrix::from_vec(n, n, f);
            let norm = f.row_iter().map(|row| row.abs().sum()).fold(1.0, f64::max);
            let l = DMatrix::from_vec(n, n, q).columns(0, rank).into_owned();
            let m = DMatrix::from_vec(n, n, p);
            let zero = vec![0.0; n];
            let rows: Vec<&[f64]> = vec![&zero; n];
            let mut model = model(&rows, &h, &rows, 10.0_f64.powf(log_r), &zero, &rows);
            model.f = f / norm;
            model.q = &l * l.transpose();
            model.p0 = &m * m.transpose();
            model
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn covariances_stay_symmetric_and_semidefinite(model in random_model()) {
        let mut kalman = Kalman::new(&model);
        for k in 0..300 {
            if k > 0 {
                kalman.predict();
            }
            let before = kalman.p.clone();
            if k % 7 != 3 {
                kalman.update(0, 1.0, None);
            }
            prop_assert_eq!(asymmetry(&kalman.p), 0.0);
            // Relative to what the update started from: an exact measurement leaves only rounding of P.
            let d = before.diagonal().map(|v| v.sqrt().max(f64::MIN_POSITIVE));
            let scaled = DMatrix::from_fn(d.len(), d.len(), |i, j| kalman.p[(i, j)] / (d[i] * d[j]));
            let smallest = symmetric_eigenvalues(&scaled)[0];
            prop_assert!(smallest >= -1e-14, "step {}: {:e}", k, smallest);
            prop_assert!(kalman.p.diagonal().iter().all(|v| *v >= 0.0));
        }
    }

    #[test]
    fn joseph_equals_the_plain_update(model in random_model()) {
        let mut kalman = Kalman::new(&model);
        kalman.predict();
        let p = kalman.p.clone();
        let s = (&model.h * &p * model.h.transpose())[0] + model.r[0];
        let k = &p * model.h.transpose() / s;
        let plain = &p - &k * &model.h * &p;
        let update = kalman.update(0, 0.7, None);
        prop_assert!((update.variance / s - 1.0).abs() < 1e-12);
        prop_assert!(relative_to_diagonal(&(&kalman.p - plain), p.diagonal().as_slice()) < 1e-13);
        prop_assert!((&kalman.x - k * update.innovation).amax() <= 1e-12 * kalman.x.amax());
    }
}
