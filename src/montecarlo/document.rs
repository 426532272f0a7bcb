//! The Monte Carlo document: verdict, curves, and the sums that make it a shard which can be merged or gone on with.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::calibration::MAX_RUN;
use super::course::AxisCourse;
use super::engine::Course;
use super::outcome::{Outcome, Runs};
use super::sums::NIS_BINS;
use super::{Experiment, MonteCarloError, Totals};
use crate::consistency::Verdict;
use crate::filter::rows;
use crate::numerics::exact_sum::ExactSum;
use crate::params::place;

const FORMAT: &str = "kfdesign-montecarlo/1";

#[derive(Serialize, JsonSchema)]
enum Format {
    #[serde(rename = "kfdesign-montecarlo/1")]
    MonteCarlo1,
}

/// A Monte Carlo experiment: `runs` of it, their sums, and the verdict on them. A document of interrupted work has
/// no tests.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "MonteCarlo")]
struct Document {
    format: Format,
    #[serde(flatten)]
    outcome: Outcome,
    /// What decides every number: `filter` and `truth` as documents, `truth_spread`, `steps`, `seed`, `alpha`,
    /// `replicates`. Documents with equal experiments and adjoining runs can be merged.
    experiment: Value,
    sums: Vec<AxisSums>,
}

/// Exact sums over the runs of one axis.
#[derive(Serialize, JsonSchema)]
struct AxisSums {
    axis: String,
    /// Each sum as the doubles that add up to it exactly. Per time of the NEES curve: log₁₀ NEES, u, u uᵀ (lower
    /// triangle by rows) with u the whitened error; then per measurement Σy, Σy², Σ y_k y_(k−h), Σ (block
    /// sum)²/length, periodogram. Null stands for a sum that is not finite.
    #[schemars(with = "Vec<Vec<Option<f64>>>")]
    values: Vec<Vec<f64>>,
    /// Per time and component: runs within 1, 2, 3 sigma; then per measurement the NIS histogram.
    counts: Vec<u64>,
}

/// What a document holds: an experiment with the sums of some of its runs.
#[derive(Clone, Debug)]
pub struct Shard {
    pub path: String,
    pub experiment: Experiment,
    pub runs: Runs,
    sums: Vec<(Vec<Vec<f64>>, Vec<u64>)>,
}

/// JSON with a trailing newline; the same bytes for the same runs, however they were come by.
pub fn to_json(experiment: &Experiment, outcome: &Outcome, totals: &[Totals]) -> String {
    let sums = experiment.design.axes.iter().zip(totals).map(|(axis, totals)| AxisSums {
        axis: axis.name.clone(),
        values: totals.values.iter().map(ExactSum::digits).collect(),
        counts: totals.counts.clone(),
    });
    rows::to_string(&Document {
        format: Format::MonteCarlo1,
        outcome: outcome.clone(),
        experiment: experiment.to_value(),
        sums: sums.collect(),
    })
}

/// A document of work that is not finished: sums, but no verdict.
pub fn partial_json(experiment: &Experiment, course: &Course, runs: Runs, totals: &[Totals]) -> String {
    let outcome = Outcome {
        verdict: Verdict::Inconclusive,
        meaning: format!("{} runs are done; go on with `resume`, or judge them with kfdesign merge", runs.count()),
        alpha: experiment.alpha,
        runs,
        steps: experiment.steps,
        duration_s: experiment.steps as f64 * course.dt,
        seed: experiment.seed,
        critical_p_value: f64::NAN,
        false_alarm_rate: None,
        rejection: None,
        detects: Vec::new(),
        tests: Vec::new(),
        axes: Vec::new(),
    };
    to_json(experiment, &outcome, totals)
}

/// The published JSON schema.
pub fn schema() -> Value {
    schemars::schema_for!(Document).to_value()
}

