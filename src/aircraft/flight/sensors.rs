//! What the sensors of an airplane show at one instant.

use rand::rngs::ChaCha8Rng;

use super::document::ErrorEntry;
use super::streams;
use crate::noise::{SamplePath, Term};
use crate::numerics::random::normal;
use crate::params::Params;
use crate::simulate::{AxisBlock, Scenario, SimulateError, Simulator, TrueRate};
use crate::units::Dimension;

/// Errors of a measurement, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Errors {
    /// Standard deviation of one measurement.
    pub white: f64,
    /// Standard deviation and correlation time.
    pub drift: Option<(f64, f64)>,
    /// One measurement in this many samples.
    pub every: u64,
}

impl Errors {
    /// At samples of `rate` (Hz); `own` is the rate of the instrument if the entry has none. Errors: no whole fraction
    /// of the rate.
    pub(super) fn new(entry: &ErrorEntry, own: Option<f64>, rate: f64) -> Result<Errors, String> {
        let measured = entry.rate.as_ref().map(|rate| rate.si()).or(own).unwrap_or(rate);
        let every = (rate / measured).round();
        if every < 1.0 || (every * measured / rate - 1.0).abs() > 1e-9 {
            return Err(format!("{measured} Hz is no whole fraction of the {rate} Hz of the sensors"));
        }
        let white = entry.white.as_ref().map_or(0.0, |white| {
            // a density has an odd number of half seconds
            let density = white.unit.dimension().time.rem_euclid(2) == 1;
            white.si() * if density { (rate / every).sqrt() } else { 1.0 }
        });
        let drift = entry.gauss_markov.as_ref().map(|d| (d.std_dev.si(), d.correlation_time.si()));
        Ok(Errors { white, drift, every: every as u64 })
    }
}

/// One measured number after another.
pub(super) struct Channel {
    errors: Errors,
    white: ChaCha8Rng,
    drift: Option<Box<dyn SamplePath + Send>>,
}

impl Channel {
    pub(super) fn new(errors: Errors, rate: f64, address: (u64, u64, u32)) -> Channel {
        let [white, drift] = streams::measurement(address.0, address.1, address.2);
        let interval = errors.every as f64 / rate;
        let drift = errors.drift.map(|(std_dev, correlation_time)| {
            Term::GaussMarkov { std_dev, correlation_time }.sample_path(interval, drift)
        });
        Channel { errors, white, drift }
    }

    /// The error at a sample; NaN where there is no measurement.
    pub(super) fn error(&mut self, sample: u64) -> f64 {
        if !sample.is_multiple_of(self.errors.every) {
            return f64::NAN;
        }
        let mut drift = [0.0];
        if let Some(path) = &mut self.drift {
            path.fill(&mut drift);
        }
        let white = if self.errors.white > 0.0 { self.errors.white * normal(&mut self.white) } else { 0.0 };
        white + drift[0]
    }
}

/// Three axes of a gyro or an accelerometer with the noise of their parameters, sample by sample.
pub(super) struct Inertial {
    simulator: Simulator,
    blocks: Vec<AxisBlock>,
    at: usize,
}

/// Of three axes: what is added to the truth, and what of it is bias and drift.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InertialErrors {
    pub all: [f64; 3],
    pub bias: [f64; 3],
    pub drift: [f64; 3],
}

/// Samples drawn at once.
const BLOCK: usize = 256;

impl Inertial {
    /// Errors: the parameters do not fit the rate.
    pub(super) fn new(
        params: &Params,
        first_axis: u32,
        rate: f64,
        samples: u64,
        seed: u64,
        run: u64,
    ) -> Result<Inertial, SimulateError> {
        let scenario = Scenario {
            seed,
            run,
            samples,
            rate_hz: rate,
            true_rate: TrueRate::Rest,
            turn_on: false,
            saturation: None,
            quantisation: None,
        };
        Ok(Inertial { simulator: Simulator::of_axes(params, &scenario, first_axis)?, blocks: Vec::new(), at: 0 })
    }

    pub(super) fn next(&mut self) -> InertialErrors {
        if self.blocks.first().is_none_or(|block| self.at >= block.measured.len()) {
            self.simulator.next_block(BLOCK, &mut self.blocks);
            self.at = 0;
        }
        let mut errors = InertialErrors::default();
        for (i, block) in self.blocks.iter().enumerate().take(3) {
            errors.all[i] = block.measured.get(self.at).copied().unwrap_or(f64::NAN);
            errors.bias[i] = block.bias;
            errors.drift[i] = block.drift.get(self.at).copied().unwrap_or(f64::NAN);
        }
        self.at += 1;
        errors
    }
}

/// The dimension of a density is the quantity's times √s.
pub fn three_axes(mut params: Params, dimension: Dimension, what: &str) -> Result<Params, String> {
    if params.quantity.dimension() != dimension {
        return Err(format!("its quantity is {}, expected that of {what}", params.quantity.name()));
    }
    match params.axes.as_slice() {
        [one] => params.axes = vec![one.clone(), one.clone(), one.clone()],
        [_, _, _] => {}
        axes => return Err(format!("{} axes, expected three (x, y, z), or one that stands for all", axes.len())),
    }
    Ok(params)
}
