//! The course of an experiment: everything that does not depend on the random numbers, computed once for all runs.

use std::sync::OnceLock;

use nalgebra::DMatrix;

use super::MonteCarloError;
use super::sums::{Channel, Layout};
use crate::consistency::low_frequency::time_constants;
use crate::filter::gains::Epoch;
use crate::filter::{AxisDesign, FilterDesign, GainSequence, Judge};
use crate::model::LinearModel;
use crate::numerics::linalg::{cholesky_semidefinite, symmetrise};
use crate::numerics::quadratic_form::QuadraticForm;
use crate::tune::{TuneOptions, sensor_model};

/// Times, evenly spread over a run, at which errors are judged; the time average of the NEES is over these.
const REGULAR_EPOCHS: u64 = 100;
/// More steps would need more memory for the gains than a small machine has.
pub const MAX_STEPS: u64 = 10_000_000;
/// Fewer steps leave no room for blocks and epochs.
pub const MIN_STEPS: u64 = 64;
/// Fewer updates of a measurement in a run have no autocorrelation.
const MIN_UPDATES: u64 = 2;

/// One axis of an experiment.
#[derive(Clone, Debug)]
pub struct AxisCourse {
    pub name: String,
    /// Of the filter, s.
    pub settling_s: f64,
    pub filter: LinearModel,
    /// The truth at its nominal parameters.
    pub truth: LinearModel,
    pub gains: GainSequence,
    pub judge: Judge,
    /// In the order of `gains.epochs`.
    pub epochs: Vec<EpochCourse>,
    pub channels: Vec<Channel>,
    pub(super) layout: Layout,
    /// A plant that nothing holds runs away, and what is left of its error is rounding: truth and estimate are moved
    /// together, which changes neither errors nor innovations where both have the same F.
    pub(super) moved_back: bool,
    /// Law of the NEES summed over the evenly spread epochs; the gate fills it in when it first asks.
    pub(super) over_time: OnceLock<QuadraticForm>,
}

/// How errors at one epoch are judged.
#[derive(Clone, Debug)]
pub struct EpochCourse {
    pub step: u64,
    /// One of the evenly spread epochs (the others look at the start).
    pub regular: bool,
    /// u = W e, independent N(0, 1) for a true filter, as W A and W B of [`Judge`].
    pub(super) of_truth: DMatrix<f64>,
    pub(super) of_estimate: DMatrix<f64>,
    /// W⁻¹ = L with L Lᵀ the claimed covariance.
    pub root: DMatrix<f64>,
    /// Claimed standard deviation of each component.
    pub sigma: Vec<f64>,
}

/// A pole that is not beyond one but by rounding.
const STANDS: f64 = 1.0 + 1e-9;

impl AxisCourse {
    /// `truth`: the model that is simulated.
    pub(super) fn new(design: &AxisDesign, truth: LinearModel, steps: u64) -> Result<AxisCourse, MonteCarloError> {
        let filter = design.model.clone();
        let described = |m: &LinearModel| {
            let every: Vec<String> =
                m.measurements.iter().zip(&m.every).map(|(m, e)| format!("{} every {e}", m.unit)).collect();
            format!("measurements ({}) at {} Hz", every.join(", "), 1.0 / m.dt)
        };
        if described(&filter) != described(&truth) {
            let (truth, filter) = (described(&truth), described(&filter));
            return Err(MonteCarloError::Mismatch { axis: design.name.clone(), truth, filter });
        }
        let mut gains = GainSequence::new(&filter, steps, &epoch_steps(steps));
        let judge = Judge::new(&filter, &truth, &gains.epochs);
        drop_exact(&mut gains.epochs, &judge);
        let regular_from = regular_steps(steps).next().unwrap_or(0);
        let epochs = gains
            .epochs
            .iter()
            .filter_map(|epoch| EpochCourse::new(&judge, epoch, epoch.step >= regular_from))
            .collect();
        for (measurement, every) in filter.measurements.iter().zip(&gains.every) {
            if steps.div_ceil(*every) < MIN_UPDATES {
                let (axis, name) = (design.name.clone(), measurement.name.clone());
                return Err(MonteCarloError::Updates { axis, name, every: *every, steps });
            }
        }
        let constants = time_constants(&design.steady_state.poles);
        let channels: Vec<Channel> = filter
            .measurements
            .iter()
            .zip(&gains.every)
            .map(|(measurement, every)| Channel::new(&measurement.name, *every, steps, &constants))
            .collect();
        let failed = |what, source| MonteCarloError::Truth { axis: design.name.clone(), what, source };
        cholesky_semidefinite(&truth.p0).map_err(|e| failed("P0", e))?;
        cholesky_semidefinite(&truth.q).map_err(|e| failed("Q", e))?;
        let grows =
            |m: &LinearModel| crate::numerics::linalg::eigenvalues(&m.f).iter().any(|(re, im)| re.hypot(*im) > STANDS);
        let moved_back = truth.f == filter.f && grows(&filter);
        let layout = Layout::new(gains.epochs.len(), judge.size(), &channels);
        Ok(AxisCourse {
            name: design.name.clone(),
            settling_s: design.steady_state.settling_time,
            filter,
            truth,
            gains,
            judge,
            epochs,
            channels,
            layout,
            moved_back,
            over_time: OnceLock::new(),
        })
    }
}

