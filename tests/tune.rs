//! The tuned design against printed vectors and an independent implementation; its verification by Monte Carlo.

mod lines;
mod low_pass;
mod objectives;
mod under_truth;
mod walk;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use kfdesign::consistency::Verdict;
use kfdesign::filter::FilterDesign;
use kfdesign::montecarlo::{AxisOutcome, Plan, verify, verify_against};
use kfdesign::noise::Term;
use kfdesign::numerics::progress::{Progress, watched};
use kfdesign::params::{AxisParams, Measured, Params, TermEntry};
use kfdesign::tune::{TuneOptions, Tuned, sensor_model, tune};
use kfdesign::units::{Quantity, Unit};

use super::support::{Bench, data};

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn measured(value: f64, unit: &str) -> Measured {
    Measured { value, unit: Unit::parse(unit).unwrap(), interval: None }
}

fn white(density: f64) -> TermEntry {
    TermEntry::White { density: measured(density, "deg/s/sqrt(Hz)") }
}

fn gauss_markov(std_dev: f64, correlation_time: f64) -> TermEntry {
    TermEntry::GaussMarkov { std_dev: measured(std_dev, "deg/s"), correlation_time: measured(correlation_time, "s") }
}

fn random_walk(density: f64) -> TermEntry {
    TermEntry::RateRandomWalk { density: measured(density, "deg/s/sqrt(s)") }
}

fn sensor(rate_hz: f64, terms: Vec<TermEntry>, turn_on: Option<f64>) -> Params {
    Params {
        quantity: Quantity::AngularRate,
        sample_rate_hz: rate_hz,
        axes: vec![AxisParams {
            name: "x".into(),
            bias: None,
            turn_on_bias: turn_on.map(|b| measured(b, "deg/s")),
            temperature: None,
            terms,
            not_identified: vec![],
        }],
        design: None,
        source: None,
    }
}

fn tuned(params: &Params) -> Tuned {
    tune(params, &TuneOptions::default()).unwrap()
}

fn skydog() -> Params {
    Params::read(&data("params.json")).unwrap()
}

#[track_caller]
fn close(found: f64, expected: f64, relative: f64) {
    assert!((found / expected - 1.0).abs() <= relative, "found {found:e}, expected {expected:e}");
}

/// Scalar bias filter P² + P (R(1 − a²) − q) − q R = 0, solved with 50 digits (mpmath 1.4.1).
#[test]
fn the_reference_sensor_has_the_printed_steady_state() {
    let tuned = tuned(&skydog());
    assert_eq!(tuned.design.plant, "static");
    for (axis, report) in tuned.design.axes.iter().zip(&tuned.reports) {
        let (model, steady) = (&axis.model, &axis.steady_state);
        assert_eq!(model.states.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["bias", "gauss_markov"]);
        let square = DEGREE * DEGREE;
        close(model.f[(1, 1)], 0.9999484366508275, 1e-15);
        close(model.q[(1, 1)] / square, 8.119380012727685e-8, 1e-13);
        close(model.r[(0, 0)] / square, 0.315844, 1e-14);
        close(steady.predicted_covariance[(1, 1)] / square, 1.447161346948421e-4, 1e-11);
        close(steady.gain[(1, 0)], 4.579788052721312e-4, 1e-11);
        let updated = (1.0 - steady.gain[(1, 0)]) * steady.predicted_covariance[(1, 1)];
        close(updated / square, 1.44649857772371e-4, 1e-11);
        close(updated.sqrt() / DEGREE, 0.01202704692650573, 1e-11);
        let pole = steady.poles.iter().map(|p| p.0).fold(1.0, f64::min);
        close(pole, 0.9994904814604764, 1e-14);
        close(-model.dt / pole.ln(), 19.62137079497566, 1e-10);
        close(report.settling_time_s, 4.0 * 19.62137079497566, 1e-10);
        // the constant bias: no gain in the long run, known from the turn-on bias at the start
        assert_eq!(steady.gain[(0, 0)], 0.0);
        close(model.p0[(0, 0)].sqrt(), 0.6 * DEGREE, 1e-14);
        close(model.p0[(1, 1)].sqrt(), 0.0280596 * DEGREE, 1e-14);
        close(model.x0[0], -0.597 * DEGREE, 1e-14);
        assert_eq!(model.x0[1], 0.0);
        assert!(steady.residual < 1e-12 && steady.eigenvector_difference < 1e-6, "{steady:?}");
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    }
}

