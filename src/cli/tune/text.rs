//! A design as a person reads it.

use super::view::{Group, View, shown, told};
use super::{insight, truth};
use crate::cli::output::{digits, shown_unit, table};
use crate::consistency::Verdict;
use crate::model::{DRIFT, LinearModel};
use crate::montecarlo::Outcome;
use crate::replay::ReplayResult;
use crate::tune::Share;
use crate::units::Quantity;

/// Columns of the table of states; a gain per measurement.
pub(super) fn state_header(model: &LinearModel) -> Vec<String> {
    let first = ["state", "unit", "sigma of P0", "sigma of Q per step", "steady sigma"].map(str::to_owned);
    let gains = model.measurements.iter().map(|m| match model.measurements.len() {
        1 => "steady gain".to_owned(),
        _ => format!("gain of {}", m.name),
    });
    first.into_iter().chain(gains).collect()
}

pub(super) const BUDGET: [&str; 3] = ["source", "sigma", "share of variance"];

/// The whole printed text.
pub(super) fn design(view: &View<'_>) -> String {
    let params = view.params;
    let mut out =
        format!("{}: plant {}, {} Hz, {}\n", view.name, view.tuned.design.plant, params.sample_rate_hz, measured(view));
    for group in view.groups() {
        let unit = &group.unit;
        let header = state_header(&group.design.model);
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        out.push_str(&format!("\n{}\n{}", group.title(), table(&header, &state_rows(&group, params.quantity))));
        out.push('\n');
        for (label, value) in facts(&group, params.quantity) {
            out.push_str(&format!("{label:<26}{value}\n"));
        }
        out.push('\n');
        for budget in &group.report.plant_budgets {
            let (scale, unit) = shown_unit(&budget.unit, params.quantity, unit);
            out.push_str(&format!(
                "Error budget of the {} in steady state (sigma in {unit})\n{}\n",
                budget.state,
                table(&BUDGET, &share_rows(&budget.error_budget, scale))
            ));
        }
        if group.report.error_budget.is_empty() {
            out.push_str(
                "Error budget: the error of the drift estimate tends to zero; there is nothing to share out.\n",
            );
        } else {
            out.push_str(&format!(
                "Error budget of the drift estimate in steady state (sigma in {unit})\n{}",
                table(&BUDGET, &budget_rows(&group))
            ));
        }
        let header = sigma_header(&group, params.quantity);
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        out.push_str(&format!(
            "\nPredicted sigma of the estimation errors\n{}",
            table(&header, &sigma_rows(&group, params.quantity))
        ));
        out.push('\n');
        if let Some(of_axis) = view.insight(&group) {
            out.push_str(&insight::text(&group, of_axis, params.quantity));
        }
        for sentence in &group.report.observability {
            out.push_str(&format!("{sentence}\n"));
        }
        for warning in &group.report.warnings {
            out.push_str(&format!("note: {warning}\n"));
        }
    }
    out.push_str(&truth::text(view));
    out.push_str(&verification(view.verification, params.sample_rate_hz));
    out
}

/// What the filter is given.
pub(super) fn measured(view: &View<'_>) -> String {
    let Some(model) = view.tuned.design.axes.first().map(|axis| &axis.model) else { return String::new() };
    if model.outputs.is_empty() {
        return "measurement z = sum of the states + white noise".into();
    }
    let rate = |every: usize| digits(view.params.sample_rate_hz / every as f64);
    let inputs = model.inputs.iter().map(|input| format!("input {}", input.name));
    let measurements = model
        .measurements
        .iter()
        .zip(&model.every)
        .map(|(m, every)| format!("measurement {} at {} Hz", m.name, rate(*every)));
    inputs.chain(measurements).collect::<Vec<_>>().join(", ")
}

pub(super) fn state_rows(group: &Group<'_>, quantity: Quantity) -> Vec<Vec<String>> {
    let (model, steady) = (&group.design.model, &group.design.steady_state);
    let p = &steady.predicted_covariance;
    (0..model.states.len())
        .map(|i| {
            let (scale, unit) = shown(model, i, quantity, &group.unit);
            let sigma = |variance: f64| digits(variance.max(0.0).sqrt() / scale);
            // after the update: P(k|k) = (I − K H) P(k|k−1)
            let updated = p[(i, i)] - (steady.gain.row(i) * &model.h * p.column(i))[(0, 0)];
            let vanishes = p[(i, i)] == 0.0;
            let gains = model.measurements.iter().enumerate().map(|(j, measurement)| {
                digits(steady.gain[(i, j)] * shown_unit(&measurement.unit, quantity, &group.unit).0 / scale)
            });
            let mut row = vec![
                model.states[i].name.clone(),
                unit,
                sigma(model.p0[(i, i)]),
                sigma(model.q[(i, i)]),
                if vanishes { "tends to 0".into() } else { sigma(updated) },
            ];
            row.extend(gains);
            row
        })
        .collect()
}

