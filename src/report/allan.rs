//! Allan curves as figures: measured points with their intervals, the model and its components.

use super::figure::{self, Allan, AllanMark, AllanPoint, Curve};
use crate::allan::{AllanCurve, Deviation, NoiseType, edf};
use crate::compare::AllanEnvelope;
use crate::noise::{NoiseModel, Term};
use crate::units::{Unit, digits, significant};

/// The curve of one axis in `unit`, with the model behind it if there is one.
pub fn figure(axis: &str, curve: &AllanCurve, model: Option<&NoiseModel>, unit: &Unit) -> String {
    let quantity = curve.deviation.name();
    let model = model.filter(|m| !m.terms.is_empty());
    let components = |model: &NoiseModel| {
        let alone = |term: &Term| model_curve(curve, &NoiseModel { terms: vec![*term] }, unit, term_name(term, unit));
        // one term alone is the total
        if model.terms.len() > 1 { model.terms.iter().map(alone).collect() } else { vec![] }
    };
    let total_name = |model: &NoiseModel| match model.terms.as_slice() {
        [term] => format!("fitted {}", term_name(term, unit)),
        _ => "fitted sum".into(),
    };
    figure::allan(&Allan {
        title: format!("{axis}: {quantity}"),
        quantity: "deviation".into(),
        unit: unit.text().into(),
        points: points(curve, unit),
        band_label: None,
        total: model.map(|m| model_curve(curve, m, unit, total_name(m))),
        components: model.map(components).unwrap_or_default(),
        marks: model.map(|m| marks(curve, m, unit)).unwrap_or_default(),
    })
}

/// Curves with their names in one panel, in `unit`.
pub fn overlay(title: &str, curves: &[(String, &AllanCurve)], unit: &Unit) -> String {
    let shown: Vec<_> = curves.iter().map(|(name, curve)| (name.clone(), points(curve, unit))).collect();
    figure::allan_overlay(title, unit.text(), &shown)
}

fn points(curve: &AllanCurve, unit: &Unit) -> Vec<AllanPoint> {
    let point = |p: &crate::allan::AllanPoint| AllanPoint {
        tau_s: p.tau_s,
        deviation: unit.from_si(p.deviation),
        lower: unit.from_si(p.lower),
        upper: unit.from_si(p.upper),
        noise: if p.noise == NoiseType::Unknown { String::new() } else { p.noise.name().into() },
    };
    curve.points.iter().map(point).collect()
}

/// Where IEEE Std 952 reads each term off its line: Q at √3 s, N at 1 s, K at 3 s, R at √2 s; B at the lowest
/// point of the curve. Other deviations than Allan's have other places.
fn marks(curve: &AllanCurve, model: &NoiseModel, unit: &Unit) -> Vec<AllanMark> {
    if !matches!(curve.deviation, Deviation::Adev | Deviation::Oadev | Deviation::Totdev) {
        return vec![];
    }
    let positive = curve.points.iter().filter(|p| p.deviation > 0.0);
    let lowest = positive.min_by(|a, b| a.deviation.total_cmp(&b.deviation)).map_or(0.0, |p| p.tau_s);
    let mark = |(k, term): (usize, &Term)| {
        let (word, tau_s) = match term {
            Term::Quantization { .. } => ("Q", 3f64.sqrt()),
            Term::White { .. } => ("N", 1.0),
            Term::BiasInstability { .. } => ("B", lowest),
            Term::RateRandomWalk { .. } => ("K", 3.0),
            Term::RateRamp { .. } => ("R", 2f64.sqrt()),
            _ => return None,
        };
        let m = (tau_s / curve.dt).round().max(1.0);
        Some(AllanMark {
            tau_s: m * curve.dt,
            deviation: predicted(curve, &NoiseModel { terms: vec![*term] }, m as u64, unit),
            word: word.into(),
            component: (model.terms.len() > 1).then_some(k),
        })
    };
    model.terms.iter().enumerate().filter_map(mark).collect()
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
        marks: vec![],
    })
}

/// Averaging times at which a model is drawn: more than a line of the figure has bends.
const DRAWN: usize = 200;

/// What the model predicts over the averaging times of the curve.
fn model_curve(curve: &AllanCurve, model: &NoiseModel, unit: &Unit, label: String) -> Curve {
    let [first, last] = [curve.points.first(), curve.points.last()].map(|p| p.map_or(1, |p| p.m) as f64);
    let at = |i: usize| (first * (last / first).powf(i as f64 / (DRAWN - 1) as f64)).round() as u64;
    let mut counts: Vec<u64> = (0..DRAWN).map(at).collect();
    counts.dedup();
    let point = |m: u64| (m as f64 * curve.dt, predicted(curve, model, m, unit));
    Curve { label, points: counts.into_iter().map(point).collect() }
}

fn predicted(curve: &AllanCurve, model: &NoiseModel, m: u64, unit: &Unit) -> f64 {
    unit.from_si(edf::expected_variance(curve.deviation, m, curve.dt, model).sqrt())
}

/// In words: "white noise, N = 0.0562 deg/s/√Hz", "Gauss-Markov, σ = 0.0281 deg/s, 193.9 s".
fn term_name(term: &Term, unit: &Unit) -> String {
    let shown = |value: f64| {
        let unit = unit.times_time(term.kind().half_seconds());
        let text = unit.text().replace("sqrt(Hz)", "√Hz").replace("sqrt(s)", "√s");
        format!("{} {text}", significant(unit.from_si(value), 3))
    };
    match term {
        Term::Quantization { coefficient } => format!("quantization, Q = {}", shown(*coefficient)),
        Term::White { density } => format!("white noise, N = {}", shown(*density)),
        Term::MovingAverage { samples, .. } => format!("moving average of {samples}"),
        Term::BandLimit { .. } => "band limit".into(),
        Term::Oscillation { frequency_hz, .. } => format!("oscillation, {} Hz", digits(*frequency_hz)),
        Term::BiasInstability { coefficient } => format!("bias instability, B = {}", shown(*coefficient)),
        Term::GaussMarkov { std_dev, correlation_time } => {
            format!("Gauss-Markov, σ = {}, {} s", shown(*std_dev), digits(*correlation_time))
        }
        Term::RateRandomWalk { density } => format!("rate random walk, K = {}", shown(*density)),
        Term::RateRamp { slope } => format!("rate ramp, R = {}", shown(*slope)),
    }
}
