//! How often a true model is rejected.

use kfdesign::compare::{Comparison, compare};
use kfdesign::consistency::Verdict;
use kfdesign::noise::Term;
use rayon::prelude::*;

use super::holes::{three_in_a_hundred, with_holes};
use super::{compared, log, params};

const WHITE: Term = Term::White { density: 0.1 };

fn models() -> Vec<(&'static str, Vec<Term>)> {
    let gm = |std_dev: f64, correlation_time: f64| Term::GaussMarkov { std_dev, correlation_time };
    vec![
        ("white", vec![WHITE]),
        ("white + GM 20 s", vec![WHITE, gm(0.05, 20.0)]),
        ("white + GM 200 s", vec![WHITE, gm(0.05, 200.0)]),
        ("white + 2 GM", vec![WHITE, gm(0.05, 5.0), gm(0.05, 100.0)]),
        ("white + walk", vec![WHITE, Term::RateRandomWalk { density: 0.01 }]),
        ("white + flicker", vec![WHITE, Term::BiasInstability { coefficient: 0.03 }]),
        ("white + ramp", vec![WHITE, Term::RateRamp { slope: 1e-3 }]),
        ("white + quantization", vec![WHITE, Term::Quantization { coefficient: 0.02 }]),
        ("white + average of 3", vec![Term::White { density: 0.03 }, Term::MovingAverage { density: 0.1, samples: 3 }]),
        (
            "white + line + GM",
            vec![WHITE, gm(0.05, 50.0), Term::Oscillation { std_dev: 0.2, frequency_hz: 2.0, correlation_time: 5.0 }],
        ),
    ]
}

/// Shares of p < 0.01 and p < 0.05 per test over 1000 logs of 6000 samples, and of rejected logs at level 0.01, for
/// docs/validation.md: `cargo test --release -- --ignored --nocapture false_alarms_of_compare`.
#[test]
#[ignore = "a study of minutes; its table is in docs/validation.md"]
fn false_alarms_of_compare() {
    study(|model, run| compared(model, model, 6000, run));
}

/// The same beside holes.
#[test]
#[ignore = "a study of minutes; its result is in docs/validation.md"]
fn false_alarms_beside_holes() {
    study(|model, run| {
        let log = with_holes(log(&params(model), 6000, run), three_in_a_hundred);
        compare(&params(model), &log, 0.01).unwrap()
    });
}

fn study(of: impl Fn(&[Term], u64) -> Comparison + Sync) {
    const LOGS: u64 = 1000;
    for (name, model) in models() {
        let results: Vec<_> = (0..LOGS).into_par_iter().map(|run| of(&model, run)).collect();
        let share =
            |hit: &dyn Fn(usize) -> bool| 100.0 * (0..results.len()).filter(|i| hit(*i)).count() as f64 / LOGS as f64;
        let tests = results[0].tests.iter().enumerate().map(|(k, test)| {
            let below = |level: f64| share(&|i| results[i].tests[k].p_value < level);
            format!("{} {:.1} {:.1}", test.name, below(0.01), below(0.05))
        });
        println!(
            "{name}: {}; any adjusted p < 0.01: {:.1}, inconsistent {:.1}",
            tests.collect::<Vec<_>>().join(", "),
            share(&|i| results[i].tests.iter().any(|t| t.adjusted_p_value < 0.01)),
            share(&|i| results[i].verdict == Verdict::Inconsistent)
        );
    }
}
