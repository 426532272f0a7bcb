//! A design against simulated truth.

mod axis;

use std::cell::OnceCell;
use std::rc::Rc;

use self::axis::AxisView;
use super::answer::{self, three};
use super::provenance;
use crate::consistency::Test;
use crate::montecarlo::outcome::{Component, Detectable, FalseAlarmRate, Measure, Method, Rejection, Sighting};
use crate::montecarlo::power::Needed;
use crate::montecarlo::{AxisOutcome, Course, Experiment, Outcome, Path};
use crate::params::{AxisParams, Measured, Params};
use crate::report::figure::{self, Curve};
use crate::report::{Level, Report, Section};
use crate::units::{Unit, digits, significant};

/// Most points of a path.
const POINTS: u64 = 600;
/// Runs that are drawn.
const DRAWN: u64 = 4;

/// What the report is made of.
#[derive(Clone, Copy)]
pub struct MonteCarlo<'a> {
    pub experiment: &'a Experiment,
    pub course: &'a Course,
    pub outcome: &'a Outcome,
    /// Label and name of the files that were read.
    pub sources: &'a [(String, String)],
    /// A terminal too shows what mistuning is caught.
    pub power: bool,
    /// What wished sensitivities cost, one sentence each.
    pub plans: &'a [String],
}

impl MonteCarlo<'_> {
    /// Samples between two points of a path.
    fn every(&self) -> u64 {
        self.course.steps.div_ceil(POINTS)
    }

    fn drawn(&self) -> u64 {
        self.outcome.runs.count().min(DRAWN)
    }
}

pub fn montecarlo<'a>(of: MonteCarlo<'a>) -> Report<'a> {
    let MonteCarlo { experiment, outcome, .. } = of;
    let mut sections = vec![summary(outcome), parameters(experiment), tests(outcome), gate(&of)];
    // simulated once, when the first figure of an error is drawn
    let paths = Rc::new(OnceCell::new());
    sections.extend(outcome.axes.iter().enumerate().map(|(number, axis)| {
        let paths = paths.clone();
        let paths = move || -> Vec<Path> {
            let all: &Vec<Vec<Path>> = paths.get_or_init(|| of.course.paths(outcome.runs.first, of.every()));
            all[number].iter().take(of.drawn() as usize).cloned().collect()
        };
        AxisView::new(of, axis, number).section(Rc::new(paths))
    }));
    Report {
        title: "Monte Carlo consistency".into(),
        subtitle: "Does the filter's covariance tell the truth?".into(),
        verdict: Some(answer::conclusion(outcome.verdict, &outcome.meaning, &outcome.tests)),
        answer: answer(&of),
        provenance: origin(&of),
        sections,
        ..Report::default()
    }
}

fn origin(of: &MonteCarlo<'_>) -> Vec<(String, String)> {
    let MonteCarlo { experiment, outcome, sources, .. } = of;
    let design = &experiment.design;
    let names: Vec<&str> = design.axes.iter().map(|axis| axis.name.as_str()).collect();
    let truth = match (&experiment.truth, experiment.truth_spread) {
        (None, false) => "the filter's own model",
        (None, true) => "the filter's own model, parameters drawn from their intervals in every run",
        (Some(_), false) => "other parameters",
        (Some(_), true) => "other parameters, drawn from their intervals in every run",
    };
    let plant = format!("plant {}, {} Hz, axes {}", design.plant, digits(design.sample_rate_hz), names.join(", "));
    let sources = sources.iter().map(|(label, name)| (label.as_str(), name.clone()));
    provenance(sources.chain([
        ("design", plant),
        ("truth", truth.into()),
        ("runs", format!("{} ({}..{})", outcome.runs.count(), outcome.runs.first, outcome.runs.end)),
        ("duration", format!("{} s, {} samples", digits(outcome.duration_s), outcome.steps)),
        ("seed", outcome.seed.to_string()),
        ("alpha", outcome.alpha.to_string()),
    ]))
}

