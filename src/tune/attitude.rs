//! The plant attitude: parameters into the filter of [`crate::filter::attitude`].

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use super::{TuneError, sensor};
use crate::filter::attitude::{
    Acceleration, Accelerometer, AttitudeDesign, AttitudeModel, Heading, HeadingModel, Mekf, RestModel, Row,
};
use crate::model::plant::vertical::STANDARD_GRAVITY;
use crate::model::{LinearModel, ModelError};
use crate::params::{AidEntry, AttitudeEntry, AxisParams, Design, Measured, Params, PlantEntry, TermEntry};
use crate::units::{Quantity, digits};

/// Scale factors and misalignments of a calibrated gyro: 0.5 %.
const SCALE: f64 = 0.005;
/// What is left of them and changes, 0.15 % of the rate as white noise over one second.
const MOTION: f64 = 0.0015;
/// Of an accelerometer nobody described: 3 mg.
const FORCE_BIAS: f64 = 0.03;
/// A gyro of which no drift was identified drifts all the same: a random walk of 0.0005 deg/s/sqrt(s), 0.03 deg/s in
/// an hour.
const UNSEEN_DRIFT: &str = "0.0005 deg/s/sqrt(s)";
/// Body motions: ω₀ = 8 rad/s, that is velocities that last an eighth of a second; a rest is quieter than 0.05 m/s²;
/// horizontal motion may be twice the vertical one, whose mean square is taken over a second.
const ACCELERATION: Acceleration = Acceleration { std_dev: 0.05, ratio: 2.0, frequency: 8.0, memory: 1.0 };
/// An aid of which nothing is said but its white noise may still be disturbed.
const HEADING_TIME: f64 = 1.0;
/// A magnetometer may be late by 20 ms, and by 5 ms more or less from one measurement to the next.
const DELAY: f64 = 0.02;
const JITTER: f64 = 0.005;
const HEADING_MEMORY: f64 = 1.0;
const REFERENCE_TIME: f64 = 60.0;
/// The body rests when its sensors spread less than twice their own noise over this time, s.
const REST_WINDOW: f64 = 1.5;
const REST_SPREAD: f64 = 2.0;
const OUTLIER: f64 = 4.0;

/// A design with what it promises for a body at rest.
#[derive(Clone, Debug)]
pub struct TunedAttitude {
    pub design: AttitudeDesign,
    pub at_rest: Vec<AtRest>,
    /// What was decided where the parameters left a choice.
    pub warnings: Vec<String>,
}

/// Predicted sigmas after so long a rest, SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AtRest {
    pub time_s: f64,
    /// The larger of the two.
    pub inclination: f64,
    pub heading: f64,
    /// Drift of each gyro axis, of a body that lies level.
    pub drift: [f64; 3],
}

