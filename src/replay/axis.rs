//! One axis in progress: the filter, its input and its measurements.

use nalgebra::DVector;

use super::follow::Following;
use super::trace::Trace;
use super::{LAGS, NIS_BINS, Options, Roles};
use crate::consistency::low_frequency::{LowFrequency, time_constants};
use crate::consistency::whiteness::Autocorrelation;
use crate::filter::innovations::nearest_turn;
use crate::filter::kalman::{Kalman, Update};
use crate::filter::smoother::History;
use crate::filter::whole_log::TwoStage;
use crate::filter::{AxisDesign, Form, Running};
use crate::model::{LinearModel, Named};
use crate::numerics::reduce::Sum;

/// One axis in progress.
#[derive(Clone, Debug)]
pub(super) struct AxisReplay {
    pub(super) filter: Running,
    /// Last usable value of each input; zero before there is one.
    inputs: Vec<f64>,
    /// One of them has had a value.
    driven: bool,
    about: About,
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
    /// Whose noise is found anew along the log.
    pub(super) following: Option<Following>,
    /// The same filter for whole stretches of the log, where it can be run so.
    stretches: Option<Stretches>,
}

/// What is taken off before the filter sees it.
#[derive(Clone, Debug)]
struct About {
    inputs: Vec<f64>,
    measurements: Vec<f64>,
}

impl About {
    fn new(design: &AxisDesign) -> About {
        let of = |named: &[Named]| named.iter().map(|n| design.about.get(&n.name).copied().unwrap_or(0.0)).collect();
        About { inputs: of(&design.model.inputs), measurements: of(&design.model.measurements) }
    }
}

/// A filter for whole stretches, and its results: ν and 1/S of each sample.
#[derive(Clone, Debug)]
struct Stretches {
    filter: TwoStage,
    innovation: Vec<f64>,
    weight: Vec<f64>,
    /// R of the measurement.
    r: f64,
    /// Rows that wait for a full stretch.
    values: Vec<f64>,
    missing: Vec<u64>,
    time_s: Vec<f64>,
}

/// Rows of a stretch: counted from the start of the log, so that the blocks it comes in leave no trace.
const STRETCH: usize = 4096;

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

