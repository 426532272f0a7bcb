//! The params.json document: versioned, units on every value, intervals, provenance (floor 1).

//!
//! `place` reads JSON key by key with the place of every complaint, `measured` is a value with its unit, `document` the
//! layout of the file and its schema, `design` its section on the plant.

mod axis;
mod design;
mod document;
mod measured;
pub mod place;
mod source;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use crate::noise::{Filter, NoiseModel, Term};
use crate::units::{Quantity, Unit, UnitError};

pub use design::{
    AidDrift, AidEntry, AttitudeEntry, CustomEntry, Design, MotionEntry, NamedEntry, PLANTS, PlantEntry, StateEntry,
    check_name, unknown_plant,
};
pub(crate) use document::{ParamsDocument, quantity};
pub use measured::Measured;
pub(crate) use measured::{Plain, Range};
use place::{KeyError, Place};

/// One noise term as documented: kind with its coefficients as [`Measured`].
#[derive(Clone, Debug, PartialEq)]
pub enum TermEntry {
    Quantization { coefficient: Measured },
    White { density: Measured },
    MovingAverage { density: Measured, samples: u32 },
    BandLimit { density: Measured, filter: Filter },
    Oscillation { std_dev: Measured, frequency: Measured, correlation_time: Measured },
    BiasInstability { coefficient: Measured },
    GaussMarkov { std_dev: Measured, correlation_time: Measured },
    RateRandomWalk { density: Measured },
    RateRamp { slope: Measured },
}

/// Something the log cannot tell.
#[derive(Clone, Debug, PartialEq)]
pub struct NotIdentified {
    /// "gauss_markov", "rate_random_walk", "gauss_markov.correlation_time" …
    pub term: String,
    pub reason: String,
    /// Log length that would tell, if it can be said.
    pub needed_log_s: Option<f64>,
    /// Of a random walk that was looked for and not seen: the density that would have shown (95 %).
    pub upper_limit: Option<Measured>,
}

/// Bias = bias + coefficient · (temperature − reference).
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureEffect {
    /// Change of the bias with temperature.
    pub coefficient: Measured,
    /// Mean temperature of the log, to which its bias belongs: a reading, of which the unit gives no SI value.
    pub reference: Measured,
    /// Highest less lowest temperature of the log.
    pub span: Measured,
}

#[derive(Clone, Debug, PartialEq)]
pub struct AxisParams {
    pub name: String,
    /// Constant bias of this log / of the sensor.
    pub bias: Option<Measured>,
    /// Standard deviation of the bias from one power-up to the next; feeds P0.
    pub turn_on_bias: Option<Measured>,
    /// How the bias followed the temperature of the log; the noise terms do not know of it.
    pub temperature: Option<TemperatureEffect>,
    pub terms: Vec<TermEntry>,
    pub not_identified: Vec<NotIdentified>,
}

/// What the white noise of an axis was multiplied with after the bench.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Inflated {
    pub axis: String,
    /// On the densities of white, moving_average and band_limit.
    pub factor: f64,
    /// 95 % of the factor.
    pub interval: [f64; 2],
}

/// What a check is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CheckKind {
    /// The log is not at rest all the time.
    Motion,
    /// The model misses the spectrum of the log.
    Fit,
    /// The part to identify instead.
    Calm,
}

/// A check that the log, or the fit to it, has failed; or (`calm`) what part of such a log is at rest.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    pub kind: CheckKind,
    /// None: the log as a whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// One sentence with numbers and units.
    pub message: String,
    /// The numbers behind it, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub numbers: BTreeMap<String, f64>,
}

/// A parameter that is not the same in all logs from which the document is: its value and interval are those of the
/// mean over logs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BetweenLogs {
    pub axis: String,
    /// `white.density`.
    pub parameter: String,
    /// Standard deviation from one log to the next, %.
    pub spread_percent: f64,
    /// Its 95 % interval.
    pub interval_percent: [f64; 2],
    /// Of the test that the logs do not differ.
    pub p_value: f64,
}

/// What had to be said of the log so that it could be read, in the words of the options of the same names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
}

