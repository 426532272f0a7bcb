//! The `design` section: which plant the sensor is part of, and what aids it.
//!
//! It stands in params.json and, as it was used, in filter.json. Values keep their units; the matrices of a custom
//! plant are SI.

mod linear;
mod written;

use schemars::JsonSchema;
use serde::Serialize;

use super::axis::axis;
use super::measured::Range;
use super::place::{self, KeyError, Object, Place};
use super::{AxisParams, Measured, ParamsError};
use crate::units::{Dimension, Quantity, Unit, digits};

/// Names of the plants, in documents and flags.
pub const PLANTS: [&str; 6] = ["static", "angle", "rate", "vertical", "attitude", "custom"];

const ANGLE: Dimension = Dimension::new(2, 0, 0);
const RATE: Dimension = Quantity::AngularRate.dimension();
/// Of a rate that is the integral of a random walk: u/s/√s.
const JERK: Dimension = RATE.times_time(-3);

/// A plant and its aids.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Design {
    pub plant: PlantEntry,
    pub aids: Vec<AidEntry>,
}

/// What the sensor is part of.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PlantEntry {
    /// The sensor rests: its true signal is zero.
    #[default]
    Static,
    /// The gyro is integrated to an angle.
    Angle {
        initial_std_dev: Option<Measured>,
    },
    /// The true rate is a process; the gyro measures it.
    Rate {
        motion: MotionEntry,
        initial_std_dev: Option<Measured>,
    },
    /// Roll or pitch: the gyro is integrated, the accelerometer measures the tilt.
    Vertical {
        accelerometer: Box<AxisParams>,
        gravity: Option<Measured>,
        initial_std_dev: Option<Measured>,
    },
    /// Three axes: the gyro is integrated to a quaternion, gravity and a heading aid it.
    Attitude(Box<AttitudeEntry>),
    Custom(Box<CustomEntry>),
}

/// What the plant attitude is given.
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeEntry {
    /// Noise of an axis of the accelerometer; it holds for all three.
    pub accelerometer: AxisParams,
    pub gravity: Option<Measured>,
    /// Spread of scale factors and misalignments of the gyro.
    pub scale_factor: Option<Measured>,
}

/// How the true rate moves.
#[derive(Clone, Debug, PartialEq)]
pub enum MotionEntry {
    GaussMarkov {
        std_dev: Measured,
        correlation_time: Measured,
    },
    /// The acceleration is a random walk of this density.
    IntegratedRandomWalk {
        density: Measured,
    },
}

/// Another measurement of the plant.
#[derive(Clone, Debug, PartialEq)]
pub struct AidEntry {
    pub name: String,
    /// White noise of one measurement.
    pub std_dev: Measured,
    /// Measurements per second; every sample when absent.
    pub rate: Option<Measured>,
    /// Error that is correlated in time.
    pub gauss_markov: Option<AidDrift>,
    /// Output of a custom plant that it measures; its only one when absent.
    pub measures: Option<String>,
}

/// A first-order Gauss-Markov error of an aid.
#[derive(Clone, Debug, PartialEq)]
pub struct AidDrift {
    pub std_dev: Measured,
    pub correlation_time: Measured,
}

/// A linear plant by its matrices, SI: ẋ = A x + B u + G w, w white of unit two-sided density, or x⁺ = A x + B u + G
/// w, w ~ N(0, I); y = H x.
#[derive(Clone, Debug, PartialEq)]
pub struct CustomEntry {
    pub discrete: bool,
    pub states: Vec<StateEntry>,
    pub inputs: Vec<NamedEntry>,
    pub outputs: Vec<NamedEntry>,
    pub a: Vec<Vec<f64>>,
    pub b: Vec<Vec<f64>>,
    pub g: Vec<Vec<f64>>,
    pub h: Vec<Vec<f64>>,
    /// The input or output that the sensor of the document is.
    pub sensor: String,
}

/// A state of a custom plant: N(mean, std_dev²) before the first measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct StateEntry {
    pub name: String,
    /// SI.
    pub unit: String,
    pub mean: Option<Measured>,
    pub std_dev: Measured,
}

/// An input or output with its SI unit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NamedEntry {
    pub name: String,
    pub unit: String,
}