/// The attitude filter of `params`, three axes x, y, z of a gyro in this order.
///
/// Errors: another quantity or number of axes, more than one heading aid, no white noise, a model that cannot be made.
pub fn tune_attitude(params: &Params, design: &Design, flicker_horizon_s: f64) -> Result<TunedAttitude, TuneError> {
    let PlantEntry::Attitude(entry) = &design.plant else {
        return Err(plant_error("attitude", format!("the plant is '{}'", design.plant.name())));
    };
    if params.quantity != Quantity::AngularRate {
        let found = params.quantity.name();
        return Err(plant_error("plant", format!("'attitude' needs an angular rate, the parameters are of a {found}")));
    }
    let [x, y, z] = params.axes.as_slice() else {
        let names: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
        let message = format!("'attitude' needs the three axes x, y, z; found {} ({})", names.len(), names.join(", "));
        return Err(plant_error("plant", message));
    };
    let dt = 1.0 / params.sample_rate_hz;
    let mut warnings = Vec::new();
    let mut gyro = Vec::with_capacity(3);
    let axes = [x, y, z].map(|axis| drifting(axis, &mut warnings));
    for axis in &axes {
        gyro.push(errors(axis, Quantity::AngularRate, dt, flicker_horizon_s, &mut warnings)?);
    }
    let spread = std::array::from_fn(|i| REST_SPREAD * gyro[i].r[(0, 0)].sqrt());
    let Ok(gyro) = <[LinearModel; 3]>::try_from(gyro) else {
        return Err(plant_error("plant", "'attitude' needs three axes".into()));
    };
    let mut force_warnings = Vec::new();
    let force = errors(&entry.accelerometer, Quantity::SpecificForce, dt, flicker_horizon_s, &mut force_warnings)?;
    warnings.extend(bias_of(entry, &force));
    let model = AttitudeModel {
        dt,
        gyro,
        scale_std_dev: entry.scale_factor.as_ref().map_or(SCALE, |m| m.si()),
        motion_density: MOTION,
        gravity: entry.gravity.as_ref().map_or(STANDARD_GRAVITY, |m| m.si()),
        accelerometer: Accelerometer { variance: force.r[(0, 0)], bias_std_dev: force_bias(entry, &force) },
        acceleration: ACCELERATION,
        heading: heading(&design.aids, &mut warnings)?,
        rest: RestModel { window: REST_WINDOW, gyro: spread, accelerometer: REST_SPREAD * force.r[(0, 0)].sqrt() },
        outlier: OUTLIER,
    };
    let at_rest = predicted(&model);
    let mut tuning = json!({
        "method": "the documented noise terms, discretised exactly, and stated figures of motion and heading; nothing \
                   is fitted",
        "decisions": warnings,
    });
    super::record_check(params, &mut tuning);
    let design = AttitudeDesign {
        sample_rate_hz: params.sample_rate_hz,
        axes: axes.each_ref().map(|axis| axis.name.clone()),
        model,
        design: Some(design.clone()),
        noise: axes.to_vec(),
        tuning,
    };
    Ok(TunedAttitude { design, at_rest, warnings })
}

fn plant_error(part: &str, message: String) -> TuneError {
    TuneError::Attitude { source: ModelError::Part { part: part.into(), message } }
}

/// The axis with a random walk where the parameters have no drift.
fn drifting(axis: &AxisParams, warnings: &mut Vec<String>) -> AxisParams {
    let mut axis = axis.clone();
    let drifts = axis.noise().terms.iter().any(|term| term.kind().is_drift());
    let density = Measured::positive(UNSEEN_DRIFT, Quantity::AngularRate.dimension().times_time(-1));
    if let (false, Ok(density)) = (drifts, density) {
        axis.terms.push(TermEntry::RateRandomWalk { density });
        warnings.push(format!("{}: no drift was identified; a random walk of {UNSEEN_DRIFT} is taken", axis.name));
    }
    axis
}

/// White noise and drift of an axis. Lines, moving averages and quantisation turn a body by nothing in the mean and
/// are left out.
fn errors(
    axis: &AxisParams,
    quantity: Quantity,
    dt: f64,
    horizon_s: f64,
    warnings: &mut Vec<String>,
) -> Result<LinearModel, TuneError> {
    let mut kept = axis.clone();
    kept.terms.retain(|term| {
        !matches!(
            term,
            TermEntry::Quantization { .. }
                | TermEntry::MovingAverage { .. }
                | TermEntry::BandLimit { .. }
                | TermEntry::Oscillation { .. }
        )
    });
    if kept.terms.len() < axis.terms.len() {
        warnings.push(format!(
            "{}: lines, moving averages and quantisation are left out: integrated, they do not grow",
            axis.name
        ));
    }
    let built = sensor::build(&kept, quantity, dt, horizon_s)?;
    warnings.extend(built.warnings.iter().map(|warning| format!("{}: {warning}", axis.name)));
    Ok(built.model)
}