/// White, two Gauss-Markov processes and a rate random walk at 10 Hz, turn-on bias 0.02 deg/s.
fn four_sources() -> Params {
    let terms = vec![white(0.005), gauss_markov(0.01, 20.0), gauss_markov(0.004, 600.0), random_walk(2e-5)];
    sensor(10.0, terms, Some(0.02))
}

/// scipy 1.17.1: `solve_discrete_are` for the gain, then `solve_discrete_lyapunov(A, M Q_i M.T)` for each source,
/// A = (I − K H) F, M = I − K H; half power of H (I − A/z)⁻¹ K by `brentq`.
#[test]
fn the_error_budget_is_that_of_an_independent_implementation() {
    let report = &tuned(&skydog()).reports[0];
    let shares: Vec<(&str, f64)> = report.error_budget.iter().map(|s| (s.source.as_str(), s.share)).collect();
    assert_eq!(shares.iter().map(|s| s.0).collect::<Vec<_>>(), ["white", "gauss_markov"]);
    close(report.error_budget[0].variance_si, 1.9807916378634826e-8, 1e-9);
    close(report.error_budget[1].variance_si, 2.4254950068486526e-8, 1e-9);
    close(shares[0].1, 0.4495376260281606, 1e-9);
    close(report.bandwidth_hz.unwrap(), 0.008111306197709191, 1e-9);

    let report = &tuned(&four_sources()).reports[0];
    let expected = [
        ("white", 0.47874084525998367),
        ("rate_random_walk", 0.00014478871968564785),
        ("gauss_markov", 0.5157535631345471),
        ("gauss_markov.2", 0.005360802885783578),
    ];
    assert_eq!(report.error_budget.len(), expected.len());
    for (source, share) in expected {
        let found = report.error_budget.iter().find(|s| s.source == source).unwrap();
        close(found.share, share, 1e-8);
    }
    close(report.bandwidth_hz.unwrap(), 0.0859321961766555, 1e-8);
}

/// Identity: the shares are all there is, and their sum is the variance of the steady state.
#[test]
fn the_error_budget_adds_up_to_the_steady_variance() {
    let quantization = TermEntry::Quantization { coefficient: measured(1e-4, "deg") };
    let flicker = TermEntry::BiasInstability { coefficient: measured(10.0, "deg/h") };
    let average = TermEntry::MovingAverage { density: measured(0.03, "deg/s/sqrt(Hz)"), samples: 5 };
    let line = TermEntry::Oscillation {
        std_dev: measured(0.05, "deg/s"),
        frequency: measured(0.3, "Hz"),
        correlation_time: measured(2.0, "s"),
    };
    for extra in [
        vec![],
        vec![gauss_markov(0.02, 3.0), random_walk(1e-4)],
        vec![quantization],
        vec![line],
        vec![average],
        vec![flicker],
    ] {
        let mut terms = vec![white(0.01), gauss_markov(0.03, 200.0)];
        terms.extend(extra);
        let tuned = tuned(&sensor(100.0, terms, Some(0.1)));
        let (axis, report) = (&tuned.design.axes[0], &tuned.reports[0]);
        let (model, steady) = (&axis.model, &axis.steady_state);
        let mut d = model.h.clone();
        for (i, state) in model.states.iter().enumerate() {
            if state.name.starts_with("quantization")
                || state.name.starts_with("oscillation")
                || state.name.starts_with("moving")
            {
                d[(0, i)] = 0.0;
            }
        }
        let p = &steady.predicted_covariance;
        let updated = p - &steady.gain * &model.h * p;
        let total: f64 = report.error_budget.iter().map(|s| s.variance_si).sum();
        close(total, (&d * updated * d.transpose())[(0, 0)], 1e-9);
        close(report.error_budget.iter().map(|s| s.share).sum::<f64>(), 1.0, 1e-12);
        assert!(report.error_budget.iter().all(|s| s.variance_si > 0.0));
    }
}