impl PlantEntry {
    /// As in documents and flags.
    pub fn name(&self) -> &'static str {
        let number = match self {
            PlantEntry::Static => 0,
            PlantEntry::Angle { .. } => 1,
            PlantEntry::Rate { .. } => 2,
            PlantEntry::Vertical { .. } => 3,
            PlantEntry::Attitude(_) => 4,
            PlantEntry::Custom(_) => 5,
        };
        PLANTS[number]
    }

    /// Dimension of what an aid measures; `None` when nothing can be aided, or when the output has no such name.
    pub fn aided(&self, measures: Option<&str>) -> Option<Dimension> {
        match self {
            PlantEntry::Static => None,
            PlantEntry::Angle { .. } | PlantEntry::Vertical { .. } | PlantEntry::Attitude(_) => Some(ANGLE),
            PlantEntry::Rate { .. } => Some(RATE),
            PlantEntry::Custom(custom) => {
                let named = |o: &&NamedEntry| measures.map_or(o.name != custom.sensor, |name| o.name == name);
                let output = custom.outputs.iter().find(named)?;
                Unit::parse(&output.unit).ok().map(|unit| unit.dimension())
            }
        }
    }
}

/// An aid's rate may be this far, relatively, from a whole fraction of the sample rate.
const RATE_TOLERANCE: f64 = 0.05;
/// An aid is taken at least once in so many samples.
const RAREST: f64 = 1e6;

impl AidEntry {
    /// Samples from one measurement to the next. Errors: a rate above the sample rate or no whole fraction of it.
    pub fn every(&self, sample_rate_hz: f64) -> Result<usize, String> {
        let Some(rate) = self.rate.as_ref().map(|m| m.si()) else { return Ok(1) };
        let every = (sample_rate_hz / rate).round().max(1.0);
        let possible = |every: f64| format!("{} Hz", digits(sample_rate_hz / every));
        if rate > sample_rate_hz * (1.0 + RATE_TOLERANCE) || !every.is_finite() {
            return Err(format!(
                "its rate of {} Hz is above the sample rate of {} Hz",
                digits(rate),
                digits(sample_rate_hz)
            ));
        }
        let off = sample_rate_hz / every / rate - 1.0;
        if off.abs() > RATE_TOLERANCE {
            return Err(format!(
                "its rate of {} Hz is no whole fraction of the sample rate of {} Hz; near it are {} and {}",
                digits(rate),
                digits(sample_rate_hz),
                possible(every),
                possible(if off > 0.0 { every + 1.0 } else { (every - 1.0).max(1.0) })
            ));
        }
        if every > RAREST {
            return Err(format!("its rate of {} Hz is less than one measurement in a million samples", digits(rate)));
        }
        Ok(every as usize)
    }
}

/// `unknown plant 'x'`, with the known ones.
pub fn unknown_plant(found: &str) -> String {
    let meant = place::meant(found, PLANTS.iter().copied());
    format!("unknown plant '{found}'; {meant}known plants: {}", PLANTS.join(", "))
}

impl Design {
    /// Reads a section that stands in another document.
    pub fn from_place(place: &Place<'_>) -> Result<Design, KeyError> {
        let object = place.object(&[
            "plant",
            "motion",
            "accelerometer",
            "gravity",
            "scale_factor",
            "initial_std_dev",
            "custom",
            "aids",
        ])?;
        let plant_place = object.required("plant")?;
        let name = plant_place.text()?;
        let plant = plant(&object, name).ok_or_else(|| plant_place.error(unknown_plant(name)))??;
        let belongs: &[&str] = match &plant {
            PlantEntry::Static => &[],
            PlantEntry::Angle { .. } => &["initial_std_dev"],
            PlantEntry::Rate { .. } => &["motion", "initial_std_dev"],
            PlantEntry::Vertical { .. } => &["accelerometer", "gravity", "initial_std_dev"],
            PlantEntry::Attitude(_) => &["accelerometer", "gravity", "scale_factor"],
            PlantEntry::Custom(_) => &["custom"],
        };
        for key in ["motion", "accelerometer", "gravity", "scale_factor", "initial_std_dev", "custom"] {
            if let Some(foreign) = object.optional(key).filter(|_| !belongs.contains(&key)) {
                return Err(foreign.error(format!("is no matter of the plant '{name}'")));
            }
        }
        let mut aids: Vec<AidEntry> = Vec::new();
        for place in object.optional("aids").map_or(Ok(Vec::new()), |p| p.list())? {
            let aid = aid(&place, &plant)?;
            if aids.iter().any(|a| a.name == aid.name) {
                let key = format!("{}.name", place.key());
                return Err(KeyError { key, message: format!("'{}' is the name of an earlier aid too", aid.name) });
            }
            aids.push(aid);
        }
        Ok(Design { plant, aids })
    }

