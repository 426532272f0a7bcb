//! `kfdesign simulate`.

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::simulate::{Request, run as simulate};
use crate::view;

/// A sensor stream with truth columns from params.json
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign simulate data/params.json -o log.npy --duration 2h --seed 1\n\
    Columns: time (s); gyro_NAME or accel_NAME per axis; truth_NAME_rate, truth_NAME_bias (constant), \
    truth_NAME_drift. With a plant: AID_NAME \
    for every aid (empty where it measures nothing), accelerometer_NAME, truth_NAME_angle (or tilt).")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &Some(args.request.output.clone()), Kind::Table)], &args.request.inputs())?;
    let summary = simulate(&args.request)?;
    if args.json {
        print_json(&summary)?;
    } else {
        print_report(&view::simulate::simulate(&summary), Status::Done);
    }
    Ok(Status::Done)
}
