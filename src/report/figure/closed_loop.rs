//! Figures of a control loop: the loop gain with the disk it must not enter, and lines over a logarithmic axis.

use std::f64::consts::TAU;

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

/// L(jω) in the complex plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nyquist {
    pub title: String,
    /// (real, imaginary) by rising frequency.
    pub curves: Vec<Curve>,
    /// Disk margin whose disk is drawn: around the segment of the gains that it holds, (−(2 + α)/(2 − α), −(2 − α)/(2 +
    /// α)).
    pub disk: f64,
    /// "disk of margin 0.8".
    pub label: String,
}

/// Width and height of the frame, px, to the widths of the labels: a unit is equally long in both directions.
const FRAME: (f64, f64) = (370.0, 280.0);
/// What is shown to the left and right of −1, and of it up and down.
const SHOWN: (f64, f64) = (-2.6, 0.8);

/// Figure of [`Nyquist`], about −1.
pub fn nyquist(data: &Nyquist) -> String {
    let names: Vec<&str> = data.curves.iter().map(|curve| curve.label.as_str()).collect();
    let half = 0.5 * (SHOWN.1 - SHOWN.0) * FRAME.1 / FRAME.0;
    let mut chart = Chart::new(
        &data.title,
        &format!("Loop gain in the complex plane about -1, with the {}: {}.", data.label, names.join(", ")),
        Axis { name: "real part".into(), unit: String::new(), scale: Scale::linear_between(SHOWN.0, SHOWN.1, 6.0) },
        Axis { name: "imaginary part".into(), unit: String::new(), scale: Scale::linear_between(-half, half, 5.0) },
    );
    chart.plot_height(FRAME.1 as i32);
    let (near, far) = ((2.0 - data.disk) / (2.0 + data.disk), (2.0 + data.disk) / (2.0 - data.disk));
    let (middle, radius) = (-0.5 * (near + far), 0.5 * (far - near));
    let circle = (0..=180).map(|i| {
        let (sin, cos) = (TAU * f64::from(i) / 180.0).sin_cos();
        (middle + radius * cos, radius * sin)
    });
    chart.line(Class::Bound, circle.collect());
    for (k, curve) in data.curves.iter().enumerate() {
        chart.line(Class::Line(k), curve.points.clone());
        chart.legend_line(Class::Line(k), &curve.label);
    }
    chart.dots(5, vec![(-1.0, 0.0)]);
    chart.legend_line(Class::Bound, &data.label);
    chart.render()
}

/// Lines over a logarithmic axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OverLog {
    pub title: String,
    pub description: String,
    /// Name and unit.
    pub x: (String, String),
    pub y: (String, String),
    pub curves: Vec<Curve>,
    /// Single points, each with the number of the line whose colour it has.
    pub dots: Vec<(usize, Curve)>,
    /// A value that matters, with what it is.
    pub level: Option<(f64, String)>,
}

/// Figure of [`OverLog`], its values from zero.
pub fn over_log(data: &OverLog) -> String {
    let points = || data.curves.iter().chain(data.dots.iter().map(|d| &d.1)).flat_map(|c| c.points.iter().copied());
    let axis = |(name, unit): &(String, String), scale| Axis { name: name.clone(), unit: unit.clone(), scale };
    let highest = points().map(|p| p.1).filter(|y| y.is_finite()).fold(0.0, f64::max);
    let highest = data.level.as_ref().map_or(highest, |(level, _)| highest.max(*level));
    let top = if highest > 0.0 { 1.05 * highest } else { 1.0 };
    let mut chart = Chart::new(
        &data.title,
        &data.description,
        axis(&data.x, Scale::log(points().map(|p| p.0))),
        axis(&data.y, Scale::linear_to_tick(0.0, top, 5.0)),
    );
    if let Some((level, label)) = &data.level {
        chart.level(Class::Bound, *level);
        chart.legend_line(Class::Bound, label);
    }
    for (k, curve) in data.curves.iter().enumerate() {
        chart.line(Class::Line(k), curve.points.clone());
        chart.legend_line(Class::Line(k), &curve.label);
    }
    for (k, dots) in &data.dots {
        chart.dots(*k, dots.points.clone());
        chart.legend_dots(*k, &dots.label);
    }
    chart.render()
}

/// What was computed, what was found over it, and the interval of that.
pub type FoundPoint = (f64, f64, [f64; 2]);

/// Values that were found beside those that were computed, by group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    pub title: String,
    /// Name and unit of what was computed.
    pub x: (String, String),
    /// By name.
    pub groups: Vec<(String, Vec<FoundPoint>)>,
    /// "95 %".
    pub label: String,
}

/// Ratios with their intervals over what was computed; one is expected. Groups stand beside each other.
pub fn found(data: &Found) -> String {
    let all = || data.groups.iter().flat_map(|(_, points)| points);
    let farthest = all().flat_map(|(_, _, ends)| ends).map(|y| (y - 1.0).abs()).fold(0.01, f64::max);
    let mut chart = Chart::new(
        &data.title,
        &format!("Found over computed with intervals ({}), {} values.", data.label, all().count()),
        Axis { name: data.x.0.clone(), unit: data.x.1.clone(), scale: Scale::log(all().map(|point| point.0)) },
        Axis {
            name: format!("found over computed, {} intervals", data.label),
            unit: String::new(),
            scale: Scale::linear_between(1.0 - 1.1 * farthest, 1.0 + 1.1 * farthest, 6.0),
        },
    );
    chart.level(Class::Expected, 1.0);
    for (k, (name, points)) in data.groups.iter().enumerate() {
        // one per cent apart, so that intervals of the same number are seen beside each other
        let place = |x: f64| x * 1.01_f64.powi(k as i32);
        for (x, _, [low, high]) in points {
            chart.line(Class::Line(k), vec![(place(*x), *low), (place(*x), *high)]);
        }
        chart.dots(k, points.iter().map(|(x, y, _)| (place(*x), *y)).collect());
        chart.legend_line(Class::Line(k), name);
    }
    chart.legend_line(Class::Expected, "equal");
    chart.render()
}
