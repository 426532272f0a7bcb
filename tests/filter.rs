//! Kalman filter, steady state and the filter.json document.

use kfdesign::filter::Kalman;
use kfdesign::model::{LinearModel, Named};
use kfdesign::numerics::linalg::{asymmetry, symmetric_eigenvalues};
use nalgebra::{DMatrix, DVector};

fn named(name: &str) -> Named {
    Named { name: name.into(), unit: "rad/s".into() }
}

/// A model from rows, dt = 1 s, one measurement.
fn model(f: &[&[f64]], h: &[f64], q: &[&[f64]], r: f64, x0: &[f64], p0: &[&[f64]]) -> LinearModel {
    let n = h.len();
    let matrix = |rows: &[&[f64]]| DMatrix::from_fn(n, n, |i, j| rows[i][j]);
    LinearModel {
        dt: 1.0,
        states: (0..n).map(|i| named(&format!("x{i}"))).collect(),
        inputs: vec![],
        measurements: vec![named("rate")],
        every: vec![1],
        f: matrix(f),
        g: DMatrix::zeros(n, 0),
        h: DMatrix::from_row_slice(1, n, h),
        q: matrix(q),
        r: DMatrix::from_element(1, 1, r),
        x0: DVector::from_row_slice(x0),
        p0: matrix(p0),
    }
}

/// Constant bias beside a Gauss-Markov drift (σ = 0.03, Tc = 193.9312 s, N = 0.0562, dt = 0.01 s; degrees).
fn bias_and_drift() -> LinearModel {
    let (a, q, r) = (0.999948436651, 9.281163561e-8, 0.315844);
    model(&[&[1.0, 0.0], &[0.0, a]], &[1.0, 1.0], &[&[0.0, 0.0], &[0.0, q]], r, &[0.0; 2], &[&[1.0, 0.0], &[0.0, 9e-4]])
}

#[test]
fn scalar_steps_follow_the_textbook_recursion() {
    // P0 = 4, R = 1: S = 5, K = 0.8, P = 0.8; then F = 0.5, Q = 1: P = 1.2, S = 2.2, K = 6/11, P = 6/11.
    let mut kalman = Kalman::new(&model(&[&[0.5]], &[1.0], &[&[1.0]], 1.0, &[1.0], &[&[4.0]]));
    let first = kalman.update(0, 3.0, None);
    assert_eq!((first.innovation, first.variance, first.nis), (2.0, 5.0, 0.8));
    assert!((first.log_likelihood + 0.5 * ((std::f64::consts::TAU * 5.0).ln() + 0.8)).abs() < 1e-15);
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
    // |ν| just inside the gate is taken: √S = √(1.0009 + 0.315844).
    assert!(kalman.update(0, 3.0 * 1.316744_f64.sqrt() * 0.9999, Some(3.0)).accepted);
}

/// Smallest eigenvalue of P scaled to unit diagonal; symmetric exactly.
fn smallest_scaled_eigenvalue(p: &DMatrix<f64>) -> f64 {
    assert_eq!(asymmetry(p), 0.0);
    let d = p.diagonal().map(f64::sqrt);
    symmetric_eigenvalues(&DMatrix::from_fn(p.nrows(), p.ncols(), |i, j| p[(i, j)] / (d[i] * d[j])))[0]
}

#[test]
fn covariances_stay_positive_definite_over_ten_million_steps() {
    // A constant bias beside the drift: the worst case, its variance falls like 1/t for ever.
    let mut kalman = Kalman::new(&bias_and_drift());
    kalman.update(0, 0.0, None);
    for step in 1..10_000_000_u32 {
        kalman.predict();
        kalman.update(0, 0.0, None);
        if step % 1_000_000 == 0 {
            assert!(smallest_scaled_eigenvalue(&kalman.p) > 1e-3, "step {step}: {}", kalman.p);
        }
    }
    // Then ten million steps with nothing measured.
    for step in 1..=10_000_000_u32 {
        kalman.predict();
        if step % 1_000_000 == 0 {
            assert!(smallest_scaled_eigenvalue(&kalman.p) > 1e-3, "silent step {step}: {}", kalman.p);
        }
    }
}
