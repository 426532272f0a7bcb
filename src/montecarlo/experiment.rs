//! What makes an experiment: design, truth, length, seed, level. Two documents belong together when these are equal.

use serde_json::{Value, json};

use super::MonteCarloError;
use super::calibration::MAX_REPLICATES;
use super::course::{AxisCourse, MAX_STEPS, MIN_STEPS, model_of, own_models};
use super::engine::Course;
use super::spread::Spread;
use crate::filter::FilterDesign;
use crate::params::{AxisParams, Params};

/// Length of a run of a filter that settles within it, s.
const USUAL_S: f64 = 600.0;
/// A thousand runs of as many samples take minutes, not hours: ten times those of 600 s at 100 Hz.
const MOST_BY_DEFAULT: f64 = 600_000.0;

/// Everything that decides the numbers of every run.
#[derive(Clone, Debug)]
pub struct Experiment {
    pub design: FilterDesign,
    /// Parameters of the truth; the design's own model when absent.
    pub truth: Option<Params>,
    /// Draw the parameters of every run from their intervals.
    pub truth_spread: bool,
    pub steps: u64,
    pub seed: u64,
    /// Family-wise false-alarm probability.
    pub alpha: f64,
    /// Whole experiments that measure the false-alarm probability; 0: replicates drawn from the law.
    pub replicates: u64,
}

impl Experiment {
    /// Checks and prepares everything that does not depend on the random numbers.
    pub fn course(&self) -> Result<Course, MonteCarloError> {
        check(self.steps, self.alpha)?;
        if self.replicates > MAX_REPLICATES {
            let (value, expected) = (self.replicates as f64, format!("at most {MAX_REPLICATES}"));
            return Err(MonteCarloError::Plan { name: "replicates", value, expected });
        }
        let truths = self.truths()?;
        let (mut axes, mut spreads) = (Vec::with_capacity(truths.len()), Vec::with_capacity(truths.len()));
        for (design, truth) in self.design.axes.iter().zip(truths) {
            let model = match &self.truth {
                Some(_) => model_of(truth, &self.design)?,
                None => design.model.clone(),
            };
            spreads.push(self.truth_spread.then(|| Spread::new(truth, &self.design)).transpose()?);
            axes.push(AxisCourse::new(design, model, self.steps)?);
        }
        Ok(Course::new(axes, spreads, self.steps, self.seed, 1.0 / self.design.sample_rate_hz))
    }

    /// The same with the design as its own truth.
    pub fn own_course(&self) -> Result<Course, MonteCarloError> {
        course_of(&self.design, own_models(&self.design), self.steps, self.seed)
    }

    /// Parameters of the truth, in the order of the design's axes.
    fn truths(&self) -> Result<Vec<&AxisParams>, MonteCarloError> {
        let Some(truth) = &self.truth else { return Ok(self.design.axes.iter().map(|axis| &axis.noise).collect()) };
        if truth.quantity != self.design.quantity {
            let (truth, filter) = (truth.quantity.name(), self.design.quantity.name());
            return Err(MonteCarloError::Quantity { truth, filter });
        }
        let names = |names: Vec<&str>| names.join(", ");
        let wrong = || MonteCarloError::Axes {
            truth: names(truth.axes.iter().map(|a| a.name.as_str()).collect()),
            filter: names(self.design.axes.iter().map(|a| a.name.as_str()).collect()),
        };
        if truth.axes.len() != self.design.axes.len() {
            return Err(wrong());
        }
        let find = |name: &str| truth.axes.iter().find(|axis| axis.name == name).ok_or_else(wrong);
        self.design.axes.iter().map(|axis| find(&axis.name)).collect()
    }

