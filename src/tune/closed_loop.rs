//! What the filter in steady state does: causes of its error, and the frequencies it follows.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::Kalman;
use crate::filter::steady_state::{SteadyState, SteadyStateError, steady_state};
use crate::model::observability::undriven_states;
use crate::model::{DRIFT, LinearModel};
use crate::noise::Kind;
use crate::numerics::linalg::{LinalgError, symmetrise};
use crate::numerics::optimize::bracketed_root;
use crate::numerics::riccati::lyapunov;

/// One cause of the final variance.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Share {
    /// "white", or the process: "gauss_markov", "gauss_markov.2", "rate_random_walk", "bias_instability" …
    pub source: String,
    /// What it adds to the variance of the drift estimate, SI.
    pub variance_si: f64,
    /// Part of the whole.
    pub share: f64,
}

/// The states that stay uncertain: those of driven processes. The others are learnt for good. None if `row` sees
/// none of them.
pub(super) fn driven(model: &LinearModel, row: &DMatrix<f64>) -> Vec<usize> {
    let undriven = undriven_states(model);
    let driven: Vec<usize> = (0..model.states.len()).filter(|i| !undriven.contains(i)).collect();
    if driven.iter().any(|&i| row[(0, i)] != 0.0) { driven } else { Vec::new() }
}

/// The part of a matrix with these rows and columns.
fn part(a: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, j| a[(rows[i], columns[j])])
}

/// The noise term that drives a state; of an aid with its name before it.
fn source(state: &str) -> String {
    if state == "bias" || state.ends_with(".bias") {
        return state.replace("bias", "rate_random_walk");
    }
    // of these kinds all states of one term together
    let together = |kind: &Kind| kind.has_joint_states() || matches!(kind, Kind::Quantization | Kind::RateRamp);
    match Kind::of_state(state).filter(together) {
        Some(kind) => state.find(kind.name()).map_or(state.into(), |at| format!("{}{}", &state[..at], kind.name())),
        None => state.replace(".quadrature", ""),
    }
}

/// Process noise of each source, adding up to Q: the given ones, then what is left by the states it stands at.
fn process_sources(model: &LinearModel, noise: &[(String, DMatrix<f64>)]) -> Vec<(String, DMatrix<f64>)> {
    let mut rest = model.q.clone();
    for (_, q) in noise {
        rest -= q;
    }
    let n = model.states.len();
    let of_state: Vec<String> = model.states.iter().map(|state| source(&state.name)).collect();
    let mut sources = noise.to_vec();
    for name in &of_state {
        if sources.iter().any(|(known, _)| known == name) {
            continue;
        }
        let own = |i: usize, j: usize| of_state[i] == *name && of_state[j] == *name;
        // what subtraction leaves of a given one is rounding
        let left = |i: usize, j: usize| rest[(i, j)].abs() > f64::EPSILON * model.q[(i, j)].abs();
        let q = DMatrix::from_fn(n, n, |i, j| if own(i, j) && left(i, j) { rest[(i, j)] } else { 0.0 });
        if q.iter().any(|v| *v != 0.0) {
            sources.push((name.clone(), q));
        }
    }
    sources
}

/// How much of the final variance d P(k|k) dᵀ of an estimate d x each noise source causes, at a sample at which all
/// measurements are taken.
///
/// In steady state the error obeys e ← (I − K H) F e + (I − K H) v − K w. It is linear, so each source has its own
/// covariance X = A X Aᵀ + (I − K H) Q_i (I − K H)ᵀ or A X Aᵀ + K R_i Kᵀ, and they add up to P(k|k). With
/// measurements at several rates A and the noise are those of one period. `noise`: process noise with names of its
/// own ([`Augmented`](crate::model::Augmented)), the rest of Q is named by its states. The first measurement's noise
/// is "white", that of others has their name ("heading.white"). A constant bias causes nothing in the long run.
/// Errors: the loop does not settle.
pub fn error_budget(
    model: &LinearModel,
    steady: &SteadyState,
    row: &DMatrix<f64>,
    noise: &[(String, DMatrix<f64>)],
) -> Result<Vec<Share>, LinalgError> {
    let kept = driven(model, row);
    if kept.is_empty() {
        return Ok(Vec::new());
    }
    let all: Vec<usize> = (0..model.h.nrows()).collect();
    let d = part(row, &[0], &kept);
    let f = part(&model.f, &kept, &kept);
    let h = part(&model.h, &all, &kept);
    let white = |i: usize| if model.inputs.is_empty() && i == 0 { "white".into() } else { white_name(model, i) };
    let mut names: Vec<String> = all.iter().map(|&i| white(i)).collect();
    let mut sums = vec![DMatrix::zeros(kept.len(), kept.len()); names.len()];
    let mut process = Vec::new();
    for (name, q) in process_sources(model, noise) {
        let q = part(&q, &kept, &kept);
        if q.iter().any(|v| *v != 0.0) {
            names.push(name);
            sums.push(DMatrix::zeros(kept.len(), kept.len()));
            process.push(q);
        }
    }
    // one period, from after the measurements of one sample at which all are taken to after those of the next
    let mut kalman = Kalman::new(&settled(model, &kept)?);
    let every: Vec<u64> = model.every.iter().map(|&e| e as u64).collect();
    let mut closed = DMatrix::<f64>::identity(kept.len(), kept.len());
    for i in all.iter().copied() {
        kalman.update(i, 0.0, None);
    }
    for step in 1..=steady.period {
        kalman.predict();
        closed = &f * closed;
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = &f * &*sum * f.transpose();
            if let Some(q) = i.checked_sub(all.len()).map(|i| &process[i]) {
                *sum += q;
            }
        }
        for i in all.iter().copied().filter(|&i| step.is_multiple_of(every[i])) {
            kalman.update(i, 0.0, None);
            let h = h.row(i);
            // K = P(k|k) hᵀ / r, the same as P(k|k−1) hᵀ / S
            let k = &kalman.p * h.transpose() / model.r[(i, i)];
            let keep = DMatrix::identity(kept.len(), kept.len()) - &k * h;
            closed = &keep * closed;
            for (source, sum) in sums.iter_mut().enumerate() {
                *sum = &keep * &*sum * keep.transpose();
                if source == i {
                    *sum += &k * model.r[(i, i)] * k.transpose();
                }
            }
        }
    }
    let mut shares = Vec::with_capacity(names.len());
    for (source, noise) in names.into_iter().zip(&mut sums) {
        symmetrise(noise);
        let x = lyapunov(&closed, noise)?;
        shares.push(Share { source, variance_si: (&d * x * d.transpose())[(0, 0)], share: 0.0 });
    }
    let total: f64 = shares.iter().map(|s| s.variance_si).sum();
    for share in &mut shares {
        share.share = share.variance_si / total;
    }
    Ok(shares)
}

