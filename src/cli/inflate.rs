//! `kfdesign inflate`.

use std::path::PathBuf;

use anyhow::{Context, bail};

use super::Status;
use super::compare::read;
use super::files::Kind;
use super::log_flags::LogFlags;
use super::output::{digits, notes, print_json, print_text, table};
use crate::compare::inflation::{AxisInflation, Inflation, inflated, inflation, usual_from_hz};
use crate::export::atomic;
use crate::units::Unit;

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
    reading: LogFlags,
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
        print_text(&text(&found, &pair.unit));
    }
    Ok(Status::Done)
}

/// Everything a person wants to see.
fn text(found: &Inflation, unit: &Unit) -> String {
    let density = unit.times_time(1);
    let row = |a: &AxisInflation| {
        let [low, high] = a.interval;
        let [robust_low, robust_high] = a.robust_interval;
        let numbers = [a.factor, low, high, a.robust_factor, robust_low, robust_high].map(digits);
        let densities = [a.density, a.density * a.factor].map(|n| digits(density.from_si(n)));
        [vec![a.name.clone(), a.log_axis.clone(), a.samples.to_string()], numbers.into(), densities.into()].concat()
    };
    let header = [
        "axis",
        "log column",
        "samples",
        "factor",
        "95 % from",
        "to",
        "by median",
        "95 % from",
        "to",
        "bench N",
        "here",
    ];
    let mut out = format!(
        "Noise above {} Hz over that of the parameters, as a factor on the density (N in {density}):\n{}",
        digits(found.from_hz),
        table(&header, &found.axes.iter().map(row).collect::<Vec<_>>())
    );
    let lines: Vec<Vec<String>> = found
        .axes
        .iter()
        .flat_map(|a| a.lines.iter().map(move |l| (a, l)))
        .map(|(a, l)| vec![a.name.clone(), digits(l.frequency_hz), digits(l.width_hz), digits(unit.from_si(l.std_dev))])
        .collect();
    if !lines.is_empty() {
        let sigma = format!("sigma ({unit})");
        out += &format!("\nLines:\n{}", table(&["axis", "frequency (Hz)", "width (Hz)", &sigma], &lines));
    }
    out += &notes(found.axes.iter().map(|a| (a.name.as_str(), a.notes.as_slice())));
    format!("{out}\nValid for {}.\n", found.valid_for)
}
