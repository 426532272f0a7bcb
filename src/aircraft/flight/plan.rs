//! A flight document with everything it names, in SI: what all runs of it share.

use std::path::Path;

use nalgebra::{DMatrix, DVector};

use super::FlightError;
use super::autopilot::{Law, Reference, StateFeedback};
use super::commands::{self, Commands};
use super::document::{EarthEntry, FlightDocument, GustEntry, LqrEntry, WindEntry};
use super::earth::Earth;
use super::motion::{State, World};
use super::sensors::{Errors, three_axes};
use super::start::{self, Start};
use super::surfaces::CONTROLS;
use super::vector::{Vector, dot, matrix, times};
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::linear::{LinearModel, LinearModels};
use crate::aircraft::atmosphere::discrete::DiscreteGust;
use crate::aircraft::atmosphere::dryden::{Dryden, Intensity};
use crate::aircraft::atmosphere::{AirError, exceedance, standard};
use crate::aircraft::control::regulator::regulator;
use crate::params::{Measured, Params};
use crate::units::Quantity;

/// Longest step of the integration when none is asked for, s: at 10 ms the error of 10 s is 1e-7 m, and gusts are
/// followed to 0.3 %.
pub const STEP: f64 = 0.0025;
/// Samples per second without any sensor or autopilot, Hz.
const RATE: f64 = 100.0;
/// A time is a whole number of intervals if it is so to this part.
const WHOLE: f64 = 1e-9;

/// Times of a flight, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    pub duration: f64,
    /// Between rows; every sample when absent.
    pub every: Option<f64>,
    /// Longest step of the integration; [`STEP`] when absent.
    pub step: Option<f64>,
}

/// The grid that follows from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Samples per second.
    pub rate: f64,
    pub samples: u64,
    /// Samples from one row to the next.
    pub row: u64,
    /// Steps of the integration in a sample.
    pub steps: u64,
}

