//! How the physical parameters of a design are chosen: as identified, honest under their intervals, by the
//! likelihood of logs, by consistency under a given truth, or by autocovariance least squares. Only physical
//! parameters move; Q, R and P0 follow from them.

pub mod als;
mod belief;
mod error;
mod likelihood;
mod nees;
mod robust;
mod settled;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use super::parameters::{Group, Parameter, Space};
use super::plant;
use super::{TuneError, TuneOptions, Tuned, tune};
use crate::filter::SensorLog;
use crate::model::LinearModel;
use crate::numerics::linalg::LinalgError;
use crate::params::{Design, Params};

pub use als::{AlsAxis, AlsError};
pub use error::ObjectiveError;
pub use likelihood::LikelihoodAxis;
pub use nees::NeesAxis;
pub use robust::{HONEST_SHARE, RobustAxis, RobustOutput};

/// What the parameters are chosen by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// The identified numbers.
    #[default]
    Nominal,
    /// The claimed sigma stays honest over the identified intervals.
    Robust,
    /// Innovation likelihood of logs, with priors from the intervals.
    Likelihood,
    /// Expected NEES and NIS are one under a given truth.
    Nees,
    /// Autocovariance least squares on logs.
    Als,
}

impl Objective {
    pub fn name(self) -> &'static str {
        match self {
            Objective::Nominal => "nominal",
            Objective::Robust => "robust",
            Objective::Likelihood => "likelihood",
            Objective::Nees => "nees",
            Objective::Als => "als",
        }
    }
}

/// A log, its axes in the order of the parameters.
#[derive(Clone, Debug)]
pub struct Log {
    pub name: String,
    pub axes: Vec<SensorLog>,
}

/// An objective with what it needs.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    pub objective: Objective,
    /// Parameters that stay: paths or their beginnings, with or without an axis before them.
    pub hold: &'a [String],
    /// For `nees`.
    pub truth: Option<&'a Params>,
    /// For `likelihood` and `als`.
    pub logs: &'a [Log],
    /// For `likelihood`: the last share of each log that is kept for the comparison.
    pub held_out: f64,
    /// For `likelihood`: whether the intervals count.
    pub priors: bool,
    /// For `robust`: of the sensors that are drawn.
    pub seed: u64,
}

/// What became of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Moved {
    /// Absent for a parameter of the plant or an aid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// `gauss_markov.std_dev`.
    pub parameter: String,
    pub unit: String,
    pub from: f64,
    pub to: f64,
    /// to / from.
    pub factor: f64,
    /// The movement of the logarithm in standard deviations of its interval; absent without an interval.
    pub sigmas: Option<f64>,
    pub held: bool,
    /// 95 %, of what was found from logs, the identified interval included where it counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
}

/// How the parameters of a design came about.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Record {
    pub objective: Objective,
    pub parameters: Vec<Moved>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub robust: Vec<RobustAxis>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub likelihood: Vec<LikelihoodAxis>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nees: Vec<NeesAxis>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub als: Vec<AlsAxis>,
}

/// What an objective finds for one group of axes.
struct Found {
    /// Of the logarithms, in the order of `Group::free`.
    shifts: Vec<f64>,
    /// Standard deviations of the logarithms, where logs gave them.
    std_devs: Vec<Option<f64>>,
}

/// The design of `params` with its physical parameters chosen by the objective, and how; for [`Objective::Nominal`]
/// that of [`tune`](super::tune()) without a record.
pub fn tune_by(
    params: &Params,
    options: &TuneOptions,
    request: &Request<'_>,
) -> Result<(Tuned, Option<Record>), ObjectiveError> {
    let design = options.design.clone().or_else(|| params.design.clone()).unwrap_or_default();
    if request.objective == Objective::Nominal {
        if !request.hold.is_empty() {
            Space::new(params, &design, request.hold)?;
        }
        return Ok((tune(params, options)?, None));
    }
    let mut space = Space::new(params, &design, request.hold)?;
    hold_more(&mut space, request.objective)?;
    let problem = Problem { space: &space, options, request };
    let mut record = Record {
        objective: request.objective,
        parameters: Vec::new(),
        robust: Vec::new(),
        likelihood: Vec::new(),
        nees: Vec::new(),
        als: Vec::new(),
    };
    let mut shifts = vec![0.0; space.parameters.len()];
    let mut std_devs = vec![None; space.parameters.len()];
    let groups = space.groups();
    for (number, group) in groups.iter().enumerate() {
        let alike = groups[..number].iter().find(|earlier| space.alike(earlier, group));
        let found = match request.objective {
            Objective::Nominal => continue,
            Objective::Robust => match alike {
                Some(earlier) => repeated(&problem, earlier, group, &shifts, &mut record.robust),
                None => robust::choose(&problem, group, &mut record.robust)?,
            },
            Objective::Likelihood => likelihood::choose(&problem, group, &mut record.likelihood)?,
            Objective::Nees => nees::choose(&problem, group, &mut record.nees)?,
            Objective::Als => als::choose(&problem, group, &mut record.als)?,
        };
        for ((&i, shift), std_dev) in group.free.iter().zip(found.shifts).zip(found.std_devs) {
            (shifts[i], std_devs[i]) = (shift, std_dev);
        }
    }
    let (moved, design) = space.shifted(&shifts);
    record.parameters = (0..shifts.len()).map(|i| space.moved(i, shifts[i], std_devs[i])).collect();
    let mut tuned = tune(&moved, &TuneOptions { design: Some(design), ..options.clone() })?;
    if let Some(written) = tuned.design.tuning.as_object_mut() {
        written.insert(
            "method".into(),
            json!("exact discretisation of the noise terms; only their physical parameters move"),
        );
        written.insert("objective".into(), json!(request.objective));
        if let Ok(serde_json::Value::Object(mut record)) = serde_json::to_value(&record) {
            record.remove("objective");
            written.extend(record);
        }
    }
    Ok((tuned, Some(record)))
}