/// numpy 2.4.6, 100 001 steps of the plain recursion P ← F P Fᵀ + Q, P ← P − K S Kᵀ; deg/s.
#[test]
fn predicted_sigma_is_that_of_the_plain_recursion() {
    #[rustfmt::skip]
    let expected = [
        (0.0, [0.013824713935727557, 0.009324439377935477, 0.00395800408598166], 0.012977184236380434),
        (0.1, [0.012259378791262708, 0.009190784373581458, 0.003949751173366036], 0.010043142382275907),
        (1.0, [0.01009964180838333, 0.009065271544303623, 0.0039400501449012165], 0.0049737089813174625),
        (10.0, [0.009002779689502121, 0.008651521337322585, 0.003936689649157572], 0.003827704071169006),
        (100.0, [0.006320416590701188, 0.006223433674240219, 0.003934488172254023], 0.003795032473658762),
        (1000.0, [0.003622524632603153, 0.004864681760411289, 0.0036916521121378013], 0.0037812629871770915),
        (10000.0, [0.0018146131946566372, 0.004722066404680591, 0.0031856294478212377], 0.0037799038813083217),
    ];
    let tuned = tuned(&four_sources());
    let predicted = &tuned.reports[0].predicted;
    assert_eq!(tuned.design.axes[0].model.states.len(), 3);
    for (time, sigma, total) in expected {
        let k = predicted.time_s.iter().position(|t| (t - time).abs() < 1e-9).unwrap();
        for (found, expected) in predicted.sigma.iter().zip(sigma) {
            close(found[k] / DEGREE, expected, 1e-9);
        }
        close(predicted.total[k] / DEGREE, total, 1e-9);
    }
}

#[test]
fn settling_of_the_drift_estimate_is_where_the_predicted_sigma_comes_within_five_percent() {
    let tuned = tuned(&skydog());
    let (axis, report) = (&tuned.design.axes[0], &tuned.reports[0]);
    let settled = report.drift_settling_time_s.unwrap();
    let total: f64 = report.error_budget.iter().map(|s| s.variance_si).sum();
    let mut filter = kfdesign::filter::Kalman::new(&axis.model);
    let mut last_outside = 0.0;
    for k in 0..60_000 {
        if k > 0 {
            filter.predict();
        }
        filter.update(0, 0.0, None);
        let sigma = (&axis.model.h * &filter.p * axis.model.h.transpose())[(0, 0)].sqrt();
        if (sigma / total.sqrt() - 1.0).abs() > 0.05 {
            last_outside = f64::from(k) * axis.model.dt;
        }
    }
    assert!((settled - last_outside - axis.model.dt).abs() < 1e-6, "{settled} {last_outside}");
}

#[test]
fn what_no_filter_can_tell_apart_is_one_state() {
    let names = |t: &Tuned| t.design.axes[0].model.states.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    // a rate random walk and the constant bias
    let walk = tuned(&sensor(100.0, vec![white(0.01), random_walk(1e-4)], Some(0.5)));
    assert_eq!(names(&walk), ["bias"]);
    let model = &walk.design.axes[0].model;
    close(model.q[(0, 0)], (1e-4 * DEGREE).powi(2) * 0.01, 1e-14);
    close(model.p0[(0, 0)].sqrt(), 0.5 * DEGREE, 1e-14);
    assert!(walk.reports[0].warnings.iter().any(|w| w.contains("share the state 'bias'")));
    // Two processes of the same correlation time
    let two = tuned(&sensor(100.0, vec![white(0.01), gauss_markov(0.03, 100.0), gauss_markov(0.04, 100.0)], Some(0.5)));
    assert_eq!(names(&two), ["bias", "gauss_markov"]);
    close(two.design.axes[0].model.p0[(1, 1)].sqrt(), 0.05 * DEGREE, 1e-14);
    // White noise in two parts is one density: 3-4-5
    let split = tuned(&sensor(100.0, vec![white(0.03), white(0.04), random_walk(1e-4)], Some(0.5)));
    close(split.design.axes[0].model.r[(0, 0)].sqrt(), 0.05 * DEGREE * 10.0, 1e-14);
    // A ramp's level is the bias too; its slope stays a state of its own
    let ramp = TermEntry::RateRamp { slope: measured(1e-5, "deg/s^2") };
    let ramp = tuned(&sensor(100.0, vec![white(0.01), random_walk(1e-4), ramp], Some(0.5)));
    assert_eq!(names(&ramp), ["bias", "rate_ramp.slope"]);
    let model = &ramp.design.axes[0].model;
    assert_eq!(model.f, nalgebra::dmatrix![1.0, 0.01; 0.0, 1.0]);
    assert_eq!(model.h, nalgebra::dmatrix![1.0, 0.0]);
    let plan = Plan { runs: 100, steps: 3000, seed: 3, alpha: 1e-5 };
    let outcome = verify(&ramp.design, &plan).unwrap();
    assert_eq!(outcome.verdict, Verdict::Consistent, "{:?}", outcome.tests);
}

