//! A log over time, with its moving average and what was found in it.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;
use super::trace::Clock;

/// One axis of a log; values in `unit`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    pub title: String,
    /// "angular rate".
    pub quantity: String,
    pub unit: String,
    /// (s from the start, value); what is not finite is a hole.
    pub points: Vec<(f64, f64)>,
    /// The moving average.
    pub average: Curve,
    /// Where something was found, s, and what.
    pub findings: Vec<(f64, String)>,
}

/// Findings stand as upright lines with a letter, which the legend explains.
pub fn course(data: &Course) -> String {
    let times: Vec<f64> = data.points.iter().map(|p| p.0).collect();
    let clock = Clock::covering(&times);
    let y = Scale::linear_padded(data.points.iter().map(|p| p.1), &[]);
    let top = y.value_at(0.94);
    let found: Vec<&str> = data.findings.iter().map(|(_, what)| what.as_str()).collect();
    let mut chart = Chart::new(
        &data.title,
        &format!("{} over time with its moving average; found: {}.", data.quantity, found.join(", ")),
        clock.axis(),
        Axis { name: data.quantity.clone(), unit: data.unit.clone(), scale: y },
    );
    let shown = |points: &[(f64, f64)]| points.iter().map(|&(t, x)| (clock.show(t), x)).collect::<Vec<_>>();
    chart.line(Class::Cloud, shown(&data.points));
    chart.legend_line(Class::Cloud, "log");
    chart.line(Class::Line(0), shown(&data.average.points));
    chart.legend_line(Class::Line(0), &data.average.label);
    for ((at, what), letter) in data.findings.iter().zip('a'..='z') {
        chart.upright(Class::Bound, clock.show(*at));
        chart.tag(None, (clock.show(*at), top), &letter.to_string());
        chart.legend_line(Class::Bound, &format!("{letter}: {what}"));
    }
    chart.render()
}
