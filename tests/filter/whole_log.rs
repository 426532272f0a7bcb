//! The filter in two stages, whose gains settle, against the one that carries its whole covariance from sample to
//! sample.

use super::model;
use kfdesign::filter::Kalman;
use kfdesign::filter::whole_log::{TwoStage, carried, innovations};
use kfdesign::model::LinearModel;
use kfdesign::numerics::random::{StreamId, fill_normal, stream};

/// Rate = bias + drift; angle of bias + drift; a drift with no bias; a bias alone; two drifts and a bias between them.
fn models() -> [LinearModel; 5] {
    [
        model(
            &[&[1.0, 0.0], &[0.0, 0.95]],
            &[1.0, 1.0],
            &[&[0.0, 0.0], &[0.0, 0.02]],
            1.0,
            &[0.3, 0.0],
            &[&[4.0, 0.0], &[0.0, 0.2]],
        ),
        model(
            &[&[1.0, 0.1, 0.1], &[0.0, 1.0, 0.0], &[0.0, 0.0, 0.9]],
            &[1.0, 0.0, 0.0],
            &[&[0.01, 0.0, 0.0], &[0.0, 0.0, 0.0], &[0.0, 0.0, 0.05]],
            0.5,
            &[0.2, -0.1, 0.0],
            &[&[1.0, 0.0, 0.0], &[0.0, 2.0, 0.0], &[0.0, 0.0, 0.3]],
        ),
        model(&[&[0.9]], &[1.0], &[&[0.1]], 1.0, &[0.0], &[&[0.5]]),
        model(&[&[1.0]], &[2.0], &[&[0.0]], 1.0, &[0.5], &[&[9.0]]),
        model(
            &[&[0.9, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 0.5]],
            &[1.0, 0.5, -1.0],
            &[&[0.1, 0.0, 0.02], &[0.0, 0.0, 0.0], &[0.02, 0.0, 0.3]],
            0.7,
            &[0.1, 0.2, 0.3],
            &[&[1.0, 0.0, 0.1], &[0.0, 1.0, 0.0], &[0.1, 0.0, 1.0]],
        ),
    ]
}

/// Samples of order one; 3000 of them, of which the first some hundred settle, with stretches that are not numbers,
/// and one whose square is none.
fn samples() -> Vec<f64> {
    let mut z = vec![0.0; 3000];
    fill_normal(&mut stream(5, StreamId { run: 0, axis: 0, term: 0 }), &mut z);
    for k in [0, 700, 701, 702, 1500, 2999] {
        z[k] = f64::NAN;
    }
    z[1000] = -1e200;
    z
}

/// ν, 1/S and ln L of the filter by the book.
fn by_steps(model: &LinearModel, z: &[f64]) -> (Vec<(f64, f64)>, f64, Kalman) {
    let mut kalman = Kalman::new(model);
    let (mut all, mut log_likelihood) = (Vec::new(), 0.0);
    for (k, z) in z.iter().enumerate() {
        if k > 0 {
            kalman.predict();
        }
        if z.abs() < 1e140 {
            let update = kalman.update(0, *z, None);
            log_likelihood += update.log_likelihood();
            all.push((update.innovation, 1.0 / update.variance));
        } else {
            all.push((f64::NAN, f64::NAN));
        }
    }
    (all, log_likelihood, kalman)
}

/// A few hundred roundings of numbers of order one, in the filter that is compared with too: 1e-11 (seen: below 1e-13).
#[track_caller]
fn same(found: f64, expected: f64, what: &str) {
    let both_missing = found.is_nan() && expected.is_nan();
    assert!(
        both_missing || (found - expected).abs() <= 1e-11 * expected.abs().max(1.0),
        "{what}: {found}, expected {expected}"
    );
}

#[test]
fn stages_and_steps_agree() {
    let z = samples();
    for (number, model) in models().iter().enumerate() {
        let (expected, log_likelihood, _) = by_steps(model, &z);
        let (mut v, mut nis) = (vec![0.0; z.len()], vec![0.0; z.len()]);
        let found = innovations(model, &z, &mut v, &mut nis);
        same(found / log_likelihood, 1.0, &format!("ln L of model {number}"));
        for (k, (innovation, weight)) in expected.iter().enumerate() {
            same(v[k], *innovation, &format!("innovation {k} of model {number}"));
            same(nis[k], innovation * innovation * weight, &format!("NIS {k} of model {number}"));
        }
        let (mut v, mut w) = (vec![0.0; z.len()], vec![0.0; z.len()]);
        let found = carried(model, &z, &mut v, &mut w);
        same(found / log_likelihood, 1.0, &format!("ln L of model {number}, carried"));
        for (k, (innovation, weight)) in expected.iter().enumerate() {
            same(v[k], *innovation, &format!("innovation {k} of model {number}, carried"));
            same(w[k], *weight, &format!("1/S {k} of model {number}, carried"));
        }
    }
}