    /// As it stands in documents. The record of the tuning is left out: it moves no number.
    pub fn to_value(&self) -> Value {
        let mut design = self.design.clone();
        design.tuning = Value::Null;
        // both were written by this program: they are JSON
        let filter: Value = serde_json::from_str(&design.to_json()).unwrap_or_default();
        let truth: Option<Value> = self.truth.as_ref().and_then(|truth| serde_json::from_str(&truth.to_json()).ok());
        json!({
            "filter": filter,
            "truth": truth,
            "truth_spread": self.truth_spread,
            "steps": self.steps,
            "seed": self.seed,
            "alpha": self.alpha,
            "replicates": self.replicates,
        })
    }

    /// The inverse; complaints name `path` and the key.
    pub fn from_value(value: &Value, path: &str) -> Result<Experiment, MonteCarloError> {
        let wrong = |key: &str, expected: &str| MonteCarloError::Document {
            path: path.into(),
            key: format!("experiment.{key}"),
            message: format!("found {}, expected {expected}", value.get(key).unwrap_or(&Value::Null)),
        };
        let whole = |key: &str| value.get(key).and_then(Value::as_u64).ok_or_else(|| wrong(key, "a whole number"));
        let filter = value.get("filter").ok_or_else(|| wrong("filter", "a filter design"))?;
        let nested = |key: &str, message: String| MonteCarloError::Document {
            path: path.into(),
            key: format!("experiment.{key}"),
            message,
        };
        let design =
            FilterDesign::from_json(&filter.to_string(), "filter").map_err(|e| nested("filter", e.to_string()))?;
        let truth = match value.get("truth") {
            None | Some(Value::Null) => None,
            Some(truth) => {
                Some(Params::from_json(&truth.to_string(), "truth").map_err(|e| nested("truth", e.to_string()))?)
            }
        };
        Ok(Experiment {
            design,
            truth,
            truth_spread: value
                .get("truth_spread")
                .and_then(Value::as_bool)
                .ok_or_else(|| wrong("truth_spread", "true or false"))?,
            steps: whole("steps")?,
            seed: whole("seed")?,
            alpha: value.get("alpha").and_then(Value::as_f64).ok_or_else(|| wrong("alpha", "a number"))?,
            replicates: whole("replicates")?,
        })
    }
}

/// Samples of a run where its length is not given: 600 s; for filters that settle more slowly twice the longest
/// settling time, of those that this makes at most `MOST_BY_DEFAULT` samples. It depends on the design alone, so
/// that more runs go on from fewer.
pub fn default_steps(design: &FilterDesign) -> u64 {
    let usual = USUAL_S * design.sample_rate_hz;
    let settled = design.axes.iter().map(|axis| 2.0 * axis.steady_state.settling_time * design.sample_rate_hz);
    let longest = settled.filter(|steps| *steps <= MOST_BY_DEFAULT && *steps > 2.0 * usual).fold(usual, f64::max);
    (longest.ceil() as u64).clamp(MIN_STEPS, MAX_STEPS)
}

/// A course with given truths, one per axis.
pub(super) fn course_of(
    design: &FilterDesign,
    truths: Vec<crate::model::LinearModel>,
    steps: u64,
    seed: u64,
) -> Result<Course, MonteCarloError> {
    let axes = design.axes.iter().zip(truths).map(|(design, truth)| AxisCourse::new(design, truth, steps));
    let axes: Vec<AxisCourse> = axes.collect::<Result<_, _>>()?;
    let spreads = vec![None; axes.len()];
    Ok(Course::new(axes, spreads, steps, seed, 1.0 / design.sample_rate_hz))
}

/// Whether a plan makes sense.
pub(super) fn check(steps: u64, alpha: f64) -> Result<(), MonteCarloError> {
    if !(MIN_STEPS..=MAX_STEPS).contains(&steps) {
        let expected = format!("{MIN_STEPS} to {MAX_STEPS}");
        return Err(MonteCarloError::Plan { name: "steps", value: steps as f64, expected });
    }
    if !(alpha > 0.0 && alpha < 1.0) {
        return Err(MonteCarloError::Plan { name: "alpha", value: alpha, expected: "between 0 and 1".into() });
    }
    Ok(())
}
