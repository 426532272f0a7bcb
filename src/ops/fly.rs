//! An airplane over time.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::{anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::{whole, with_unit};
use super::closed_loop;
use crate::aircraft::flight::{FlightError, FlightReport, Plan, RowSink, Times, fly};
use crate::export::table::TableWriter;
use crate::report::figure::Envelope;
use crate::units::Dimension;

/// A flight, how long, how often.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// flight.json
    pub flight: PathBuf,
    /// Log to write: .csv, .csv.gz or .npy; with --runs one for each, flight-0.csv, flight-1.csv …
    #[arg(short, long, value_name = "LOG")]
    #[serde(default)]
    pub output: Option<PathBuf>,
    /// Length; the last row is there: 60s, "10 s", 5min
    #[arg(long, value_name = "TIME", default_value = "60s", allow_hyphen_values = true)]
    #[serde(default = "duration")]
    pub duration: String,
    /// Time between two rows [default: that between two samples of the sensors]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    #[serde(default)]
    pub every: Option<String>,
    /// Longest step of the integration [default: 2.5 ms]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    #[serde(default)]
    pub step: Option<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "one")]
    pub seed: u64,
    /// Number of runs; each has its own gusts and noise
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "one")]
    pub runs: u64,
}

fn duration() -> String {
    "60s".into()
}

fn one() -> u64 {
    1
}

/// The flights.
pub struct Done {
    pub report: FlightReport,
    /// Columns of the log.
    pub header: Vec<String>,
    /// Of the first run, if they were wished.
    pub lines: Option<Envelope>,
    /// Angles where surfaces end, rad.
    pub stops: Vec<f64>,
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

/// Logs are written as they come; `figures`: lines for figures are kept.
pub fn run(request: &Request, figures: bool) -> anyhow::Result<Done> {
    if request.runs == 0 {
        bail!("`runs` 0: expected at least one run");
    }
    let time = |option: &str, text: &str| with_unit(option, text, Dimension::TIME, "10s");
    let times = Times {
        duration: time("`duration`", &request.duration)?,
        every: request.every.as_deref().map(|text| time("`every`", text)).transpose()?,
        step: request.step.as_deref().map(|text| time("`step`", text)).transpose()?,
    };
    let document = closed_loop::flight(&request.flight)?;
    let folder = request.flight.parent().unwrap_or(Path::new("."));
    let failed = |error: FlightError| anyhow!("{}: {error}", request.flight.display());
    let plan = Plan::new(&document, folder, &times).map_err(failed)?;
    let header = plan.columns();
    let lines = Mutex::new(Envelope::default());
    let open = |run: u64| -> anyhow::Result<Log<'_>> {
        let path = request.output.as_ref().map(|output| of_run(output, run, request.runs));
        let writer = path.as_ref().map(|path| TableWriter::create(path, &header)).transpose()?;
        Ok(Log { path, writer, lines: (run == 0 && figures).then_some(&lines) })
    };
    let flown = fly(&plan, request.seed, request.runs, open);
    let report = flown.map_err(|error| error.downcast::<FlightError>().map_or_else(|other| other, failed))?;
    let lines = lines.into_inner().ok().filter(|_| figures);
    Ok(Done { report, lines, stops: plan.stops(), header })
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
