//! What an airplane document says and whether it makes sense: margins, signs, sizes, and the speeds of level flight.

use std::convert::Infallible;

use schemars::JsonSchema;
use serde::Serialize;

use super::trim::{Sideways, Trim, TrimError, TrimRequest, Turn};
use super::{Airplane, Propulsion};
use crate::aircraft::atmosphere::standard::{self, GRAVITY};
use crate::numerics::optimize::{bisect, half_way};

pub const FORMAT: &str = "kfdesign-airplane-check/1";

/// Speeds looked at, as shares of the speed at which the wing carries the weight at a lift coefficient of one: far
/// below any stall, far above any engine.
const SPEEDS: [f64; 2] = [0.4, 10.0];
const STEPS: usize = 120;
/// Points of the curves.
const POINTS: usize = 60;

/// An airplane, looked at. SI and rad.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AirplaneCheck")]
pub struct AirplaneCheck {
    #[schemars(extend("const" = FORMAT))]
    pub format: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub name: String,
    pub mass: f64,
    /// kg/m².
    pub wing_loading: f64,
    pub aspect_ratio: f64,
    /// Of the inertia, about the centre of gravity, ascending.
    pub principal_moments: [f64; 3],
    /// −Cmα/CLα: the neutral point behind the centre of gravity, in chords.
    pub static_margin: f64,
    /// Change of the moment coefficients of pitch, roll and yaw per rad of elevator, aileron, rudder.
    pub control_power: [f64; 3],
    /// Where the blended lift is greatest; absent when the document gives no stall.
    pub stall: Option<StallCheck>,
    /// Where speeds are looked at.
    pub altitude: f64,
    pub density: f64,
    /// Of level flight; absent when there is none.
    pub level_flight: Option<SpeedRange>,
    pub curve: Vec<SpeedPoint>,
    pub warnings: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "StallCheck")]
pub struct StallCheck {
    pub angle: f64,
    pub greatest_lift: f64,
    /// At which the weight needs the greatest lift; the elevator may end level flight before.
    pub airspeed: f64,
}

/// Speeds between which there is level flight, and what ends it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SpeedRange")]
pub struct SpeedRange {
    pub slowest: f64,
    /// lift, elevator, thrust …: what is missing below; null: level flight was found at the slowest speed looked at.
    pub slowest_limit: Option<&'static str>,
    pub fastest: f64,
    pub fastest_limit: Option<&'static str>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "SpeedPoint")]
pub struct SpeedPoint {
    pub airspeed: f64,
    pub alpha: f64,
    pub elevator: f64,
    /// 0 to 1, or the thrust in N.
    pub throttle: f64,
    /// What level flight needs, N.
    pub drag: f64,
    /// Drag times airspeed, W.
    pub power: f64,
    /// At the greatest throttle, N.
    pub thrust_available: f64,
    pub current: f64,
}

impl Airplane {
    /// Errors: the altitude is outside the standard atmosphere.
    pub fn check(&self, altitude: f64) -> Result<AirplaneCheck, TrimError> {
        let density = standard::at(altitude).map_err(|e| TrimError::new("request", e.to_string()))?.density;
        let weight = self.mass * GRAVITY;
        let size = &self.size;
        let unit_speed = (2.0 * weight / (density * size.area)).sqrt();
        let level = |airspeed: f64| self.trim(&level(airspeed, altitude));
        let range = self.range(unit_speed, &level);
        let stall = self.aerodynamics.stall.map(|stall| {
            // the blended lift turns a little before the angle of the document
            let angles = (0..=600).map(|i| stall.angle * 1.5 * f64::from(i) / 600.0);
            let lift = |alpha: f64| self.aerodynamics.lift_and_drag(alpha, 0.0, 0.0).0;
            let (angle, greatest_lift) =
                angles.map(|a| (a, lift(a))).fold((0.0, 0.0), |best, now| if now.1 > best.1 { now } else { best });
            StallCheck { angle, greatest_lift, airspeed: unit_speed / greatest_lift.sqrt() }
        });
        let point = |airspeed: f64, trim: Trim| {
            let running = self.propulsion.running(trim.controls.throttle, airspeed, density);
            SpeedPoint {
                airspeed,
                alpha: trim.alpha,
                elevator: trim.controls.elevator,
                throttle: trim.controls.throttle,
                drag: running.thrust * trim.alpha.cos(),
                power: running.thrust * trim.alpha.cos() * airspeed,
                thrust_available: self.propulsion.running(self.propulsion.greatest(), airspeed, density).thrust,
                current: running.current,
            }
        };
        let curve = range.iter().flat_map(|range| {
            let step = (range.fastest - range.slowest) / POINTS as f64;
            (0..=POINTS).map(move |i| range.slowest + step * i as f64)
        });
        let curve: Vec<SpeedPoint> = curve.filter_map(|v| Some(point(v, level(v).ok()?))).collect();
        let a = &self.aerodynamics;
        Ok(AirplaneCheck {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION"),
            name: self.name.clone(),
            mass: self.mass,
            wing_loading: self.mass / size.area,
            aspect_ratio: size.span * size.span / size.area,
            principal_moments: self.inertia.principal_moments(),
            static_margin: -a.pitch.alpha / a.lift.alpha,
            control_power: [a.pitch.elevator, a.roll.aileron, a.yaw.rudder],
            stall,
            altitude,
            density,
            warnings: self.warnings(range.as_ref(), &curve),
            level_flight: range,
            curve,
        })
    }

