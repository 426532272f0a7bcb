//! What a design does when the sensor is another: real against claimed errors over time, exactly and without
//! simulation.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use super::plant;
use super::{TuneError, TuneOptions, Tuned};
use crate::filter::AxisDesign;
use crate::filter::gains::GainSequence;
use crate::filter::judge::Judge;
use crate::filter::mismatch::{Expectation, ExpectedError, ExpectedInnovations, expect};
use crate::model::{DRIFT, LinearModel, Named};
use crate::noise::Kind;
use crate::params::Params;
use crate::units::digits;

/// Times shown after the first measurement, evenly spaced in their logarithm.
const TIMES: u32 = 8;
/// Settling times that are followed.
const SETTLING_TIMES: f64 = 10.0;
/// Span followed when the filter never settles, s.
const UNSETTLED_SPAN: f64 = 1000.0;
/// Most steps followed: some seconds of work, some 100 MB of gains for ten states.
const MOST_STEPS: f64 = 1e6;
/// A real error within this share of the claimed sigma is as claimed.
const AS_CLAIMED: f64 = 0.01;

/// Whether real errors are as large as the filter says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tendency {
    AsClaimed,
    /// Errors are larger than claimed.
    Optimistic,
    /// Errors are smaller than claimed.
    Pessimistic,
    /// Some are larger, some smaller.
    Mixed,
}

/// The error of one estimated quantity at each time, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ErrorOverTime {
    /// The state, or "whole drift".
    pub name: String,
    /// Mean error, truth − estimate.
    pub mean: Vec<f64>,
    /// Root mean square error.
    pub real: Vec<f64>,
    /// Sigma that the filter claims.
    pub claimed: Vec<f64>,
}

/// A design of one axis under another truth.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct UnderTruth {
    pub name: String,
    /// s from the first measurement.
    pub time_s: Vec<f64>,
    /// The sum that is subtracted from a measurement.
    pub drift: ErrorOverTime,
    /// Every state, in the order of the model; empty when the truth has other states.
    pub states: Vec<ErrorOverTime>,
    /// `E[NEES]` at each time, divided by its number of components: 1 as claimed; null where the filter claims to
    /// know something exactly. Of all states, or of the whole drift when the truth has other states.
    pub nees: Vec<Option<f64>>,
    /// `E[NIS]`, mean over all measurements: 1 as claimed.
    pub nis: f64,
    pub tendency: Tendency,
    /// The same as a sentence.
    pub meaning: String,
    /// What was decided where the parameters of the truth left a choice, and what is not shown.
    pub notes: Vec<String>,
}

/// Every axis of the design with its sensor replaced by the one of the same name in `truth`, sampled at the design's
/// rate.
///
/// The truth starts at its own x0, P0 (bias and turn-on bias), the filter at its own; at most a million steps are
/// followed. Errors: another quantity, other axes, a truth without white noise.
pub fn under_truth(tuned: &Tuned, truth: &Params, options: &TuneOptions) -> Result<Vec<UnderTruth>, TuneError> {
    let design = &tuned.design;
    if truth.quantity != design.quantity {
        let (truth, design) = (truth.quantity.si_unit(), design.quantity.si_unit());
        return Err(TuneError::TruthQuantity { truth, design });
    }
    let other_axes = || TuneError::TruthAxes {
        truth: truth.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>().join(", "),
        design: design.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>().join(", "),
    };
    if truth.axes.len() != design.axes.len() {
        return Err(other_axes());
    }
    // axes are often alike: each pair of models is worked out once
    let mut worked_out: Vec<(&LinearModel, LinearModel, UnderTruth)> = Vec::new();
    let mut results = Vec::with_capacity(design.axes.len());
    for axis in &design.axes {
        let its_truth = truth.axes.iter().find(|t| t.name == axis.name).ok_or_else(other_axes)?;
        let chosen = design.design.clone().unwrap_or_default();
        let sensor = plant::build(its_truth, truth.quantity, axis.model.dt, &chosen, options)?;
        let alike = worked_out.iter().find(|(filter, truth, _)| **filter == axis.model && *truth == sensor.model);
        let mut result = match alike {
            Some((_, _, result)) => result.clone(),
            None => {
                let result = one_axis(axis, &sensor.model);
                worked_out.push((&axis.model, sensor.model, result.clone()));
                result
            }
        };
        result.name.clone_from(&axis.name);
        result.notes.extend(sensor.warnings.iter().map(|warning| format!("the truth: {warning}")));
        results.push(result);
    }
    Ok(results)
}

