//! Augmented matrices, steady states and discretisation against independent ones.

use kfdesign::filter::{FilterDesign, Kalman};
use kfdesign::model::discretize::angle_and_drift;
use kfdesign::params::Params;
use kfdesign::tune::{TuneOptions, tune};
use nalgebra::DMatrix;
use serde_json::Value;

use super::gyro;

/// Made by reference.py beside it.
const REFERENCE: &str = include_str!("reference.json");

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(value.clone()).unwrap();
    DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j])
}

/// Largest difference relative to what the rows and columns are of: √(d_ii d_jj) of a covariance, the largest entry
/// of others.
fn apart(found: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    assert_eq!(found.shape(), expected.shape());
    (found - expected).amax() / expected.amax().max(f64::MIN_POSITIVE)
}

#[test]
fn augmented_matrices_and_steady_states_are_those_of_numpy() {
    let cases: Vec<Value> = serde_json::from_str(REFERENCE).unwrap();
    assert_eq!(cases.len(), 4);
    for case in cases {
        let name = case["name"].as_str().unwrap();
        let params = Params::from_json(&case["params"].to_string(), name).unwrap();
        let tuned = tune(&params, &TuneOptions::default()).unwrap();
        let (model, steady) = (&tuned.design.axes[0].model, &tuned.design.axes[0].steady_state);
        // both are sums and products of a few doubles: some roundings of the largest entry of the block
        for (letter, found) in [("F", &model.f), ("H", &model.h), ("P0", &model.p0)] {
            assert!(apart(found, &matrix(&case[letter])) < 1e-12, "{name} {letter}");
        }
        if !model.inputs.is_empty() {
            assert!(apart(&model.g, &matrix(&case["G"])) < 1e-12, "{name} G");
        }
        let q = matrix(&case["Q"]);
        for i in 0..q.nrows() {
            for j in 0..q.ncols() {
                // Van Loan's exponential cancels where a state is reached only through another
                let size = (q[(i, i)] * q[(j, j)]).sqrt();
                assert!(
                    (model.q[(i, j)] - q[(i, j)]).abs() <= 1e-12 * size,
                    "{name} Q{i}{j}: {} {}",
                    model.q[(i, j)],
                    q[(i, j)]
                );
            }
        }
        let numbers = |key: &str| -> Vec<f64> { serde_json::from_value(case[key].clone()).unwrap() };
        for (found, expected) in model.r.diagonal().iter().zip(numbers("R")) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{name} R: {found} {expected}");
        }
        let every: Vec<usize> = serde_json::from_value(case["every"].clone()).unwrap();
        assert_eq!((&model.every, Some(steady.period)), (&every, case["period"].as_u64()), "{name}");
        // the recursion stops at changes of 1e-14 per period; what is left is that times the periods in a time constant
        let p = matrix(&case["predicted_covariance"]);
        for i in 0..p.nrows() {
            for j in 0..p.ncols() {
                let size = (p[(i, i)] * p[(j, j)]).sqrt();
                let found = steady.predicted_covariance[(i, j)];
                assert!((found - p[(i, j)]).abs() <= 1e-9 * size, "{name} P{i}{j}: {found} {}", p[(i, j)]);
            }
        }
        assert!(apart(&steady.gain, &matrix(&case["gain"])) < 1e-9, "{name} gain");
        assert!(steady.residual < 1e-11, "{name}: {}", steady.residual);
        // a moving average forgets within a period, so that the eigenvectors of the plant vertical are none
        let exists = name != "vertical";
        assert_eq!(steady.eigenvector_difference < 1e-6, exists, "{name}: {}", steady.eigenvector_difference);
        assert_eq!(steady.eigenvector_difference.is_nan(), !exists, "{name}: {}", steady.eigenvector_difference);
    }
}

