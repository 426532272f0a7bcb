//! flight.json: which airplane, where it starts, what moves its surfaces, through what air, with which sensors.
//!
//! Every number stands with its unit. `read` makes the document of a text; the structs here are its layout and its
//! schema.

pub mod criteria;
pub mod feeds;
mod optimize;
mod read;
mod rule;
mod uncertainty;
mod values;
mod weights;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Serialize;

pub use self::criteria::CriteriaEntry;
pub use self::feeds::{FeedEntry, LowpassEntry};
pub use self::optimize::OptimizeEntry;
pub use self::rule::RuleEntry;
pub use self::uncertainty::UncertaintyEntry;
use super::autopilot::RateGains;
use crate::aircraft::airframe::AirplaneDocument;
use crate::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
use crate::aircraft::atmosphere::discrete::Form;
use crate::aircraft::atmosphere::dryden::Specification;
use crate::params::place::{self, DocumentError};
use crate::params::{Measured, Params, ParamsDocument, Plain};

pub const FORMAT: &str = "kfdesign-flight/1";

/// A flight of an airplane.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Flight")]
pub struct FlightDocument {
    #[schemars(extend("const" = FORMAT))]
    pub format: String,
    /// airplane.json: its path from this file, or the document itself.
    #[schemars(schema_with = "linked::<AirplaneDocument>")]
    pub airplane: Linked,
    /// Steady flight to start from, and what controls not given below stand at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trim: Option<TrimEntry>,
    /// A state to start from instead of the trim's; what is absent is zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial: Option<InitialEntry>,
    /// Commands of the surfaces and the throttle; those of the trim where absent.
    #[serde(default)]
    #[schemars(schema_with = "controls")]
    pub controls: ControlsEntry,
    /// "flat" when absent.
    #[serde(default)]
    #[schemars(schema_with = "earth")]
    pub earth: EarthEntry,
    /// Height of the ground above the sea or the ellipsoid, where a flight ends; 0 m when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<Measured>,
    /// Steady velocity of the air over the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind: Option<WindEntry>,
    /// One, or a list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(schema_with = "gusts")]
    pub gusts: Vec<GustEntry>,
    #[serde(default)]
    pub sensors: SensorsEntry,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub autopilot: Option<AutopilotEntry>,
    /// What `loop` compares: what stands between the sensors and the gains; each has a name of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub feeds: Vec<FeedEntry>,
    /// What every feed must keep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criteria: Option<CriteriaEntry>,
    /// How well the airframe is known, for `spread` of `loop`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<UncertaintyEntry>,
    /// What `loop` with `optimize` makes least; the usual when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimize: Option<OptimizeEntry>,
}

/// Another document: a path, from the folder of this one, or the document itself.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Linked {
    Path(PathBuf),
    Document(serde_json::Value),
}

/// Steady flight.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrimEntry {
    pub airspeed: Measured,
    /// Above the sea or the ellipsoid.
    pub altitude: Measured,
    /// Angle of the flight path; level when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub climb: Option<Measured>,
    /// Of the heading; straight when absent, and no `bank` beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_rate: Option<Measured>,
    /// Angle of a coordinated turn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bank: Option<Measured>,
    /// What fixes the sideways motion: zero_sideslip when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = ["zero_sideslip", "zero_side_force", "wings_level"]))]
    pub lateral: Option<String>,
}

impl TrimEntry {
    pub fn request(&self) -> TrimRequest {
        let si = |m: &Option<Measured>| m.as_ref().map_or(0.0, Measured::si);
        TrimRequest {
            airspeed: self.airspeed.si(),
            altitude: self.altitude.si(),
            climb: si(&self.climb),
            turn: self.bank.as_ref().map_or(Turn::Rate(si(&self.turn_rate)), |bank| Turn::Bank(bank.si())),
            sideways: self.lateral.as_deref().and_then(Sideways::named).unwrap_or_default(),
        }
    }
}

/// Velocity u v w and rate p q r in body axes, relative to the earth; roll, pitch, yaw against north, east, down.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialEntry {
    pub u: Option<Measured>,
    pub v: Option<Measured>,
    pub w: Option<Measured>,
    pub phi: Option<Measured>,
    pub theta: Option<Measured>,
    pub psi: Option<Measured>,
    pub p: Option<Measured>,
    pub q: Option<Measured>,
    pub r: Option<Measured>,
    pub altitude: Option<Measured>,
    pub latitude: Option<Measured>,
    pub longitude: Option<Measured>,
}

/// Commands: fixed, or a log with a time column and columns elevator, aileron, rudder, throttle; each row holds until
/// the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ControlsEntry {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevator: Option<Measured>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aileron: Option<Measured>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rudder: Option<Measured>,
    /// 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Plain>")]
    pub throttle: Option<f64>,
    /// Of an airplane whose propulsion is a thrust.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thrust: Option<Measured>,
    /// A log of commands instead of fixed ones: its path from the folder of this document.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
}

