//! The factor between bench and vehicle of a log in pieces, such as batches of raw samples.

use kfdesign::compare::inflation::{AxisInflation, inflation};
use kfdesign::compare::{Log, LogAxis};
use kfdesign::noise::Term;

use super::inflate::{FROM, check_intervals, moved};
use super::{WHITE, log, params};
use crate::support::Bench;

/// Of every `period` samples the first `batch`, as the reader and the cut of a log make them.
fn batches(log: Log, batch: usize, period: usize) -> Log {
    let whole = |axis: &LogAxis| {
        let of = |own: &[f64]| own[..batch.min(own.len())].to_vec();
        let first = axis.rate.chunks(period).map(of).enumerate();
        first.map(|(i, own)| (if i > 0 { (period - batch) as u64 } else { 0 }, own)).collect()
    };
    cut(log, whole)
}

fn cut(log: Log, whole: impl Fn(&LogAxis) -> Vec<(u64, Vec<f64>)>) -> Log {
    let axis = |axis: LogAxis| {
        let whole = whole(&axis);
        let runs = whole.iter().flat_map(|(_, own)| own.split(|x| x.is_nan()));
        let longest = runs.max_by_key(|own| own.len()).unwrap().to_vec();
        let usable = whole.iter().flat_map(|(_, own)| own).filter(|x| !x.is_nan()).count();
        LogAxis { left_out: usable - longest.len(), rate: longest, filled: 0, whole, ..axis }
    };
    Log { axes: log.axes.into_iter().map(axis).collect(), ..log }
}

fn of(model: &[Term], log: &Log) -> AxisInflation {
    inflation(&params(model), log, FROM).unwrap().axes.remove(0)
}

/// 40 batches of 1024 samples, 90 % of their coefficients, half of a degree of freedom each: 0.51 % standard
/// deviation of the factor, 0.92 % of the robust one; five of each. Between batches, and in them, the vehicle turns
/// by some hundred times the noise.
#[test]
fn batches_are_counted_together_under_motion() {
    for (run, factor) in [(0, 1.0), (1, 3.5)] {
        let still = log(&params(&[Term::White { density: 0.1 * factor }]), 80_000, run);
        for log in [still.clone(), moved(still)] {
            let found = of(&[WHITE], &batches(log, 1024, 2000));
            assert_eq!((found.segments, found.samples, found.left_out, found.filled), (40, 40 * 1024, 0, 0));
            assert!((found.factor / factor - 1.0).abs() < 5.0 * 0.0051, "{} for {factor}", found.factor);
            assert!((found.robust_factor / factor - 1.0).abs() < 5.0 * 0.0092, "{}", found.robust_factor);
            let said =
                "the log is in pieces: 40 stretches of 1024 samples between its gaps are used, 0 samples left out";
            assert_eq!(found.notes, [said]);
            assert!(found.lines.is_empty(), "{:?}", found.lines);
        }
    }
}

/// 1000 logs of 8 batches of 300 samples: fewer than 914 or more than 986 covered with a probability of 1e-6, width
/// and scatter known to 2.2 %, five of it.
#[test]
fn the_intervals_cover() {
    let loud = params(&[Term::White { density: 0.2 }]);
    let found: Vec<AxisInflation> =
        (0..1000).map(|run| of(&[WHITE], &batches(log(&loud, 4800, run), 300, 600))).collect();
    assert!(found.iter().all(|axis| axis.segments == 8));
    check_intervals(&found, 914..=986, 0.11);
}

/// Neighbouring coefficients of a segment go together by its window. 3 of 1000 such logs of white noise show a line:
/// five or more of 100 with a probability of 2e-5; 14 % would if every coefficient counted as one of its own.
#[test]
fn what_a_window_ties_together_is_no_line() {
    let with_lines =
        |run: &u64| !of(&[WHITE], &batches(log(&params(&[WHITE]), 16_000, *run), 2000, 4000)).lines.is_empty();
    let found = (0..100).filter(with_lines).count();
    assert!(found < 5, "{found}");
}

/// As for a log in one stretch: the power of 40 batches of 100 s at a correlation time of 50 s has some 80
/// independent values, 16 %; sigma 8 %, six of it.
#[test]
fn a_line_is_found_in_batches() {
    let line = Term::Oscillation { std_dev: 0.5, frequency_hz: 2.0, correlation_time: 50.0 };
    let found = of(&[WHITE], &batches(log(&params(&[WHITE, line]), 80_000, 3), 1024, 2000));
    assert!(found.factor > 1.5 && (found.robust_factor - 1.0).abs() < 0.06, "{} {}", found.factor, found.robust_factor);
    assert_eq!(found.lines.len(), 1, "{:?}", found.lines);
    let strongest = found.lines[0];
    assert!((strongest.frequency_hz - 2.0).abs() < 0.02, "{strongest:?}");
    assert!((strongest.std_dev / 0.5 - 1.0).abs() < 0.48, "{strongest:?}");

    // a tone, which the window spreads: all of its power
    let mut toned = log(&params(&[WHITE]), 80_000, 4);
    toned.axes[0]
        .rate
        .iter_mut()
        .enumerate()
        .for_each(|(k, x)| *x += 0.5 * (0.4 * std::f64::consts::PI * k as f64).sin());
    let found = of(&[WHITE], &batches(toned, 1024, 2000));
    assert_eq!(found.lines.len(), 1, "{:?}", found.lines);
    assert!((found.lines[0].std_dev / 0.125_f64.sqrt() - 1.0).abs() < 0.05, "{:?}", found.lines);
}

