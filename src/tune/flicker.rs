//! Flicker in a filter: a chain of Gauss-Markov states, the fastest of which are indistinguishable from white noise.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use crate::model::LinearModel;
use crate::noise::{Kind, NoiseModel, Term};

/// Flicker (bias instability) as the filter has it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FlickerApproximation {
    /// Number of Gauss-Markov states.
    pub states: usize,
    /// Number of faster ones that are part of R instead.
    pub folded: usize,
    /// What they add to R, relatively.
    pub added_to_r: f64,
    /// Largest relative error of the sensor's Allan deviation (all terms) for averaging times from one sample to
    /// `tau_max_s`.
    pub max_relative_error: f64,
    /// Averaging time of the largest error, s.
    pub worst_tau_s: f64,
    pub tau_max_s: f64,
}

/// Share of R up to which fast states are folded into it.
const FOLDED: f64 = 0.01;
/// Points per decade at which the curves are compared.
const PER_DECADE: f64 = 16.0;

/// Folds the fastest flicker states into R as long as they add no more than 1 % to it, and compares the Allan
/// deviation of the result with that of `noise`, all sampled, up to `horizon_s`. `None` when there is no flicker.
///
/// A Gauss-Markov state faster than the filter is white to it, with the variance σ²(1 + φ)/(1 − φ) of its sum over
/// many samples.
pub(super) fn simplify(
    model: LinearModel,
    noise: &NoiseModel,
    horizon_s: f64,
) -> (LinearModel, Option<FlickerApproximation>) {
    let mut chain: Vec<usize> = (0..model.states.len())
        .filter(|&i| Kind::of_state(&model.states[i].name) == Some(Kind::BiasInstability))
        .collect();
    if chain.is_empty() {
        return (model, None);
    }
    chain.sort_by(|&i, &j| model.f[(i, i)].total_cmp(&model.f[(j, j)]));
    let white = model.r[(0, 0)];
    let mut added = 0.0;
    let mut folded = 0;
    for &i in &chain {
        let (phi, q) = (model.f[(i, i)], model.q[(i, i)]);
        // σ² = q/(1 − φ²), so σ²(1 + φ)/(1 − φ) = q/(1 − φ)²
        let variance = q / ((1.0 - phi) * (1.0 - phi));
        if added + variance > FOLDED * white {
            break;
        }
        added += variance;
        folded += 1;
    }
    let (fast, slow) = chain.split_at(folded);
    let mut terms: Vec<Term> =
        noise.terms.iter().copied().filter(|t| !matches!(t, Term::BiasInstability { .. })).collect();
    terms.push(Term::White { density: (added * model.dt).sqrt() });
    terms.extend(slow.iter().map(|&i| {
        let (phi, q) = (model.f[(i, i)], model.q[(i, i)]);
        Term::GaussMarkov {
            std_dev: (q / ((1.0 - phi) * (1.0 + phi))).sqrt(),
            correlation_time: -model.dt / (phi - 1.0).ln_1p(),
        }
    }));
    let (max_relative_error, worst_tau_s) = largest_error(&NoiseModel { terms }, noise, model.dt, horizon_s);
    let approximation = FlickerApproximation {
        states: slow.len(),
        folded,
        added_to_r: added / white,
        max_relative_error,
        worst_tau_s,
        tau_max_s: horizon_s,
    };
    (without(model, fast, added), Some(approximation))
}

/// Largest relative difference of the Allan deviations and where it is.
fn largest_error(approximate: &NoiseModel, exact: &NoiseModel, dt: f64, tau_max_s: f64) -> (f64, f64) {
    let last = (tau_max_s / dt).clamp(1.0, 1e15).floor();
    let mut worst = (0.0, dt);
    for k in 0..=(last.log10() * PER_DECADE).ceil() as u32 {
        let m = 10f64.powf(f64::from(k) / PER_DECADE).round().min(last);
        let ratio = approximate.allan_variance(m as u64, dt) / exact.allan_variance(m as u64, dt);
        let error = (ratio.sqrt() - 1.0).abs();
        if error > worst.0 {
            worst = (error, m * dt);
        }
    }
    worst
}

/// The model without these states, their variance in R.
fn without(model: LinearModel, gone: &[usize], variance: f64) -> LinearModel {
    let kept: Vec<usize> = (0..model.states.len()).filter(|i| !gone.contains(i)).collect();
    let select = |a: &DMatrix<f64>| DMatrix::from_fn(kept.len(), kept.len(), |i, j| a[(kept[i], kept[j])]);
    LinearModel {
        states: kept.iter().map(|&i| model.states[i].clone()).collect(),
        f: select(&model.f),
        q: select(&model.q),
        p0: select(&model.p0),
        g: model.g.select_rows(&kept),
        h: model.h.select_columns(&kept),
        x0: model.x0.select_rows(&kept),
        r: model.r.add_scalar(variance),
        dt: model.dt,
        inputs: model.inputs,
        measurements: model.measurements,
        every: model.every,
        outputs: model.outputs,
    }
}
