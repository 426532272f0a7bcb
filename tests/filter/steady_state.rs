//! Steady state against closed forms, an independent solver and the running filter.

use kfdesign::filter::{Kalman, SteadyStateError, steady_state};
use kfdesign::model::LinearModel;
use kfdesign::numerics::linalg::relative_to_diagonal;
use kfdesign::numerics::riccati::{dare_doubling, dare_eigenvector};
use nalgebra::DMatrix;

use super::{bias_and_drift, drift, model};

#[test]
fn steady_state_of_the_bias_filter_to_fourteen_digits() {
    // Roots of P² + P(R(1−a²) − q) − qR = 0, mpmath 1.3 with 40 digits: P(k|k−1), K, P(k|k), pole, time constant.
    let cases = [
        (
            drift(0.0280596, 193.9312, 0.0562, 0.01),
            [1.4471613469484e-4, 4.5797880527213e-4, 1.4464985777237e-4, 0.99949048146048, 19.621370794976],
        ),
        (
            drift(0.03, 193.9312, 0.0562, 0.01),
            [1.55742560123e-4, 4.9285660444286e-4, 1.5566580137365e-4, 0.99945560545972, 18.364030203448],
        ),
        (
            drift(0.0280596, 193.9312, 0.0562, 1.0),
            [1.4803016362076e-4, 4.4769847086313e-2, 1.414028758313e-4, 0.95031721691474, 19.623450482334],
        ),
    ];
    for (model, [predicted, gain, updated, pole, time_constant]) in cases {
        let steady = steady_state(&model).unwrap();
        let (p, k) = (steady.predicted_covariance[(0, 0)], steady.gain[(0, 0)]);
        let found = [p, k, (1.0 - k) * p, steady.poles[0].0, steady.settling_time / 4.0];
        for (found, expected) in found.iter().zip([predicted, gain, updated, pole, time_constant]) {
            assert!((found / expected - 1.0).abs() < 2e-11, "{found} {expected}");
        }
        assert!((steady.innovation_covariance[(0, 0)] - p - model.r[(0, 0)]).abs() < 1e-16);
        assert_eq!(steady.poles.len(), 1);
        assert!(steady.residual < 1e-14, "{}", steady.residual);
        assert!(steady.eigenvector_difference < 1e-7, "{}", steady.eigenvector_difference);
    }
}

#[test]
fn steady_state_of_the_tracking_filter_is_kalatas_alpha_beta() {
    // Constant velocity driven by random acceleration steps: α and β are closed forms of λ = σ_a T²/σ_z
    // (Kalata 1984, IEEE Trans. AES 20; Bar-Shalom, Li, Kirubarajan 2001, section 6.5.3).
    for lambda in [1e-4_f64, 0.01, 0.5, 3.0] {
        let q = lambda * lambda;
        let model = model(
            &[&[1.0, 1.0], &[0.0, 1.0]],
            &[1.0, 0.0],
            &[&[q / 4.0, q / 2.0], &[q / 2.0, q]],
            1.0,
            &[0.0; 2],
            &[&[1.0, 0.0], &[0.0, 1.0]],
        );
        let root = (lambda * (lambda + 8.0)).sqrt();
        let alpha = -(lambda * lambda + 8.0 * lambda - (lambda + 4.0) * root) / 8.0;
        let beta = (lambda * lambda + 4.0 * lambda - lambda * root) / 4.0;
        let steady = steady_state(&model).unwrap();
        assert!((steady.gain[(0, 0)] / alpha - 1.0).abs() < 1e-11, "λ = {lambda}: {} {alpha}", steady.gain[(0, 0)]);
        assert!((steady.gain[(1, 0)] / beta - 1.0).abs() < 1e-10, "λ = {lambda}: {} {beta}", steady.gain[(1, 0)]);
        assert!(steady.residual < 1e-13 && steady.eigenvector_difference < 1e-6);
    }
}