/// States that are noise of the measurement, not drift.
const NOISE: [&str; 4] = ["quantization", "moving_average", "band_limit", "oscillation"];

/// Label and value of what is said in one line each.
pub(super) fn facts(group: &Group<'_>, quantity: Quantity) -> Vec<(&'static str, String)> {
    let (model, steady, report) = (&group.design.model, &group.design.steady_state, group.report);
    let mut facts = Vec::new();
    for (i, measurement) in model.measurements.iter().enumerate() {
        let (scale, unit) = shown_unit(&measurement.unit, quantity, &group.unit);
        let root_r = model.r[(i, i)].sqrt() / scale;
        let which = if model.measurements.len() > 1 { format!(" of {}", measurement.name) } else { String::new() };
        // R is all of a sample's noise only where none of it has states
        let is_noise =
            |s: usize| model.h[(i, s)] != 0.0 && NOISE.iter().any(|kind| model.states[s].name.contains(kind));
        let white = if (0..model.states.len()).any(is_noise) { "white noise of " } else { "" };
        facts.push((
            "R",
            format!(
                "{} ({unit})^2: {white}one sample{which} has sigma {} {unit}",
                digits(root_r * root_r),
                digits(root_r)
            ),
        ));
    }
    if steady.period > 1 {
        let text = format!(
            "{} samples: steady sigma and gain are those at a sample at which every measurement is taken, after it",
            steady.period
        );
        facts.push(("period", text));
    }
    facts.extend([
        ("closed-loop poles", poles_text(&steady.poles, model.dt)),
        (
            "settling time",
            if steady.settling_time > 0.0 {
                format!("{} s (four time constants of the slowest driven pole)", digits(steady.settling_time))
            } else {
                "never: the estimate gets better for ever".into()
            },
        ),
        (
            "drift estimate settled",
            report.drift_settling_time_s.map_or_else(
                || "later than the table below reaches".into(),
                |t| format!("{} s (sigma within 5 % of its final value)", digits(t)),
            ),
        ),
        (
            "Riccati equation",
            format!(
                "relative residual {:.1e}, difference to the eigenvector solution {:.1e}",
                steady.residual, steady.eigenvector_difference
            ),
        ),
    ]);
    let output = model.outputs.iter().find(|output| output.name != DRIFT);
    let bandwidth = match (report.bandwidth_hz, output) {
        (Some(f), None) => Some(format!("{} Hz (half power of the drift estimate)", digits(f))),
        (None, None) if report.error_budget.is_empty() => Some("0: the filter follows no drift".into()),
        (None, None) => Some("up to half the sample rate: the drift estimate follows each sample".into()),
        (Some(f), Some(output)) => {
            let above = if model.inputs.is_empty() {
                String::new()
            } else {
                format!(", above it the {}", model.inputs[0].name)
            };
            let (hz, state, measurement) = (digits(f), &output.name, &model.measurements[0].name);
            Some(format!("{hz} Hz: below it the {state} follows the {measurement}{above} (half power)"))
        }
        (None, Some(_)) => None,
    };
    if let Some(bandwidth) = bandwidth {
        facts.insert(facts.len() - 1, ("bandwidth", bandwidth));
    }
    facts
}

fn pole_text((re, im): (f64, f64), dt: f64) -> String {
    let modulus = re.hypot(im);
    let value = if im == 0.0 { format!("{re:.8}") } else { format!("{re:.8}{im:+.8}i") };
    if modulus >= 1.0 - 1e-12 {
        format!("{value} (holds for ever)")
    } else if modulus > 0.0 {
        format!("{value} (time constant {} s)", digits(-dt / (modulus - 1.0).ln_1p()))
    } else {
        value
    }
}

/// Every pole, or of many only how far they reach.
fn poles_text(poles: &[(f64, f64)], dt: f64) -> String {
    if poles.len() <= 4 {
        return poles.iter().map(|pole| pole_text(*pole, dt)).collect::<Vec<_>>().join(", ");
    }
    let time = |(re, im): &(f64, f64)| -dt / (re.hypot(*im) - 1.0).ln_1p();
    let decaying: Vec<f64> = poles.iter().filter(|p| p.0.hypot(p.1) < 1.0 - 1e-12).map(time).collect();
    format!(
        "{} with time constants from {} s to {} s, {} that hold for ever",
        decaying.len(),
        digits(decaying.iter().copied().fold(f64::INFINITY, f64::min)),
        digits(decaying.iter().copied().fold(0.0, f64::max)),
        poles.len() - decaying.len()
    )
}

