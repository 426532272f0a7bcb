//! How long to record, and at which rate.

use super::or_dash;
use crate::identify::log_plan::{AxisPlan, HOURS, LogPlan, RatePlan};
use crate::identify::plan::Thinning;
use crate::report::{Report, Section};
use crate::units::{digits, duration};

/// Axes alike are shown once.
pub fn plan<'a>(plan: &LogPlan) -> Report<'a> {
    let mut sections: Vec<Section<'_>> = Vec::new();
    for alike in plan.axes.chunk_by(|a, b| a.model == b.model) {
        let names: Vec<&str> = alike.iter().map(|axis| axis.name.as_str()).collect();
        sections.push(of_axis(plan, &alike[0], &names.join(", ")));
    }
    sections.push(Section::new("").paragraphs(
        [
            "Precision: relative standard deviation (1 sigma) of a maximum likelihood estimate, Cramér-Rao bound at \
             these parameters.",
            "Assumed: a sensor at rest, the model of the parameters; the same coefficients at a higher rate (white \
             noise of the same density);",
            "a lower rate either as means of consecutive samples or with samples thrown away.",
        ]
        .map(String::from)
        .to_vec(),
    ));
    let alike = plan.axes.chunk_by(|a, b| a.model == b.model);
    let answers = alike.map(|alike| {
        let names: Vec<&str> = alike.iter().map(|axis| axis.name.as_str()).collect();
        let best =
            alike[0].recommended.as_ref().map(|best| format!("; lowest rate for at most 5 % more: {}", advice(best)));
        answer(plan, &alike[0], &names.join(", ")) + &best.unwrap_or_default()
    });
    let short = Section::new("").paragraphs(answers.collect());
    Report { title: format!("A log for {}", plan.parameter), sections, answer: short, ..Report::default() }
}

/// How long a log must be.
fn answer(plan: &LogPlan, axis: &AxisPlan, names: &str) -> String {
    let wish = format!("{} %", digits(100.0 * plan.precision));
    let value = axis.value.as_ref().map_or_else(String::new, |value| format!(" ({value})"));
    let rate = digits(plan.sample_rate_hz);
    let needed = match (axis.duration_s, known(axis.precision_after_ten_years)) {
        (Some(seconds), _) => format!("{} at {rate} Hz", duration(seconds)),
        (None, Some(share)) => {
            format!("no log is long enough; ten years at {rate} Hz give {} %", digits(100.0 * share))
        }
        (None, None) => format!(
            "no log is long enough; ten years at {rate} Hz say nothing of it: the model cannot tell it from its other \
             parameters"
        ),
    };
    format!("{names}: {}{value} to {wish}: {needed}", plan.parameter)
}

fn of_axis<'a>(plan: &LogPlan, axis: &AxisPlan, names: &str) -> Section<'a> {
    let mut section = Section::new("").paragraph(answer(plan, axis, names)).table(
        "At other rates",
        &["rate (Hz)", "samples", "length", "against own rate"],
        axis.rates.iter().map(rate_row),
    );
    if let Some(best) = &axis.recommended {
        section = section.paragraph(format!("Lowest rate for at most 5 % more: {}", advice(best)));
    }
    let lengths = axis.duration_s.map(duration).into_iter().chain(HOURS.map(|hours| format!("{hours} h")));
    let header: Vec<String> = ["parameter".to_string()].into_iter().chain(lengths).collect();
    let rows = axis.parameters.iter().map(|parameter| {
        let planned = axis.duration_s.map(|_| parameter.after_duration);
        let shares = planned.into_iter().chain(parameter.after_hours.iter().map(|after| after.precision));
        let cells = shares.map(|share| or_dash(known(share).map(|share| 100.0 * share)));
        std::iter::once(parameter.parameter.clone()).chain(cells).collect::<Vec<_>>()
    });
    section.table("Precision (%) after", &header, rows)
}

/// Beyond ten times the value nothing is known.
fn known(share: Option<f64>) -> Option<f64> {
    share.filter(|share| *share < 10.0)
}

fn samples(rate: &RatePlan) -> String {
    match rate.thinning {
        None => "of the sensor".into(),
        Some(Thinning::Averages) => format!("means of {}", rate.every),
        Some(Thinning::Decimation) => format!("one of {}", rate.every),
    }
}

fn rate_row(rate: &RatePlan) -> [String; 4] {
    let length = rate.duration_s.map_or("above 10 years".into(), duration);
    let ratio = rate.ratio.map_or("-".into(), |ratio| format!("{ratio:.3}"));
    [digits(rate.rate_hz), samples(rate), length, ratio]
}

fn advice(best: &RatePlan) -> String {
    let length = best.duration_s.map_or_else(String::new, duration);
    match best.thinning {
        None => format!("{} Hz, the sensor's own", digits(best.rate_hz)),
        Some(_) => format!("{} Hz, {}: {length}", digits(best.rate_hz), samples(best)),
    }
}
