//! `kfdesign import`.

use std::path::PathBuf;

use anyhow::bail;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::export::atomic;
use crate::import::Imported;
use crate::numerics::progress::warning;
use crate::ops::import::{Request, run as import};
use crate::params::Params;
use crate::units::Quantity;
use crate::view;

/// Noise parameters from the files of other programs
///
/// Kalibr, OpenVINS, ORB-SLAM3, imu_utils (both kinds) and gnss-ins-sim, known by their content. What each number is
/// and how it became a parameter is said. `compare FILE LOG --parameters` puts them beside what a log says.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign import imu.yaml -o gyro.json --accelerometer accelerometer.json")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The parameters of its gyro; where it has none, of its accelerometer
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// The parameters of its accelerometer
    #[arg(long, value_name = "FILE.json")]
    accelerometer: Option<PathBuf>,
    /// The parameters on stdout, one document (that of -o)
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), ("--accelerometer", &args.accelerometer, Kind::Json)];
    files::check(&outputs, &[&args.request.file])?;
    let found = import(&args.request)?;
    let of_force = found.sensor(Quantity::SpecificForce);
    if args.accelerometer.is_some() && of_force.is_none() {
        bail!("--accelerometer: {} has no accelerometer", args.request.file.display());
    }
    finish(&found, &[(&args.output, found.sensors.first()), (&args.accelerometer, of_force)], args.json)
}

/// Writes and prints; `files`: what is written where.
pub(super) fn finish(
    found: &Imported,
    files: &[(&Option<PathBuf>, Option<&Params>)],
    json: bool,
) -> anyhow::Result<Status> {
    found.warnings.iter().for_each(|line| warning(line));
    let mut report = view::import::import(found);
    for (path, params) in files {
        if let (Some(path), Some(params)) = (path, params) {
            atomic::write(path, params.to_json().as_bytes())?;
            report.written.push(format!("{} written: {}", path.display(), params.quantity.name()));
        }
    }
    if json {
        print_json(&found.sensors.first())?;
    } else {
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
