//! Errors of a filter whose truth is known: of single runs within their band, and of many runs beside what was claimed.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;
use super::trace::Clock;

/// Errors of some runs over time; values in `unit`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    pub title: String,
    /// "error of bias".
    pub quantity: String,
    pub unit: String,
    /// (time in s, the filter's own standard deviation).
    pub sigma: Vec<(f64, f64)>,
    pub runs: Vec<Curve>,
    /// "runs 0 to 3".
    pub label: String,
}

/// A hair line per run over bands of one and three sigma around zero.
pub fn errors(data: &Errors) -> String {
    let times: Vec<f64> = data.sigma.iter().map(|s| s.0).collect();
    let clock = Clock::covering(&times);
    // the first moments, before anything is known, would flatten the rest
    let start = clock.early();
    let settled = |points: &[(f64, f64)]| {
        points.iter().filter(|p| p.0 >= start && p.1.is_finite()).map(|p| p.1.abs()).fold(0.0, f64::max)
    };
    let band = 3.0 * settled(&data.sigma);
    let largest = data.runs.iter().map(|run| settled(&run.points)).fold(band, f64::max);
    let limit = if largest > 0.0 && largest.is_finite() { 1.1 * largest } else { 1.0 };
    let seen: usize = data.runs.iter().map(|run| run.points.len()).sum();
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "{} over time: {} runs, {seen} points, with bands of one and three standard deviations around zero.",
            data.quantity,
            data.runs.len()
        ),
        clock.axis(),
        Axis { name: data.quantity.clone(), unit: data.unit.clone(), scale: Scale::linear_between(-limit, limit, 6.0) },
    );
    for k in [3.0, 1.0] {
        chart.band(5, data.sigma.iter().map(|&(t, s)| (clock.show(t), -k * s, k * s)).collect());
    }
    chart.level(Class::Axis, 0.0);
    for (k, run) in data.runs.iter().enumerate() {
        // points beyond the frame would be drawn along its edge
        let inside = run.points.iter().filter(|p| p.1.abs() <= limit);
        chart.line(Class::Thread(k), inside.map(|&(t, e)| (clock.show(t), e)).collect());
    }
    chart.legend_line(Class::Thread(0), &data.label);
    chart.legend_bands(5, "±1σ and ±3σ of the filter");
    chart.render()
}

/// One component of the error, one value per time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Component {
    pub name: String,
    /// Root mean square over the runs.
    pub rms: Vec<f64>,
    /// The filter's own standard deviation.
    pub claimed: Vec<f64>,
}

/// Errors of many runs beside what was claimed; values in `unit`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rms {
    pub title: String,
    pub unit: String,
    pub time_s: Vec<f64>,
    pub components: Vec<Component>,
}

/// Log-log figure of [`Rms`].
pub fn rms(data: &Rms) -> String {
    let names: Vec<&str> = data.components.iter().map(|c| c.name.as_str()).collect();
    let times = data.time_s.iter().copied();
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Root mean square error against time, beside the claimed standard deviation, for {}.",
            names.join(", ")
        ),
        Axis { name: "time from the first measurement".into(), unit: "s".into(), scale: Scale::log(times.clone()) },
        Axis {
            name: "error".into(),
            unit: data.unit.clone(),
            scale: Scale::log(data.components.iter().flat_map(|c| c.rms.iter().chain(&c.claimed).copied())),
        },
    );
    for (k, component) in data.components.iter().enumerate() {
        chart.line(Class::Thin(k), times.clone().zip(component.claimed.iter().copied()).collect());
        chart.line(Class::Line(k), times.clone().zip(component.rms.iter().copied()).collect());
        chart.legend_line(Class::Line(k), &format!("{}, rms", component.name));
        chart.legend_line(Class::Thin(k), "claimed");
    }
    chart.render()
}