/// The runs, each axis in three numbers, and what this gate would have seen.
fn answer<'a>(of: &MonteCarlo<'_>) -> Section<'a> {
    let outcome = of.outcome;
    let runs = format!(
        "{} runs of {}, {} tests, seed {}",
        outcome.runs.count(),
        answer::time(outcome.duration_s),
        outcome.tests.len(),
        outcome.seed
    );
    let row = |axis: &AxisOutcome| {
        let nis: Vec<String> = axis.innovations.iter().map(|i| three(i.nis)).collect();
        [
            axis.name.clone(),
            three(axis.nees_average.mean),
            nis.join(", "),
            coverage(axis),
            answer::result(outcome.tests.iter().filter(|test| test.axis == axis.name)),
        ]
    };
    let alarms = outcome.false_alarm_rate.as_ref().map(|rate| {
        let [measured, wanted] = [rate.value, outcome.alpha].map(|share| three(100.0 * share));
        format!("False alarms of this gate: {measured} % (wanted {wanted} %).")
    });
    // the sizes that are worst seen: what is finer is seen too
    let factor = |d: &&Detectable| d.measure == Measure::Factor;
    let size = |d: &Detectable| {
        let percent = 100.0 * (d.too_large.as_ref()?.size - 1.0);
        Some(format!("{} {} %", d.parameter, significant(percent, 2)))
    };
    let first = outcome.detects.first().map(|d| d.axis.clone());
    let seen = outcome.detects.iter().filter(|d| Some(&d.axis) == first.as_ref()).filter(factor);
    let seen: Vec<String> = seen.filter_map(size).collect();
    let sees = first
        .filter(|_| !seen.is_empty())
        .map(|axis| format!("Sees with 90 % probability what is too large on {axis} by: {}.", seen.join(", ")));
    Section::new("")
        .table(runs, &["", "NEES", "NIS", "within 1, 2, 3 sigma", "result"], outcome.axes.iter().map(row))
        .paragraphs(alarms.into_iter().chain(outcome.rejection.iter().map(rejected)).chain(sees).collect())
        .paragraphs(of.plans.to_vec())
}

fn summary<'a>(outcome: &Outcome) -> Section<'a> {
    let runs = format!(
        "{} runs ({}..{}) of {} s, {} samples each, seed {}",
        outcome.runs.count(),
        outcome.runs.first,
        outcome.runs.end,
        digits(outcome.duration_s),
        outcome.steps,
        outcome.seed
    );
    let row = |axis: &AxisOutcome| {
        let credibility = axis.credibility.as_ref();
        let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".into());
        let nis: Vec<String> = axis.innovations.iter().map(|i| format!("{:.5}", i.nis)).collect();
        [
            axis.name.clone(),
            format!("{:.4}", axis.nees_average.mean),
            nis.join(", "),
            or_none(credibility.map(|c| format!("{:.2} dB", c.nci_db))),
            or_none(credibility.map(|c| format!("{:+.2} dB", c.inclination_db))),
            coverage(axis),
            or_none(credibility.map(|c| c.meaning.clone())),
        ]
    };
    Section::of_page("Summary").at(Level::Full).paragraph(runs).table(
        "NEES (per component) and NIS are 1 when the covariance is right; NCI and inclination are 0 dB",
        &["axis", "NEES over time", "NIS", "NCI", "inclination", "within 1, 2, 3 sigma", "meaning"],
        outcome.axes.iter().map(row),
    )
}

/// Shares of all runs and times within 1, 2 and 3 predicted sigma, all components.
fn coverage(axis: &AxisOutcome) -> String {
    let mean = |of: fn(&Component) -> &[f64]| {
        let all: Vec<f64> = axis.errors.iter().flat_map(|c| of(c).iter().copied()).collect();
        format!("{:.2}", 100.0 * all.iter().sum::<f64>() / all.len() as f64)
    };
    format!("{}, {}, {} %", mean(|c| &c.within_1_sigma), mean(|c| &c.within_2_sigma), mean(|c| &c.within_3_sigma))
}

