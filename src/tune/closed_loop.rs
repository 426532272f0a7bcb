//! What the filter in steady state does: causes of its error, and the frequencies it follows.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::steady_state::SteadyState;
use crate::model::LinearModel;
use crate::model::observability::undriven_states;
use crate::numerics::linalg::LinalgError;
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

/// The states that stay uncertain: those of driven processes. The others are learnt for good. None if no drift is among them.
fn driven(model: &LinearModel) -> Vec<usize> {
    let undriven = undriven_states(model);
    let driven: Vec<usize> = (0..model.states.len()).filter(|i| !undriven.contains(i)).collect();
    let drift = model.drift_row();
    if driven.iter().any(|&i| drift[(0, i)] != 0.0) { driven } else { Vec::new() }
}

/// The part of a matrix with these rows and columns.
fn part(a: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, j| a[(rows[i], columns[j])])
}

/// The noise term that drives a state.
fn source(state: &str) -> String {
    match state.split_once('.') {
        _ if state == "bias" => "rate_random_walk".into(),
        Some((chain @ ("bias_instability" | "moving_average" | "quantization" | "rate_ramp"), _)) => chain.into(),
        _ => state.replace(".quadrature", ""),
    }
}

/// How much of the final variance d P(k|k) dᵀ of the drift estimate each noise source causes.
///
/// In steady state the error obeys e ← (I − K H) F e + (I − K H) v − K w. It is linear, so each source has its own
/// covariance X = A X Aᵀ + (I − K H) Q_i (I − K H)ᵀ or A X Aᵀ + K R Kᵀ, and they add up to P(k|k).
/// A constant bias causes nothing in the long run. Errors: the loop does not settle.
pub fn error_budget(model: &LinearModel, steady: &SteadyState) -> Result<Vec<Share>, LinalgError> {
    let kept = driven(model);
    if kept.is_empty() {
        return Ok(Vec::new());
    }
    let all: Vec<usize> = (0..model.h.nrows()).collect();
    let (f, q) = (part(&model.f, &kept, &kept), part(&model.q, &kept, &kept));
    let h = part(&model.h, &all, &kept);
    let d = part(&model.drift_row(), &[0], &kept);
    let k = part(&steady.gain, &kept, &all);
    let keep = DMatrix::identity(kept.len(), kept.len()) - &k * &h;
    let a = &keep * &f;
    let variance = |noise: DMatrix<f64>| -> Result<f64, LinalgError> {
        let x = lyapunov(&a, &noise)?;
        Ok((&d * x * d.transpose())[(0, 0)])
    };
    let mut shares =
        vec![Share { source: "white".into(), variance_si: variance(&k * &model.r * k.transpose())?, share: 0.0 }];
    let mut sources: Vec<String> = kept.iter().map(|&i| source(&model.states[i].name)).collect();
    let of_state = sources.clone();
    sources.dedup();
    for name in sources {
        let q_i = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
            if of_state[i] == name && of_state[j] == name { q[(i, j)] } else { 0.0 }
        });
        let variance_si = variance(&keep * q_i * keep.transpose())?;
        shares.push(Share { source: name, variance_si, share: 0.0 });
    }
    let total: f64 = shares.iter().map(|s| s.variance_si).sum();
    for share in &mut shares {
        share.share = share.variance_si / total;
    }
    Ok(shares)
}

/// Frequency in Hz at which the estimate of the whole drift follows the measurement with half the power it has at zero frequency.
///
/// T(ω) = d [I − (I − K H) F e^(−jω dt)]⁻¹ K. For one pole λ near one it is (1 − λ)/(2π dt). `None` when the steady gain is zero or
/// the estimate follows up to half the sample rate.
pub fn bandwidth_hz(model: &LinearModel, steady: &SteadyState) -> Option<f64> {
    let kept = driven(model);
    let all: Vec<usize> = (0..model.h.nrows()).collect();
    let h = part(&model.h, &all, &kept);
    let d = part(&model.drift_row(), &[0], &kept);
    let k = part(&steady.gain, &kept, &all);
    if kept.is_empty() {
        return None;
    }
    let a = (DMatrix::identity(kept.len(), kept.len()) - &k * &h) * part(&model.f, &kept, &kept);
    let power = |f_hz: f64| -> Option<f64> {
        let turn = Complex::from_polar(1.0, -TAU * f_hz * model.dt);
        let complex = |x: &DMatrix<f64>| x.map(|v| Complex::new(v, 0.0));
        let loop_matrix = DMatrix::identity(kept.len(), kept.len()) - complex(&a) * turn;
        Some((complex(&d) * loop_matrix.lu().solve(&complex(&k))?)[(0, 0)].norm_sqr())
    };
    let half = 0.5 * power(0.0)?;
    let nyquist = 0.5 / model.dt;
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
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if power(middle)? > half { low = middle } else { high = middle }
    }
    Some((low * high).sqrt())
}
