//! How a log is read: of every request that takes one.

use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::with_unit;
use crate::input::{InputKind, LogOptions, TemperatureColumn};
use crate::numerics::progress::note;
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
    /// As [`Reading::options`], for what reads sample by sample and knows rates alone.
    pub fn rates(&self) -> anyhow::Result<LogOptions> {
        let flag = match self.input {
            InputArg::Rate => return self.options(),
            InputArg::Increments => "increments",
            InputArg::Angle => "angle",
        };
        anyhow::bail!(
            "`input` {flag}: a filter runs on rates, sample by sample; write the log as rates first (increments, or differences of angles, over the sample period)"
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
        note(&format!("  {}: {}", if finding.serious { "warning" } else { "note" }, finding.message));
    }
}
