//! A Monte Carlo verdict as a person reads it.

use crate::cli::output::{digits, table};
use crate::montecarlo::outcome::{Detectable, FalseAlarmRate, Measure, Method, Rejection, Sighting};
use crate::montecarlo::power::Needed;
use crate::montecarlo::{AxisOutcome, Outcome};

pub(super) const TESTS: [&str; 9] =
    ["axis", "test", "statistic", "lower", "upper", "p", "family-wise p", "result", "meaning"];
pub(super) const AXES: [&str; 7] =
    ["axis", "NEES over time", "NIS", "NCI", "inclination", "within 1, 2, 3 sigma", "meaning"];

pub(super) fn outcome(outcome: &Outcome) -> String {
    let mut text = format!("{}\n\n", experiment(outcome));
    text.push_str(&table(&AXES, &axis_rows(outcome)));
    text.push_str(&format!("\nTests: a true filter keeps within all bounds with {} %\n", kept(outcome)));
    text.push_str(&table(&TESTS, &test_rows(outcome)));
    text.push('\n');
    if let Some(rejection) = &outcome.rejection {
        text.push_str(&format!("{}\n", rejected(rejection)));
    }
    if let Some(rate) = &outcome.false_alarm_rate {
        text.push_str(&format!("{}\n", false_alarms(outcome, rate)));
    }
    text.push_str(&format!("{}: {}\n", outcome.verdict.word(), outcome.meaning));
    text
}

/// Probability in % that a true filter passes.
pub(super) fn kept(outcome: &Outcome) -> String {
    digits(100.0 * (1.0 - outcome.alpha))
}

/// What was run.
pub(super) fn experiment(outcome: &Outcome) -> String {
    format!(
        "{} runs ({}..{}) of {} s, {} samples each, seed {}",
        outcome.runs.count(),
        outcome.runs.first,
        outcome.runs.end,
        digits(outcome.duration_s),
        outcome.steps,
        outcome.seed
    )
}

/// How surely the given truth is told from the design.
pub(super) fn rejected(rejection: &Rejection) -> String {
    let counted =
        rejection.confirmed.map_or_else(String::new, |c| format!("; {} of {} experiments did", c.caught, c.of));
    format!(
        "This gate rejects this truth with a probability of at least {} % ({} of axis {}){counted}",
        digits(100.0 * rejection.probability),
        rejection.test,
        rejection.axis
    )
}

/// How often this gate is wrong about a true filter.
pub(super) fn false_alarms(outcome: &Outcome, rate: &FalseAlarmRate) -> String {
    let what = match rate.method {
        Method::Law => "replicates drawn from the law of its statistics",
        Method::Experiments => "whole experiments",
    };
    format!(
        "False alarms of this gate: {} % measured ({} … {} %, {} {what}); {} % intended",
        digits(100.0 * rate.value),
        digits(100.0 * rate.interval[0]),
        digits(100.0 * rate.interval[1]),
        rate.replicates,
        digits(100.0 * outcome.alpha)
    )
}

pub(super) const POWER: [&str; 6] = ["axis", "parameter", "too large", "seen by", "too small", "seen by"];

/// What the gate sees.
pub(super) fn power(outcome: &Outcome) -> String {
    let caption = "Caught with 90 % probability: the filter's value over the true one (x0: in sigmas of P0)";
    format!("{caption}\n{}\n", table(&POWER, &power_rows(outcome)))
}

pub(super) fn power_rows(outcome: &Outcome) -> Vec<Vec<String>> {
    let cell = |sighting: &Option<Sighting>, measure: Measure| match sighting {
        None => ["not seen".to_string(), String::new()],
        Some(Sighting { size, test, confirmed }) => {
            let size = match measure {
                // close to one the digits behind it are what matters
                Measure::Factor if (size - 1.0).abs() < 0.01 => format!("x {size:.5}"),
                Measure::Factor => format!("x {}", digits(*size)),
                Measure::Sigmas => format!("{size:+.3} sigma"),
            };
            let counted = confirmed.map_or_else(String::new, |c| format!(" ({} of {} caught)", c.caught, c.of));
            [size, format!("{test}{counted}")]
        }
    };
    let row = |d: &Detectable| {
        let [large, by_large] = cell(&d.too_large, d.measure);
        let [small, by_small] = cell(&d.too_small, d.measure);
        vec![d.axis.clone(), d.parameter.clone(), large, by_large, small, by_small]
    };
    outcome.detects.iter().map(row).collect()
}

/// Runs or duration for a wished sensitivity.
pub(super) fn plan(outcome: &Outcome, wished: &str, needed: &Needed) -> String {
    let duration = digits(outcome.duration_s);
    let runs = needed.runs.map_or_else(
        || "no number of runs up to 100 million".to_string(),
        |(runs, kind)| format!("{runs} runs of {duration} s ({kind})"),
    );
    let longer = needed.duration.map_or_else(
        || format!("{} runs of no duration that was tried", outcome.runs.count()),
        |(seconds, kind)| format!("{} runs of {} s ({kind})", outcome.runs.count(), digits(seconds)),
    );
    let now = digits(100.0 * needed.power.probability);
    format!(
        "To see {wished} with 90 % probability: {runs}, or {longer}; this experiment sees it with {now} % ({})\n",
        needed.power.kind
    )
}

pub(super) fn axis_rows(outcome: &Outcome) -> Vec<Vec<String>> {
    let row = |axis: &AxisOutcome| {
        let db = |value: f64| format!("{value:.2} dB");
        let credibility = axis.credibility.as_ref();
        let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".into());
        let nis: Vec<String> = axis.innovations.iter().map(|i| format!("{:.5}", i.nis)).collect();
        vec![
            axis.name.clone(),
            format!("{:.4}", axis.nees_average.mean),
            nis.join(", "),
            or_none(credibility.map(|c| db(c.nci_db))),
            or_none(credibility.map(|c| format!("{:+.2} dB", c.inclination_db))),
            coverage(axis),
            or_none(credibility.map(|c| c.meaning.clone())),
        ]
    };
    outcome.axes.iter().map(row).collect()
}

/// Shares of all runs and times within 1, 2 and 3 predicted sigma, all components.
fn coverage(axis: &AxisOutcome) -> String {
    let mean = |of: &dyn Fn(&crate::montecarlo::outcome::Component) -> &[f64]| {
        let all: Vec<f64> = axis.errors.iter().flat_map(|c| of(c).iter().copied()).collect();
        format!("{:.2}", 100.0 * all.iter().sum::<f64>() / all.len() as f64)
    };
    format!("{}, {}, {} %", mean(&|c| &c.within_1_sigma), mean(&|c| &c.within_2_sigma), mean(&|c| &c.within_3_sigma))
}

pub(super) fn test_rows(outcome: &Outcome) -> Vec<Vec<String>> {
    let row = |test: &crate::consistency::Test| {
        vec![
            test.axis.clone(),
            test.name.clone(),
            digits(test.statistic),
            digits(test.lower),
            digits(test.upper),
            digits(test.p_value),
            digits(test.adjusted_p_value),
            if test.pass() { "pass" } else { "FAIL" }.to_string(),
            test.meaning.clone(),
        ]
    };
    outcome.tests.iter().map(row).collect()
}
