//! `kfdesign compare`.

use std::path::PathBuf;

use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use super::{Status, VerdictFlags};
use crate::ops::compare::{Request, run as compare};
use crate::view;

/// Does a noise model fit a log that it may not come from?
///
/// The Allan curve within the envelope the model draws around its own, the spectrum over the model's, and what the
/// model's filter leaves of the log. A test fails when its deviation is significant (Holm, over all tests and axes)
/// and beyond what is tolerated. Exit status 1 when the verdict is inconsistent, or inconclusive without
/// --allow-inconclusive.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: kfdesign compare params.json other_day.csv --report compare.html; kfdesign compare \
                  imu.yaml log.bag --parameters")]
#[command(mut_arg("plot", |plot| plot.help("Allan curve and spectral ratio of every axis")))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The verdict document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    judging: VerdictFlags,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), args.plot.output()];
    files::check(&outputs, &[&args.request.params, &args.request.log])?;
    let (result, unit) = compare(&args.request)?;
    files::write_json(args.output.as_deref(), &result)?;
    let mut report = view::compare::compare(&result, &unit);
    args.plot.write("Model and log", &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    let status = args.judging.status([result.verdict]);
    if args.json {
        print_json(&result)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, status);
    }
    Ok(status)
}
