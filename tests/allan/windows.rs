//! Logs read in windows: the pooled curve against its definition, truth recovered, what is left out said.

use super::*;
use crate::support::Bench;
use kfdesign::allan::Pooled;

/// The mean over windows of the same length is the mean square over all differences within windows; degrees of
/// freedom add up. Tolerance: some roundings of sums of positive numbers.
#[test]
fn pooled_curve_is_its_definition() {
    let mixture = model(&[Term::White { density: 0.1 }, gauss_markov(0.05, 20.0)]);
    let (dt, samples, windows) = (0.5, 1200, 7);
    let rate = path(&mixture, dt, samples * windows, 5, 0);
    for kind in ALL {
        let mut pooled = Pooled::new(kind, samples, dt, TauGrid::Log(5));
        for window in rate.chunks(samples) {
            pooled.add(&deviation::phase(window, dt)).unwrap();
        }
        let mut curve = pooled.curve();
        assert_eq!((curve.windows, curve.samples), (7, samples));
        assert_eq!(curve.points.last().unwrap().m, {
            let largest = deviation::largest_factor(kind, samples);
            *tau::averaging_factors(TauGrid::Log(5), largest).last().unwrap()
        });
        curve.refine(&mixture);
        for point in &curve.points {
            let each: Vec<_> = rate
                .chunks(samples)
                .map(|window| deviation::variance(kind, &deviation::phase(window, dt), dt, point.m).unwrap())
                .collect();
            let terms: u64 = each.iter().map(|estimate| estimate.terms).sum();
            let squares: f64 = each.iter().map(|estimate| estimate.variance * estimate.terms as f64).sum();
            assert_eq!(point.terms, terms);
            let expected = (squares / terms as f64).sqrt();
            assert!((point.deviation / expected - 1.0).abs() < 1e-14, "{kind:?} m = {}", point.m);
            let edf = 7.0 * edf::degrees_of_freedom(kind, samples, point.m, dt, &mixture);
            assert!((point.edf / edf - 1.0).abs() < 1e-14);
        }
    }
    assert_eq!(
        Pooled::new(Deviation::Oadev, 10, 1.0, TauGrid::Octave).add(&[0.0; 10]).unwrap_err(),
        AllanError::TooShort { samples: 9, needed: 10 }
    );
}

/// One window is the whole log, to the bit.
#[test]
fn one_window_is_the_log() {
    let rate = nist();
    for kind in ALL {
        let mut pooled = Pooled::new(kind, rate.len(), 0.1, TauGrid::Octave);
        pooled.add(&deviation::phase(&rate, 0.1)).unwrap();
        assert_eq!(pooled.curve().points, allan::curve(&rate, 0.1, kind, TauGrid::Octave).unwrap().points);
    }
}

/// The variance of the pooled estimate is 2 V²/edf with the degrees of freedom added up, although the windows of a
/// Gauss-Markov process with a correlation time of a tenth of a window are not quite independent. 400 logs: the
/// sample variance has a standard deviation of 7 %; within 4 of them at five averaging times, false alarms 3e-4.
#[test]
fn degrees_of_freedom_add_up() {
    let mixture = model(&[Term::White { density: 0.1 }, gauss_markov(0.1, 30.0)]);
    let (dt, samples, windows, logs) = (1.0, 300, 6, 400);
    let mut sums = vec![[0.0; 2]; 5];
    let mut edfs = vec![0.0; 5];
    for run in 0..logs {
        let rate = path(&mixture, dt, samples * windows, 17, run);
        let mut pooled = Pooled::new(Deviation::Oadev, samples, dt, TauGrid::Log(2));
        rate.chunks(samples).for_each(|window| pooled.add(&deviation::phase(window, dt)).unwrap());
        let mut curve = pooled.curve();
        curve.refine(&mixture);
        for (i, point) in curve.points.iter().enumerate() {
            let ratio = point.deviation.powi(2) / mixture.allan_variance(point.m, dt);
            sums[i][0] += ratio;
            sums[i][1] += ratio * ratio;
            edfs[i] = point.edf;
        }
        assert_eq!(curve.points.len(), 5);
    }
    for ([sum, squares], edf) in sums.into_iter().zip(edfs) {
        let mean = sum / logs as f64;
        let variance = squares / logs as f64 - mean * mean;
        let expected: f64 = 2.0 / edf;
        assert!((mean - 1.0).abs() < 4.0 * (expected / logs as f64).sqrt(), "mean {mean}");
        assert!((variance / expected - 1.0).abs() < 0.28, "variance {variance}, expected {expected}");
    }
}

fn log(rate: &[f64]) -> String {
    let rows = rate.iter().map(|y| format!("{y}\n"));
    std::iter::once("x (rad/s)\n".to_string()).chain(rows).collect()
}

