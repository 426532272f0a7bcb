//! The exact likelihood against the density of the normal vector it stands for.

use kfdesign::filter::Kalman;
use kfdesign::filter::likelihood::{
    LogLikelihood, Stretch, diffuse_log_likelihood, diffuse_log_likelihoods, log_likelihoods_with_bias,
};
use kfdesign::model::{InitialBias, LinearModel, sensor_errors};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::units::Quantity;
use nalgebra::{Cholesky, DMatrix, DVector};

const DT: f64 = 0.1;
const N: f64 = 0.02;
const SIGMA: f64 = 0.3;
const TIME: f64 = 0.25;
const WALK: f64 = 0.05;

/// (value, bias, variance of the bias) with C = N²/dt I + σ² e^(−|i−j| dt/Tc) + K² dt min(i, j), restricted
/// likelihood with U = [1, t − t_mid]: −½ [n ln 2π + ln det C + zᵀ P z + ln det Uᵀ C⁻¹ U] (Harville 1974). `at`:
/// steps from the start of the log.
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

/// 700 samples, so that the filter settles (its slowest error mode is that of the constant the random walk has
/// become, or of the Gauss-Markov process), a gap of 37 and another of one, a sample that is not a number: every sum
/// is over less than a thousand terms of order one, so 1e-10 of ln L and 1e-9 of the bias are rounding.
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

/// A gap of 10¹⁵ samples costs no more than one of ten correlation times: what is before it says nothing of the
/// drift behind it, so both give the same to 1e-4 of the variance that is left (e^−20 = 2e-9 of correlation, 700
/// samples).
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

/// The same number step by step: one filter for the log, one for each regressor, every covariance carried to the
/// end, least squares after. `prior`: mean and variance of the bias.
fn step_by_step(model: &LinearModel, log: &[Stretch], slope: bool, prior: Option<[f64; 2]>) -> LogLikelihood {
    let total: u64 = log.iter().map(|part| part.missing + part.samples.len() as u64).sum();
    let middle = 0.5 * (total as f64 - 1.0);
    let columns = if slope { 3 } else { 2 };
    let mut filters = vec![Kalman::new(model); columns];
    filters[1..].iter_mut().for_each(|filter| filter.x.fill(0.0));
    let mean = prior.map_or(0.0, |[mean, _]| mean);
    let (mut sums, mut log_variance, mut count) = (DMatrix::zeros(columns, columns), 0.0, 0.0);
    let mut step = 0;
    for part in log {
        (0..part.missing).for_each(|_| filters.iter_mut().for_each(Kalman::predict));
        step += part.missing;
        for z in part.samples {
            if z.is_finite() {
                let column = [z - mean, 1.0, (step as f64 - middle) * DT];
                let updates: Vec<_> = filters.iter_mut().zip(column).map(|(f, z)| f.update(0, z, None)).collect();
                let s = updates[0].variance;
                sums += DMatrix::from_fn(columns, columns, |i, j| updates[i].innovation * updates[j].innovation / s);
                log_variance += s.ln();
                count += 1.0;
            }
            filters.iter_mut().for_each(Kalman::predict);
            step += 1;
        }
    }
    let [mean, variance] = prior.unwrap_or([0.0, 1.0]);
    let mut information = sums.view((1, 1), (columns - 1, columns - 1)).into_owned();
    information[(0, 0)] += prior.map_or(0.0, |[_, variance]| 1.0 / variance);
    let cross = sums.view((1, 0), (columns - 1, 1)).into_owned();
    let inverse = information.clone().try_inverse().unwrap();
    let best = &inverse * &cross;
    let rest = sums[(0, 0)] - cross.dot(&best);
    let value =
        count * std::f64::consts::TAU.ln() + log_variance + rest + information.determinant().ln() + variance.ln();
    LogLikelihood { value: -0.5 * value, bias: mean + best[0], bias_variance: inverse[(0, 0)] }
}

