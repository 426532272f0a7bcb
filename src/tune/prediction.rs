//! The covariance of a filter over time, by doubling: any number of steps costs its logarithm.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use super::sensor::drift_sigma;
use crate::filter::Cycle;
use crate::model::LinearModel;
use crate::numerics::linalg::{LinalgError, solve_spd, symmetrise};
use crate::numerics::optimize::bisect;
use crate::numerics::riccati::Flow;

/// Points per decade of time.
const PER_DECADE: i32 = 8;
/// Shortest span shown, s.
const SHORTEST_SPAN: f64 = 1000.0;
/// Longest span in steps: beyond, doubles no longer count steps exactly.
const MOST_STEPS: f64 = 1e15;

/// Standard deviations of the estimation errors after the update at each time, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Predicted {
    /// s from the first measurement.
    pub time_s: Vec<f64>,
    /// One list per state, in the order of the model.
    pub sigma: Vec<Vec<f64>>,
    /// Of the whole drift, the sum that is subtracted from a measurement.
    pub total: Vec<f64>,
}

/// Within this share of its final value the drift estimate counts as settled.
const SETTLED: f64 = 0.05;

/// Time in s after which the predicted sigma of the whole drift stays within 5 % of `final_sigma`; `None` when that
/// is beyond the times of `predicted`, or when the final sigma is zero.
pub(super) fn drift_settling_time(
    model: &LinearModel,
    predicted: &Predicted,
    final_sigma: f64,
) -> Result<Option<f64>, LinalgError> {
    if final_sigma == 0.0 {
        return Ok(None);
    }
    let outside = |sigma: f64| (sigma / final_sigma - 1.0).abs() > SETTLED;
    settled_after(model, predicted, &predicted.total, |p| drift_sigma(model, p), outside)
}

/// Time in s after which a sigma is never `outside` again; `None` when that is beyond the times of `predicted`.
/// `sigmas` are those at these times, `sigma_of` takes them from a covariance.
pub(super) fn settled_after(
    model: &LinearModel,
    predicted: &Predicted,
    sigmas: &[f64],
    sigma_of: impl Fn(&DMatrix<f64>) -> f64,
    outside: impl Fn(f64) -> bool,
) -> Result<Option<f64>, LinalgError> {
    let Some(last) = sigmas.iter().rposition(|&sigma| outside(sigma)) else { return Ok(Some(0.0)) };
    let Some(inside) = predicted.time_s.get(last + 1) else { return Ok(None) };
    let steps = |time: f64| (time / model.dt).round() as u64;
    // between two samples at which all measurements are taken the sigma is another
    let period = cycle(model)?.period;
    let unit = if steps(*inside) > period { period } else { 1 };
    let (low, high) = (steps(predicted.time_s[last]) / unit, steps(*inside).div_ceil(unit));
    let between = |low: u64, high: u64| (high - low > 1).then_some(low + (high - low) / 2);
    let (_, high) = bisect(low, high, between, |middle| {
        Ok::<_, LinalgError>(!covariances(model, &[middle * unit])?.iter().any(|p| outside(sigma_of(p))))
    })?;
    Ok(Some((high * unit) as f64 * model.dt))
}

/// The pattern of the measurements; there is one where there is a steady state.
fn cycle(model: &LinearModel) -> Result<Cycle, LinalgError> {
    Cycle::new(&model.every).ok_or(LinalgError::NoConvergence { iterations: 0, residual: f64::NAN })
}

/// P(k|k) at these numbers of steps after the first measurement.
pub(super) fn covariances(model: &LinearModel, steps: &[u64]) -> Result<Vec<DMatrix<f64>>, LinalgError> {
    let cycle = cycle(model)?;
    let mut powers = vec![cycle.flow_of(model, cycle.period)?];
    let mut result = Vec::with_capacity(steps.len());
    for &count in steps {
        let (whole, rest) = (count / cycle.period, count % cycle.period);
        // flows are joined, and P0 goes through them at once: of a plant that runs away, what is left of P after a long
        // flow is not positive definite to the last bit
        let mut flow = Flow::none(model.states.len());
        for bit in 0..u64::BITS - whole.leading_zeros() {
            while powers.len() <= bit as usize {
                let mut next = powers[powers.len() - 1].clone();
                next.double()?;
                powers.push(next);
            }
            if whole >> bit & 1 == 1 {
                flow = flow.then(&powers[bit as usize])?;
            }
        }
        if rest > 0 {
            flow = flow.then(&cycle.flow_of(model, rest)?)?;
        }
        result.push(updated(model, &cycle.taken(rest), flow.apply(&model.p0)?)?);
    }
    Ok(result)
}

/// P(k|k) from P(k|k−1) with these measurements, Joseph form.
fn updated(model: &LinearModel, taken: &[usize], p: DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    if taken.is_empty() {
        return Ok(p);
    }
    let h = &model.h.select_rows(taken);
    let r = &model.r.select_rows(taken).select_columns(taken);
    let s = h * &p * h.transpose() + r;
    let gain = solve_spd(&s, &(h * &p))?.transpose();
    let keep = DMatrix::identity(p.nrows(), p.nrows()) - &gain * h;
    let mut next = &keep * p * keep.transpose() + &gain * r * gain.transpose();
    symmetrise(&mut next);
    Ok(next)
}

/// Predicted standard deviations at log-spaced times: the first measurement, then eight per decade to ten settling
/// times or more. With measurements at several rates, times beyond the period are those at which all are taken.
pub fn predicted_sigma(model: &LinearModel, settling_time_s: f64) -> Result<Predicted, LinalgError> {
    let span = (10.0 * settling_time_s).max(SHORTEST_SPAN).max(100.0 * model.dt);
    let most = (span / model.dt).min(MOST_STEPS);
    let period = cycle(model)?.period as f64;
    let mut steps = vec![0u64];
    for k in 0.. {
        let mut count = 10f64.powf(f64::from(k) / f64::from(PER_DECADE)).round();
        if count > period {
            count = (count / period).round() * period;
        }
        if count > most * 1.001 {
            break;
        }
        if steps.last().is_some_and(|last| (*last as f64) < count) {
            steps.push(count as u64);
        }
    }
    let covariances = covariances(model, &steps)?;
    let n = model.states.len();
    let sigma = (0..n).map(|i| covariances.iter().map(|p| p[(i, i)].max(0.0).sqrt()).collect()).collect();
    let total = covariances.iter().map(|p| drift_sigma(model, p)).collect();
    Ok(Predicted { time_s: steps.iter().map(|&s| s as f64 * model.dt).collect(), sigma, total })
}
