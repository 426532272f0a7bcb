//! Noise parameters that other programs and datasheets hold, in params.json's terms (floor 2).
//!
//! One file per origin; [`read`] knows a file by its content. Numbers keep the unit in which they are written; what
//! is done with each is said in words. Sources: the programs' own code, named in each file.

pub mod datasheet;
mod gnss_ins_sim;
mod imu_utils;
mod kalibr;
mod yaml;

use std::path::Path;

use crate::params::{AxisParams, Measured, Params, Source, TermEntry};
use crate::units::{Quantity, Unit, plain_lines};

/// A file of parameters is no longer than this, bytes; a log may be.
const LONGEST: u64 = 1 << 20;

/// What a file or a datasheet says.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// "Kalibr imu.yaml".
    pub origin: &'static str,
    /// At most one for each quantity, the gyro first.
    pub sensors: Vec<Params>,
    /// What each number is and how it became a parameter, one sentence each.
    pub rules: Vec<String>,
    /// What a person must know before the numbers are used.
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    #[error("{path}: line {line}: {message}")]
    Line { path: String, line: usize, message: String },
    #[error("{path}: {message}")]
    File { path: String, message: String },
    #[error("{path}: {why}: give the sample rate, for example `rate` 200")]
    Rate { path: String, why: String },
}

/// What is wrong; the path is added by [`read`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Problem {
    Line {
        line: usize,
        message: String,
    },
    File {
        message: String,
    },
    /// The sample rate is needed and not there.
    Rate {
        why: String,
    },
}

impl Problem {
    fn at(line: usize, message: impl Into<String>) -> Problem {
        Problem::Line { line, message: message.into() }
    }
    fn whole(message: impl Into<String>) -> Problem {
        Problem::File { message: message.into() }
    }
    fn of(self, path: String) -> ImportError {
        match self {
            Problem::Line { line, message } => ImportError::Line { path, line, message },
            Problem::File { message } => ImportError::File { path, message },
            Problem::Rate { why } => ImportError::Rate { path, why },
        }
    }
}

/// Reads a file of Kalibr, OpenVINS, ORB-SLAM3, imu_utils or gnss-ins-sim.
///
/// `rate_hz`: sample rate of the sensor; it stands before what the file says. Errors: a file that is none of these,
/// numbers or keys that make no sense, a sample rate that is needed and not there.
pub fn read(path: &Path, rate_hz: Option<f64>) -> Result<Imported, ImportError> {
    let shown = path.display().to_string();
    let found = text(path).and_then(|text| parse(&text, rate_hz)).map_err(|problem| problem.of(shown.clone()))?;
    Ok(found.named(&path.file_name().map_or(shown, |name| name.to_string_lossy().into_owned())))
}

/// Whether [`read`] knows the kind of the file, whatever else may be wrong with it.
pub fn knows(path: &Path) -> bool {
    let yaml = |text: &str| !text.trim_start().starts_with('{') && MARKS.iter().any(|mark| text.contains(mark));
    text(path).is_ok_and(|text| gnss_ins_sim::knows(&text) || yaml(&text))
}

/// A name that stands in every yaml that is read.
const MARKS: [&str; 7] = [
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "accelerometer_noise_density",
    "accelerometer_random_walk",
    "IMU.Noise",
    "gyr_n",
    "acc_n",
];

fn text(path: &Path) -> Result<String, Problem> {
    let cannot = |e: std::io::Error| Problem::whole(format!("cannot read: {e}"));
    if std::fs::metadata(path).map_err(cannot)?.len() > LONGEST {
        return Err(Problem::whole("longer than any file of parameters; a log is read by identify"));
    }
    String::from_utf8(std::fs::read(path).map_err(cannot)?)
        .map(|text| plain_lines(&text).into_owned())
        .map_err(|_| Problem::whole(format!("is no text; expected {KNOWN}")))
}

