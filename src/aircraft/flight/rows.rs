//! The columns of a flight: truth, controls, gusts, measurements, and the truth of the inertial sensors.

use super::FlightError;
use super::commands::SURFACES;
use super::earth::{Earth, Geodetic};
use super::motion::{Instant, State, attitude, inertial_rate, position, velocity};
use super::plan::{Plan, point};
use super::sensors::{Channel, Errors, Inertial, InertialErrors};
use super::streams;
use super::surfaces::Surfaces;
use super::vector::{Vector, back, cross, dot, plus, to_euler};
use crate::aircraft::atmosphere::{Gust, standard};

const AXES: [&str; 3] = ["x", "y", "z"];
const DIRECTIONS: [&str; 3] = ["north", "east", "down"];
const ANGLES: [&str; 3] = ["phi", "theta", "psi"];
const BODY: [(&str, &str); 6] =
    [("u", "m/s"), ("v", "m/s"), ("w", "m/s"), ("p", "rad/s"), ("q", "rad/s"), ("r", "rad/s")];

/// What the sensors showed at one sample, SI; NaN where they did not measure. The gyro shows the truth where there is
/// none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// The true attitude.
    pub euler: Vector,
    pub gyro: Vector,
    pub attitude: Vector,
    accelerometer: Vector,
    airspeed: f64,
    altitude: f64,
    /// North, east, down, or latitude, longitude (rad), height.
    gnss_position: Vector,
    gnss_velocity: Vector,
    /// Of gyro and accelerometer.
    errors: [InertialErrors; 2],
    /// True specific force at the accelerometer.
    specific_force: Vector,
}

/// The sensors of one run.
pub(super) struct Measurements {
    gyro: Option<Inertial>,
    accelerometer: Option<Inertial>,
    attitude: Vec<Channel>,
    airspeed: Option<Channel>,
    altitude: Option<Channel>,
    gnss_position: Vec<Channel>,
    gnss_velocity: Vec<Channel>,
}

impl Measurements {
    pub(super) fn new(plan: &Plan, seed: u64, run: u64) -> Result<Measurements, FlightError> {
        let rate = plan.grid.rate;
        let inertial = |params: &Option<crate::params::Params>, first: u32, what: &str| {
            let sensor = params.as_ref().map(|p| Inertial::new(p, first, rate, plan.grid.samples + 1, seed, run));
            sensor.transpose().map_err(|e| FlightError(format!("sensors.{what}: {e}")))
        };
        // the numbers of channels belong to the address of their streams and stay, whatever sensors there are
        let channel = |errors: Errors, number: u32| Channel::new(errors, rate, (seed, run, number));
        let three = |errors: Option<Errors>, first: u32| -> Vec<Channel> {
            errors.map_or(Vec::new(), |errors| (first..first + 3).map(|i| channel(errors, i)).collect())
        };
        let sensors = &plan.sensors;
        Ok(Measurements {
            gyro: inertial(&sensors.gyro, streams::GYRO, "gyro")?,
            accelerometer: inertial(&sensors.accelerometer, streams::ACCELEROMETER, "accelerometer")?,
            attitude: three(sensors.attitude, 0),
            airspeed: sensors.airspeed.map(|errors| channel(errors, 3)),
            altitude: sensors.altitude.map(|errors| channel(errors, 4)),
            gnss_position: three(sensors.gnss_position, 5),
            gnss_velocity: three(sensors.gnss_velocity, 8),
        })
    }

    /// One sample further.
    pub(super) fn take(&mut self, plan: &Plan, sample: u64, x: &State, instant: &Instant) -> Measured {
        let gyro = self.gyro.as_mut().map(Inertial::next).unwrap_or_default();
        let accelerometer = self.accelerometer.as_mut().map(Inertial::next).unwrap_or_default();
        let rate = inertial_rate(x);
        let arm = plan.sensors.accelerometer_position;
        let turning = [instant.derivative[10], instant.derivative[11], instant.derivative[12]];
        let specific_force = plus(instant.specific_force, plus(cross(turning, arm), cross(rate, cross(rate, arm))));
        let three = |channels: &mut [Channel]| -> Vector {
            std::array::from_fn(|i| channels.get_mut(i).map_or(0.0, |channel| channel.error(sample)))
        };
        let euler = to_euler(&plan.earth.body_to_local(position(x), attitude(x)));
        let angles = plus(euler, three(&mut self.attitude));
        let (way, speed) = (three(&mut self.gnss_position), three(&mut self.gnss_velocity));
        let gnss = !(self.gnss_position.is_empty() && self.gnss_velocity.is_empty());
        let (antenna, antenna_velocity) =
            if gnss { point(plan, x, instant.rate, plan.sensors.gnss_antenna) } else { ([0.0; 3], [0.0; 3]) };
        Measured {
            euler,
            gyro: plus(rate, gyro.all),
            attitude: angles,
            accelerometer: plus(specific_force, accelerometer.all),
            airspeed: airspeed(instant, plan.sensors.airspeed_position)
                + self.airspeed.as_mut().map_or(0.0, |channel| channel.error(sample)),
            altitude: standard::geopotential(instant.height)
                + self.altitude.as_mut().map_or(0.0, |channel| channel.error(sample)),
            gnss_position: if gnss {
                place(plan.earth, plus(antenna, back(&plan.earth.local(antenna), way)))
            } else {
                antenna
            },
            gnss_velocity: plus(antenna_velocity, speed),
            errors: [gyro, accelerometer],
            specific_force,
        }
    }
}