/// Models of one to nine states, F diagonal and not, each with 11 neighbours that differ: two turns through the log,
/// the second not full.
fn families() -> Vec<Vec<LinearModel>> {
    let white = |f: f64| Term::White { density: f * N };
    let drift = |f: f64, time: f64| Term::GaussMarkov { std_dev: f * SIGMA, correlation_time: time / f };
    let walk = |f: f64| Term::RateRandomWalk { density: WALK / f };
    let line = |f: f64| Term::Oscillation { std_dev: 0.1, frequency_hz: 1.3 * f, correlation_time: 3.0 };
    let mixtures: [&dyn Fn(f64) -> Vec<Term>; 9] = [
        &|f| vec![white(f)],
        &|f| vec![white(f), drift(f, TIME)],
        &|f| vec![white(f), drift(f, TIME), walk(f)],
        &|f| vec![white(f), drift(f, TIME), drift(1.0, 4.0), walk(f)],
        &|f| vec![white(f), drift(f, TIME), drift(1.0, 4.0), drift(1.0, 1.0), walk(f)],
        &|f| vec![white(f), Term::BiasInstability { coefficient: 0.1 * f }],
        &|f| vec![white(f), drift(f, TIME), line(f)],
        &|f| {
            vec![white(f), Term::Quantization { coefficient: 0.01 * f }, Term::MovingAverage { density: N, samples: 3 }]
        },
        &|f| vec![white(f), line(f), Term::BiasInstability { coefficient: 0.1 }],
    ];
    let of = |terms| sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, None, DT, 400.0).unwrap();
    let zero = Some(InitialBias { mean: 0.0, std_dev: 0.0 });
    let white = |terms| sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, zero, DT, 400.0).unwrap();
    let family = |(i, terms): (usize, &&dyn Fn(f64) -> Vec<Term>)| {
        let scales = (0..12).map(|k| 0.8 + 0.05 * f64::from(k));
        scales.map(|f| if i == 0 { white(terms(f)) } else { of(terms(f)) }).collect()
    };
    mixtures.iter().enumerate().map(family).collect()
}

/// 4000 samples, so that gains settle and the answer to the constant comes to rest, a gap, a sample that is not a
/// number: |ln L| and the sums in it are below 1e5, so 1e-9 is rounding. A constant of ten thousand standard
/// deviations, which is no part of the likelihood, rounds the samples to 1e-12 of those: 1e-6 after 4000 of them.
#[test]
fn models_side_by_side_are_those_one_by_one() {
    let value = |k: usize| 0.3 * (0.7 * k as f64).sin() + 0.3 * (0.013 * k as f64).cos();
    let series = |constant: f64| {
        let mut parts: [Vec<f64>; 2] = [0..3000, 3011..4011].map(|range| range.map(|k| constant + value(k)).collect());
        parts[0][1444] = f64::NAN;
        parts
    };
    let stretches = |parts: &'static [Vec<f64>; 2]| {
        [(0, &parts[0]), (11, &parts[1])].map(|(missing, samples)| Stretch { missing, samples })
    };
    let plain_log = stretches(Box::leak(Box::new(series(0.0))));
    for (constant, tolerance) in [(0.0, 1e-9), (1e3, 1e-6)] {
        let log = stretches(Box::leak(Box::new(series(constant))));
        for models in families() {
            let about = |constant: f64| (0..12).map(|k| [constant + 0.01 * f64::from(k), 0.04]).collect::<Vec<_>>();
            let found = [
                diffuse_log_likelihoods(&models, &log, false),
                diffuse_log_likelihoods(&models, &log, true),
                log_likelihoods_with_bias(&models, &log, &about(constant)),
            ];
            for (i, model) in models.iter().enumerate().step_by(3) {
                let expected = [(false, None), (true, None), (false, Some(about(0.0)[i]))];
                for (found, (slope, prior)) in found.iter().zip(expected) {
                    let plain = step_by_step(model, &plain_log, slope, prior);
                    let far = [
                        found[i].value - plain.value,
                        (found[i].bias - constant - plain.bias) / plain.bias_variance.sqrt(),
                        found[i].bias_variance / plain.bias_variance - 1.0,
                    ];
                    let n = model.states.len();
                    assert!(far.iter().all(|d| d.abs() < tolerance), "{n} states, {slope}, {prior:?}: {far:?}");
                }
            }
        }
    }
}

/// Companions change a number by no more than when gains count as settled: rounding.
#[test]
fn a_model_alone_is_that_in_company() {
    let samples: Vec<f64> = (0..3000).map(|k| 0.3 * (0.7 * f64::from(k)).sin()).collect();
    let log = [Stretch { missing: 0, samples: &samples }];
    for models in families() {
        let together = diffuse_log_likelihoods(&models, &log, false);
        for (model, found) in models.iter().zip(together).step_by(5) {
            let alone = diffuse_log_likelihood(model, &log, false);
            assert!((alone.value - found.value).abs() < 1e-9, "{} and {}", alone.value, found.value);
        }
    }
    let mixed: Vec<LinearModel> = families().into_iter().flat_map(|family| family.into_iter().take(2)).collect();
    let found = diffuse_log_likelihoods(&mixed, &log, false);
    for (model, found) in mixed.iter().zip(&found) {
        assert!((diffuse_log_likelihood(model, &log, false).value - found.value).abs() < 1e-9);
    }
    assert!(diffuse_log_likelihoods(&[], &log, false).is_empty());
}
