//! When states are known, what better parts buy, what wrong parameters cost: as text and for the page.

use super::view::Group;
use crate::cli::output::{digits, duration, shown_unit, table};
use crate::filter::single::{SingleForm, SinglePrecision, SingleResult};
use crate::report::figure::{self, Curve, Worth as WorthFigure};
use crate::report::page::Section;
use crate::tune::{FACTORS, Insight, MISTAKES, OutputInsight, WHOLE_SENSOR, Worth};
use crate::units::Quantity;

const OBSERVED: [&str; 6] = ["state", "unit", "sigma at first", "in the end", "half known after", "known after"];
const OBSERVED_CAPTION: &str =
    "When each state is known: half and 95 % of the variance that the measurements will ever take away is gone";
/// Lines of the figure.
const MOST_LINES: usize = 6;

/// Three kinds of tables.
pub(super) fn text(group: &Group<'_>, insight: &Insight, quantity: Quantity) -> String {
    let mut out = format!("{OBSERVED_CAPTION}\n{}", table(&OBSERVED, &observed_rows(group, insight, quantity)));
    for output in &insight.outputs {
        out.push_str(&format!(
            "\n{}\n{}",
            worth_caption(group, output, quantity),
            table(&WORTH, &worth_rows(group, output, quantity))
        ));
    }
    let header = mistake_header(insight);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    if !insight.mistakes.is_empty() {
        out.push_str(&format!("\n{MISTAKES_CAPTION}\n{}", table(&header, &mistake_rows(insight))));
    }
    let single = &insight.single_precision;
    out.push_str(&format!("\n{}\n{}\n", single_caption(group, single), table(&SINGLE, &single_rows(group, single))));
    out
}

/// The same with figures.
pub(super) fn section(group: &Group<'_>, insight: &Insight, quantity: Quantity) -> Section {
    let header = mistake_header(insight);
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut section = Section::new(format!("{}: what could be", group.title())).table(
        OBSERVED_CAPTION,
        &OBSERVED,
        observed_rows(group, insight, quantity),
    );
    for output in &insight.outputs {
        section = section.figures(vec![(figure(group, output, quantity), String::new())]).table(
            worth_caption(group, output, quantity),
            &WORTH,
            worth_rows(group, output, quantity),
        );
    }
    let single = &insight.single_precision;
    section.table(MISTAKES_CAPTION, &header, mistake_rows(insight)).table(
        single_caption(group, single),
        &SINGLE,
        single_rows(group, single),
    )
}

/// Steady sigma against the quality of the parts that matter most.
pub(super) fn figure(group: &Group<'_>, output: &OutputInsight, quantity: Quantity) -> String {
    let (scale, unit) = shown_unit(&output.unit, quantity, &group.unit);
    let curve = |worth: &Worth| Curve {
        label: worth.parameter.clone(),
        points: worth.factors.iter().zip(&worth.sigma).filter_map(|(f, s)| Some((*f, (*s)? / scale))).collect(),
    };
    figure::worth(&WorthFigure {
        title: format!("{}: what better parts buy", group.title()),
        quantity: format!("steady sigma of the {}", output.name.replace('_', " ")),
        unit,
        curves: by_effect(output).into_iter().take(MOST_LINES).map(curve).collect(),
    })
}

fn observed_rows(group: &Group<'_>, insight: &Insight, quantity: Quantity) -> Vec<Vec<String>> {
    let row = |o: &crate::tune::Observed| {
        let (scale, unit) = shown_unit(&o.unit, quantity, &group.unit);
        let after = |time: Option<f64>| time.map_or_else(|| "-".into(), duration);
        let last = if o.final_sigma == 0.0 { "tends to 0".into() } else { digits(o.final_sigma / scale) };
        vec![o.state.clone(), unit, digits(o.initial_sigma / scale), last, after(o.half_s), after(o.most_s)]
    };
    insight.observed.iter().map(row).collect()
}

const WORTH: [&str; 6] = ["parameter", "value", "at half of it", "change", "at twice", "change"];

fn worth_caption(group: &Group<'_>, output: &OutputInsight, quantity: Quantity) -> String {
    let (scale, unit) = shown_unit(&output.unit, quantity, &group.unit);
    format!(
        "What other parts buy: steady sigma of the {} in {unit}, {} as designed; the filter is designed anew",
        output.name.replace('_', " "),
        digits(output.sigma / scale)
    )
}

/// The sigma at a factor.
fn at(worth: &Worth, factor: f64) -> Option<f64> {
    FACTORS.iter().position(|f| *f == factor).and_then(|i| worth.sigma[i])
}

