//! Truths drawn from what an identification leaves open: a design is judged over the sensors it may meet.

use super::MonteCarloError;
use super::course::model_of;
use crate::filter::FilterDesign;
use crate::model::LinearModel;
use crate::numerics::random::{StreamId, normal, stream};
use crate::params::AxisParams;

/// Term part of the stream addresses of drawn parameters, beside those of the runs (in `scratch`).
const PARAMETERS: u32 = 0x13_0000;

/// Parameters of one axis with their intervals.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    axis: AxisParams,
    design: FilterDesign,
}

impl Spread {
    /// Errors: no parameter of the axis has an interval.
    pub(super) fn new(axis: &AxisParams, design: &FilterDesign) -> Result<Spread, MonteCarloError> {
        let mut axis = axis.clone();
        if axis.noise_parameters().all(|(_, parameter)| parameter.log_spread().is_none()) {
            return Err(MonteCarloError::NoIntervals { axis: axis.name });
        }
        Ok(Spread { axis, design: FilterDesign { axes: Vec::new(), ..design.clone() } })
    }

    /// The truth of a run: every parameter with an interval is log-normal with the value as its median and the
    /// interval as its 95 % range. Parameters outside what a model can be built from give the nominal one.
    pub(super) fn draw(&self, seed: u64, run: u64, number: u32, nominal: &LinearModel) -> LinearModel {
        let mut axis = self.axis.clone();
        for (term, (_, parameter)) in (PARAMETERS..).zip(axis.noise_parameters()) {
            if let Some(spread) = parameter.log_spread() {
                let draw = normal(&mut stream(seed, StreamId { run, axis: number, term }));
                parameter.value *= (spread * draw).exp();
            }
        }
        model_of(&axis, &self.design)
            .ok()
            .filter(|model| model.states == nominal.states)
            .unwrap_or_else(|| nominal.clone())
    }
}