#[test]
fn the_sensor_model_is_the_one_that_the_filter_is_built_on() {
    let params = four_sources();
    let model = sensor_model(&params.axes[0], params.quantity, 0.1, &TuneOptions::default()).unwrap();
    assert_eq!(model, tuned(&params).design.axes[0].model);
}

#[test]
fn what_the_parameters_leave_open_is_decided_by_a_stated_rule() {
    let p0 = |t: &Tuned| t.design.axes[0].model.p0[(0, 0)].sqrt() / DEGREE;
    let drift = tuned(&sensor(100.0, vec![white(0.01), gauss_markov(0.03, 100.0)], None));
    close(p0(&drift), 0.09, 1e-12);
    assert!(
        drift.reports[0].warnings[0].contains("three times the standard deviation of the whole drift, 0.09000 deg/s")
    );
    let mut params = sensor(100.0, vec![white(0.01), gauss_markov(0.03, 100.0)], None);
    params.axes[0].bias = Some(measured(-0.7, "deg/s"));
    let given = tuned(&params);
    close(p0(&given), 0.7, 1e-12);
    close(given.design.axes[0].model.x0[0], -0.7 * DEGREE, 1e-14);
    assert!(given.reports[0].warnings[0].contains("the size of the given bias"));
    // a bias near zero is no smaller than it is known, drift counts where that is more
    for (interval, expected, rule) in
        [([-0.39, 0.41], 0.4, "as far as its interval reaches, 0.4000 deg/s"), ([-0.04, 0.06], 0.09, "three times")]
    {
        params.axes[0].bias = Some(Measured { interval: Some(interval), ..measured(0.01, "deg/s") });
        let near_zero = tuned(&params);
        close(p0(&near_zero), expected, 1e-12);
        assert!(near_zero.reports[0].warnings[0].contains(rule), "{:?}", near_zero.reports[0].warnings);
    }
    let nothing = tuned(&sensor(100.0, vec![white(0.01)], None));
    close(p0(&nothing), 1.0, 1e-12);
    assert!(nothing.reports[0].warnings.iter().any(|w| w.contains("averages for ever")));
    assert!(nothing.reports[0].error_budget.is_empty() && nothing.reports[0].bandwidth_hz.is_none());
    // a constant in white noise: the variance is R/(k + 1 + R/P0) exactly
    let (model, predicted) = (&nothing.design.axes[0].model, &nothing.reports[0].predicted);
    for (time, sigma) in predicted.time_s.iter().zip(&predicted.sigma[0]) {
        let k = (time / model.dt).round();
        let r = model.r[(0, 0)];
        close(sigma * sigma, r / (k + 1.0 + r / model.p0[(0, 0)]), 1e-9);
    }
    let Err(error) = tune(&sensor(100.0, vec![gauss_markov(0.03, 100.0)], None), &TuneOptions::default()) else {
        panic!("no white noise was accepted")
    };
    assert!(error.to_string().contains("axis 'x': no measurement noise"), "{error}");
}