impl Shard {
    pub fn read(path: &Path) -> Result<Shard, MonteCarloError> {
        let shown = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| MonteCarloError::Document {
            path: shown.clone(),
            key: "cannot read".into(),
            message: e.to_string(),
        })?;
        Shard::from_json(&text, &shown)
    }

    /// Reads a document; complaints name `path` and the key.
    pub fn from_json(text: &str, path: &str) -> Result<Shard, MonteCarloError> {
        let wrong =
            |key: &str, message: String| MonteCarloError::Document { path: path.into(), key: key.into(), message };
        let value = place::parse(text).map_err(|e| {
            wrong(&format!("line {}, column {}", e.line, e.column), format!("not valid JSON: {}", e.message))
        })?;
        if value.get("format").and_then(Value::as_str) != Some(FORMAT) {
            let found = value.get("format").unwrap_or(&Value::Null);
            return Err(wrong(
                "format",
                format!("found {found}, expected \"{FORMAT}\", as written by kfdesign montecarlo"),
            ));
        }
        let experiment = value.get("experiment").ok_or_else(|| wrong("experiment", "is missing".into()))?;
        let experiment = Experiment::from_value(experiment, path)?;
        let run = |key: &str| value.get("runs").and_then(|runs| runs.get(key)).and_then(Value::as_u64);
        let runs = match (run("first"), run("end")) {
            (Some(first), Some(end)) if first < end && end <= MAX_RUN => Runs { first, end },
            _ => {
                let found = value.get("runs").unwrap_or(&Value::Null);
                let expected = format!("{{\"first\": A, \"end\": B}} with A below B and B at most {MAX_RUN}");
                return Err(wrong("runs", format!("found {found}, expected {expected}")));
            }
        };
        let sums = value.get("sums").and_then(Value::as_array).ok_or_else(|| wrong("sums", "is missing".into()))?;
        let axis = |(i, sums): (usize, &Value)| {
            let expected = || {
                wrong(
                    &format!("sums[{i}]"),
                    "expected \"values\" (lists of numbers) and \"counts\" (whole numbers)".into(),
                )
            };
            let values = sums.get("values").and_then(Value::as_array).ok_or_else(expected)?;
            let counts = sums.get("counts").and_then(Value::as_array).ok_or_else(expected)?;
            let digits = |digits: &Value| {
                let digits = digits.as_array()?;
                // what is not finite is written as null
                digits
                    .iter()
                    .map(|d| if d.is_null() { Some(f64::NAN) } else { d.as_f64() })
                    .collect::<Option<Vec<f64>>>()
            };
            let values = values.iter().map(digits).collect::<Option<_>>().ok_or_else(expected)?;
            let counts = counts.iter().map(Value::as_u64).collect::<Option<_>>().ok_or_else(expected)?;
            Ok((values, counts))
        };
        let sums = sums.iter().enumerate().map(axis).collect::<Result<Vec<_>, _>>()?;
        Ok(Shard { path: path.into(), experiment, runs, sums })
    }

    /// The sums, if they are those of `course`.
    pub fn totals(&self, course: &Course) -> Result<Vec<Totals>, MonteCarloError> {
        let wrong =
            |message: String| MonteCarloError::Document { path: self.path.clone(), key: "sums".into(), message };
        if self.sums.len() != course.axes.len() {
            return Err(wrong(format!("found {} axes, expected {}", self.sums.len(), course.axes.len())));
        }
        let one = |((values, counts), axis): (&(Vec<Vec<f64>>, Vec<u64>), &AxisCourse)| {
            let fresh = Totals::new(&axis.layout);
            if values.len() != fresh.values.len() || counts.len() != fresh.counts.len() {
                return Err(wrong(format!(
                    "axis '{}': found {} values and {} counts, expected {} and {}",
                    axis.name,
                    values.len(),
                    counts.len(),
                    fresh.values.len(),
                    fresh.counts.len()
                )));
            }
            let sums = values.iter().map(|d| ExactSum::from_digits(d)).collect();
            let totals = Totals { values: sums, counts: counts.clone() };
            match impossible(&totals, axis, self.runs.count()) {
                None => Ok(totals),
                Some(what) => Err(wrong(format!("axis '{}': {what}; the file was changed or damaged", axis.name))),
            }
        };
        self.sums.iter().zip(&course.axes).map(one).collect()
    }

    /// Errors unless the experiment is `expected`: what differs first, by key.
    pub fn require(&self, expected: &Experiment, of: &str) -> Result<(), MonteCarloError> {
        let (found, expected) = (self.experiment.to_value(), expected.to_value());
        match difference(&found, &expected, "experiment") {
            None => Ok(()),
            Some((key, found, expected)) => Err(MonteCarloError::Document {
                path: self.path.clone(),
                key,
                message: format!("found {found}, but {expected} in {of}: not the same experiment"),
            }),
        }
    }
}

