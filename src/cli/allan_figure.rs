//! The Allan curves of a log as one SVG.

use super::allan::AxisCurve;
use crate::report;

/// All axes, one above the other.
pub(super) fn sheet(log: &str, axes: &[AxisCurve]) -> String {
    let figures: Vec<String> = axes.iter().map(figure).collect();
    let kind = axes.first().map_or("", |axis| axis.curve.deviation.name());
    report::figure::sheet(&format!("{log}: {kind}"), &figures)
}

/// One axis.
pub(super) fn figure(axis: &AxisCurve) -> String {
    let AxisCurve { name, unit, curve, fit, .. } = axis;
    report::allan::figure(name, curve, fit.as_ref().ok(), unit)
}
