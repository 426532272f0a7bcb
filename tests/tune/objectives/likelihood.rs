//! Objective likelihood, against statsmodels; the likelihood itself against the plain filter.

use kfdesign::filter::SensorLog;
use kfdesign::filter::innovations::{log_likelihood, run};
use kfdesign::params::{AidEntry, Design, Params, PlantEntry};
use kfdesign::tune::objective::{Objective, Request};

use super::super::{DEGREE, close, gauss_markov, measured, random_walk, sensor, tuned, white};
use super::{chosen, log, moved, refused, request, uniform, with_intervals};

/// As tests/tune/reference.py makes it, rad/s.
fn log_at_rest() -> SensorLog {
    let (mut u, mut drift) = (uniform(), 0.0);
    let mut next = || u.next().unwrap();
    let sample = |_| {
        drift = 0.99 * drift + 0.05 * next();
        (0.1 + drift + 0.8 * next()) * DEGREE
    };
    let sensor: Vec<f64> = (0..3000).map(sample).collect();
    SensorLog { missing: vec![0; sensor.len()], sensor, aids: vec![] }
}

fn at_rest() -> Params {
    sensor(10.0, vec![white(0.1), gauss_markov(0.05, 10.0)], Some(0.5))
}

/// As tests/tune/reference.py makes it, SI.
fn log_that_turns() -> SensorLog {
    let (mut u, mut drift, mut angle) = (uniform(), 0.0, 0.0);
    let (mut gyro, mut heading) = (Vec::new(), Vec::new());
    for k in 0..4000 {
        let mut next = || u.next().unwrap();
        drift = 0.99 * drift + 0.1 * next();
        let rate = 2.0 * (0.02 * f64::from(k)).sin();
        gyro.push((rate + 0.05 + drift + 0.5 * next()) * DEGREE);
        let error = 1.5 * next();
        heading.push(if k % 5 == 0 { (angle + error) * DEGREE } else { f64::NAN });
        angle += 0.1 * rate;
    }
    SensorLog { missing: vec![0; gyro.len()], sensor: gyro, aids: vec![heading] }
}

fn turning() -> Params {
    let aid = AidEntry {
        name: "heading".into(),
        std_dev: measured(0.5, "deg"),
        rate: Some(measured(2.0, "Hz")),
        gauss_markov: None,
        measures: None,
    };
    let plant = PlantEntry::Angle { initial_std_dev: Some(measured(10.0, "deg")) };
    let params = sensor(10.0, vec![white(0.05), gauss_markov(0.1, 10.0)], Some(0.5));
    Params { design: Some(Design { plant, aids: vec![aid] }), ..params }
}

