//! One axis in progress: the filter, its input and its measurements.

use nalgebra::DVector;

use super::trace::Trace;
use super::{LAGS, NIS_BINS, Options, Roles};
use crate::consistency::low_frequency::{LowFrequency, time_constants};
use crate::consistency::whiteness::Autocorrelation;
use crate::filter::innovations::nearest_turn;
use crate::filter::kalman::{Kalman, Update};
use crate::filter::smoother::History;
use crate::filter::{AxisDesign, Running};
use crate::model::LinearModel;
use crate::numerics::reduce::Sum;

/// One axis in progress.
#[derive(Clone, Debug)]
pub(super) struct AxisReplay {
    pub(super) filter: Running,
    /// Last usable value of the input.
    input: Option<f64>,
    pub(super) channels: Vec<Channel>,
    roles: Roles,
    gate: Option<f64>,
    /// Measurements beyond the gate still move the estimate, as far as one at the gate.
    clip: bool,
    /// Steps since the first sample.
    step: u64,
    started: bool,
    pub(super) start: StartTest,
    pub(super) samples: u64,
    /// Samples of an input that are not numbers.
    pub(super) unusable: u64,
    pub(super) gaps: u64,
    pub(super) missing: u64,
    /// For smoothing.
    pub(super) history: Option<History>,
}

/// One measurement in progress.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) every: u64,
    /// Of the estimate that figures show beside the measurement.
    row: Vec<f64>,
    /// An angle is measured modulo a turn.
    angle: bool,
    /// H, for the nearest turn.
    h: DVector<f64>,
    /// The update of this sample.
    pub(super) last: Option<Update>,
    pub(super) autocorrelation: Autocorrelation,
    pub(super) low_frequency: LowFrequency,
    pub(super) log_likelihood: Sum,
    pub(super) unusable: u64,
    pub(super) rejected: u64,
    pub(super) trace: Trace,
    pub(super) nis_histogram: [u64; NIS_BINS],
}

/// The score test of x0: a second filter, shifted at the start by one standard deviation of P0 in the direction that the first
/// measurement sees, shows how innovations answer to such a shift; they are projected on that answer.
#[derive(Clone, Debug)]
pub(super) struct StartTest {
    shifted: Option<Kalman>,
    /// Steps after which the answer has died away.
    until: u64,
    /// Σ d ν/S and Σ d²/S, d = difference of the innovations.
    pub(super) score: f64,
    pub(super) information: f64,
}

impl AxisReplay {
    pub(super) fn new(design: &AxisDesign, filter: Running, roles: Roles, options: &Options) -> AxisReplay {
        let model = &design.model;
        let settling = design.steady_state.settling_time / model.dt;
        AxisReplay {
            filter,
            input: None,
            channels: (0..model.measurements.len()).map(|i| Channel::new(design, i)).collect(),
            roles,
            gate: options.gate,
            clip: options.clip,
            step: 0,
            started: false,
            start: StartTest::new(model, settling),
            samples: 0,
            unusable: 0,
            gaps: 0,
            missing: 0,
            history: None,
        }
    }

    /// Columns beside the sensor's.
    pub(super) fn aids(&self) -> usize {
        usize::from(self.roles.known_input) + self.channels.len() - self.roles.own
    }

    /// One row: the sensor's value, the samples missing before it, and one value per aid.
    pub(super) fn step(&mut self, sensor: f64, missing: u64, time_s: f64, mut aids: impl Iterator<Item = f64>) {
        self.samples += 1;
        if self.started {
            self.advance(missing);
        } else if let Some(history) = &mut self.history {
            history.row(0, None);
        }
        self.started = true;
        self.channels.iter_mut().for_each(|channel| channel.last = None);
        if self.roles.own == 1 {
            // taken at every n-th sample, and a value that is no number is a fault
            if self.step.is_multiple_of(self.channels[0].every) {
                if sensor.is_finite() { self.update(0, sensor, time_s) } else { self.channels[0].skip() }
            }
        } else if sensor.is_finite() {
            self.input = Some(sensor);
        } else {
            self.unusable += 1;
        }
        if self.roles.known_input {
            match aids.next().filter(|u| u.is_finite()) {
                Some(u) => self.input = Some(u),
                None => self.unusable += 1,
            }
        }
        for (index, z) in (self.roles.own..).zip(aids) {
            if z.is_finite() {
                self.update(index, z, time_s);
            }
        }
    }