/// The Allan variance of the states and R of a design, from the closed forms for sampled Gauss-Markov and white noise.
fn allan_variance_of_design(design: &FilterDesign, m: f64) -> f64 {
    let model = &design.axes[0].model;
    let mut sum = model.r[(0, 0)] / m;
    for i in 0..model.states.len() {
        let (phi, q) = (model.f[(i, i)], model.q[(i, i)]);
        if q > 0.0 {
            let (u, variance) = (1.0 - phi, q / ((1.0 - phi) * (1.0 + phi)));
            let power = -(m * phi.ln()).exp_m1();
            let bracket = m * (1.0 + phi) / u - 2.0 * phi * power / (u * u) - phi * power * power / (u * u);
            sum += variance / (m * m) * bracket;
        }
    }
    sum
}

#[test]
fn flicker_is_approximated_within_the_stated_error() {
    for name in ["analog-devices-adis16505-1", "invensense-mpu-6000", "kvh-dsp-1760"] {
        let params = Params::read(&data(&format!("sensors/{name}.json"))).unwrap();
        let tuned = tuned(&params);
        let stated = tuned.reports[0].flicker.as_ref().unwrap();
        assert!(stated.max_relative_error < 0.01 && stated.added_to_r <= 0.01 && stated.states >= 4, "{stated:?}");
        let noise = params.axes[0].noise();
        assert!(noise.terms.iter().any(|t| matches!(t, Term::BiasInstability { .. })));
        let dt = 1.0 / params.sample_rate_hz;
        let error = |m: u64| {
            let ratio = allan_variance_of_design(&tuned.design, m as f64) / noise.allan_variance(m, dt);
            ratio.sqrt() - 1.0
        };
        for m in [1u64, 3, 30, 300, 3000, 30_000, 300_000, 1_000_000] {
            assert!(error(m).abs() <= stated.max_relative_error + 1e-12, "{name} {m} {}", error(m));
        }
        let worst = (stated.worst_tau_s / dt).round() as u64;
        close(error(worst).abs(), stated.max_relative_error, 1e-6);
        // Averaged over many samples, the fast states in R are as good as states: without them this would be
        // −added_to_r/2
        assert!(error(100).abs() < 0.25 * stated.added_to_r, "{name} {} {stated:?}", error(100));
    }
}

#[test]
fn every_shipped_sensor_tunes_and_verifies() {
    let sensors = std::fs::read_dir(data("sensors")).unwrap().map(|e| e.unwrap().path());
    let mut count = 0;
    for path in sensors.filter(|p| p.extension().is_some_and(|e| e == "json")) {
        let mut params = Params::read(&path).unwrap();
        params.axes.truncate(1);
        let tuned = tuned(&params);
        let steady = &tuned.design.axes[0].steady_state;
        assert!(steady.residual < 1e-9, "{}: {steady:?}", path.display());
        let plan = Plan { runs: 60, steps: 3000, seed: 5, alpha: 1e-5 };
        let outcome = verify(&tuned.design, &plan).unwrap();
        assert_eq!(outcome.verdict, Verdict::Consistent, "{}: {:#?}", path.display(), outcome.tests);
        count += 1;
    }
    assert!(count >= 4);
}

/// The false-alarm probability of the verdict is at most alpha, and not much less: 400 designs that are true, alpha
/// 0.05. Binomial(400, 0.05) exceeds 45 with probability 1e-7; were the size below 0.03, none at all would have
/// probability 5e-6.
#[test]
fn the_verdict_has_its_false_alarm_probability() {
    let tuned = tuned(&sensor(10.0, vec![white(0.05), gauss_markov(0.03, 2.0)], Some(0.1)));
    let alarms = (0..400)
        .filter(|&seed| {
            let plan = Plan { runs: 20, steps: 300, seed, alpha: 0.05 };
            verify(&tuned.design, &plan).unwrap().verdict == Verdict::Inconsistent
        })
        .count();
    println!("false alarms: {alarms} of 400");
    assert!((1..=45).contains(&alarms), "{alarms} of 400");
}