/// Name, maximum and standard deviation of its logarithm by tests/tune/reference.py (statsmodels 0.15.0, scipy 1.17.1).
type Reference = (&'static str, f64, f64);

/// `before`, `at`: ln L at the start and at the maximum in degrees; `count`: measurements.
#[track_caller]
fn assert_maximum(params: &Params, log_axis: SensorLog, count: f64, before: f64, at: f64, reference: &[Reference]) {
    let logs = log(vec![log_axis]);
    let (_, record) = chosen(params, &Request { logs: &logs, priors: false, ..request(Objective::Likelihood) });
    let found = &record.likelihood[0];
    // a density in 1/rad is 1/DEGREE times that in 1/deg
    let in_degrees = |value: f64| value + count * DEGREE.ln();
    // identity of the likelihood: both round some thousand terms
    assert!((in_degrees(found.fitted_before) - before).abs() < 1e-7, "{found:?}");
    // the search ends when it gains less than 1e-7
    assert!((in_degrees(found.fitted) - at).abs() < 1e-6, "{} {at}", in_degrees(found.fitted));
    for &(path, value, std_dev) in reference {
        let moved = moved(&record, path);
        // 1e-7 in ln L are 4.5e-4 standard deviations
        assert!((moved.to / value).ln().abs() < 2e-3 * std_dev, "{path}: {} {value}", moved.to);
        let [lower, upper] = moved.interval.unwrap();
        // second differences half a standard deviation wide
        close((upper / lower).ln() / (2.0 * 1.959_964), std_dev, 0.1);
    }
    assert_eq!(found.held_out_gain, None);
    assert!(found.at_limit.is_empty());
}

#[test]
fn a_sensor_at_rest_has_the_maximum_that_statsmodels_finds() {
    let reference = [
        ("white.density", 0.07314164591567882, 0.0133606),
        ("gauss_markov.std_dev", 0.09424068956911683, 0.14133091),
        ("gauss_markov.correlation_time", 9.680938569248328, 0.37106816),
    ];
    assert_maximum(&at_rest(), log_at_rest(), 3000.0, -176.80655444151307, 58.76623554635063, &reference);
}

#[test]
fn a_flight_with_a_compass_has_the_maximum_that_statsmodels_finds() {
    let reference = [
        ("gauss_markov.std_dev", 0.1909927369911168, 0.12255186),
        ("gauss_markov.correlation_time", 7.8122267610424965, 0.38437794),
        ("heading.std_dev", 0.4337772839944259, 0.03279683),
    ];
    assert_maximum(&turning(), log_that_turns(), 800.0, -652.8944973005609, -612.8279073766166, &reference);
}

/// The bias as an unknown with a prior against the plain filter with a state for it; gaps and samples that are no
/// numbers included.
#[test]
fn the_likelihood_is_that_of_the_plain_filter() {
    let mut log = log_at_rest();
    log.sensor[1700] = f64::NAN;
    log.sensor[0] = f64::NAN;
    (log.missing[40], log.missing[2000]) = (3, 500);
    for terms in [
        vec![white(0.07), gauss_markov(0.09, 10.0)],
        vec![white(0.07), gauss_markov(0.09, 10.0), gauss_markov(0.05, 0.3)],
        vec![white(0.07), random_walk(0.001)],
        vec![white(0.07)],
    ] {
        let mut params = sensor(10.0, terms, Some(0.5));
        params.axes[0].bias = Some(measured(0.02, "deg/s"));
        let model = &tuned(&params).design.axes[0].model;
        for rows in [1, 41, 2500, 3000] {
            let mut sum = 0.0;
            run(model, &log, rows, |_, _, update| sum += update.log_likelihood());
            let found = log_likelihood(model, &log, rows);
            // some thousand terms of size one, rounded
            assert!((found - sum).abs() < 1e-8 || rows == 1, "{rows} rows: {found} {sum}");
        }
    }
}

#[test]
fn a_prior_holds_what_the_log_tells_less_well() {
    let logs = log(vec![log_at_rest()]);
    // standard deviations of the logarithms by log 0.37 and by interval 0.005 for the time, 0.013 and 0.5 for the
    // density
    let known = [
        ("white.density", [0.04, 0.04 * (4.0 * 0.5_f64 * 0.98).exp()]),
        ("gauss_markov.correlation_time", [9.9, 10.1]),
        ("gauss_markov.std_dev", [0.02, 0.5]),
    ];
    let params = with_intervals(at_rest(), &known);
    let with = Request { logs: &logs, ..request(Objective::Likelihood) };
    let (_, record) = chosen(&params, &with);
    let time = moved(&record, "gauss_markov.correlation_time");
    assert!((time.factor - 1.0).abs() < 2e-3, "{time:?}");
    close(moved(&record, "white.density").to, 0.0731416, 2e-2);
    assert!(record.likelihood[0].priors);
    // what is held does not move at all, and keeps what is known of it
    let hold = ["gauss_markov".to_string()];
    let (tuned, record) = chosen(&params, &Request { hold: &hold, ..with });
    let held = moved(&record, "gauss_markov.std_dev");
    assert!(held.held && held.factor == 1.0 && held.from == held.to);
    let mut axis = tuned.design.axes[0].noise.clone();
    let kept: Vec<bool> = axis.noise_parameters().map(|(_, value)| value.interval.is_some()).collect();
    assert_eq!(kept, [false, true, true]);
}

#[test]
fn held_out_rows_are_foretold_from_those_before() {
    let logs = log(vec![log_at_rest()]);
    let third = Request { logs: &logs, held_out: 1.0 / 3.0, priors: false, ..request(Objective::Likelihood) };
    let (tuned, record) = chosen(&at_rest(), &third);
    let of_log = &record.likelihood[0].logs[0];
    assert_eq!((of_log.fitted_rows, of_log.held_out_rows), (2000, 1000));
    let model = &tuned.design.axes[0].model;
    let mut rest = 0.0;
    run(model, &logs[0].axes[0], 3000, |row, _, update| {
        rest += if row >= 2000 { update.log_likelihood() } else { 0.0 }
    });
    assert!((of_log.held_out - rest).abs() < 1e-7, "{of_log:?} {rest}");
    // the start is wrong by factors: what it foretells is far worse
    assert!(record.likelihood[0].held_out_gain.unwrap() > 20.0);
}

#[test]
fn what_the_likelihood_cannot_do_is_refused() {
    let none = request(Objective::Likelihood);
    assert!(refused(&at_rest(), &none).contains("needs a log: `log` LOG"));
    let long = sensor(10.0, vec![white(0.1), gauss_markov(0.05, 200.0)], Some(0.5));
    let logs = log(vec![log_at_rest()]);
    let short = Request { logs: &logs, ..none };
    let message = refused(&long, &short);
    assert!(message.contains("300.0 s") && message.contains("`hold` gauss_markov.correlation_time"), "{message}");
    assert!(refused(&at_rest(), &Request { held_out: 1.5, ..short }).contains("`held_out` is 1.5"));
}
