//! A design against simulated truth.

mod axis;

use std::cell::OnceCell;
use std::rc::Rc;

use self::axis::AxisView;
use super::provenance;
use crate::consistency::Test;
use crate::montecarlo::outcome::{Component, Detectable, FalseAlarmRate, Measure, Method, Rejection, Sighting};
use crate::montecarlo::power::Needed;
use crate::montecarlo::{AxisOutcome, Course, Experiment, Outcome, Path};
use crate::params::{AxisParams, Measured};
use crate::report::{Conclusion, Level, Report, Section};
use crate::units::{Unit, digits};

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
        verdict: Some(Conclusion::new(outcome.verdict, outcome.meaning.clone())),
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
    Section::of_page("Summary").at(Level::Brief).paragraph(runs).table(
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
    let rows = experiment.design.axes.iter().flat_map(|axis| {
        let truth = experiment.truth.as_ref();
        let truth = truth.map(|truth| truth.axes.iter().find(|a| a.name == axis.name).map(listed).unwrap_or_default());
        let own = listed(&axis.noise);
        let mut names: Vec<&String> = Vec::new();
        for (name, _) in own.iter().chain(truth.iter().flatten()) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let find =
            |list: &[(String, Measured)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, m)| m.clone());
        let row = |name: &&String| {
            let filter = find(&own, name);
            let truth = truth.as_ref().map_or_else(|| filter.clone(), |truth| find(truth, name));
            row(&axis.name, name, filter.as_ref(), truth.as_ref(), experiment.truth_spread)
        };
        names.iter().map(row).collect::<Vec<_>>()
    });
    let header = ["axis", "parameter", "filter", "truth", "filter / truth", "unit", "truth is drawn from"];
    let shown = if experiment.truth_spread { &header[..] } else { &header[..6] };
    Section::new("Filter and truth").at(Level::Page).table(
        "Noise parameters that the filter expects, and those that were simulated",
        shown,
        rows,
    )
}

/// Everything about an axis that has a number, by its name in documents.
fn listed(axis: &AxisParams) -> Vec<(String, Measured)> {
    let bias = axis.bias.iter().map(|m| ("bias".to_string(), m.clone()));
    let start = axis.turn_on_bias.iter().map(|m| ("turn_on_bias.std_dev".to_string(), m.clone()));
    let mut noise = axis.clone();
    let noise: Vec<(String, Measured)> = noise.noise_parameters().map(|(name, m)| (name, m.clone())).collect();
    bias.chain(start).chain(noise).collect()
}

fn row(axis: &str, name: &str, filter: Option<&Measured>, truth: Option<&Measured>, drawn: bool) -> Vec<String> {
    let unit = filter.or(truth).map_or_else(Unit::one, |m| m.unit.clone());
    let value = |m: Option<&Measured>| m.map(|m| unit.from_si(m.si()));
    let text = |value: Option<f64>| value.map_or_else(|| "–".into(), digits);
    let ratio =
        value(filter).zip(value(truth)).filter(|(_, truth)| *truth != 0.0).map(|(filter, truth)| filter / truth);
    let interval = truth.and_then(Measured::interval_si).map(|ends| ends.map(|end| digits(unit.from_si(end))));
    let mut row =
        vec![axis.into(), name.into(), text(value(filter)), text(value(truth)), text(ratio), unit.to_string()];
    if drawn {
        row.push(interval.map_or_else(|| "fixed".into(), |[lower, upper]| format!("{lower} … {upper}")));
    }
    row
}

fn tests<'a>(outcome: &Outcome) -> Section<'a> {
    let failed = outcome.tests.iter().filter(|t| !t.pass());
    let row = |test: &Test| {
        let numbers = [test.statistic, test.lower, test.upper, test.p_value, test.adjusted_p_value].map(digits);
        let result = if test.pass() { "pass" } else { "FAIL" };
        let names = [test.axis.clone(), test.name.clone()];
        names.into_iter().chain(numbers).chain([result.to_string(), test.meaning.clone()])
    };
    let caption = format!(
        "Tests: a true filter keeps within all bounds with {} %; a test is beyond its bounds when its p is at most {}, its \
         family-wise p at most {}",
        digits(100.0 * (1.0 - outcome.alpha)),
        digits(outcome.critical_p_value),
        outcome.alpha
    );
    Section::of_page("Tests")
        .at(Level::Page)
        .list(failed.map(|t: &Test| format!("{}, {}: {}.", t.axis, t.name, t.meaning)).collect())
        .at(Level::Full)
        .table(
            caption,
            &["axis", "test", "statistic", "lower", "upper", "p", "family-wise p", "result", "meaning"],
            outcome.tests.iter().map(row),
        )
        .minor(&["lower", "upper", "p"])
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

/// How surely the given truth is told from the design.
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
