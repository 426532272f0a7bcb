//! `kfdesign inflate`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::export::atomic;
use crate::ops::inflate::{Request, run as inflate};
use crate::view;

/// How many times louder than on the bench: the factor that vibration puts on white noise
///
/// The noise of a flight log above a frequency that motion does not reach, over what the parameters say there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign inflate params.json flight.csv --from 20 -o inflated.json")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The parameters with their white noise multiplied by the factor
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json)];
    files::check(&outputs, &[&args.request.params, &args.request.log])?;
    let done = inflate(&args.request)?;
    if let Some(path) = &args.output {
        atomic::write(path, done.params.to_json().as_bytes())?;
    }
    if args.json {
        print_json(&done.found)?;
    } else {
        let mut report = view::inflate::inflate(&done.found, &done.unit);
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
