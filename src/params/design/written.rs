//! The `design` section as it is written, and its schema.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, Serializer};

use super::{AidDrift, AidEntry, CustomEntry, Design, MotionEntry, NamedEntry, PlantEntry, StateEntry};
use crate::params::{AxisParams, Measured};

/// The section as it is written.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Design")]
struct DesignDocument {
    /// "static", "angle", "rate", "vertical", "attitude" or "custom".
    plant: String,
    /// Plant rate: how the true rate moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    motion: Option<MotionDocument>,
    /// Plants vertical and attitude: the noise of the accelerometer, with the keys of an axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    accelerometer: Option<AxisParams>,
    /// Plants vertical and attitude; standard gravity when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    gravity: Option<Measured>,
    /// Plant attitude: spread of scale factors and misalignments of the gyro, for example "0.5 %"; that when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    scale_factor: Option<Measured>,
    /// Spread of the angle or rate before the first measurement.
    #[serde(skip_serializing_if = "Option::is_none")]
    initial_std_dev: Option<Measured>,
    /// Plant custom: its matrices.
    #[serde(skip_serializing_if = "Option::is_none")]
    custom: Option<CustomDocument>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    aids: Vec<AidDocument>,
}

/// One of the two.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "Motion")]
enum MotionDocument {
    GaussMarkov {
        std_dev: Measured,
        correlation_time: Measured,
    },
    /// Density of the random walk of the acceleration.
    IntegratedRandomWalk {
        density: Measured,
    },
}

/// Another measurement of the plant.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Aid")]
struct AidDocument {
    name: String,
    /// White noise of one measurement.
    std_dev: Measured,
    /// Measurements per second; every sample when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    rate: Option<Measured>,
    /// Error that is correlated in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    gauss_markov: Option<DriftDocument>,
    /// Output of a custom plant.
    #[serde(skip_serializing_if = "Option::is_none")]
    measures: Option<String>,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AidDrift")]
struct DriftDocument {
    std_dev: Measured,
    correlation_time: Measured,
}

/// continuous: dx/dt = A x + B u + G w, w white of unit two-sided density; discrete: x(k+1) = A x(k) + B u(k) + G
/// w(k), w ~ N(0, I); y = H x. SI numbers, row by row.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "CustomPlant")]
struct CustomDocument {
    /// "continuous" or "discrete".
    time: String,
    states: Vec<StateDocument>,
    #[serde(default)]
    inputs: Vec<NamedEntry>,
    #[serde(default)]
    outputs: Vec<NamedEntry>,
    #[serde(rename = "A")]
    a: Vec<Vec<f64>>,
    #[serde(rename = "B", default)]
    b: Vec<Vec<f64>>,
    #[serde(rename = "G", default)]
    g: Vec<Vec<f64>>,
    #[serde(rename = "H", default)]
    h: Vec<Vec<f64>>,
    /// The input or output that the sensor is.
    sensor: String,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "PlantState")]
struct StateDocument {
    name: String,
    /// SI unit.
    unit: String,
    /// Before the first measurement; zero when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    mean: Option<Measured>,
    /// Spread before the first measurement.
    std_dev: Measured,
}

impl From<&Design> for DesignDocument {
    fn from(design: &Design) -> Self {
        let mut document = DesignDocument {
            plant: design.plant.name().to_string(),
            motion: None,
            accelerometer: None,
            gravity: None,
            scale_factor: None,
            initial_std_dev: None,
            custom: None,
            aids: design.aids.iter().map(AidDocument::from).collect(),
        };
        match design.plant.clone() {
            PlantEntry::Static => {}
            PlantEntry::Angle { initial_std_dev } => document.initial_std_dev = initial_std_dev,
            PlantEntry::Rate { motion, initial_std_dev } => {
                document.motion = Some(match motion {
                    MotionEntry::GaussMarkov { std_dev, correlation_time } => {
                        MotionDocument::GaussMarkov { std_dev, correlation_time }
                    }
                    MotionEntry::IntegratedRandomWalk { density } => MotionDocument::IntegratedRandomWalk { density },
                });
                document.initial_std_dev = initial_std_dev;
            }
            PlantEntry::Vertical { accelerometer, gravity, initial_std_dev } => {
                document.accelerometer = Some(*accelerometer);
                document.gravity = gravity;
                document.initial_std_dev = initial_std_dev;
            }
            PlantEntry::Attitude(entry) => {
                document.accelerometer = Some(entry.accelerometer);
                document.gravity = entry.gravity;
                document.scale_factor = entry.scale_factor;
            }
            PlantEntry::Custom(custom) => document.custom = Some(CustomDocument::from(*custom)),
        }
        document
    }
}

impl From<&AidEntry> for AidDocument {
    fn from(aid: &AidEntry) -> Self {
        let drift = |d: AidDrift| DriftDocument { std_dev: d.std_dev, correlation_time: d.correlation_time };
        AidDocument {
            name: aid.name.clone(),
            std_dev: aid.std_dev.clone(),
            rate: aid.rate.clone(),
            gauss_markov: aid.gauss_markov.clone().map(drift),
            measures: aid.measures.clone(),
        }
    }
}

impl From<CustomEntry> for CustomDocument {
    fn from(custom: CustomEntry) -> Self {
        let state = |s: StateEntry| StateDocument { name: s.name, unit: s.unit, mean: s.mean, std_dev: s.std_dev };
        CustomDocument {
            time: if custom.discrete { "discrete" } else { "continuous" }.to_string(),
            states: custom.states.into_iter().map(state).collect(),
            inputs: custom.inputs,
            outputs: custom.outputs,
            a: custom.a,
            b: custom.b,
            g: custom.g,
            h: custom.h,
            sensor: custom.sensor,
        }
    }
}

impl Serialize for Design {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        DesignDocument::from(self).serialize(serializer)
    }
}

impl JsonSchema for Design {
    fn schema_name() -> Cow<'static, str> {
        DesignDocument::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        DesignDocument::json_schema(generator)
    }
}
