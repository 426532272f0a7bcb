//! linear.json: a steady flight, the small motions about it, their modes, levels and controllability. SI and rad.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use super::controllability::{Reach, controllability, gramian, observability};
use crate::aircraft::airframe::levels::{CAUTION, cap, criteria, load_per_angle};
use crate::aircraft::airframe::linear::{LinearModel, LinearModels, Port};
use crate::aircraft::airframe::modes::{Mode, modes};
use crate::aircraft::airframe::trim::{Trim, TrimRequest};
use crate::aircraft::airframe::{Airplane, Propulsion};
use crate::numerics::linalg::LinalgError;

pub const FORMAT: &str = "kfdesign-linear/1";
/// Of the Gramian, s.
pub const HORIZON: f64 = 5.0;
/// A control is near its stop when less than this share of the way from the middle is left.
const NEAR_STOP: f64 = 0.1;
/// Beyond it the linear coefficients of small airplanes are extrapolated, rad.
const LARGE_ALPHA: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// A steady flight and the linear model about it; SI units and radians.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Linear")]
pub struct LinearDocument {
    #[schemars(extend("const" = FORMAT))]
    pub format: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub airplane: String,
    pub trim: TrimDocument,
    pub models: ModelsDocument,
    /// Of the longitudinal, the lateral and the full model.
    pub modes: Vec<ModeDocument>,
    /// Load factor per angle of attack, 1/rad.
    pub load_per_angle: f64,
    /// Control anticipation parameter, rad²/s² per g; null without a short period.
    pub cap: Option<f64>,
    pub criteria: Vec<CriterionDocument>,
    /// What the limits of the criteria are worth.
    pub caution: &'static str,
    /// Full size over model, as Froude's law takes it; null: levels as flown only.
    pub froude_scale: Option<f64>,
    pub controllability: Vec<ReachDocument>,
    pub observability: Vec<ReachDocument>,
    pub gramians: Vec<GramianDocument>,
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Trim")]
pub struct TrimDocument {
    pub airspeed: f64,
    pub altitude: f64,
    pub density: f64,
    pub climb: f64,
    pub turn_rate: f64,
    pub alpha: f64,
    pub beta: f64,
    pub phi: f64,
    pub theta: f64,
    /// Any: it is zero here.
    pub psi: f64,
    pub u: f64,
    pub v: f64,
    pub w: f64,
    pub p: f64,
    pub q: f64,
    pub r: f64,
    pub elevator: f64,
    pub aileron: f64,
    pub rudder: f64,
    /// 0 to 1; null for an airplane whose propulsion is a thrust.
    pub throttle: Option<f64>,
    pub thrust: f64,
    /// Of the propeller on its shaft, N m.
    pub torque: f64,
    /// Of the propeller, rad/s.
    pub propeller_rate: f64,
    pub current: f64,
    /// Aerodynamics and propulsion over mass, body axes: what an accelerometer shows.
    pub specific_force: [f64; 3],
    /// Largest of six accelerations and of the conditions, SI.
    pub residual: f64,
    /// Of controls that have stops: how much of the way from the middle to the stop is used.
    pub used: Vec<UsedDocument>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Used")]
pub struct UsedDocument {
    pub control: &'static str,
    /// 1 at the stop.
    pub share: f64,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Models")]
pub struct ModelsDocument {
    pub longitudinal: ModelDocument,
    pub lateral: ModelDocument,
    pub full: ModelDocument,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Port")]
pub struct PortDocument {
    pub name: &'static str,
    pub unit: &'static str,
}

/// dx/dt = A x + B u + E g, deviations from the trim; rows of numbers.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Model")]
pub struct ModelDocument {
    pub states: Vec<PortDocument>,
    pub inputs: Vec<PortDocument>,
    pub gusts: Vec<PortDocument>,
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    #[serde(rename = "E")]
    pub e: Vec<Vec<f64>>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Mode")]
pub struct ModeDocument {
    /// short_period, phugoid, dutch_roll, roll, spiral, oscillation, real.
    pub name: &'static str,
    /// longitudinal, lateral, full.
    pub model: &'static str,
    /// [real, imaginary], of a pair the one above the axis.
    pub eigenvalue: [f64; 2],
    /// Of its modulus, rad/s.
    pub frequency: f64,
    pub damping: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_to_half: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_to_double: Option<f64>,
    /// Of a real mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_constant: Option<f64>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Criterion")]
pub struct CriterionDocument {
    pub name: &'static str,
    /// Flight phases A, B or C.
    pub category: &'static str,
    pub unit: &'static str,
    pub value: Option<f64>,
    /// 1 to 3, 4 beyond Level 3; null: not judged.
    pub level: Option<u8>,
    /// By Froude's law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scaled_value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scaled_level: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// How a mode is reached or seen. It depends on units: SI and rad here, and once more with velocities divided by the
/// airspeed, so that every state is an angle or a rate.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Reach")]
pub struct ReachDocument {
    pub mode: &'static str,
    pub model: &'static str,
    /// Inputs or outputs.
    pub by: Vec<&'static str>,
    /// Smallest singular value of [A − λI, B], or of [A − λI; C].
    pub pbh: f64,
    /// Modal measure of each: cosine between eigenvector and column.
    pub cosines: Vec<f64>,
    /// Velocities over the airspeed.
    pub pbh_scaled: f64,
    /// Velocities over the airspeed.
    pub cosines_scaled: Vec<f64>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Gramian")]
pub struct GramianDocument {
    pub model: &'static str,
    pub by: Vec<&'static str>,
    /// s.
    pub horizon: f64,
    /// Ascending, velocities divided by the airspeed.
    pub eigenvalues: Vec<f64>,
    pub condition: f64,
}

/// Everything that the document is made of.
#[derive(Clone, Debug)]
pub struct Linearized {
    pub trim: Trim,
    pub models: LinearModels,
    pub longitudinal: Vec<Mode>,
    pub lateral: Vec<Mode>,
    pub full: Vec<Mode>,
}

impl Linearized {
    pub fn new(airplane: &Airplane, trim: Trim) -> Result<Linearized, LinalgError> {
        let models = airplane.linear(&trim);
        let speed = trim.airspeed();
        Ok(Linearized {
            longitudinal: modes(&models.longitudinal, speed)?,
            lateral: modes(&models.lateral, speed)?,
            full: modes(&models.full, speed)?,
            trim,
            models,
        })
    }

