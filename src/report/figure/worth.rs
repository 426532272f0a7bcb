//! What better parts buy: a steady sigma against the size of single parameters.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

/// One line per parameter, (factor of the design's value, sigma in `unit`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worth {
    pub title: String,
    /// "steady sigma of the angle".
    pub quantity: String,
    pub unit: String,
    pub curves: Vec<Curve>,
}

/// Log-log figure; all lines meet at the design, at one.
pub fn worth(data: &Worth) -> String {
    let points = || data.curves.iter().flat_map(|curve| curve.points.iter().copied());
    let names: Vec<&str> = data.curves.iter().map(|curve| curve.label.as_str()).collect();
    let mut chart = Chart::new(
        &data.title,
        &format!("{} when one parameter is other than in the design: {}.", data.quantity, names.join(", ")),
        Axis {
            name: "parameter over that of the design".into(),
            unit: String::new(),
            scale: Scale::log(points().map(|p| p.0)),
        },
        Axis { name: data.quantity.clone(), unit: data.unit.clone(), scale: Scale::log(points().map(|p| p.1)) },
    );
    chart.upright(Class::Expected, 1.0);
    for (k, curve) in data.curves.iter().enumerate() {
        chart.line(Class::Line(k), curve.points.clone());
        chart.legend_line(Class::Line(k), &curve.label);
    }
    chart.legend_line(Class::Expected, "the design");
    chart.render()
}