/// The score test of x0: a second filter, shifted at the start by one standard deviation of P0 in the direction that
/// the first measurement sees, shows how innovations answer to such a shift; they are projected on that answer.
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
    pub(super) fn new(
        design: &AxisDesign,
        filter: Running,
        roles: Roles,
        options: &Options,
        following: Option<Following>,
    ) -> AxisReplay {
        let model = &design.model;
        let settling = design.steady_state.settling_time / model.dt;
        let channels: Vec<Channel> = (0..model.measurements.len()).map(|i| Channel::new(design, i)).collect();
        // what figures show beside the measurement must be what the measurement sees
        let plain = roles.own == 1
            && model.inputs.is_empty()
            && channels.len() == 1
            && !channels[0].angle
            && design.about.is_empty();
        let seen = || channels[0].row.iter().eq(channels[0].h.iter());
        let stretches =
            (options.form == Form::Joseph && options.gate.is_none() && following.is_none() && plain && seen())
                .then(|| TwoStage::new(model))
                .flatten()
                .map(|filter| Stretches::new(filter, model.r[(0, 0)]));
        AxisReplay {
            filter,
            inputs: vec![0.0; model.inputs.len()],
            driven: false,
            about: About::new(design),
            channels,
            stretches,
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
            following,
        }
    }

    /// Columns beside the sensor's.
    pub(super) fn aids(&self) -> usize {
        self.roles.known_inputs + self.channels.len() - self.roles.own
    }

    /// Rows of a sensor alone, when nothing but the statistics is wanted of them; false where they must go one by one.
    pub(super) fn rows(&mut self, values: &[f64], missing: &[u64], time_s: &[f64]) -> bool {
        if self.history.is_some() {
            self.leave_stretches();
        }
        let Some(stretches) = &mut self.stretches else { return false };
        stretches.values.extend(values);
        stretches.missing.extend(missing);
        stretches.time_s.extend(time_s);
        while self.stretches.as_ref().is_some_and(|stretches| stretches.values.len() >= STRETCH) {
            self.stretch(STRETCH);
        }
        true
    }

    /// The rows that still wait.
    pub(super) fn flush(&mut self) {
        if let Some(count) = self.stretches.as_ref().map(|stretches| stretches.values.len()).filter(|count| *count > 0)
        {
            self.stretch(count);
        }
    }

    /// From here on rows go one by one.
    fn leave_stretches(&mut self) {
        self.flush();
        self.stretches = None;
    }

    /// The first `count` of the rows that wait.
    fn stretch(&mut self, count: usize) {
        let Some(mut stretches) = self.stretches.take() else { return };
        stretches.run(count, self.started);
        let Stretches { filter, innovation, weight, r, values, missing, time_s } = &mut stretches;
        for (row, ((z, missing), time_s)) in
            values.drain(..count).zip(missing.drain(..count)).zip(time_s.drain(..count)).enumerate()
        {
            self.samples += 1;
            if self.started {
                self.pass(missing);
            }
            self.started = true;
            let channel = &mut self.channels[0];
            let (v, w) = (innovation[row], weight[row]);
            if !v.is_finite() {
                channel.skip();
                continue;
            }
            self.start.update(self.step, 0, z, v, w);
            // of the state after the update: H x = z − ν R/S, H P Hᵀ = R (1 − R/S)
            let (estimate, variance) = (z - v * *r * w, *r * (1.0 - *r * w));
            channel.accept(time_s, z, (estimate, variance.max(0.0).sqrt()), v * w.sqrt());
        }
        self.channels[0].log_likelihood = Sum::default();
        self.channels[0].log_likelihood.add(filter.log_likelihood());
        if let Running::Joseph(kalman) = &mut self.filter {
            (kalman.x, kalman.p) = filter.state();
        }
        self.stretches = Some(stretches);
    }

    /// One row: the sensor's value, the samples missing before it, and one value per aid.
    pub(super) fn step(&mut self, sensor: f64, missing: u64, time_s: f64, mut aids: impl Iterator<Item = f64>) {
        self.leave_stretches();
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
        } else {
            self.drive(0, sensor);
        }
        self.follow(sensor);
        for input in 0..self.roles.known_inputs {
            self.drive(input, aids.next().unwrap_or(f64::NAN));
        }
        for (index, z) in (self.roles.own..).zip(aids) {
            if z.is_finite() {
                self.update(index, z, time_s);
            }
        }
    }

    /// The value that an input keeps from now on.
    fn drive(&mut self, input: usize, value: f64) {
        if value.is_finite() {
            self.inputs[input] = value - self.about.inputs[input];
            self.driven = true;
        } else {
            self.unusable += 1;
        }
    }

    /// The noise as the samples so far have it, where it is followed.
    fn follow(&mut self, sensor: f64) {
        let (Some(following), Running::Joseph(kalman)) = (&mut self.following, &mut self.filter) else { return };
        let used = self.channels[0].last.is_some_and(|update| update.accepted);
        let value = if used { sensor - self.about.measurements[0] } else { kalman.expected(0) };
        if let Some(model) = following.take(value) {
            kalman.change(&model);
            // the answer to a shift of x0 is that of the design
            self.start.shifted = None;
        }
    }

    fn update(&mut self, index: usize, z: f64, time_s: f64) {
        let channel = &mut self.channels[index];
        let z = channel.nearest(z - self.about.measurements[index], self.filter.x());
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
        self.start.update(self.step, index, z, update.innovation, 1.0 / update.variance);
        channel.log_likelihood.add(update.log_likelihood());
        channel.accept(time_s, z, self.filter.of_row(&channel.row), y);
    }

    /// Predictions to the next sample, with `missing` samples in between.
    fn advance(&mut self, missing: u64) {
        let steps = missing.saturating_add(1);
        let inputs = self.driven.then_some(self.inputs.as_slice());
        self.filter.advance(steps, inputs);
        if let Some(history) = &mut self.history {
            history.row(steps, inputs);
        }
        self.pass(missing);
    }

    /// What is counted of a step, with `missing` samples in between.
    fn pass(&mut self, missing: u64) {
        let steps = missing.saturating_add(1);
        self.start.predict(steps, self.driven.then_some(self.inputs.as_slice()));
        if missing > 0 {
            self.following.iter_mut().for_each(Following::interrupt);
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

    /// A measurement that was used: `estimate` and its standard deviation after it, y = ν/√S.
    fn accept(&mut self, time_s: f64, z: f64, estimate: (f64, f64), y: f64) {
        self.autocorrelation.push(y);
        self.low_frequency.push(y);
        self.trace.push(time_s, z, estimate.0, estimate.1, y);
        self.nis_histogram[((2.0 * y * y) as usize).min(NIS_BINS - 1)] += 1;
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

impl Stretches {
    fn new(filter: TwoStage, r: f64) -> Stretches {
        let (innovation, weight) = (vec![0.0; STRETCH], vec![0.0; STRETCH]);
        Stretches { filter, innovation, weight, r, values: Vec::new(), missing: Vec::new(), time_s: Vec::new() }
    }

    fn run(&mut self, count: usize, started: bool) {
        let (values, missing) = (&self.values[..count], &self.missing[..count]);
        let mut from = 0;
        while from < count {
            let to = missing[from + 1..].iter().position(|n| *n > 0).map_or(count, |n| from + 1 + n);
            // x0, P0 belong to the first sample that there is
            if missing[from] > 0 && (started || from > 0) {
                self.filter.pause(missing[from]);
            }
            self.filter.run(&values[from..to], &mut self.innovation[from..to], &mut self.weight[from..to]);
            from = to;
        }
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

    fn predict(&mut self, steps: u64, inputs: Option<&[f64]>) {
        if let Some(kalman) = &mut self.shifted {
            kalman.advance(steps, inputs);
        }
    }

    /// The same measurement that the filter accepted; ν and 1/S.
    fn update(&mut self, step: u64, index: usize, z: f64, innovation: f64, weight: f64) {
        let Some(kalman) = &mut self.shifted else { return };
        // ν of the shifted filter is ν − d
        let difference = innovation - kalman.update(index, z, None).innovation;
        self.score += difference * innovation * weight;
        self.information += difference * difference * weight;
        if step >= self.until {
            self.shifted = None;
        }
    }
}