    pub fn document(
        &self,
        airplane: &Airplane,
        request: &TrimRequest,
        froude: Option<f64>,
    ) -> Result<LinearDocument, LinalgError> {
        let Linearized { trim, models, longitudinal, lateral, full } = self;
        let speed = trim.airspeed();
        let trim_document = trim_document(airplane, trim, request);
        let all = [(&models.longitudinal, longitudinal), (&models.lateral, lateral), (&models.full, full)];
        let criteria =
            criteria(airplane, trim, models, [longitudinal, lateral], froude).into_iter().map(|c| CriterionDocument {
                name: c.name,
                category: c.category.name(),
                unit: c.unit,
                value: c.value,
                level: c.level,
                scaled_value: c.scaled_value,
                scaled_level: c.scaled_level,
                note: c.note,
            });
        let (mut reached, mut seen, mut gramians) = (Vec::new(), Vec::new(), Vec::new());
        for (model, modes, inputs, outputs) in [
            (&models.longitudinal, longitudinal, [vec![0], vec![0, 1]], vec!["q"]),
            (&models.lateral, lateral, [vec![0], vec![0, 1]], vec!["p", "r"]),
        ] {
            let scaled = model.in_angles(speed);
            for set in inputs.into_iter().chain([vec![1]]) {
                let by: Vec<&'static str> = set.iter().map(|i| model.inputs[*i].0).collect();
                let of = |model: &LinearModel| controllability(model, modes, &set);
                reached.extend(reach_documents(model, of(model)?, of(&scaled)?, &by));
                let w = gramian(&scaled, &set, HORIZON)?;
                gramians.push(GramianDocument {
                    model: model.name,
                    by,
                    horizon: HORIZON,
                    eigenvalues: w.eigenvalues,
                    condition: w.condition,
                });
            }
            let places: Vec<usize> = outputs.iter().filter_map(|name| model.state(name)).collect();
            let of = |model: &LinearModel| observability(model, modes, &places);
            seen.extend(reach_documents(model, of(model)?, of(&scaled)?, &outputs));
        }
        Ok(LinearDocument {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION"),
            airplane: airplane.name.clone(),
            warnings: warnings(airplane, trim, &trim_document),
            trim: trim_document,
            models: ModelsDocument {
                longitudinal: model_document(&models.longitudinal),
                lateral: model_document(&models.lateral),
                full: model_document(&models.full),
            },
            modes: all
                .iter()
                .flat_map(|(model, modes)| modes.iter().map(|mode| mode_document(mode, model.name)))
                .collect(),
            load_per_angle: load_per_angle(models, speed),
            cap: cap(longitudinal, models, speed),
            criteria: criteria.collect(),
            caution: CAUTION,
            froude_scale: froude,
            controllability: reached,
            observability: seen,
            gramians,
        })
    }
}

fn trim_document(airplane: &Airplane, trim: &Trim, request: &TrimRequest) -> TrimDocument {
    let ([u, v, w], [p, q, r]) = (trim.velocity, trim.rate);
    let c = trim.controls;
    let running = airplane.propulsion.running(c.throttle, trim.airspeed(), trim.density);
    let air = crate::aircraft::airframe::AirState { velocity: trim.velocity, rate: trim.rate };
    let force = airplane.forces(&air, &c, trim.density).force;
    let mut used: Vec<UsedDocument> = Vec::new();
    for (i, (control, at)) in
        [("elevator", c.elevator), ("aileron", c.aileron), ("rudder", c.rudder)].into_iter().enumerate()
    {
        if let Some([low, high]) = airplane.actuators[i].map(|a| a.travel).filter(|t| t.iter().all(|x| x.is_finite())) {
            used.push(UsedDocument { control, share: (at - 0.5 * (low + high)).abs() / (0.5 * (high - low)) });
        }
    }
    let greatest = airplane.propulsion.greatest();
    if greatest.is_finite() {
        used.push(UsedDocument { control: airplane.inputs()[1].0, share: c.throttle / greatest });
    }
    TrimDocument {
        airspeed: request.airspeed,
        altitude: request.altitude,
        density: trim.density,
        climb: request.climb,
        turn_rate: trim.turn_rate,
        alpha: trim.alpha,
        beta: trim.beta,
        phi: trim.phi,
        theta: trim.theta,
        psi: 0.0,
        u,
        v,
        w,
        p,
        q,
        r,
        elevator: c.elevator,
        aileron: c.aileron,
        rudder: c.rudder,
        throttle: (!matches!(airplane.propulsion, Propulsion::Thrust { .. })).then_some(c.throttle),
        thrust: running.thrust,
        torque: running.reaction.abs(),
        propeller_rate: running.rate,
        current: running.current,
        specific_force: force.map(|f| f / airplane.mass),
        residual: trim.residual,
        used,
    }
}

fn warnings(airplane: &Airplane, trim: &Trim, document: &TrimDocument) -> Vec<String> {
    let mut out = Vec::new();
    for used in document.used.iter().filter(|used| used.share > 1.0 - NEAR_STOP) {
        out.push(format!("{} uses {:.0} % of its way: little is left to steer with", used.control, 100.0 * used.share));
    }
    let stall = airplane.aerodynamics.stall.map(|stall| stall.angle);
    if trim.alpha > LARGE_ALPHA {
        out.push(format!(
            "angle of attack {:.1} deg: coefficients of small airplanes are not measured so far",
            trim.alpha.to_degrees()
        ));
    } else if stall.is_some_and(|stall| trim.alpha > (1.0 - NEAR_STOP) * stall) {
        out.push(format!("angle of attack {:.1} deg is near the stall", trim.alpha.to_degrees()));
    }
    out
}

fn ports(ports: &[Port]) -> Vec<PortDocument> {
    ports.iter().map(|(name, unit)| PortDocument { name, unit }).collect()
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn model_document(model: &LinearModel) -> ModelDocument {
    ModelDocument {
        states: ports(&model.states),
        inputs: ports(&model.inputs),
        gusts: ports(&model.gusts),
        a: rows(&model.a),
        b: rows(&model.b),
        e: rows(&model.e),
    }
}

fn mode_document(mode: &Mode, model: &'static str) -> ModeDocument {
    ModeDocument {
        name: mode.name.text(),
        model,
        eigenvalue: [mode.eigenvalue.0, mode.eigenvalue.1],
        frequency: mode.frequency(),
        damping: mode.damping(),
        time_to_half: mode.time_to_half(),
        time_to_double: mode.time_to_double(),
        time_constant: mode.time_constant(),
    }
}

fn reach_documents(
    model: &LinearModel,
    as_is: Vec<Reach>,
    scaled: Vec<Reach>,
    by: &[&'static str],
) -> impl Iterator<Item = ReachDocument> {
    as_is.into_iter().zip(scaled).map(move |(reach, scaled)| ReachDocument {
        mode: reach.mode.name.text(),
        model: model.name,
        by: by.to_vec(),
        pbh: reach.pbh,
        cosines: reach.cosines,
        pbh_scaled: scaled.pbh,
        cosines_scaled: scaled.cosines,
    })
}
