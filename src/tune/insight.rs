//! What a design could be: when each state is known, what better parts buy, what wrong parameters cost. Everything
//! is exact; nothing is simulated.

use nalgebra::DMatrix;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::closed_loop::{driven, settled};
use super::prediction::{Predicted, settled_after};
use super::{TuneError, TuneOptions, Tuned, plant};
use crate::filter::mismatch::expect_settled;
use crate::filter::single::{SinglePrecision, single_precision};
use crate::filter::{AxisDesign, Cycle, FilterDesign, Judge, Kalman};
use crate::model::{DRIFT, LinearModel, Named};
use crate::numerics::linalg::LinalgError;
use crate::params::{AxisParams, Design, Measured};
use crate::units::{Quantity, Unit};

/// Factors at which a parameter is tried.
pub const FACTORS: [f64; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Factors by which the truth is moved under a fixed filter.
pub const MISTAKES: [f64; 2] = [0.5, 2.0];
/// Share of the variance that is still to go when a state counts as half known, and as known.
const STILL_TO_GO: [f64; 2] = [0.5, 0.05];
/// Steps of the f32 filter times its states cubed, at most: about a second of work.
const SINGLE_WORK: f64 = 8e6;
const FEWEST_SINGLE_STEPS: f64 = 10_000.0;
const SINGLE_SEED: u64 = 1;
/// The row that scales all noise of the sensor at once.
pub const WHOLE_SENSOR: &str = "sensor";

/// What could be known of one axis before anything is built.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Insight {
    pub axis: String,
    /// Every state, in the order of the model.
    pub observed: Vec<Observed>,
    /// The states of the plant, then the whole drift; those that stay uncertain.
    pub outputs: Vec<OutputInsight>,
    /// The filter as designed, the truth with one parameter moved.
    pub mistakes: Vec<Mistake>,
    /// The filter in f32.
    pub single_precision: SinglePrecision,
}

/// How long a state takes to be known, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Observed {
    pub state: String,
    pub unit: String,
    /// Before the first measurement.
    pub initial_sigma: f64,
    /// In the end; zero for a constant.
    pub final_sigma: f64,
    /// Time in s after which half of the variance that the measurements will ever take away is gone for good; absent
    /// when they take none, or beyond the times looked at.
    pub half_s: Option<f64>,
    /// The same for 95 % of it.
    pub most_s: Option<f64>,
}

/// One estimated quantity against the quality of the parts, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct OutputInsight {
    pub name: String,
    pub unit: String,
    /// Steady sigma as designed.
    pub sigma: f64,
    pub worth: Vec<Worth>,
}

/// Steady sigma when one parameter is other and the filter is designed anew.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Worth {
    /// `gauss_markov.std_dev`, `heading.rate`; "sensor": all its noise together, correlation times as they are.
    pub parameter: String,
    /// As designed, in the unit of the document.
    pub value: Option<f64>,
    pub value_unit: Option<String>,
    /// The parameter is this many times that of the design.
    pub factors: Vec<f64>,
    /// SI; absent where there is no such design (a rate above the sample rate).
    pub sigma: Vec<Option<f64>>,
}

/// The steady state of the filter as designed when the truth has another parameter.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Mistake {
    pub parameter: String,
    /// Truth over filter.
    pub factor: f64,
    /// Real sigma over claimed sigma of every output, in their order.
    pub real_over_claimed: Vec<f64>,
    /// E[ν²/S], mean over the measurements.
    pub nis: f64,
}

/// Where a parameter stands.
#[derive(Clone, Debug, PartialEq)]
enum Parameter {
    WholeSensor,
    Sensor(String),
    Plant(String),
    /// Of an aid, by its name.
    Rate(String),
}

/// The design of one axis with the documents it was made from.
struct Made<'a> {
    axis: &'a AxisParams,
    quantity: Quantity,
    dt: f64,
    design: &'a Design,
    options: &'a TuneOptions,
}

