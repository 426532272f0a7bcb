//! Logs read in windows, and the maximum of the exact likelihood alone.

use super::*;
use crate::support::Bench;
use kfdesign::filter::likelihood::{Stretch, diffuse_log_likelihood};
use kfdesign::identify::maximum;
use kfdesign::identify::windows::Windows;
use kfdesign::model::sensor_errors;
use kfdesign::units::Quantity;

const DT: f64 = 0.1;

fn truth() -> NoiseModel {
    NoiseModel {
        terms: vec![Term::White { density: 0.01 }, Term::GaussMarkov { std_dev: 0.01, correlation_time: 20.0 }],
    }
}

fn in_windows(rate: &[f64], samples: usize, times: usize) -> Identified {
    let unit = Unit::parse("rad/s").unwrap();
    let mut windows = Windows::new("x", samples, DT, &unit);
    for _ in 0..times {
        rate.chunks_exact(samples).for_each(|window| windows.add(window).unwrap());
    }
    assert_eq!((windows.len(), windows.is_empty()), (rate.len() / samples * times, false));
    windows.identify(&parse_model("white+gm").unwrap(), &[]).unwrap()
}

/// Values of N, sigma and Tc.
fn values(found: &NoiseModel) -> [f64; 3] {
    match found.terms[..] {
        [Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }] => {
            [density, std_dev, correlation_time]
        }
        _ => panic!("{found:?}"),
    }
}

/// The same windows four times over have the same maximum, and standard deviations half as large: ln L is four times
/// that of once. 81 times: so many windows are held in groups. The search ends within 1e-4 standard deviations,
/// which is below 1e-5 of the parameters here.
#[test]
fn the_same_windows_again_and_again() {
    let rate = log(&truth().terms, 20_000, DT, 3, 0);
    let once = in_windows(&rate, 5000, 1);
    for times in [4, 81] {
        let often = in_windows(&rate, 5000, times);
        for (a, b) in values(&once.model).into_iter().zip(values(&often.model)) {
            assert!((a / b - 1.0).abs() < 1e-5, "{a} and {b}");
        }
        let root = (times as f64).sqrt();
        for (a, b) in once.precision.iter().zip(&often.precision) {
            assert!((a.cramer_rao_percent / b.cramer_rao_percent / root - 1.0).abs() < 1e-4, "{a:?} and {b:?}");
        }
        let gain = |found: &Identified| found.candidates[0].log_likelihood.unwrap();
        assert!((gain(&often) / gain(&once) / times as f64 - 1.0).abs() < 1e-9);
    }
}

/// 60 logs of five windows, each a hundred correlation times long: N, sigma and Tc are off by as much as is said.
/// Mean within 4 standard deviations of the mean of 60 and 0.2 (half of what the means of the windows take away of
/// the drift), mean square of (ln θ̂ − ln θ)/σ within 4 × √(2/60) of 1: six figures, false alarms 4e-4.
#[test]
fn windows_recover_the_truth() {
    let mut sums = [[0.0; 2]; 3];
    for run in 0..60 {
        let found = in_windows(&log(&truth().terms, 100_000, DT, 29, run), 20_000, 1);
        let precision: Vec<f64> = found.precision.iter().map(|p| p.cramer_rao_percent / 100.0).collect();
        for (i, (value, truth)) in values(&found.model).into_iter().zip(values(&truth())).enumerate() {
            let off = (value / truth).ln() / precision[i];
            sums[i][0] += off / 60.0;
            sums[i][1] += off * off / 60.0;
        }
    }
    for [mean, square] in sums {
        assert!(mean.abs() < 4.0 / 60_f64.sqrt() + 0.2, "{sums:?}");
        assert!((square - 1.0).abs() < 0.73, "{sums:?}");
    }
}

