//! The exact likelihood against the density of the normal vector it stands for.

use kfdesign::filter::likelihood::{Stretch, diffuse_log_likelihood};
use kfdesign::model::sensor_errors;
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::units::Quantity;
use nalgebra::{Cholesky, DMatrix, DVector};

const DT: f64 = 0.1;
const N: f64 = 0.02;
const SIGMA: f64 = 0.3;
const TIME: f64 = 0.25;
const WALK: f64 = 0.05;

/// (value, bias, variance of the bias) with C = N²/dt I + σ² e^(−|i−j| dt/Tc) + K² dt min(i, j), restricted likelihood with U = [1, t − t_mid]:
/// −½ [n ln 2π + ln det C + zᵀ P z + ln det Uᵀ C⁻¹ U] (Harville 1974). `at`: steps from the start of the log.
fn by_the_book(at: &[usize], z: &[f64], slope: bool, [drift, walk]: [bool; 2]) -> (f64, f64, f64) {
    let n = at.len();
    let total = at.last().unwrap() + 1;
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let apart = at[i].abs_diff(at[j]) as f64 * DT;
        let white = if i == j { N * N / DT } else { 0.0 };
        let walk = if walk { WALK * WALK * DT * at[i].min(at[j]) as f64 } else { 0.0 };
        let drift = if drift { SIGMA * SIGMA * (-apart / TIME).exp() } else { 0.0 };
        white + drift + walk
    });
    let middle = 0.5 * (total as f64 - 1.0);
    let u = DMatrix::from_fn(n, 1 + usize::from(slope), |i, j| if j == 0 { 1.0 } else { (at[i] as f64 - middle) * DT });
    let factor = Cholesky::new(covariance).unwrap();
    let z = DVector::from_column_slice(z);
    let information = u.transpose() * factor.solve(&u);
    let inverse = information.clone().try_inverse().unwrap();
    let best = &inverse * (u.transpose() * factor.solve(&z));
    let left = &z - &u * &best;
    let log_det = 2.0 * factor.l().diagonal().iter().map(|l| l.ln()).sum::<f64>();
    let value = n as f64 * std::f64::consts::TAU.ln()
        + log_det
        + left.dot(&factor.solve(&left))
        + information.determinant().ln();
    (-0.5 * value, best[0], inverse[(0, 0)])
}

fn noise([drift, walk]: [bool; 2]) -> NoiseModel {
    let mut terms = vec![Term::White { density: N }];
    if drift {
        terms.push(Term::GaussMarkov { std_dev: SIGMA, correlation_time: TIME });
    }
    if walk {
        terms.push(Term::RateRandomWalk { density: WALK });
    }
    NoiseModel { terms }
}

/// 700 samples, so that the filter settles (its slowest error mode is that of the constant the random walk has become, or of the
/// Gauss-Markov process), a gap of 37 and another of one, a sample that is not a number: every sum is over less than a thousand terms of order one,
/// so 1e-10 of ln L and 1e-9 of the bias are rounding.
#[test]
fn likelihood_is_that_of_the_normal_vector() {
    let kinds = [[true, false], [false, true], [true, true]];
    for (slope, kinds) in [false, true].into_iter().flat_map(|slope| kinds.map(|kinds| (slope, kinds))) {
        let model = sensor_errors(Quantity::AngularRate, &noise(kinds), None, DT, 100.0).unwrap();
        let value = |k: usize| (0.7 * k as f64).sin() + 0.3 * (0.013 * k as f64).cos() + 2.0;
        let parts: [(u64, std::ops::Range<usize>); 3] = [(0, 0..500), (37, 537..640), (1, 641..738)];
        let mut samples: Vec<Vec<f64>> = parts.iter().map(|(_, range)| range.clone().map(value).collect()).collect();
        samples[0][444] = f64::NAN;
        let log: Vec<Stretch> =
            parts.iter().zip(&samples).map(|((missing, _), s)| Stretch { missing: *missing, samples: s }).collect();
        let found = diffuse_log_likelihood(&model, &log, slope);
        let at: Vec<usize> = parts.iter().flat_map(|(_, range)| range.clone()).filter(|k| *k != 444).collect();
        let z: Vec<f64> = at.iter().map(|k| value(*k)).collect();
        let (value, bias, variance) = by_the_book(&at, &z, slope, kinds);
        assert!((found.value / value - 1.0).abs() < 1e-10, "slope {slope}, {kinds:?}: {} for {value}", found.value);
        assert!((found.bias / bias - 1.0).abs() < 1e-9, "{} for {bias}", found.bias);
        assert!((found.bias_variance / variance - 1.0).abs() < 1e-9, "{} for {variance}", found.bias_variance);
    }
}

/// A gap of 10¹⁵ samples costs no more than one of ten correlation times: what is before it says nothing of the drift behind it, so both give the
/// same to 1e-4 of the variance that is left (e^−20 = 2e-9 of correlation, 700 samples).
#[test]
fn a_gap_of_years_is_one_step() {
    let model = sensor_errors(Quantity::AngularRate, &noise([true, false]), None, DT, 100.0).unwrap();
    let [before, after]: [Vec<f64>; 2] = [0.7, 1.3].map(|f| (0..700).map(|k| (f * f64::from(k)).sin()).collect());
    let value = |missing| {
        let log = [Stretch { missing: 0, samples: &before }, Stretch { missing, samples: &after }];
        diffuse_log_likelihood(&model, &log, false).value
    };
    let (long, short) = (value(1_000_000_000_000_000), value(50));
    assert!((long - short).abs() < 1e-4 && long.is_finite(), "{long} {short}");
}

#[test]
fn too_few_samples_have_no_likelihood() {
    let model = sensor_errors(Quantity::AngularRate, &noise([true, false]), None, DT, 100.0).unwrap();
    let of = |samples: &[f64], slope| diffuse_log_likelihood(&model, &[Stretch { missing: 0, samples }], slope).value;
    assert!(of(&[], false).is_nan() && of(&[1.0], false).is_nan() && of(&[1.0, 2.0], true).is_nan());
    assert!(of(&[f64::NAN; 9], false).is_nan());
    assert!(of(&[1.0, 1.5], false).is_finite() && of(&[1.0, 1.5, 1.2], true).is_finite());
}