impl Grid {
    pub(super) fn step(&self) -> f64 {
        1.0 / (self.rate * self.steps as f64)
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct AutopilotPlan {
    pub law: Law,
    pub reference: Reference,
    /// Samples from one command to the next.
    pub every: u64,
    /// s.
    pub delay: f64,
    pub filter: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct SensorPlan {
    pub gyro: Option<Params>,
    pub accelerometer: Option<Params>,
    /// From the centre of gravity, body axes, m.
    pub accelerometer_position: Vector,
    pub attitude: Option<Errors>,
    pub airspeed: Option<Errors>,
    pub airspeed_position: Vector,
    pub altitude: Option<Errors>,
    pub gnss_position: Option<Errors>,
    pub gnss_velocity: Option<Errors>,
    pub gnss_antenna: Vector,
}

/// All of it; one plan serves many runs at once.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(super) airplane: Airplane,
    pub(super) earth: Earth,
    /// Its height, m.
    pub(super) ground: f64,
    pub(super) wind: Vector,
    pub(super) start: State,
    pub(super) commands: Commands,
    pub(super) dryden: Vec<Dryden>,
    pub(super) discrete: Vec<DiscreteGust>,
    pub(super) sensors: SensorPlan,
    pub(super) autopilot: Option<AutopilotPlan>,
    pub(super) grid: Grid,
}

fn si(measured: &Option<Measured>) -> f64 {
    measured.as_ref().map_or(0.0, Measured::si)
}

fn at(key: &str) -> impl Fn(String) -> FlightError {
    let key = key.to_string();
    move |message| FlightError(format!("{key}: {message}"))
}

impl Plan {
    /// Reads what the document names from `folder` and checks that it fits together. Errors: one line with the key.
    pub fn new(document: &FlightDocument, folder: &Path, times: &Times) -> Result<Plan, FlightError> {
        let airplane = start::airplane(document, folder)?;
        let earth = match document.earth {
            EarthEntry::Flat => Earth::Flat,
            EarthEntry::Wgs84(_) => Earth::Wgs84,
        };
        let wind =
            document.wind.as_ref().map_or([0.0; 3], |WindEntry { north, east, down }| [north, east, down].map(si));
        let Start { state, controls, reference, altitude } = start::start(document, &airplane, earth, wind)?;
        standard::at(altitude).map_err(|e| at("altitude")(e.to_string()))?;
        let ground = si(&document.ground);
        if altitude < ground {
            return Err(FlightError(format!(
                "altitude: {altitude} m is below the ground at {ground} m; start higher, or give the ground its height"
            )));
        }
        let world = World::new(&airplane, earth, wind);
        let through_air = world.through_air(&state);
        let airspeed = dot(through_air, through_air).sqrt();
        let (dryden, discrete) = gusts(document, altitude - ground, airspeed, airplane.size.span)?;
        let sensors = &document.sensors;
        let read = |key: &str, linked: &Option<super::document::Linked>, quantity: Quantity, what: &str| {
            let key = format!("sensors.{key}");
            let Some(linked) = linked else { return Ok(None) };
            let (params, shown) = linked.params(&key, folder).map_err(FlightError)?;
            three_axes(params, quantity.dimension(), what)
                .map(Some)
                .map_err(|e| FlightError(format!("{key}: {shown}: {e}")))
        };
        let gyro = read("gyro", &sensors.gyro, Quantity::AngularRate, "a gyro")?;
        let accelerometer = read("accelerometer", &sensors.accelerometer, Quantity::SpecificForce, "an accelerometer")?;
        let of_params = [&gyro, &accelerometer].into_iter().flatten().map(|params| params.sample_rate_hz).next();
        let of_autopilot = document.autopilot.as_ref().map(|autopilot| autopilot.rate.si());
        let given = sensors.rate.as_ref().map(Measured::si).or(of_params).or(of_autopilot);
        let any = gyro.is_some()
            || accelerometer.is_some()
            || [&sensors.attitude, &sensors.airspeed, &sensors.altitude].iter().any(|e| e.is_some())
            || sensors.gnss.is_some();
        let grid = grid(times, given.or(any.then_some(RATE)))?;
        let errors = |key: &str, entry: &Option<super::document::ErrorEntry>, own: Option<f64>| {
            let errors = entry.as_ref().map(|entry| Errors::new(entry, own, grid.rate));
            errors.transpose().map_err(at(&format!("sensors.{key}")))
        };
        let gnss = sensors.gnss.as_ref();
        let own = gnss.and_then(|gnss| gnss.rate.as_ref()).map(Measured::si);
        let sensors = SensorPlan {
            attitude: errors("attitude", &sensors.attitude, None)?,
            airspeed: errors("airspeed", &sensors.airspeed, None)?,
            altitude: errors("altitude", &sensors.altitude, None)?,
            gnss_position: errors("gnss.position", &gnss.and_then(|g| g.position.clone()), own)?,
            gnss_velocity: errors("gnss.velocity", &gnss.and_then(|g| g.velocity.clone()), own)?,
            gyro,
            accelerometer,
            accelerometer_position: airplane.position("accelerometer"),
            airspeed_position: airplane.position("airspeed"),
            gnss_antenna: airplane.position("gnss"),
        };
        let commands = commands::read(&document.controls, folder, &airplane, controls, times.duration)?;
        let [elevator, aileron, rudder, _] = commands.fixed;
        let reference = Reference { surfaces: [elevator, aileron, rudder], ..reference };
        let autopilot = autopilot(document, &airplane, reference, &grid, sensors.attitude.is_some())?;
        if autopilot.is_some() && commands.rows.iter().any(|(_, row)| row[..3] != commands.fixed[..3]) {
            return Err(FlightError(
                "controls.file: moves a surface that the autopilot moves; leave one of them out".into(),
            ));
        }
        start::check_travel(&airplane, &commands)?;
        let plan =
            Plan { airplane, earth, ground, wind, start: state, commands, dryden, discrete, sensors, autopilot, grid };
        plan.check_step()?;
        Ok(plan)
    }

    /// The gyro without its constant bias: what it does is an offset, which needs no flights.
    #[must_use]
    pub fn without_bias(mut self) -> Plan {
        self.sensors.gyro.iter_mut().flat_map(|gyro| &mut gyro.axes).for_each(|axis| axis.bias = None);
        self
    }

    pub(super) fn world(&self) -> World<'_> {
        World::new(&self.airplane, self.earth, self.wind)
    }

    /// Seconds between two steps of the integration.
    pub fn step(&self) -> f64 {
        self.grid.step()
    }

    /// Seconds from the start to the last row.
    pub fn duration(&self) -> f64 {
        self.grid.samples as f64 / self.grid.rate
    }

    pub(super) fn initial_commands(&self) -> [f64; CONTROLS] {
        self.commands.at_start()
    }
}

pub(super) fn gusts(
    document: &FlightDocument,
    above_ground: f64,
    speed: f64,
    span: f64,
) -> Result<(Vec<Dryden>, Vec<DiscreteGust>), FlightError> {
    let (mut dryden, mut discrete) = (Vec::new(), Vec::new());
    for (i, gust) in document.gusts.iter().enumerate() {
        match gust {
            GustEntry::Dryden { specification, wind_at_20ft, std_dev, exceedance, height, airspeed } => {
                let refused = |e: AirError| at(&format!("gusts[{i}]"))(e.to_string());
                let height = height.as_ref().map_or(above_ground, Measured::si);
                let of_chart = |probability| exceedance::std_dev(probability, height).map_err(refused);
                let intensity = Intensity {
                    wind_at_20ft: wind_at_20ft.as_ref().map(Measured::si),
                    std_dev_aloft: std_dev.as_ref().map(|m| Ok(m.si())).or(exceedance.map(of_chart)).transpose()?,
                };
                let speed = airspeed.as_ref().map_or(speed, Measured::si);
                dryden.push(Dryden::new(*specification, height, intensity, speed, span).map_err(refused)?);
            }
            GustEntry::Discrete { form, length, u, v, w, start } => discrete.push(DiscreteGust {
                form: *form,
                velocity: [u, v, w].map(si),
                length: length.si(),
                start: si(start),
            }),
        }
    }
    Ok((dryden, discrete))
}

/// `count` if a number is whole to [`WHOLE`].
fn whole(number: f64) -> Option<u64> {
    let count = number.round();
    (count >= 1.0 && (number / count - 1.0).abs() <= WHOLE).then_some(count as u64)
}

/// `given`: samples per second that sensors or the autopilot ask for.
fn grid(times: &Times, given: Option<f64>) -> Result<Grid, FlightError> {
    let positive = |name: &str, time: f64| {
        if time.is_finite() && time > 0.0 {
            Ok(())
        } else {
            Err(FlightError(format!("{name} {time} s: expected a positive time")))
        }
    };
    positive("duration", times.duration)?;
    times.every.map_or(Ok(()), |every| positive("every", every))?;
    times.step.map_or(Ok(()), |step| positive("step", step))?;
    // without sensors the rows alone ask for samples
    let free = times.every.filter(|every| whole(times.duration / every).is_some()).map_or(RATE, |every| 1.0 / every);
    let rate = given.unwrap_or(free);
    let Some(samples) = whole(times.duration * rate) else {
        return Err(FlightError(format!(
            "duration {} s is no whole number of samples at {rate} Hz; take a multiple of {} s",
            times.duration,
            1.0 / rate
        )));
    };
    let every = times.every.unwrap_or(1.0 / rate);
    let Some(row) = whole(every * rate) else {
        return Err(FlightError(format!(
            "every {every} s is no whole number of samples at {rate} Hz; take a multiple of {} s",
            1.0 / rate
        )));
    };
    let steps = (1.0 / (rate * times.step.unwrap_or(STEP)) * (1.0 - WHOLE)).ceil().max(1.0);
    Ok(Grid { rate, samples, row, steps: steps as u64 })
}

fn autopilot(
    document: &FlightDocument,
    airplane: &Airplane,
    mut reference: Reference,
    grid: &Grid,
    measured: bool,
) -> Result<Option<AutopilotPlan>, FlightError> {
    let Some(entry) = &document.autopilot else { return Ok(None) };
    let rate = entry.rate.si();
    let every = whole(grid.rate / rate).ok_or_else(|| {
        FlightError(format!("autopilot.rate: {rate} Hz is no whole fraction of the {} Hz of the sensors", grid.rate))
    })?;
    if let Some(bank) = &entry.bank {
        reference.angles[0] = bank.si();
    }
    if let Some(pitch) = &entry.pitch {
        reference.angles[1] = pitch.si();
    }
    let law = match (&entry.gains, &entry.lqr) {
        (Some(gains), _) => Law::Gains(gains.si()),
        (None, Some(lqr)) => Law::Regulator(state_feedback(lqr, document, airplane).map_err(at("autopilot.lqr"))?),
        (None, None) => return Err(FlightError("autopilot: expected one of gains, lqr and rule".into())),
    };
    Ok(Some(AutopilotPlan {
        law,
        reference,
        every,
        delay: entry.delay as f64 / rate,
        filter: measured.then(|| entry.attitude_filter_s()),
    }))
}

/// Optimal gains about the trim of the document.
fn state_feedback(lqr: &LqrEntry, document: &FlightDocument, airplane: &Airplane) -> Result<StateFeedback, String> {
    let entry = document.trim.as_ref().ok_or("needs a trim, about which its gains are made; give trim too")?;
    let trim = start::trim(entry, airplane).map_err(|e| e.to_string())?;
    let [along, across] = optimal_gains(lqr, &airplane.linear(&trim))?;
    let row = |gain: &DMatrix<f64>, i: usize| std::array::from_fn(|j| gain[(i, j)]);
    Ok(StateFeedback { along: row(&along, 0), across: [row(&across, 0), row(&across, 1)], velocity: trim.velocity })
}

/// Of the longitudinal and of the lateral states. Errors: there are none for these weights.
pub(super) fn optimal_gains(lqr: &LqrEntry, models: &LinearModels) -> Result<[DMatrix<f64>; 2], String> {
    let diagonal = |weights: &[f64]| DMatrix::from_diagonal(&DVector::from_column_slice(weights));
    let gain = |model: &LinearModel, inputs: &[&str], states: &[f64; 4], weights: &[f64]| {
        let columns: Vec<usize> = (0..model.inputs.len()).filter(|i| inputs.contains(&model.inputs[*i].0)).collect();
        regulator(&model.a, &model.b.select_columns(&columns), &diagonal(states), &diagonal(weights))
            .map(|found| found.gain)
            .map_err(|e| format!("no optimal gains of the {} motion: {e}; give other weights", model.name))
    };
    let (x, y) = (&lqr.longitudinal, &lqr.lateral);
    Ok([
        gain(&models.longitudinal, &["elevator"], &x.states, &[x.elevator])?,
        gain(&models.lateral, &["aileron", "rudder"], &y.states, &[y.aileron, y.rudder])?,
    ])
}

/// Where a point of the airplane is and how it moves, north, east, down from the start.
pub(super) fn point(plan: &Plan, x: &State, rate: Vector, arm: Vector) -> (Vector, Vector) {
    let c = matrix(super::motion::attitude(x));
    let r = super::motion::position(x);
    let v = super::vector::plus(super::motion::velocity(x), super::vector::cross(rate, arm));
    (super::vector::plus(r, times(&c, arm)), times(&plan.earth.local(r), times(&c, v)))
}