    /// Every noise parameter of the plant and its aids with its path: `motion.std_dev`, `accelerometer.white.density`,
    /// `heading.gauss_markov.correlation_time`. Rates are not among them.
    pub fn noise_parameters(&mut self) -> impl Iterator<Item = (String, &mut Measured)> {
        let plant: Vec<(String, &mut Measured)> = match &mut self.plant {
            PlantEntry::Rate { motion: MotionEntry::GaussMarkov { std_dev, correlation_time }, .. } => {
                vec![("motion.std_dev".into(), std_dev), ("motion.correlation_time".into(), correlation_time)]
            }
            PlantEntry::Rate { motion: MotionEntry::IntegratedRandomWalk { density }, .. } => {
                vec![("motion.density".into(), density)]
            }
            PlantEntry::Vertical { accelerometer, .. } => {
                accelerometer.noise_parameters().map(|(path, m)| (format!("accelerometer.{path}"), m)).collect()
            }
            PlantEntry::Attitude(entry) => {
                let accelerometer = entry.accelerometer.noise_parameters();
                accelerometer.map(|(path, m)| (format!("accelerometer.{path}"), m)).collect()
            }
            PlantEntry::Static | PlantEntry::Angle { .. } | PlantEntry::Custom(_) => Vec::new(),
        };
        plant.into_iter().chain(self.aids.iter_mut().flat_map(|aid| {
            let name = &aid.name;
            let drift = aid
                .gauss_markov
                .iter_mut()
                .flat_map(|drift| [("std_dev", &mut drift.std_dev), ("correlation_time", &mut drift.correlation_time)]);
            let drift = drift.map(|(key, m)| (format!("{name}.gauss_markov.{key}"), m));
            std::iter::once((format!("{name}.std_dev"), &mut aid.std_dev)).chain(drift).collect::<Vec<_>>()
        }))
    }

    /// Reads a file that holds nothing but the section, or a linear.json, of which `sensor` is the rate that the
    /// gyro measures (q, p or r).
    pub fn from_json(text: &str, path: &str, sensor: Option<&str>) -> Result<Design, ParamsError> {
        let value = place::parse(text).map_err(|e| ParamsError::Syntax {
            path: path.into(),
            line: e.line,
            column: e.column,
            message: e.message,
        })?;
        let root = Place::root(&value);
        let design = match sensor {
            _ if linear::is_linear(&value) => linear::linear(&root, sensor.unwrap_or("q")),
            Some(sensor) => Err(root.error(format!("#{sensor} chooses a rate of a linear.json; this is a design"))),
            None => Design::from_place(&root),
        };
        design.map_err(|e| ParamsError::Invalid { path: path.into(), key: e.key, message: e.message })
    }
}

/// `None`: no plant of this name.
fn plant(object: &Object<'_>, name: &str) -> Option<Result<PlantEntry, KeyError>> {
    let initial = |dimension| measured(object, "initial_std_dev", dimension);
    Some(match name {
        "static" => Ok(PlantEntry::Static),
        "angle" => initial(ANGLE).map(|initial_std_dev| PlantEntry::Angle { initial_std_dev }),
        "rate" => object
            .required("motion")
            .and_then(|place| motion(&place))
            .and_then(|motion| Ok(PlantEntry::Rate { motion, initial_std_dev: initial(RATE)? })),
        "vertical" => vertical(object),
        "attitude" => attitude(object),
        "custom" => object.required("custom").and_then(|place| custom(&place)).map(|c| PlantEntry::Custom(Box::new(c))),
        _ => return None,
    })
}

