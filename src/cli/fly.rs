//! `kfdesign fly`.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::bail;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use crate::aircraft::flight::{FlightDocument, FlightError, Plan, RowSink, Times, fly};
use crate::export::table::TableWriter;
use crate::ops::amounts::{whole, with_unit};
use crate::report::figure::Envelope;
use crate::units::Dimension;
use crate::view;

/// An airplane over time: truth and what its sensors show
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign fly data/flights/aerosonde.json -o flight.csv --duration 60s\n\
    Columns: time; truth north, east, down (or latitude, longitude, height), u, v, w, phi, theta, psi, p, q, r (relative to the earth); elevator, aileron, \
    rudder, throttle; gusts; what the sensors measure (gyro_x … is relative to inertial space); truth of gyro and accelerometer; surface rates.")]
pub struct Args {
    /// flight.json
    flight: PathBuf,
    /// Log to write: .csv, .csv.gz or .npy; with --runs one for each, flight-0.csv, flight-1.csv …
    #[arg(short, long, value_name = "LOG")]
    output: Option<PathBuf>,
    /// Length; the last row is there: 60s, "10 s", 5min
    #[arg(long, value_name = "TIME", default_value = "60s", allow_hyphen_values = true)]
    duration: String,
    /// Time between two rows [default: that between two samples of the sensors]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    every: Option<String>,
    /// Longest step of the integration [default: 2.5 ms]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    step: Option<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    seed: u64,
    /// Number of runs; each has its own gusts and noise
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    runs: u64,
    /// Figures of the first run: attitude, rates, surfaces with their stops, gusts, way over the ground, height
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

/// The log of one run, or nowhere, and the lines of figures.
struct Log<'a> {
    path: Option<PathBuf>,
    writer: Option<TableWriter>,
    lines: Option<&'a Mutex<Envelope>>,
}

impl RowSink<anyhow::Error> for Log<'_> {
    fn write(&mut self, columns: &[Vec<f64>]) -> anyhow::Result<()> {
        if let Some(writer) = &mut self.writer {
            writer.write(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
        }
        // one run has figures: nobody else holds the lock
        if let Some(Ok(mut lines)) = self.lines.map(Mutex::lock) {
            for row in 0..columns.first().map_or(0, Vec::len) {
                let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
                lines.add(values[0], &values);
            }
        }
        Ok(())
    }
    fn finish(self) -> anyhow::Result<Option<String>> {
        if let Some(writer) = self.writer {
            writer.finish()?;
        }
        Ok(self.path.map(|path| path.display().to_string()))
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    if args.runs == 0 {
        bail!("--runs 0: expected at least one run");
    }
    files::check(&[("-o", &args.output, Kind::Table), ("--plot", &args.plot, Kind::Svg)], &[&args.flight])?;
    let time = |flag: &str, text: &str| with_unit(flag, text, Dimension::TIME, "10s");
    let times = Times {
        duration: time("--duration", &args.duration)?,
        every: args.every.as_deref().map(|text| time("--every", text)).transpose()?,
        step: args.step.as_deref().map(|text| time("--step", text)).transpose()?,
    };
    let document = FlightDocument::read(&args.flight)?;
    let folder = args.flight.parent().unwrap_or(Path::new("."));
    let plan = Plan::new(&document, folder, &times).map_err(|e| anyhow::anyhow!("{}: {e}", args.flight.display()))?;
    let header = plan.columns();
    let lines = Mutex::new(Envelope::default());
    let open = |run: u64| -> anyhow::Result<Log<'_>> {
        let path = args.output.as_ref().map(|output| of_run(output, run, args.runs));
        let writer = path.as_ref().map(|path| TableWriter::create(path, &header)).transpose()?;
        Ok(Log { path, writer, lines: (run == 0 && args.plot.is_some()).then_some(&lines) })
    };
    let flown = fly(&plan, args.seed, args.runs, open).map_err(|e| match e.downcast::<FlightError>() {
        Ok(e) => anyhow::anyhow!("{}: {e}", args.flight.display()),
        Err(e) => e,
    })?;
    let lines = lines.into_inner().ok().filter(|_| args.plot.is_some());
    let report = view::fly::fly(&flown, &header, lines.as_ref(), &plan.stops());
    files::write_plot(args.plot.as_deref(), &format!("Flight of {}", flown.airplane), &report)?;
    if args.json {
        print_json(&flown)?;
    } else {
        print_report(&report);
    }
    Ok(Status::Done)
}

/// `flight.csv` of one run, `flight-3.csv` of several: the number stands before the first dot of the name.
fn of_run(output: &Path, run: u64, runs: u64) -> PathBuf {
    if runs == 1 {
        return output.to_path_buf();
    }
    let name = output.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let (stem, extension) = name.split_once('.').unwrap_or((&name, ""));
    output.with_file_name(format!("{stem}-{run}.{extension}"))
}
