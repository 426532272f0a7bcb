//! `kfdesign airplane`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::aircraft::airframe::Airplane;
use crate::ops::amounts::with_unit;
use crate::units::Dimension;
use crate::view;

/// What an airplane document says, and whether it makes sense
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign airplane data/airplanes/aerosonde.json --altitude \"100 m\" --plot speeds.svg"
)]
pub struct Args {
    /// airplane.json
    airplane: PathBuf,
    /// Where speeds are looked at
    #[arg(long, value_name = "LENGTH", default_value = "0 m", allow_hyphen_values = true)]
    altitude: String,
    /// Figures of angle of attack and elevator, drag and thrust, power over the speeds of level flight
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("--plot", &args.plot, Kind::Svg)], &[&args.airplane])?;
    let altitude = with_unit("--altitude", &args.altitude, Dimension::new(0, 2, 0), "100 m")?;
    let check = Airplane::read(&args.airplane)?.check(altitude)?;
    let report = view::airplane::airplane(&check);
    files::write_plot(args.plot.as_deref(), &format!("Level flight of {}", check.name), &report)?;
    if args.json {
        print_json(&check)?;
    } else {
        print_report(&report);
    }
    Ok(Status::Done)
}