pub(super) fn budget_rows(group: &Group<'_>) -> Vec<Vec<String>> {
    share_rows(&group.report.error_budget, group.unit.scale())
}

/// Sigmas in the unit of this scale.
fn share_rows(budget: &[Share], scale: f64) -> Vec<Vec<String>> {
    let sigma = |variance: f64| digits(variance.sqrt() / scale);
    let mut rows: Vec<Vec<String>> = budget
        .iter()
        .map(|s| vec![s.source.clone(), sigma(s.variance_si), format!("{:.2} %", 100.0 * s.share)])
        .collect();
    let total: f64 = budget.iter().map(|s| s.variance_si).sum();
    rows.push(vec!["all".into(), sigma(total), "100 %".into()]);
    rows
}

pub(super) fn sigma_header(group: &Group<'_>, quantity: Quantity) -> Vec<String> {
    let mut header = vec!["time (s)".to_string()];
    let model = &group.design.model;
    header.extend(told(model).map(|i| match shown(model, i, quantity, &group.unit).1 {
        unit if unit == group.unit.text() || model.outputs.is_empty() => model.states[i].name.clone(),
        unit => format!("{} ({unit})", model.states[i].name),
    }));
    header.push(format!("whole drift ({})", group.unit));
    header
}

/// About one row per decade.
pub(super) fn sigma_rows(group: &Group<'_>, quantity: Quantity) -> Vec<Vec<String>> {
    let predicted = &group.report.predicted;
    let last = predicted.time_s.len().saturating_sub(1);
    let mut decade = f64::NEG_INFINITY;
    let mut rows = Vec::new();
    for (k, &time) in predicted.time_s.iter().enumerate() {
        let exponent = if time > 0.0 { (time.log10() + 1e-6).floor() } else { f64::NEG_INFINITY };
        if k == 0 || k == last || exponent > decade {
            let mut row = vec![digits(time)];
            for i in told(&group.design.model) {
                row.push(digits(predicted.sigma[i][k] / shown(&group.design.model, i, quantity, &group.unit).0));
            }
            row.push(digits(group.unit.from_si(predicted.total[k])));
            rows.push(row);
        }
        decade = decade.max(exponent);
    }
    rows
}

pub(super) const VERIFICATION: [&str; 7] =
    ["axis", "NEES at first", "NEES over time", "NEES at last", "NIS", "least adjusted p", "result"];

pub(super) fn verification_rows(outcome: &Outcome) -> Vec<Vec<String>> {
    let row = |axis: &crate::montecarlo::AxisOutcome| {
        let mine = || outcome.tests.iter().filter(|t| t.axis == axis.name);
        let least = mine().map(|t| t.adjusted_p_value).fold(1.0, f64::min);
        let or_none = |value: Option<f64>| value.map_or_else(|| "-".into(), digits);
        vec![
            axis.name.clone(),
            or_none(axis.nees.mean.first().copied()),
            digits(axis.nees_average.mean),
            or_none(axis.nees.mean.last().copied()),
            or_none(axis.innovations.first().map(|i| i.nis)),
            digits(least),
            if mine().all(|t| t.pass()) { "pass" } else { "FAIL" }.into(),
        ]
    };
    outcome.axes.iter().map(row).collect()
}

/// What was run and what it means.
pub(super) fn verification_sentence(outcome: &Outcome, sample_rate_hz: f64) -> String {
    let what = format!(
        "{} runs of {} s on the design's own model (seed {}), {} tests, false alarm {} %",
        outcome.runs.count(),
        outcome.steps as f64 / sample_rate_hz,
        outcome.seed,
        outcome.tests.len(),
        100.0 * outcome.alpha
    );
    match outcome.verdict {
        Verdict::Consistent => format!("{what}: errors and innovations are as large as the filter says"),
        _ => {
            let failed: Vec<String> = outcome
                .tests
                .iter()
                .filter(|t| !t.pass())
                .map(|t| format!("{} {}: {}", t.axis, t.name, t.meaning))
                .collect();
            format!("{what}: {}", failed.join("; "))
        }
    }
}

fn verification(outcome: &Outcome, sample_rate_hz: f64) -> String {
    format!(
        "\nQuick Monte Carlo: mean NEES per state and mean NIS, 1 when the filter's covariance is right\n{}{}: {}\n",
        table(&VERIFICATION, &verification_rows(outcome)),
        outcome.verdict.word(),
        verification_sentence(outcome, sample_rate_hz)
    )
}

/// The verdict of the log.
pub(super) fn replay(result: &ReplayResult) -> String {
    format!(
        "\n{} through this design: {}: {}\n",
        result.log.as_deref().unwrap_or("the log"),
        result.verdict.word(),
        result.meaning
    )
}
