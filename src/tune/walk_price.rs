//! What it costs when a filter takes the drift for a random walk.

use nalgebra::DMatrix;

use super::closed_loop::{driven, settled};
use super::{TuneOptions, sensor_model};
use crate::filter::mismatch::expect_settled;
use crate::filter::{Cycle, Judge, Kalman};
use crate::model::{LinearModel, Named};
use crate::params::{AxisParams, Measured, TermEntry};
use crate::units::{Quantity, Unit};

/// The filter of a sensor at rest with a walk, beside the one with the true drift, in steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkPrice {
    /// Root mean square error of the drift estimate, over that of the right filter.
    pub error: f64,
    /// E[e²/P] of it: 1 when the claimed sigma is the real one.
    pub nees: f64,
}

/// The price of the walk `k` (SI, unit/s/√Hz) in place of the drift of `axis`, exactly. `None` where one of the filters has no steady state,
/// or the drift is a walk itself.
pub fn walk_price(axis: &AxisParams, quantity: Quantity, dt: f64, k: f64) -> Option<WalkPrice> {
    let unit = Unit::parse(quantity.si_unit()).ok()?.per(&Unit::second());
    let density = Measured::from_si(k, None, Unit::parse(&format!("{unit}/sqrt(Hz)")).ok()?);
    let mut simple = axis.clone();
    simple.terms.retain(|term| !term.to_term().kind().is_drift());
    simple.terms.push(TermEntry::RateRandomWalk { density });
    let model = |axis: &AxisParams| sensor_model(axis, quantity, dt, &TuneOptions::default()).ok();
    let (filter, truth) = (model(&simple)?, model(axis)?);
    let kept = |model: &LinearModel| {
        let row = model.drift_row();
        let kept = driven(model, &row);
        (!kept.is_empty()).then(|| (row.select_columns(&kept), kept))
    };
    let ((of_estimate, in_filter), (of_truth, in_truth)) = (kept(&filter)?, kept(&truth)?);
    let (filter, right) = (settled(&filter, &in_filter).ok()?, settled(&truth, &in_truth).ok()?);
    let mut best = Kalman::new(&right);
    best.update(0, 0.0, None);
    let optimum: f64 = (&of_truth * &best.p * of_truth.transpose())[(0, 0)];
    let components = vec![Named { name: "drift".into(), unit: quantity.si_unit().into() }];
    let judge = Judge { components, of_truth, of_estimate };
    let error = expect_settled(&filter, &truth.part(&in_truth), &judge, &Cycle::new(&filter.every)?).ok()?.error;
    let real: &DMatrix<f64> = &error.covariance;
    Some(WalkPrice { error: (real[(0, 0)] / optimum).sqrt(), nees: real[(0, 0)] / error.claimed[(0, 0)] })
}