#[test]
fn the_sampled_integration_tends_to_the_continuous_one() {
    let degrees = std::f64::consts::PI / 180.0;
    let (density, std_dev, tc) = (0.0562 * degrees, 0.0280596 * degrees, 193.9312);
    let params = gyro(r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#);
    for rate in [100.0, 1.0, 0.1] {
        let dt = 1.0 / rate;
        let mut params = params.clone();
        params.sample_rate_hz = rate;
        params.design.as_mut().unwrap().aids[0].rate = None;
        let tuned = tune(&params, &TuneOptions::default()).unwrap();
        let model = &tuned.design.axes[0].model;
        let (f, q) = angle_and_drift(density, std_dev, tc, dt);
        // states angle, bias, gauss_markov; held over a sample instead of decaying within it: relative dt/2Tc, to
        // second order
        let x = dt / tc;
        let of_drift = model.f[(0, 2)] / f[(0, 1)] - 1.0;
        assert!((of_drift - x / 2.0).abs() < x * x, "{of_drift} {x}");
        assert!((model.f[(2, 2)] - f[(1, 1)]).abs() < 1e-15 && (model.q[(2, 2)] / q[(1, 1)] - 1.0).abs() < 1e-12);
        // N² dt in both; the drift within a sample adds (2σ²/3Tc) dt³ in the continuous form
        let within = 2.0 * std_dev * std_dev / (3.0 * tc) * dt.powi(3);
        assert!((q[(0, 0)] - model.q[(0, 0)] - within).abs() < x * within + 1e-15 * q[(0, 0)]);
        // and a correlation −σ² Tc (dt/Tc)² that the sampled form has not
        assert!((q[(0, 1)] / (-std_dev * std_dev * tc * x * x) - 1.0).abs() < 2.0 * x && model.q[(0, 2)] == 0.0);
        assert_eq!(model.g.as_slice(), [dt, 0.0, 0.0]);
    }
}

#[test]
fn the_steady_state_is_where_the_running_filter_comes_to() {
    let params = gyro(
        r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "2 Hz"},
            {"name": "course", "std_dev": "5 deg", "rate": "5 Hz", "gauss_markov": {"std_dev": "1 deg", "correlation_time": "3 s"}}]}"#,
    );
    let tuned = tune(&params, &TuneOptions::default()).unwrap();
    let axis = &tuned.design.axes[0];
    assert_eq!((axis.steady_state.period, axis.model.every.as_slice()), (100, &[50, 20][..]));
    // without the constant bias, which is learnt for ever
    let mut model = axis.model.clone();
    let bias = model.states.iter().position(|state| state.name == "bias").unwrap();
    model.p0[(bias, bias)] = 0.0;
    let mut kalman = Kalman::new(&model);
    let n = model.states.len();
    let periods = (3.0 * axis.steady_state.settling_time).ceil() as u64;
    let mut over_a_period = DMatrix::identity(n, n);
    for step in 0..periods * 100 {
        if step % 100 == 0 {
            over_a_period = DMatrix::identity(n, n);
        }
        for i in 0..2 {
            if step % model.every[i] as u64 == 0 {
                kalman.update(i, 0.0, None);
                let h = model.h.row(i);
                let gain = &kalman.p * h.transpose() / model.r[(i, i)];
                over_a_period = (DMatrix::identity(n, n) - gain * h) * over_a_period;
            }
        }
        kalman.predict();
        over_a_period = &model.f * over_a_period;
    }
    let p = &axis.steady_state.predicted_covariance;
    for i in 0..n {
        for j in 0..n {
            // e^−12 of the start is left, twice over in a covariance; the start of the angle is 50 times its end
            let size = (p[(i, i)] * p[(j, j)]).sqrt();
            assert!((kalman.p[(i, j)] - p[(i, j)]).abs() <= 1e-6 * size, "{i} {j}: {} {}", kalman.p[(i, j)], p[(i, j)]);
        }
    }
    // poles per sample: their hundredth powers are the eigenvalues over a period
    let mut found: Vec<f64> = axis.steady_state.poles.iter().map(|z| z.0.hypot(z.1).powi(100)).collect();
    let mut expected: Vec<f64> = over_a_period.complex_eigenvalues().iter().map(|z| z.norm()).collect();
    found.sort_by(f64::total_cmp);
    expected.sort_by(f64::total_cmp);
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}

#[test]
fn the_error_budget_adds_up_and_predicted_sigmas_reach_the_steady_ones() {
    for case in serde_json::from_str::<Vec<Value>>(REFERENCE).unwrap() {
        let name = case["name"].as_str().unwrap();
        let params = Params::from_json(&case["params"].to_string(), name).unwrap();
        let tuned = tune(&params, &TuneOptions::default()).unwrap();
        let (axis, report) = (&tuned.design.axes[0], &tuned.reports[0]);
        let (p, h, k) = (&axis.steady_state.predicted_covariance, &axis.model.h, &axis.steady_state.gain);
        let updated = p - k * h * p;
        let budgets = report.plant_budgets.iter().map(|b| &b.error_budget).chain([&report.error_budget]);
        assert_eq!(report.plant_budgets.len() + 1, axis.model.outputs.len());
        for (output, budget) in axis.model.outputs.iter().zip(budgets) {
            let row = DMatrix::from_row_slice(1, output.row.len(), &output.row);
            let steady = (&row * &updated * row.transpose())[0];
            let sum: f64 = budget.iter().map(|share| share.variance_si).sum();
            assert!((sum / steady - 1.0).abs() < 1e-6, "{name} {}: {sum:e} {steady:e}", output.name);
            assert!((budget.iter().map(|share| share.share).sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(budget.iter().all(|share| share.variance_si >= 0.0), "{name} {}: {budget:?}", output.name);
        }
        // the plain recursion at one of the shown times
        let at = report.predicted.time_s.iter().position(|t| *t > 3.0).unwrap();
        let steps = (report.predicted.time_s[at] / axis.model.dt).round() as u64;
        let mut kalman = Kalman::new(&axis.model);
        for step in 0..=steps {
            if step > 0 {
                kalman.predict();
            }
            for (i, every) in axis.model.every.iter().enumerate() {
                if step % *every as u64 == 0 {
                    kalman.update(i, 0.0, None);
                }
            }
        }
        assert_eq!(steps % axis.steady_state.period, 0, "{name}: all measurements are taken at the times shown");
        for (i, sigma) in report.predicted.sigma.iter().enumerate() {
            let expected = kalman.p[(i, i)].sqrt();
            assert!((sigma[at] / expected - 1.0).abs() < 1e-9, "{name} {i}: {} {expected}", sigma[at]);
        }
        // and the document reads back
        let read = FilterDesign::from_json(&tuned.design.to_json(), "filter.json").unwrap();
        assert_eq!((&read.axes[0].model, &read.design), (&axis.model, &tuned.design.design), "{name}");
        let (found, expected) = (&read.axes[0].steady_state, &axis.steady_state);
        assert_eq!(
            (found.period, &found.gain, &found.poles),
            (expected.period, &expected.gain, &expected.poles),
            "{name}"
        );
    }
}
