//! `kfdesign tune`.

pub(super) mod attitude;
mod compare;
mod insight;
mod logs;
mod objective;
pub(super) mod plant_flags;
mod sight;
mod text;
mod truth;
mod view;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;

use self::logs::Reading;
use self::objective::{ObjectiveArg, ObjectiveFlags};
use self::plant_flags::PlantFlags;
use self::view::View;
use super::files::{self, Kind};
use super::flags::whole;
use super::log_flags::LogFlags;
use super::output::{print_json, print_text, progress, say};
use super::{Status, VerdictFlags};
use crate::cli::checked;
use crate::consistency::Verdict;
use crate::export::atomic;
use crate::filter::FilterDesign;
use crate::montecarlo::{Outcome, Plan, verify};
use crate::params::{Params, PlantEntry};
use crate::replay::ReplayResult;
use crate::tune::objective::{Objective, Record, Request, tune_by};
use crate::tune::{AxisReport, Insight, TuneOptions, Tuned, UnderTruth, insight, tune, under_truth};

/// The augmented Kalman filter from params.json
///
/// States, exact F and Q, R, P0, steady gain, error budget and predicted sigma(t) of every axis. A quick Monte Carlo on the design's own
/// model verifies it before anything is written; a design that fails is not written (exit status 1).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign tune data/params.json -o filter.json --report design.html")]
pub struct Args {
    /// Noise parameters
    #[arg(required_unless_present = "compare")]
    params: Option<PathBuf>,
    /// The design: filter.json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Slowest time constant that the states for flicker cover
    #[arg(long, default_value_t = TuneOptions::default().flicker_horizon_s, value_name = "SECONDS", allow_negative_numbers = true)]
    flicker_horizon: f64,
    /// Also say what the design does when the sensor has these parameters instead
    #[arg(long, value_name = "PARAMS")]
    truth: Option<PathBuf>,
    /// Runs of the Monte Carlo
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    runs: u64,
    /// Seed of the Monte Carlo
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    seed: u64,
    /// Also say when each state is known, what better parts would buy, and what wrong parameters would cost
    #[arg(long)]
    insight: bool,
    /// Also replay these logs through the design; the objectives likelihood and als choose the parameters on them
    #[arg(long, num_args = 1.., value_name = "LOG")]
    log: Vec<PathBuf>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Figure of the predicted sigma of every axis
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout: the filter, the reports, the verification, and what --truth and --log gave
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    judging: VerdictFlags,
    #[command(flatten)]
    choosing: ObjectiveFlags,
    #[command(flatten)]
    plant: PlantFlags,
    #[command(flatten)]
    reading: LogFlags,
}

