//! What better parts buy and what wrong parameters cost, against identities and the same by other means.

use kfdesign::filter::gains::GainSequence;
use kfdesign::filter::judge::Judge;
use kfdesign::filter::mismatch::expect;
use kfdesign::filter::steady_state;
use kfdesign::params::Params;
use kfdesign::tune::{FACTORS, Insight, TuneOptions, Tuned, insight, sensor_model, tune};
use nalgebra::DMatrix;

use super::{gyro, gyro_with};

const HEADING: &str = r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz",
    "gauss_markov": {"std_dev": "3 deg", "correlation_time": "60 s"}}]}"#;

fn both(params: &Params) -> (Tuned, Insight) {
    let tuned = tune(params, &TuneOptions::default()).unwrap();
    let insight = insight(&tuned, &TuneOptions::default()).unwrap().remove(0);
    (tuned, insight)
}

fn close(found: f64, expected: f64, relative: f64) {
    assert!((found / expected - 1.0).abs() < relative, "{found} {expected}");
}

/// Factor one is the design itself: the sum of its error budget, reached by another equation.
#[test]
fn at_factor_one_it_is_the_design() {
    let (tuned, insight) = both(&gyro(HEADING));
    let report = &tuned.reports[0];
    let one = FACTORS.iter().position(|f| *f == 1.0).unwrap();
    let budgets = [&report.plant_budgets[0].error_budget, &report.error_budget];
    assert_eq!(insight.outputs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["angle", "drift"]);
    for (output, budget) in insight.outputs.iter().zip(budgets) {
        let sigma = budget.iter().map(|s| s.variance_si).sum::<f64>().sqrt();
        close(output.sigma, sigma, 1e-9);
        for worth in &output.worth {
            close(worth.sigma[one].unwrap(), sigma, 1e-9);
        }
    }
}

/// All noise of a sensor at rest times f is its error times f; of a random walk beside white noise the error grows
/// like √(f of either).
#[test]
fn sigma_scales_with_the_noise() {
    let (_, insight) = both(&gyro(r#"{"plant": "static"}"#));
    let output = &insight.outputs[0];
    let whole = output.worth.iter().find(|w| w.parameter == "sensor").unwrap();
    for (factor, sigma) in whole.factors.iter().zip(&whole.sigma) {
        close(sigma.unwrap(), factor * output.sigma, 1e-9);
    }
    let walk = gyro_with(r#""rate_random_walk": {"density": "0.001 deg/s/sqrt(s)"}"#, r#"{"plant": "static"}"#);
    let (_, insight) = both(&walk);
    let output = &insight.outputs[0];
    // P(k|k)² ≈ q r for a slow walk: the rest is of the order √(q/r) = 1.8e-5 per step, eight times in the worst row
    for name in ["white.density", "rate_random_walk.density"] {
        let worth = output.worth.iter().find(|w| w.parameter == name).unwrap();
        for (factor, sigma) in worth.factors.iter().zip(&worth.sigma) {
            close(sigma.unwrap(), factor.sqrt() * output.sigma, 1e-3);
        }
    }
}

/// A faster aid with as much noise per second says the same: rate × f with σ × √f changes the error by less than one
/// aid interval's worth.
#[test]
fn an_aid_twice_as_fast_is_one_with_less_noise() {
    let aid = |sigma: f64, rate: f64| {
        format!(
            r#"{{"plant": "angle", "aids": [{{"name": "heading", "std_dev": "{sigma} deg", "rate": "{rate} Hz"}}]}}"#
        )
    };
    let (_, slow) = both(&gyro(&aid(2.0, 1.0)));
    let rate = slow.outputs[1].worth.iter().find(|w| w.parameter == "heading.rate").unwrap();
    let at = |factor: f64| rate.sigma[FACTORS.iter().position(|f| *f == factor).unwrap()].unwrap();
    // exactly the design of that rate
    let (_, fast) = both(&gyro(&aid(2.0, 2.0)));
    close(at(2.0), fast.outputs[1].sigma, 1e-12);
    // the drift lives for 194 s: per second, half the noise power
    let (_, quiet) = both(&gyro(&aid(2.0 / std::f64::consts::SQRT_2, 1.0)));
    close(at(2.0), quiet.outputs[1].sigma, 0.01);
    // no design above the sample rate of 100 Hz
    let (_, every) = both(&gyro(&aid(2.0, 50.0)));
    let rate = every.outputs[0].worth.iter().find(|w| w.parameter == "heading.rate").unwrap();
    let missing: Vec<bool> = rate.sigma.iter().map(Option::is_none).collect();
    assert_eq!(missing, FACTORS.map(|f| f > 2.0));
}

/// The real variance under a wrong amount of noise is that of the budget with this source scaled: (1 + (f² − 1) share).
#[test]
fn wrong_amounts_of_noise_cost_what_the_budget_says() {
    let (tuned, insight) = both(&gyro(HEADING));
    let report = &tuned.reports[0];
    let budgets = [&report.plant_budgets[0].error_budget, &report.error_budget];
    let sources = [
        ("white.density", "white"),
        ("gauss_markov.std_dev", "gauss_markov"),
        ("heading.std_dev", "heading.white"),
        ("heading.gauss_markov.std_dev", "heading.gauss_markov"),
    ];
    for (parameter, source) in sources {
        for mistake in insight.mistakes.iter().filter(|m| m.parameter == parameter) {
            for (ratio, budget) in mistake.real_over_claimed.iter().zip(budgets) {
                let share = budget.iter().find(|s| s.source == source).unwrap().share;
                let expected = (1.0 + (mistake.factor * mistake.factor - 1.0) * share).sqrt();
                close(*ratio, expected, 1e-8);
            }
        }
    }
    let parameters = insight.mistakes.len() / 2;
    assert_eq!(parameters, 7, "all noise of the sensor, three of it, three of the aid");
}

/// A wrong correlation time: the recursion over a long run comes to the same error and the same NIS.
#[test]
fn a_wrong_correlation_time_costs_what_a_long_run_shows() {
    let mut params = gyro_with(
        r#""gauss_markov": {"std_dev": "0.05 deg/s", "correlation_time": "8 s"}"#,
        r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "1 deg", "rate": "5 Hz"}]}"#,
    );
    let (tuned, insight) = both(&params);
    let options = TuneOptions { design: params.design.clone(), ..TuneOptions::default() };
    for factor in [0.5, 2.0] {
        let path = "gauss_markov.correlation_time";
        params.axes[0].noise_parameters().find(|(name, _)| name == path).unwrap().1.value = 8.0 * factor;
        // without the constant bias, whose error dies away only like 1/t
        let drop = |model: kfdesign::model::LinearModel| {
            let kept: Vec<usize> = (0..model.states.len()).filter(|i| model.states[*i].name != "bias").collect();
            let square = |a: &DMatrix<f64>| a.select_rows(&kept).select_columns(&kept);
            kfdesign::model::LinearModel {
                states: kept.iter().map(|i| model.states[*i].clone()).collect(),
                f: square(&model.f),
                g: model.g.select_rows(&kept),
                h: model.h.select_columns(&kept),
                q: square(&model.q),
                x0: model.x0.select_rows(&kept),
                p0: square(&model.p0),
                outputs: Vec::new(),
                ..model
            }
        };
        let filter = drop(tuned.design.axes[0].model.clone());
        let truth = drop(sensor_model(&params.axes[0], params.quantity, 0.01, &options).unwrap());
        let filter = kfdesign::model::LinearModel { p0: steady_state(&filter).unwrap().predicted_covariance, ..filter };
        let mut start = truth.p0.clone();
        start[(0, 0)] = filter.p0[(0, 0)];
        let truth = kfdesign::model::LinearModel { p0: start, ..truth };
        // 400 s are more than 20 time constants of anything in it
        let (steps, last) = (40_001, 40_000);
        let gains = GainSequence::new(&filter, steps, &[last]);
        let identity = DMatrix::identity(2, 2);
        let judge = Judge { components: filter.states.clone(), of_truth: identity.clone(), of_estimate: identity };
        let run = expect(&filter, &truth, &gains, &judge, &[vec![]]);
        let error = &run.epochs[0];
        let ratio = |i: usize| (error.covariance[(i, i)] / error.claimed[(i, i)]).sqrt();
        let mistake = insight.mistakes.iter().find(|m| m.parameter == path && m.factor == factor).unwrap();
        for i in 0..2 {
            close(mistake.real_over_claimed[i], ratio(i), 1e-6);
        }
        // the run starts with the claimed covariance: the first 20 of 400 s are not yet those of the settled error
        let off = mistake.nis - 1.0;
        assert!(((run.innovations[0].nis - 1.0) / off - 1.0).abs() < 0.1, "{off} {}", run.innovations[0].nis);
    }
}