/// Parameters of filter and truth side by side.
fn parameters<'a>(experiment: &Experiment) -> Section<'a> {
    let mut rows = Vec::new();
    for axis in &experiment.design.axes {
        let filter = listed(&axis.noise);
        let of_truth = |truth: &Params| truth.axes.iter().find(|a| a.name == axis.name).map(listed).unwrap_or_default();
        let truth = experiment.truth.as_ref().map_or_else(|| filter.clone(), of_truth);
        let find =
            |list: &[(String, Measured)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, m)| m.clone());
        let further = truth.iter().filter(|(name, _)| find(&filter, name).is_none());
        rows.extend(filter.iter().chain(further).map(|(name, _)| {
            let drawn = experiment.truth_spread;
            parameter_row(&axis.name, name, find(&filter, name).as_ref(), find(&truth, name).as_ref(), drawn)
        }));
    }
    let header = ["axis", "parameter", "filter", "truth", "filter / truth", "unit", "truth is drawn from"];
    let shown = if experiment.truth_spread { &header[..] } else { &header[..6] };
    let caption = "Noise parameters that the filter expects, and those that were simulated";
    Section::new("Filter and truth").at(Level::Page).table(caption, shown, rows)
}

/// Everything about an axis that has a number, by its name in documents.
fn listed(axis: &AxisParams) -> Vec<(String, Measured)> {
    let bias = axis.bias.iter().map(|m| ("bias".to_string(), m.clone()));
    let start = axis.turn_on_bias.iter().map(|m| ("turn_on_bias.std_dev".to_string(), m.clone()));
    let mut noise = axis.clone();
    bias.chain(start).chain(noise.noise_parameters().map(|(name, m)| (name, m.clone()))).collect()
}

/// `drawn`: with the interval from which the truth is drawn.
fn parameter_row(
    axis: &str,
    name: &str,
    filter: Option<&Measured>,
    truth: Option<&Measured>,
    drawn: bool,
) -> Vec<String> {
    let unit = filter.or(truth).map_or_else(Unit::one, |m| m.unit.clone());
    let [of_filter, of_truth] = [filter, truth].map(|m| m.map(|m| unit.from_si(m.si())));
    let ratio = of_filter.zip(of_truth.filter(|truth| *truth != 0.0)).map(|(filter, truth)| filter / truth);
    let numbers = [of_filter, of_truth, ratio].map(|value| value.map_or_else(|| "–".into(), digits));
    let interval = truth.and_then(Measured::interval_si).map(|ends| ends.map(|end| digits(unit.from_si(end))));
    let interval = interval.map_or_else(|| "fixed".into(), |[lower, upper]| format!("{lower} … {upper}"));
    let names = [axis.to_string(), name.to_string()];
    names.into_iter().chain(numbers).chain([unit.to_string()]).chain(drawn.then_some(interval)).collect()
}

pub(super) const TESTS: [&str; 9] =
    ["axis", "test", "statistic", "lower", "upper", "p", "family-wise p", "result", "meaning"];

pub(super) fn tests_caption(outcome: &Outcome) -> String {
    format!(
        "Tests: a true filter keeps within all bounds with {} %; a test is beyond its bounds when its p is at most \
         {}, its family-wise p at most {}",
        digits(100.0 * (1.0 - outcome.alpha)),
        digits(outcome.critical_p_value),
        outcome.alpha
    )
}

pub(super) fn test_row(test: &Test) -> impl Iterator<Item = String> + use<> {
    let numbers = [test.statistic, test.lower, test.upper, test.p_value, test.adjusted_p_value].map(digits);
    let result = if test.pass() { "pass" } else { "FAIL" };
    let names = [test.axis.clone(), test.name.clone()];
    names.into_iter().chain(numbers).chain([result.to_string(), test.meaning.clone()])
}

fn tests<'a>(outcome: &Outcome) -> Section<'a> {
    let failed = outcome.tests.iter().filter(|t| !t.pass());
    Section::of_page("Tests")
        .at(Level::Page)
        .list(failed.map(|t| format!("{}, {}: {}.", t.axis, t.name, t.meaning)).collect())
        .at(Level::Full)
        .table(tests_caption(outcome), &TESTS, outcome.tests.iter().map(test_row))
        .minor(&["statistic", "lower", "upper", "p"])
}

/// NEES over time with the band of the gate; `expected` under the truth where that is another.
pub(super) fn nees(axis: &AxisOutcome, outcome: &Outcome, expected: Option<Curve>) -> String {
    let nees = &axis.nees;
    figure::nees(&figure::Nees {
        title: format!("{}: NEES of {} runs", axis.name, outcome.runs.count()),
        time_s: nees.time_s.clone(),
        nees: nees.mean.clone(),
        lower: vec![nees.lower; nees.time_s.len()],
        upper: vec![nees.upper; nees.time_s.len()],
        expected: 1.0,
        under_truth: expected,
        band_label: "band of the gate, all times together".into(),
    })
}