/// Of a point of the airplane: the air turns with its gust like a rigid body.
fn airspeed(instant: &Instant, arm: Vector) -> f64 {
    let v = plus(instant.air.velocity, cross(instant.air.rate, arm));
    dot(v, v).sqrt()
}

/// North, east, down, or latitude, longitude, height.
fn place(earth: Earth, r: Vector) -> Vector {
    match earth {
        Earth::Flat => r,
        Earth::Wgs84 => {
            let Geodetic { latitude, longitude, height } = Geodetic::from_ecef(r);
            [latitude, longitude, height]
        }
    }
}

/// The same as columns show it: degrees instead of radians.
fn shown(earth: Earth, place: Vector) -> Vector {
    match earth {
        Earth::Flat => place,
        Earth::Wgs84 => [place[0].to_degrees(), place[1].to_degrees(), place[2]],
    }
}

/// Names and units of the columns.
pub(super) fn header(plan: &Plan) -> Vec<String> {
    let mut names = vec!["time (s)".to_string()];
    let places = |prefix: &str| match plan.earth {
        Earth::Flat => DIRECTIONS.map(|name| format!("{prefix}{name} (m)")),
        Earth::Wgs84 => [("latitude", "deg"), ("longitude", "deg"), ("height", "m")]
            .map(|(name, unit)| format!("{prefix}{name} ({unit})")),
    };
    names.extend(places(""));
    names.extend(BODY[..3].iter().map(|(name, unit)| format!("{name} ({unit})")));
    names.extend(ANGLES.map(|name| format!("{name} (rad)")));
    names.extend(BODY[3..].iter().map(|(name, unit)| format!("{name} ({unit})")));
    names.extend(SURFACES.iter().map(|name| format!("{name} (rad)")));
    names.push(super::start::throttle_column(&plan.airplane).to_string());
    if plan.has_gusts() {
        names.extend(BODY.map(|(name, unit)| format!("gust_{name} ({unit})")));
    }
    let sensors = &plan.sensors;
    if sensors.gyro.is_some() {
        names.extend(AXES.map(|axis| format!("gyro_{axis} (rad/s)")));
    }
    if sensors.accelerometer.is_some() {
        names.extend(AXES.map(|axis| format!("accel_{axis} (m/s^2)")));
    }
    if sensors.attitude.is_some() {
        names.extend(ANGLES.map(|angle| format!("attitude_{angle} (rad)")));
    }
    if sensors.airspeed.is_some() {
        names.push("airspeed (m/s)".into());
    }
    if sensors.altitude.is_some() {
        names.push("pressure_altitude (m)".into());
    }
    if sensors.gnss_position.is_some() {
        names.extend(places("gnss_"));
    }
    if sensors.gnss_velocity.is_some() {
        names.extend(DIRECTIONS.map(|name| format!("gnss_velocity_{name} (m/s)")));
    }
    for (sensor, unit, there) in
        [("gyro", "rad/s", sensors.gyro.is_some()), ("accel", "m/s^2", sensors.accelerometer.is_some())]
    {
        if there {
            let of =
                |axis: &str| ["rate", "bias", "drift"].map(|what| format!("truth_{sensor}_{axis}_{what} ({unit})"));
            names.extend(AXES.iter().flat_map(|axis| of(axis)));
        }
    }
    names.extend(SURFACES.iter().map(|name| format!("{name}_rate (rad/s)")));
    names.extend(SURFACES.iter().map(|name| format!("{name}_command (rad)")));
    names
}

/// One row in the order of [`header`], in the place of the one before.
pub(super) fn row(
    row: &mut Vec<f64>,
    plan: &Plan,
    time: f64,
    (x, instant): (&State, &Instant),
    surfaces: &Surfaces,
    gust: &Gust,
    measured: &Measured,
) {
    row.clear();
    row.push(time);
    row.extend(shown(plan.earth, place(plan.earth, position(x))));
    row.extend(velocity(x));
    row.extend(measured.euler);
    row.extend(instant.rate);
    let controls = surfaces.controls();
    row.extend([controls.elevator, controls.aileron, controls.rudder, controls.throttle]);
    if plan.has_gusts() {
        row.extend(gust.velocity);
        row.extend(gust.rate);
    }
    let sensors = &plan.sensors;
    if sensors.gyro.is_some() {
        row.extend(measured.gyro);
    }
    if sensors.accelerometer.is_some() {
        row.extend(measured.accelerometer);
    }
    if sensors.attitude.is_some() {
        row.extend(measured.attitude);
    }
    if sensors.airspeed.is_some() {
        row.push(measured.airspeed);
    }
    if sensors.altitude.is_some() {
        row.push(measured.altitude);
    }
    if sensors.gnss_position.is_some() {
        row.extend(shown(plan.earth, measured.gnss_position));
    }
    if sensors.gnss_velocity.is_some() {
        row.extend(measured.gnss_velocity);
    }
    let truths = [inertial_rate(x), measured.specific_force];
    let there = [sensors.gyro.is_some(), sensors.accelerometer.is_some()];
    for ((truth, errors), _) in truths.iter().zip(&measured.errors).zip(there).filter(|(_, there)| *there) {
        for ((truth, bias), drift) in truth.iter().zip(errors.bias).zip(errors.drift) {
            row.extend([*truth, bias, drift]);
        }
    }
    row.extend(surfaces.rates());
    row.extend(surfaces.commands());
}