#[test]
fn a_wrong_design_is_caught() {
    let mut params = skydog();
    params.axes.truncate(1);
    let truth = tuned(&params).design;
    let plan = Plan { seed: 7, ..Plan::quick(100.0) };
    let outcome = verify(&truth, &plan).unwrap();
    assert_eq!(outcome.verdict, Verdict::Consistent, "{:#?}", outcome.tests);
    assert_eq!(outcome.alpha, 1e-3);
    let wrong = |change: &dyn Fn(&mut kfdesign::model::LinearModel)| {
        let mut design = truth.clone();
        change(&mut design.axes[0].model);
        verify_against(&design, &truth, &plan).unwrap()
    };
    for (what, outcome) in [
        ("Q x 5", wrong(&|m| m.q *= 5.0)),
        ("Q / 5", wrong(&|m| m.q /= 5.0)),
        ("R x 1.02", wrong(&|m| m.r *= 1.02)),
        ("P0 x 4", wrong(&|m| m.p0 *= 4.0)),
        ("P0 / 4", wrong(&|m| m.p0 /= 4.0)),
        ("Tc / 4", wrong(&|m| m.f[(1, 1)] = m.f[(1, 1)].powi(4))),
        ("x0 off by 1 sigma", wrong(&|m| m.x0[0] += m.p0[(0, 0)].sqrt())),
    ] {
        assert_eq!(outcome.verdict, Verdict::Inconsistent, "{what}: {:#?}", outcome.tests);
        let worst = outcome.tests.iter().filter(|t| !t.pass()).min_by(|a, b| a.p_value.total_cmp(&b.p_value)).unwrap();
        println!("{what}: {} p {:.1e}: {}", worst.name, worst.p_value, worst.meaning);
    }
}

/// With other states than the filter's, the truth is compared by the whole drift: the same truth in another order
/// passes (false alarm 1e-5), a second process that the filter does not have is seen.
#[test]
fn a_truth_of_other_states_is_judged_by_the_whole_drift() {
    let plan = Plan { runs: 100, steps: 3000, seed: 2, alpha: 1e-5 };
    let design = tuned(&sensor(10.0, vec![white(0.05), gauss_markov(0.03, 20.0)], Some(0.1))).design;
    let mut reordered = design.clone();
    let model = &mut reordered.axes[0].model;
    model.states.swap(0, 1);
    for matrix in [&mut model.f, &mut model.q, &mut model.p0] {
        matrix.swap_rows(0, 1);
        matrix.swap_columns(0, 1);
    }
    let same = verify_against(&design, &reordered, &plan).unwrap();
    assert_eq!(same.verdict, Verdict::Consistent, "{:#?}", same.tests);
    let walk = tuned(&sensor(10.0, vec![white(0.05), random_walk(1e-3)], Some(0.1))).design;
    let more = tuned(&sensor(10.0, vec![white(0.05), random_walk(1e-3), gauss_markov(0.03, 20.0)], Some(0.1))).design;
    let missing = verify_against(&walk, &more, &plan).unwrap();
    assert_eq!(missing.verdict, Verdict::Inconsistent, "{:#?}", missing.tests);
    let mut other_rate = design.clone();
    other_rate.sample_rate_hz = 20.0;
    assert!(verify_against(&design, &other_rate, &plan).unwrap_err().to_string().contains("20 Hz"));
}

#[test]
fn the_verification_is_the_same_for_any_number_of_threads_and_axes() {
    let params = skydog();
    let plan = Plan { runs: 30, steps: 500, seed: 11, alpha: 1e-3 };
    let design = tuned(&params).design;
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| serde_json::to_string(&verify(&design, &plan).unwrap()).unwrap())
    };
    let one = with(1);
    assert_eq!(one, with(4));
    // identical axes have their own random numbers; leaving one out changes no other
    let outcome = verify(&design, &plan).unwrap();
    assert_ne!(outcome.axes[0].innovations[0].nis, outcome.axes[1].innovations[0].nis);
    let mut first = design.clone();
    first.axes.truncate(1);
    let alone = verify(&first, &plan).unwrap();
    // the bounds are those of fewer tests, the measured numbers are the same
    let measured = |axis: &AxisOutcome| {
        let innovations = &axis.innovations[0];
        let statistics =
            (axis.nees.mean.clone(), axis.nees_average.mean, innovations.nis, innovations.autocorrelation.clone());
        (axis.errors.clone(), axis.credibility.clone(), statistics)
    };
    assert_eq!(measured(&alone.axes[0]), measured(&outcome.axes[0]));
    let other = verify(&design, &Plan { seed: 12, ..plan }).unwrap();
    assert_ne!(other.axes[0].innovations[0].nis, outcome.axes[0].innovations[0].nis);
}