    /// The first stretch of speeds with level flight, its ends by halving.
    fn range(&self, unit_speed: f64, level: &impl Fn(f64) -> Result<Trim, TrimError>) -> Option<SpeedRange> {
        let ratio = (SPEEDS[1] / SPEEDS[0]).powf(1.0 / STEPS as f64);
        let speeds: Vec<f64> = (0..=STEPS).map(|i| unit_speed * SPEEDS[0] * ratio.powi(i as i32)).collect();
        let first = speeds.iter().position(|v| level(*v).is_ok())?;
        let last = first + speeds[first..].iter().take_while(|v| level(**v).is_ok()).count() - 1;
        let end = |inside: f64, outside: Option<&f64>| {
            let Some(&outside) = outside else { return (inside, None) };
            // to rounding of what is worth to print
            let Ok((inside, outside)) =
                bisect(inside, outside, half_way(1e-12 * unit_speed), |v| Ok::<_, Infallible>(level(v).is_err()));
            (inside, level(outside).err().map(|e| e.missing))
        };
        let (slowest, slowest_limit) = end(speeds[first], first.checked_sub(1).and_then(|i| speeds.get(i)));
        let (fastest, fastest_limit) = end(speeds[last], speeds.get(last + 1));
        Some(SpeedRange { slowest, slowest_limit, fastest, fastest_limit })
    }

    /// Numbers that are odd for an airplane.
    fn warnings(&self, range: Option<&SpeedRange>, curve: &[SpeedPoint]) -> Vec<String> {
        let mut out = Vec::new();
        let a = &self.aerodynamics;
        let margin = -a.pitch.alpha / a.lift.alpha;
        if margin <= 0.0 {
            out.push(format!(
                "static margin {margin:.3} chords: without feedback the airplane pitches away from its trim"
            ));
        } else if margin > 0.3 {
            out.push(format!(
                "static margin {margin:.3} chords is large (0.05 to 0.25 is usual): a stiff and fast short period"
            ));
        }
        if let Some(stall) = a.stall.filter(|stall| stall.angle > 20.0_f64.to_radians()) {
            out.push(format!(
                "stall angle {:.1} deg is large (12 to 18 is usual): keep the angle of attack below 15 deg",
                stall.angle.to_degrees()
            ));
        } else if a.stall.is_none() {
            out.push("no stall is given: lift rises without end, and slow flight is not to be believed".into());
        }
        if a.parasitic <= 0.0 {
            out.push("parasitic drag is not above zero: flight without lift costs nothing".into());
        }
        // signs by which an airplane damps and steers, in the conventions of the document
        for (name, value, positive, meaning) in [
            ("pitch.pitch_rate", a.pitch.pitch_rate, false, "pitching is not damped"),
            ("roll.p", a.roll.p, false, "rolling is not damped"),
            ("yaw.r", a.yaw.r, false, "yawing is not damped"),
            ("yaw.beta", a.yaw.beta, true, "the airplane does not turn into the wind"),
            ("side.beta", a.side.beta, false, "sideslip pulls sideways into the slip"),
            ("roll.beta", a.roll.beta, false, "sideslip does not lift the windward wing"),
            ("pitch.elevator", a.pitch.elevator, false, "the elevator is positive trailing edge down"),
            ("roll.aileron", a.roll.aileron, true, "the aileron is positive when it rolls right"),
            ("yaw.rudder", a.yaw.rudder, false, "the rudder is positive trailing edge left"),
        ] {
            let right = if positive { value > 0.0 } else { value < 0.0 };
            if !right && (value != 0.0 || name != "yaw.rudder") {
                let usual = if positive { "above" } else { "below" };
                out.push(format!("aerodynamics.{name} {value} is usually {usual} zero: {meaning}"));
            }
        }
        let [least, middle, greatest] = self.inertia.principal_moments();
        let excess = greatest / (least + middle) - 1.0;
        if excess > 0.0 {
            out.push(format!(
                "inertia: the largest principal moment is {:.1} % above the sum of the others, which no body has; \
                 measured less well than that, or xz is wrong",
                100.0 * excess
            ));
        }
        for (name, moment, length) in [("xx", self.inertia.xx, self.size.span), ("zz", self.inertia.zz, self.size.span)]
        {
            let share = (moment / self.mass).sqrt() / length;
            if share > 0.22 {
                out.push(format!(
                    "inertia.{name}: a radius of gyration of {share:.2} spans is large (0.08 to 0.2 is usual)"
                ));
            }
        }
        for (name, actuator) in ["elevator", "aileron", "rudder"].iter().zip(&self.actuators) {
            if actuator.is_none() {
                out.push(format!("no actuator {name}: the surface stands where it is told, without stops"));
            }
        }
        match range {
            None => out.push("no level flight at any speed at this altitude".into()),
            Some(range) => {
                if range.fastest_limit.is_none() {
                    out.push("nothing ends level flight at high speed: the thrust has no limit".into());
                }
                if let Some(slow) = curve.first().filter(|p| p.alpha > 15.0_f64.to_radians()) {
                    out.push(format!(
                        "the slowest level flight is at {:.1} deg angle of attack",
                        slow.alpha.to_degrees()
                    ));
                }
            }
        }
        if matches!(self.propulsion, Propulsion::Thrust { .. }) {
            out.push("propulsion is a thrust: no propeller torque, and thrust does not fall with speed".into());
        }
        out
    }
}

fn level(airspeed: f64, altitude: f64) -> TrimRequest {
    TrimRequest { airspeed, altitude, climb: 0.0, turn: Turn::Rate(0.0), sideways: Sideways::ZeroSideslip }
}
