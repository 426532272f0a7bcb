//! Logs with holes: curves and spectra see a stretch whose short holes are filled in, the filter all that is there.

use kfdesign::compare::{Comparison, Log, LogAxis, compare};
use kfdesign::noise::Term;
use kfdesign::signal::bridge::bridge;

use super::{WHITE, drift, log, params, test, whole};
use crate::support::Bench;

/// The log without the samples for which `hole` holds: filled for the curves, in pieces for the filter.
pub fn with_holes(log: Log, hole: impl Fn(usize) -> bool) -> Log {
    let axis = |axis: LogAxis| {
        let all: Vec<f64> = axis.rate.iter().enumerate().map(|(k, x)| if hole(k) { f64::NAN } else { *x }).collect();
        let (mut pieces, mut missing) = (vec![], 0);
        for part in all.chunk_by(|a, b| a.is_nan() == b.is_nan()) {
            match part[0].is_nan() {
                true => missing = part.len() as u64,
                false => pieces.push((std::mem::take(&mut missing), part.to_vec())),
            }
        }
        let found = bridge(&all).expect("a longer stretch");
        LogAxis { filled: found.filled, rate: found.samples, whole: pieces, ..axis }
    };
    Log { axes: log.axes.into_iter().map(axis).collect(), ..log }
}

/// In threes.
pub fn three_in_a_hundred(sample: usize) -> bool {
    sample / 3 * 7919 % 1000 < 30 && sample > 3
}

/// Three of every hundred samples are missing. 30 logs of their own model, of which 1.5 % are rejected (1000 twice
/// as long, docs/validation.md): six or more of 30 with a probability of 5e-6, and of 2e-4 were it twice that.
#[test]
fn true_models_are_kept_beside_holes() {
    let model = [WHITE, drift(0.05)];
    let results: Vec<Comparison> = (0..30)
        .map(|run| {
            compare(&params(&model), &with_holes(log(&params(&model), 3000, run), three_in_a_hundred), 0.01).unwrap()
        })
        .collect();
    let rejected = results.iter().filter(|r| r.tests.iter().any(|t| t.adjusted_p_value < 0.01)).count();
    assert!(rejected < 6, "{rejected}");
    // what follows its neighbours in more than the level is said
    let averaged = [Term::White { density: 0.03 }, Term::MovingAverage { density: 0.1, samples: 3 }];
    let log = with_holes(log(&params(&averaged), 3000, 0), three_in_a_hundred);
    let notes = &compare(&params(&averaged), &log, 0.01).unwrap().axes[0].notes;
    assert!(notes.iter().any(|note| note.starts_with("2.900 % of the samples are filled in")), "{notes:?}");
    assert!(results[0].axes[0].notes.is_empty());
    assert!(super::compared(&averaged, &averaged, 3000, 0).axes[0].notes.is_empty());
    let missing = (0..3000).filter(|k| three_in_a_hundred(*k)).count();
    for axis in results.iter().map(|result| &result.axes[0]) {
        assert!(axis.filled > missing - 20 && axis.samples > 2900, "{} of {}", axis.filled, axis.samples);
    }
}

/// The louder third of a log is before a hole that is too long to fill, so the curves do not see it; the filter
/// does: (8000·4 + 12,000)/20,000 = 2.2 for the mean of NIS (five standard deviations: √(2 (8000·16 +
/// 12,000))/20,000 = 0.0265).
#[test]
fn the_filter_sees_both_sides_of_a_long_hole() {
    let of = |density: f64, samples, run| log(&params(&[Term::White { density }]), samples, run).axes.remove(0).rate;
    let (before, after) = (of(0.2, 8000, 1), of(0.1, 12_000, 2));
    let axis = LogAxis { left_out: before.len(), whole: vec![(0, before), (5000, after.clone())], ..whole("x", after) };
    let seen = Log { axes: vec![axis], ..log(&params(&[WHITE]), 200, 0) };
    let found = compare(&params(&[WHITE]), &seen, 0.01).unwrap();
    let nis = found.axes[0].innovations.as_ref().unwrap().nis.unwrap().mean;
    assert!((nis - 2.2).abs() < 5.0 * 0.0265, "{nis}");
    assert!(test(&found, "allan_curve").pass() && !test(&found, "nis").pass());
    assert_eq!((found.axes[0].samples, found.axes[0].left_out), (12_000, 8000));
}

