//! `kfdesign trim`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::trim::{Request, run as trim};
use crate::view;

/// Steady flight, the linear model about it, its modes, handling-quality levels and controllability
///
/// Straight, climbing or turning flight, of the section `trim` of a flight.json, or of an airplane.json by flags;
/// flags replace what the document says. Flight that is not possible is refused by what is missing: lift, thrust,
/// elevator.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign trim data/airplanes/aerosonde.json --speed \"25 m/s\" --altitude \"100 m\" -o \
                  linear.json"
)]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The document: linear.json
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// One HTML page with tables, poles and step responses
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// One JSON document on stdout, the same as -o writes
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html)];
    files::check(&outputs, &[&args.request.file])?;
    let done = trim(&args.request)?;
    files::write_json(args.output.as_deref(), &done.document)?;
    let mut report = view::trim::trim(&done.linearized, &done.document);
    files::write_page(args.report.as_deref(), &report)?;
    if args.json {
        print_json(&done.document)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
