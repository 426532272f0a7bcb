//! `kfdesign plan`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::plan::{Request, run as plan};
use crate::view;

/// How long to record, and at which rate, to know a parameter to a wished precision
///
/// The precision is the relative standard deviation (1 sigma) of a maximum likelihood estimate with the model of
/// params.json; its Cramér-Rao bound at these parameters is what is planned with. Exit status 1 when no log of up to
/// ten years is enough.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign plan data/params.json --parameter gauss_markov.correlation_time --precision 10%"
)]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The plan as a JSON document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json)];
    files::check(&outputs, &[&args.request.params])?;
    let plan = plan(&args.request)?;
    files::write_json(args.output.as_deref(), &plan)?;
    let possible = plan.axes.iter().all(|axis| axis.duration_s.is_some());
    let status = if possible { Status::Done } else { Status::CheckFailed };
    if args.json {
        print_json(&plan)?;
    } else {
        let mut report = view::plan::plan(&plan);
        report.written = files::written(&outputs);
        print_report(&report, status);
    }
    Ok(status)
}
