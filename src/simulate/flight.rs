//! The plant that a sensor is part of, moving with its true rate, and what aids it.

use rand::rngs::ChaCha8Rng;

use super::{AxisBlock, AxisGenerator, Scenario, SimulateError};
use crate::model::plant::vertical::STANDARD_GRAVITY;
use crate::noise::{SamplePath, Term};
use crate::numerics::random::{StreamId, normal, stream};
use crate::params::{AidEntry, Design, PlantEntry};

/// First axis number of accelerometers, beside those of the sensor.
const ACCELEROMETERS: u32 = 1 << 31;
/// First term number of aids: two for each, its white noise and its drift.
const AIDS: u32 = 1 << 24;

/// The plants of all axes in motion; streaming, with the same numbers for any block size.
pub struct Flight {
    axes: Vec<AxisFlight>,
    dt: f64,
    /// Only for a tilt.
    gravity: Option<f64>,
    /// Whether the state is the integral of the rate, not the rate.
    integrates: bool,
    next: u64,
}

/// What one axis of the plant does in a block, SI.
#[derive(Clone, Debug, Default)]
pub struct FlightBlock {
    /// The true angle, tilt or rate at every sample.
    pub state: Vec<f64>,
    /// g sin(tilt) with the accelerometer's errors.
    pub accelerometer: Option<Vec<f64>>,
    /// One list per aid; NaN at a sample without a measurement. Angles within half a turn.
    pub aids: Vec<Vec<f64>>,
}

struct AxisFlight {
    state: f64,
    accelerometer: Option<AxisGenerator>,
    aids: Vec<AidGenerator>,
}

struct AidGenerator {
    every: u64,
    std_dev: f64,
    white: ChaCha8Rng,
    drift: Option<Box<dyn SamplePath + Send>>,
}

impl Flight {
    /// Starts at zero. `None` for a sensor at rest. Errors: a custom plant or an attitude, an aid whose rate is no
    /// whole fraction of the sample rate, an accelerometer's line too fast for it.
    pub fn new(design: &Design, axes: usize, scenario: &Scenario) -> Result<Option<Flight>, SimulateError> {
        let dt = 1.0 / scenario.rate_hz;
        let (gravity, accelerometer) = match &design.plant {
            PlantEntry::Static => return Ok(None),
            PlantEntry::Custom(_) => {
                let message = "the design is a custom plant: simulate moves the plants angle, rate and vertical; leave \
                               the design out with \
                               `plant` static, or judge the filter with montecarlo";
                return Err(SimulateError(message.into()));
            }
            PlantEntry::Attitude(_) => {
                let message = "the design is the plant attitude: simulate moves the plants angle, rate and vertical; \
                               leave the design out with \
                               `plant` static";
                return Err(SimulateError(message.into()));
            }
            PlantEntry::Angle { .. } | PlantEntry::Rate { .. } => (None, None),
            PlantEntry::Vertical { accelerometer, gravity, .. } => {
                let errors = accelerometer.noise();
                errors.check_rate(dt).map_err(|e| SimulateError(format!("accelerometer: {e}")))?;
                (Some(gravity.as_ref().map_or(STANDARD_GRAVITY, |m| m.si())), Some(accelerometer))
            }
        };
        let aid = |number: u32, entry: &AidEntry, axis: u32| -> Result<AidGenerator, SimulateError> {
            let failed = |message: String| SimulateError(format!("aid '{}': {message}", entry.name));
            let id = |term: u32| StreamId { run: scenario.run, axis, term: AIDS + 2 * number + term };
            let drift = entry.gauss_markov.as_ref().map(|drift| {
                let (std_dev, correlation_time) = (drift.std_dev.si(), drift.correlation_time.si());
                Term::GaussMarkov { std_dev, correlation_time }.sample_path(dt, stream(scenario.seed, id(1)))
            });
            Ok(AidGenerator {
                every: entry.every(scenario.rate_hz).map_err(failed)? as u64,
                std_dev: entry.std_dev.si(),
                white: stream(scenario.seed, id(0)),
                drift,
            })
        };
        let axis = |number: u32| -> Result<AxisFlight, SimulateError> {
            let aids = (0..).zip(&design.aids).map(|(i, entry)| aid(i, entry, number)).collect::<Result<_, _>>()?;
            let accelerometer =
                accelerometer.map(|errors| AxisGenerator::new(errors, ACCELEROMETERS + number, scenario, dt));
            Ok(AxisFlight { state: 0.0, accelerometer, aids })
        };
        let axes = (0..axes as u32).map(axis).collect::<Result<_, _>>()?;
        let integrates = !matches!(design.plant, PlantEntry::Rate { .. });
        Ok(Some(Flight { axes, dt, gravity, integrates, next: 0 }))
    }

    /// Moves with the true rates of `blocks`, x⁺ = x + dt ω.
    pub fn next_block(&mut self, blocks: &[AxisBlock], out: &mut Vec<FlightBlock>) {
        out.resize_with(self.axes.len(), FlightBlock::default);
        let mut errors = AxisBlock::default();
        for ((axis, block), out) in self.axes.iter_mut().zip(blocks).zip(out.iter_mut()) {
            let n = block.true_rate.len();
            out.state.clear();
            for rate in &block.true_rate {
                out.state.push(if self.integrates { axis.state } else { *rate });
                axis.state += self.dt * rate;
            }
            out.accelerometer = axis.accelerometer.as_mut().zip(self.gravity).map(|(generator, gravity)| {
                errors.true_rate.clear();
                errors.true_rate.extend(out.state.iter().map(|tilt| gravity * tilt.sin()));
                generator.fill(n, &mut errors);
                errors.measured.clone()
            });
            out.aids.resize_with(axis.aids.len(), Vec::new);
            for (aid, values) in axis.aids.iter_mut().zip(&mut out.aids) {
                values.resize(n, 0.0);
                match &mut aid.drift {
                    Some(drift) => drift.fill(values),
                    None => values.fill(0.0),
                }
                for (step, (value, state)) in (self.next..).zip(values.iter_mut().zip(&out.state)) {
                    if step.is_multiple_of(aid.every) {
                        *value += state + aid.std_dev * normal(&mut aid.white);
                        if self.integrates {
                            *value -= std::f64::consts::TAU * (*value / std::f64::consts::TAU).round();
                        }
                    } else {
                        *value = f64::NAN;
                    }
                }
            }
        }
        self.next += blocks.first().map_or(0, |block| block.true_rate.len() as u64);
    }
}
