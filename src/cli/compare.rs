//! `kfdesign compare`.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::files::{self, Kind, Output};
use super::output::{print_json, print_report, say};
use super::{Status, VerdictFlags};
use crate::compare::parameters::parameters;
use crate::compare::{self, Log, LogAxis};
use crate::import::{self, ImportError};
use crate::ops::checked;
use crate::ops::reading::{Reading, note_check};
use crate::ops::stretch::stretches;
use crate::params::{AxisParams, Params};
use crate::replay::axes::partners;
use crate::signal::LogCheck;
use crate::units::{Quantity, Unit};
use crate::view;

/// Does a noise model fit a log that it may not come from?
///
/// The Allan curve within the envelope the model draws around its own, the spectrum over the model's, and what the model's filter leaves of the
/// log. A test fails when its deviation is significant (Holm, over all tests and axes) and beyond what is tolerated. Exit status 1 when
/// the verdict is inconsistent, or inconclusive without --allow-inconclusive.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples: kfdesign compare params.json other_day.csv --report compare.html; kfdesign compare imu.yaml log.bag --parameters"
)]
pub struct Args {
    /// The noise parameters: params.json, or a file that `kfdesign import` reads
    params: PathBuf,
    /// The log, sensor at rest, of any format that `kfdesign info` reads
    log: PathBuf,
    /// Probability of a false alarm, over all tests together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_negative_numbers = true)]
    alpha: f64,
    /// Identify the log too, and put every number of the file beside the log's own: its interval, the ratio, and whether it lies inside
    #[arg(long)]
    parameters: bool,
    /// The verdict document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Allan curve and spectral ratio of every axis
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    judging: VerdictFlags,
    #[command(flatten)]
    reading: Reading,
}

/// Parameters and a log at rest, as the commands that hold one against the other read them.
pub(super) struct Pair {
    pub(super) params: Params,
    pub(super) log: Log,
    /// Of every axis of the log, what curves and spectra leave out, if anything.
    left_out: Vec<Option<String>>,
    pub(super) check: LogCheck,
    pub(super) sha256: Option<String>,
    /// Unit of the log's rate.
    pub(super) unit: Unit,
}

impl Pair {
    /// On stderr, of the axes that are named.
    pub(super) fn print_left_out(&self, axes: &[&str]) {
        for (axis, note) in self.log.axes.iter().zip(&self.left_out).filter(|(axis, _)| axes.contains(&&*axis.name)) {
            note.iter().for_each(|note| say(&format!("  note: {}: {note}", axis.name)));
        }
    }
}

/// Reads both, prints the log check, and refuses to overwrite either with one of `outputs`, named with their flags.
pub(super) fn read(params: &Path, log: &Path, reading: &Reading, outputs: &[Output<'_>]) -> anyhow::Result<Pair> {
    files::check(outputs, &[params, log])?;
    let given = given(params)?;
    let options = reading.options()?;
    let (recording, check) = crate::input::read(log, &options)?;
    note_check(&recording.name, &check);
    let mut params = of_quantity(given, recording.quantity, params)?;
    let parts = stretches(&recording, options.kind);
    let unit =
        parts.first().map(|p| p.unit.clone()).with_context(|| format!("{}: no axis to work on", log.display()))?;
    let (axes, left_out): (Vec<LogAxis>, Vec<Option<String>>) = parts
        .into_iter()
        .map(|part| {
            let at_rest = !check.moves(&part.name);
            part.into_log_axis(at_rest)
        })
        .unzip();
    one_for_all(&mut params, &axes);
    let log = Log { quantity: recording.quantity, sample_rate_hz: recording.sample_rate_hz, axes };
    Ok(Pair { params, log, left_out, check, sha256: recording.sha256, unit })
}

/// Axes that are alike but cannot be told apart in the log (a file has one number for three of them): one stands for every axis of the log.
fn one_for_all(params: &mut Params, log: &[LogAxis]) {
    let wanted: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
    let found: Vec<&str> = log.iter().map(|axis| axis.name.as_str()).collect();
    let alike = params.axes.windows(2).all(|pair| pair[0].terms == pair[1].terms);
    if partners(&wanted, &found).is_none()
        && alike
        && let Some(first) = params.axes.first().cloned()
    {
        params.axes = found.iter().map(|name| AxisParams { name: (*name).to_owned(), ..first.clone() }).collect();
    }
}

/// Parameters of one sensor, or of the two that a file of another program may have.
fn given(path: &Path) -> anyhow::Result<Vec<Params>> {
    if !import::knows(path) {
        return Ok(vec![checked::params(path)?]);
    }
    let found = import::read(path, None).map_err(|error| match &error {
        ImportError::Rate { path, why } => {
            anyhow!("{path}: {why}: first kfdesign import {path} --rate HZ -o params.json, then compare params.json")
        }
        _ => anyhow!(error),
    })?;
    found.warnings.iter().for_each(|warning| say(&format!("  warning: {warning}")));
    Ok(found.sensors)
}

/// Those of the log's quantity, else the first, of which it is then said that they do not fit.
fn of_quantity(mut given: Vec<Params>, quantity: Quantity, path: &Path) -> anyhow::Result<Params> {
    let at = given.iter().position(|params| params.quantity == quantity).unwrap_or(0);
    if given.is_empty() {
        bail!("{}: no sensor is in it", path.display());
    }
    Ok(given.swap_remove(at))
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    compare::check_alpha(args.alpha)?;
    let outputs =
        [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), ("--plot", &args.plot, Kind::Svg)];
    let pair = read(&args.params, &args.log, &args.reading, &outputs)?;
    pair.print_left_out(&pair.log.axes.iter().map(|axis| &*axis.name).collect::<Vec<_>>());
    let mut result =
        compare::compare(&pair.params, &pair.log, args.alpha).with_context(|| args.log.display().to_string())?;
    result.params = Some(args.params.display().to_string());
    result.log = Some(args.log.display().to_string());
    result.log_sha256 = pair.sha256;
    if args.parameters {
        result.parameters =
            parameters(&pair.params, &pair.log, &pair.unit).with_context(|| args.log.display().to_string())?;
    }
    for axis in result.axes.iter_mut().filter(|axis| pair.check.moves(&axis.log_axis)) {
        axis.notes.push(
            "the log is not at rest all the time (see the log check): motion counts as noise here; cut it with --start/--end"
                .into(),
        );
    }
    files::write_json(args.output.as_deref(), &result)?;
    let report = view::compare::compare(&result, &pair.unit);
    files::write_plot(args.plot.as_deref(), "Model and log", &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    if args.json {
        print_json(&result)?;
    } else {
        print_report(&report);
    }
    Ok(args.judging.status([result.verdict]))
}
