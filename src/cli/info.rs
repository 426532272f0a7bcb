//! `kfdesign info`.

use super::Status;
use super::output::{print_json, print_report};
use crate::ops::info::{Request, run as info};
use crate::view;

/// What is in a log: its topics, columns, units, rates and spans
///
/// Nothing is chosen and nothing judged; the commands that take a log do that, and choose a topic with --topic.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign info flight.ulg")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// Every topic with all its columns, not only those with a gyro or an accelerometer
    #[arg(long)]
    all: bool,
    /// One JSON document on stdout, with everything
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let found = info(&args.request)?;
    if args.json {
        print_json(&found)?;
    } else {
        print_report(&view::info::info(&args.request.log.display().to_string(), &found, args.all), Status::Done);
    }
    Ok(Status::Done)
}
