//! A noise model against a log.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::checked;
use super::reading::{Reading, note_check};
use super::stretch::stretches;
use crate::compare::parameters::parameters;
use crate::compare::{self, Comparison, Log, LogAxis};
use crate::import::{self, ImportError};
use crate::numerics::progress::{note, warning};
use crate::params::{AxisParams, Params};
use crate::replay::axes::partners;
use crate::signal::LogCheck;
use crate::units::{Quantity, Unit};

/// A noise model and a log.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The noise parameters: params.json, or a file that `kfdesign import` reads
    pub params: PathBuf,
    /// The log, sensor at rest, of any format that `kfdesign info` reads
    pub log: PathBuf,
    /// Probability of a false alarm, over all tests together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_negative_numbers = true)]
    #[serde(default = "alpha")]
    pub alpha: f64,
    /// Identify the log too, and put every number of the file beside the log's own: its interval, the ratio, and
    /// whether it lies inside
    #[arg(long)]
    #[serde(default)]
    pub parameters: bool,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

fn alpha() -> f64 {
    0.01
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
    /// Of the axes that are named.
    pub(super) fn note_left_out(&self, axes: &[&str]) {
        for (axis, left_out) in self.log.axes.iter().zip(&self.left_out).filter(|(axis, _)| axes.contains(&&*axis.name))
        {
            left_out.iter().for_each(|line| note(&format!("  note: {}: {line}", axis.name)));
        }
    }
}

/// Reads both, with the log check as notes.
pub(super) fn read(params: &Path, log: &Path, reading: &Reading) -> anyhow::Result<Pair> {
    checked::not_swapped(params, log, "PARAMS LOG")?;
    let given = given(params)?;
    let options = reading.options()?;
    let known = given.iter().find_map(|params| params.source.as_ref()?.reading.as_ref());
    let (recording, check) = reading.read(known, |options| crate::input::read(log, &options))?;
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

/// Axes that are alike but cannot be told apart in the log (a file has one number for three of them): one stands for
/// every axis of the log.
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
            anyhow!("{path}: {why}: first kfdesign import {path} `rate` HZ -o params.json, then compare params.json")
        }
        _ => anyhow!(error),
    })?;
    found.warnings.iter().for_each(|line| warning(line));
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

/// The comparison, and the unit of the log's rate. Notes say what of the log is used.
pub fn run(request: &Request) -> anyhow::Result<(Comparison, Unit)> {
    compare::check_alpha(request.alpha)?;
    let pair = read(&request.params, &request.log, &request.reading)?;
    pair.note_left_out(&pair.log.axes.iter().map(|axis| &*axis.name).collect::<Vec<_>>());
    let name = || request.log.display().to_string();
    let mut result = compare::compare(&pair.params, &pair.log, request.alpha).with_context(name)?;
    result.params = Some(request.params.display().to_string());
    result.log = Some(name());
    result.log_sha256 = pair.sha256;
    if request.parameters {
        result.parameters = parameters(&pair.params, &pair.log, &pair.unit).with_context(name)?;
    }
    for axis in result.axes.iter_mut().filter(|axis| pair.check.moves(&axis.log_axis)) {
        axis.notes.push(
            "the log is not at rest all the time (see the log check): motion counts as noise here; cut it with \
             `start`/`end`"
                .into(),
        );
    }
    Ok((result, pair.unit))
}