/// The command in windows: the truth lies in the intervals, the document says how many windows, stderr what was left
/// out.
#[test]
fn command_recovers_the_truth() {
    let mixture = model(&[Term::White { density: 0.01 }, gauss_markov(0.003, 20.0)]);
    let (dt, n) = (0.1, 60_000);
    let mut rate = path(&mixture, dt, n, 23, 0);
    rate[25_000] = f64::NAN;
    let bench = Bench::new();
    bench.file("log.csv", log(&rate));
    let out = bench.run("allan log.csv --rate 10 --window 1000s --json");
    assert_eq!(out.status, 0, "{}", out.stderr);
    // two windows before the unusable sample, with 5000 samples left, three behind it, with 4999 left
    assert!(
        out.stderr.contains("read in 5 windows of 1000 s, whose squares are averaged; 10000 samples fill no window"),
        "{}",
        out.stderr
    );
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let axis = &document["axes"][0];
    assert_eq!((&axis["windows"], &axis["samples"]), (&5.into(), &10_000.into()));
    assert_eq!(axis["model"], "white + gauss_markov");
    let list = |key: &str| -> Vec<f64> { axis[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
    let (tau, deviation, edf) = (list("tau_s"), list("deviation"), list("edf"));
    // within 4 standard deviations of the variance at each of 13 averaging times: false alarms 1e-3 with some skewness
    for i in 0..tau.len() {
        let truth = mixture.allan_variance((tau[i] / dt).round() as u64, dt);
        let off = (deviation[i].powi(2) / truth - 1.0) / (2.0 / edf[i]).sqrt();
        assert!(off.abs() < 4.0, "tau {}: {off} standard deviations", tau[i]);
    }
    assert_eq!(tau.len(), 13);
    assert!(bench.ok("allan log.csv --rate 10 --window 1000s").contains("of 5 windows of 10000 samples"));
}

/// Rates, increments and angles in windows are the same curve; the integral shares a point between windows.
#[test]
fn increments_and_angles_in_windows() {
    let increments: Vec<f64> = nist().iter().map(|y| (y * 1048576.0).round() / 1048576.0).collect();
    let mut angle = vec![0.0];
    for v in &increments {
        angle.push(angle[angle.len() - 1] + v);
    }
    let bench = Bench::new();
    let text = |unit: &str, values: &[f64]| {
        std::iter::once(format!("x ({unit})\n")).chain(values.iter().map(|v| format!("{v:e}\n"))).collect::<String>()
    };
    bench.file("rate.csv", text("deg/s", &increments.iter().map(|v| v / 0.01).collect::<Vec<f64>>()));
    bench.file("increments.csv", text("deg", &increments));
    bench.file("angle.csv", text("deg", &angle));
    let curve = |args: &str| {
        let stdout = bench.ok(&format!("allan {args} --rate 100 --window 2.5s --json"));
        let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
        let axis = &document["axes"][0];
        assert_eq!((&axis["windows"], axis["unit"].as_str()), (&4.into(), Some("deg/s")), "{args}");
        axis["deviation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect::<Vec<f64>>()
    };
    let from_rate = curve("rate.csv");
    for other in [curve("increments.csv --input increments"), curve("angle.csv --input angle")] {
        for (a, b) in from_rate.iter().zip(other) {
            assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
        }
    }
}

#[test]
fn windows_that_cannot_be() {
    let bench = Bench::new();
    let rows = nist()
        .into_iter()
        .enumerate()
        .map(|(i, y)| format!("{y},{}\n", if i == 500 { String::new() } else { y.to_string() }));
    bench.file("log.csv", std::iter::once("x (rad/s),y (rad/s)\n".to_string()).chain(rows).collect::<String>());
    for (window, expected) in [
        ("2.9s", "--window 2.9s: expected at least 30 samples: 3.000 s"),
        ("0s", "--window 0s: expected at least 30 samples: 3.000 s"),
        ("-5s", "--window"),
        ("5deg", "--window 5deg"),
        ("long", "expected a number and a unit, for example \"24h\""),
        ("101s", "log.csv: 1000 samples are fewer than a window of 1010; choose a shorter --window"),
        ("1e300h", "log.csv: 1000 samples are fewer than a window of"),
        ("60s --columns 2", "y: no window of 60.00 s without gaps and unusable samples fits in the log"),
    ] {
        let out = bench.run(&format!("allan log.csv --rate 10 --window={window}"));
        assert_eq!(out.status, 2, "{window}: {}", out.stderr);
        let last = out.stderr.lines().last().unwrap();
        assert!(last.contains(expected), "{window}: {last}");
        assert!(out.stdout.is_empty());
    }
}
