//! `kfdesign airplane`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::airplane::{Request, run as airplane};
use crate::view;

/// What an airplane document says, and whether it makes sense
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign airplane data/airplanes/aerosonde.json --altitude \"100 m\" --plot speeds.svg"
)]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// Figures of angle of attack and elevator, drag and thrust, power over the speeds of level flight
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("--plot", &args.plot, Kind::Svg)];
    files::check(&outputs, &[&args.request.airplane])?;
    let check = airplane(&args.request)?;
    let mut report = view::airplane::airplane(&check);
    files::write_plot(args.plot.as_deref(), &format!("Level flight of {}", check.name), &report)?;
    if args.json {
        print_json(&check)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