/// What `tune --json` prints.
#[derive(Serialize, JsonSchema)]
pub(super) struct Printed<'a> {
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

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let reading = Reading { flags: &args.reading, aids: &args.plant.columns() };
    let params_path = match &args.params {
        Some(path) if args.choosing.compare.is_empty() => path,
        Some(path) => bail!("--compare ranks designs and makes none: leave out {}", path.display()),
        None => {
            let options = TuneOptions { design: None, flicker_horizon_s: args.flicker_horizon };
            return compare::run(&args.choosing.compare, args.choosing.held_out, args.json, &options, &reading);
        }
    };
    let outputs =
        [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), ("--plot", &args.plot, Kind::Svg)];
    let inputs: Vec<&Path> =
        std::iter::once(params_path).chain(&args.log).chain(&args.truth).map(PathBuf::as_path).collect();
    files::check(&outputs, &inputs)?;
    let params = checked::params(params_path)?;
    let name = params_path.display().to_string();
    let design = args.plant.design(&params)?;
    let attitude = design.as_ref().or(params.design.as_ref()).filter(|d| matches!(d.plant, PlantEntry::Attitude(_)));
    if let Some(design) = attitude {
        return attitude::run(args, &name, &params, design);
    }
    let options = TuneOptions { design, flicker_horizon_s: args.flicker_horizon };
    let (mut tuned, record) = chosen(args, &params, &options, &reading).with_context(|| name.clone())?;
    let truth = args.truth.as_deref().map(|path| Truth::read(path, &tuned, &options)).transpose()?;
    let plan = Plan { runs: args.runs, seed: args.seed, ..Plan::quick(params.sample_rate_hz) };
    let insights = if args.insight { insight(&tuned, &options)? } else { Vec::new() };
    let bar = progress(plan.runs * tuned.design.axes.len() as u64, "verify");
    let verification = verify(&tuned.design, &plan, &|runs| bar.inc(runs))?;
    bar.finish_and_clear();
    if let Some(record) = tuned.design.tuning.as_object_mut() {
        let summary = json!({
            "verdict": verification.verdict, "alpha": verification.alpha, "runs": verification.runs.count(),
            "steps": verification.steps, "seed": verification.seed, "tests": verification.tests,
        });
        record.insert("verification".into(), summary);
    }
    let kept = record.iter().flat_map(|record| &record.robust).all(|axis| axis.met);
    let verified = verification.verdict == Verdict::Consistent && kept;
    let replays = args.log.iter().map(|log| reading.replay(log, &tuned.design)).collect::<anyhow::Result<Vec<_>>>()?;
    if let (Some(output), true) = (&args.output, verified) {
        atomic::write(output, tuned.design.to_json().as_bytes())?;
    }
    let view = View {
        name: &name,
        params: &params,
        tuned: &tuned,
        verification: &verification,
        truth: truth.as_ref(),
        insights: &insights,
    };
    if let Some(path) = &args.plot {
        atomic::write(path, sight::sheet(&view).as_bytes())?;
    }
    if let Some(path) = &args.report {
        let mut page = sight::page(&view, &replays);
        page.sections.splice(0..0, record.iter().map(|record| objective::section(record, &params)));
        atomic::write(path, page.to_html()?.as_bytes())?;
    }
    if args.json {
        let filter = serde_json::from_str(&tuned.design.to_json())?;
        print_json(&Printed {
            format: "kfdesign-tune/1",
            filter,
            reports: &tuned.reports,
            verification: &verification,
            under_truth: truth.as_ref().map(|t| t.axes.as_slice()),
            insight: &insights,
            replay: &replays,
        })?;
    } else {
        let mut printed = record.as_ref().map_or_else(String::new, |record| objective::text(record, &params));
        printed.push_str(&text::design(&view));
        replays.iter().for_each(|result| printed.push_str(&text::replay(result)));
        if let Some(output) = &args.output {
            printed.push_str(&written(output, verified));
        }
        print_text(&printed);
    }
    Ok(if verified { args.judging.status(replays.iter().map(|r| r.verdict)) } else { Status::CheckFailed })
}

/// What `--truth` asks for.
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

fn written(output: &Path, verified: bool) -> String {
    if verified {
        format!("\n{} written\n", output.display())
    } else {
        format!("\n{} not written: the verification failed\n", output.display())
    }
}

/// The design with its parameters chosen as asked, and how they were.
fn chosen(
    args: &Args,
    params: &Params,
    options: &TuneOptions,
    reading: &Reading<'_>,
) -> anyhow::Result<(Tuned, Option<Record>)> {
    let flags = &args.choosing;
    let truth = args.truth.as_deref().filter(|_| flags.objective.objective() == Objective::Nees);
    let truth = truth.map(Params::read).transpose()?;
    let mut logs = Vec::new();
    if flags.objective.needs_logs() {
        let nominal = tune(params, options)?;
        let own = params.source.as_ref().and_then(|source| source.sha256.clone());
        for log in &args.log {
            let (read, sha256) = reading.read(log, &nominal.design)?;
            if flags.objective == ObjectiveArg::Likelihood && !flags.no_prior && own.as_ref() == Some(&sha256) {
                say(
                    "  warning: the intervals come from this log, which now counts twice; give another one, or --no-prior",
                );
            }
            logs.push(read);
        }
    }
    let request = Request {
        objective: flags.objective.objective(),
        hold: &flags.hold,
        truth: truth.as_ref(),
        logs: &logs,
        held_out: flags.held_out,
        priors: !flags.no_prior,
        seed: args.seed,
    };
    Ok(tune_by(params, options, &request)?)
}