/// The one that changes the sigma most comes first.
fn by_effect(output: &OutputInsight) -> Vec<&Worth> {
    let effect = |worth: &Worth| {
        [0.5, 2.0].iter().filter_map(|f| at(worth, *f)).map(|s| (s / output.sigma).ln().abs()).fold(0.0, f64::max)
    };
    let mut sorted: Vec<&Worth> = output.worth.iter().collect();
    sorted.sort_by(|a, b| effect(b).total_cmp(&effect(a)));
    sorted
}

fn worth_rows(group: &Group<'_>, output: &OutputInsight, quantity: Quantity) -> Vec<Vec<String>> {
    let scale = shown_unit(&output.unit, quantity, &group.unit).0;
    let row = |worth: &Worth| {
        let value = match (worth.value, &worth.value_unit) {
            (Some(value), Some(unit)) => format!("{} {unit}", digits(value)),
            _ => "all its noise".into(),
        };
        let mut row = vec![worth.parameter.clone(), value];
        for factor in [0.5, 2.0] {
            match at(worth, factor) {
                Some(sigma) => {
                    row.extend([digits(sigma / scale), format!("{:+.1} %", 100.0 * (sigma / output.sigma - 1.0))]);
                }
                None => row.extend(["-".into(), "-".into()]),
            }
        }
        row
    };
    by_effect(output).into_iter().map(row).collect()
}

const MISTAKES_CAPTION: &str = "What wrong parameters cost: real sigma over claimed sigma and mean NIS in steady state, the filter as designed, \
     the truth with";

fn mistake_header(insight: &Insight) -> Vec<String> {
    let mut header = vec!["parameter".to_string()];
    for factor in MISTAKES {
        let size = if factor < 1.0 { "half" } else { "twice" };
        header.extend(insight.outputs.iter().map(|output| format!("{size}: {}", output.name.replace('_', " "))));
        header.push("NIS".into());
    }
    header
}

fn mistake_rows(insight: &Insight) -> Vec<Vec<String>> {
    let mut parameters: Vec<&str> = insight.mistakes.iter().map(|m| m.parameter.as_str()).collect();
    parameters.dedup();
    let cells = |parameter: &str, factor: f64| -> Vec<String> {
        let found = insight.mistakes.iter().find(|m| m.parameter == parameter && m.factor == factor);
        let values = found.map(|m| m.real_over_claimed.iter().chain([&m.nis]).map(|v| digits(*v)).collect());
        values.unwrap_or_else(|| vec!["-".into(); insight.outputs.len() + 1])
    };
    let named = |parameter: &str| match parameter {
        WHOLE_SENSOR => "sensor (all its noise)".to_string(),
        other => other.to_string(),
    };
    let row = |parameter: &&str| {
        std::iter::once(named(parameter)).chain(MISTAKES.iter().flat_map(|f| cells(parameter, *f))).collect()
    };
    parameters.iter().map(row).collect()
}

const SINGLE: [&str; 5] = ["update in f32", "largest error", "of", "claimed sigma", "of"];

fn single_caption(group: &Group<'_>, single: &SinglePrecision) -> String {
    format!(
        "In single precision: error and claimed sigma over those in double, worst state, {} of the design's own model; the correlation \
         matrix of P has condition {}",
        duration(single.steps as f64 * group.design.model.dt),
        digits(single.condition)
    )
}

fn single_rows(group: &Group<'_>, single: &SinglePrecision) -> Vec<Vec<String>> {
    let states = &group.design.model.states;
    let worst = |values: &[f64]| -> (usize, f64) {
        let far = |v: &f64| if v.is_finite() { v.ln().abs() } else { f64::INFINITY };
        let (i, v) = values
            .iter()
            .enumerate()
            .max_by(|a, b| far(a.1).total_cmp(&far(b.1)))
            .map_or((0, f64::NAN), |(i, v)| (i, *v));
        (i, v)
    };
    let row = |result: &SingleResult| {
        let form = match result.form {
            SingleForm::Conventional => "P - K h P",
            SingleForm::Joseph => "Joseph",
            SingleForm::SquareRoot => "square root",
        };
        if let Some(step) = result.lost_at {
            let when = duration(step as f64 * group.design.model.dt);
            return vec![
                form.into(),
                format!("covariance lost after {when}"),
                String::new(),
                "-".into(),
                String::new(),
            ];
        }
        let ((e, error), (c, claimed)) = (worst(&result.error), worst(&result.claimed));
        vec![form.into(), digits(error), states[e].name.clone(), digits(claimed), states[c].name.clone()]
    };
    single.forms.iter().map(row).collect()
}
