//! Allan deviations.

use crate::allan::{AxisCurve, Deviation};
use crate::noise::NoiseModel;
use crate::report::{self, Level, Report, Section};
use crate::units::digits;

pub fn allan<'a>(log: &str, axes: &'a [AxisCurve]) -> Report<'a> {
    Report { title: log.into(), sections: axes.iter().map(of_axis).collect(), ..Report::default() }
}

fn of_axis(axis: &AxisCurve) -> Section<'_> {
    let AxisCurve { name, unit, curve, fit, .. } = axis;
    let basis = match fit {
        Ok(model) if curve.deviation == Deviation::Totdev => {
            format!("published formula for the dominating law of the fitted {}", kinds(model))
        }
        Ok(model) => format!("exact for the fitted {}", kinds(model)),
        Err(_) => "for the power law at each tau".into(),
    };
    let points = &curve.points;
    let lowest = points.iter().filter(|p| p.deviation > 0.0).min_by(|a, b| a.deviation.total_cmp(&b.deviation));
    let lowest = lowest.map_or_else(String::new, |p| {
        format!("Lowest: {} {unit} at {} s. ", digits(unit.from_si(p.deviation)), digits(p.tau_s))
    });
    let windows = if curve.windows == 1 { String::new() } else { format!("{} windows of ", curve.windows) };
    let rows = points.iter().map(|p| {
        let [deviation, lower, upper] = [p.deviation, p.lower, p.upper].map(|v| digits(unit.from_si(v)));
        [digits(p.tau_s), deviation, lower, upper, digits(p.edf), p.terms.to_string(), p.noise.name().into()]
    });
    Section::new("")
        .at(Level::Brief)
        .paragraph(format!("{name}: {} of {windows}{} samples", curve.deviation.name(), curve.samples))
        .at(Level::Full)
        .table("", &["tau (s)", &format!("deviation ({unit})"), "95 % from", "to", "edf", "terms", "noise"], rows)
        .minor(&["edf", "terms"])
        .at(Level::Brief)
        .paragraph(format!("{lowest}Intervals: {basis}."))
        .figure("", || figure(axis))
}

/// The curve of one axis.
pub(super) fn figure(axis: &AxisCurve) -> String {
    report::allan::figure(&axis.name, &axis.curve, axis.fit.as_ref().ok(), &axis.unit)
}

/// "white + gauss_markov".
pub fn kinds(model: &NoiseModel) -> String {
    let names: Vec<String> = model
        .terms
        .iter()
        .filter_map(|term| serde_json::to_value(term.kind()).ok())
        .filter_map(|kind| kind.as_str().map(String::from))
        .collect();
    names.join(" + ")
}
