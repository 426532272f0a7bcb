//! The maximum of the exact likelihood alone.

use super::super::FEWEST_SAMPLES;
use super::exact::Exact;
use super::form::Form;
use super::ordinates::Ordinates;
use super::whittle::STEEPEST;
use crate::filter::likelihood::Stretch;
use crate::noise::{Grid, Kind, NoiseModel, Role};

/// Longest correlation time that a maximum is looked for at, in lengths of the log.
const FURTHEST: f64 = 100.0;

/// The terms of `start` at the maximum of the exact likelihood of all logs, nothing else: no choice of terms, no
/// intervals. With it diffuse ln L, SI; `start` may be far away, if every parameter is within about a factor of ten
/// or twenty.
///
/// `None` for a model with flicker noise or a ramp, a likelihood that would take minutes, and a start from which no
/// step leads up.
pub fn maximum(start: &NoiseModel, logs: &[Vec<Stretch<'_>>], dt: f64) -> Option<(NoiseModel, f64)> {
    let (form, at) = Form::of(start);
    let samples = logs.iter().flatten().map(|part| part.samples.len()).max()?;
    if form.has(Kind::RateRamp) || form.has(Kind::BiasInstability) || samples < FEWEST_SAMPLES {
        return None;
    }
    let data = Ordinates::expected(samples, dt, &[], |frequency_hz| Grid::new(frequency_hz.to_vec(), dt));
    let longest = (FURTHEST * data.span_s()).ln();
    let bounds: Vec<(f64, f64)> = form
        .roles()
        .iter()
        .map(|(_, role)| match role {
            Role::CorrelationTime => (dt.ln(), longest),
            Role::Frequency => (f64::NEG_INFINITY, (0.5 / dt).ln()),
            Role::Shape => (-STEEPEST, STEEPEST),
            Role::Coefficient => (f64::NEG_INFINITY, f64::INFINITY),
        })
        .collect();
    let found = Exact::new(&data, &form, &at, logs)?.refine(&at, &bounds)?;
    Some((NoiseModel { terms: form.terms(&found.logs).collect() }, found.log_likelihood))
}