const KNOWN: &str =
    "a Kalibr or OpenVINS imu yaml, an ORB-SLAM3 yaml, a result of imu_utils or a dictionary of gnss-ins-sim";

fn parse(text: &str, rate_hz: Option<f64>) -> Result<Imported, Problem> {
    if gnss_ins_sim::knows(text) {
        return gnss_ins_sim::parse(text, rate_hz);
    }
    let unknown = || Problem::whole(format!("no noise parameters found; expected {KNOWN}"));
    // what is no YAML at all is better told so than by its first line
    let entries = yaml::entries(text)
        .map_err(|problem| if MARKS.iter().any(|mark| text.contains(mark)) { problem } else { unknown() })?;
    if imu_utils::knows(&entries) {
        imu_utils::parse(&entries, rate_hz)
    } else if kalibr::knows(&entries) {
        kalibr::parse(&entries, rate_hz)
    } else if entries.iter().any(|e| e.key == "gyr_n" || e.key == "acc_n") {
        Err(Problem::whole(
            "gyr_n and acc_n of VINS are per step, N sqrt(2 rate) by its code and N sqrt(rate) by custom: the file \
             does not say which, \
             so it is not read; type the densities with kfdesign datasheet",
        ))
    } else {
        Err(unknown())
    }
}

impl Imported {
    /// With the name of the file as the source of every sensor.
    fn named(mut self, file: &str) -> Imported {
        for params in &mut self.sensors {
            params.source = Some(source(format!("{file}: {}", self.rules.join("; ")), self.origin));
        }
        self
    }

    /// Of this kind of sensor.
    pub fn sensor(&self, quantity: Quantity) -> Option<&Params> {
        self.sensors.iter().find(|params| params.quantity == quantity)
    }
}

fn source(note: String, origin: &str) -> Source {
    Source {
        note: Some(note),
        method: Some(format!("import from {origin}")),
        version: Some(env!("CARGO_PKG_VERSION").into()),
        ..Source::default()
    }
}

/// An axis without temperature and without anything unknown.
fn axis(name: &str, bias: Option<Measured>, turn_on_bias: Option<Measured>, terms: Vec<TermEntry>) -> AxisParams {
    AxisParams { name: name.into(), bias, turn_on_bias, temperature: None, terms, not_identified: Vec::new() }
}

/// x, y and z alike.
fn three_alike(terms: &[TermEntry]) -> Vec<AxisParams> {
    ["x", "y", "z"].map(|name| axis(name, None, None, terms.to_vec())).into()
}

fn measured(value: f64, unit: &str) -> Result<Measured, Problem> {
    let unit = Unit::parse(unit).map_err(|e| Problem::whole(e.to_string()))?;
    Ok(Measured { value, unit, interval: None })
}

/// Of N as the YAML files hold it.
fn density_unit(quantity: Quantity) -> String {
    format!("{}/sqrt(Hz)", quantity.si_unit())
}

/// Of K.
fn walk_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::AngularRate => "rad/s^2/sqrt(Hz)",
        Quantity::SpecificForce => "m/s^3/sqrt(Hz)",
    }
}

fn sensor_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::AngularRate => "gyro",
        Quantity::SpecificForce => "accelerometer",
    }
}

/// White noise N and, unless it is zero, a walk K, both continuous and SI.
fn white_and_walk(quantity: Quantity, white: f64, walk: f64) -> Result<Vec<TermEntry>, Problem> {
    let mut terms = vec![TermEntry::White { density: measured(white, &density_unit(quantity))? }];
    if walk > 0.0 {
        terms.push(TermEntry::RateRandomWalk { density: measured(walk, walk_unit(quantity))? });
    }
    Ok(terms)
}

/// Where a file does not say at which rate the sensor is read.
fn rate(rate_hz: Option<f64>, why: &str) -> Result<f64, Problem> {
    rate_hz.ok_or_else(|| Problem::Rate { why: why.into() })
}
