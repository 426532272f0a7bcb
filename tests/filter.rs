//! Kalman filter, steady state and the filter.json document.

mod document;
mod kalman;
mod likelihood;
mod mismatch;
mod single;
mod smoother;
mod square_root;
mod steady_state;
mod whole_log;

use kfdesign::model::{LinearModel, Named};
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
        outputs: vec![],
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

/// One Gauss-Markov drift in white noise; σ and N in deg/s and deg/s/√Hz.
fn drift(sigma: f64, tc: f64, n: f64, dt: f64) -> LinearModel {
    let a = (-dt / tc).exp();
    let q = -sigma * sigma * (-2.0 * dt / tc).exp_m1();
    LinearModel { dt, ..model(&[&[a]], &[1.0], &[&[q]], n * n / dt, &[0.0], &[&[sigma * sigma]]) }
}