/// A random walk goes on in a hole of 20,000 samples beside 1000 on either side: K √(2000 s) = 4.5 where a step is
/// 0.05. A filter that did not know of the hole would have one innovation of some ninety standard deviations, and a
/// mean of NIS of about 5.
#[test]
fn drift_goes_on_in_a_hole() {
    let model = [Term::White { density: 0.01 }, Term::RateRandomWalk { density: 0.1 }];
    let of_model = log(&params(&model), 22_000, 9);
    let rate = &of_model.axes[0].rate;
    let [early, late] = [rate[..1000].to_vec(), rate[21_000..].to_vec()];
    assert!((early[999] - late[0]).abs() > 1.5, "{} {}", early[999], late[0]);
    let axis = LogAxis { left_out: 1000, whole: vec![(0, early), (20_000, late.clone())], ..whole("x", late) };
    let seen = Log { axes: vec![axis], ..of_model };
    let found = compare(&params(&model), &seen, 0.01).unwrap();
    let nis = found.axes[0].innovations.as_ref().unwrap().nis.unwrap().mean;
    // √(2/2000) = 0.032
    assert!((nis - 1.0).abs() < 5.0 * 0.032, "{nis}");
}

/// Half an hour of the reference sensor at 10 Hz, one row of fifty missing: all of it is compared, and the numbers
/// are those of a log without holes but for the samples that are gone.
#[test]
fn the_command_fills_short_holes() {
    let bench = Bench::new();
    let given = crate::support::data("params.json").display().to_string();
    bench.ok(&format!("simulate {given} -o log.csv --duration 30min --rate 10 --seed 3"));
    let text = bench.read("log.csv");
    let kept = text.lines().enumerate().filter(|(row, _)| row % 50 != 7).map(|(_, line)| format!("{line}\n"));
    bench.file("holes.csv", kept.collect::<String>());
    let of = |log: &str| -> serde_json::Value {
        serde_json::from_str(&bench.run(&format!("compare {given} {log} --json --parameters")).stdout).unwrap()
    };
    let (all, holes) = (of("log.csv"), of("holes.csv"));
    let axis = &holes["axes"][0];
    let [samples, filled] = ["samples", "filled"].map(|key| axis[key].as_u64().unwrap());
    assert!(samples > 17_900 && (350..=360).contains(&filled), "{samples}, {filled}");
    assert_eq!((all["axes"][0]["filled"].as_u64(), &all["verdict"]), (Some(0), &holes["verdict"]));
    let value = |of: &serde_json::Value, row: usize| of["parameters"][row]["log"].as_f64().unwrap();
    // a fiftieth of the samples moves the white noise by √(1/18,000·(1/0.98 − 1)) = 0.1 %
    assert!((value(&holes, 0) / value(&all, 0) - 1.0).abs() < 0.005, "{} {}", value(&holes, 0), value(&all, 0));
    let found: serde_json::Value =
        serde_json::from_str(&bench.ok(&format!("inflate {given} holes.csv --json"))).unwrap();
    assert_eq!(found["axes"][0]["filled"].as_u64(), Some(filled));
    let words = bench.run(&format!("compare {given} holes.csv")).stderr;
    assert!(words.contains("stands for the log in curves and spectra") && words.contains("filled in"), "{words}");
}

/// Sways of 100 deg/s at 2 Hz: no line between two levels is what they did in a hole of 20 samples, so the factor is
/// that of the eight times 679 samples between them (544 coefficients each above 10 Hz, half of a degree of freedom
/// each: 1/√(8·544) = 1.5 %; five of these).
#[test]
fn nothing_is_filled_in_where_the_log_moves() {
    let bench = Bench::new();
    let given = crate::support::data("params.json").display().to_string();
    bench.ok(&format!("simulate {given} -o log.csv --duration 1min --seed 3 --true-rate sine:100deg/s,2Hz"));
    let text = bench.read("log.csv");
    let kept = text.lines().enumerate().filter(|(row, _)| *row == 0 || row % 700 > 20).map(|(_, line)| line);
    bench.file("holes.csv", kept.map(|line| format!("{line}\n")).collect::<String>());
    let found: serde_json::Value =
        serde_json::from_str(&bench.ok(&format!("inflate {given} holes.csv --from 10 --json"))).unwrap();
    for axis in found["axes"].as_array().unwrap() {
        assert_eq!([&axis["segments"], &axis["samples"], &axis["filled"]], [8, 8 * 679, 0], "{axis}");
        let factor = axis["factor"].as_f64().unwrap();
        assert!((factor - 1.0).abs() < 5.0 * 0.015, "{factor}");
    }
}