fn one_axis(axis: &AxisDesign, truth: &LinearModel) -> UnderTruth {
    let filter = &axis.model;
    let settling_time = axis.steady_state.settling_time;
    let span = if settling_time > 0.0 { SETTLING_TIMES * settling_time } else { UNSETTLED_SPAN };
    let last = (span / filter.dt).round().clamp(f64::from(TIMES), MOST_STEPS) as u64;
    let steps = shown_steps(last);
    let mut notes = Vec::new();
    if last as f64 == MOST_STEPS {
        let (reached, wanted) = (digits(MOST_STEPS * filter.dt), digits(span));
        notes.push(format!("the first {reached} s are followed; ten settling times are {wanted} s"));
    }
    let same_states = filter.states == truth.states && filter.h == truth.h;
    let judge = judge(filter, truth, same_states);
    let gains = GainSequence::new(filter, last + 1, &steps);
    let Expectation { epochs, innovations } = expect(filter, truth, &gains, &judge, &vec![vec![]; filter.every.len()]);
    let of = |i: usize| ErrorOverTime {
        name: judge.components[i].name.clone(),
        mean: epochs.iter().map(|e| e.mean[i]).collect(),
        real: epochs.iter().map(|e| e.covariance[(i, i)].max(0.0).sqrt().hypot(e.mean[i])).collect(),
        claimed: epochs.iter().map(|e| e.claimed[(i, i)].max(0.0).sqrt()).collect(),
    };
    let states = judge.size() - 1;
    let mut result = UnderTruth {
        name: axis.name.clone(),
        time_s: steps.iter().map(|&step| step as f64 * filter.dt).collect(),
        drift: of(states),
        states: (0..states).map(of).collect(),
        nees: epochs.iter().map(|e| nees(e, states)).collect(),
        nis: mean_nis(&innovations, &gains),
        tendency: Tendency::AsClaimed,
        meaning: String::new(),
        notes,
    };
    (result.tendency, result.meaning) = conclusion(&result);
    result
}

/// Over the updates of all measurements.
fn mean_nis(innovations: &[ExpectedInnovations], gains: &GainSequence) -> f64 {
    let updates: Vec<f64> = gains.every.iter().map(|every| gains.steps.div_ceil(*every) as f64).collect();
    let sum: f64 = innovations.iter().zip(&updates).map(|(i, updates)| i.nis * updates).sum();
    sum / updates.iter().sum::<f64>()
}

/// The first measurement and [`TIMES`] steps from 1 to `last`, evenly spaced in their logarithm.
fn shown_steps(last: u64) -> Vec<u64> {
    let spaced = (0..TIMES).map(|k| (last as f64).powf(f64::from(k) / f64::from(TIMES - 1)).round() as u64);
    let mut steps: Vec<u64> = std::iter::once(0).chain(spaced).collect();
    steps.dedup();
    steps
}

/// Every state, if filter and truth have the same, then the whole drift.
fn judge(filter: &LinearModel, truth: &LinearModel, same_states: bool) -> Judge {
    let states = if same_states { filter.states.len() } else { 0 };
    let stack = |model: &LinearModel| {
        let drift = model.drift_row();
        let row = |i: usize, j: usize| if i < states { f64::from(i == j) } else { drift[(0, j)] };
        DMatrix::from_fn(states + 1, model.states.len(), row)
    };
    let mut components = filter.states[..states].to_vec();
    components.push(Named { name: "whole drift".into(), unit: drift_unit(filter) });
    Judge { components, of_truth: stack(truth), of_estimate: stack(filter) }
}

