//! Allan curves as figures: measured points with their intervals, the model and its components.

use super::figure::{self, Allan, AllanPoint, Curve};
use crate::allan::{AllanCurve, NoiseType, edf};
use crate::compare::AllanEnvelope;
use crate::noise::{NoiseModel, Term};
use crate::units::{Unit, digits};

/// The curve of one axis in `unit`, with the model behind it if there is one.
pub fn figure(axis: &str, curve: &AllanCurve, model: Option<&NoiseModel>, unit: &Unit) -> String {
    let quantity = curve.deviation.name();
    let points = curve.points.iter().map(|p| AllanPoint {
        tau_s: p.tau_s,
        deviation: unit.from_si(p.deviation),
        lower: unit.from_si(p.lower),
        upper: unit.from_si(p.upper),
        noise: if p.noise == NoiseType::Unknown { String::new() } else { p.noise.name().into() },
    });
    let model = model.filter(|m| !m.terms.is_empty());
    let components = |model: &NoiseModel| {
        let alone = |term: &Term| model_curve(curve, &NoiseModel { terms: vec![*term] }, unit, term_name(term));
        // one term alone is the total
        if model.terms.len() > 1 { model.terms.iter().map(alone).collect() } else { vec![] }
    };
    let total_name = |model: &NoiseModel| match model.terms.as_slice() {
        [term] => format!("fitted {}", term_name(term)),
        _ => "fitted sum".into(),
    };
    figure::allan(&Allan {
        title: format!("{axis}: {quantity}"),
        quantity: "deviation".into(),
        unit: unit.text().into(),
        points: points.collect(),
        band_label: None,
        total: model.map(|m| model_curve(curve, m, unit, total_name(m))),
        components: model.map(components).unwrap_or_default(),
    })
}

/// The measured curve over the envelope that the model draws around its own, in `unit`.
pub fn envelope(axis: &str, envelope: &AllanEnvelope, alpha: f64, unit: &Unit) -> String {
    let curve = |values: &[f64]| {
        envelope.tau_s.iter().zip(values).map(|(tau, v)| (*tau, unit.from_si(*v))).collect::<Vec<(f64, f64)>>()
    };
    let edges = envelope.lower.iter().zip(&envelope.upper);
    let points = curve(&envelope.measured).into_iter().zip(edges).map(|((tau_s, deviation), (lower, upper))| {
        AllanPoint { tau_s, deviation, lower: unit.from_si(*lower), upper: unit.from_si(*upper), noise: String::new() }
    });
    figure::allan(&Allan {
        title: format!("{axis}: Allan deviation and envelope of the model"),
        quantity: "deviation".into(),
        unit: unit.text().into(),
        points: points.collect(),
        band_label: Some(format!("{} % envelope of the model", digits(100.0 * (1.0 - alpha)))),
        total: Some(Curve { label: "model".into(), points: curve(&envelope.model) }),
        components: vec![],
    })
}

/// What the model predicts at the averaging times of the curve.
fn model_curve(curve: &AllanCurve, model: &NoiseModel, unit: &Unit, label: String) -> Curve {
    let at = |m: u64| unit.from_si(edf::expected_variance(curve.deviation, m, curve.dt, model).sqrt());
    Curve { label, points: curve.points.iter().map(|p| (p.tau_s, at(p.m))).collect() }
}

/// In words: "Gauss-Markov, 193.9 s".
fn term_name(term: &Term) -> String {
    match term {
        Term::Quantization { .. } => "quantization".into(),
        Term::White { .. } => "white noise".into(),
        Term::MovingAverage { samples, .. } => format!("moving average of {samples}"),
        Term::BandLimit { .. } => "band limit".into(),
        Term::Oscillation { frequency_hz, .. } => format!("oscillation, {} Hz", digits(*frequency_hz)),
        Term::BiasInstability { .. } => "bias instability".into(),
        Term::GaussMarkov { correlation_time, .. } => format!("Gauss-Markov, {} s", digits(*correlation_time)),
        Term::RateRandomWalk { .. } => "rate random walk".into(),
        Term::RateRamp { .. } => "rate ramp".into(),
    }
}
