//! A log in memory through a filter: its innovations and their likelihood.

use nalgebra::DVector;
use rayon::prelude::*;

use super::kalman::{Kalman, Update};
use super::likelihood::{Stretch, log_likelihoods_with_bias};
use crate::model::LinearModel;

/// What one axis of a log says, SI; numbers that are not finite are missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorLog {
    pub sensor: Vec<f64>,
    /// Samples missing right before each.
    pub missing: Vec<u64>,
    /// One list per aid, in the order of the measurements.
    pub aids: Vec<Vec<f64>>,
}

impl SensorLog {
    /// Rows.
    pub fn len(&self) -> usize {
        self.sensor.len()
    }

    pub fn is_empty(&self) -> bool {
        self.sensor.is_empty()
    }

    /// Stretches without gaps of the first `rows` samples of the sensor.
    fn stretches(&self, rows: usize) -> Vec<Stretch<'_>> {
        let rows = rows.min(self.len());
        let starts: Vec<usize> = (0..rows).filter(|&i| i == 0 || self.missing[i] > 0).collect();
        let ends = starts.iter().skip(1).copied().chain([rows]);
        let stretch = |(from, to): (&usize, usize)| Stretch {
            // x0, P0 belong to the first sample that there is
            missing: if *from == 0 { 0 } else { self.missing[*from] },
            samples: &self.sensor[*from..to],
        };
        starts.iter().zip(ends).map(stretch).collect()
    }
}

/// A measured angle, by whole turns nearest to what the filter expects.
pub fn nearest_turn(z: f64, expected: f64) -> f64 {
    let turns = ((z - expected) / std::f64::consts::TAU).round();
    if turns == 0.0 { z } else { z - turns * std::f64::consts::TAU }
}

/// Runs a filter over the first `rows` rows and hands out every update with its row and measurement.
///
/// The sensor is the input, held over gaps, or else the first measurement, taken at its every n-th sample; aids are
/// taken where they are finite. Measured angles are taken modulo a turn.
pub fn run(model: &LinearModel, log: &SensorLog, rows: usize, mut visit: impl FnMut(usize, usize, &Update)) {
    let mut kalman = Kalman::new(model);
    let own = usize::from(model.inputs.is_empty());
    let rows_of_h: Vec<DVector<f64>> = model.h.row_iter().map(|row| row.transpose()).collect();
    let angle: Vec<bool> = model.measurements.iter().map(|m| m.unit == "rad").collect();
    let every = model.every.first().map_or(1, |&every| every.max(1) as u64);
    let (mut input, mut step) = (None, 0_u64);
    for row in 0..rows.min(log.len()) {
        if row > 0 {
            let steps = log.missing[row].saturating_add(1);
            kalman.advance(steps, input.as_ref().map(std::slice::from_ref));
            step = step.saturating_add(steps);
        }
        let sensor = log.sensor[row];
        let mut take = |kalman: &mut Kalman, index: usize, z: f64| {
            if z.is_finite() {
                let z = if angle[index] { nearest_turn(z, rows_of_h[index].dot(&kalman.x)) } else { z };
                let update = kalman.update(index, z, None);
                visit(row, index, &update);
            }
        };
        if own == 0 {
            input = if sensor.is_finite() { Some(sensor) } else { input };
        } else if step.is_multiple_of(every) {
            take(&mut kalman, 0, sensor);
        }
        for (index, aid) in (own..).zip(&log.aids) {
            take(&mut kalman, index, aid[row]);
        }
    }
}

/// ln L of the first `rows` rows: Σ −½ (ln 2πS + ν²/S) over all updates.
pub fn log_likelihood(model: &LinearModel, log: &SensorLog, rows: usize) -> f64 {
    log_likelihoods(std::slice::from_ref(model), log, rows)[0]
}

/// The same of several models.
///
/// For a sensor at rest with a constant bias the same numbers by filters without that state, whose gains settle,
/// eight at once: some fifty times faster.
pub fn log_likelihoods(models: &[LinearModel], log: &SensorLog, rows: usize) -> Vec<f64> {
    let at_rest: Option<Vec<_>> =
        models.iter().map(|model| without_bias(model).filter(|_| log.aids.is_empty())).collect();
    if let Some(at_rest) = at_rest {
        let (rest, biases): (Vec<LinearModel>, Vec<[f64; 2]>) = at_rest.into_iter().unzip();
        let found = log_likelihoods_with_bias(&rest, &log.stretches(rows), &biases);
        return found.iter().map(|of_model| of_model.value).collect();
    }
    let one_by_one = |model: &LinearModel| {
        let mut sum = 0.0;
        run(model, log, rows, |_, _, update| sum += update.log_likelihood());
        sum
    };
    models.par_iter().map(one_by_one).collect()
}

/// The model without its constant bias, and mean and variance of that before the log; `None` where it has none, or
/// is more than a sensor at rest.
fn without_bias(model: &LinearModel) -> Option<(LinearModel, [f64; 2])> {
    let n = model.states.len();
    let b = model.states.iter().position(|state| state.name == "bias")?;
    let alone =
        |i: usize| i == b || [&model.f, &model.q, &model.p0].iter().all(|a| a[(i, b)] == 0.0 && a[(b, i)] == 0.0);
    let constant = model.f[(b, b)] == 1.0 && model.q[(b, b)] == 0.0 && model.p0[(b, b)] > 0.0;
    let at_rest = model.inputs.is_empty() && model.every == [1] && model.h[(0, b)] == 1.0;
    if !(constant && at_rest && n > 1 && (0..n).all(alone)) {
        return None;
    }
    let kept: Vec<usize> = (0..n).filter(|&i| i != b).collect();
    Some((model.part(&kept), [model.x0[b], model.p0[(b, b)]]))
}
