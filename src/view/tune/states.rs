//! States, loop and error budgets of a design in numbers.

use super::Group;
use crate::model::{DRIFT, LinearModel};
use crate::noise::Kind;
use crate::report::Section;
use crate::tune::Share;
use crate::units::digits;

/// States, what is said of measurement and loop, and error budgets.
pub(super) fn tables<'a>(section: Section<'a>, group: &Group<'_>) -> Section<'a> {
    let measurements = &group.design.model.measurements;
    let gains = measurements.iter().map(|m| match measurements.len() {
        1 => "steady gain".to_owned(),
        _ => format!("gain of {}", m.name),
    });
    let header = ["state", "unit", "sigma of P0", "sigma of Q per step", "steady sigma"].map(str::to_owned);
    let header: Vec<String> = header.into_iter().chain(gains).collect();
    let facts = facts(group).into_iter().map(|(label, value)| [label.to_string(), value]);
    let mut section = section
        .table("States", &header, state_rows(group))
        .minor(&["sigma of P0", "sigma of Q per step"])
        .table("Measurement and loop", &["", ""], facts);
    for budget in &group.report.plant_budgets {
        let (scale, unit) = group.shown(&budget.unit);
        let caption = format!("Error budget of the {} in steady state (sigma in {unit})", budget.state);
        section = budget_table(section, caption, &budget.error_budget, scale);
    }
    if group.report.error_budget.is_empty() {
        return section
            .paragraph("Error budget: the error of the drift estimate tends to zero; there is nothing to share out.");
    }
    let caption = format!("Error budget of the drift estimate in steady state (sigma in {})", group.unit);
    budget_table(section, caption, &group.report.error_budget, group.unit.scale())
}

fn state_rows(group: &Group<'_>) -> Vec<Vec<String>> {
    let (model, steady) = (&group.design.model, &group.design.steady_state);
    let p = &steady.predicted_covariance;
    let row = |i: usize| {
        let (scale, unit) = group.of_state(i);
        let sigma = |variance: f64| digits(variance.max(0.0).sqrt() / scale);
        // after the update: P(k|k) = (I − K H) P(k|k−1)
        let updated = p[(i, i)] - (steady.gain.row(i) * &model.h * p.column(i))[(0, 0)];
        let vanishes = p[(i, i)] == 0.0;
        let of_steady = if vanishes { "tends to 0".into() } else { sigma(updated) };
        let gains = model.measurements.iter().enumerate();
        let gains = gains.map(|(j, m)| digits(steady.gain[(i, j)] * group.shown(&m.unit).0 / scale));
        let sigmas = [sigma(model.p0[(i, i)]), sigma(model.q[(i, i)]), of_steady];
        [model.states[i].name.clone(), unit].into_iter().chain(sigmas).chain(gains).collect()
    };
    (0..model.states.len()).map(row).collect()
}

/// Label and value of what is said in one line each.
fn facts(group: &Group<'_>) -> Vec<(&'static str, String)> {
    let (model, steady, report) = (&group.design.model, &group.design.steady_state, group.report);
    let mut facts = Vec::new();
    for (i, measurement) in model.measurements.iter().enumerate() {
        let (scale, unit) = group.shown(&measurement.unit);
        let root_r = model.r[(i, i)].sqrt() / scale;
        let which = if model.measurements.len() > 1 { format!(" of {}", measurement.name) } else { String::new() };
        // R is all of a sample's noise only where none of it has states
        let noise = |s: usize| Kind::of_state(&model.states[s].name).is_some_and(|kind| !kind.is_drift());
        let is_noise = |s: usize| model.h[(i, s)] != 0.0 && noise(s);
        let white = if (0..model.states.len()).any(is_noise) { "white noise of " } else { "" };
        let [r, sigma] = [root_r * root_r, root_r].map(digits);
        facts.push(("R", format!("{r} ({unit})^2: {white}one sample{which} has sigma {sigma} {unit}")));
    }
    if steady.period > 1 {
        let what = "steady sigma and gain are those at a sample at which every measurement is taken, after it";
        facts.push(("period", format!("{} samples: {what}", steady.period)));
    }
    facts.push(("closed-loop poles", poles_text(&steady.poles, model.dt)));
    let settling = Some(steady.settling_time).filter(|time| *time > 0.0).map_or_else(
        || "never: the estimate gets better for ever".into(),
        |time| format!("{} s (four time constants of the slowest driven pole)", digits(time)),
    );
    facts.push(("settling time", settling));
    let settled = report.drift_settling_time_s.map_or_else(
        || "later than the table below reaches".into(),
        |time| format!("{} s (sigma within 5 % of its final value)", digits(time)),
    );
    facts.push(("drift estimate settled", settled));
    facts.extend(bandwidth(group).map(|text| ("bandwidth", text)));
    let (residual, difference) = (steady.residual, steady.eigenvector_difference);
    let riccati = format!("relative residual {residual:.1e}, difference to the eigenvector solution {difference:.1e}");
    facts.push(("Riccati equation", riccati));
    facts
}