#[test]
fn progress_counts_every_run() {
    #[derive(Default)]
    struct Count(AtomicU64);
    impl Progress for Count {
        fn advance(&self, parts: u64) {
            self.0.fetch_add(parts, Ordering::Relaxed);
        }
    }
    let count = Arc::new(Count::default());
    let watch: Arc<dyn Progress> = Arc::clone(&count) as _;
    let plan = Plan { runs: 7, steps: 100, seed: 1, alpha: 1e-3 };
    watched(&watch, || verify(&tuned(&skydog()).design, &plan)).unwrap().unwrap();
    assert_eq!(count.0.load(Ordering::Relaxed), 21);
    for plan in [Plan { runs: 1, ..plan }, Plan { steps: 3, ..plan }, Plan { alpha: 0.0, ..plan }] {
        let message = verify(&tuned(&skydog()).design, &plan).unwrap_err().to_string();
        assert!(message.contains("expected"), "{message}");
    }
}

#[test]
fn the_command_prints_a_design_and_writes_the_filter() {
    let bench = Bench::new();
    let params = data("params.json").display().to_string();
    let printed = bench.ok(&format!("tune {params} -o filter.json --report design.html --plot sigma.svg --runs 20"));
    for part in [
        "axes x, y, z (identical)",
        "tends to 0",
        "0.01203",
        "0.0004580",
        "time constant 19.62 s",
        "44.95 %",
        "Predicted sigma",
        "observable",
        "consistent: 20 runs of 600 s",
        "filter.json written",
    ] {
        assert!(printed.contains(part), "{part} is missing:\n{printed}");
    }
    let design = FilterDesign::read(&bench.path("filter.json")).unwrap();
    assert_eq!(design.axes.len(), 3);
    assert_eq!(design.tuning["verification"]["verdict"], "consistent");
    assert!(bench.read("design.html").contains("</html>"));
    assert!(bench.read("sigma.svg").starts_with("<svg"));
    // Same input, same bytes
    bench.ok(&format!("tune {params} -o again.json --runs 20"));
    assert_eq!(bench.read("again.json"), bench.read("filter.json"));
    let document: serde_json::Value =
        serde_json::from_str(&bench.ok(&format!("tune {params} --json --runs 20"))).unwrap();
    assert_eq!(document["filter"]["axes"].as_array().unwrap().len(), 3);
    assert_eq!(document["reports"][0]["name"], "x");
    assert_eq!(document["verification"]["verdict"], "consistent");
}

#[test]
fn the_command_refuses_what_it_cannot_tune() {
    let bench = Bench::new();
    bench.file(
        "quiet.json",
        r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{"name": "x",
        "gauss_markov": [{"std_dev": "0.03 deg/s", "correlation_time": "100 s"}]}]}"#,
    );
    for (args, part) in [
        ("tune quiet.json -o filter.json", "quiet.json: axis 'x': no measurement noise"),
        ("tune quiet.json -o quiet.json", "it is the input file"),
        ("tune none.json -o filter.json", "none.json: cannot read"),
        ("tune quiet.json --plant rocket", "unknown plant 'rocket'"),
        (
            "tune quiet.json --flicker-horizon -3",
            "quiet.json: axis 'x': horizon is -3; expected a number greater than zero\n",
        ),
    ] {
        let out = bench.run(args);
        assert_eq!(out.status, 2, "{args}: {}", out.stdout);
        assert!(out.stderr.contains(part), "{args}: {}", out.stderr);
        assert!(out.stdout.is_empty(), "{args}");
    }
    assert_eq!(bench.files(), ["quiet.json"]);
}