/// An output that stays uncertain.
struct Watched {
    name: Named,
    row: DMatrix<f64>,
    sigma: f64,
}

/// Insight into every axis of a design that [`tune`](super::tune()) made with `options`.
///
/// With every trial the filter is designed anew (`worth`) or kept (`mistakes`, by [`expect_settled`]). Errors: the
/// loop does not settle.
pub fn insight(tuned: &Tuned, options: &TuneOptions) -> Result<Vec<Insight>, TuneError> {
    let axes = &tuned.design.axes;
    let mut all: Vec<Insight> = Vec::with_capacity(axes.len());
    for (number, (axis, report)) in axes.iter().zip(&tuned.reports).enumerate() {
        // axes are often alike
        let alike = |earlier: &&AxisDesign| earlier.model == axis.model && earlier.noise.terms == axis.noise.terms;
        let mut of_axis = match axes[..number].iter().position(|earlier| alike(&earlier)) {
            Some(earlier) => all[earlier].clone(),
            None => of_axis(&tuned.design, axis, &report.predicted, options)?,
        };
        of_axis.axis.clone_from(&axis.name);
        all.push(of_axis);
    }
    Ok(all)
}

fn of_axis(
    design: &FilterDesign,
    axis: &AxisDesign,
    predicted: &Predicted,
    options: &TuneOptions,
) -> Result<Insight, TuneError> {
    let entry = design.design.clone().unwrap_or_default();
    let made = Made { axis: &axis.noise, quantity: design.quantity, dt: axis.model.dt, design: &entry, options };
    let failed = |source: LinalgError| TuneError::Linalg { axis: axis.name.clone(), source };
    let model = &axis.model;
    let mut watched = Vec::new();
    for (name, row) in rows(model) {
        let sigma = steady_sigma(model, &row).map_err(failed)?;
        if sigma > 0.0 {
            watched.push(Watched { name, row, sigma });
        }
    }
    let parameters = made.parameters();
    let tried: Vec<(usize, f64)> =
        (0..parameters.len()).flat_map(|i| FACTORS.into_iter().map(move |factor| (i, factor))).collect();
    let sigmas: Vec<Vec<Option<f64>>> =
        tried.par_iter().map(|&(i, factor)| made.sigmas(&parameters[i], factor, &watched)).collect();
    let worth = |output: usize| -> Vec<Worth> {
        let of = |(i, parameter): (usize, &Parameter)| {
            let value = made.value(parameter);
            Worth {
                parameter: parameter.name(),
                value: value.as_ref().map(|m| m.value),
                value_unit: value.map(|m| m.unit.to_string()),
                factors: FACTORS.to_vec(),
                sigma: sigmas[i * FACTORS.len()..(i + 1) * FACTORS.len()].iter().map(|s| s[output]).collect(),
            }
        };
        parameters.iter().enumerate().map(of).collect()
    };
    let outputs = watched.iter().enumerate().map(|(i, output)| OutputInsight {
        name: output.name.name.clone(),
        unit: output.name.unit.clone(),
        sigma: output.sigma,
        worth: worth(i),
    });
    let moved: Vec<(&Parameter, f64)> = parameters
        .iter()
        .filter(|parameter| !matches!(parameter, Parameter::Rate(_)))
        .flat_map(|parameter| MISTAKES.into_iter().map(move |factor| (parameter, factor)))
        .collect();
    let mistakes = moved.par_iter().filter_map(|&(parameter, factor)| made.mistake(axis, parameter, factor, &watched));
    Ok(Insight {
        axis: axis.name.clone(),
        observed: observed(axis, predicted).map_err(failed)?,
        outputs: outputs.collect(),
        mistakes: mistakes.collect(),
        single_precision: single_precision(model, single_steps(axis), SINGLE_SEED).map_err(failed)?,
    })
}

/// Two settling times, as far as the budget of steps goes.
fn single_steps(axis: &AxisDesign) -> u64 {
    let states = axis.model.states.len() as f64;
    let most = (SINGLE_WORK / (states * states * states)).max(FEWEST_SINGLE_STEPS);
    (2.0 * axis.steady_state.settling_time / axis.model.dt).clamp(FEWEST_SINGLE_STEPS, most) as u64
}