/// "flat", or the place and heading at the start over the rotating WGS84 earth.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EarthEntry {
    #[default]
    Flat,
    Wgs84(Box<PlaceEntry>),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaceEntry {
    /// Geodetic.
    pub latitude: Option<Measured>,
    pub longitude: Option<Measured>,
    /// North when absent.
    pub heading: Option<Measured>,
}

/// The velocity with which the air moves, not the direction it comes from.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WindEntry {
    pub north: Option<Measured>,
    pub east: Option<Measured>,
    pub down: Option<Measured>,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "model", deny_unknown_fields)]
pub enum GustEntry {
    /// Continuous turbulence of fixed height and airspeed.
    #[serde(rename = "dryden")]
    Dryden {
        #[schemars(with = "String", extend("enum" = Specification::NAMES))]
        #[serde(serialize_with = "name_of_specification")]
        specification: Specification,
        /// Mean wind 20 ft above ground: 15, 30, 45 kt are light, moderate, severe.
        #[serde(skip_serializing_if = "Option::is_none")]
        wind_at_20ft: Option<Measured>,
        /// Of u, v, w above 1000 ft; no `exceedance` beside it.
        #[serde(skip_serializing_if = "Option::is_none")]
        std_dev: Option<Measured>,
        /// The same by the chart of MIL-F-8785C, figure 7: the probability that it is exceeded. 1e-2, 1e-3, 1e-5 are
        /// light, moderate, severe; 0.2, 0.1, 1e-4, 1e-6 have curves too.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<Plain>")]
        exceedance: Option<f64>,
        /// Above ground; that of the start when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        height: Option<Measured>,
        /// Of the filters; that of the start when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        airspeed: Option<Measured>,
    },
    /// A discrete gust along the way through the air: at least one of u, v, w.
    #[serde(rename = "1-cos")]
    #[schemars(extend("anyOf" = [{ "required": ["u"] }, { "required": ["v"] }, { "required": ["w"] }]))]
    Discrete {
        /// hold: MIL-F-8785C, the velocity stays; return: it goes back to zero.
        #[schemars(with = "String", extend("enum" = ["hold", "return"]))]
        #[serde(serialize_with = "name_of_form")]
        form: Form,
        /// Length of the rise.
        length: Measured,
        /// Largest velocity of the air in body axes; an up-gust has w below zero.
        #[serde(skip_serializing_if = "Option::is_none")]
        u: Option<Measured>,
        #[serde(skip_serializing_if = "Option::is_none")]
        v: Option<Measured>,
        #[serde(skip_serializing_if = "Option::is_none")]
        w: Option<Measured>,
        /// When the airplane meets it; at once when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        start: Option<Measured>,
    },
}

fn name_of_specification<S: serde::Serializer>(value: &Specification, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(value.name())
}

fn name_of_form<S: serde::Serializer>(value: &Form, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(match value {
        Form::Hold => "hold",
        Form::Return => "return",
    })
}

/// What is measured; a sensor that is absent measures nothing, and the autopilot then takes the truth.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorsEntry {
    /// Of every sensor without a rate of its own; when absent that of the gyro's parameters, then of the autopilot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Measured>,
    /// params.json of an angular rate: path or document, one axis for all or three.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "linked::<ParamsDocument>")]
    pub gyro: Option<Linked>,
    /// params.json of a specific force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "linked::<ParamsDocument>")]
    pub accelerometer: Option<Linked>,
    /// Roll, pitch, yaw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude: Option<ErrorEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub airspeed: Option<ErrorEntry>,
    /// Pressure altitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub altitude: Option<ErrorEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gnss: Option<GnssEntry>,
}

/// Errors of a measurement: the short form "2 deg/sqrt(Hz)" is white noise alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorEntry {
    /// A density, or the standard deviation of one measurement.
    pub white: Option<Measured>,
    pub gauss_markov: Option<DriftEntry>,
    /// Measurements per second.
    pub rate: Option<Measured>,
}

impl JsonSchema for ErrorEntry {
    fn schema_name() -> Cow<'static, str> {
        "Error".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let measured = generator.subschema_for::<Measured>();
        let drift = generator.subschema_for::<DriftEntry>();
        json_schema!({
            "description": "Errors of a measurement; one value with its unit is white noise alone: \
                            a density (deg/sqrt(Hz)) or the standard deviation of one measurement (deg).",
            "anyOf": [
                measured,
                {
                    "type": "object",
                    "properties": { "white": measured, "gauss_markov": drift, "rate": measured },
                    "additionalProperties": false
                }
            ]
        })
    }
}

/// A first-order Gauss-Markov error.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriftEntry {
    pub std_dev: Measured,
    pub correlation_time: Measured,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GnssEntry {
    /// Of north, east and down, each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<ErrorEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<ErrorEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Measured>,
}

/// One law, `gains` (or a `rule` for them) or `lqr`; both work on deviations from the trim.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["gains"] }, { "required": ["lqr"] }, { "required": ["rule"] }]))]
pub struct AutopilotEntry {
    pub rate: Measured,
    /// Whole samples from the measurement to the command at the servo; 1 when absent.
    #[serde(default = "one_sample")]
    #[schemars(schema_with = "samples")]
    pub delay: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gains: Option<GainsEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lqr: Option<LqrEntry>,
    /// Instead of gains: what they are to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rule: Option<RuleEntry>,
    /// Time constant of the complementary filter of gyro and attitude reference; 5 s when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_filter: Option<Measured>,
    /// Commanded angles instead of the trim's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pitch: Option<Measured>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bank: Option<Measured>,
}

