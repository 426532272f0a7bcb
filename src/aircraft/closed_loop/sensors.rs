//! Errors of the gyros and of the attitude reference as states and noise at the samples of the loop.

use super::LoopError;
use super::half::Half;
use crate::aircraft::flight::Setting;
use crate::aircraft::flight::setting::Reference;
use crate::model::{InitialBias, LinearModel, sensor_errors};
use crate::noise::{Kind, NoiseModel, Term};
use crate::params::{AxisParams, Measured, Params};
use crate::units::Quantity;

/// What an error that never settles is judged over: a random walk is taken as a Gauss-Markov process of the same
/// driving noise and this correlation time, flicker up to it, s. An hour is a flight.
pub const HORIZON: f64 = 3600.0;
/// Density of the walk by which a filter of constant gain follows a constant bias, 0.0005 deg/s/√s: 0.03 deg/s in an
/// hour, a tenth of what a warming gyro does.
pub const BIAS_WALK: f64 = 0.0005 * std::f64::consts::PI / 180.0;
/// Spread of the bias before the first measurement where the parameters say none, rad/s: 1 deg/s, of a poor gyro.
const UNKNOWN_BIAS: f64 = std::f64::consts::PI / 180.0;

/// One gyro axis.
#[derive(Clone, Debug)]
pub struct Gyro {
    /// e_k = H s_k + w_k, s⁺ = F s + v: states of everything but white noise and the constant bias; none where the gyro
    /// has white noise only.
    pub errors: Option<LinearModel>,
    /// Standard deviation of w, rad/s.
    pub white: f64,
    /// Constant, rad/s.
    pub bias: f64,
    /// Of the bias from one power-up to the next, rad/s.
    pub spread: f64,
    /// Of the strongest line, Hz.
    pub line: Option<f64>,
}

impl Gyro {
    fn new(axis: &AxisParams, interval: f64) -> Result<Gyro, LoopError> {
        let noise = settled(&axis.noise());
        let si = |m: &Option<Measured>| m.as_ref().map(Measured::si);
        let bias = si(&axis.bias).unwrap_or(0.0);
        let spread = si(&axis.turn_on_bias).or(Some(bias.abs()).filter(|b| *b > 0.0)).unwrap_or(UNKNOWN_BIAS);
        let place = |e: crate::model::ModelError| LoopError(format!("sensors.gyro: axis {}: {e}", axis.name));
        let errors = sensor_errors(Quantity::AngularRate, &noise, None, interval, HORIZON);
        let white = noise.white_density() / interval.sqrt();
        let line = noise.terms.iter().filter_map(|term| match term {
            Term::Oscillation { std_dev, frequency_hz, .. } => Some((*std_dev, *frequency_hz)),
            _ => None,
        });
        let line = line.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, frequency)| frequency);
        let errors = if noise.terms.iter().all(|term| term.kind() == Kind::White) {
            noise.check_rate(interval).map_err(|e| place(e.into()))?;
            None
        } else {
            Some(errors.map_err(place)?)
        };
        Ok(Gyro { errors, white, bias, spread, line })
    }

    /// Whether a state of the errors is drift, which a filter takes off, or noise.
    pub fn is_drift(&self, state: usize) -> bool {
        let Some(errors) = &self.errors else { return false };
        Kind::of_state(&errors.states[state].name).is_none_or(Kind::is_drift)
    }

    pub fn states(&self) -> usize {
        self.errors.as_ref().map_or(0, |errors| errors.states.len())
    }
}

/// The same noise with a law that stands still over [`HORIZON`]; a ramp is a bias that changes and left to it.
pub(super) fn settled(noise: &NoiseModel) -> NoiseModel {
    let one = |term: &Term| match *term {
        Term::RateRamp { .. } => None,
        Term::RateRandomWalk { density } => {
            Some(Term::GaussMarkov { std_dev: density * (0.5 * HORIZON).sqrt(), correlation_time: HORIZON })
        }
        other => Some(other),
    };
    NoiseModel { terms: noise.terms.iter().filter_map(one).collect() }
}

/// The gyros of a half, in the order of its rates. Errors: parameters that do not fit the rate; none at all.
pub fn gyros(params: &Params, half: Half, interval: f64) -> Result<Vec<Gyro>, LoopError> {
    half.gyros().iter().map(|axis| Gyro::new(&params.axes[*axis], interval)).collect()
}

/// The model of one gyro with its bias, as a filter has it: the states of [`Gyro`] behind a constant that walks.
/// `walk` in rad/s/√s. Errors: no white noise.
pub fn with_bias(axis: &AxisParams, gyro: &Gyro, walk: f64, interval: f64) -> Result<LinearModel, LoopError> {
    let bias = InitialBias { mean: 0.0, std_dev: gyro.spread };
    let mut model = sensor_errors(Quantity::AngularRate, &settled(&axis.noise()), Some(bias), interval, HORIZON)
        .map_err(|e| LoopError(format!("sensors.gyro: axis {}: {e}", axis.name)))?;
    // the bias is the first state
    model.q[(0, 0)] += walk * walk * interval;
    Ok(model)
}

/// All that is measured in one half.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// Without a gyro the rates are measured truly.
    pub gyros: Vec<Gyro>,
    /// Without a reference the angle is measured truly.
    pub reference: Option<Reference>,
}

impl Sensors {
    pub fn new(setting: &Setting, half: Half) -> Result<Sensors, LoopError> {
        let gyros = match &setting.gyro {
            Some(params) => gyros(params, half, setting.interval())?,
            None => Vec::new(),
        };
        Ok(Sensors { gyros, reference: setting.reference })
    }
}