/// Where the numbers come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    pub log: Option<String>,
    pub sha256: Option<String>,
    pub samples: Option<u64>,
    pub span_s: Option<f64>,
    pub method: Option<String>,
    pub version: Option<String>,
    /// Free text: datasheet, paper, address.
    pub note: Option<String>,
    /// By axis, where `inflate` measured it; empty: as identified.
    pub inflation: Vec<Inflated>,
    /// What `identify` found wrong; empty: nothing.
    pub checks: Vec<Check>,
    /// Of several logs: what differs between them.
    pub between_logs: Vec<BetweenLogs>,
    /// None: nothing had to be said.
    pub reading: Option<Reading>,
}

impl Reading {
    /// What a document says at `key`; nothing where that is no such record.
    pub fn of(record: &serde_json::Value, key: &str) -> Option<Reading> {
        source::reading(&Place::at(key, record.get(key)?)).ok()
    }
}

impl Source {
    /// The log, or the fit to it, has failed a check: one line that names each with its axes, and the part that is
    /// at rest.
    pub fn failed(&self) -> Option<String> {
        let of = |kind: CheckKind, words: &str| {
            let found = self.checks.iter().filter(|check| check.kind == kind);
            let mut axes: Vec<&str> = found.clone().filter_map(|check| check.axis.as_deref()).collect();
            axes.dedup();
            let on = if axes.is_empty() { String::new() } else { format!(" ({})", axes.join(", ")) };
            found.take(1).map(|_| format!("{words}{on}")).next()
        };
        let failed: Vec<String> = [
            of(CheckKind::Motion, "the log is not at rest all the time"),
            of(CheckKind::Fit, "the model misses the spectrum of the log"),
        ]
        .into_iter()
        .flatten()
        .collect();
        let calm = self.checks.iter().find(|check| check.kind == CheckKind::Calm);
        let calm = calm.map_or_else(String::new, |check| format!("; {}", check.message));
        (!failed.is_empty()).then(|| format!("{}{calm}", failed.join("; ")))
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    pub quantity: Quantity,
    /// Hz.
    pub sample_rate_hz: f64,
    pub axes: Vec<AxisParams>,
    /// The plant that the sensor is part of; at rest when absent.
    pub design: Option<Design>,
    pub source: Option<Source>,
}

#[derive(Clone, Debug, thiserror::Error)]
pub enum ParamsError {
    #[error("{path}: cannot read: {reason}")]
    Read { path: String, reason: String },
    /// `key` is the path inside the document: `axes[0].white.density`.
    #[error("{path}: {key}: {message}")]
    Invalid { path: String, key: String, message: String },
    #[error("{path}: line {line}, column {column}: not valid JSON: {message}")]
    Syntax { path: String, line: usize, column: usize, message: String },
    #[error(transparent)]
    Unit(#[from] UnitError),
}

impl AxisParams {
    /// The noise terms in SI.
    pub fn noise(&self) -> NoiseModel {
        NoiseModel { terms: self.terms.iter().map(TermEntry::to_term).collect() }
    }

    /// Every coefficient of the noise terms with its path in the document: `white.density`, `gauss_markov.std_dev`,
    /// `gauss_markov[1].std_dev` for the second term of a kind.
    pub fn noise_parameters(&mut self) -> impl Iterator<Item = (String, &mut Measured)> {
        let mut seen: Vec<&'static str> = Vec::new();
        self.terms.iter_mut().flat_map(move |term| {
            let (kind, parameters) = term.parameters();
            let before = seen.iter().filter(|k| **k == kind).count();
            seen.push(kind);
            let place = if before == 0 { kind.to_string() } else { format!("{kind}[{before}]") };
            parameters.into_iter().map(move |(name, value)| (format!("{place}.{name}"), value))
        })
    }
}

impl TermEntry {
    /// Of what is white at low frequencies: white noise, a moving average, a band limit.
    pub fn wideband_density(&self) -> Option<&Measured> {
        match self {
            TermEntry::White { density }
            | TermEntry::MovingAverage { density, .. }
            | TermEntry::BandLimit { density, .. } => Some(density),
            _ => None,
        }
    }

