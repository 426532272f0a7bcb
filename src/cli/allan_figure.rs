//! The Allan curves of a log as one SVG.

use super::allan::{AxisCurve, model_name, noise_name};
use crate::allan::{NoiseType, edf};
use crate::noise::{NoiseModel, Term};
use crate::report::figure::{self, Allan, AllanPoint, Curve};

/// All axes, one above the other.
pub(super) fn sheet(log: &str, title: &str, axes: &[AxisCurve]) -> String {
    let figures: Vec<String> = axes.iter().map(|axis| figure(axis, title)).collect();
    figure::sheet(&format!("{log}: {title}"), &figures)
}

/// One axis.
pub(super) fn figure(axis: &AxisCurve, title: &str) -> String {
    figure::allan(&data(axis, title))
}

fn data(axis: &AxisCurve, title: &str) -> Allan {
    let unit = &axis.stretch.unit;
    let points = axis.curve.points.iter().map(|p| AllanPoint {
        tau_s: p.tau_s,
        deviation: unit.from_si(p.deviation),
        lower: unit.from_si(p.lower),
        upper: unit.from_si(p.upper),
        noise: if p.noise == NoiseType::Unknown { String::new() } else { noise_name(p.noise).into() },
    });
    let model = axis.fit.as_ref().ok();
    Allan {
        title: format!("{}: {title}", axis.stretch.name),
        quantity: title.into(),
        unit: unit.text().into(),
        points: points.collect(),
        total: model.map(|model| curve(axis, model, format!("fitted {}", model_name(model)))),
        components: model.map(|model| components(axis, model)).unwrap_or_default(),
    }
}

fn components(axis: &AxisCurve, model: &NoiseModel) -> Vec<Curve> {
    // one term alone is the total
    let terms: &[Term] = if model.terms.len() > 1 { &model.terms } else { &[] };
    terms
        .iter()
        .map(|term| {
            let alone = NoiseModel { terms: vec![*term] };
            curve(axis, &alone, model_name(&alone))
        })
        .collect()
}

fn curve(axis: &AxisCurve, model: &NoiseModel, label: String) -> Curve {
    let (kind, dt, unit) = (axis.curve.deviation, axis.curve.dt, &axis.stretch.unit);
    let at = |m: u64| unit.from_si(edf::expected_variance(kind, m, dt, model).sqrt());
    Curve { label, points: axis.curve.points.iter().map(|p| (p.tau_s, at(p.m))).collect() }
}