/// The longest length that keeps four fifths of what 256 samples would keep: of pieces of 1000, 1000, 900, 300 and
/// 100 these are 2560; 1000 would keep 2000.
#[test]
fn segments_are_as_long_as_they_keep_most_of_the_log() {
    let of_lengths = |lengths: &[usize]| {
        let total = lengths.iter().sum::<usize>() as u64;
        let log = cut(log(&params(&[WHITE]), total, 5), |axis| {
            let mut rest = &axis.rate[..];
            let take = |length: &usize| {
                let (own, after) = rest.split_at(*length);
                rest = after;
                (50, own.to_vec())
            };
            lengths.iter().map(take).collect()
        });
        let found = of(&[WHITE], &log);
        let said = found.notes.iter().filter(|note| note.contains("in pieces")).count();
        assert_eq!(said, usize::from(found.segments > 1), "{:?}", found.notes);
        (found.segments, found.samples, found.left_out)
    };
    assert_eq!(of_lengths(&[1000, 900, 300, 1000, 100]), (3, 2700, 600));
    assert_eq!(of_lengths(&[2100, 1000, 200]), (3, 3000, 300), "what is twice as long is two");
    assert_eq!(of_lengths(&[1024, 300, 1024]), (2, 2048, 300), "short ones do not make them shorter");
    assert_eq!(of_lengths(&[8000, 1000, 1000]), (1, 8000, 2000), "one stretch is most of it");
    assert_eq!(of_lengths(&[700, 200, 200]), (1, 700, 400), "no other piece is long enough");
    assert_eq!(of_lengths(&[250, 250, 250]), (1, 250, 500), "no piece is long enough");
    // a value that is none is where a piece ends
    let log = cut(log(&params(&[WHITE]), 2600, 5), |axis| {
        let mut own = axis.rate.clone();
        own[1300] = f64::NAN;
        vec![(0, own)]
    });
    let found = of(&[WHITE], &log);
    assert_eq!((found.segments, found.samples, found.left_out), (2, 2 * 1299, 1));
}

/// A text log with the times of batches: 256 samples in every second at 1 kHz.
#[test]
fn the_command() {
    let bench = Bench::new();
    let bench_params = crate::support::data("params.json").display().to_string();
    let loud = std::fs::read_to_string(&bench_params).unwrap().replace("0.0562", "0.281").replace("100 Hz", "1 kHz");
    bench.file("loud.json", loud);
    bench.ok("simulate loud.json -o flight.csv --rate 1000 --duration 40s --seed 3 --true-rate sine:30deg/s,1Hz");
    let text = bench.read("flight.csv");
    let kept = text.lines().enumerate().filter(|(i, _)| *i == 0 || (i - 1) % 1000 < 256).map(|(_, line)| line);
    bench.file("batches.csv", kept.collect::<Vec<_>>().join("\n") + "\n");
    let out = bench.run(&format!("inflate {bench_params} batches.csv --json"));
    assert_eq!(out.status, 0, "{}", out.stderr);
    assert!(!out.stderr.contains("longest stretch"), "{}", out.stderr);
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    // 10,240 samples, 90 % of the coefficients, half of a degree of freedom each: 1.0 %, six of it
    for axis in document["axes"].as_array().unwrap() {
        assert_eq!((&axis["segments"], &axis["samples"]), (&40.into(), &10_240.into()));
        assert!((axis["factor"].as_f64().unwrap() / 5.0 - 1.0).abs() < 0.06, "{axis}");
    }
    // one stretch is most of the log
    let kept = text.lines().enumerate().filter(|(i, _)| !(36_000..36_500).contains(i)).map(|(_, line)| line);
    bench.file("whole.csv", kept.collect::<Vec<_>>().join("\n") + "\n");
    let out = bench.run(&format!("inflate {bench_params} whole.csv --json"));
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!((&document["axes"][0]["segments"], &document["axes"][0]["samples"]), (&1.into(), &35_999.into()));
    assert!(out.stderr.contains("the longest stretch without gaps"), "{}", out.stderr);
}