/// What no `runs` runs can add up to, whatever the truth: counts that do not belong to so many runs, or sums against
/// Cauchy and Schwarz.
///
/// Sums that are not finite are those of a truth that runs away; nothing is said about them.
fn impossible(totals: &Totals, axis: &AxisCourse, runs: u64) -> Option<String> {
    let layout = &axis.layout;
    // sums of a run are rounded before they are added up
    let larger = |a: f64, b: f64| a > b + 1e-9 * b.abs();
    for epoch in 0..axis.epochs.len() {
        let (means, moments) = (layout.mean(epoch), layout.moments(epoch));
        for i in 0..axis.judge.size() {
            let within = &totals.counts[layout.within(epoch, i)..][..3];
            if !within.is_sorted() || within[2] > runs {
                return Some(format!("found {within:?} runs within 1, 2, 3 sigma, expected a growing share of {runs}"));
            }
            let (mean, square) = (totals.value(means + i), totals.value(moments + i * (i + 3) / 2));
            if larger(mean * mean, square * runs as f64) {
                return Some(format!("a sum of errors of {mean} with a sum of squares of {square}"));
            }
        }
    }
    for (c, channel) in axis.channels.iter().enumerate() {
        let updates = u128::from(channel.updates) * u128::from(runs);
        let binned: u128 = totals.counts[layout.histogram(c)..][..=NIS_BINS].iter().map(|n| u128::from(*n)).sum();
        if binned != updates {
            return Some(format!("found {binned} innovations in the histogram, expected {updates}"));
        }
        let (mean, square) = (totals.value(layout.sum(c)), totals.value(layout.squares(c)));
        let products = totals.some(layout.lags(c), channel.lags);
        if larger(mean * mean, square * updates as f64) || products.iter().any(|p| larger(p.abs(), square)) {
            return Some(format!("a sum of squared innovations of {square} with larger sums of products"));
        }
        let powers = totals.some(layout.blocks(c), channel.lengths.len() + channel.ordinates);
        if let Some(power) = powers.iter().find(|power| **power < 0.0) {
            return Some(format!("a sum of squares of {power}"));
        }
    }
    None
}

/// Key and values of the first difference.
fn difference(a: &Value, b: &Value, key: &str) -> Option<(String, String, String)> {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            let keys = x.keys().chain(y.keys().filter(|key| !x.contains_key(*key)));
            let null = Value::Null;
            keys.map(|k| difference(x.get(k).unwrap_or(&null), y.get(k).unwrap_or(&null), &format!("{key}.{k}")))
                .find_map(|found| found)
        }
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
            let pairs = x.iter().zip(y).enumerate();
            pairs.map(|(i, (x, y))| difference(x, y, &format!("{key}[{i}]"))).find_map(|found| found)
        }
        _ if a == b => None,
        _ => Some((key.to_string(), short(a), short(b))),
    }
}

fn short(value: &Value) -> String {
    match value {
        Value::Object(_) => "an object".into(),
        Value::Array(list) => format!("a list of {}", list.len()),
        plain => plain.to_string(),
    }
}

/// Shards in the order of their runs; errors when they overlap, leave runs out, or belong to different experiments.
pub fn in_order(mut shards: Vec<Shard>) -> Result<Vec<Shard>, MonteCarloError> {
    shards.sort_by_key(|shard| (shard.runs.first, shard.runs.end));
    for pair in shards.windows(2) {
        let [before, after] = pair else { continue };
        after.require(&before.experiment, &before.path)?;
        let message = if after.runs.first < before.runs.end {
            let end = before.runs.end.min(after.runs.end);
            format!("runs {}..{end} are also in {}", after.runs.first, before.path)
        } else if after.runs.first > before.runs.end {
            format!("runs {}..{} are missing between {} and this", before.runs.end, after.runs.first, before.path)
        } else {
            continue;
        };
        return Err(MonteCarloError::Document { path: after.path.clone(), key: "runs".into(), message });
    }
    Ok(shards)
}
