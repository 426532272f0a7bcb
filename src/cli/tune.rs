//! `kfdesign tune`.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use super::{Status, VerdictFlags};
use crate::export::atomic;
use crate::ops::tune::attitude::linear_only;
use crate::ops::tune::{Done, Linear, Request, attitude, compare, run as tune};
use crate::tune::TunedAttitude;
use crate::view;

/// The augmented Kalman filter from params.json
///
/// States, exact F and Q, R, P0, steady gain, error budget and predicted sigma(t) of every axis. A quick Monte Carlo
/// on the design's own model verifies it before anything is written; a design that fails is not written (exit status
/// 1).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign tune data/params.json -o filter.json --report design.html")]
#[command(mut_arg("plot", |plot| plot.help("Figure of the predicted sigma of every axis")))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The design: filter.json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// One JSON document on stdout: the filter, the reports, the verification, and what --truth and --log gave
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    judging: VerdictFlags,
    /// Rank designs (filter.json, or params.json as identified) on logs instead
    #[arg(long, alias = "compare", num_args = 1.., value_name = "DESIGN|LOG")]
    rank: Vec<PathBuf>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    if let Some(path) = args.request.params.as_ref().filter(|_| !args.rank.is_empty()) {
        bail!("--rank ranks designs and makes none: leave out {}", path.display());
    }
    if args.request.params.is_none() {
        return rank(args);
    }
    let outputs = [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), args.plot.output()];
    files::check(&outputs, &args.request.inputs())?;
    match tune(&args.request)? {
        Done::Linear(done) => linear(args, &done, &outputs),
        Done::Attitude(tuned) => of_attitude(args, &tuned),
    }
}

fn linear(args: &Args, done: &Linear, outputs: &[files::Output<'_>]) -> anyhow::Result<Status> {
    if let (Some(output), true) = (&args.output, done.verified) {
        atomic::write(output, done.tuned.design.to_json().as_bytes())?;
    }
    let shown = done.shown();
    let mut report = view::tune::tune(&shown);
    args.plot.write("Tuned filter", &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    let replays = done.replays.iter().map(|replay| replay.verdict);
    let status = if done.verified { args.judging.status(replays) } else { Status::CheckFailed };
    if args.json {
        print_json(&done.document()?)?;
    } else {
        report.written.extend(args.output.as_deref().map(|output| written(output, done.verified)));
        report.written.extend(files::written(&outputs[1..]));
        report.next = args
            .output
            .as_deref()
            .filter(|_| done.verified)
            .map(|output| format!("kfdesign replay {} LOG", output.display()));
        print_report(&report, status);
    }
    Ok(status)
}

fn of_attitude(args: &Args, tuned: &TunedAttitude) -> anyhow::Result<Status> {
    for (option, given) in [("report", args.report.is_some()), ("plot", args.plot.wanted())] {
        if given {
            return Err(linear_only(option));
        }
    }
    if let Some(output) = &args.output {
        atomic::write(output, tuned.design.to_json().as_bytes())?;
    }
    if args.json {
        print_json(&attitude::document(tuned)?)?;
    } else {
        let name = args.request.params.as_deref().map(|path| path.display().to_string()).unwrap_or_default();
        let mut report = view::tune::attitude(&name, tuned);
        report.written.extend(args.output.as_ref().map(|output| format!("{} written", output.display())));
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}

fn rank(args: &Args) -> anyhow::Result<Status> {
    files::check(&[], &args.rank.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    let request = compare::Request {
        files: args.rank.clone(),
        held_out: args.request.choosing.held_out,
        flicker_horizon: args.request.flicker_horizon,
        plant: args.request.plant.clone(),
        reading: args.request.reading.clone(),
    };
    let (ranking, first) = compare::run(&request)?;
    if args.json {
        print_json(&ranking)?;
    } else {
        print_report(&view::tune::ranking(&ranking, &first), Status::Done);
    }
    Ok(Status::Done)
}

fn written(output: &Path, verified: bool) -> String {
    let what = if verified { "written" } else { "not written: the verification failed" };
    format!("{} {what}", output.display())
}
