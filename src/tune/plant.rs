//! The documented plant and its aids, joined with the sensor of an axis.

use nalgebra::{DMatrix, DVector};

use super::flicker::FlickerApproximation;
use super::{TuneError, TuneOptions, sensor};
use crate::model::plant::{self, Plant, custom, rate, vertical};
use crate::model::{Attached, LinearModel, ModelError, Named, Port, aid_errors, augment};
use crate::noise::Term;
use crate::params::{AidEntry, AxisParams, CustomEntry, Design, MotionEntry, NamedEntry, PlantEntry};
use crate::units::{Quantity, Unit, digits};

/// Spread of an angle nobody described: uniform over the circle.
const ANY_ANGLE: f64 = std::f64::consts::PI / 1.732_050_807_568_877_2;
/// Spread of a tilt nobody described: 30 deg.
const ANY_TILT: f64 = std::f64::consts::PI / 6.0;
/// Spread of a rate nobody described: 100 deg/s.
const ANY_RATE: f64 = 100.0 * std::f64::consts::PI / 180.0;

/// A plant joined with its sensors, and the decisions that led to it.
#[derive(Clone, Debug)]
pub struct Joined {
    pub model: LinearModel,
    /// Process noise with names of its own.
    pub noise: Vec<(String, DMatrix<f64>)>,
    pub flicker: Option<FlickerApproximation>,
    pub warnings: Vec<String>,
}

/// A sensor that is joined to the plant.
struct Part {
    name: String,
    errors: LinearModel,
    port: Port,
    every: usize,
}

/// The plant of `design` with the sensor of `axis` and the aids.
pub(super) fn build(
    axis: &AxisParams,
    quantity: Quantity,
    dt: f64,
    design: &Design,
    options: &TuneOptions,
) -> Result<Joined, TuneError> {
    let failed = |source: ModelError| TuneError::Model { axis: axis.name.clone(), source };
    let plant = plant_of(design, quantity, dt).map_err(failed)?;
    let sensor = sensor::build(axis, quantity, dt, options.flicker_horizon_s)?;
    let mut warnings = sensor.warnings;
    let port = sensor_port(&design.plant, &plant, quantity).map_err(failed)?;
    let mut parts = vec![Part { name: String::new(), errors: sensor.model, port, every: 1 }];
    if let PlantEntry::Vertical { accelerometer, .. } = &design.plant {
        let built = sensor::build(accelerometer, Quantity::SpecificForce, dt, options.flicker_horizon_s)?;
        warnings.extend(built.warnings.iter().map(|warning| format!("accelerometer: {warning}")));
        let port = Port::Output(vertical::SPECIFIC_FORCE);
        parts.push(Part { name: "accelerometer".into(), errors: built.model, port, every: 1 });
    }
    for aid in &design.aids {
        parts.push(aid_part(aid, &design.plant, &plant, &mut warnings).map_err(failed)?);
    }
    if !parts.iter().any(|part| matches!(part.port, Port::Output(_))) {
        let output = plant.outputs.first().map_or("the plant", |output| output.name.as_str());
        return Err(TuneError::NoAid { axis: axis.name.clone(), output: output.to_owned() });
    }
    warn_slow_aids(axis, &parts, dt, &mut warnings);
    let attached: Vec<Attached<'_>> = parts
        .iter()
        .map(|part| Attached { name: &part.name, errors: &part.errors, port: part.port, every: part.every })
        .collect();
    let augmented = augment(&plant, &attached).map_err(failed)?;
    Ok(Joined { model: augmented.model, noise: augmented.noise, flicker: sensor.flicker, warnings })
}

fn plant_of(design: &Design, quantity: Quantity, dt: f64) -> Result<Plant, ModelError> {
    let gyro = !matches!(design.plant, PlantEntry::Static | PlantEntry::Custom(_));
    if gyro && quantity != Quantity::AngularRate {
        let message = format!(
            "the plant '{}' needs an angular rate, the parameters are of a {}; use the plant static or custom",
            design.plant.name(),
            quantity.name()
        );
        return Err(ModelError::Part { part: "plant".into(), message });
    }
    match &design.plant {
        PlantEntry::Static => Ok(plant::at_rest(quantity, dt)),
        PlantEntry::Angle { initial_std_dev } => {
            plant::angle::plant(initial_std_dev.as_ref().map_or(ANY_ANGLE, |m| m.si()), dt)
        }
        PlantEntry::Rate { motion, initial_std_dev } => {
            let motion = match motion {
                MotionEntry::GaussMarkov { std_dev, correlation_time } => {
                    rate::Motion::GaussMarkov { std_dev: std_dev.si(), correlation_time: correlation_time.si() }
                }
                MotionEntry::IntegratedRandomWalk { density } => rate::Motion::IntegratedRandomWalk {
                    density: density.si(),
                    initial_std_dev: initial_std_dev.as_ref().map_or(ANY_RATE, |m| m.si()),
                },
            };
            rate::plant(motion, dt)
        }
        PlantEntry::Vertical { gravity, initial_std_dev, .. } => vertical::plant(
            gravity.as_ref().map_or(vertical::STANDARD_GRAVITY, |m| m.si()),
            initial_std_dev.as_ref().map_or(ANY_TILT, |m| m.si()),
            dt,
        ),
        PlantEntry::Attitude(_) => Err(not_linear()),
        PlantEntry::Custom(entry) => custom::plant(&matrices(entry), dt),
    }
}

