//! What a linear analysis of the loop needs of a flight document, in SI.

use std::path::Path;

use nalgebra::DMatrix;

use super::autopilot::RateGains;
use super::document::FlightDocument;
use super::plan::{gusts, optimal_gains};
use super::sensors::{Errors, three_axes};
use super::{FlightError, start};
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::linear::LinearModels;
use crate::aircraft::airframe::trim::{Trim, TrimRequest};
use crate::aircraft::atmosphere::discrete::DiscreteGust;
use crate::aircraft::atmosphere::dryden::Dryden;
use crate::params::{Measured, Params};
use crate::units::{Quantity, digits};

/// Gyros of small vehicles give up to 32 kHz; answers in time are followed sample by sample.
const FASTEST: f64 = 40e3;
/// Two numbers of samples per second are one if they are so to this part: what decimal numbers leave.
const SAME_RATE: f64 = 1e-9;

pub fn same_rate(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() <= SAME_RATE
}

/// By what the surfaces move.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    Gains(RateGains),
    /// K of a regulator, of the longitudinal and of the lateral states.
    Regulator([DMatrix<f64>; 2]),
}

/// Errors of the attitude reference, per measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Standard deviation of one measurement, rad.
    pub white: f64,
    /// Standard deviation (rad) and correlation time (s).
    pub drift: Option<(f64, f64)>,
}

/// An airplane in steady flight with its sensors and its autopilot.
#[derive(Clone, Debug)]
pub struct Setting {
    pub airplane: Airplane,
    pub request: TrimRequest,
    pub trim: Trim,
    pub models: LinearModels,
    /// Above ground, m.
    pub height: f64,
    pub dryden: Vec<Dryden>,
    /// Wind at 20 ft of the first of them, m/s.
    pub wind_at_20ft: Option<f64>,
    pub discrete: Vec<DiscreteGust>,
    /// Three axes.
    pub gyro: Option<Params>,
    pub reference: Option<Reference>,
    /// Samples per second.
    pub rate: f64,
    /// Samples from the measurement to the command at the servo.
    pub delay: u64,
    pub control: Control,
    /// Time constant of the complementary filter, s.
    pub attitude_filter: f64,
}

impl Setting {
    /// Reads what the document names from `folder`. Errors: one line with the key; no trim, no autopilot, sensors of
    /// another rate than the autopilot's.
    pub fn new(document: &FlightDocument, folder: &Path) -> Result<Setting, FlightError> {
        let error = |key: &str, message: &str| FlightError(format!("{key}: {message}"));
        let airplane = start::airplane(document, folder)?;
        let entry = document.trim.as_ref().ok_or_else(|| {
            error("trim", "missing; the loop is judged about a steady flight: give airspeed and altitude")
        })?;
        let request = entry.request();
        let trim = start::trim(entry, &airplane)?;
        let autopilot = document
            .autopilot
            .as_ref()
            .ok_or_else(|| error("autopilot", "missing; there is no loop without it: give rate and gains"))?;
        let rate = autopilot.rate.si();
        if rate > FASTEST {
            let found = digits(rate);
            return Err(FlightError(format!(
                "autopilot.rate: found {found} Hz; expected at most {} Hz: no gyro is read faster",
                digits(FASTEST)
            )));
        }
        let height = request.altitude - document.ground.as_ref().map_or(0.0, Measured::si);
        let (dryden, discrete) = gusts(document, height, request.airspeed, airplane.size.span)?;
        let sensors = &document.sensors;
        let gyro = match &sensors.gyro {
            None => None,
            Some(linked) => Some(gyro(linked, "sensors.gyro", folder)?),
        };
        let sampled = sensors.rate.as_ref().map(Measured::si);
        let found = match (sampled, &gyro) {
            (Some(found), _) => Some(("sensors.rate", found)),
            (None, Some(gyro)) => Some(("sensors.gyro", gyro.sample_rate_hz)),
            (None, None) => None,
        };
        if let Some((key, found)) = found.filter(|(_, found)| !same_rate(*found, rate)) {
            return Err(FlightError(format!(
                "{key}: {} Hz, the autopilot has {} Hz; the loop is judged at one rate: give sensors.rate and \
                 autopilot.rate the same value",
                digits(found),
                digits(rate)
            )));
        }
        let reference = match &sensors.attitude {
            None => None,
            Some(entry) => {
                let errors = Errors::new(entry, None, rate).map_err(|e| error("sensors.attitude", &e))?;
                if errors.every != 1 {
                    return Err(FlightError(format!(
                        "sensors.attitude: measured every {} samples; the loop is judged at one rate: give it the {} \
                         Hz of the autopilot with the same density",
                        errors.every,
                        digits(rate)
                    )));
                }
                Some(Reference { white: errors.white, drift: errors.drift })
            }
        };
        let control = match (&autopilot.gains, &autopilot.lqr) {
            (Some(gains), _) => Control::Gains(gains.si()),
            (None, Some(lqr)) => {
                let gains = optimal_gains(lqr, &airplane.linear(&trim)).map_err(|e| error("autopilot.lqr", &e))?;
                Control::Regulator(gains)
            }
            (None, None) => return Err(error("autopilot", "expected one of gains, lqr and rule")),
        };
        Ok(Setting {
            models: airplane.linear(&trim),
            airplane,
            request,
            trim,
            height,
            wind_at_20ft: document.wind_at_20ft(),
            dryden,
            discrete,
            gyro,
            reference,
            rate,
            delay: autopilot.delay,
            control,
            attitude_filter: autopilot.attitude_filter_s(),
        })
    }