/// States of the plant, then the whole drift.
fn rows(model: &LinearModel) -> Vec<(Named, DMatrix<f64>)> {
    let plant = model.outputs.iter().filter(|output| output.name != DRIFT);
    let mut rows: Vec<_> = plant
        .map(|o| {
            (Named { name: o.name.clone(), unit: o.unit.clone() }, DMatrix::from_row_slice(1, o.row.len(), &o.row))
        })
        .collect();
    let drift = model.outputs.iter().find(|output| output.name == DRIFT).map(|output| &output.unit);
    let unit = drift.unwrap_or(&model.measurements[0].unit).clone();
    rows.push((Named { name: DRIFT.into(), unit }, model.drift_row()));
    rows
}

/// √(d P(k|k) dᵀ) of the states that stay uncertain, at a sample at which every measurement is taken; zero when
/// there are none.
fn steady_sigma(model: &LinearModel, row: &DMatrix<f64>) -> Result<f64, LinalgError> {
    let kept = driven(model, row);
    if kept.is_empty() {
        return Ok(0.0);
    }
    let mut kalman = Kalman::new(&settled(model, &kept)?);
    for i in 0..model.h.nrows() {
        kalman.update(i, 0.0, None);
    }
    let row = row.select_columns(&kept);
    Ok((&row * &kalman.p * row.transpose())[(0, 0)].max(0.0).sqrt())
}

fn observed(axis: &AxisDesign, predicted: &Predicted) -> Result<Vec<Observed>, LinalgError> {
    let model = &axis.model;
    // P(k|k) in the end
    let mut settled = axis.steady_state.predicted_covariance.clone();
    let mut kalman = Kalman::new(&LinearModel { p0: settled.clone(), ..model.clone() });
    for i in 0..model.h.nrows() {
        kalman.update(i, 0.0, None);
    }
    settled.copy_from(&kalman.p);
    let mut all = Vec::with_capacity(model.states.len());
    for (i, state) in model.states.iter().enumerate() {
        let (first, last) = (model.p0[(i, i)], settled[(i, i)].max(0.0));
        let mut times = [None; 2];
        for (time, share) in times.iter_mut().zip(STILL_TO_GO) {
            let above = |variance: f64| variance > last + share * (first - last);
            if first > last * (1.0 + 1e-9) {
                let sigma_of = |p: &DMatrix<f64>| p[(i, i)].max(0.0).sqrt();
                *time = settled_after(model, predicted, &predicted.sigma[i], sigma_of, |s| above(s * s))?;
            }
        }
        all.push(Observed {
            state: state.name.clone(),
            unit: state.unit.clone(),
            initial_sigma: first.sqrt(),
            final_sigma: last.sqrt(),
            half_s: times[0],
            most_s: times[1],
        });
    }
    Ok(all)
}

impl Parameter {
    fn name(&self) -> String {
        match self {
            Parameter::WholeSensor => WHOLE_SENSOR.into(),
            Parameter::Sensor(path) | Parameter::Plant(path) => path.clone(),
            Parameter::Rate(aid) => format!("{aid}.rate"),
        }
    }
}

/// Whether a coefficient is an amount of noise, not a time or a frequency.
fn is_size(path: &str) -> bool {
    !(path.ends_with("correlation_time") || path.ends_with("frequency"))
}

