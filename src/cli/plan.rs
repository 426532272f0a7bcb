//! `kfdesign plan`.

use std::path::PathBuf;

use anyhow::{Context, bail};

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report, say};
use crate::cli::checked;
use crate::identify::log_plan::log_plan;
use crate::identify::plan::Planned;
use crate::params::{AxisParams, Params};
use crate::view;

/// How long to record, and at which rate, to know a parameter to a wished precision
///
/// The precision is the relative standard deviation (1 sigma) of a maximum likelihood estimate with the model of params.json; its Cramér-Rao
/// bound at these parameters is what is planned with. Exit status 1 when no log of up to ten years is enough.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign plan data/params.json --parameter gauss_markov.correlation_time --precision 10%"
)]
pub struct Args {
    /// Noise parameters: guesses of the right size, from a short log or a datasheet
    params: PathBuf,
    /// As in the document: white.density, gauss_markov[1].std_dev, …; also gauss_markov.driving_noise (sigma sqrt(2/Tc))
    #[arg(long, value_name = "NAME")]
    parameter: String,
    /// Relative standard deviation, 1 sigma: 10% or 0.1
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    precision: String,
    /// One axis [default: every axis that has the parameter]
    #[arg(long, value_name = "NAME")]
    axis: Option<String>,
    /// Sample rate of the sensor in Hz [default: sample_rate of the parameters]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// The plan as a JSON document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &args.output, Kind::Json)], &[&args.params])?;
    let params = checked::params(&args.params)?;
    let precision = share(&args.precision)?;
    let rate_hz = args.rate.unwrap_or(params.sample_rate_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        bail!("--rate {rate_hz}: expected a positive number of Hz");
    }
    let chosen = chosen(args, &params)?;
    for axis in &chosen {
        axis.noise()
            .check_rate(1.0 / rate_hz)
            .with_context(|| format!("{}: axis {}", args.params.display(), axis.name))?;
    }
    let notes = view::notes_of_rate(&params, &chosen, rate_hz);
    notes.iter().for_each(|note| say(&format!("note: {note}")));
    let plan = log_plan(&chosen, &args.parameter, precision, rate_hz);
    files::write_json(args.output.as_deref(), &plan)?;
    if args.json {
        print_json(&plan)?;
    } else {
        print_report(&view::plan::plan(&plan));
    }
    Ok(if plan.axes.iter().all(|axis| axis.duration_s.is_some()) { Status::Done } else { Status::CheckFailed })
}

/// "10%" or "0.1".
fn share(text: &str) -> anyhow::Result<f64> {
    let (number, unit) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |number| (number.trim(), 0.01));
    match number.parse::<f64>().map(|value| value * unit) {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => bail!("--precision {text}: expected a share above 0 and at most 1, such as 10% or 0.1"),
    }
}

/// The axes that are asked for and have the parameter.
fn chosen<'a>(args: &Args, params: &'a Params) -> anyhow::Result<Vec<&'a AxisParams>> {
    let file = args.params.display();
    let asked: Vec<&AxisParams> =
        params.axes.iter().filter(|axis| args.axis.as_ref().is_none_or(|name| axis.name == *name)).collect();
    if asked.is_empty() {
        let names: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
        let name = args.axis.as_deref().unwrap_or_default();
        bail!("--axis {name}: {file} has no such axis; it has {}", names.join(", "));
    }
    let mut known: Vec<String> = Vec::new();
    let mut found = Vec::new();
    for axis in asked {
        let planned = Planned::new(&axis.noise());
        if planned.names().any(|name| name == args.parameter) {
            found.push(axis);
        }
        for name in planned.names().filter(|name| !known.iter().any(|k| k == name)).collect::<Vec<_>>() {
            known.push(name.to_string());
        }
    }
    if found.is_empty() {
        let known = if known.is_empty() { "no noise parameter at all".to_string() } else { known.join(", ") };
        bail!("--parameter {}: {file} has no such parameter; it has {known}", args.parameter);
    }
    Ok(found)
}
