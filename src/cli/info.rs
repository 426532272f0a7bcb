//! `kfdesign info`.

use super::Status;
use super::files;
use super::output::{print_json, print_report};
use super::plot::Plot;
use crate::ops::info::{Request, course, run as info};
use crate::ops::reading::Reading;
use crate::view;

/// What `--plot` shows.
const FIGURES: &str = "Every axis over time, with its moving average and what the log check found";

/// What is in a log: its topics, columns, units, rates and spans
///
/// Nothing is chosen and nothing judged; the commands that take a log do that, and choose a topic with --topic. So does
/// --plot, for which alone the options of reading count.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign info flight.ulg")]
#[command(mut_arg("plot", |plot| plot.help(FIGURES)))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// Every topic with all its columns, not only those with a gyro or an accelerometer
    #[arg(long)]
    all: bool,
    /// One JSON document on stdout, with everything
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [args.plot.output()];
    files::check(&outputs, &[&args.request.log])?;
    let found = info(&args.request)?;
    let name = args.request.log.display().to_string();
    let mut report = view::info::info(&name, &found, args.all);
    if args.plot.wanted() {
        let course = course(&args.request, &args.reading)?;
        args.plot.write(&format!("{name} over time"), &view::info::course(&course))?;
        report.written = files::written(&outputs);
    }
    if args.json {
        print_json(&found)?;
    } else {
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
