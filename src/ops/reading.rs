//! How a log is read: of every request that takes one.

use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::with_unit;
use crate::input::{InputError, InputKind, LogOptions, TemperatureColumn};
use crate::numerics::progress::{note, warning};
use crate::params::Reading as Known;
use crate::signal::LogCheck;
use crate::units::{Dimension, Quantity, Unit};

/// How to read LOG.
#[derive(Clone, Debug, Default, Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[command(next_help_heading = "Reading the log")]
pub struct Reading {
    /// Columns to use: names or 1-based numbers, comma separated [default: found by name]
    #[arg(long, value_delimiter = ',', value_name = "COLUMNS")]
    pub columns: Option<Vec<String>>,
    /// Which table of a file with several (`kfdesign info` lists them): a message, topic or array, `sensor_gyro:1`
    #[arg(long, value_name = "NAME")]
    pub topic: Option<String>,
    /// Time column: name or 1-based number; `none` ignores time columns
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// Unit of the columns if the header does not say it: deg/s, rad/s, mdps, m/s^2, g, "1/131 deg/s" …
    #[arg(long, value_name = "UNIT")]
    pub unit: Option<String>,
    /// Sample rate in Hz if there is no time column; with one, it replaces the stamps
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Skip what is before this time from the start of the log: seconds, or with a unit (`10min`)
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub start: Option<String>,
    /// Stop at this time from the start of the log
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub end: Option<String>,
    /// What the values are
    #[arg(long, value_enum, default_value_t = InputArg::Rate)]
    pub input: InputArg,
    /// Which sensor, if the log holds both
    #[arg(long, value_enum)]
    pub sensor: Option<SensorArg>,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InputArg {
    /// Angular rate or specific force
    #[default]
    Rate,
    /// Increments over one sample (delta angle, delta velocity)
    Increments,
    /// Integrated angle or velocity
    Angle,
}

#[derive(Clone, Copy, Debug, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SensorArg {
    Gyro,
    Accel,
}

impl Reading {
    /// What was said of the log; `None`: nothing.
    pub fn said(&self) -> Option<Known> {
        let said = Known {
            columns: self.columns.clone().unwrap_or_default(),
            topic: self.topic.clone(),
            time: self.time.clone(),
            unit: self.unit.clone(),
            rate: self.rate,
        };
        (said != Known::default()).then_some(said)
    }

    /// Reads a log; where it cannot be read without options that are not given, and `known` has them of the log behind
    /// the parameters, with these, which is noted.
    pub fn read<T>(
        &self,
        known: Option<&Known>,
        read: impl Fn(LogOptions) -> Result<T, InputError>,
    ) -> anyhow::Result<T> {
        let (error, known) = match (read(self.options()?), known) {
            (Ok(found), _) => return Ok(found),
            (Err(error), None) => return Err(error.into()),
            (Err(error), Some(known)) => (error, known),
        };
        let mut with = self.clone();
        let mut added = Vec::new();
        for (option, _) in &error.missing {
            let (option, said) = match *option {
                "columns" if !known.columns.is_empty() => {
                    with.columns = Some(known.columns.clone());
                    ("columns", known.columns.join(","))
                }
                "unit" => ("unit", take(&mut with.unit, &known.unit)),
                // either gives the samples their time
                "rate" | "time" if known.rate.is_some() => ("rate", take(&mut with.rate, &known.rate)),
                "rate" | "time" => ("time", take(&mut with.time, &known.time)),
                _ => continue,
            };
            if !said.is_empty() {
                added.push(format!("`{option}` {said}"));
            }
        }
        if added.len() < error.missing.len() || added.is_empty() {
            return Err(error.into());
        }
        note(&format!("  note: read with {}, as the log behind the parameters was", added.join(" ")));
        Ok(read(with.options()?)?)
    }

    /// As [`Reading::options`], for what reads sample by sample and knows rates alone.
    pub fn rates(&self) -> anyhow::Result<LogOptions> {
        let flag = match self.input {
            InputArg::Rate => return self.options(),
            InputArg::Increments => "increments",
            InputArg::Angle => "angle",
        };
        anyhow::bail!(
            "`input` {flag}: a filter runs on rates, sample by sample; write the log as rates first (increments, or \
             differences of angles, over the sample period)"
        )
    }

    /// What was typed, checked.
    pub fn options(&self) -> anyhow::Result<LogOptions> {
        Ok(LogOptions {
            columns: self.columns.clone(),
            topic: self.topic.clone(),
            time: self.time.clone(),
            unit: self.unit.as_deref().map(Unit::parse).transpose().map_err(|e| anyhow::anyhow!("`unit`: {e}"))?,
            rate_hz: self.rate,
            start_s: self.start.as_deref().map(|text| seconds("`start`", text)).transpose()?,
            end_s: self.end.as_deref().map(|text| seconds("`end`", text)).transpose()?,
            no_digest: false,
            kind: match self.input {
                InputArg::Rate => InputKind::Rate,
                InputArg::Increments => InputKind::Increments,
                InputArg::Angle => InputKind::Angle,
            },
            quantity: self.sensor.map(|s| match s {
                SensorArg::Gyro => Quantity::AngularRate,
                SensorArg::Accel => Quantity::SpecificForce,
            }),
            temperature: TemperatureColumn::Ignored,
            extra: Vec::new(),
        })
    }
}

/// What is known in place of what was not said, as text.
fn take<T: Clone + ToString>(said: &mut Option<T>, known: &Option<T>) -> String {
    *said = known.clone();
    known.as_ref().map(ToString::to_string).unwrap_or_default()
}

/// A time without a unit is in seconds.
fn seconds(flag: &str, text: &str) -> anyhow::Result<f64> {
    match text.trim().parse::<f64>() {
        Ok(seconds) => Ok(seconds),
        Err(_) => with_unit(flag, text, Dimension::TIME, "10min"),
    }
}

/// The log check as notes, one line a finding.
pub fn note_check(name: &str, check: &LogCheck) {
    note(&format!(
        "{name}: {} samples at {:.6} Hz, {:.1} s{}",
        check.samples,
        check.sample_rate_hz,
        check.span_s,
        if check.findings.is_empty() { ", nothing unusual" } else { "" }
    ));
    for finding in &check.findings {
        if finding.serious {
            warning(&finding.message);
        } else {
            note(&format!("  note: {}", finding.message));
        }
    }
}
