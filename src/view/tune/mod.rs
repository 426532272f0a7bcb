//! A design.

mod attitude;
mod insight;
mod objective;
mod ranking;
mod states;
mod truth;

use super::answer::{self, three};
use super::{alike, by_name, montecarlo, provenance};
use crate::consistency::Verdict;
use crate::filter::AxisDesign;
use crate::montecarlo::{AxisOutcome, Outcome};
use crate::params::Params;
use crate::replay::ReplayResult;
use crate::report::figure::{self, BudgetItem, Sigma, SigmaState};
use crate::report::{Conclusion, Level, Report, Section};
use crate::tune::objective::Record;
use crate::tune::{AxisReport, Insight, PlantBudget, Share, Tuned, UnderTruth};
use crate::units::{Quantity, Unit, digits, shown_unit};
pub use attitude::attitude;
pub use ranking::ranking;

/// What the report is made of.
#[derive(Clone, Copy)]
pub struct Design<'a> {
    /// File of the parameters.
    pub name: &'a str,
    pub params: &'a Params,
    pub tuned: &'a Tuned,
    pub verification: &'a Outcome,
    /// File of other parameters, and what the design does under them.
    pub truth: Option<(&'a str, &'a [UnderTruth])>,
    /// Of every axis, if asked for.
    pub insights: &'a [Insight],
    /// How the parameters were chosen.
    pub record: Option<&'a Record>,
    pub replays: &'a [ReplayResult],
}

/// One or more axes with the same design.
#[derive(Clone)]
struct Group<'a> {
    names: Vec<&'a str>,
    design: &'a AxisDesign,
    report: &'a AxisReport,
    quantity: Quantity,
    unit: Unit,
}

impl Group<'_> {
    fn title(&self) -> String {
        match self.names[..] {
            [one] => format!("axis {one}"),
            _ => format!("axes {} (identical)", self.names.join(", ")),
        }
    }

    /// Scale and text of what is shown for a unit in SI.
    fn shown(&self, si: &str) -> (f64, String) {
        shown_unit(si, self.quantity, &self.unit)
    }

    /// The same of a state.
    fn of_state(&self, state: usize) -> (f64, String) {
        self.shown(&self.design.model.states[state].unit)
    }
}

/// Every axis by its name, for itself.
fn axes<'a>(of: &Design<'a>) -> impl Iterator<Item = (&'a str, Group<'a>)> {
    let quantity = of.params.quantity;
    let axes = of.tuned.design.axes.iter().zip(&of.tuned.reports).zip(&of.params.axes);
    axes.map(move |((design, report), params)| {
        let unit = params.display_unit(quantity);
        (design.name.as_str(), Group { names: Vec::new(), design, report, quantity, unit })
    })
}

/// Axes of the same numbers together.
fn groups<'a>(of: &Design<'a>) -> Vec<Group<'a>> {
    let same = |a: &Group<'_>, b: &Group<'_>| {
        a.unit == b.unit
            && a.design.model == b.design.model
            && a.report.warnings == b.report.warnings
            && a.report.predicted == b.report.predicted
    };
    alike(axes(of), same).into_iter().map(|(names, group)| Group { names, ..group }).collect()
}

pub fn tune<'a>(of: &Design<'a>) -> Report<'a> {
    let (params, outcome) = (of.params, of.verification);
    let groups = groups(of);
    let mut sections: Vec<Section<'a>> = of.record.iter().map(|record| objective::section(record, params)).collect();
    let rate = short(params.sample_rate_hz);
    let headline = format!("{}: plant {}, {rate} Hz, {}", of.name, of.tuned.design.plant, measured(of));
    sections.push(Section::new("").paragraph(headline));
    sections.extend(groups.iter().map(group_section));
    sections.extend(groups.iter().filter_map(|group| {
        let insight = of.insights.iter().find(|insight| Some(&insight.axis.as_str()) == group.names.first())?;
        Some(insight::section(group, insight))
    }));
    sections.extend(truth::sections(of));
    sections.push(verification(of));
    sections.extend(of.replays.iter().map(replay));
    let note = params.source.as_ref().and_then(|source| source.note.clone());
    let lines = [
        ("parameters", of.name.to_string()),
        ("plant", of.tuned.design.plant.clone()),
        ("sample rate", format!("{rate} Hz")),
        ("seed", outcome.seed.to_string()),
    ];
    Report {
        title: format!("Kalman filter from {}", of.name),
        subtitle: "Augmented bias filter: model, steady state, error budget, predicted accuracy".into(),
        verdict: Some(conclusion(of)),
        answer: answer(of, &groups),
        provenance: provenance(lines.into_iter().chain(note.map(|note| ("source of the parameters", note)))),
        sections,
        ..Report::default()
    }
}