    /// The term's key in the document and its coefficients by name.
    fn parameters(&mut self) -> (&'static str, Vec<(&'static str, &mut Measured)>) {
        match self {
            TermEntry::Quantization { coefficient } => ("quantization", vec![("coefficient", coefficient)]),
            TermEntry::White { density } => ("white", vec![("density", density)]),
            TermEntry::MovingAverage { density, .. } => ("moving_average", vec![("density", density)]),
            TermEntry::BandLimit { density, .. } => ("band_limit", vec![("density", density)]),
            TermEntry::Oscillation { std_dev, frequency, correlation_time } => {
                let values = [("std_dev", std_dev), ("frequency", frequency), ("correlation_time", correlation_time)];
                ("oscillation", values.into())
            }
            TermEntry::BiasInstability { coefficient } => ("bias_instability", vec![("coefficient", coefficient)]),
            TermEntry::GaussMarkov { std_dev, correlation_time } => {
                ("gauss_markov", vec![("std_dev", std_dev), ("correlation_time", correlation_time)])
            }
            TermEntry::RateRandomWalk { density } => ("rate_random_walk", vec![("density", density)]),
            TermEntry::RateRamp { slope } => ("rate_ramp", vec![("slope", slope)]),
        }
    }

    /// The term with SI coefficients.
    pub fn to_term(&self) -> Term {
        match self {
            TermEntry::Quantization { coefficient } => Term::Quantization { coefficient: coefficient.si() },
            TermEntry::White { density } => Term::White { density: density.si() },
            TermEntry::MovingAverage { density, samples } => {
                Term::MovingAverage { density: density.si(), samples: *samples }
            }
            TermEntry::BandLimit { density, filter } => Term::BandLimit { density: density.si(), filter: *filter },
            TermEntry::Oscillation { std_dev, frequency, correlation_time } => Term::Oscillation {
                std_dev: std_dev.si(),
                frequency_hz: frequency.si(),
                correlation_time: correlation_time.si(),
            },
            TermEntry::BiasInstability { coefficient } => Term::BiasInstability { coefficient: coefficient.si() },
            TermEntry::GaussMarkov { std_dev, correlation_time } => {
                Term::GaussMarkov { std_dev: std_dev.si(), correlation_time: correlation_time.si() }
            }
            TermEntry::RateRandomWalk { density } => Term::RateRandomWalk { density: density.si() },
            TermEntry::RateRamp { slope } => Term::RateRamp { slope: slope.si() },
        }
    }
}

impl AxisParams {
    /// The unit of the quantity in which the parameters of this axis are written, else deg/s or m/s^2.
    pub fn display_unit(&self, quantity: Quantity) -> Unit {
        let terms = self.terms.iter().filter_map(|term| match term {
            TermEntry::GaussMarkov { std_dev, .. } | TermEntry::Oscillation { std_dev, .. } => Some(std_dev),
            TermEntry::BiasInstability { coefficient } => Some(coefficient),
            _ => None,
        });
        let written = terms.chain(&self.turn_on_bias).chain(&self.bias).map(|m| m.unit.times_time(0)).next();
        let usual = match quantity {
            Quantity::AngularRate => "deg/s",
            Quantity::SpecificForce => "m/s^2",
        };
        written.unwrap_or_else(|| Unit::parse(usual).unwrap_or_else(|_| Unit::one()))
    }

    /// Reads an axis that stands in another document; `place` names where.
    pub fn from_place(place: &Place<'_>, quantity: Quantity) -> Result<AxisParams, KeyError> {
        axis::axis(place, quantity)
    }
}

impl Params {
    /// Reads params.json; every complaint names `path` and the key.
    pub fn from_json(text: &str, path: &str) -> Result<Params, ParamsError> {
        let value = place::parse(text).map_err(|e| ParamsError::Syntax {
            path: path.into(),
            line: e.line,
            column: e.column,
            message: e.message,
        })?;
        document::params(&Place::root(&value)).map_err(|e| ParamsError::Invalid {
            path: path.into(),
            key: e.key,
            message: e.message,
        })
    }
    pub fn read(path: &Path) -> Result<Params, ParamsError> {
        let shown = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Params::from_json(&text, &shown),
            Err(e) => Err(ParamsError::Read { path: shown, reason: e.to_string() }),
        }
    }
    /// See [`Source::failed`].
    pub fn failed_check(&self) -> Option<String> {
        self.source.as_ref().and_then(Source::failed)
    }
    /// Pretty JSON with a trailing newline; reading it back gives the same document.
    pub fn to_json(&self) -> String {
        // no map with keys other than text is in the document, so that serialising cannot fail
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
    /// The published JSON schema.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(ParamsDocument).to_value()
    }
}