/// Weights of the linear-quadratic regulator u = −K x of the linear model about the trim, in continuous time; SI and
/// rad. It needs the velocity through the air, which no sensor here shows, and takes the true one.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LqrEntry {
    pub longitudinal: LongitudinalWeights,
    pub lateral: LateralWeights,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LongitudinalWeights {
    /// Of u, w, q, theta.
    #[schemars(with = "[Plain; 4]")]
    pub states: [f64; 4],
    #[schemars(with = "Plain")]
    pub elevator: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LateralWeights {
    /// Of v, p, r, phi.
    #[schemars(with = "[Plain; 4]")]
    pub states: [f64; 4],
    #[schemars(with = "Plain")]
    pub aileron: f64,
    #[schemars(with = "Plain")]
    pub rudder: f64,
}

/// Rate dampers and attitude loops: δe = kq q + kθ(θ − θc), δa = −kp p − kφ(φ − φc), δr = kr · washout(r).
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainsEntry {
    pub kq: Measured,
    #[schemars(with = "Plain")]
    pub ktheta: f64,
    pub kp: Measured,
    #[schemars(with = "Plain")]
    pub kphi: f64,
    pub kr: Measured,
    /// 1 s when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub washout: Option<Measured>,
}

impl GainsEntry {
    pub fn si(&self) -> RateGains {
        let washout = self.washout.as_ref().map_or(1.0, Measured::si);
        RateGains::of([self.kq.si(), self.ktheta, self.kp.si(), self.kphi, self.kr.si()], washout)
    }
}

impl AutopilotEntry {
    /// s.
    pub fn attitude_filter_s(&self) -> f64 {
        self.attitude_filter.as_ref().map_or(5.0, Measured::si)
    }
}

impl FlightDocument {
    /// Of the first turbulence, m/s.
    pub fn wind_at_20ft(&self) -> Option<f64> {
        self.gusts.iter().find_map(|gust| match gust {
            GustEntry::Dryden { wind_at_20ft, .. } => wind_at_20ft.as_ref().map(Measured::si),
            GustEntry::Discrete { .. } => None,
        })
    }

    /// Every complaint names `path` and the key.
    pub fn from_json(text: &str, path: &str) -> Result<FlightDocument, DocumentError> {
        place::document(text, path, read::flight)
    }

    pub fn read(path: &Path) -> Result<FlightDocument, DocumentError> {
        place::read(path, read::flight)
    }

    /// The published JSON schema.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(FlightDocument).to_value()
    }
}

impl Linked {
    /// The text of the document and how to name it: a path is taken from `folder`. Errors: it cannot be read.
    pub fn text(&self, key: &str, folder: &Path) -> Result<(String, String), DocumentError> {
        match self {
            Linked::Document(value) => Ok((value.to_string(), key.to_string())),
            Linked::Path(path) => place::file(&folder.join(path)).map_err(|error| match error {
                DocumentError::Read { path, reason } => DocumentError::Read { path: format!("{key}: {path}"), reason },
                other => other,
            }),
        }
    }

    /// The noise parameters it names.
    pub fn params(&self, key: &str, folder: &Path) -> Result<(Params, String), String> {
        let (text, shown) = self.text(key, folder).map_err(|e| e.to_string())?;
        let params = Params::from_json(&text, &shown).map_err(|e| e.to_string())?;
        Ok((params, shown))
    }
}

// layouts that are more than one type of value

fn linked<T: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    let whole = generator.subschema_for::<T>();
    json_schema!({ "anyOf": [{ "description": "Its path.", "type": "string" }, whole] })
}

fn controls(generator: &mut SchemaGenerator) -> Schema {
    let fixed = generator.subschema_for::<ControlsEntry>();
    json_schema!({ "anyOf": [fixed, { "description": "A log of commands: its path.", "type": "string" }] })
}

fn earth(generator: &mut SchemaGenerator) -> Schema {
    let place = generator.subschema_for::<PlaceEntry>();
    json_schema!({
        "anyOf": [
            { "description": "wgs84: with latitude and longitude in `initial`.", "enum": ["flat", "wgs84"] },
            { "type": "object", "properties": { "wgs84": place }, "required": ["wgs84"], "additionalProperties": false }
        ]
    })
}

fn gusts(generator: &mut SchemaGenerator) -> Schema {
    let gust = generator.subschema_for::<GustEntry>();
    json_schema!({ "anyOf": [gust, { "type": "array", "items": gust }] })
}

fn one_sample() -> u64 {
    1
}

fn samples(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "integer", "minimum": 0 },
            { "description": "\"1 sample\"", "type": "string", "pattern": "^\\s*[0-9]+(\\s+samples?)?\\s*$" }
        ]
    })
}