fn bandwidth(group: &Group<'_>) -> Option<String> {
    let (model, report) = (&group.design.model, group.report);
    let output = model.outputs.iter().find(|output| output.name != DRIFT);
    match (report.bandwidth_hz.map(digits), output) {
        (Some(hz), None) => Some(format!("{hz} Hz (half power of the drift estimate)")),
        (None, None) if report.error_budget.is_empty() => Some("0: the filter follows no drift".into()),
        (None, None) => Some("up to half the sample rate: the drift estimate follows each sample".into()),
        (Some(hz), Some(output)) => {
            let above = model.inputs.first().map_or_else(String::new, |input| format!(", above it the {}", input.name));
            let (state, measurement) = (&output.name, &model.measurements[0].name);
            Some(format!("{hz} Hz: below it the {state} follows the {measurement}{above} (half power)"))
        }
        (None, Some(_)) => None,
    }
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

/// `scale`: of the unit in which sigmas are shown.
fn budget_table<'a>(section: Section<'a>, caption: String, budget: &[Share], scale: f64) -> Section<'a> {
    let sigma = |variance: f64| digits(variance.sqrt() / scale);
    let total: f64 = budget.iter().map(|share| share.variance_si).sum();
    let rows = budget.iter().map(|s| [s.source.clone(), sigma(s.variance_si), format!("{:.2} %", 100.0 * s.share)]);
    let all = ["all".to_string(), sigma(total), "100 %".into()];
    section.table(caption, &["source", "sigma", "share of variance"], rows.chain([all]))
}

/// States with a column of their own: not those that only together stand for flicker or an average.
pub(super) fn single(model: &LinearModel) -> impl Iterator<Item = usize> + '_ {
    let joint = |i: usize| Kind::of_state(&model.states[i].name).is_some_and(Kind::has_joint_states);
    (0..model.states.len()).filter(move |&i| !joint(i))
}

/// Sigma over time, about one row per decade.
pub(super) fn predicted<'a>(section: Section<'a>, group: &Group<'_>) -> Section<'a> {
    let (model, predicted) = (&group.design.model, &group.report.predicted);
    let of_states = single(model).map(|i| match group.of_state(i).1 {
        unit if unit == group.unit.text() || model.outputs.is_empty() => model.states[i].name.clone(),
        unit => format!("{} ({unit})", model.states[i].name),
    });
    let whole = format!("whole drift ({})", group.unit);
    let header: Vec<String> = ["time (s)".to_string()].into_iter().chain(of_states).chain([whole]).collect();
    let last = predicted.time_s.len().saturating_sub(1);
    let mut decade = f64::NEG_INFINITY;
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (k, &time) in predicted.time_s.iter().enumerate() {
        let exponent = if time > 0.0 { (time.log10() + 1e-6).floor() } else { f64::NEG_INFINITY };
        if k == 0 || k == last || exponent > decade {
            let sigmas = single(model).map(|i| predicted.sigma[i][k] / group.of_state(i).0);
            let whole = group.unit.from_si(predicted.total[k]);
            rows.push(std::iter::once(time).chain(sigmas).chain([whole]).map(digits).collect());
        }
        decade = decade.max(exponent);
    }
    section.table("Predicted sigma of the estimation errors", &header, rows)
}
