//! Allan deviations.

use super::answer::{self, three};
use crate::allan::{AllanPoint, AxisCurve, Deviation, NoiseType};
use crate::noise::NoiseModel;
use crate::report::{self, Report, Section};
use crate::units::{digits, significant};

pub fn allan<'a>(log: &str, axes: &'a [AxisCurve]) -> Report<'a> {
    let sections = axes.iter().map(of_axis).collect();
    Report { title: log.into(), sections, answer: answer(log, axes), ..Report::default() }
}

/// The curve of each axis where it is read: at one second, and where it is lowest; which laws it follows.
fn answer<'a>(log: &str, axes: &[AxisCurve]) -> Section<'a> {
    let Some(first) = axes.first() else { return Section::default() };
    let curve = &first.curve;
    let heading = format!("{log}: {} of {} samples", curve.deviation.name(), curve.samples);
    let row = |axis: &AxisCurve| {
        let points: Vec<&AllanPoint> = axis.curve.points.iter().filter(|p| p.deviation > 0.0).collect();
        let shown = |p: &AllanPoint| three(axis.unit.from_si(p.deviation));
        let half = |p: &AllanPoint| significant(50.0 * (p.upper - p.lower) / p.deviation, 2);
        let lowest = points.iter().min_by(|a, b| a.deviation.total_cmp(&b.deviation));
        [
            axis.name.clone(),
            at_one_second(&points).map_or("-".into(), |(deviation, near)| {
                format!("{} ± {} %", three(axis.unit.from_si(deviation)), half(near))
            }),
            lowest.map_or("-".into(), |p| format!("{} at {}", shown(p), answer::time(p.tau_s))),
            laws(&points),
        ]
    };
    let unit = answer::unit(&first.unit);
    let header = ["", &format!("at 1 s, {unit}"), "lowest", "law up to"];
    Section::new(heading).table("", &header, axes.iter().map(row))
}

/// The deviation at one second, between the points beside it along a power law, and the later of them.
fn at_one_second<'p>(points: &[&'p AllanPoint]) -> Option<(f64, &'p AllanPoint)> {
    let later = points.iter().position(|p| p.tau_s >= 1.0)?;
    let after = points[later];
    let before = points[later.saturating_sub(1)];
    if before.tau_s > 1.0 {
        return None;
    }
    let width = (after.tau_s / before.tau_s).ln();
    let share = if width > 0.0 { (1.0 / before.tau_s).ln() / width } else { 0.0 };
    Some((before.deviation * (after.deviation / before.deviation).powf(share), after))
}

/// "white 10.2 s, flicker 41 s": up to which averaging time each law holds.
fn laws(points: &[&AllanPoint]) -> String {
    let known: Vec<&&AllanPoint> = points.iter().filter(|p| p.noise != NoiseType::Unknown).collect();
    let runs = known.chunk_by(|a, b| a.noise == b.noise).filter_map(|run| run.last());
    runs.map(|p| format!("{} {}", p.noise.name(), answer::time(p.tau_s))).collect::<Vec<_>>().join(", ")
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
        .paragraph(format!("{name}: {} of {windows}{} samples", curve.deviation.name(), curve.samples))
        .table("", &["tau (s)", &format!("deviation ({unit})"), "95 % from", "to", "edf", "terms", "noise"], rows)
        .minor(&["edf", "terms"])
        .paragraph(format!("{lowest}Intervals: {basis}."))
        .figure("", || figure(axis))
}

/// Curves of several logs: a panel for each axis, by its name, or one for all. `logs`: names, each with its axes.
pub fn overlay<'a>(logs: &'a [(String, Vec<AxisCurve>)], one_panel: bool) -> Vec<Section<'a>> {
    let curves = || logs.iter().flat_map(|(log, axes)| axes.iter().map(move |axis| (log, axis)));
    let mut panels: Vec<&str> = Vec::new();
    for (_, axis) in curves() {
        if !panels.contains(&axis.name.as_str()) {
            panels.push(&axis.name);
        }
    }
    let panel = move |title: String, only: Option<&'a str>| {
        let shown = curves().filter(move |(_, axis)| only.is_none_or(|name| axis.name == name));
        let named = shown.map(move |(log, axis)| match (logs.len(), only) {
            (1, _) => (axis.name.clone(), &axis.curve),
            (_, Some(_)) => (log.clone(), &axis.curve),
            (_, None) => (format!("{log}, {}", axis.name), &axis.curve),
        });
        let Some(unit) = curves().next().map(|(_, axis)| &axis.unit) else { return String::new() };
        report::allan::overlay(&title, &named.collect::<Vec<_>>(), unit)
    };
    let name = curves().next().map_or("deviation", |(_, axis)| axis.curve.deviation.name());
    if one_panel {
        return vec![Section::new("").figure("", move || panel(name.into(), None))];
    }
    panels
        .into_iter()
        .map(|only| Section::new("").figure("", move || panel(format!("{only}: {name}"), Some(only))))
        .collect()
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