#[test]
fn riccati_solutions_equal_an_independent_solver() {
    // scipy 1.17.1: scipy.linalg.solve_discrete_are(F.T, H.T, Q, R); printed to eight digits.
    let matrix = |rows, columns, v: &[f64]| DMatrix::from_row_slice(rows, columns, v);
    let f = matrix(3, 3, &[0.9, 0.1, 0.0, -0.2, 0.8, 0.05, 0.0, 0.0, 0.99]);
    let h = matrix(2, 3, &[1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    let q = matrix(3, 3, &[0.1, 0.02, 0.0, 0.02, 0.2, 0.01, 0.0, 0.01, 0.005]);
    let r = matrix(2, 2, &[0.5, 0.0, 0.0, 0.3]);
    let expected = matrix(
        3,
        3,
        &[
            0.25943027,
            -0.01242161,
            -0.04512864,
            -0.01242161,
            0.31137834,
            0.03861775,
            -0.04512864,
            0.03861775,
            0.07570977,
        ],
    );
    let doubling = dare_doubling(&f, &h, &q, &r).unwrap();
    let eigenvector = dare_eigenvector(&f, &h, &q, &r).unwrap();
    assert!((&doubling.covariance - expected).amax() < 5.1e-9);
    assert!((doubling.covariance - eigenvector.covariance).amax() < 1e-12);
    assert!(doubling.relative_residual < 1e-14 && eigenvector.relative_residual < 1e-12);
}

/// The filter's covariance before the measurement after so many steps.
fn predicted_after(model: &LinearModel, steps: u32) -> DMatrix<f64> {
    let mut kalman = Kalman::new(model);
    for _ in 0..steps {
        kalman.update(0, 0.0, None);
        kalman.predict();
    }
    kalman.p
}

#[test]
fn undriven_states_have_no_gain_and_the_drift_settles_as_if_alone() {
    let both = bias_and_drift();
    let steady = steady_state(&both).unwrap();
    assert_eq!(steady.gain[(0, 0)], 0.0);
    assert_eq!(steady.predicted_covariance.column(0).amax(), 0.0);
    // The drift alone, formulas with σ = 0.03: 1.557425601e-4, 4.928566044e-4.
    assert!((steady.predicted_covariance[(1, 1)] - 1.557425601e-4).abs() < 1e-13);
    assert!((steady.gain[(1, 0)] - 4.928566044e-4).abs() < 1e-12);
    // Poles of (I − K H) F: 1 for the constant, the drift's closed-loop pole.
    assert!((steady.poles[0].0 - 1.0).abs() < 1e-15 && (steady.poles[1].0 - 0.99945560546).abs() < 1e-11);
    // The running filter: the constant's variance tends to (2σ²Tc + N²)/T, the drift's gain to K.
    let steps = 2_000_000_u32;
    let p = predicted_after(&both, steps);
    let expected = (2.0 * 9e-4 * 193.9312 + 0.0562 * 0.0562) / (f64::from(steps) * 0.01);
    assert!((p[(0, 0)] / expected - 1.0).abs() < 0.03, "{} {expected}", p[(0, 0)]);
}

#[test]
fn a_constant_beside_a_random_walk_settles_where_the_prior_says() {
    // Only the sum is seen: P of bias and walk depends on P0 for ever, the gain does not.
    let model = model(
        &[&[1.0, 0.0], &[0.0, 1.0]],
        &[1.0, 1.0],
        &[&[0.0, 0.0], &[0.0, 1e-4]],
        1.0,
        &[0.0; 2],
        &[&[4.0, 0.0], &[0.0, 0.25]],
    );
    let steady = steady_state(&model).unwrap();
    let reached = predicted_after(&model, 20_000);
    let difference = relative_to_diagonal(&(&steady.predicted_covariance - &reached), reached.diagonal().as_slice());
    assert!(difference < 1e-12, "{difference:e} {} {reached}", steady.predicted_covariance);
    assert!(steady.predicted_covariance[(0, 0)] > 0.1);
    // The sum's variance is the random walk's own: (q + √(q² + 4qr))/2.
    let sum = (&model.h * &steady.predicted_covariance * model.h.transpose())[0];
    assert!((sum - (1e-4 + (1e-8_f64 + 4e-4).sqrt()) / 2.0).abs() < 1e-12, "{sum}");
    assert_eq!(steady.gain[(0, 0)], 0.0);
    assert!((steady.gain[(1, 0)] - sum / (sum + 1.0)).abs() < 1e-12);
}

#[test]
fn steady_state_without_drift_is_trivial_and_without_sight_is_refused() {
    let constant = model(&[&[1.0]], &[1.0], &[&[0.0]], 2.0, &[0.0], &[&[1.0]]);
    let steady = steady_state(&constant).unwrap();
    assert_eq!((steady.gain[(0, 0)], steady.predicted_covariance[(0, 0)]), (0.0, 0.0));
    assert_eq!((steady.innovation_covariance[(0, 0)], steady.settling_time), (2.0, 0.0));
    assert_eq!(steady.poles, [(1.0, 0.0)]);

    let unseen = model(&[&[1.0]], &[0.0], &[&[1.0]], 1.0, &[0.0], &[&[1.0]]);
    let error = steady_state(&unseen).unwrap_err();
    assert!(error.to_string().contains("x0 reaches no measurement"), "{error}");
    let growing = model(&[&[1.1]], &[1.0], &[&[0.0]], 1.0, &[0.0], &[&[1.0]]);
    assert!(matches!(steady_state(&growing), Err(SteadyStateError::Growing { .. })));
    // rates with no common period
    let mut twice = two_measurements();
    twice.every = vec![1_000_003, 999_983];
    assert!(steady_state(&twice).unwrap_err().to_string().contains("more than a million samples"));
}

fn two_measurements() -> LinearModel {
    let mut model = drift(0.03, 100.0, 0.05, 1.0);
    model.measurements.push(kfdesign::model::Named { name: "second".into(), unit: "deg/s".into() });
    model.h = DMatrix::from_element(2, 1, 1.0);
    model.r = DMatrix::identity(2, 2) * model.r[0];
    model.every = vec![1, 1];
    model
}

#[test]
fn a_measurement_at_every_tenth_sample_is_a_filter_of_ten_times_the_step() {
    // A scalar process is one at any step: closed forms of one hold for the other.
    let mut rare = drift(0.03, 100.0, 0.05, 1.0);
    rare.every = vec![10];
    let mut slow = drift(0.03, 100.0, 0.05, 10.0);
    slow.r = rare.r.clone();
    let (found, expected) = (steady_state(&rare).unwrap(), steady_state(&slow).unwrap());
    assert_eq!((found.period, expected.period), (10, 1));
    // ten products of doubles
    for (found, expected) in [
        (found.gain[0], expected.gain[0]),
        (found.predicted_covariance[0], expected.predicted_covariance[0]),
        (found.poles[0].0.powi(10), expected.poles[0].0),
        (found.settling_time, expected.settling_time),
    ] {
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }
    // two measurements at every sample are one of half the variance
    let mut one = two_measurements();
    one.measurements.pop();
    one.every.pop();
    one.h = DMatrix::from_element(1, 1, 1.0);
    one.r = DMatrix::from_element(1, 1, one.r[(0, 0)] / 2.0);
    let (two, one) = (steady_state(&two_measurements()).unwrap(), steady_state(&one).unwrap());
    assert!((two.predicted_covariance[0] / one.predicted_covariance[0] - 1.0).abs() < 1e-12);
}
