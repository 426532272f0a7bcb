//! `kfdesign allan`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::allan::{Request, run as allan};
use crate::view;

/// Allan deviations of a log, with intervals and noise identification
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    /// SVG figure with interval band and fitted components
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// The JSON document into a file
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), ("--plot", &args.plot, Kind::Svg)];
    files::check(&outputs, &[&args.request.log])?;
    let done = allan(&args.request)?;
    files::write_json(args.output.as_deref(), &done.document)?;
    let mut report = view::allan::allan(&done.name, &done.axes);
    files::write_plot(args.plot.as_deref(), &format!("{}: {}", done.name, done.document.deviation.name()), &report)?;
    if args.json {
        print_json(&done.document)?;
    } else {
        report.written = files::written(&outputs);
        report.next = Some(format!("kfdesign identify {} -o params.json", done.name));
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
