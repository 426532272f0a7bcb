//! The parameters of one axis as a linear model, with what no filter can tell apart merged.

use nalgebra::DMatrix;

use super::TuneError;
use super::flicker::{self, FlickerApproximation};
use crate::model::observability::observability;
use crate::model::{InitialBias, LinearModel, ModelError, sensor_errors};
use crate::noise::{Kind, NoiseModel, Term};
use crate::numerics::linalg::LinalgError;
use crate::params::{AxisParams, Measured};
use crate::units::{Quantity, digits};

/// Correlation times and frequencies closer than this, relatively, are one process to any filter.
const SAME: f64 = 1e-6;

/// A model with the decisions that led to it.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    pub(super) model: LinearModel,
    pub(super) flicker: Option<FlickerApproximation>,
    pub(super) warnings: Vec<String>,
}

/// States "bias" and those of each drift process; see [`super::tune`].
pub(super) fn build(axis: &AxisParams, quantity: Quantity, dt: f64, horizon_s: f64) -> Result<Sensor, TuneError> {
    let failed = |source| match source {
        ModelError::NoMeasurementNoise => TuneError::NoMeasurementNoise { axis: axis.name.clone() },
        ModelError::TooFast(line) => TuneError::TooFast { axis: axis.name.clone(), line },
        source => TuneError::Model { axis: axis.name.clone(), source },
    };
    let mut warnings = Vec::new();
    let noise = merged(&axis.noise(), &mut warnings);
    let mut bias = InitialBias { mean: axis.bias.as_ref().map_or(0.0, |b| b.si()), std_dev: 0.0 };
    let model = sensor_errors(quantity, &noise, Some(bias), dt, horizon_s).map_err(failed)?;
    let (mut model, flicker) = flicker::simplify(model, &noise, horizon_s);
    bias.std_dev = match &axis.turn_on_bias {
        Some(given) => given.si(),
        None => {
            let (std_dev, rule) = turn_on_rule(&model, axis.bias.as_ref());
            let unit = axis.display_unit(quantity);
            let value = digits(unit.from_si(std_dev));
            warnings.push(format!(
                "no turn-on bias is given: P0 of the bias is {rule}, {value} {unit}; give turn_on_bias.std_dev if you \
                 know it"
            ));
            std_dev
        }
    };
    if let Some(i) = model.states.iter().position(|s| s.name == "bias") {
        model.p0[(i, i)] = bias.std_dev * bias.std_dev;
    }
    let model = share_level(model, &mut warnings);
    if let Some(flicker) = &flicker {
        warnings.push(format!(
            "flicker has no exact filter: {} Gauss-Markov states stand for it, {} faster ones are part of R (+{:.2} \
             %); the Allan deviation \
             of the whole is right to {:.2} % for averaging times up to {} s",
            flicker.states,
            flicker.folded,
            100.0 * flicker.added_to_r,
            100.0 * flicker.max_relative_error,
            digits(flicker.tau_max_s)
        ));
    }
    Ok(Sensor { model, flicker, warnings })
}

/// Standard deviation of the whole drift, the sum that is subtracted from a measurement, under covariance `p`.
pub(super) fn drift_sigma(model: &LinearModel, p: &DMatrix<f64>) -> f64 {
    let d = model.drift_row();
    (&d * p * d.transpose())[(0, 0)].max(0.0).sqrt()
}

/// What the measurements can tell, without a sentence for each state that only stands for flicker together with others.
pub(super) fn observability_sentences(model: &LinearModel) -> Result<Vec<String>, LinalgError> {
    let mut sentences = observability(model)?.sentences;
    let chain: Vec<&str> = model
        .states
        .iter()
        .map(|s| s.name.as_str())
        .filter(|n| Kind::of_state(n) == Some(Kind::BiasInstability))
        .collect();
    if let [parts @ .., _slowest] = chain.as_slice() {
        sentences.retain(|s| !parts.iter().any(|name| s.contains(&format!("{name} (correlation"))));
    }
    Ok(sentences)
}

/// P0 of a bias nobody described: the largest of what the parameters hint at.
fn turn_on_rule(model: &LinearModel, bias: Option<&Measured>) -> (f64, &'static str) {
    let mean = bias.map_or(0.0, Measured::si);
    // a bias that happens to be near zero, as after calibration, is no smaller than it is known
    let known = bias.and_then(Measured::interval_si).map_or(0.0, |[low, high]| 0.5 * (high - low));
    // P0 of the bias is still zero, so this is the stationary variance of the drift
    let drift = 3.0 * drift_sigma(model, &model.p0);
    let sample = 10.0 * (&model.h * &model.p0 * model.h.transpose() + &model.r)[(0, 0)].sqrt();
    if known > drift.max(mean.abs()) && known.is_finite() {
        (known, "as far as its interval reaches")
    } else if mean.abs() >= drift && mean != 0.0 {
        (mean.abs(), "the size of the given bias")
    } else if drift > 0.0 {
        (drift, "three times the standard deviation of the whole drift")
    } else {
        (sample, "ten times the standard deviation of one sample")
    }
}

