//! A filter after a long time: what it claims of its errors, and what they are when the sensor is another.

use nalgebra::DMatrix;

use crate::filter::mismatch::expect_settled;
use crate::filter::{Cycle, Judge};
use crate::model::{DRIFT, LinearModel, Named};
use crate::numerics::linalg::LinalgError;
use crate::numerics::progress::checkpoint;
use crate::tune::closed_loop::{driven, settled};

/// A settled filter, without the constants that it learns for good.
pub(super) struct Settled {
    filter: LinearModel,
    cycle: Cycle,
    judge: Judge,
    /// Sigma of every output as claimed, SI.
    pub(super) claimed: Vec<f64>,
}

/// A sensor in its plant, without what is learnt for good.
pub(super) struct Truth {
    model: LinearModel,
    rows: DMatrix<f64>,
}

/// What the errors are, SI.
pub(super) struct Real {
    /// Of every output.
    pub(super) sigma: Vec<f64>,
    /// E[ν²/S], mean over the measurements.
    pub(super) nis: f64,
}

/// The states of the plant and the whole drift: names with SI units, and their rows.
fn outputs(model: &LinearModel) -> (Vec<Named>, DMatrix<f64>) {
    if model.outputs.is_empty() {
        let drift = Named { name: DRIFT.into(), unit: model.measurements[0].unit.clone() };
        return (vec![drift], model.drift_row());
    }
    let names = model.outputs.iter().map(|o| Named { name: o.name.clone(), unit: o.unit.clone() }).collect();
    let rows = DMatrix::from_fn(model.outputs.len(), model.states.len(), |i, j| model.outputs[i].row[j]);
    (names, rows)
}

impl Truth {
    pub(super) fn new(model: &LinearModel) -> Truth {
        let kept = driven(model, &model.drift_row());
        Truth { model: model.part(&kept), rows: outputs(model).1.select_columns(&kept) }
    }
}

impl Settled {
    /// `None` when no error stays: a filter without drift averages for ever.
    pub(super) fn new(model: &LinearModel) -> Result<Option<Settled>, LinalgError> {
        checkpoint();
        let kept = driven(model, &model.drift_row());
        let Some(cycle) = Cycle::new(&model.every).filter(|_| !kept.is_empty()) else { return Ok(None) };
        let filter = settled(model, &kept)?;
        let (components, rows) = outputs(model);
        let rows = rows.select_columns(&kept);
        let judge = Judge { components, of_truth: rows.clone(), of_estimate: rows };
        let mut found = Settled { filter, cycle, judge, claimed: Vec::new() };
        let own = Truth { model: found.filter.clone(), rows: found.judge.of_truth.clone() };
        found.claimed = found.under(&own)?.sigma;
        Ok(Some(found))
    }

    /// Names and SI units of the outputs.
    pub(super) fn outputs(&self) -> &[Named] {
        &self.judge.components
    }

    /// Errors: they grow without bound in this truth.
    pub(super) fn under(&self, truth: &Truth) -> Result<Real, LinalgError> {
        checkpoint();
        let judge = Judge { of_truth: truth.rows.clone(), ..self.judge.clone() };
        let found = expect_settled(&self.filter, &truth.model, &judge, &self.cycle)?;
        let sigma = found.error.covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
        Ok(Real { sigma, nis: found.nis })
    }
}
