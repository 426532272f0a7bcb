//! Noise parameters of a file of another program.

use std::path::PathBuf;

use anyhow::bail;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::import::{self, Imported};

/// A file of another program.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The file
    pub file: PathBuf,
    /// Sample rate of the sensor in Hz; before that of the file
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    #[serde(default)]
    pub rate: Option<f64>,
}

/// At least one sensor.
pub fn run(request: &Request) -> anyhow::Result<Imported> {
    check_rate(request.rate)?;
    not_empty(import::read(&request.file, request.rate)?, &request.file.display().to_string())
}

pub(super) fn check_rate(rate: Option<f64>) -> anyhow::Result<()> {
    match rate.filter(|v| !(*v > 0.0 && v.is_finite())) {
        Some(rate) => bail!("`rate` {rate}: expected a number above zero"),
        None => Ok(()),
    }
}

/// `name`: of where the sensors come from.
pub(super) fn not_empty(found: Imported, name: &str) -> anyhow::Result<Imported> {
    if found.sensors.is_empty() {
        bail!("{name}: no sensor is in it");
    }
    Ok(found)
}
