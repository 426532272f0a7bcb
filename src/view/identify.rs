//! The noise of a log.

use super::{allan, or_dash, parameters, provenance};
use crate::identify::graphical::Step;
use crate::identify::temperature::SMOOTHING_S;
use crate::identify::{Candidate, IdentifiedAxis, OnTemperature, SharedTime};
use crate::params::{Measured, NotIdentified, Params};
use crate::report::{Level, Report, Section};
use crate::units::{digits, duration};

/// Below this p-value the axes have different correlation times.
const SAME_TIME: f64 = 0.01;
/// Above this p-value the log does not show that the bias follows the temperature.
const FOLLOWS: f64 = 0.05;
/// Below this share of temperature in what was taken for it, its noise is said.
const RELIABLE: f64 = 0.9;
/// Candidates shown; all are in the JSON document.
const SHOWN_CANDIDATES: usize = 6;

/// `shared`: one correlation time for all axes, where that can be asked.
pub fn identify<'a>(params: &Params, axes: &'a [IdentifiedAxis], shared: Option<&SharedTime>) -> Report<'a> {
    let source = params.source.clone().unwrap_or_default();
    let log = source.log.unwrap_or_default();
    let failed = params.failed_check();
    let mut sections: Vec<Section<'_>> = axes.iter().map(|axis| of_axis(axis, params)).collect();
    sections.extend(shared.map(|shared| Section::of_page("All axes").paragraph(same_time(shared))));
    Report {
        title: format!("Noise parameters from {log}"),
        subtitle: failed.map_or_else(
            || "What a log of the sensor at rest says about its noise, and what it cannot say".into(),
            |failed| format!("A check failed: {failed}"),
        ),
        provenance: provenance([
            ("log", log),
            ("log SHA-256", source.sha256.unwrap_or_default()),
            ("samples", source.samples.map(|n| n.to_string()).unwrap_or_default()),
            ("span", source.span_s.map(|s| format!("{} s", digits(s))).unwrap_or_default()),
            ("sample rate", format!("{} Hz", digits(params.sample_rate_hz))),
            ("method", source.method.unwrap_or_default()),
        ]),
        sections,
        ..Report::default()
    }
}

fn of_axis<'a>(axis: &'a IdentifiedAxis, params: &Params) -> Section<'a> {
    let found = &axis.found;
    let section = Section::of_page(found.params.name.clone()).at(Level::Brief).paragraph(headline(axis));
    let section = parameters::table(section, found, params.quantity)
        .at(Level::Full)
        .figure("The measured curve with exact 95 % intervals for the model, and the model's terms.", || {
            allan::figure(&axis.measured)
        });
    let section = match &found.hold {
        Some(hold) => section.at(Level::Brief).paragraph(hold.sentence()).at(Level::Full),
        None => section,
    };
    let mut section = candidates(section, &found.candidates);
    if !found.steps.is_empty() {
        section = section
            .table("The recipe, step by step", &["step", "formula", "value", "unit"], found.steps.iter().map(step))
            .paragraph("What each step costs:")
            .list(found.steps.iter().map(|s| format!("{}: {}", s.what, s.cost)).collect());
    }
    if let Some(temperature) = &axis.temperature {
        section = on_temperature(section, temperature);
    }
    if !found.between.is_empty() {
        let each = found.between.iter().map(|b| format!("{} p = {}", b.parameter, digits(b.p_value)));
        section = section.paragraph(format!("Whether the logs are alike: {}", each.collect::<Vec<_>>().join(", ")));
    }
    if !found.not_identified.is_empty() {
        section = section
            .paragraph("What this log does not tell:")
            .list(found.not_identified.iter().map(not_identified).collect());
    }
    section.findings("warning", found.warnings.clone())
}

/// Whether the axes have one correlation time.
fn same_time(shared: &SharedTime) -> String {
    let limit = |limit: Option<f64>| limit.map_or("open".into(), digits);
    format!(
        "One correlation time for all axes: {} s ({} … {}); likelihood ratio {}, p = {}: {}",
        digits(shared.correlation_time_s),
        limit(shared.lower_s),
        limit(shared.upper_s),
        digits(shared.likelihood_ratio),
        digits(shared.p_value),
        if shared.p_value < SAME_TIME { "the axes differ" } else { "the log does not tell the axes apart" }
    )
}

/// "gyro_x: white+gm from 720000 samples (2 h); fit p = 0.41".
fn headline(axis: &IdentifiedAxis) -> String {
    let (found, samples) = (&axis.found, axis.found.samples);
    let (name, span) = (&found.params.name, duration(samples as f64 * found.curve.dt));
    let Some(chosen) = found.candidates.iter().find(|c| c.chosen) else {
        return format!("{name}: the graphical recipe on {samples} samples ({span})");
    };
    let used = found.first_tau_s.map_or_else(String::new, |tau| format!(", averaging times from {} s", digits(tau)));
    format!("{name}: {} from {samples} samples ({span}); fit p = {}{used}", chosen.model, digits(found.fit_p_value))
}

