//! `kfdesign tune`.

mod plant_flags;
mod sight;
mod text;
mod truth;

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use serde_json::json;

use self::plant_flags::PlantFlags;
use super::Status;
use super::log_flags::{LogFlags, print_check};
use super::output::{print_json, print_text, progress};
use crate::consistency::Verdict;
use crate::export::atomic;
use crate::input::{Block, LogReader};
use crate::montecarlo::{Outcome, Plan, verify};
use crate::params::Params;
use crate::replay::{LogShape, Options, ReplayResult, Replayer};
use crate::tune::{AxisReport, TuneOptions, Tuned, UnderTruth, tune, under_truth};

/// The augmented Kalman filter from params.json
///
/// States, exact F and Q, R, P0, steady gain, error budget and predicted sigma(t) of every axis. A quick Monte Carlo on the design's own
/// model verifies it before anything is written; a design that fails is not written (exit status 1).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign tune data/params.json -o filter.json --report design.html")]
pub struct Args {
    /// Noise parameters
    params: PathBuf,
    /// The design: filter.json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Slowest time constant that the states for flicker cover
    #[arg(long, default_value_t = TuneOptions::default().flicker_horizon_s, value_name = "SECONDS")]
    flicker_horizon: f64,
    /// Also say what the design does when the sensor has these parameters instead
    #[arg(long, value_name = "PARAMS")]
    truth: Option<PathBuf>,
    /// Runs of the Monte Carlo
    #[arg(long, default_value_t = 100, value_name = "N")]
    runs: u64,
    /// Seed of the Monte Carlo
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Also replay this log through the design
    #[arg(long, value_name = "LOG")]
    log: Option<PathBuf>,
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
    plant: PlantFlags,
    #[command(flatten)]
    reading: LogFlags,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Printed<'a> {
    filter: serde_json::Value,
    reports: &'a [AxisReport],
    verification: &'a Outcome,
    #[serde(skip_serializing_if = "Option::is_none")]
    under_truth: Option<&'a [UnderTruth]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    replay: Option<&'a ReplayResult>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    for output in [&args.output, &args.report, &args.plot].into_iter().flatten() {
        for input in std::iter::once(&args.params).chain(&args.log).chain(&args.truth) {
            atomic::check_output(output, input)?;
        }
    }
    let params = Params::read(&args.params)?;
    let name = args.params.display().to_string();
    let options = TuneOptions { design: args.plant.design(&params)?, flicker_horizon_s: args.flicker_horizon };
    let mut tuned = tune(&params, &options).with_context(|| name.clone())?;
    let truth = args.truth.as_deref().map(|path| Truth::read(path, &tuned, &options)).transpose()?;
    let plan = Plan { runs: args.runs, seed: args.seed, ..Plan::quick(params.sample_rate_hz) };
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
    let verified = verification.verdict == Verdict::Consistent;
    if let (Some(output), true) = (&args.output, verified) {
        atomic::write(output, tuned.design.to_json().as_bytes())?;
    }
    let replay = args.log.as_deref().map(|log| replay(args, &tuned, log)).transpose()?;
    let view =
        text::View { name: &name, params: &params, tuned: &tuned, verification: &verification, truth: truth.as_ref() };
    if let Some(path) = &args.plot {
        atomic::write(path, sight::sheet(&view).as_bytes())?;
    }
    if let Some(path) = &args.report {
        atomic::write(path, sight::page(&view, replay.as_ref()).to_html()?.as_bytes())?;
    }
    if args.json {
        let filter = serde_json::from_str(&tuned.design.to_json())?;
        print_json(&Printed {
            filter,
            reports: &tuned.reports,
            verification: &verification,
            under_truth: truth.as_ref().map(|t| t.axes.as_slice()),
            replay: replay.as_ref(),
        })?;
    } else {
        let mut printed = text::design(&view);
        if let Some(result) = &replay {
            printed.push_str(&text::replay(result));
        }
        if let Some(output) = &args.output {
            printed.push_str(&written(output, verified));
        }
        print_text(&printed)?;
    }
    let contradicted = replay.is_some_and(|r| r.verdict == Verdict::Inconsistent);
    Ok(if verified && !contradicted { Status::Done } else { Status::CheckFailed })
}

/// What `--truth` asks for.
struct Truth {
    name: String,
    axes: Vec<UnderTruth>,
}

impl Truth {
    fn read(path: &Path, tuned: &Tuned, options: &TuneOptions) -> anyhow::Result<Truth> {
        let name = path.display().to_string();
        let axes = under_truth(tuned, &Params::read(path)?, options).with_context(|| name.clone())?;
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

/// The log through the design; only the verdict is wanted.
fn replay(args: &Args, tuned: &Tuned, log: &Path) -> anyhow::Result<ReplayResult> {
    let mut reader = LogReader::open(log, &args.reading.options()?)?;
    let name = log.display().to_string();
    print_check(&name, reader.check());
    let shape = LogShape {
        axes: reader.axes().iter().map(|a| a.name.clone()).collect(),
        quantity: reader.quantity(),
        sample_rate_hz: reader.check().sample_rate_hz,
        aids: 0,
    };
    let mut replayer = Replayer::new(&tuned.design, &shape, Options::default()).with_context(|| name.clone())?;
    let mut block = Block::default();
    let bar = progress(reader.check().samples, "replay");
    while reader.next_block(&mut block)? {
        replayer.push(&block, None);
        bar.inc(block.time_s.len() as u64);
    }
    bar.finish_and_clear();
    let mut result = replayer.finish();
    result.log = Some(name);
    result.log_sha256 = Some(reader.sha256().to_string());
    Ok(result)
}