fn white_name(model: &LinearModel, measurement: usize) -> String {
    format!("{}.white", model.measurements[measurement].name)
}

/// The states `kept` alone, settled, before the measurements of a sample at which all are taken.
pub(super) fn settled(model: &LinearModel, kept: &[usize]) -> Result<LinearModel, LinalgError> {
    let mut alone = model.part(kept);
    let steady = steady_state(&alone).map_err(|error| match error {
        SteadyStateError::Linalg(source) | SteadyStateError::Riccati { source, .. } => source,
        _ => LinalgError::Singular,
    })?;
    alone.p0 = steady.predicted_covariance;
    Ok(alone)
}

/// Frequency in Hz at which the estimate follows the measurement with half the power it has at zero frequency: that
/// of the whole drift of a sensor at rest, that of the first state of a plant. Below it a plant's state follows what
/// measures it, above it the sensor that is integrated, if there is one.
///
/// T(ω) = d [I − (I − K H) F e^(−jω dt)]⁻¹ K. For one pole λ near one it is (1 − λ)/(2π dt). With one measurement at
/// every n-th sample F is that of n samples and dt their length; several measurements of the same thing move
/// together. `None` when the steady gain is zero, the estimate follows up to half the rate of the measurements, or
/// these are of several rates or units.
pub fn bandwidth_hz(model: &LinearModel, steady: &SteadyState) -> Option<f64> {
    let output = model.outputs.iter().find(|output| output.name != DRIFT);
    let row = output.map_or_else(|| model.drift_row(), |o| DMatrix::from_row_slice(1, o.row.len(), &o.row));
    let kept = driven(model, &row);
    let several = model.every.iter().any(|every| *every as u64 != steady.period);
    let unlike = model.measurements.iter().any(|m| m.unit != model.measurements[0].unit);
    if kept.is_empty() || several || unlike {
        return None;
    }
    let all: Vec<usize> = (0..model.h.nrows()).collect();
    let h = part(&model.h, &all, &kept);
    let d = part(&row, &[0], &kept);
    let gains = part(&steady.gain, &kept, &all);
    let k = gains.column_sum();
    let f = part(&model.f, &kept, &kept).pow(u32::try_from(steady.period).ok()?);
    let a = (DMatrix::identity(kept.len(), kept.len()) - gains * &h) * f;
    let dt = model.dt * steady.period as f64;
    let power = |f_hz: f64| -> Option<f64> {
        let turn = Complex::from_polar(1.0, -TAU * f_hz * dt);
        let complex = |x: &DMatrix<f64>| x.map(|v| Complex::new(v, 0.0));
        let loop_matrix = DMatrix::identity(kept.len(), kept.len()) - complex(&a) * turn;
        let k = k.map(|v| Complex::new(v, 0.0));
        Some((complex(&d) * loop_matrix.lu().solve(&k)?)[(0, 0)].norm_sqr())
    };
    let half = 0.5 * power(0.0)?;
    let nyquist = 0.5 / dt;
    // upward from far below the slowest pole
    let mut low = nyquist;
    for (re, im) in &steady.poles {
        let modulus = re.hypot(*im);
        if modulus < 1.0 && modulus > 0.0 {
            low = f64::min(low, -modulus.ln() / (TAU * model.dt));
        }
    }
    low *= 1e-3;
    let mut high = low;
    while power(high)? > half {
        if high >= nyquist {
            return None;
        }
        low = high;
        high = (high * 1.25).min(nyquist);
    }
    bracketed_root(|ln| power(ln.exp()).map(|power| power - half), low.ln(), high.ln(), 0.0).map(f64::exp)
}
