//! One row of the attitude filter (prediction, force towards east and north, heading) against the same sizes with
//! nalgebra's dynamic matrices: P ← F P Fᵀ + Q with a full F, three scalar updates P ← P − K (h P). And a linear
//! error-state filter of twelve states with two measurements, ours (structure of F found once) against the same.

use std::hint::black_box;
use std::time::Instant;

use kfdesign::filter::Kalman;
use kfdesign::filter::attitude::{AttitudeModel, Heading, Mekf, Row};
use kfdesign::model::{LinearModel, Named};
use kfdesign::params::{Design, Params};
use kfdesign::tune::tune_attitude;
use nalgebra::{DMatrix, DVector, Vector3};

const STEPS: usize = 2000;
const ROUNDS: usize = 60;

fn attitude_model() -> AttitudeModel {
    let axis = |name: &str| {
        format!(
            r#"{{ "name": "{name}", "turn_on_bias": {{ "std_dev": "0.3 deg/s" }}, "white": {{ "density": "0.005 deg/s/sqrt(Hz)" }} }}"#
        )
    };
    let gyro = format!(
        r#"{{ "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{}, {}, {}] }}"#,
        axis("x"),
        axis("y"),
        axis("z")
    );
    let section = r#"{ "plant": "attitude", "accelerometer": { "name": "z", "white": { "density": "0.0041 m/s^2/sqrt(Hz)" } },
        "aids": [{ "name": "magnetometer", "std_dev": "3 deg", "gauss_markov": { "std_dev": "3 deg", "correlation_time": "1 s" } }] }"#;
    let params = Params::from_json(&gyro, "the bench").expect("sound parameters");
    let design = Design::from_json(section, "the bench", None).expect("a sound design");
    tune_attitude(&params, &design, 1e4).expect("a sound model").design.model
}

fn rows(model: &AttitudeModel) -> Vec<Row> {
    let turn = |k: usize| (k as f64 * 0.01).sin();
    let row = |k| Row {
        rate: Vector3::new(0.1 * turn(k), 0.05 * turn(2 * k), 0.2),
        force: Vector3::new(0.3 * turn(3 * k), 0.2 * turn(5 * k), model.gravity),
        heading: Some(Heading::Field(Vector3::new(0.0, 15.0, -41.0))),
    };
    (0..STEPS).map(row).collect()
}

fn ours(model: &AttitudeModel, rows: &[Row]) -> f64 {
    let mut filter = Mekf::new(model);
    for row in rows {
        filter.step(row, 0);
    }
    filter.covariance()[(0, 0)]
}

/// The covariance of a filter of `n` states, by the book.
fn by_the_book(f: &DMatrix<f64>, q: &DMatrix<f64>, h: &DMatrix<f64>, r: f64, steps: usize) -> f64 {
    let n = f.nrows();
    let (mut x, mut p) = (DVector::zeros(n), DMatrix::identity(n, n));
    for k in 0..steps {
        x = f * &x;
        p = f * &p * f.transpose() + q;
        for row in h.row_iter() {
            let direction = &p * row.transpose();
            let variance = (row * &direction)[0] + r;
            let gain = &direction / variance;
            x += &gain * (0.01 * k as f64 - (row * &x)[0]);
            p -= &gain * direction.transpose();
        }
    }
    p[(0, 0)] + x[0]
}

/// Attitude errors, gyro biases, gyro drifts and body accelerations about three axes; the two horizontal forces are
/// measured.
fn twelve_states() -> LinearModel {
    let (n, dt) = (12, 0.01);
    let named = |name: String| Named { name, unit: "rad".into() };
    let mut f = DMatrix::identity(n, n);
    for i in 0..3 {
        (f[(i, 3 + i)], f[(i, 6 + i)]) = (-dt, -dt);
        (f[(6 + i, 6 + i)], f[(9 + i, 9 + i)]) = (0.9999, 0.98);
    }
    let h = DMatrix::from_fn(2, n, |i, j| if j == 1 - i || j == 9 + i { 1.0 } else { 0.0 });
    LinearModel {
        dt,
        states: (0..n).map(|i| named(format!("x{i}"))).collect(),
        inputs: vec![],
        measurements: (0..2).map(|i| named(format!("force {i}"))).collect(),
        every: vec![1, 1],
        outputs: vec![],
        q: DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| if (3..6).contains(&i) { 0.0 } else { 1e-8 })),
        g: DMatrix::zeros(n, 0),
        r: DMatrix::from_diagonal_element(2, 2, 1e-2),
        x0: DVector::zeros(n),
        p0: DMatrix::from_diagonal_element(n, n, 1.0),
        f,
        h,
    }
}

fn linear(model: &LinearModel) -> f64 {
    let mut filter = Kalman::new(model);
    for k in 0..STEPS {
        filter.predict();
        filter.update(0, 0.01 * k as f64, None);
        filter.update(1, 0.01 * k as f64, None);
    }
    filter.p[(0, 0)]
}

/// Best microseconds of a step, the two in turn.
fn best(mut first: impl FnMut() -> f64, mut second: impl FnMut() -> f64) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        let works: [&mut dyn FnMut() -> f64; 2] = [&mut first, &mut second];
        for (best, work) in best.iter_mut().zip(works) {
            let start = Instant::now();
            black_box(work());
            *best = best.min(start.elapsed().as_secs_f64() * 1e6 / STEPS as f64);
        }
    }
    best
}

#[allow(clippy::print_stdout, reason = "the ratios are what the bench is for")]
fn main() {
    let model = attitude_model();
    let rows = rows(&model);
    let n = Mekf::new(&model).covariance().nrows();
    let f = DMatrix::from_fn(n, n, |i, j| if i == j { 0.999 } else { 1e-4 / (1.0 + i.abs_diff(j) as f64) });
    let (q, h) =
        (DMatrix::from_diagonal_element(n, n, 1e-6), DMatrix::from_fn(3, n, |i, j| f64::from(u8::from(j % 3 == i))));
    let [filter, book] = best(|| ours(&model, &rows), || by_the_book(&f, &q, &h, 0.1, STEPS));
    println!("attitude, {n} states: {filter:.3} µs a row, dynamic matrices {book:.3} µs, {:.1} times", book / filter);
    let twelve = twelve_states();
    let [filter, book] = best(|| linear(&twelve), || by_the_book(&twelve.f, &twelve.q, &twelve.h, 1e-2, STEPS));
    println!("linear, 12 states: {filter:.3} µs a step, dynamic matrices {book:.3} µs, {:.1} times", book / filter);
}