/// Half of the variance and 95 % of it: of a constant under white noise P = 1/(1/P0 + n/R).
#[test]
fn a_constant_is_known_when_the_samples_say_so() {
    let mut params = gyro(r#"{"plant": "static"}"#);
    params.axes[0].terms.truncate(1);
    let (tuned, insight) = both(&params);
    let model = &tuned.design.axes[0].model;
    let (p0, r) = (model.p0[(0, 0)], model.r[(0, 0)]);
    let samples = |left: f64| ((1.0 / left - 1.0) * r / p0).ceil();
    // after n samples the last was at (n − 1) dt
    let observed = &insight.observed[0];
    assert_eq!(observed.final_sigma, 0.0);
    close(observed.most_s.unwrap(), (samples(0.05) - 1.0) * 0.01, 1e-9);
    assert_eq!(observed.half_s, Some((samples(0.5) - 1.0).max(0.0) * 0.01));
    assert!(insight.outputs.is_empty() && insight.mistakes.iter().all(|m| m.real_over_claimed.is_empty()));
}

/// One state and white noise alone: |T|² = (1 − λ)²/|1 − λ e^(−jω)|² per measurement, half of it at cos ω = (1 + λ²
/// − 2 (1 − λ)²)/2λ.
#[test]
fn the_bandwidth_of_an_aided_angle_is_that_of_its_pole() {
    let mut params = gyro(r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "0.2 deg", "rate": "2 Hz"}]}"#);
    params.axes[0].terms.truncate(1);
    let tuned = tune(&params, &TuneOptions::default()).unwrap();
    let steady = &tuned.design.axes[0].steady_state;
    assert_eq!(steady.period, 50);
    let lambda = 1.0 - steady.gain[(0, 0)];
    let cosine = (1.0 + lambda * lambda - 2.0 * (1.0 - lambda).powi(2)) / (2.0 * lambda);
    close(tuned.reports[0].bandwidth_hz.unwrap(), cosine.acos() / (std::f64::consts::TAU * 0.5), 1e-9);
}
