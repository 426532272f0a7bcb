//! `kfdesign fly`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::ops::fly::{Request, run as fly};
use crate::view;

/// An airplane over time: truth and what its sensors show
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign fly data/flights/aerosonde.json -o flight.csv --duration 60s\n\
    Columns: time; truth north, east, down (or latitude, longitude, height), u, v, w, phi, theta, psi, p, q, r \
    (relative to the earth); elevator, aileron, \
    rudder, throttle; gusts; what the sensors measure (gyro_x … is relative to inertial space); truth of gyro and \
    accelerometer; surface rates.")]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// Figures of the first run: attitude, rates, surfaces with their stops, gusts, way over the ground, height
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let request = &args.request;
    let outputs = [("-o", &request.output, Kind::Table), ("--plot", &args.plot, Kind::Svg)];
    files::check(&outputs, &[&request.flight])?;
    let done = fly(request, args.plot.is_some())?;
    let mut report = view::fly::fly(&done.report, &done.header, done.lines.as_ref(), &done.stops);
    files::write_plot(args.plot.as_deref(), &format!("Flight of {}", done.report.airplane), &report)?;
    if args.json {
        print_json(&done.report)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
