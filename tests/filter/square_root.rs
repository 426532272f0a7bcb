//! The square-root form: the results of the Joseph form where that is sound, and right ones where it is not.

use kfdesign::filter::Kalman;
use kfdesign::model::LinearModel;
use kfdesign::numerics::random::{StreamId, stream};
use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

type SquareRoot = kfdesign::filter::SquareRoot<f64>;

use super::{bias_and_drift, drift, model, named};

pub(super) fn normals(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = stream(seed, StreamId { run: 0, axis: 0, term: 0 });
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// Position and velocity driven by white acceleration, position measured every sample, velocity every third; an
/// input; F full.
pub(super) fn two_measurements() -> LinearModel {
    let mut m = model(
        &[&[1.0, 0.5], &[-0.02, 0.9]],
        &[1.0, 0.0],
        &[&[0.02, 0.03], &[0.03, 0.09]],
        0.25,
        &[1.0, -1.0],
        &[&[2.0, 0.3], &[0.3, 1.0]],
    );
    m.measurements.push(named("velocity"));
    m.every = vec![1, 3];
    m.h = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.2, 1.0]);
    m.r = DMatrix::from_diagonal(&DVector::from_vec(vec![0.25, 0.04]));
    m.inputs = vec![named("push")];
    m.g = DMatrix::from_column_slice(2, 1, &[0.1, 0.4]);
    m
}

/// 3000 samples, some rejected, some without a measurement: x to 1e-10 of its sigma, P and every update to 1e-10 of
/// themselves.
#[test]
fn equals_the_joseph_form() {
    for m in [drift(0.03, 193.93, 0.0562, 0.01), bias_and_drift(), two_measurements()] {
        let (mut joseph, mut root) = (Kalman::new(&m), SquareRoot::new(&m).unwrap());
        let noise = normals(6000, 71);
        let mut rejected = 0;
        for k in 0..3000 {
            if k > 0 {
                let u = vec![noise[k]; m.inputs.len()];
                joseph.predict();
                root.predict();
                joseph.drive(&u);
                root.drive(&u);
            }
            for (i, every) in m.every.iter().enumerate() {
                if k % every != 0 || k % 17 == 5 {
                    continue;
                }
                let gate = (k % 2 == 1).then_some(2.0);
                let z = noise[3000 + (k + i) % 3000] * 3.0 * m.r[(i, i)].sqrt();
                let (a, b) = (joseph.update(i, z, gate), root.update(i, z, gate));
                assert_eq!(a.accepted, b.accepted);
                rejected += usize::from(!a.accepted);
                assert!(
                    (a.variance / b.variance - 1.0).abs() < 1e-10
                        && (a.innovation - b.innovation).abs() < 1e-10 * a.variance.sqrt()
                );
                assert!((a.log_likelihood() - b.log_likelihood()).abs() < 1e-9 * a.log_likelihood().abs().max(1.0));
            }
            let p = root.covariance();
            for s in 0..m.x0.len() {
                let sigma = joseph.p[(s, s)].sqrt();
                assert!((joseph.x[s] - root.x[s]).abs() < 1e-10 * sigma, "sample {k}");
                for t in 0..m.x0.len() {
                    let scale = (joseph.p[(s, s)] * joseph.p[(t, t)]).sqrt();
                    assert!((joseph.p[(s, t)] - p[(s, t)]).abs() < 1e-10 * scale, "sample {k}");
                }
            }
        }
        assert!(rejected > 20, "{rejected}");
    }
}

/// Three nearly parallel measurements of σ = 1e-7 from P = I: the covariance in rational arithmetic (beside it the
/// condition number is 1e15). The Joseph form, in double precision, is 4 to 56 % off in the variances; the square
/// root keeps 1e-8.
#[test]
fn keeps_a_covariance_that_the_joseph_form_has_lost() {
    let d = 1e-7;
    let one: [&[f64]; 3] = [&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0]];
    let none: [&[f64]; 3] = [&[0.0; 3]; 3];
    let mut m = model(&one, &[1.0; 3], &none, d * d, &[0.0; 3], &one);
    m.measurements = vec![named("a"), named("b"), named("c")];
    m.every = vec![1; 3];
    m.h = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0 + d, 1.0, 1.0 + d, 1.0]);
    m.r = DMatrix::identity(3, 3) * (d * d);
    let exact = [
        [0.600_000_015_929_936_1, -0.299_999_997_964_967_46, -0.299_999_997_964_967_46],
        [-0.299_999_997_964_967_46, 0.399_999_993_836_517_63, -0.100_000_005_871_548_77],
        [-0.299_999_997_964_967_46, -0.100_000_005_871_548_77, 0.399_999_993_836_517_63],
    ];
    let (mut joseph, mut root) = (Kalman::new(&m), SquareRoot::new(&m).unwrap());
    for i in 0..3 {
        joseph.update(i, 0.0, None);
        root.update(i, 0.0, None);
    }
    let p = root.covariance();
    for i in 0..3 {
        for k in 0..3 {
            assert!((p[(i, k)] - exact[i][k]).abs() < 1e-8, "{i} {k}: {} for {}", p[(i, k)], exact[i][k]);
        }
    }
    let off: Vec<f64> = (0..3).map(|i| (joseph.p[(i, i)] / exact[i][i] - 1.0).abs()).collect();
    assert!(off.iter().all(|off| *off > 0.02), "this case no longer shows a difference: {off:?}");
}

/// What is not a covariance is refused.
#[test]
fn indefinite_covariances_are_refused() {
    let mut m = bias_and_drift();
    m.p0[(0, 0)] = -1.0;
    assert!(SquareRoot::new(&m).is_err());
    let mut m = bias_and_drift();
    m.q[(1, 1)] = -1e-9;
    assert!(SquareRoot::new(&m).is_err());
}
