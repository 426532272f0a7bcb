//! Attitude from a gyro, an accelerometer and, optionally, a heading: a multiplicative error-state Kalman filter.
//!
//! The quaternion q turns vectors of the body into the earth frame (x east, y north, z up). Its error is a small
//! rotation θ in the earth frame, R = exp(\[θ\]×) R̂ (Lefferts, Markley, Shuster 1982; Markley 2003; Solà 2017,
//! section 7: the global error), beside the states of each gyro axis, a matrix C of scale factors and misalignments,
//! a constant bias of the accelerometer, the acceleration of the body and the disturbance and delay of the heading.
//! With g the measured rate, f the specific force and m the field:
//!
//! - θ' = −R̂ (δb + δC g + w), w of the gyro's white density and of `motion_density`·|g|, which stands for what
//!   scale factors leave;
//! - R̂ f = g e_z − θ × g e_z + a + R̂ b_f + white, of which the two horizontal parts are measurements. The
//!   acceleration a is not white: it is the derivative of a bounded velocity, v'' + 2 ω₀ v' + ω₀² v = white, so it
//!   has no power at zero frequency. Its size follows the vertical part, which attitude errors reach in second order
//!   only, as a witness;
//! - heading of R̂ m against north = θ_z + d + τ (rate about it) + white; d is a first-order Gauss-Markov process in
//!   the earth frame, whose size follows the parts of the field that heading does not touch (its strength along and
//!   across the vertical), and the inclination error that the dip carries over; τ is a constant delay. Gains of this
//!   measurement on inclination, scale, accelerometer and acceleration are zero; the covariance update holds for any
//!   gain;
//! - at rest, when gyro and accelerometer have stayed within their own noise for a window, g = b + white as well.
//!
//! An innovation beyond `outlier` sigma has its variance inflated until it is there.

mod covariance;
mod document;
mod mekf;
mod rest;

use nalgebra::DMatrix;

use crate::model::{LinearModel, Named};

pub use document::AttitudeDesign;
pub(super) use document::FORMAT;
pub use mekf::{Heading, Mekf, Row, Taken};

/// Everything the filter needs; SI.
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeModel {
    pub dt: f64,
    /// Errors of the gyro axes x, y, z: states with F, Q, x0, P0; H (one row) makes the drift; R is the white
    /// variance of a sample.
    pub gyro: [LinearModel; 3],
    /// Spread of each element of C.
    pub scale_std_dev: f64,
    /// Attitude noise per rate, 1/√Hz.
    pub motion_density: f64,
    /// m/s².
    pub gravity: f64,
    pub accelerometer: Accelerometer,
    pub acceleration: Acceleration,
    pub heading: Option<HeadingModel>,
    pub rest: RestModel,
    /// Sigmas.
    pub outlier: f64,
}

/// Noise of the accelerometer, the same in every direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accelerometer {
    /// Variance of a sample, (m/s²)².
    pub variance: f64,
    /// m/s².
    pub bias_std_dev: f64,
}

/// How the body accelerates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// Least size, m/s².
    pub std_dev: f64,
    /// Horizontal over vertical size.
    pub ratio: f64,
    /// ω₀, rad/s.
    pub frequency: f64,
    /// Averaging time of the witness, s.
    pub memory: f64,
}

/// A magnetometer or another heading.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadingModel {
    pub name: String,
    /// White, rad.
    pub std_dev: f64,
    /// Least size of the disturbance, rad.
    pub disturbance: f64,
    /// s.
    pub correlation_time: f64,
    /// Spread of the delay, s.
    pub delay_std_dev: f64,
    /// White spread of the delay from one measurement to the next, s.
    pub jitter: f64,
    /// Release time of the witness, s; its attack is a twentieth of it.
    pub memory: f64,
    /// The field of reference is a mean over at most this time, s.
    pub reference_time: f64,
}

/// When the body rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestModel {
    /// s.
    pub window: f64,
    /// Greatest standard deviations within the window.
    pub gyro: [f64; 3],
    pub accelerometer: f64,
}

/// Where the states are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    /// First state of each gyro axis.
    pub(crate) gyro: [usize; 3],
    /// Row by row.
    pub(crate) scale: usize,
    pub(crate) force_bias: usize,
    /// Velocity and acceleration towards east, then north.
    pub(crate) motion: usize,
    /// Disturbance and delay.
    pub(crate) heading: usize,
    pub(crate) states: usize,
}

impl AttitudeModel {
    pub(crate) fn layout(&self) -> Layout {
        let mut at = 3;
        let gyro = std::array::from_fn(|i| {
            let first = at;
            at += self.gyro[i].states.len();
            first
        });
        let (force_bias, motion, heading) = (at + 9, at + 12, at + 16);
        let states = heading + if self.heading.is_some() { 2 } else { 0 };
        Layout { gyro, scale: at, force_bias, motion, heading, states }
    }

    /// Names and units of the error states, in their order; `axes` are those of the gyro.
    pub fn states(&self, axes: [&str; 3]) -> Vec<Named> {
        let named = |name: String, unit: &str| Named { name, unit: unit.to_owned() };
        let directions = ["x", "y", "z"];
        let mut states: Vec<Named> =
            ["east", "north", "up"].iter().map(|d| named(format!("rotation.{d}"), "rad")).collect();
        for (axis, model) in axes.iter().zip(&self.gyro) {
            states.extend(model.states.iter().map(|s| named(format!("{axis}.{}", s.name), &s.unit)));
        }
        for row in directions {
            states.extend(directions.iter().map(|column| named(format!("scale.{row}{column}"), "1")));
        }
        states.extend(directions.iter().map(|d| named(format!("accelerometer.bias.{d}"), "m/s^2")));
        for direction in ["east", "north"] {
            states.push(named(format!("velocity.{direction}"), "m/s"));
            states.push(named(format!("acceleration.{direction}"), "m/s^2"));
        }
        if let Some(heading) = &self.heading {
            states.push(named(format!("{}.gauss_markov", heading.name), "rad"));
            states.push(named(format!("{}.delay", heading.name), "s"));
        }
        states
    }
}

impl Acceleration {
    /// Transition of (v, a) over `dt`, and the stationary covariance for an acceleration of size 1: diag(1/ω₀², 1).
    ///
    /// e^{A dt} of A = [[0, 1], [−ω₀², −2ω₀]] = e^{−ω₀ dt} (I + (A + ω₀ I) dt).
    pub(crate) fn process(&self, dt: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let w = self.frequency;
        let decay = (-w * dt).exp();
        let f = DMatrix::from_row_slice(2, 2, &[1.0 + w * dt, dt, -w * w * dt, 1.0 - w * dt]) * decay;
        (f, DMatrix::from_row_slice(2, 2, &[1.0 / (w * w), 0.0, 0.0, 1.0]))
    }
}
