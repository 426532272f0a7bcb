//! The attitude.json document: everything an independent filter needs, SI.

use std::borrow::Cow;
use std::path::Path;

use nalgebra::{DMatrix, DVector};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde_json::Value;

use super::{Acceleration, Accelerometer, AttitudeModel, HeadingModel, RestModel};
use crate::filter::FilterError;
use crate::filter::rows;
use crate::model::{LinearModel, ModelError, Named};
use crate::params::place::{self, KeyError, Object, Place};
use crate::params::{AxisParams, Design, Measured, Range};
use crate::units::{Dimension, Quantity, Unit};

/// A tuned attitude filter: what `tune --plant attitude` writes and `replay` reads.
#[derive(Clone, Debug)]
pub struct AttitudeDesign {
    pub sample_rate_hz: f64,
    /// Names of the gyro's axes x, y, z.
    pub axes: [String; 3],
    pub model: AttitudeModel,
    /// As documented.
    pub design: Option<Design>,
    /// The terms each gyro axis was built from, as documented.
    pub noise: Vec<AxisParams>,
    /// Free-form record.
    pub tuning: Value,
}

/// Layout of attitude.json.
pub(in crate::filter) const FORMAT: &str = "kfdesign-attitude/1";

/// A multiplicative error-state Kalman filter for attitude. It is nonlinear: the equations are those of
/// docs/plants.md, the numbers these. Every number is SI.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Attitude")]
struct Document {
    /// "kfdesign-attitude/1".
    format: String,
    quantity: Quantity,
    /// Frequency, for example "100 Hz".
    sample_rate: Measured,
    /// "attitude".
    plant: String,
    /// The plant and its aids, as in params.json.
    #[serde(skip_serializing_if = "Option::is_none")]
    design: Option<Design>,
    /// Error states in their order, with their units.
    states: Vec<NamedDocument>,
    /// Errors of the axes x, y, z.
    #[schemars(length(min = 3, max = 3))]
    gyro: Vec<GyroDocument>,
    /// Spread of each element of the matrix of scale factors and misalignments.
    scale_std_dev: f64,
    /// Attitude noise per rate, 1/sqrt(Hz).
    motion_density: f64,
    /// m/s^2.
    gravity: f64,
    accelerometer: AccelerometerDocument,
    acceleration: AccelerationDocument,
    #[serde(skip_serializing_if = "Option::is_none")]
    heading: Option<HeadingDocument>,
    rest: RestDocument,
    /// Sigmas beyond which an innovation has its variance inflated.
    outlier: f64,
    #[serde(default, skip_serializing_if = "Value::is_null")]
    tuning: Value,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeState")]
struct NamedDocument {
    name: String,
    unit: String,
}

/// drift = H x, x(k+1) = F x(k) + v, v ~ N(0, Q); the measured rate is the true one, the drift and white noise of
/// variance R.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeGyro")]
struct GyroDocument {
    name: String,
    states: Vec<NamedDocument>,
    #[serde(rename = "F")]
    f: Vec<Vec<f64>>,
    #[serde(rename = "Q")]
    q: Vec<Vec<f64>>,
    #[serde(rename = "H")]
    h: Vec<f64>,
    /// (rad/s)^2.
    #[serde(rename = "R")]
    r: f64,
    x0: Vec<f64>,
    #[serde(rename = "P0")]
    p0: Vec<Vec<f64>>,
    /// As in params.json.
    noise: AxisParams,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeAccelerometer")]
struct AccelerometerDocument {
    /// Of a sample, (m/s^2)^2.
    variance: f64,
    /// m/s^2.
    bias_std_dev: f64,
}

/// Of the body: the derivative of a velocity that is a critically damped second-order process.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeAcceleration")]
struct AccelerationDocument {
    /// Least size, m/s^2.
    std_dev: f64,
    /// Horizontal over vertical size.
    ratio: f64,
    /// rad/s.
    frequency: f64,
    /// Averaging time of the vertical size, s.
    memory: f64,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeHeading")]
struct HeadingDocument {
    name: String,
    /// White, rad.
    std_dev: f64,
    /// Least size of the disturbance, rad.
    disturbance: f64,
    /// s.
    correlation_time: f64,
    /// s.
    delay_std_dev: f64,
    /// s.
    jitter: f64,
    /// s.
    memory: f64,
    /// s.
    reference_time: f64,
}

/// At rest is a window in which no axis spreads more than this.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AttitudeRest")]
struct RestDocument {
    /// s.
    window: f64,
    /// rad/s, of x, y, z.
    gyro: Vec<f64>,
    /// m/s^2.
    accelerometer: f64,
}

impl AttitudeDesign {
    /// Whether a file says that it is of this format; any other file is for others to complain of.
    pub fn is(path: &Path) -> bool {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        place::parse(&text).is_ok_and(|value| value.get("format").is_some_and(|format| format == FORMAT))
    }

