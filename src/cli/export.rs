//! `kfdesign export`.

mod code;

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::Status;
use super::files::{self, Kind};
use super::output::{print_report, print_text, say, with_flags};
use crate::export::atomic;
use crate::export::consumer::{Choice, Export, Target, Walk, write};
use crate::ops::amounts::with_unit;
use crate::ops::checked;
use crate::params::Params;
use crate::units::{Dimension, Quantity, digits};
use crate::view;

/// Noise parameters in the files and units of other programs; a filter as source code in C or Rust
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples: kfdesign export params.json --to kalibr --accelerometer accelerometer.json --inflate 10 -o imu.yaml\n          kfdesign export filter.json --to c --precision float -o drift.c"
)]
pub struct Args {
    /// Noise parameters of a gyro or an accelerometer; filter.json for c and rust
    #[arg(value_name = "FILE")]
    params: PathBuf,
    /// Whose file it is
    #[arg(long, value_enum, value_name = "TARGET")]
    to: TargetFlag,
    /// The file [default: stdout]. c: NAME.c, which gets NAME.h and NAME_test.c beside it; NAME begins the names of
    /// types and functions
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Noise parameters of the other sensor of the unit
    #[arg(long, value_name = "PARAMS")]
    accelerometer: Option<PathBuf>,
    /// Rate of the log that the program will read, or of its filter's steps, in Hz [default: that of the parameters;
    /// px4: 100, ardupilot: 83.3]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Multiply every white density and every drift; written beside the identified numbers
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    inflate: Option<f64>,
    /// Where the file has one number for three axes: worst, mean (root mean square) or the name of an axis [default:
    /// worst]. c, rust: the one axis to write [default: all]
    #[arg(long, value_name = "AXIS")]
    axis: Option<String>,
    /// Where the file knows no other drift than a random walk: least (what costs the program's filter least), short
    /// (the growth over short times) or horizon=60s (the growth over that time) [default: least]
    #[arg(long, value_name = "RULE")]
    walk: Option<String>,
    /// Write zeros where no drift is known
    #[arg(long)]
    allow_zero_walk: bool,
    #[command(flatten)]
    code: code::Flags,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum TargetFlag {
    Kalibr,
    Openvins,
    Vins,
    Orbslam3,
    Gtsam,
    Px4,
    Ardupilot,
    Matlab,
    GnssInsSim,
    Navego,
    Gazebo,
    /// A filter as a C99 header and source
    C,
    /// A filter as a no_std module of Rust
    Rust,
}

impl TargetFlag {
    /// `None`: the filter as code.
    fn target(self) -> Option<Target> {
        Some(match self {
            TargetFlag::C | TargetFlag::Rust => return None,
            TargetFlag::Kalibr => Target::Kalibr,
            TargetFlag::Openvins => Target::OpenVins,
            TargetFlag::Vins => Target::Vins,
            TargetFlag::Orbslam3 => Target::OrbSlam3,
            TargetFlag::Gtsam => Target::Gtsam,
            TargetFlag::Px4 => Target::Px4,
            TargetFlag::Ardupilot => Target::ArduPilot,
            TargetFlag::Matlab => Target::Matlab,
            TargetFlag::GnssInsSim => Target::GnssInsSim,
            TargetFlag::Navego => Target::NaveGo,
            TargetFlag::Gazebo => Target::Gazebo,
        })
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let Some(target) = args.to.target() else { return code::run(args) };
    args.code.refuse()?;
    for (name, value) in [("--rate", args.rate), ("--inflate", args.inflate)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            bail!("{name} {value}: expected a number above zero");
        }
    }
    let inputs: Vec<&Path> = std::iter::once(args.params.as_path()).chain(args.accelerometer.as_deref()).collect();
    files::check(&[("-o", &args.output, Kind::Other)], &inputs)?;
    let walk = walk(args.walk.as_deref().unwrap_or("least"))?;
    let mut export = Export {
        target,
        gyro: None,
        accelerometer: None,
        rate_hz: args.rate,
        sample_rate_hz: 0.0,
        inflation: args.inflate.unwrap_or(1.0),
        measured_inflation: Vec::new(),
        failed: Vec::new(),
        from_log: true,
        choice: match args.axis.as_deref().unwrap_or("worst") {
            "worst" => Choice::Worst,
            "mean" => Choice::Mean,
            name => Choice::Axis(name.to_owned()),
        },
        walk,
        allow_zero_walk: args.allow_zero_walk,
        origin: vec![format!("kfdesign {} export", env!("CARGO_PKG_VERSION"))],
    };
    for (path, given) in [(Some(&args.params), ""), (args.accelerometer.as_ref(), "--accelerometer ")] {
        let Some(path) = path else { continue };
        let params = checked::params(path)?;
        if !given.is_empty() && params.quantity != Quantity::SpecificForce {
            bail!(
                "{given}{}: the parameters are of an {}, expected a specific force",
                path.display(),
                params.quantity.name()
            );
        }
        add(&mut export, path, &params)?;
    }
    let written = write(&export).map_err(|message| anyhow!(message))?;
    for warning in &written.warnings {
        say(&format!("  warning: {warning}"));
    }
    let text = with_flags(&written.text);
    match &args.output {
        Some(path) => {
            atomic::write(path, text.as_bytes())?;
            print_report(&view::export::export(&[path.display().to_string()], None));
        }
        None => print_text(&text),
    }
    Ok(Status::Done)
}

/// One sensor of the unit with what is said of its origin.
fn add(export: &mut Export, path: &Path, params: &Params) -> anyhow::Result<()> {
    let shown = path.display().to_string();
    export.failed.extend(params.failed_check());
    let source = params.source.clone().unwrap_or_default();
    export.from_log &= source.log.is_some();
    let log = source.log.map_or_else(String::new, |log| format!(", from {log}"));
    let hash = source.sha256.map_or_else(String::new, |hash| format!(" (sha256 {hash})"));
    let method = source.method.map_or_else(String::new, |method| format!(", {method}"));
    export.origin.push(format!("{shown}{log}{hash}{method}"));
    export.measured_inflation.extend(source.inflation.iter().map(|found| {
        let [low, high] = found.interval;
        format!(
            "inflation, measured: N of {} ({}) above is {} [{}, {}] times that of the bench",
            found.axis,
            params.quantity.name(),
            digits(found.factor),
            digits(low),
            digits(high)
        )
    }));
    export.add(params).map_err(|message| anyhow!(message)).with_context(|| shown)
}

fn walk(text: &str) -> anyhow::Result<Walk> {
    match text.split_once('=') {
        None if text == "least" => Ok(Walk::Least),
        None if text == "short" => Ok(Walk::Short),
        Some(("horizon", time)) => {
            let seconds = with_unit("--walk horizon", time, Dimension::TIME, "60s")?;
            if seconds > 0.0 {
                return Ok(Walk::Horizon(seconds));
            }
            bail!("--walk {text}: expected a time above zero")
        }
        _ => bail!("--walk {text}: expected least, short or horizon=TIME, for example horizon=60s"),
    }
}
