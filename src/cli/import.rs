//! `kfdesign import`.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report, say};
use crate::export::atomic;
use crate::import::{self, Imported};
use crate::units::Quantity;
use crate::view;

/// Noise parameters from the files of other programs
///
/// Kalibr, OpenVINS, ORB-SLAM3, imu_utils (both kinds) and gnss-ins-sim, known by their content. What each number is
/// and how it became a parameter is said. `compare FILE LOG --parameters` puts them beside what a log says.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign import imu.yaml -o gyro.json --accelerometer accelerometer.json")]
pub struct Args {
    /// The file
    file: PathBuf,
    /// The parameters of its gyro; where it has none, of its accelerometer
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// The parameters of its accelerometer
    #[arg(long, value_name = "FILE.json")]
    accelerometer: Option<PathBuf>,
    /// Sample rate of the sensor in Hz; before that of the file
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// The parameters on stdout, one document (that of -o)
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    check_rate(args.rate)?;
    let outputs = [("-o", &args.output, Kind::Json), ("--accelerometer", &args.accelerometer, Kind::Json)];
    files::check(&outputs, &[&args.file])?;
    let found = import::read(&args.file, args.rate)?;
    finish(&found, &args.file.display().to_string(), args.output.as_deref(), args.accelerometer.as_deref(), args.json)
}

pub(super) fn check_rate(rate: Option<f64>) -> anyhow::Result<()> {
    match rate.filter(|v| !(*v > 0.0 && v.is_finite())) {
        Some(rate) => bail!("--rate {rate}: expected a number above zero"),
        None => Ok(()),
    }
}

/// Writes, prints, warns.
pub(super) fn finish(
    found: &Imported,
    name: &str,
    output: Option<&Path>,
    accelerometer: Option<&Path>,
    json: bool,
) -> anyhow::Result<Status> {
    let Some(first) = found.sensors.first() else { bail!("{name}: no sensor is in it") };
    let of_force = found.sensor(Quantity::SpecificForce);
    if accelerometer.is_some() && of_force.is_none() {
        bail!("--accelerometer: {name} has no accelerometer");
    }
    for warning in &found.warnings {
        say(&format!("  warning: {warning}"));
    }
    let mut report = view::import::import(found);
    for (path, params) in [(output, Some(first)), (accelerometer, of_force)] {
        if let (Some(path), Some(params)) = (path, params) {
            atomic::write(path, params.to_json().as_bytes())?;
            report.written.push(format!("{} written: {}", path.display(), params.quantity.name()));
        }
    }
    if json {
        print_json(first)?;
    } else {
        print_report(&report);
    }
    Ok(Status::Done)
}
