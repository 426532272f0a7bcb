//! `kfdesign fly`.

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use crate::ops::fly::{Request, run as fly};
use crate::view;

/// What `--plot` shows.
const FIGURES: &str = "Figures of the first run: attitude, rates, surfaces with their stops, gusts, way over the \
    ground, height";

/// An airplane over time: truth and what its sensors show
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign fly data/flights/aerosonde.json -o flight.csv --duration 60s\n\
    Columns: time; truth north, east, down (or latitude, longitude, height), u, v, w, phi, theta, psi, p, q, r \
    (relative to the earth); elevator, aileron, \
    rudder, throttle; gusts; what the sensors measure (gyro_x … is relative to inertial space); truth of gyro and \
    accelerometer; surface rates.")]
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
    let request = &args.request;
    let outputs = [("-o", &request.output, Kind::Table), args.plot.output()];
    files::check(&outputs, &[&request.flight])?;
    let done = fly(request, args.plot.wanted())?;
    let mut report = view::fly::fly(&done.report, &done.header, done.lines.as_ref(), &done.stops);
    args.plot.write(&format!("Flight of {}", done.report.airplane), &report)?;
    if args.json {
        print_json(&done.report)?;
    } else {
        report.written = files::written(&outputs);
        print_report(&report, Status::Done);
    }
    Ok(Status::Done)
}