/// What an objective cannot find stays as it is.
fn hold_more(space: &mut Space, objective: Objective) -> Result<(), ObjectiveError> {
    for parameter in &mut space.parameters {
        let shared = parameter.axis.is_none();
        parameter.held |= match objective {
            Objective::Nominal | Objective::Likelihood => false,
            // of a plant or an aid, a number without an interval is known
            Objective::Robust => shared && parameter.prior().is_none(),
            // the truth is another sensor in the same plant
            Objective::Nees => shared,
            // Q and R are linear in the squares of amounts, not in times
            Objective::Als => {
                shared || ["correlation_time", "frequency"].iter().any(|time| parameter.path.ends_with(time))
            }
        };
    }
    if space.parameters.iter().all(|parameter| parameter.held) { Err(ObjectiveError::AllHeld) } else { Ok(()) }
}

/// Axes of the same numbers have the same answer.
fn repeated(
    problem: &Problem<'_>,
    earlier: &Group,
    group: &Group,
    shifts: &[f64],
    told: &mut Vec<RobustAxis>,
) -> Found {
    for (&from, &to) in earlier.axes.iter().zip(&group.axes) {
        let name = problem.axis_name(from);
        let known = told.iter().find(|told| told.axis == name).cloned();
        told.extend(known.map(|known| RobustAxis { axis: problem.axis_name(to), ..known }));
    }
    Found { shifts: earlier.free.iter().map(|&i| shifts[i]).collect(), std_devs: vec![None; earlier.free.len()] }
}

impl Space {
    fn moved(&self, number: usize, shift: f64, std_dev: Option<f64>) -> Moved {
        let parameter: &Parameter = &self.parameters[number];
        let (from, factor) = (parameter.value.value, shift.exp());
        let to = from * factor;
        let reach = |s: f64| (crate::numerics::distribution::NORMAL_95 * s).exp();
        Moved {
            axis: parameter.axis.map(|axis| self.params().axes[axis].name.clone()),
            parameter: parameter.path.clone(),
            unit: parameter.value.unit.to_string(),
            from,
            to,
            factor,
            sigmas: parameter.prior().map(|prior| shift / prior.std_dev),
            held: parameter.held,
            interval: std_dev.map(|s| [to / reach(s), to * reach(s)]),
        }
    }
}

/// What all objectives work on.
struct Problem<'a> {
    space: &'a Space,
    options: &'a TuneOptions,
    request: &'a Request<'a>,
}

impl Problem<'_> {
    fn dt(&self) -> f64 {
        1.0 / self.space.params().sample_rate_hz
    }

    fn axis_name(&self, axis: usize) -> String {
        self.space.params().axes[axis].name.clone()
    }

    /// The axes of a group, for messages.
    fn names(&self, group: &Group) -> String {
        let names: Vec<String> = group.axes.iter().map(|&axis| self.axis_name(axis)).collect();
        format!("axis {}", names.join(", "))
    }

    fn nothing_drifts(&self, group: &Group) -> ObjectiveError {
        ObjectiveError::NothingDrifts { objective: self.request.objective.name(), axis: self.names(group) }
    }

    fn linalg(&self, group: &Group) -> impl Fn(LinalgError) -> ObjectiveError {
        let axis = self.names(group);
        move |source| ObjectiveError::Linalg { axis: axis.clone(), source }
    }

    /// The models of the axes of a group with its parameters moved.
    fn models(&self, group: &Group, shifts: &[f64]) -> Result<Vec<LinearModel>, TuneError> {
        let mut all = vec![0.0; self.space.parameters.len()];
        group.free.iter().zip(shifts).for_each(|(&i, shift)| all[i] = *shift);
        let (params, design) = self.space.shifted(&all);
        let of = |&axis: &usize| self.model(&params, axis, &design);
        group.axes.iter().map(of).collect()
    }

    fn model(&self, params: &Params, axis: usize, design: &Design) -> Result<LinearModel, TuneError> {
        let built = plant::build(&params.axes[axis], params.quantity, self.dt(), design, self.options)?;
        Ok(built.model)
    }
}