/// From a start that is off by factors of three to ten: ln L is that of the filter there, its slopes vanish, and
/// `identify` ends at the same place.
#[test]
fn maximum_alone() {
    let rate = log(&truth().terms, 30_000, DT, 7, 0);
    let stretch = [Stretch { missing: 0, samples: &rate }];
    let start = NoiseModel {
        terms: vec![Term::White { density: 0.03 }, Term::GaussMarkov { std_dev: 0.002, correlation_time: 3.0 }],
    };
    let (found, value) = maximum(&start, &[stretch.to_vec()], DT).unwrap();
    let at = |[density, std_dev, correlation_time]: [f64; 3]| {
        let terms = vec![Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }];
        let model = sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, None, DT, 3000.0).unwrap();
        diffuse_log_likelihood(&model, &stretch, false).value
    };
    let best = values(&found);
    // sums of 30 000 terms
    assert!((at(best) / value - 1.0).abs() < 1e-11);
    for i in 0..3 {
        for by in [0.99, 1.01] {
            let mut beside = best;
            beside[i] *= by;
            assert!(at(beside) < value, "{i} times {by}");
        }
    }
    let unit = Unit::parse("rad/s").unwrap();
    let whole = identify_axis("x", &rate, DT, &unit, Method::Likelihood, &parse_model("white+gm").unwrap()).unwrap();
    for (a, b) in best.into_iter().zip(values(&whole.model)) {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} and {b}");
    }
    let ramp = NoiseModel { terms: vec![Term::RateRamp { slope: 1.0 }] };
    assert!(maximum(&ramp, &[stretch.to_vec()], DT).is_none());
    assert!(maximum(&start, &[], DT).is_none());
}

fn text(rate: &[f64]) -> String {
    let rows = rate.iter().map(|y| format!("{y}\n"));
    std::iter::once("x (rad/s)\n".to_string()).chain(rows).collect()
}

/// The command: truth in the intervals (three of 99.99 %, fixed seed), how much was used, what was left out.
#[test]
fn command_in_windows() {
    let mut rate = log(&truth().terms, 60_000, DT, 23, 0);
    rate[25_000] = f64::NAN;
    let bench = Bench::new();
    bench.file("log.csv", text(&rate));
    let out = bench.run("identify log.csv --rate 10 --window 1000s --json -o params.json");
    assert_eq!(out.status, 0, "{}", out.stderr);
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let axis = &document["axes"][0];
    assert_eq!((&axis["samples"], &axis["left_out"]), (&50_000.into(), &10_000.into()));
    let said = axis["warnings"].to_string();
    assert!(
        said.contains("read in 5 windows of 1000 s, whose likelihoods are multiplied; 10000 samples fill no window"),
        "{said}"
    );
    let found = &document["params"]["axes"][0];
    let number = |value: &serde_json::Value| value["value"].as_f64().unwrap();
    let drift = &found["gauss_markov"][0];
    let expected = [(&found["white"]["density"], 0.01), (&drift["std_dev"], 0.01), (&drift["correlation_time"], 20.0)];
    for ((value, truth), precision) in expected.into_iter().zip(axis["precision"].as_array().unwrap()) {
        let sigma = precision["cramer_rao_percent"].as_f64().unwrap() / 100.0;
        assert!((number(value) / truth).ln().abs() < 4.0 * sigma, "{value}, expected {truth}");
    }
    // a temperature is left where it is
    let plain = text(&rate);
    let warm = plain.lines().enumerate().map(|(i, line)| match i {
        0 => format!("{line},temperature (degC)\n"),
        _ => format!("{line},{}\n", 20 + i % 7),
    });
    bench.file("warm.csv", warm.collect::<String>());
    let out = bench.run("identify warm.csv --rate 10 --window 1000s --json");
    assert_eq!(out.status, 0, "{}", out.stderr);
    let warm: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(warm["params"]["axes"], document["params"]["axes"]);
    assert!(warm["axes"][0]["warnings"].to_string().contains("outliers, steps and a temperature were not looked for"));
    // what comes out is read by what follows
    assert_eq!(bench.run("tune params.json -o filter.json").status, 0);
}

#[test]
fn what_has_no_windows() {
    let bench = Bench::new();
    bench.file("log.csv", text(&log(&truth().terms, 1000, DT, 5, 0)));
    for (flags, expected) in [
        ("--method allan", "--window 10s: only --method likelihood is identified in windows"),
        ("log.csv", "--window 10s: only one log is identified in windows"),
        ("--without-outliers", "--window 10s: only a log without --without-outliers is identified in windows"),
        ("--temperature t", "--window 10s: only a log without --temperature is identified in windows"),
    ] {
        let out = bench.run(&format!("identify log.csv --rate 10 --window 10s {flags} -o params.json"));
        assert_eq!(out.status, 2, "{flags}");
        assert!(out.stderr.lines().last().unwrap().contains(expected), "{flags}: {}", out.stderr);
        assert!(!bench.path("params.json").exists());
    }
}
