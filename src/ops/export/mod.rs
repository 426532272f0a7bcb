//! Parameters for other programs, and filters as source code.

mod code;

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::code::{Flags, FormFlag, PrecisionFlag};
use super::amounts::with_unit;
use super::checked;
use crate::export::consumer::{Choice, Export, Target, Walk, write};
use crate::numerics::progress::warning;
use crate::params::Params;
use crate::units::{Dimension, Quantity, digits};

/// Parameters or a filter, and whose file it becomes.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Noise parameters of a gyro or an accelerometer; filter.json for c and rust
    #[arg(value_name = "FILE")]
    pub params: PathBuf,
    /// Whose file it is
    #[arg(long, value_enum, value_name = "TARGET")]
    pub to: Consumer,
    /// The file [default: stdout]. c: NAME.c, which gets NAME.h and NAME_test.c beside it; NAME begins the names of
    /// types and functions
    #[arg(short, long, value_name = "FILE")]
    #[serde(default)]
    pub output: Option<PathBuf>,
    /// Noise parameters of the other sensor of the unit
    #[arg(long, value_name = "PARAMS")]
    #[serde(default)]
    pub accelerometer: Option<PathBuf>,
    /// Rate of the log that the program will read, or of its filter's steps, in Hz [default: that of the parameters;
    /// px4: 100, ardupilot: 83.3]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    #[serde(default)]
    pub rate: Option<f64>,
    /// Multiply every white density and every drift; written beside the identified numbers
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    #[serde(default)]
    pub inflate: Option<f64>,
    /// Where the file has one number for three axes: worst, mean (root mean square) or the name of an axis [default:
    /// worst]. c, rust: the one axis to write [default: all]
    #[arg(long, value_name = "AXIS")]
    #[serde(default)]
    pub axis: Option<String>,
    /// Where the file knows no other drift than a random walk: least (what costs the program's filter least), short
    /// (the growth over short times) or horizon=60s (the growth over that time) [default: least]
    #[arg(long, value_name = "RULE")]
    #[serde(default)]
    pub walk: Option<String>,
    /// Write zeros where no drift is known
    #[arg(long)]
    #[serde(default)]
    pub allow_zero_walk: bool,
    #[command(flatten)]
    #[serde(default)]
    pub code: Flags,
}

impl Request {
    /// Files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        std::iter::once(self.params.as_path()).chain(self.accelerometer.as_deref()).collect()
    }
}

/// Whose file it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Consumer {
    Kalibr,
    Openvins,
    Vins,
    Orbslam3,
    Gtsam,
    #[value(alias = "ekf2")]
    Px4,
    #[value(alias = "ekf3")]
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

impl Consumer {
    /// Whether the file is source code.
    pub fn is_code(self) -> bool {
        self.target().is_none()
    }

    /// `None`: the filter as code.
    fn target(self) -> Option<Target> {
        Some(match self {
            Consumer::C | Consumer::Rust => return None,
            Consumer::Kalibr => Target::Kalibr,
            Consumer::Openvins => Target::OpenVins,
            Consumer::Vins => Target::Vins,
            Consumer::Orbslam3 => Target::OrbSlam3,
            Consumer::Gtsam => Target::Gtsam,
            Consumer::Px4 => Target::Px4,
            Consumer::Ardupilot => Target::ArduPilot,
            Consumer::Matlab => Target::Matlab,
            Consumer::GnssInsSim => Target::GnssInsSim,
            Consumer::Navego => Target::NaveGo,
            Consumer::Gazebo => Target::Gazebo,
        })
    }
}

/// A text and where it belongs; `None`: nowhere was said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    pub path: Option<PathBuf>,
    pub text: String,
}

/// What the other program reads. Nothing is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Done {
    pub files: Vec<File>,
    /// The command that compiles and runs the self-test of the code.
    pub self_test: Option<String>,
}

/// The files. Warnings are notes.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    let Some(target) = request.to.target() else { return code::run(request) };
    request.code.refuse()?;
    for (name, value) in [("`rate`", request.rate), ("`inflate`", request.inflate)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            bail!("{name} {value}: expected a number above zero");
        }
    }
    let walk = walk(request.walk.as_deref().unwrap_or("least"))?;
    let mut export = Export {
        target,
        gyro: None,
        accelerometer: None,
        rate_hz: request.rate,
        sample_rate_hz: 0.0,
        inflation: request.inflate.unwrap_or(1.0),
        measured_inflation: Vec::new(),
        failed: Vec::new(),
        from_log: true,
        choice: match request.axis.as_deref().unwrap_or("worst") {
            "worst" => Choice::Worst,
            "mean" => Choice::Mean,
            name => Choice::Axis(name.to_owned()),
        },
        walk,
        allow_zero_walk: request.allow_zero_walk,
        origin: vec![format!("kfdesign {} export", env!("CARGO_PKG_VERSION"))],
    };
    for (path, given) in [(Some(&request.params), ""), (request.accelerometer.as_ref(), "`accelerometer` ")] {
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
    written.warnings.iter().for_each(|line| warning(line));
    Ok(Done { files: vec![File { path: request.output.clone(), text: written.text }], self_test: None })
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
            let seconds = with_unit("`walk` horizon", time, Dimension::TIME, "60s")?;
            if seconds > 0.0 {
                return Ok(Walk::Horizon(seconds));
            }
            bail!("`walk` {text}: expected a time above zero")
        }
        _ => bail!("`walk` {text}: expected least, short or horizon=TIME, for example horizon=60s"),
    }
}
