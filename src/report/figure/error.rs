//! Errors of a filter whose truth is known: of single runs within their band, and of many runs beside what was claimed.

use super::Curve;
use super::chart::{Axis, Chart};
use super::consistency::WIDE;
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
    let bands = [3.0, 1.0].map(|k| {
        let edge = |&(t, s): &(f64, f64)| (clock.show(t), -k * s, k * s);
        data.sigma.iter().map(edge).collect::<Vec<_>>()
    });
    bands.iter().for_each(|band| chart.band(5, band.clone()));
    chart.level(Class::Axis, 0.0);
    for (k, run) in data.runs.iter().enumerate() {
        // points beyond the frame would be drawn along its edge
        let inside = run.points.iter().filter(|p| p.1.abs() <= limit);
        chart.line(Class::Thread(k), inside.map(|&(t, e)| (clock.show(t), e)).collect());
    }
    // over the errors, which hide what is under them
    bands.iter().for_each(|band| chart.edges(Class::Expected, band));
    chart.legend_line(Class::Thread(0), &data.label);
    chart.legend_line(Class::Expected, "±1σ and ±3σ of the filter");
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

/// Errors of many runs beside what was claimed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rms {
    pub title: String,
    pub time_s: Vec<f64>,
    pub components: Vec<Component>,
    /// Where the ratio of a true claim is at one time, with what that is called.
    pub band: Option<([f64; 2], String)>,
}

/// Root mean square error over the claimed standard deviation, against time on a logarithmic axis: 1 where the claim
/// is true.
pub fn rms(data: &Rms) -> String {
    let names: Vec<&str> = data.components.iter().map(|c| c.name.as_str()).collect();
    let times = data.time_s.iter().copied();
    let ratio = |c: &Component| c.rms.iter().zip(&c.claimed).map(|(rms, claimed)| rms / claimed).collect::<Vec<_>>();
    let ratios: Vec<Vec<f64>> = data.components.iter().map(ratio).collect();
    let values = || ratios.iter().flatten().copied().chain(data.band.iter().flat_map(|(ends, _)| *ends));
    let positive = || values().filter(|v| *v > 0.0 && v.is_finite());
    let wide = positive().fold(1.0, f64::max) > WIDE * positive().fold(1.0, f64::min);
    let mut chart = Chart::new(
        &data.title,
        &format!("Root mean square error over the claimed standard deviation against time, for {}.", names.join(", ")),
        Axis { name: "time from the first measurement".into(), unit: "s".into(), scale: Scale::log(times.clone()) },
        Axis {
            name: "error over claimed σ".into(),
            unit: String::new(),
            scale: if wide { Scale::log(values()) } else { Scale::linear_padded(values(), &[0.8, 1.2]) },
        },
    );
    if let Some(([lower, upper], _)) = data.band {
        let (first, last) = chart.x_ends();
        chart.band(5, vec![(first, lower, upper), (last, lower, upper)]);
    }
    chart.level(Class::Expected, 1.0);
    for (k, (component, ratio)) in data.components.iter().zip(&ratios).enumerate() {
        chart.line(Class::Line(k), times.clone().zip(ratio.iter().copied()).collect());
        chart.legend_line(Class::Line(k), &component.name);
    }
    chart.legend_line(Class::Expected, "as claimed");
    if let Some((_, label)) = &data.band {
        chart.legend_band(5, label);
    }
    chart.render()
}
