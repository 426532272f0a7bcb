//! `kfdesign loop`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use crate::export::{atomic, junit};
use crate::ops::closed_loop::{Request, run as judge};
use crate::view;

/// The filter in the control loop: what a sensor and its filter do to stability, damping, gusts and accuracy
///
/// Every feed between sensors and gains (raw, low-pass, notch, Kalman filters of drift or airframe) is judged exactly,
/// without simulation: motions, margins at every surface, rms by source, offsets, responses. Exit status 1 when a
/// criterion of the flight is not kept.
#[derive(Debug, clap::Args)]
#[command(mut_arg("plot", |plot| plot.help("Poles, loop gain, sensitivity and surface rates as figures")))]
#[command(after_help = "Example: kfdesign loop data/flights/aerosonde-loop.json --report loop.html")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout, the same as -o writes
    #[arg(long)]
    json: bool,
    /// Test report for CI servers
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Verdict, tables and figures on one page
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [
        ("-o", &args.output, Kind::Json),
        ("--junit", &args.junit, Kind::Xml),
        ("--report", &args.report, Kind::Html),
        args.plot.output(),
    ];
    files::check(&outputs, &args.request.inputs())?;
    let done = judge(&args.request, args.report.is_some() || args.plot.wanted())?;
    files::write_json(args.output.as_deref(), &done.judged.document)?;
    if let Some(path) = &args.junit {
        atomic::write(path, junit::of_loop(&done.judged.document)?.as_bytes())?;
    }
    let mut report = view::closed_loop::closed_loop(&done.judged, &done.drawn);
    args.plot.write(&report.title, &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    let status = if done.judged.passes() { Status::Done } else { Status::CheckFailed };
    if args.json {
        print_json(&done.judged.document)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, status);
    }
    Ok(status)
}
