//! `kfdesign airplane`.

use super::Status;
use super::files;
use super::output::{print_json, print_report};
use super::plot::Plot;
use crate::ops::airplane::{Request, run as airplane};
use crate::view;

/// What `--plot` shows.
const FIGURES: &str = "Figures of angle of attack and elevator, drag and thrust, power over the speeds of level flight";

/// What an airplane document says, and whether it makes sense
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign airplane data/airplanes/aerosonde.json --altitude \"100 m\" --plot speeds.svg"
)]
#[command(mut_arg("plot", |plot| plot.help(FIGURES)))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    #[command(flatten)]
    plot: Plot,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [args.plot.output()];
    files::check(&outputs, &[&args.request.airplane])?;
    let check = airplane(&args.request)?;
    let mut report = view::airplane::airplane(&check);
    args.plot.write(&format!("Level flight of {}", check.name), &report)?;
    if args.json {
        print_json(&check)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