/// Of the verification; its answer is one line.
fn conclusion(of: &Design<'_>) -> Conclusion {
    let outcome = of.verification;
    let sentence = verification_sentence(outcome, of.params.sample_rate_hz);
    let conclusion = answer::conclusion(outcome.verdict, &sentence, &outcome.tests);
    match outcome.verdict {
        Verdict::Consistent => {
            let (runs, tests) = (outcome.runs.count(), outcome.tests.len());
            conclusion.brief(format!("the design passes {tests} tests in {runs} quick runs on its own model"))
        }
        _ => conclusion,
    }
}

/// What the filter promises, one row for axes alike.
fn answer<'a>(of: &Design<'_>, groups: &[Group<'_>]) -> Section<'a> {
    let states = groups.first().map_or(0, |group| group.design.model.states.len());
    let plant = &of.tuned.design.plant;
    let plural = if states == 1 { "" } else { "s" };
    let heading = format!("{}: {states} state{plural}, {} Hz, plant {plant}", of.name, three(of.params.sample_rate_hz));
    let row = |group: &Group<'_>| {
        let (model, report) = (&group.design.model, group.report);
        let unit = answer::unit(&group.unit);
        let sample = group.shown(&model.measurements[0].unit);
        let of_sample = model.r[(0, 0)].sqrt() / sample.0;
        let budget: f64 = report.error_budget.iter().map(|share| share.variance_si).sum();
        let causes = report
            .error_budget
            .iter()
            .filter(|share| share.share > 0.05)
            .map(|share| format!("{} {:.0} %", share.source, 100.0 * share.share));
        [
            group.names.join(", "),
            format!("{} {}", three(of_sample), sample.1),
            match budget > 0.0 {
                true => format!("{} {unit}", three(group.unit.from_si(budget.sqrt()))),
                false => "tends to 0".into(),
            },
            report.drift_settling_time_s.map_or("-".into(), answer::time),
            causes.collect::<Vec<_>>().join(", "),
        ]
    };
    let replayed = of.replays.iter().map(|replay| {
        format!("{}: {}: {}", replay.log.as_deref().unwrap_or("the log"), replay.verdict.word(), replay.meaning)
    });
    let truth = of.truth.iter().flat_map(|(_, results)| results.iter());
    let under_truth: Vec<(&str, Vec<String>)> =
        truth.map(|result| (result.name.as_str(), vec![format!("under the truth {}", result.meaning)])).collect();
    let notes = groups.iter().map(|group| (group.names.first().copied().unwrap_or(""), &*group.report.warnings));
    Section::new(heading)
        .table("", &["", "one sample", "drift known to", "after", "caused by"], groups.iter().map(row))
        .findings("note", answer::warnings(by_name(notes)))
        .paragraphs(by_name(under_truth.iter().map(|(name, said)| (*name, said.as_slice()))))
        .paragraphs(replayed.collect())
}

/// What the filter is given.
fn measured(of: &Design<'_>) -> String {
    let Some(model) = of.tuned.design.axes.first().map(|axis| &axis.model) else { return String::new() };
    if model.outputs.is_empty() {
        return "measurement z = sum of the states + white noise".into();
    }
    let rate = |every: usize| digits(of.params.sample_rate_hz / every as f64);
    let inputs = model.inputs.iter().map(|input| format!("input {}", input.name));
    let every = model.measurements.iter().zip(&model.every);
    let measurements = every.map(|(m, every)| format!("measurement {} at {} Hz", m.name, rate(*every)));
    inputs.chain(measurements).collect::<Vec<_>>().join(", ")
}

fn group_section<'a>(group: &Group<'a>) -> Section<'a> {
    let report = group.report;
    let of_group = group.clone();
    let mut section = states::tables(Section::new(group.title()), group)
        .list(report.observability.clone())
        .findings("note", report.warnings.clone())
        .figure("What the filter promises, from the first measurement on.", move || sigma(&of_group))
        .at(Level::Page);
    if !report.error_budget.is_empty() {
        let shown = group.shown(group.quantity.si_unit());
        let title = format!("{}: error budget", group.title());
        section = section.figure("Causes of the final variance of the drift estimate.", move || {
            budget(&title, &report.error_budget, &shown)
        });
    }
    for (state, plant) in report.plant_budgets.iter().enumerate() {
        let (of_group, shown) = (group.clone(), group.shown(&plant.unit));
        if plant.unit != group.quantity.si_unit() {
            let caption = format!("What the filter promises of the {}.", plant.state);
            section = section.figure(caption, move || plant_sigma(&of_group, state, plant));
        }
        let title = format!("{}: error budget of the {}", group.title(), plant.state);
        let caption = format!("Causes of the final variance of the {}.", plant.state);
        section = section.figure(caption, move || budget(&title, &plant.error_budget, &shown));
    }
    states::predicted(section.at(Level::Full), group)
}