    pub fn read(path: &Path) -> Result<AttitudeDesign, FilterError> {
        let shown = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|e| FilterError::Read { path: shown.clone(), reason: e.to_string() })?;
        AttitudeDesign::from_json(&text, &shown)
    }

    /// Reads attitude.json and checks it; every complaint names `path` and the key.
    pub fn from_json(text: &str, path: &str) -> Result<AttitudeDesign, FilterError> {
        let value = place::parse(text).map_err(|e| FilterError::Syntax {
            path: path.into(),
            line: e.line,
            column: e.column,
            message: e.message,
        })?;
        read(&Place::root(&value)).map_err(|e| FilterError::Invalid {
            path: path.into(),
            key: e.key,
            message: e.message,
        })
    }

    /// JSON with one matrix row per line and a trailing newline; every number reads back as the same double.
    pub fn to_json(&self) -> String {
        rows::to_string(&Document::from(self))
    }

    pub fn schema() -> Value {
        schemars::schema_for!(Document).to_value()
    }
}

impl JsonSchema for AttitudeDesign {
    fn schema_name() -> Cow<'static, str> {
        "AttitudeDesign".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Document::json_schema(generator)
    }
}

fn read(root: &Place<'_>) -> Result<AttitudeDesign, KeyError> {
    let known = [
        "format",
        "quantity",
        "sample_rate",
        "plant",
        "design",
        "states",
        "gyro",
        "scale_std_dev",
        "motion_density",
        "gravity",
        "accelerometer",
        "acceleration",
        "heading",
        "rest",
        "outlier",
        "tuning",
    ];
    let object = root.document(FORMAT, "an attitude filter", &known)?;
    let rate = Measured::from_place(&object.required("sample_rate")?, Dimension::FREQUENCY, Range::Positive)?;
    let dt = 1.0 / rate.si();
    let list_place = object.required("gyro")?;
    let list = list_place.list()?;
    let [x, y, z] = list.as_slice() else {
        return Err(list_place.error(format!("found {} axes; expected x, y, z", list.len())));
    };
    let [x, y, z] = [gyro(x, dt)?, gyro(y, dt)?, gyro(z, dt)?];
    let model = AttitudeModel {
        dt,
        gyro: [x.1, y.1, z.1],
        scale_std_dev: not_negative(&object, "scale_std_dev")?,
        motion_density: not_negative(&object, "motion_density")?,
        gravity: positive(&object, "gravity")?,
        accelerometer: accelerometer(&object.required("accelerometer")?)?,
        acceleration: acceleration(&object.required("acceleration")?)?,
        heading: object.optional("heading").map(|place| heading(&place)).transpose()?,
        rest: rest(&object.required("rest")?)?,
        outlier: positive(&object, "outlier")?,
    };
    Ok(AttitudeDesign {
        sample_rate_hz: rate.si(),
        axes: [x.0, y.0, z.0],
        model,
        design: object.optional("design").map(|place| Design::from_place(&place)).transpose()?,
        noise: vec![x.2, y.2, z.2],
        tuning: object.optional("tuning").map_or(Value::Null, |place| place.value().clone()),
    })
}

fn positive(object: &Object<'_>, key: &str) -> Result<f64, KeyError> {
    let place = object.required(key)?;
    let value = place.number()?;
    if value > 0.0 { Ok(value) } else { Err(place.error(format!("found {value}; expected more than 0"))) }
}

fn not_negative(object: &Object<'_>, key: &str) -> Result<f64, KeyError> {
    let place = object.required(key)?;
    let value = place.number()?;
    if value >= 0.0 { Ok(value) } else { Err(place.error(format!("found {value}; expected 0 or more"))) }
}

fn accelerometer(place: &Place<'_>) -> Result<Accelerometer, KeyError> {
    let object = place.object(&["variance", "bias_std_dev"])?;
    Ok(Accelerometer { variance: positive(&object, "variance")?, bias_std_dev: not_negative(&object, "bias_std_dev")? })
}

fn acceleration(place: &Place<'_>) -> Result<Acceleration, KeyError> {
    let object = place.object(&["std_dev", "ratio", "frequency", "memory"])?;
    Ok(Acceleration {
        std_dev: not_negative(&object, "std_dev")?,
        ratio: not_negative(&object, "ratio")?,
        frequency: positive(&object, "frequency")?,
        memory: positive(&object, "memory")?,
    })
}

fn heading(place: &Place<'_>) -> Result<HeadingModel, KeyError> {
    let object = place.object(&[
        "name",
        "std_dev",
        "disturbance",
        "correlation_time",
        "delay_std_dev",
        "jitter",
        "memory",
        "reference_time",
    ])?;
    Ok(HeadingModel {
        name: object.required("name")?.text()?.to_owned(),
        std_dev: positive(&object, "std_dev")?,
        disturbance: not_negative(&object, "disturbance")?,
        correlation_time: positive(&object, "correlation_time")?,
        delay_std_dev: not_negative(&object, "delay_std_dev")?,
        jitter: not_negative(&object, "jitter")?,
        memory: positive(&object, "memory")?,
        reference_time: positive(&object, "reference_time")?,
    })
}

fn rest(place: &Place<'_>) -> Result<RestModel, KeyError> {
    let object = place.object(&["window", "gyro", "accelerometer"])?;
    let list = object.required("gyro")?;
    let gyro = numbers(&list)?;
    let [x, y, z] = gyro[..] else {
        return Err(list.error(format!("found {} numbers; expected one per axis", gyro.len())));
    };
    if gyro.iter().any(|value| *value < 0.0) {
        return Err(list.error("a standard deviation cannot be negative"));
    }
    Ok(RestModel {
        window: positive(&object, "window")?,
        gyro: [x, y, z],
        accelerometer: not_negative(&object, "accelerometer")?,
    })
}

fn numbers(place: &Place<'_>) -> Result<Vec<f64>, KeyError> {
    place.list()?.iter().map(Place::number).collect()
}

fn gyro(place: &Place<'_>, dt: f64) -> Result<(String, LinearModel, AxisParams), KeyError> {
    let object = place.object(&["name", "states", "F", "Q", "H", "R", "x0", "P0", "noise"])?;
    let name = object.required("name")?.text()?.to_owned();
    let states = object.required("states")?.list()?.iter().map(state).collect::<Result<Vec<_>, _>>()?;
    let n = states.len();
    let square = |key: &str| {
        let place = object.required(key)?;
        let rows = place.list()?.iter().map(numbers).collect::<Result<Vec<_>, _>>()?;
        match rows.len() == n && rows.iter().all(|row| row.len() == n) {
            true => Ok(DMatrix::from_fn(n, n, |i, j| rows[i][j])),
            false => Err(place.error(format!("expected {n} rows of {n} numbers, one per state"))),
        }
    };
    let list = |key: &str| {
        let place = object.required(key)?;
        let found = numbers(&place)?;
        match found.len() == n {
            true => Ok(found),
            false => Err(place.error(format!("found {} numbers; expected one per state, {n}", found.len()))),
        }
    };
    let unit = Quantity::AngularRate.si_unit();
    let model = LinearModel {
        dt,
        f: square("F")?,
        q: square("Q")?,
        h: DMatrix::from_row_slice(1, n, &list("H")?),
        r: DMatrix::from_element(1, 1, positive(&object, "R")?),
        x0: DVector::from_vec(list("x0")?),
        p0: square("P0")?,
        g: DMatrix::zeros(n, 0),
        states,
        inputs: Vec::new(),
        measurements: vec![Named { name: "angular_rate".into(), unit: unit.into() }],
        every: vec![1],
        outputs: Vec::new(),
    };
    model.check().map_err(|error| match error {
        ModelError::Part { part, message } => KeyError { key: format!("{}.{part}", place.key()), message },
        other => place.error(other.to_string()),
    })?;
    let noise = AxisParams::from_place(&object.required("noise")?, Quantity::AngularRate)?;
    Ok((name, model, noise))
}

fn state(place: &Place<'_>) -> Result<Named, KeyError> {
    let object = place.object(&["name", "unit"])?;
    let unit = object.required("unit")?;
    let text = unit.text()?;
    Unit::parse(text).map_err(|e| unit.error(e.to_string()))?;
    Ok(Named { name: object.required("name")?.text()?.to_owned(), unit: text.to_owned() })
}

fn rows_of(a: &DMatrix<f64>) -> Vec<Vec<f64>> {
    a.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn named(states: &[Named]) -> Vec<NamedDocument> {
    states.iter().map(|s| NamedDocument { name: s.name.clone(), unit: s.unit.clone() }).collect()
}

impl From<&AttitudeDesign> for Document {
    fn from(design: &AttitudeDesign) -> Self {
        let AttitudeModel { gravity, scale_std_dev, motion_density, outlier, .. } = design.model;
        let [x, y, z] = &design.axes;
        let gyro = design.model.gyro.iter().zip(&design.axes).zip(&design.noise);
        Document {
            format: FORMAT.to_owned(),
            quantity: Quantity::AngularRate,
            sample_rate: Measured { value: design.sample_rate_hz, unit: Unit::hertz(), interval: None },
            plant: "attitude".to_owned(),
            design: design.design.clone(),
            states: named(&design.model.states([x, y, z])),
            gyro: gyro
                .map(|((model, name), noise)| GyroDocument {
                    name: name.clone(),
                    states: named(&model.states),
                    f: rows_of(&model.f),
                    q: rows_of(&model.q),
                    h: model.h.iter().copied().collect(),
                    r: model.r[(0, 0)],
                    x0: model.x0.iter().copied().collect(),
                    p0: rows_of(&model.p0),
                    noise: noise.clone(),
                })
                .collect(),
            scale_std_dev,
            motion_density,
            gravity,
            accelerometer: AccelerometerDocument {
                variance: design.model.accelerometer.variance,
                bias_std_dev: design.model.accelerometer.bias_std_dev,
            },
            acceleration: AccelerationDocument {
                std_dev: design.model.acceleration.std_dev,
                ratio: design.model.acceleration.ratio,
                frequency: design.model.acceleration.frequency,
                memory: design.model.acceleration.memory,
            },
            heading: design.model.heading.as_ref().map(|h| HeadingDocument {
                name: h.name.clone(),
                std_dev: h.std_dev,
                disturbance: h.disturbance,
                correlation_time: h.correlation_time,
                delay_std_dev: h.delay_std_dev,
                jitter: h.jitter,
                memory: h.memory,
                reference_time: h.reference_time,
            }),
            rest: RestDocument {
                window: design.model.rest.window,
                gyro: design.model.rest.gyro.to_vec(),
                accelerometer: design.model.rest.accelerometer,
            },
            outlier,
            tuning: design.tuning.clone(),
        }
    }
}