    /// s.
    pub fn interval(&self) -> f64 {
        1.0 / self.rate
    }

    /// Surfaces that do more, or less, than modelled.
    pub fn scale_surfaces(&mut self, factor: f64) {
        for model in [&mut self.models.longitudinal, &mut self.models.lateral] {
            for (j, (name, _)) in model.inputs.iter().enumerate() {
                if ["elevator", "aileron", "rudder"].contains(name) {
                    model.b.column_mut(j).scale_mut(factor);
                }
            }
        }
    }

    /// The same airplane, sensors and autopilot at another airspeed (m/s), in turbulence of another wind at 20 ft
    /// (m/s); intensity goes with that wind, scale lengths stay (MIL-F-8785C, below 1000 ft). Errors: it does not
    /// fly there, or there is no turbulence with a wind at 20 ft.
    pub fn designed_for(&self, airspeed: Option<f64>, wind_at_20ft: Option<f64>) -> Result<Setting, FlightError> {
        let mut other = self.clone();
        if let Some(speed) = airspeed {
            other.request.airspeed = speed;
            other.trim = self.airplane.trim(&other.request).map_err(|e| FlightError(format!(".airspeed: {e}")))?;
            other.models = self.airplane.linear(&other.trim);
            other.dryden.iter_mut().for_each(|dryden| dryden.airspeed = speed);
        }
        if let Some(wind) = wind_at_20ft {
            let own = self.wind_at_20ft.filter(|own| *own > 0.0).ok_or_else(|| {
                FlightError(".wind_at_20ft: the flight has no turbulence by a wind at 20 ft; give gusts one".into())
            })?;
            other.dryden.iter_mut().for_each(|dryden| dryden.std_devs = dryden.std_devs.map(|s| s * wind / own));
            other.wind_at_20ft = Some(wind);
        }
        Ok(other)
    }
}

/// Parameters of a gyro on three axes. Errors: with `key`.
pub fn gyro(linked: &super::document::Linked, key: &str, folder: &Path) -> Result<Params, FlightError> {
    let (params, shown) = linked.params(key, folder).map_err(FlightError)?;
    three_axes(params, Quantity::AngularRate.dimension(), "a gyro")
        .map_err(|e| FlightError(format!("{key}: {shown}: {e}")))
}
