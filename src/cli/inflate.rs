//! `kfdesign inflate`.

use std::path::PathBuf;

use anyhow::{Context, bail};

use super::Status;
use super::compare::read;
use super::files::Kind;
use super::output::{print_json, print_report};
use crate::compare::inflation::{inflated, inflation, usual_from_hz};
use crate::export::atomic;
use crate::ops::reading::Reading;
use crate::view;

/// How many times louder than on the bench: the factor that vibration puts on white noise
///
/// The noise of a flight log above a frequency that motion does not reach, over what the parameters say there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign inflate params.json flight.csv --from 20 -o inflated.json")]
pub struct Args {
    /// The noise parameters from the bench
    params: PathBuf,
    /// A log with vibration, moving or not, of any format that `kfdesign info` reads
    log: PathBuf,
    /// Lowest frequency used, in Hz, above all motion [default: a tenth of half the sample rate]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    from: Option<f64>,
    /// The parameters with their white noise multiplied by the factor
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    if let Some(from) = args.from.filter(|f| !(f.is_finite() && *f > 0.0)) {
        bail!("--from is {from}, expected a frequency above 0 Hz");
    }
    let pair = read(&args.params, &args.log, &args.reading, &[("-o", &args.output, Kind::Json)])?;
    let name = args.log.display().to_string();
    let from = args.from.unwrap_or_else(|| usual_from_hz(pair.log.sample_rate_hz));
    let mut found = inflation(&pair.params, &pair.log, from).with_context(|| name.clone())?;
    // of a log in pieces the notes of the result tell
    let whole = found.axes.iter().filter(|axis| axis.segments == 1).map(|axis| &*axis.log_axis);
    pair.print_left_out(&whole.collect::<Vec<_>>());
    found.params = Some(args.params.display().to_string());
    found.log = Some(name);
    found.log_sha256.clone_from(&pair.sha256);
    if let Some(path) = &args.output {
        atomic::write(path, inflated(&pair.params, &found).to_json().as_bytes())?;
    }
    if args.json {
        print_json(&found)?;
    } else {
        print_report(&view::inflate::inflate(&found, &pair.unit));
    }
    Ok(Status::Done)
}