    fn update(&mut self, index: usize, z: f64, time_s: f64) {
        let channel = &mut self.channels[index];
        let z = channel.nearest(z, self.filter.x());
        let update = self.filter.update(index, z, self.gate);
        channel.last = Some(update);
        let y = update.innovation / update.variance.sqrt();
        if !update.accepted {
            match self.gate.filter(|gate| y.abs() > *gate) {
                Some(gate) => {
                    channel.rejected += 1;
                    channel.autocorrelation.skip(1);
                    if self.clip {
                        self.filter.nudge(index, y.signum() * gate * update.variance.sqrt());
                    }
                }
                None => channel.skip(),
            }
            return;
        }
        if let Some(history) = &mut self.history {
            history.take(index, z);
        }
        self.start.update(self.step, index, z, &update);
        channel.log_likelihood.add(update.log_likelihood);
        channel.autocorrelation.push(y);
        channel.low_frequency.push(y);
        let (estimate, sigma) = self.filter.of_row(&channel.row);
        channel.trace.push(time_s, z, estimate, sigma, y);
        channel.nis_histogram[((2.0 * update.nis) as usize).min(NIS_BINS - 1)] += 1;
    }

    /// Predictions to the next sample, with `missing` samples in between.
    fn advance(&mut self, missing: u64) {
        let steps = missing.saturating_add(1);
        self.filter.advance(steps, self.input);
        if let Some(history) = &mut self.history {
            history.row(steps, self.input);
        }
        self.start.predict(steps, self.input);
        if missing > 0 {
            self.gaps += 1;
            self.missing = self.missing.saturating_add(missing);
            for channel in &mut self.channels[..self.roles.own] {
                channel.autocorrelation.skip(missing / channel.every);
            }
        }
        self.step = self.step.saturating_add(steps);
    }
}

impl Channel {
    fn new(design: &AxisDesign, index: usize) -> Channel {
        let model = &design.model;
        let every = model.every[index].max(1) as u64;
        let h = model.h.row(index);
        let row = if model.outputs.is_empty() {
            model.drift_row().iter().copied().collect()
        } else {
            h.iter().copied().collect()
        };
        let constants: Vec<f64> =
            time_constants(&design.steady_state.poles).into_iter().map(|samples| samples / every as f64).collect();
        Channel {
            every,
            row,
            angle: model.measurements[index].unit == "rad",
            h: h.transpose(),
            last: None,
            autocorrelation: Autocorrelation::new(LAGS),
            low_frequency: LowFrequency::new(&constants, (h * design.steady_state.gain.column(index))[0]),
            log_likelihood: Sum::default(),
            unusable: 0,
            rejected: 0,
            trace: Trace::new(),
            nis_histogram: [0; NIS_BINS],
        }
    }

    /// A measured angle, by whole turns nearest to what the filter expects.
    fn nearest(&self, z: f64, x: &DVector<f64>) -> f64 {
        if self.angle { nearest_turn(z, self.h.dot(x)) } else { z }
    }

    fn skip(&mut self) {
        self.unusable += 1;
        self.autocorrelation.skip(1);
    }
}

impl StartTest {
    fn new(model: &LinearModel, settling: f64) -> StartTest {
        let direction = &model.p0 * model.h.row(0).transpose();
        let size = (model.h.row(0) * &direction)[0].sqrt();
        let shifted = (size.is_finite() && size > 0.0).then(|| {
            let mut kalman = Kalman::new(model);
            kalman.x += direction / size;
            kalman
        });
        // a filter that never settles is watched for as long as a float counts exactly
        let until = if settling.is_finite() { settling.clamp(1.0, 1e9) as u64 } else { 1_000_000_000 };
        StartTest { shifted, until, score: 0.0, information: 0.0 }
    }

    fn predict(&mut self, steps: u64, input: Option<f64>) {
        if let Some(kalman) = &mut self.shifted {
            kalman.advance(steps, input);
        }
    }

    /// The same measurement that the filter accepted.
    fn update(&mut self, step: u64, index: usize, z: f64, update: &Update) {
        let Some(kalman) = &mut self.shifted else { return };
        // ν of the shifted filter is ν − d
        let difference = update.innovation - kalman.update(index, z, None).innovation;
        self.score += difference * update.innovation / update.variance;
        self.information += difference * difference / update.variance;
        if step >= self.until {
            self.shifted = None;
        }
    }
}
