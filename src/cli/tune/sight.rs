//! Figures and the report page of a design.

use super::text;
use super::view::{Group, View, shown, told};
use super::{insight, truth};
use crate::cli::output::{digits, shown_unit};
use crate::montecarlo::{AxisOutcome, Outcome};
use crate::replay::ReplayResult;
use crate::report::figure::{self, BudgetItem, Nees, Sigma, SigmaState};
use crate::report::page::{Badge, Page, Section};
use crate::tune::{PlantBudget, Share};
use crate::units::Quantity;

/// Predicted sigma of every axis, one below the other.
pub(super) fn sheet(view: &View<'_>) -> String {
    let quantity = view.params.quantity;
    let of_group = |g: &Group<'_>| {
        let worth =
            view.insight(g).into_iter().flat_map(|i| &i.outputs).map(|output| insight::figure(g, output, quantity));
        std::iter::once(sigma(g, quantity)).chain(worth).collect::<Vec<_>>()
    };
    let figures: Vec<String> = view.groups().iter().flat_map(of_group).collect();
    figure::sheet("Tuned filter", &figures)
}

/// The report page.
pub(super) fn page(view: &View<'_>, replays: &[ReplayResult]) -> Page {
    let (params, outcome) = (view.params, view.verification);
    let mut provenance = vec![
        ("parameters".to_string(), view.name.to_string()),
        ("plant".to_string(), view.tuned.design.plant.clone()),
        ("sample rate".to_string(), format!("{} Hz", params.sample_rate_hz)),
        ("seed".to_string(), outcome.seed.to_string()),
        ("version".to_string(), format!("kfdesign {}", env!("CARGO_PKG_VERSION"))),
    ];
    if let Some(note) = params.source.as_ref().and_then(|s| s.note.clone()) {
        provenance.push(("source of the parameters".to_string(), note));
    }
    let mut sections: Vec<Section> = view.groups().iter().map(|g| section(g, params.quantity)).collect();
    sections.extend(view.groups().iter().filter_map(|g| Some(insight::section(g, view.insight(g)?, params.quantity))));
    sections.extend(truth::sections(view));
    let tests = outcome.tests.iter().map(|t| {
        vec![
            t.axis.clone(),
            t.name.clone(),
            digits(t.statistic),
            digits(t.lower),
            digits(t.upper),
            digits(t.adjusted_p_value),
            if t.pass() { "pass" } else { "FAIL" }.to_string(),
        ]
    });
    sections.push(
        Section::new("Verification by Monte Carlo")
            .paragraph(text::verification_sentence(outcome, params.sample_rate_hz))
            .figures(outcome.axes.iter().map(|axis| (nees(axis, outcome), String::new())).collect())
            .table(
                "Mean NEES per state and mean NIS: 1 when the covariance is right",
                &text::VERIFICATION,
                text::verification_rows(outcome),
            )
            .table(
                format!(
                    "Tests: a true filter keeps within all bounds with {} %; p adjusted for all {} tests",
                    digits(100.0 * (1.0 - outcome.alpha)),
                    outcome.tests.len()
                ),
                &["axis", "test", "statistic", "lower", "upper", "p", "result"],
                tests.collect(),
            ),
    );
    for result in replays {
        sections.push(Section::new("Replay of a log").paragraph(text::replay(result).trim().to_string()));
    }
    Page {
        title: format!("Kalman filter from {}", view.name),
        subtitle: "Augmented bias filter: model, steady state, error budget, predicted accuracy".to_string(),
        badge: Some(Badge::new(outcome.verdict, text::verification_sentence(outcome, params.sample_rate_hz))),
        provenance,
        sections,
    }
}

fn section(group: &Group<'_>, quantity: Quantity) -> Section {
    let header = text::sigma_header(group, quantity);
    let states = text::state_header(&group.design.model);
    let states: Vec<&str> = states.iter().map(String::as_str).collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let facts = text::facts(group, quantity).into_iter().map(|(label, value)| vec![label.to_string(), value]);
    let mut section = Section::new(group.title())
        .table("States", &states, text::state_rows(group, quantity))
        .table("Measurement and loop", &["what", "value"], facts.collect())
        .list(group.report.observability.clone());
    for warning in &group.report.warnings {
        section = section.warning(warning.clone());
    }
    let mut figures =
        vec![(sigma(group, quantity), "What the filter promises, from the first measurement on.".to_string())];
    let report = group.report;
    if !report.error_budget.is_empty() {
        let title = format!("{}: error budget", group.title());
        let svg = budget(&title, &report.error_budget, &shown_unit(quantity.si_unit(), quantity, &group.unit));
        figures.push((svg, "Causes of the final variance of the drift estimate.".to_string()));
    }
    for (state, plant) in report.plant_budgets.iter().enumerate() {
        let unit = shown_unit(&plant.unit, quantity, &group.unit);
        if plant.unit != quantity.si_unit() {
            let caption = format!("What the filter promises of the {}.", plant.state);
            figures.push((plant_sigma(group, state, plant, &unit), caption));
        }
        let title = format!("{}: error budget of the {}", group.title(), plant.state);
        let caption = format!("Causes of the final variance of the {}.", plant.state);
        figures.push((budget(&title, &plant.error_budget, &unit), caption));
    }
    section.figures(figures).table(
        "Predicted sigma of the estimation errors",
        &header,
        text::sigma_rows(group, quantity),
    )
}

fn sigma(group: &Group<'_>, quantity: Quantity) -> String {
    let (model, predicted) = (&group.design.model, &group.report.predicted);
    let mut states: Vec<SigmaState> = Vec::new();
    for i in told(model) {
        let sigma = &predicted.sigma[i];
        if model.states[i].unit == quantity.si_unit() {
            let scale = shown(model, i, quantity, &group.unit).0;
            let steady = group.design.steady_state.predicted_covariance[(i, i)];
            states.push(SigmaState {
                name: model.states[i].name.clone(),
                sigma: sigma.iter().map(|s| s / scale).collect(),
                steady: (steady > 0.0).then(|| steady.sqrt() / scale),
            });
        }
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

fn nees(axis: &AxisOutcome, outcome: &Outcome) -> String {
    figure::nees(&Nees {
        title: format!("{}: NEES of {} runs", axis.name, outcome.runs.count()),
        time_s: axis.nees.time_s.clone(),
        nees: axis.nees.mean.clone(),
        lower: vec![axis.nees.lower; axis.nees.time_s.len()],
        upper: vec![axis.nees.upper; axis.nees.time_s.len()],
        expected: 1.0,
        under_truth: None,
        band_label: "band of the gate, all times together".into(),
    })
}

/// Predicted sigma of one state of the plant, which come first in the model.
fn plant_sigma(group: &Group<'_>, state: usize, plant: &PlantBudget, (scale, unit): &(f64, String)) -> String {
    let predicted = &group.report.predicted;
    let variance: f64 = plant.error_budget.iter().map(|share| share.variance_si).sum();
    figure::sigma(&Sigma {
        title: format!("{}: predicted sigma of the {}", group.title(), plant.state),
        unit: unit.clone(),
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
