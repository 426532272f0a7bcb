//! How many times louder than on the bench.

use std::path::PathBuf;

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::compare::read;
use super::reading::Reading;
use crate::compare::inflation::{Inflation, inflated, inflation, usual_from_hz};
use crate::params::Params;
use crate::units::Unit;

/// Parameters from the bench and a log with vibration.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The noise parameters from the bench
    pub params: PathBuf,
    /// A log with vibration, moving or not, of any format that `kfdesign info` reads
    pub log: PathBuf,
    /// Lowest frequency used, in Hz, above all motion [default: a tenth of half the sample rate]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    #[serde(default)]
    pub from: Option<f64>,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

/// The factors.
pub struct Done {
    pub found: Inflation,
    /// The parameters with their white noise multiplied by them.
    pub params: Params,
    /// Of the log's rate.
    pub unit: Unit,
}

/// Notes say what of the log is used.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    if let Some(from) = request.from.filter(|f| !(f.is_finite() && *f > 0.0)) {
        bail!("`from` is {from}, expected a frequency above 0 Hz");
    }
    let pair = read(&request.params, &request.log, &request.reading)?;
    let name = request.log.display().to_string();
    let from = request.from.unwrap_or_else(|| usual_from_hz(pair.log.sample_rate_hz));
    let mut found = inflation(&pair.params, &pair.log, from).with_context(|| name.clone())?;
    // of a log in pieces the notes of the result tell
    let whole = found.axes.iter().filter(|axis| axis.segments == 1).map(|axis| &*axis.log_axis);
    pair.note_left_out(&whole.collect::<Vec<_>>());
    found.params = Some(request.params.display().to_string());
    found.log = Some(name);
    found.log_sha256.clone_from(&pair.sha256);
    Ok(Done { params: inflated(&pair.params, &found), found, unit: pair.unit })
}
