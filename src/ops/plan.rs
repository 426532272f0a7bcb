//! How long to record.

use std::path::PathBuf;

use anyhow::{Context, bail};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::checked;
use crate::identify::log_plan::{LogPlan, log_plan};
use crate::identify::plan::Planned;
use crate::numerics::progress::note;
use crate::params::{AxisParams, Params, place};
use crate::view;

/// What to plan for.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Noise parameters: guesses of the right size, from a short log or a datasheet
    pub params: PathBuf,
    #[allow(rustdoc::broken_intra_doc_links, reason = "it is the help of a flag, too")]
    /// As in the document: white.density, gauss_markov[1].std_dev, …; also gauss_markov.driving_noise (sigma
    /// sqrt(2/Tc))
    #[arg(long, value_name = "NAME")]
    pub parameter: String,
    /// Relative standard deviation, 1 sigma: 10% or 0.1
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    pub precision: String,
    /// One axis [default: every axis that has the parameter]
    #[arg(long, value_name = "NAME")]
    #[serde(default)]
    pub axis: Option<String>,
    /// Sample rate of the sensor in Hz [default: sample_rate of the parameters]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    #[serde(default)]
    pub rate: Option<f64>,
}

/// Notes say what another rate makes of terms that count samples.
pub fn run(request: &Request) -> anyhow::Result<LogPlan> {
    let params = checked::params(&request.params)?;
    let precision = share(&request.precision)?;
    let rate_hz = request.rate.unwrap_or(params.sample_rate_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        bail!("`rate` {rate_hz}: expected a positive number of Hz");
    }
    let chosen = chosen(request, &params)?;
    for axis in &chosen {
        axis.noise()
            .check_rate(1.0 / rate_hz)
            .with_context(|| format!("{}: axis {}", request.params.display(), axis.name))?;
    }
    for line in view::notes_of_rate(&params, &chosen, rate_hz) {
        note(&format!("note: {line}"));
    }
    Ok(log_plan(&chosen, &request.parameter, precision, rate_hz))
}

/// "10%" or "0.1".
fn share(text: &str) -> anyhow::Result<f64> {
    let (number, unit) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |number| (number.trim(), 0.01));
    match number.parse::<f64>().map(|value| value * unit) {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => bail!("`precision` {text}: expected a share above 0 and at most 1, such as 10% or 0.1"),
    }
}

/// The axes that are asked for and have the parameter.
fn chosen<'a>(request: &Request, params: &'a Params) -> anyhow::Result<Vec<&'a AxisParams>> {
    let file = request.params.display();
    let asked: Vec<&AxisParams> =
        params.axes.iter().filter(|axis| request.axis.as_ref().is_none_or(|name| axis.name == *name)).collect();
    if asked.is_empty() {
        let names: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
        let name = request.axis.as_deref().unwrap_or_default();
        bail!("`axis` {name}: {file} has no such axis; it has {}", names.join(", "));
    }
    let mut known: Vec<String> = Vec::new();
    let mut found = Vec::new();
    for axis in asked {
        let planned = Planned::new(&axis.noise());
        if planned.names().any(|name| name == request.parameter) {
            found.push(axis);
        }
        for name in planned.names().filter(|name| !known.iter().any(|k| k == name)).collect::<Vec<_>>() {
            known.push(name.to_string());
        }
    }
    if found.is_empty() {
        let meant = place::meant(&request.parameter, known.iter().map(String::as_str));
        let known = if known.is_empty() { "no noise parameter at all".to_string() } else { known.join(", ") };
        bail!("`parameter` {}: {file} has no such parameter; {meant}it has {known}", request.parameter);
    }
    Ok(found)
}