fn sigma(group: &Group<'_>) -> String {
    let (model, predicted) = (&group.design.model, &group.report.predicted);
    let mut states: Vec<SigmaState> = Vec::new();
    for i in states::single(model).filter(|i| model.states[*i].unit == group.quantity.si_unit()) {
        let scale = group.of_state(i).0;
        let steady = group.design.steady_state.predicted_covariance[(i, i)];
        states.push(SigmaState {
            name: model.states[i].name.clone(),
            sigma: predicted.sigma[i].iter().map(|s| s / scale).collect(),
            steady: (steady > 0.0).then(|| steady.sqrt() / scale),
        });
    }
    if model.states.len() > 1 {
        let variance: f64 = group.report.error_budget.iter().map(|s| s.variance_si).sum();
        let final_sigma = (variance > 0.0).then(|| group.unit.from_si(variance.sqrt()));
        let total = predicted.total.iter().map(|s| group.unit.from_si(*s)).collect();
        states.push(SigmaState { name: "whole drift".into(), sigma: total, steady: final_sigma });
    }
    figure::sigma(&Sigma {
        title: format!("{}: predicted sigma", group.title()),
        unit: group.unit.to_string(),
        time_s: predicted.time_s.clone(),
        states,
        settling_time_s: group.report.drift_settling_time_s,
    })
}

/// Predicted sigma of one state of the plant, which come first in the model.
fn plant_sigma(group: &Group<'_>, state: usize, plant: &PlantBudget) -> String {
    let (scale, unit) = group.shown(&plant.unit);
    let predicted = &group.report.predicted;
    let variance: f64 = plant.error_budget.iter().map(|share| share.variance_si).sum();
    figure::sigma(&Sigma {
        title: format!("{}: predicted sigma of the {}", group.title(), plant.state),
        unit,
        time_s: predicted.time_s.clone(),
        states: vec![SigmaState {
            name: plant.state.clone(),
            sigma: predicted.sigma[state].iter().map(|sigma| sigma / scale).collect(),
            steady: (variance > 0.0).then(|| variance.sqrt() / scale),
        }],
        settling_time_s: None,
    })
}

fn budget(title: &str, shares: &[Share], (scale, unit): &(f64, String)) -> String {
    let item = |share: &Share| BudgetItem {
        source: share.source.clone(),
        share: share.share,
        value: format!("{} {unit}", digits(share.variance_si.sqrt() / scale)),
    };
    figure::error_budget(title, &shares.iter().map(item).collect::<Vec<_>>())
}

fn verification<'a>(of: &Design<'a>) -> Section<'a> {
    let outcome = of.verification;
    let result = |pass: bool| if pass { "pass" } else { "FAIL" }.to_string();
    let row = |axis: &AxisOutcome| {
        let mine = || outcome.tests.iter().filter(|t| t.axis == axis.name);
        let least = mine().map(|t| t.adjusted_p_value).fold(1.0, f64::min);
        let nees = [axis.nees.mean.first().copied(), Some(axis.nees_average.mean), axis.nees.mean.last().copied()];
        let numbers = nees.into_iter().chain([axis.innovations.first().map(|i| i.nis), Some(least)]);
        let numbers = numbers.map(super::or_dash);
        std::iter::once(axis.name.clone()).chain(numbers).chain([result(mine().all(|t| t.pass()))]).collect::<Vec<_>>()
    };
    let mut section = Section::of_page("Verification by Monte Carlo").at(Level::Page);
    for axis in &outcome.axes {
        section = section.figure("", move || montecarlo::nees(axis, outcome, None));
    }
    section
        .at(Level::Full)
        .table(
            "Quick Monte Carlo: mean NEES per state and mean NIS, 1 when the filter's covariance is right",
            &["axis", "NEES at first", "NEES over time", "NEES at last", "NIS", "least adjusted p", "result"],
            outcome.axes.iter().map(row),
        )
        .minor(&["NEES at first", "NEES at last"])
        .at(Level::Page)
        .table(montecarlo::tests_caption(outcome), &montecarlo::TESTS, outcome.tests.iter().map(montecarlo::test_row))
}

/// A rate or a length as it was given: at most seven digits, and no zeros that were made up.
fn short(x: f64) -> f32 {
    x as f32
}

/// What was run and what it means.
fn verification_sentence(outcome: &Outcome, sample_rate_hz: f64) -> String {
    let what = format!(
        "{} runs of {} s on the design's own model (seed {}), {} tests, false alarm {} %",
        outcome.runs.count(),
        short(outcome.steps as f64 / sample_rate_hz),
        outcome.seed,
        outcome.tests.len(),
        100.0 * outcome.alpha
    );
    if outcome.verdict == Verdict::Consistent {
        return format!("{what}: errors and innovations are as large as the filter says");
    }
    let failed = outcome.tests.iter().filter(|t| !t.pass());
    let failed: Vec<String> = failed.map(|t| format!("{} {}: {}", t.axis, t.name, t.meaning)).collect();
    format!("{what}: {}", failed.join("; "))
}

/// The verdict of a log.
fn replay<'a>(result: &ReplayResult) -> Section<'a> {
    let log = result.log.as_deref().unwrap_or("the log");
    Section::of_page("Replay of a log").at(Level::Full).paragraph(format!(
        "{log} through this design: {}: {}",
        result.verdict.word(),
        result.meaning
    ))
}
