//! Lines and dots over a linear axis: step responses, curves over speed, a map of poles.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

/// A figure of lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    pub title: String,
    /// For who cannot see it.
    pub description: String,
    /// Name and unit.
    pub x: (String, String),
    pub y: (String, String),
    pub curves: Vec<Curve>,
    /// Single points, with a legend entry each.
    pub dots: Vec<Curve>,
    /// Thin lines that bound something.
    pub bounds: Vec<Curve>,
}

pub fn lines(data: &Lines) -> String {
    let all = || data.curves.iter().chain(&data.dots).flat_map(|c| c.points.iter().copied());
    let axis = |(name, unit): &(String, String), scale| Axis { name: name.clone(), unit: unit.clone(), scale };
    // points lead, bounds may run out of the frame and are cut there
    let (x, y) = (Scale::linear_padded(all().map(|p| p.0), &[]), Scale::linear_padded(all().map(|p| p.1), &[]));
    let ((left, right), (low, high)) = (x.ends(), y.ends());
    let mut chart = Chart::new(&data.title, &data.description, axis(&data.x, x), axis(&data.y, y));
    for bound in &data.bounds {
        let inside = |p: &&(f64, f64)| (left..=right).contains(&p.0) && (low..=high).contains(&p.1);
        chart.line(Class::Bound, bound.points.iter().filter(inside).copied().collect());
    }
    for (k, curve) in data.curves.iter().enumerate() {
        chart.line(Class::Line(k), curve.points.clone());
        chart.legend_line(Class::Line(k), &curve.label);
    }
    for (k, dots) in data.dots.iter().enumerate() {
        chart.dots(k, dots.points.clone());
        chart.legend_dots(k, &dots.label);
    }
    if let Some(bound) = data.bounds.first() {
        chart.legend_line(Class::Bound, &bound.label);
    }
    chart.render()
}