/// The unit of the log changes neither NIS nor the differences of ln L: the product of sixteen variances of 1e-50
/// would be zero.
#[test]
fn any_unit_gives_the_same() {
    let scale = 1e-25;
    let z: Vec<f64> = samples().into_iter().filter(|z| z.abs() < 1e140).collect();
    let small: Vec<f64> = z.iter().map(|z| z * scale).collect();
    for (number, model) in models().iter().enumerate() {
        let mut scaled = model.clone();
        scaled.x0 *= scale;
        [&mut scaled.q, &mut scaled.r, &mut scaled.p0].into_iter().for_each(|m| *m *= scale * scale);
        let [mut v, mut nis, mut small_v, mut small_nis] = std::array::from_fn(|_| vec![0.0; z.len()]);
        let expected = innovations(model, &z, &mut v, &mut nis) - z.len() as f64 * scale.ln();
        for way in [innovations, carried] {
            let found = way(&scaled, &small, &mut small_v, &mut small_nis);
            same(found / expected, 1.0, &format!("ln L of model {number}"));
        }
        innovations(&scaled, &small, &mut small_v, &mut small_nis);
        for (k, (found, expected)) in small_nis.iter().zip(&nis).enumerate() {
            same(*found, *expected, &format!("NIS {k} of model {number}"));
        }
    }
}

/// A gap is stepped over in as many steps as its length has binary digits, as the filter by the book does it: a few
/// hundred roundings.
#[test]
fn long_gaps_take_no_time() {
    for (number, model) in models().iter().enumerate() {
        let mut stages = TwoStage::new(model).expect("a model of few states");
        let mut kalman = Kalman::new(model);
        stages.run(&[0.7], &mut [0.0], &mut [0.0]);
        kalman.update(0, 0.7, None);
        stages.pause(1 << 40);
        kalman.predict_many(1 << 40);
        let (x, p) = stages.state();
        for (found, expected) in x.iter().zip(&kalman.x).chain(p.iter().zip(&kalman.p)) {
            assert!(
                (found - expected).abs() <= 1e-11 * expected.abs().max(1e-3),
                "model {number}: {found}, {expected}"
            );
        }
    }
}

/// Pieces of any length, with steps left out between them, end in the state and covariance of the filter that goes
/// step by step.
#[test]
fn pieces_and_gaps_end_in_the_same_state() {
    let z: Vec<f64> = samples().into_iter().filter(|z| z.abs() < 1e140).collect();
    for (number, model) in models().iter().enumerate() {
        let mut stages = TwoStage::new(model).expect("a model of few states");
        let mut kalman = Kalman::new(model);
        let (mut at, mut first) = (0, true);
        for (length, gap) in [(1, 0), (2, 0), (900, 3), (1, 1), (500, 0), (1200, 40), (7, 0)] {
            let piece = &z[at..at + length];
            at += length;
            let (mut v, mut w) = (vec![0.0; length], vec![0.0; length]);
            stages.run(piece, &mut v, &mut w);
            for (k, z) in piece.iter().enumerate() {
                if !first {
                    kalman.predict();
                }
                first = false;
                same(
                    v[k],
                    kalman.update(0, *z, None).innovation,
                    &format!("innovation {k} of {length}, model {number}"),
                );
            }
            let (x, p) = stages.state();
            for (found, expected) in x.iter().zip(&kalman.x).chain(p.iter().zip(&kalman.p)) {
                same(*found, *expected, &format!("state after {length}, model {number}"));
            }
            stages.pause(gap);
            kalman.predict_many(gap);
        }
    }
}

/// What it cannot run, it says so: a measurement at every second step, and seven states.
#[test]
fn other_models_are_not_taken() {
    let mut seldom = models()[0].clone();
    seldom.every = vec![2];
    assert!(TwoStage::new(&seldom).is_none());
    let z: Vec<f64> = samples()[1..200].to_vec();
    let (mut v, mut nis) = (vec![0.0; z.len()], vec![0.0; z.len()]);
    innovations(&seldom, &z, &mut v, &mut nis);
    assert!(v.iter().enumerate().all(|(k, v)| v.is_finite() == (k % 2 == 0)));
    let identity: Vec<Vec<f64>> = (0..8).map(|i| (0..8).map(|j| if i == j { 0.5 } else { 0.0 }).collect()).collect();
    let rows: Vec<&[f64]> = identity.iter().map(Vec::as_slice).collect();
    assert!(TwoStage::new(&model(&rows, &[1.0; 8], &rows, 1.0, &[0.0; 8], &rows)).is_none());
}