fn vertical(object: &Object<'_>) -> Result<PlantEntry, KeyError> {
    Ok(PlantEntry::Vertical {
        accelerometer: Box::new(axis(&object.required("accelerometer")?, Quantity::SpecificForce)?),
        gravity: measured(object, "gravity", Quantity::SpecificForce.dimension())?,
        initial_std_dev: measured(object, "initial_std_dev", ANGLE)?,
    })
}

fn attitude(object: &Object<'_>) -> Result<PlantEntry, KeyError> {
    Ok(PlantEntry::Attitude(Box::new(AttitudeEntry {
        accelerometer: axis(&object.required("accelerometer")?, Quantity::SpecificForce)?,
        gravity: measured(object, "gravity", Quantity::SpecificForce.dimension())?,
        scale_factor: measured(object, "scale_factor", Dimension::NONE)?,
    })))
}

fn measured(object: &Object<'_>, key: &str, dimension: Dimension) -> Result<Option<Measured>, KeyError> {
    object.optional(key).map(|place| Measured::from_place(&place, dimension, Range::Positive)).transpose()
}

fn positive(object: &Object<'_>, key: &str, dimension: Dimension) -> Result<Measured, KeyError> {
    Measured::from_place(&object.required(key)?, dimension, Range::Positive)
}

fn motion(place: &Place<'_>) -> Result<MotionEntry, KeyError> {
    let object = place.object(&["gauss_markov", "integrated_random_walk"])?;
    match (object.optional("gauss_markov"), object.optional("integrated_random_walk")) {
        (Some(place), None) => {
            let object = place.object(&["std_dev", "correlation_time"])?;
            Ok(MotionEntry::GaussMarkov {
                std_dev: positive(&object, "std_dev", RATE)?,
                correlation_time: positive(&object, "correlation_time", Dimension::TIME)?,
            })
        }
        (None, Some(place)) => {
            let density = positive(&place.object(&["density"])?, "density", JERK)?;
            Ok(MotionEntry::IntegratedRandomWalk { density })
        }
        _ => Err(place.error("expected one of gauss_markov and integrated_random_walk")),
    }
}

/// A name that can stand in tables and before a dot.
fn name(object: &Object<'_>) -> Result<String, KeyError> {
    let place = object.required("name")?;
    let text = place.text()?;
    check_name(text).map_err(|message| place.error(message))?;
    Ok(text.to_string())
}

/// Letters, digits and underscores, so that a name can be part of a state's, a flag's and a column's.
pub fn check_name(text: &str) -> Result<(), String> {
    let fits = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    match !text.is_empty() && text.chars().all(fits) {
        true => Ok(()),
        false => Err(format!("'{}' is no name; expected letters, digits and _", text.escape_debug())),
    }
}

fn aid(place: &Place<'_>, plant: &PlantEntry) -> Result<AidEntry, KeyError> {
    let object = place.object(&["name", "std_dev", "rate", "gauss_markov", "measures"])?;
    let measures = object.optional("measures").map(|p| p.text().map(|text| (p.clone(), text))).transpose()?;
    let dimension = plant.aided(measures.as_ref().map(|m| m.1)).ok_or_else(|| match (&measures, plant) {
        (Some((place, found)), PlantEntry::Custom(_)) => place.error(format!("'{found}' is no output of the plant")),
        (None, PlantEntry::Custom(_)) => place.error("the plant has no output that the sensor does not measure"),
        _ => place.error(format!("the plant '{}' has nothing to aid", plant.name())),
    })?;
    if let (Some((place, _)), false) = (&measures, matches!(plant, PlantEntry::Custom(_))) {
        return Err(place.error(format!("the plant '{}' has one output to aid; leave it out", plant.name())));
    }
    let drift = |place: Place<'_>| {
        let object = place.object(&["std_dev", "correlation_time"])?;
        Ok(AidDrift {
            std_dev: positive(&object, "std_dev", dimension)?,
            correlation_time: positive(&object, "correlation_time", Dimension::TIME)?,
        })
    };
    Ok(AidEntry {
        name: name(&object)?,
        std_dev: positive(&object, "std_dev", dimension)?,
        rate: measured(&object, "rate", Dimension::FREQUENCY)?,
        gauss_markov: object.optional("gauss_markov").map(drift).transpose()?,
        measures: measures.map(|m| m.1.to_string()),
    })
}