/// Terms of the same dynamics add up to one: exactly, since variances add.
fn merged(noise: &NoiseModel, warnings: &mut Vec<String>) -> NoiseModel {
    let mut terms: Vec<Term> = Vec::with_capacity(noise.terms.len());
    for term in &noise.terms {
        let partner = terms.iter_mut().find_map(|earlier| Some((together(earlier, term)?, earlier)));
        if let Some((sum, earlier)) = partner {
            *earlier = sum;
            let name = term.kind().name();
            warnings.push(format!("two {name} terms of the same dynamics are one state: their variances are added"));
        } else {
            terms.push(*term);
        }
    }
    NoiseModel { terms }
}

/// The one term that two of the same dynamics amount to.
fn together(a: &Term, b: &Term) -> Option<Term> {
    let same = |x: f64, y: f64| (y / x - 1.0).abs() < SAME;
    match (*a, *b) {
        (Term::White { density: x }, Term::White { density: y }) => Some(Term::White { density: x.hypot(y) }),
        (Term::RateRandomWalk { density: x }, Term::RateRandomWalk { density: y }) => {
            Some(Term::RateRandomWalk { density: x.hypot(y) })
        }
        (Term::BiasInstability { coefficient: x }, Term::BiasInstability { coefficient: y }) => {
            Some(Term::BiasInstability { coefficient: x.hypot(y) })
        }
        (Term::Quantization { coefficient: x }, Term::Quantization { coefficient: y }) => {
            Some(Term::Quantization { coefficient: x.hypot(y) })
        }
        (Term::MovingAverage { density: x, samples }, Term::MovingAverage { density: y, samples: other })
            if samples == other =>
        {
            Some(Term::MovingAverage { density: x.hypot(y), samples })
        }
        (Term::BandLimit { density: x, filter }, Term::BandLimit { density: y, filter: other }) if filter == other => {
            Some(Term::BandLimit { density: x.hypot(y), filter })
        }
        (
            Term::Oscillation { std_dev: x, frequency_hz, correlation_time },
            Term::Oscillation { std_dev: y, frequency_hz: other, correlation_time: time },
        ) if same(frequency_hz, other) && same(correlation_time, time) => {
            Some(Term::Oscillation { std_dev: x.hypot(y), frequency_hz, correlation_time })
        }
        (Term::RateRamp { slope: x }, Term::RateRamp { slope: y }) => Some(Term::RateRamp { slope: x + y }),
        (
            Term::GaussMarkov { std_dev: x, correlation_time },
            Term::GaussMarkov { std_dev: y, correlation_time: other },
        ) if same(correlation_time, other) => Some(Term::GaussMarkov { std_dev: x.hypot(y), correlation_time }),
        _ => None,
    }
}

/// States that hold their value and are seen directly (bias, rate random walk, level of a ramp) can only be known as
/// a sum: they become the one state "bias". With T summing them, F' T = T F, Q' = T Q Tᵀ, P0' = T P0 Tᵀ.
fn share_level(model: LinearModel, warnings: &mut Vec<String>) -> LinearModel {
    let n = model.states.len();
    let holds =
        |i: usize| model.h[(0, i)] == 1.0 && model.f[(i, i)] == 1.0 && (0..n).all(|j| j == i || model.f[(j, i)] == 0.0);
    let level: Vec<usize> = (0..n).filter(|&i| holds(i)).collect();
    if level.len() < 2 {
        return model;
    }
    let others: Vec<&str> =
        level.iter().map(|&i| model.states[i].name.as_str()).filter(|name| *name != "bias").collect();
    warnings.push(format!(
        "{} and the constant bias share the state 'bias': they have the same dynamics, only their sum can be observed",
        others.join(", ")
    ));
    let kept: Vec<usize> = (0..n).filter(|i| *i == level[0] || !level.contains(i)).collect();
    let t = DMatrix::from_fn(kept.len(), n, |row, j| {
        f64::from(kept[row] == j || (kept[row] == level[0] && level.contains(&j)))
    });
    let choose = DMatrix::from_fn(n, kept.len(), |i, column| f64::from(kept[column] == i));
    let mut states: Vec<_> = kept.iter().map(|&i| model.states[i].clone()).collect();
    if let Some(first) = kept.iter().position(|&i| i == level[0]) {
        states[first].name = "bias".into();
    }
    LinearModel {
        states,
        f: &t * &model.f * &choose,
        g: &t * &model.g,
        h: &model.h * &choose,
        q: &t * &model.q * t.transpose(),
        x0: &t * &model.x0,
        p0: &t * &model.p0 * t.transpose(),
        dt: model.dt,
        inputs: model.inputs,
        measurements: model.measurements,
        every: model.every,
        outputs: model.outputs,
        r: model.r,
    }
}