/// Spread of the accelerometer's bias: what is documented of it, and the stationary drift beside it.
fn force_bias(entry: &AttitudeEntry, force: &LinearModel) -> f64 {
    let constant = entry.accelerometer.turn_on_bias.as_ref().map_or(FORCE_BIAS, |m| m.si());
    let moving: f64 = (0..force.states.len())
        .filter(|&i| force.states[i].name != "bias" && force.f[(i, i)] < 1.0)
        .map(|i| force.p0[(i, i)])
        .sum();
    constant.hypot(moving.sqrt())
}

fn bias_of(entry: &AttitudeEntry, force: &LinearModel) -> Option<String> {
    entry.accelerometer.turn_on_bias.is_none().then(|| {
        format!(
            "accelerometer: no turn-on bias is given, its spread is taken as {} m/s^2; give turn_on_bias.std_dev if \
             you know it",
            digits(force_bias(entry, force))
        )
    })
}

fn heading(aids: &[AidEntry], warnings: &mut Vec<String>) -> Result<Option<HeadingModel>, TuneError> {
    let aid = match aids {
        [] => {
            warnings.push("nothing measures the heading: it is free, and only the inclination is known".into());
            return Ok(None);
        }
        [aid] => aid,
        [_, second, ..] => {
            let message = "the plant 'attitude' takes one heading; leave one of them out".to_string();
            return Err(plant_error(&format!("aid '{}'", second.name), message));
        }
    };
    let std_dev = aid.std_dev.si();
    let drift = aid.gauss_markov.as_ref().map(|d| (d.std_dev.si(), d.correlation_time.si()));
    let (disturbance, correlation_time) = drift.unwrap_or((std_dev, HEADING_TIME));
    if drift.is_none() {
        warnings.push(format!(
            "{}: no disturbance is given, it is taken to be as large as its white noise, over {HEADING_TIME} s; a \
             magnetic heading is never \
             only white: \"{0}: 3 deg, 3 deg over 1 s\"",
            aid.name
        ));
    }
    Ok(Some(HeadingModel {
        name: aid.name.clone(),
        std_dev,
        disturbance,
        correlation_time,
        delay_std_dev: DELAY,
        jitter: JITTER,
        memory: HEADING_MEMORY,
        reference_time: REFERENCE_TIME,
    }))
}

/// Covariance of a level body that faces north and rests, with every measurement as expected.
fn predicted(model: &AttitudeModel) -> Vec<AtRest> {
    let mut mekf = Mekf::new(model);
    let force = Vector3::new(0.0, 0.0, model.gravity);
    let mut sigmas = Vec::new();
    for (row, time_s) in [(0.0, 0.0)].into_iter().chain([1.0, 3.0, 10.0, 30.0, 100.0].map(|t| (t / model.dt, t))) {
        let start = sigmas.last().map_or(0.0, |last: &AtRest| last.time_s / model.dt + 1.0);
        for k in (start.round() as u64)..=(row.round() as u64) {
            let rate = Vector3::from_fn(|i, _| (&model.gyro[i].h * &model.gyro[i].x0)[0]);
            // a held field is no measurement, so its strength changes from row to row
            let size = 1.0 + 1e-9 * (k % 2) as f64;
            let heading = model.heading.as_ref().map(|_| Heading::Field(Vector3::new(0.0, size, 0.0)));
            mekf.step(&Row { rate, force, heading }, 0);
        }
        sigmas.push(at(&mekf, time_s));
    }
    sigmas
}

fn at(mekf: &Mekf, time_s: f64) -> AtRest {
    let p: Matrix3<f64> = mekf.attitude_covariance();
    let drift = mekf.drift();
    AtRest {
        time_s,
        inclination: p[(0, 0)].max(p[(1, 1)]).max(0.0).sqrt(),
        heading: p[(2, 2)].max(0.0).sqrt(),
        drift: std::array::from_fn(|i| drift[i].1),
    }
}