fn custom(place: &Place<'_>) -> Result<CustomEntry, KeyError> {
    let object = place.object(&["time", "states", "inputs", "outputs", "A", "B", "G", "H", "sensor"])?;
    let time = object.required("time")?;
    let discrete = match time.text()? {
        "continuous" => false,
        "discrete" => true,
        other => return Err(time.error(format!("expected \"continuous\" or \"discrete\", found \"{other}\""))),
    };
    let states = object.required("states")?.list()?.iter().map(state).collect::<Result<Vec<_>, _>>()?;
    let list = |key: &str| object.optional(key).map_or(Ok(Vec::new()), |p| p.list());
    let inputs = list("inputs")?.iter().map(named).collect::<Result<Vec<_>, _>>()?;
    let outputs = list("outputs")?.iter().map(named).collect::<Result<Vec<_>, _>>()?;
    let sized = |key: &str, rows: usize, columns: Option<usize>| -> Result<Vec<Vec<f64>>, KeyError> {
        let Some(place) = object.optional(key) else {
            let missing = columns.is_none_or(|c| c == 0) || rows == 0;
            let matrix = if rows == 0 { Vec::new() } else { vec![Vec::new(); rows] };
            return if missing { Ok(matrix) } else { object.required(key).map(|_| matrix) };
        };
        matrix(&place, rows, columns)
    };
    let n = states.len();
    let sensor = object.required("sensor")?;
    let sensor_name = sensor.text()?;
    if !inputs.iter().chain(&outputs).any(|port| port.name == sensor_name) {
        return Err(sensor.error(format!("'{sensor_name}' is neither an input nor an output")));
    }
    Ok(CustomEntry {
        discrete,
        a: sized("A", n, Some(n))?,
        b: sized("B", n, Some(inputs.len()))?,
        g: sized("G", n, None)?,
        h: sized("H", outputs.len(), Some(n))?,
        states,
        inputs,
        outputs,
        sensor: sensor_name.to_string(),
    })
}

fn state(place: &Place<'_>) -> Result<StateEntry, KeyError> {
    let object = place.object(&["name", "unit", "mean", "std_dev"])?;
    let unit = si_unit(&object)?;
    let dimension = unit.dimension();
    let std_dev = Measured::from_place(&object.required("std_dev")?, dimension, Range::Any)?;
    if std_dev.value < 0.0 {
        return Err(object.required("std_dev")?.error("a standard deviation cannot be negative"));
    }
    Ok(StateEntry {
        name: name(&object)?,
        unit: unit.text().to_string(),
        mean: object.optional("mean").map(|p| Measured::from_place(&p, dimension, Range::Any)).transpose()?,
        std_dev,
    })
}

fn named(place: &Place<'_>) -> Result<NamedEntry, KeyError> {
    let object = place.object(&["name", "unit"])?;
    Ok(NamedEntry { name: name(&object)?, unit: si_unit(&object)?.text().to_string() })
}

/// A unit without a factor: the matrices are SI.
fn si_unit(object: &Object<'_>) -> Result<Unit, KeyError> {
    let place = object.required("unit")?;
    let text = place.text()?;
    let unit = Unit::parse(text).map_err(|e| place.error(e.to_string()))?;
    if unit.scale() != 1.0 {
        return Err(place.error(format!("'{text}' is not an SI unit; the matrices of a plant are in SI")));
    }
    Ok(unit)
}

/// Rows of numbers; `columns` unknown: those of the first row.
fn matrix(place: &Place<'_>, rows: usize, columns: Option<usize>) -> Result<Vec<Vec<f64>>, KeyError> {
    let numbers = |row: &Place<'_>| row.list()?.iter().map(Place::number).collect::<Result<Vec<f64>, _>>();
    let found = place.list()?.iter().map(numbers).collect::<Result<Vec<_>, _>>()?;
    let columns = columns.unwrap_or_else(|| found.first().map_or(0, Vec::len));
    if found.len() != rows || found.iter().any(|row| row.len() != columns) {
        let lengths: Vec<String> = found.iter().map(|row| row.len().to_string()).collect();
        return Err(place.error(format!(
            "expected {rows} rows of {columns} numbers, found rows of {}",
            if lengths.is_empty() { "nothing".into() } else { lengths.join(", ") }
        )));
    }
    Ok(found)
}