/// What the gate does to a true filter and to wrong ones.
fn gate<'a>(of: &MonteCarlo<'_>) -> Section<'a> {
    let outcome = of.outcome;
    let mut section = Section::of_page("Error rates of this gate");
    section = section.paragraphs(outcome.rejection.iter().map(rejected).collect());
    if let Some(rate) = &outcome.false_alarm_rate {
        let names = outcome.axes.iter().map(|axis| axis.name.as_str());
        let header: Vec<&str> = std::iter::once("test").chain(names).collect();
        section = section.paragraph(false_alarms(outcome, rate)).at(Level::Page).table(
            format!("False alarms of each test alone at level {} (%)", outcome.alpha),
            &header,
            alarm_rows(outcome, rate),
        );
    }
    section
        .at(if of.power { Level::Full } else { Level::Page })
        .table(
            "Caught with 90 % probability: the filter's value over the true one (x0: in sigmas of P0)",
            &["axis", "parameter", "too large", "seen by", "too small", "seen by"],
            outcome.detects.iter().map(power_row),
        )
        .at(Level::Full)
        .paragraphs(of.plans.to_vec())
}

/// How surely the given truth is rejected.
fn rejected(rejection: &Rejection) -> String {
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
fn false_alarms(outcome: &Outcome, rate: &FalseAlarmRate) -> String {
    let what = match rate.method {
        Method::Law => "replicates drawn from the law of its statistics",
        Method::Experiments => "whole experiments",
    };
    let [value, low, high, intended] =
        [rate.value, rate.interval[0], rate.interval[1], outcome.alpha].map(|share| digits(100.0 * share));
    let count = rate.replicates;
    format!("False alarms of this gate: {value} % measured ({low} … {high} %, {count} {what}); {intended} % intended")
}

fn alarm_rows(outcome: &Outcome, rate: &FalseAlarmRate) -> Vec<Vec<String>> {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for test in &rate.tests {
        if !rows.iter().any(|row| row[0] == test.name) {
            let of = |axis: &AxisOutcome| rate.tests.iter().find(|t| t.axis == axis.name && t.name == test.name);
            let cells = outcome.axes.iter().map(|axis| of(axis).map_or_else(String::new, |t| digits(100.0 * t.value)));
            rows.push(std::iter::once(test.name.clone()).chain(cells).collect());
        }
    }
    rows
}

fn power_row(d: &Detectable) -> [String; 6] {
    let cell = |sighting: &Option<Sighting>| match sighting {
        None => ["not seen".to_string(), String::new()],
        Some(Sighting { size, test, confirmed }) => {
            let size = match d.measure {
                // close to one the digits behind it are what matters
                Measure::Factor if (size - 1.0).abs() < 0.01 => format!("x {size:.5}"),
                Measure::Factor => format!("x {}", digits(*size)),
                Measure::Sigmas => format!("{size:+.3} sigma"),
            };
            let counted = confirmed.map_or_else(String::new, |c| format!(" ({} of {} caught)", c.caught, c.of));
            [size, format!("{test}{counted}")]
        }
    };
    let ([large, by_large], [small, by_small]) = (cell(&d.too_large), cell(&d.too_small));
    [d.axis.clone(), d.parameter.clone(), large, by_large, small, by_small]
}

/// Runs or duration for a wished sensitivity.
pub fn plan(outcome: &Outcome, wished: &str, needed: &Needed) -> String {
    let (duration, count) = (digits(outcome.duration_s), outcome.runs.count());
    let runs = needed.runs.map_or_else(
        || "no number of runs up to 100 million".to_string(),
        |(runs, kind)| format!("{runs} runs of {duration} s ({kind})"),
    );
    let longer = needed.duration.map_or_else(
        || format!("{count} runs of no duration that was tried"),
        |(seconds, kind)| format!("{count} runs of {} s ({kind})", digits(seconds)),
    );
    let (now, kind) = (digits(100.0 * needed.power.probability), needed.power.kind);
    format!("To see {wished} with 90 % probability: {runs}, or {longer}; this experiment sees it with {now} % ({kind})")
}