fn drift_unit(model: &LinearModel) -> String {
    let drift = model.outputs.iter().find(|output| output.name == DRIFT).map(|output| &output.unit);
    drift.unwrap_or(&model.measurements[0].unit).clone()
}

/// E[NEES] per component: of all states, or of the whole drift where they are not judged.
fn nees(error: &ExpectedError, states: usize) -> Option<f64> {
    let count = states.max(1);
    let part = ExpectedError {
        mean: error.mean.rows(0, count).into_owned(),
        covariance: error.covariance.view((0, 0), (count, count)).into_owned(),
        claimed: error.claimed.view((0, 0), (count, count)).into_owned(),
    };
    part.nees().map(|nees| nees / count as f64)
}

/// A real size over the one that the filter claims.
struct Ratio<'a> {
    /// Of which error, and when; `None`: the innovations.
    error: Option<(&'a str, f64)>,
    ratio: f64,
}

impl Ratio<'_> {
    fn sentence(&self) -> String {
        let times = digits(self.ratio);
        match self.error {
            Some((name, time)) if self.ratio.is_infinite() => {
                format!("the filter claims to know {name} exactly at {} s, which it does not", digits(time))
            }
            Some((name, time)) => {
                format!("the error of {name} is {times} times its claimed sigma at {} s", digits(time))
            }
            None => format!("the innovations are {times} times as large as predicted"),
        }
    }
}

/// States that only together stand for flicker are left out.
fn conclusion(result: &UnderTruth) -> (Tendency, String) {
    let ratios = |error: &ErrorOverTime| -> Vec<f64> {
        let known = |(&real, &claimed): (&f64, &f64)| if real == claimed { 1.0 } else { real / claimed };
        error.real.iter().zip(&error.claimed).map(known).collect()
    };
    let told = result.states.iter().filter(|s| Kind::of_state(&s.name) != Some(Kind::BiasInstability));
    let errors = told.map(|s| (s.name.as_str(), s)).chain([("the whole drift", &result.drift)]);
    let mut all = vec![Ratio { error: None, ratio: result.nis.sqrt() }];
    for (name, error) in errors {
        let at = result.time_s.iter().zip(ratios(error));
        all.extend(at.map(|(&time, ratio)| Ratio { error: Some((name, time)), ratio }));
    }
    let by_size = |a: &&Ratio<'_>, b: &&Ratio<'_>| a.ratio.total_cmp(&b.ratio);
    // of equal ones the earliest
    let larger = all.iter().rev().max_by(by_size).filter(|r| r.ratio > 1.0 + AS_CLAIMED);
    let smaller = all.iter().min_by(by_size).filter(|r| r.ratio < 1.0 - AS_CLAIMED);
    let (tendency, mut said) = match (larger, smaller) {
        (Some(larger), Some(smaller)) => {
            let both = format!("optimistic and pessimistic: {}, but {}", larger.sentence(), smaller.sentence());
            (Tendency::Mixed, both)
        }
        (Some(larger), None) => (Tendency::Optimistic, format!("optimistic: {}", larger.sentence())),
        (None, Some(smaller)) => (Tendency::Pessimistic, format!("pessimistic: {}", smaller.sentence())),
        (None, None) => {
            let all = "as claimed: every error and the innovations are within 1 % of what the filter says";
            return (Tendency::AsClaimed, all.into());
        }
    };
    // the last of all is the whole drift in the end
    let Some(end) = all.last() else { return (tendency, said) };
    if [larger, smaller].into_iter().flatten().all(|r| r.error != end.error) {
        said.push_str(&format!("; in the end, {}", end.sentence()));
    }
    (tendency, said)
}