impl Made<'_> {
    fn parameters(&self) -> Vec<Parameter> {
        let (mut axis, mut design) = (self.axis.clone(), self.design.clone());
        let sensor: Vec<String> = axis.noise_parameters().map(|(path, _)| path).collect();
        let whole = sensor.iter().filter(|path| is_size(path)).count() > 1;
        let mut all: Vec<Parameter> = whole.then_some(Parameter::WholeSensor).into_iter().collect();
        all.extend(sensor.into_iter().map(Parameter::Sensor));
        all.extend(design.noise_parameters().map(|(path, _)| Parameter::Plant(path)));
        all.extend(self.design.aids.iter().map(|aid| Parameter::Rate(aid.name.clone())));
        all
    }

    fn value(&self, parameter: &Parameter) -> Option<Measured> {
        let (mut axis, mut design) = (self.axis.clone(), self.design.clone());
        match parameter {
            Parameter::WholeSensor => None,
            Parameter::Sensor(path) => axis.noise_parameters().find(|(name, _)| name == path).map(|(_, m)| m.clone()),
            Parameter::Plant(path) => design.noise_parameters().find(|(name, _)| name == path).map(|(_, m)| m.clone()),
            Parameter::Rate(name) => {
                let aid = self.design.aids.iter().find(|aid| aid.name == *name)?;
                Some(aid.rate.clone().unwrap_or_else(|| Measured::from_si(1.0 / self.dt, None, Unit::hertz())))
            }
        }
    }

    /// The model with one parameter at `factor` times its value; `None` when there is no such model.
    fn with(&self, parameter: &Parameter, factor: f64) -> Option<LinearModel> {
        let (mut axis, mut design) = (self.axis.clone(), self.design.clone());
        match parameter {
            Parameter::WholeSensor => {
                for (_, value) in axis.noise_parameters().filter(|(path, _)| is_size(path)) {
                    value.value *= factor;
                }
            }
            Parameter::Sensor(path) => axis.noise_parameters().find(|(name, _)| name == path)?.1.value *= factor,
            Parameter::Plant(path) => design.noise_parameters().find(|(name, _)| name == path)?.1.value *= factor,
            Parameter::Rate(name) => {
                let mut rate = self.value(parameter)?;
                rate.value *= factor;
                design.aids.iter_mut().find(|aid| aid.name == *name)?.rate = Some(rate);
            }
        }
        plant::build(&axis, self.quantity, self.dt, &design, self.options).ok().map(|joined| joined.model)
    }

    /// Steady sigma of every output, designed anew.
    fn sigmas(&self, parameter: &Parameter, factor: f64, watched: &[Watched]) -> Vec<Option<f64>> {
        let Some(model) = self.with(parameter, factor) else { return vec![None; watched.len()] };
        let rows = rows(&model);
        let of = |output: &Watched| {
            let (_, row) = rows.iter().find(|(name, _)| *name == output.name)?;
            steady_sigma(&model, row).ok()
        };
        watched.iter().map(of).collect()
    }

    /// `None` where the filter's error has no steady state in this truth.
    fn mistake(&self, axis: &AxisDesign, parameter: &Parameter, factor: f64, watched: &[Watched]) -> Option<Mistake> {
        let truth = self.with(parameter, factor)?;
        let mut ratios = Vec::with_capacity(watched.len());
        let mut nis = f64::NAN;
        let truth_rows = rows(&truth);
        for output in watched {
            let (kept, its) = (driven(&axis.model, &output.row), driven(&truth, &output.row_in(&truth_rows)?));
            let filter = settled(&axis.model, &kept).ok()?;
            let judge = Judge {
                components: vec![output.name.clone()],
                of_truth: output.row_in(&truth_rows)?.select_columns(&its),
                of_estimate: output.row.select_columns(&kept),
            };
            let truth = truth.part(&its);
            let result = expect_settled(&filter, &truth, &judge, &Cycle::new(&filter.every)?).ok()?;
            ratios.push((result.error.covariance[(0, 0)] / result.error.claimed[(0, 0)]).sqrt());
            nis = result.nis;
        }
        Some(Mistake { parameter: parameter.name(), factor, real_over_claimed: ratios, nis })
    }
}

impl Watched {
    /// The same output of another model.
    fn row_in(&self, rows: &[(Named, DMatrix<f64>)]) -> Option<DMatrix<f64>> {
        rows.iter().find(|(name, _)| *name == self.name).map(|(_, row)| row.clone())
    }
}
