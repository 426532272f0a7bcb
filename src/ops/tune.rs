//! The augmented Kalman filter of noise parameters.

mod airplane;
pub mod attitude;
pub mod compare;
pub mod objective;
pub mod plant_flags;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use self::objective::{ObjectiveArg, ObjectiveFlags};
use self::plant_flags::PlantFlags;
use super::amounts::whole;
use super::checked;
use super::logs::Logs;
use super::reading::Reading;
use crate::consistency::Verdict;
use crate::filter::FilterDesign;
use crate::montecarlo::{Outcome, Plan, verify};
use crate::numerics::progress::{begin, warning};
use crate::params::{Params, PlantEntry};
use crate::replay::ReplayResult;
use crate::tune::objective::{Objective, Record, Request as By, tune_by};
use crate::tune::{AxisReport, Insight, TuneOptions, Tuned, TunedAttitude, UnderTruth, insight, tune, under_truth};
use crate::view::tune::Design;

/// Which filter is made of which parameters.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Noise parameters
    #[arg(required_unless_present = "rank")]
    #[serde(default)]
    pub params: Option<PathBuf>,
    /// Slowest time constant that the states for flicker cover
    #[arg(long, default_value_t = TuneOptions::default().flicker_horizon_s, value_name = "SECONDS", allow_negative_numbers = true)]
    #[serde(default = "flicker_horizon")]
    pub flicker_horizon: f64,
    /// Also say what the design does when the sensor has these parameters instead
    #[arg(long, value_name = "PARAMS")]
    #[serde(default)]
    pub truth: Option<PathBuf>,
    /// Runs of the Monte Carlo
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "runs")]
    pub runs: u64,
    /// Seed of the Monte Carlo
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "seed")]
    pub seed: u64,
    /// Also say when each state is known, what better parts would buy, and what wrong parameters would cost
    #[arg(long)]
    #[serde(default)]
    pub insight: bool,
    /// Also replay these logs through the design; the objectives likelihood and als choose the parameters on them
    #[arg(long, num_args = 1.., value_name = "LOG")]
    #[serde(default)]
    pub log: Vec<PathBuf>,
    #[command(flatten)]
    #[serde(default)]
    pub choosing: ObjectiveFlags,
    #[command(flatten)]
    #[serde(default)]
    pub plant: PlantFlags,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

fn flicker_horizon() -> f64 {
    TuneOptions::default().flicker_horizon_s
}

fn runs() -> u64 {
    100
}

fn seed() -> u64 {
    1
}

/// What `tune` gives as a document.
#[derive(Serialize, JsonSchema)]
pub struct Document<'a> {
    /// "kfdesign-tune/1".
    format: &'static str,
    /// As written with `-o`.
    #[schemars(with = "FilterDesign")]
    filter: serde_json::Value,
    reports: &'a [AxisReport],
    verification: &'a Outcome,
    #[serde(skip_serializing_if = "Option::is_none")]
    under_truth: Option<&'a [UnderTruth]>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    insight: &'a [Insight],
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    replay: &'a [ReplayResult],
}

/// A design, verified or not.
pub enum Done {
    Linear(Box<Linear>),
    Attitude(Box<TunedAttitude>),
}

/// A filter of a linear model.
pub struct Linear {
    /// Of the parameters.
    pub name: String,
    pub params: Params,
    pub tuned: Tuned,
    pub verification: Outcome,
    /// The Monte Carlo finds it consistent, and what its objective claims is kept: only then should it be written.
    pub verified: bool,
    pub replays: Vec<ReplayResult>,
    truth: Option<Truth>,
    insights: Vec<Insight>,
    record: Option<Record>,
}

impl Request {
    /// Files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        let given = self.params.iter().chain(&self.log).chain(&self.truth).chain(&self.plant.flight);
        given.map(PathBuf::as_path).collect()
    }
}

