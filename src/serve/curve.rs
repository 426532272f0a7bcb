//! The curves of a noise model: Allan deviation and spectral density, of the whole and of every term.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Refused;
use crate::noise::Term;
use crate::params::Params;

/// Points of a curve where none are asked for: as figures have.
const POINTS: usize = 200;
const MOST_POINTS: usize = 2000;

/// Parameters as in params.json.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Asked {
    params: Value,
    axis: String,
    /// Averaging times, s.
    #[serde(default)]
    times: Option<Vec<f64>>,
    /// Hz.
    #[serde(default)]
    frequencies: Option<Vec<f64>>,
}

#[derive(Debug, Serialize)]
pub(super) struct Curve {
    /// Of the deviations; the density has it per √Hz.
    unit: String,
    times: Vec<f64>,
    deviation: Vec<f64>,
    frequencies: Vec<f64>,
    density: Vec<f64>,
    terms: Vec<OfTerm>,
}

#[derive(Debug, Serialize)]
struct OfTerm {
    name: &'static str,
    deviation: Vec<f64>,
    density: Vec<f64>,
}

/// The Allan deviation σ(τ) and the square root of the two-sided spectral density (of white noise: N). Errors:
/// parameters that params.json could not have.
pub(super) fn curve(asked: &Asked) -> Result<Curve, Refused> {
    let params = Params::from_json(&asked.params.to_string(), "params");
    let params = params.map_err(|error| Refused::unprocessable(error.to_string()))?;
    let axis = params.axes.iter().find(|axis| axis.name == asked.axis);
    let axis = axis.ok_or_else(|| Refused::unprocessable(format!("axis {}: the parameters have none", asked.axis)))?;
    let dt = 1.0 / params.sample_rate_hz;
    let (model, unit) = (axis.noise(), axis.display_unit(params.quantity));
    let times = match &asked.times {
        Some(times) => times.iter().map(|time| (time / dt).round().max(1.0) * dt).collect(),
        None => spread(dt, 1e5),
    };
    let frequencies = asked.frequencies.clone().unwrap_or_else(|| spread(1e-5, 0.5 / dt));
    let all = times.iter().chain(&frequencies);
    if times.len().max(frequencies.len()) > MOST_POINTS || all.clone().any(|x| !(x.is_finite() && *x > 0.0)) {
        return Err(Refused::unprocessable(format!("times, frequencies: at most {MOST_POINTS} positive numbers each")));
    }
    let shown = |square: f64| unit.from_si(square.max(0.0).sqrt());
    let deviations = |of: &dyn Fn(u64) -> f64| times.iter().map(|t| shown(of((t / dt).round() as u64))).collect();
    let densities = |of: &dyn Fn(f64) -> f64| frequencies.iter().map(|f| shown(of(*f))).collect();
    let term = |term: &Term| OfTerm {
        name: term.kind().name(),
        deviation: deviations(&|m| term.allan_variance(m, dt)),
        density: densities(&|f| term.psd(f, dt)),
    };
    Ok(Curve {
        unit: unit.text().to_string(),
        deviation: deviations(&|m| model.allan_variance(m, dt)),
        density: densities(&|f| model.psd(f, dt)),
        terms: model.terms.iter().map(term).collect(),
        times,
        frequencies,
    })
}

/// Evenly over the logarithm.
fn spread(from: f64, to: f64) -> Vec<f64> {
    (0..POINTS).map(|i| from * (to / from).powf(i as f64 / (POINTS - 1) as f64)).collect()
}
