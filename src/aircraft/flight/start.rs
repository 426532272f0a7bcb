//! From the document to the airplane and the state it starts in.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use super::FlightError;
use super::autopilot::Reference;
use super::commands::{Commands, names};
use super::document::{EarthEntry, FlightDocument, TrimEntry};
use super::earth::{Earth, Geodetic};
use super::motion::State;
use super::servo::Servo;
use super::surfaces::CONTROLS;
use super::vector::{Vector, back, from_euler, matrix, plus};
use crate::aircraft::airframe::trim::Trim;
use crate::aircraft::airframe::{Actuator, Airplane, Propulsion};
use crate::params::Measured;

/// Where a flight begins.
pub(super) struct Start {
    pub state: State,
    /// Those of the trim, if there is one.
    pub controls: Option<[f64; CONTROLS]>,
    /// Of an autopilot.
    pub reference: Reference,
    /// m.
    pub altitude: f64,
}

/// The airplane that the document names. Errors: its own, with the place.
pub(super) fn airplane(document: &FlightDocument, folder: &Path) -> Result<Airplane, FlightError> {
    let (text, shown) = document.airplane.text("airplane", folder).map_err(|e| FlightError(e.to_string()))?;
    Airplane::from_json(&text, &shown).map_err(|e| FlightError(e.to_string()))
}

/// Servo and delay of a control; the throttle has none.
pub(super) fn servo_of(airplane: &Airplane, control: usize) -> (Option<Servo>, f64) {
    let Some(Some(Actuator { frequency, damping, travel, rate_limit, delay })) = airplane.actuators.get(control) else {
        return (None, 0.0);
    };
    (Some(Servo { frequency: *frequency, damping: *damping, travel: *travel, rate_limit: *rate_limit }), *delay)
}

pub(super) fn throttle_column(airplane: &Airplane) -> &'static str {
    match airplane.propulsion {
        Propulsion::Motor(_) => "throttle",
        Propulsion::Thrust { .. } => "thrust (N)",
    }
}

/// The steady flight that the document asks for.
pub(super) fn trim(entry: &TrimEntry, airplane: &Airplane) -> Result<Trim, FlightError> {
    airplane.trim(&entry.request()).map_err(|e| FlightError(format!("trim: {e}")))
}

/// Fixed commands and rows stay within the stops, and within what the propulsion has. Errors: the first that does not.
pub(super) fn check_travel(airplane: &Airplane, commands: &Commands) -> Result<(), FlightError> {
    let rows = commands.rows.iter().map(|(_, row)| row);
    for row in std::iter::once(&commands.fixed).chain(rows) {
        let greatest = airplane.propulsion.greatest();
        let propulsion = row[CONTROLS - 1];
        if !(0.0..=greatest).contains(&propulsion) {
            let name = names(airplane)[CONTROLS - 1];
            return Err(FlightError(format!("controls.{name}: {propulsion} is not from 0 to {greatest}")));
        }
        for (i, (command, name)) in row.iter().zip(names(airplane)).enumerate() {
            let Some(Servo { travel: [least, greatest], .. }) = servo_of(airplane, i).0 else { continue };
            if !(least..=greatest).contains(command) {
                return Err(FlightError(format!(
                    "controls.{name}: {:.3} deg is beyond the stops of {:.3} deg and {:.3} deg",
                    command.to_degrees(),
                    least.to_degrees(),
                    greatest.to_degrees()
                )));
            }
        }
    }
    Ok(())
}

pub(super) fn start(
    document: &FlightDocument,
    airplane: &Airplane,
    earth: Earth,
    wind: Vector,
) -> Result<Start, FlightError> {
    if document.trim.is_none() && document.initial.is_none() {
        return Err(FlightError("trim: missing; give a trim or an initial state to start from".into()));
    }
    let si = |m: &Option<Measured>| m.as_ref().map(Measured::si);
    let of_earth = match &document.earth {
        EarthEntry::Flat => [None; 3],
        EarthEntry::Wgs84(place) => [&place.latitude, &place.longitude, &place.heading].map(si),
    };
    let (mut velocity, mut euler, mut rate) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    let mut controls = None;
    let mut altitude = None;
    euler[2] = of_earth[2].unwrap_or(0.0);
    if let Some(trim) = &document.trim {
        altitude = Some(trim.altitude.si());
        let found = self::trim(trim, airplane)?;
        (velocity, rate) = (found.velocity, found.rate);
        euler = [found.phi, found.theta, euler[2]];
        let c = found.controls;
        controls = Some([c.elevator, c.aileron, c.rudder, c.throttle]);
        velocity = plus(velocity, back(&from_euler(euler), wind));
    }
    // an airplane that starts beside its trim is brought back to it
    let trimmed = document.trim.as_ref().map(|_| (rate, [euler[0], euler[1]]));
    let mut place = [of_earth[0], of_earth[1]];
    if let Some(i) = &document.initial {
        let zero = |m: &Option<Measured>| si(m).unwrap_or(0.0);
        velocity = [&i.u, &i.v, &i.w].map(zero);
        euler = [zero(&i.phi), zero(&i.theta), si(&i.psi).or(of_earth[2]).unwrap_or(0.0)];
        rate = [&i.p, &i.q, &i.r].map(zero);
        altitude = si(&i.altitude).or(altitude);
        place = [si(&i.latitude).or(place[0]), si(&i.longitude).or(place[1])];
    }
    let missing = |key: &str| FlightError(format!("{key}: missing; the flight needs a place to start from"));
    let height = altitude.ok_or_else(|| missing("initial.altitude"))?;
    let (latitude, longitude) = match earth {
        Earth::Flat => (0.0, 0.0),
        Earth::Wgs84 => (
            place[0].ok_or_else(|| missing("earth.wgs84.latitude"))?,
            place[1].ok_or_else(|| missing("earth.wgs84.longitude"))?,
        ),
    };
    if latitude.abs() > FRAC_PI_2 {
        return Err(FlightError(format!("latitude: {:.3} deg, expected -90 to 90 deg", latitude.to_degrees())));
    }
    let state = state_of(earth, Geodetic { latitude, longitude, height }, euler, velocity, rate);
    let (rate, angles) = trimmed.unwrap_or((rate, [euler[0], euler[1]]));
    let reference = Reference { rate, angles, surfaces: [0.0; 3] };
    Ok(Start { state, controls, reference, altitude: height })
}

/// A place and the attitude there as a state; `velocity` and `rate` in body axes, relative to the earth.
fn state_of(earth: Earth, place: Geodetic, euler: Vector, velocity: Vector, rate: Vector) -> State {
    let r = match earth {
        Earth::Flat => [0.0, 0.0, -place.height],
        Earth::Wgs84 => place.to_ecef(),
    };
    let attitude = earth.attitude(r, &from_euler(euler));
    let c = matrix(attitude);
    let inertial = plus(rate, earth.field(r, &c).rate);
    let [a, b, d] = [r, velocity, inertial];
    let e = attitude;
    [a[0], a[1], a[2], b[0], b[1], b[2], e[0], e[1], e[2], e[3], d[0], d[1], d[2], 0.0]
}