fn step(s: &Step) -> [String; 4] {
    [s.what.clone(), s.formula.clone(), or_dash(s.value), s.unit.clone()]
}

fn not_identified(entry: &NotIdentified) -> String {
    let needed =
        entry.needed_log_s.map_or_else(String::new, |s| format!("; a log of about {} would tell", duration(s)));
    format!("{}: {}{needed}", entry.term, entry.reason)
}

/// The models that were compared; none for the graphical recipe.
fn candidates<'a>(section: Section<'a>, candidates: &[Candidate]) -> Section<'a> {
    let Some(chosen) = candidates.iter().find(|c| c.chosen) else { return section };
    let best = candidates.iter().map(|c| c.score).fold(f64::INFINITY, f64::min);
    let against = |value: Option<f64>, chosen: Option<f64>| match (value, chosen) {
        (Some(value), Some(chosen)) => format!("{:+.2}", value - chosen),
        _ => "-".into(),
    };
    let row = |(_, c): (usize, &Candidate)| {
        let mark = match (c.chosen, c.identified) {
            (true, _) => "chosen",
            (false, false) => "not identified",
            (false, true) => "",
        };
        let [a, b, score] = match c.chi_square.zip(c.dof) {
            Some((chi_square, dof)) => [digits(chi_square), dof.to_string(), digits(c.score)],
            None => [
                against(c.log_likelihood, chosen.log_likelihood),
                against(c.held_out, chosen.held_out),
                format!("{:+.2}", c.score - best),
            ],
        };
        [c.model.clone(), c.parameters.to_string(), a, b, score, mark.into()]
    };
    let shown = candidates.iter().enumerate().filter(|(place, c)| *place < SHOWN_CANDIDATES || c.chosen);
    let (caption, [a, b]) = match chosen.chi_square {
        Some(_) => {
            let caption = "Candidates (score = chi-square + 4 per parameter + 4 per process; lowest wins)";
            (caption, ["chi-square", "dof"])
        }
        None => (
            "Candidates (ln L of the log, and of its last third under what the first two thirds give, against the \
             chosen; \
             score: -2 ln L plus a cost for every process, lowest wins, unless one within 6 of it foretells that third \
             better by more than 3)",
            ["ln L", "held out"],
        ),
    };
    section.table(caption, &["model", "parameters", a, b, "score", ""], shown.map(row))
}

/// What of the bias follows the temperature, and the parameters without and with that.
fn on_temperature<'a>(section: Section<'a>, of: &OnTemperature) -> Section<'a> {
    let [low, high] = of.range.map(digits);
    let unit = &of.reference.unit;
    let filled = match of.missing {
        0.0 => String::new(),
        share => format!("; {} % of the samples have none and are filled in", digits(100.0 * share)),
    };
    let column = &of.column;
    let averaged =
        format!("Temperature {column}, averaged over {} s: {low} … {high} {unit}{filled}.", digits(SMOOTHING_S));
    let found = match &of.found {
        Ok(found) => found,
        Err(reason) => return section.paragraph(format!("{averaged} No regression: {reason}.")),
    };
    let coefficient = of.coefficient(found);
    let [from, to] = coefficient.interval.map_or_else(Default::default, |ends| ends.map(digits));
    let verdict = if found.p_value < FOLLOWS {
        "the bias follows the temperature".to_string()
    } else {
        format!("a span of {} {unit} does not show that the bias follows the temperature", digits(of.span.value))
    };
    let mut sentences = vec![format!(
        "{averaged} Bias with temperature: {} {} (95 %: {from} … {to}); 2 Δ ln L {}, p = {}: {verdict}.",
        digits(coefficient.value),
        of.per,
        digits(found.likelihood_ratio),
        digits(found.p_value)
    )];
    sentences.extend(found.reliability.filter(|share| *share < RELIABLE).map(|share| {
        let percent = digits(100.0 * share);
        format!("The temperature is noisy: this coefficient is on average {percent} % of the true one.")
    }));
    let cells = |measured: &Measured| {
        let [low, high] = measured.interval.unwrap_or([0.0, f64::INFINITY]);
        let value = Some(measured.value).filter(|_| measured.interval.is_none() || (low > 0.0 && high.is_finite()));
        [value, Some(low).filter(|low| *low > 0.0), Some(high).filter(|high| high.is_finite())].map(or_dash)
    };
    let rows = found.parameters.iter().map(|pair| {
        let numbers = cells(&pair.without).into_iter().chain(cells(&pair.with));
        [pair.parameter.clone()].into_iter().chain(numbers).chain([pair.without.unit.to_string()])
    });
    section.paragraphs(sentences).table(
        "Parameters without the regression, which are those above and those written, and with it",
        &["parameter", "without", "95 % from", "to", "with", "95 % from", "to", "unit"],
        rows,
    )
}