impl EpochCourse {
    fn new(judge: &Judge, epoch: &Epoch, regular: bool) -> Option<EpochCourse> {
        let whiten = judge.whitening(&epoch.covariance)?;
        let mut claimed = judge.claimed(&epoch.covariance);
        symmetrise(&mut claimed);
        let root = crate::numerics::linalg::cholesky(&claimed).ok()?;
        Some(EpochCourse {
            step: epoch.step,
            regular,
            of_truth: &whiten * &judge.of_truth,
            of_estimate: &whiten * &judge.of_estimate,
            root,
            sigma: claimed.diagonal().iter().map(|v| v.sqrt()).collect(),
        })
    }
}

/// Epochs at which some judged component is known exactly have no NEES.
fn drop_exact(epochs: &mut Vec<Epoch>, judge: &Judge) {
    let mut kept: Vec<Epoch> = Vec::with_capacity(epochs.len());
    let mut before: Option<DMatrix<f64>> = None;
    for mut epoch in epochs.drain(..) {
        if let Some(earlier) = before.take() {
            epoch.transition = &epoch.transition * earlier;
        }
        if judge.whitening(&epoch.covariance).is_some() {
            kept.push(epoch);
        } else {
            before = Some(epoch.transition);
        }
    }
    if let Some(first) = kept.first_mut() {
        first.transition.fill_with_identity();
    }
    *epochs = kept;
}

/// The evenly spread epochs.
fn regular_steps(steps: u64) -> impl Iterator<Item = u64> {
    let count = REGULAR_EPOCHS.min(steps);
    (1..=count).map(move |i| i * steps / count - 1)
}

/// The first measurement and powers of four up to the first evenly spread epoch, then these.
fn epoch_steps(steps: u64) -> Vec<u64> {
    let first = regular_steps(steps).next().unwrap_or(0);
    let start = std::iter::once(0).chain((0..).map(|k| 4u64.pow(k)).take_while(|step| *step < first));
    let mut all: Vec<u64> = start.filter(|step| *step < first).chain(regular_steps(steps)).collect();
    all.dedup();
    all
}

/// The truth of each axis of a design: its own model.
pub(super) fn own_models(design: &FilterDesign) -> Vec<LinearModel> {
    design.axes.iter().map(|axis| axis.model.clone()).collect()
}

/// The model of parameters at the rate of a filter and in its plant.
pub(super) fn model_of(
    axis: &crate::params::AxisParams,
    design: &FilterDesign,
) -> Result<LinearModel, MonteCarloError> {
    model_in(axis, design.design.clone(), design)
}

/// The model of parameters at the rate of a filter in another plant.
pub(super) fn model_in(
    axis: &crate::params::AxisParams,
    plant: Option<crate::params::Design>,
    design: &FilterDesign,
) -> Result<LinearModel, MonteCarloError> {
    let options = TuneOptions { design: plant, ..TuneOptions::default() };
    sensor_model(axis, design.quantity, 1.0 / design.sample_rate_hz, &options)
        .map_err(|source| MonteCarloError::Parameters { source })
}
