//! Intervals of lines: how often they hold the truth, and what is said at the end of what is searched.

use kfdesign::identify::{Identified, ModelChoice, parse_model};
use kfdesign::noise::Term;
use kfdesign::numerics::distribution::normal_cdf;
use kfdesign::numerics::random::{StreamId, normal, stream};
use rayon::prelude::*;

use super::{attempt, gauss_markov, identify, log, white};

/// 240 s at 100 Hz.
const SAMPLES: usize = 24_000;
const DT: f64 = 0.01;
/// As of an MPU6050 at rest, deg/s/√Hz.
const DENSITY: f64 = 0.01;
const NAMES: [&str; 6] = ["white N", "line sigma", "line f0", "line Tc", "Gauss-Markov sigma", "Gauss-Markov Tc"];

/// White noise, a line and drift in the ranges that lines of measured logs at rest have: 3 to 48 Hz, correlation
/// times of 0.2 to 20 s, two to forty times the white noise at its peak.
fn truth(run: u64) -> [f64; 6] {
    let mut rng = stream(77, StreamId { run, axis: 9, term: 0 });
    let mut between = |low: f64, high: f64| low * (high / low).powf(normal_cdf(normal(&mut rng)));
    let (frequency, time, peak, slow) =
        (between(3.0, 48.0), between(0.2, 20.0), between(2.0, 40.0), between(10.0, 60.0));
    [DENSITY, DENSITY * (peak / time).sqrt(), frequency, time, 0.01, slow]
}

/// `None` where a given model has a line and none stands out.
fn found(run: u64, choice: &ModelChoice) -> Option<Identified> {
    let [density, std_dev, frequency_hz, correlation_time, sigma, slow] = truth(run);
    let line = Term::Oscillation { std_dev, frequency_hz, correlation_time };
    attempt(&log(&[white(density), line, gauss_markov(sigma, slow)], SAMPLES, DT, 78, run), DT, choice).ok()
}

/// Of each parameter whether its interval holds the truth; `None` where the model has no such parameter, or another
/// beside it, or gives no interval.
fn held(found: &Identified, truth: [f64; 6]) -> [Option<bool>; 6] {
    use kfdesign::params::TermEntry as Entry;
    let holds = |value: &kfdesign::params::Measured, truth: f64| {
        let [low, high] = value.interval_si()?;
        assert!(low < high, "an interval of no width: {value:?}");
        Some(low <= truth && truth <= high)
    };
    let mut all = [None; 6];
    let [mut lines, mut drifts] = [0; 2];
    for term in &found.params.terms {
        match term {
            Entry::White { density } => all[0] = holds(density, truth[0]),
            Entry::Oscillation { std_dev, frequency, correlation_time } => {
                lines += 1;
                all[1] = holds(std_dev, truth[1]);
                all[2] = holds(frequency, truth[2]);
                all[3] = holds(correlation_time, truth[3]);
            }
            Entry::GaussMarkov { std_dev, correlation_time } => {
                drifts += 1;
                all[4] = holds(std_dev, truth[4]);
                all[5] = holds(correlation_time, truth[5]);
            }
            _ => drifts += 2,
        }
    }
    if lines != 1 {
        all[1..4].fill(None);
    }
    if drifts != 1 {
        all[4..].fill(None);
    }
    all
}

fn counts(runs: u64, choice: &ModelChoice) -> [[u64; 2]; 6] {
    let each: Vec<_> =
        (0..runs).into_par_iter().filter_map(|run| Some(held(&found(run, choice)?, truth(run)))).collect();
    let count = |i: usize, what: bool| each.iter().filter(|held| held[i] == Some(what)).count() as u64;
    std::array::from_fn(|i| [count(i, true), count(i, false)])
}

#[test]
#[ignore = "a study of minutes that prints figures, not a check"]
fn likelihood_study_of_lines() {
    let runs = std::env::var("KFDESIGN_RUNS").ok().and_then(|text| text.parse().ok()).unwrap_or(200);
    println!("| model | parameter | intervals | hold the truth |\n| --- | --- | --- | --- |");
    for model in ["white+osc+gm", "auto"] {
        for (name, [inside, outside]) in NAMES.iter().zip(counts(runs, &parse_model(model).unwrap())) {
            let share = inside as f64 / (inside + outside) as f64;
            println!("| {model} | {name} | {} | {inside} ({share:.3}) |", inside + outside);
        }
    }
}

/// Of 16 logs no parameter's 95 % interval misses the truth in 6 or more: false alarm 2e-4 for each of six
/// parameters at 95 %, 1e-3 together and less for what is seen here, since the logs are fixed.
#[test]
fn intervals_of_lines_hold_the_truth() {
    for (name, [inside, outside]) in NAMES.iter().zip(counts(16, &parse_model("white+osc+gm").unwrap())) {
        // drift is told in fewer of these logs than a line is
        let least = if name.starts_with("Gauss-Markov") { 5 } else { 8 };
        assert!(inside >= least && outside < 6, "{name}: {inside} in, {outside} out");
    }
}

/// A model that is given reaches the likelihood that the same model has where it is grown, also where drift passes
/// for a line of low frequency, or a line for a Gauss-Markov process (a third of these logs, when lines were placed
/// before drift was).
#[test]
fn a_given_model_is_as_likely_as_when_it_is_grown() {
    let model = "white+osc+gm";
    let of = |found: &Identified| {
        found.candidates.iter().find(|candidate| candidate.model == model).and_then(|found| found.log_likelihood)
    };
    let behind: Vec<(u64, f64)> = (0..24_u64)
        .into_par_iter()
        .filter_map(|run| {
            let given = of(&found(run, &parse_model(model).unwrap())?)?;
            Some((run, of(&found(run, &ModelChoice::Auto)?)? - given))
        })
        .collect();
    assert!(behind.len() >= 12, "grown in {} of 24 logs", behind.len());
    // two searches for one maximum stop at a difference of about 1e-3
    assert!(behind.iter().all(|(_, by)| *by < 0.01), "{behind:?}");
}

/// A line that is wider than lines beside a filter are searched (a correlation time of 0.06 s, 0.1 s is the
/// shortest) ends there: the value stays for the model, no interval is given, and the reason stands under what is
/// not identified.
#[test]
fn a_line_at_the_end_of_what_is_searched_is_not_identified() {
    let line = Term::Oscillation { std_dev: 0.18, frequency_hz: 20.0, correlation_time: 0.06 };
    let found = identify(&log(&[white(DENSITY), line], SAMPLES, DT, 79, 0), DT, &parse_model("bl1+osc").unwrap());
    let time = found.params.terms.iter().find_map(|term| match term {
        kfdesign::params::TermEntry::Oscillation { correlation_time, .. } => Some(correlation_time),
        _ => None,
    });
    let time = time.unwrap();
    assert!((time.value - 0.1).abs() < 1e-6, "{time:?}");
    assert_eq!(time.interval, None);
    let said = found.not_identified.iter().find(|said| said.term == "oscillation.correlation_time").unwrap();
    assert!(said.reason.starts_with("at the shortest that is searched, 0.1000 s"), "{}", said.reason);
}