/// The attitude has a filter of its own.
fn not_linear() -> ModelError {
    let message = "'attitude' is not linear; its filter is made by tune with `plant` attitude and run by replay alone";
    ModelError::Part { part: "plant".into(), message: message.into() }
}

fn matrices(entry: &CustomEntry) -> custom::Matrices {
    let n = entry.states.len();
    let matrix = |rows: &[Vec<f64>], count: usize| {
        let columns = rows.first().map_or(0, Vec::len);
        DMatrix::from_fn(count, columns, |i, j| rows[i][j])
    };
    let named = |entries: &[NamedEntry]| -> Vec<Named> {
        entries.iter().map(|e| Named { name: e.name.clone(), unit: e.unit.clone() }).collect()
    };
    custom::Matrices {
        discrete: entry.discrete,
        states: entry.states.iter().map(|s| Named { name: s.name.clone(), unit: s.unit.clone() }).collect(),
        inputs: named(&entry.inputs),
        outputs: named(&entry.outputs),
        a: matrix(&entry.a, n),
        b: matrix(&entry.b, n),
        g: matrix(&entry.g, n),
        h: matrix(&entry.h, entry.outputs.len()),
        x0: DVector::from_iterator(n, entry.states.iter().map(|s| s.mean.as_ref().map_or(0.0, |m| m.si()))),
        std_dev: DVector::from_iterator(n, entry.states.iter().map(|s| s.std_dev.si())),
    }
}

/// Where the sensor of the document belongs; of a custom plant by name, with the unit checked.
fn sensor_port(entry: &PlantEntry, plant: &Plant, quantity: Quantity) -> Result<Port, ModelError> {
    let PlantEntry::Custom(custom) = entry else {
        return Ok(if plant.inputs.is_empty() { Port::Output(0) } else { Port::Input(0) });
    };
    let at = |ports: &[Named]| ports.iter().position(|port| port.name == custom.sensor);
    let (port, unit) = match (at(&plant.inputs), at(&plant.outputs)) {
        (Some(i), _) => (Port::Input(i), &plant.inputs[i].unit),
        (None, Some(i)) => (Port::Output(i), &plant.outputs[i].unit),
        (None, None) => {
            let message = format!("'{}' is neither an input nor an output", custom.sensor);
            return Err(ModelError::Part { part: "sensor".into(), message });
        }
    };
    let fits = Unit::parse(unit).is_ok_and(|unit| unit.dimension() == quantity.dimension());
    if !fits {
        let message = format!("'{}' is in {unit}, but the sensor measures in {}", custom.sensor, quantity.si_unit());
        return Err(ModelError::Part { part: "sensor".into(), message });
    }
    Ok(port)
}

fn aid_part(aid: &AidEntry, entry: &PlantEntry, plant: &Plant, warnings: &mut Vec<String>) -> Result<Part, ModelError> {
    let wrong = |message: String| ModelError::Part { part: format!("aid '{}'", aid.name), message };
    let output = match entry {
        PlantEntry::Vertical { .. } => vertical::TILT,
        PlantEntry::Custom(custom) => {
            let named = |o: &Named| aid.measures.as_ref().map_or(o.name != custom.sensor, |name| o.name == *name);
            plant.outputs.iter().position(named).ok_or_else(|| wrong("measures no output of the plant".into()))?
        }
        PlantEntry::Static => return Err(wrong("the plant 'static' has nothing to aid; choose a plant".into())),
        PlantEntry::Attitude(_) => return Err(not_linear()),
        PlantEntry::Angle { .. } | PlantEntry::Rate { .. } => 0,
    };
    let sample_rate_hz = 1.0 / plant.dt;
    let every = aid.every(sample_rate_hz).map_err(wrong)?;
    let taken_at = sample_rate_hz / every as f64;
    if aid.rate.as_ref().is_some_and(|rate| (taken_at / rate.si() - 1.0).abs() > 1e-6) {
        warnings.push(format!("{} is taken every {every} samples, at {} Hz", aid.name, digits(taken_at)));
    }
    let drift = aid.gauss_markov.as_ref().map(|d| [d.std_dev.si(), d.correlation_time.si()]);
    let errors = aid_errors(plant.outputs[output].clone(), aid.std_dev.si(), drift, plant.dt)?;
    Ok(Part { name: aid.name.clone(), errors, port: Port::Output(output), every })
}

/// A drift that changes between two measurements of the fastest aid is not followed.
fn warn_slow_aids(axis: &AxisParams, parts: &[Part], dt: f64, warnings: &mut Vec<String>) {
    let fastest = parts.iter().filter(|part| matches!(part.port, Port::Output(_))).map(|part| part.every).min();
    let Some(interval) = fastest.map(|every| every as f64 * dt) else { return };
    let quickest = axis.noise().terms.into_iter().filter_map(|term| match term {
        Term::GaussMarkov { correlation_time, .. } => Some(correlation_time),
        _ => None,
    });
    if let Some(tc) = quickest.min_by(f64::total_cmp).filter(|tc| *tc < interval) {
        warnings.push(format!(
            "the aid is slower than the drift: a measurement every {} s, a correlation time of {} s; the drift is \
             hardly followed, its \
             estimate has decayed before the next one",
            digits(interval),
            digits(tc)
        ));
    }
}
