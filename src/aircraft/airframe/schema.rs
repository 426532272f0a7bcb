//! The layout of airplane.json key by key, from which its published schema is made; `document` reads it.

#![allow(dead_code, reason = "only the schema of these types is used")]

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use super::document::FORMAT;
use crate::params::{Measured, Plain};

/// An airplane: mass, aerodynamics, propulsion, actuators. Values are numbers with units, "11 kg"; derivatives
/// "5.61 1/rad", plain coefficients "0.23".
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Airplane")]
pub struct AirplaneDocument {
    #[schemars(extend("const" = FORMAT))]
    format: String,
    /// Of the set of numbers.
    name: String,
    /// Where they come from.
    source: String,
    licence: String,
    note: Option<String>,
    mass: Measured,
    inertia: InertiaEntry,
    reference: ReferenceEntry,
    aerodynamics: AerodynamicsEntry,
    propulsion: PropulsionEntry,
    actuators: Option<ActuatorsEntry>,
    positions: Option<PositionsEntry>,
}

impl AirplaneDocument {
    /// The published JSON schema.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(AirplaneDocument).to_value()
    }
}

/// About the centre of gravity; the matrix has −xz beside its diagonal.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct InertiaEntry {
    xx: Measured,
    yy: Measured,
    zz: Measured,
    /// The integral ∫xz dm, which many files give negated.
    xz: Measured,
}

/// Lengths by which the coefficients are made.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ReferenceEntry {
    area: Measured,
    span: Measured,
    /// Mean chord.
    chord: Measured,
}

#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct AerodynamicsEntry {
    lift: AlongEntry,
    drag: DragEntry,
    /// Side force.
    side: AcrossEntry,
    roll: AcrossEntry,
    pitch: AlongEntry,
    yaw: AcrossEntry,
    /// Lift rises without end when absent.
    stall: Option<StallEntry>,
}

/// Of lift or pitching moment.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct AlongEntry {
    zero: Plain,
    alpha: Derivative,
    /// By q̂ = cq/2V; may be plain.
    pitch_rate: RateDerivative,
    elevator: Derivative,
}

/// Of side force, rolling or yawing moment.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct AcrossEntry {
    /// 0 when absent.
    zero: Option<Plain>,
    beta: Derivative,
    /// By p̂ = bp/2V; may be plain.
    p: RateDerivative,
    /// By r̂ = br/2V; may be plain.
    r: RateDerivative,
    aileron: Derivative,
    rudder: Derivative,
}

/// One of `oswald` and `polar` says what lift costs.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, extend("oneOf" = [{ "required": ["oswald"] }, { "required": ["polar"] }]))]
struct DragEntry {
    parasitic: Plain,
    /// Factor e of (CL0 + CLα α)²/(π e b²/S).
    oswald: Option<Plain>,
    /// [k, CL of least drag] of k (CL − CL of least drag)² with the whole CL.
    polar: Option<[Plain; 2]>,
    pitch_rate: Option<RateDerivative>,
    elevator: Option<Derivative>,
}

/// σ goes from 0 to 1 about the angle.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct StallEntry {
    sharpness: Plain,
    angle: Measured,
}

#[derive(Debug, JsonSchema)]
#[schemars(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum PropulsionEntry {
    /// A thrust along x in place of the throttle, without end when `greatest` is absent.
    Thrust { greatest: Option<Measured> },
    /// An electric motor with a propeller, its coefficients c0 + c1 J + c2 J².
    Motor {
        /// Of the propeller.
        diameter: Measured,
        /// Turns per volt, "145 rpm/V".
        speed_constant: Measured,
        resistance: Measured,
        no_load_current: Measured,
        /// At full throttle.
        voltage: Measured,
        turns: Turns,
        thrust: [Plain; 3],
        torque: [Plain; 3],
    },
    /// The same with CT (`thrust`) and CP (`power`) over J, straight in between.
    Table {
        diameter: Measured,
        speed_constant: Measured,
        resistance: Measured,
        no_load_current: Measured,
        voltage: Measured,
        turns: Turns,
        #[schemars(length(min = 2))]
        advance_ratio: Vec<Plain>,
        #[schemars(length(min = 2))]
        thrust: Vec<Plain>,
        #[schemars(length(min = 2))]
        power: Vec<Plain>,
    },
}

/// Seen from behind.
#[derive(Debug, JsonSchema)]
#[schemars(rename_all = "snake_case")]
enum Turns {
    Clockwise,
    Counterclockwise,
}

/// A surface without one stands where it is told.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ActuatorsEntry {
    elevator: Option<ActuatorEntry>,
    aileron: Option<ActuatorEntry>,
    rudder: Option<ActuatorEntry>,
}

/// A servo of second order.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct ActuatorEntry {
    /// Of the servo without damping.
    frequency: Measured,
    damping: Plain,
    /// ± or [lower, upper]; without stops when absent.
    limit: Option<LimitEntry>,
    rate_limit: Option<Measured>,
    delay: Option<Measured>,
}

#[derive(Debug, JsonSchema)]
#[schemars(untagged)]
enum LimitEntry {
    Both(Measured),
    Each([Measured; 2]),
}

/// Of sensors from the centre of gravity, each ["0.1 m", "0 m", "0 m"] forward, right, down. That of the gyro is for
/// the record: all of a rigid body has one rate.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct PositionsEntry {
    gyro: Option<[Measured; 3]>,
    accelerometer: Option<[Measured; 3]>,
    gnss: Option<[Measured; 3]>,
    airspeed: Option<[Measured; 3]>,
}

/// "5.61 1/rad" or "0.098 1/deg".
#[derive(Debug)]
struct Derivative;

impl JsonSchema for Derivative {
    fn schema_name() -> Cow<'static, str> {
        "Derivative".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A derivative by an angle, \"5.61 1/rad\" or \"0.098 1/deg\".",
            "type": "string",
            "pattern": "^\\s*[-+]?[0-9.][-+.0-9eE]*\\s+\\S"
        })
    }
}

/// Rates are made dimensionless with the airspeed, so that theirs may be plain.
#[derive(Debug, JsonSchema)]
#[schemars(untagged)]
enum RateDerivative {
    ByAngle(Derivative),
    Plain(Plain),
}