/// Notes say what the logs are, and what of the parameters is in doubt.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    let Some(path) = &request.params else {
        bail!("params is missing: the noise parameters of which a filter is made")
    };
    let logs = Logs { reading: &request.reading, aids: &request.plant.columns() };
    let params = checked::params(path)?;
    let name = path.display().to_string();
    let design = if request.plant.is_airplane() { None } else { request.plant.design(&params)? };
    let attitude = design.as_ref().or(params.design.as_ref()).filter(|d| matches!(d.plant, PlantEntry::Attitude(_)));
    if let Some(design) = attitude {
        return Ok(Done::Attitude(Box::new(attitude::run(request, &name, &params, design)?)));
    }
    let options = TuneOptions { design, flicker_horizon_s: request.flicker_horizon };
    let made = if request.plant.is_airplane() {
        airplane::tuned(request, &params).map(|(axes, tuned)| (axes, tuned, None))
    } else {
        chosen(request, &params, &options, &logs).map(|(tuned, record)| (params, tuned, record))
    };
    let (params, mut tuned, record) = made.with_context(|| name.clone())?;
    let truth = request.truth.as_deref().map(|path| Truth::read(path, &tuned, &options)).transpose()?;
    let plan = Plan { runs: request.runs, seed: request.seed, ..Plan::quick(params.sample_rate_hz) };
    let insights = if request.insight { insight(&tuned, &options)? } else { Vec::new() };
    begin("verify", plan.runs * tuned.design.axes.len() as u64);
    let verification = verify(&tuned.design, &plan)?;
    if let Some(record) = tuned.design.tuning.as_object_mut() {
        let summary = json!({
            "verdict": verification.verdict, "alpha": verification.alpha, "runs": verification.runs.count(),
            "steps": verification.steps, "seed": verification.seed, "tests": verification.tests,
        });
        record.insert("verification".into(), summary);
    }
    let kept = record.iter().flat_map(|record| &record.robust).all(|axis| axis.met);
    let verified = verification.verdict == Verdict::Consistent && kept;
    let replays = request.log.iter().map(|log| logs.replay(log, &tuned.design)).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Done::Linear(Box::new(Linear { name, params, tuned, verification, verified, replays, truth, insights, record })))
}

impl Linear {
    /// As a person reads it.
    pub fn shown(&self) -> Design<'_> {
        Design {
            name: &self.name,
            params: &self.params,
            tuned: &self.tuned,
            verification: &self.verification,
            truth: self.truth.as_ref().map(|truth| (truth.name.as_str(), truth.axes.as_slice())),
            insights: &self.insights,
            record: self.record.as_ref(),
            replays: &self.replays,
        }
    }

    pub fn document(&self) -> anyhow::Result<Document<'_>> {
        Ok(Document {
            format: "kfdesign-tune/1",
            filter: serde_json::from_str(&self.tuned.design.to_json())?,
            reports: &self.tuned.reports,
            verification: &self.verification,
            under_truth: self.truth.as_ref().map(|t| t.axes.as_slice()),
            insight: &self.insights,
            replay: &self.replays,
        })
    }
}

/// Another truth than the design's own.
struct Truth {
    name: String,
    axes: Vec<UnderTruth>,
}

impl Truth {
    fn read(path: &Path, tuned: &Tuned, options: &TuneOptions) -> anyhow::Result<Truth> {
        let name = path.display().to_string();
        let axes = under_truth(tuned, &checked::params(path)?, options).with_context(|| name.clone())?;
        Ok(Truth { name, axes })
    }
}

/// The design with its parameters chosen as asked, and how they were.
fn chosen(
    request: &Request,
    params: &Params,
    options: &TuneOptions,
    logs_of: &Logs<'_>,
) -> anyhow::Result<(Tuned, Option<Record>)> {
    let flags = &request.choosing;
    let truth = request.truth.as_deref().filter(|_| flags.objective.objective() == Objective::Nees);
    let truth = truth.map(Params::read).transpose()?;
    let mut logs = Vec::new();
    if flags.objective.needs_logs() {
        let nominal = tune(params, options)?;
        let own = params.source.as_ref().and_then(|source| source.sha256.clone());
        for log in &request.log {
            let (read, sha256) = logs_of.read(log, &nominal.design)?;
            if flags.objective == ObjectiveArg::Likelihood && !flags.no_prior && own.as_ref() == Some(&sha256) {
                warning("the intervals come from this log, which now counts twice; give another one, or `no_prior`");
            }
            logs.push(read);
        }
    }
    let by = By {
        objective: flags.objective.objective(),
        hold: &flags.hold,
        truth: truth.as_ref(),
        logs: &logs,
        held_out: flags.held_out,
        priors: !flags.no_prior,
        seed: request.seed,
    };
    Ok(tune_by(params, options, &by)?)
}
