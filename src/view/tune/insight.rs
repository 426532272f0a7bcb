//! When states are known, what better parts buy, what wrong parameters cost.

use super::Group;
use crate::filter::single::{SingleForm, SingleResult};
use crate::report::Section;
use crate::report::figure::{self, Curve, Worth as WorthFigure};
use crate::tune::{FACTORS, Insight, MISTAKES, Observed, OutputInsight, WHOLE_SENSOR, Worth};
use crate::units::{digits, duration};

/// Lines of the figure.
const MOST_LINES: usize = 6;

/// With figures of what better parts buy.
pub(super) fn section<'a>(group: &Group<'a>, insight: &'a Insight) -> Section<'a> {
    let mut section = Section::new(format!("{}: what could be", group.title())).table(
        "When each state is known: half and 95 % of the variance that the measurements will ever take away is gone",
        &["state", "unit", "sigma at first", "in the end", "half known after", "known after"],
        insight.observed.iter().map(|observed| observed_row(group, observed)),
    );
    for output in &insight.outputs {
        let (scale, unit) = group.shown(&output.unit);
        let caption = format!(
            "What other parts buy: steady sigma of the {} in {unit}, {} as designed; the filter is designed anew",
            output.name.replace('_', " "),
            digits(output.sigma / scale)
        );
        let of_group = group.clone();
        section = section.figure("", move || figure(&of_group, output)).table(
            caption,
            &["parameter", "value", "at half of it", "change", "at twice", "change"],
            worth_rows(output, scale),
        );
    }
    let single = &insight.single_precision;
    let duration = duration(single.steps as f64 * group.design.model.dt);
    section
        .table(
            "What wrong parameters cost: real sigma over claimed sigma and mean NIS in steady state, the filter as \
             designed, the truth with",
            &mistake_header(insight),
            mistake_rows(insight),
        )
        .table(
            format!(
                "In single precision: error and claimed sigma over those in double, worst state, {duration} of the \
                 design's own model; the correlation matrix of P has condition {}",
                digits(single.condition)
            ),
            &["update in f32", "largest error", "of", "claimed sigma", "of"],
            single.forms.iter().map(|form| single_row(group, form)),
        )
}

/// Steady sigma against the quality of the parts that matter most.
fn figure(group: &Group<'_>, output: &OutputInsight) -> String {
    let (scale, unit) = group.shown(&output.unit);
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

fn observed_row(group: &Group<'_>, observed: &Observed) -> [String; 6] {
    let (scale, unit) = group.shown(&observed.unit);
    let after = |time: Option<f64>| time.map_or_else(|| "-".into(), duration);
    let last = observed.final_sigma / scale;
    let last = if last == 0.0 { "tends to 0".into() } else { digits(last) };
    let first = digits(observed.initial_sigma / scale);
    [observed.state.clone(), unit, first, last, after(observed.half_s), after(observed.most_s)]
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

/// `scale`: of the unit in which sigmas are shown.
fn worth_rows(output: &OutputInsight, scale: f64) -> Vec<Vec<String>> {
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

fn single_row(group: &Group<'_>, result: &SingleResult) -> [String; 5] {
    let states = &group.design.model.states;
    let worst = |values: &[f64]| -> [String; 2] {
        let far = |v: &f64| if v.is_finite() { v.ln().abs() } else { f64::INFINITY };
        let found = values.iter().enumerate().max_by(|a, b| far(a.1).total_cmp(&far(b.1)));
        let (state, value) = found.map_or((0, f64::NAN), |(i, v)| (i, *v));
        [digits(value), states[state].name.clone()]
    };
    let form = match result.form {
        SingleForm::Conventional => "P - K h P",
        SingleForm::Joseph => "Joseph",
        SingleForm::SquareRoot => "square root",
    };
    let ([error, of], [claimed, of_claimed]) = match result.lost_at {
        Some(step) => {
            let when = duration(step as f64 * group.design.model.dt);
            ([format!("covariance lost after {when}"), String::new()], ["-".into(), String::new()])
        }
        None => (worst(&result.error), worst(&result.claimed)),
    };
    [form.into(), error, of, claimed, of_claimed]
}
