//! The params.json document: versioned, units on every value, intervals, provenance (floor 1).

use std::path::Path;

use crate::noise::{NoiseModel, Term};
use crate::units::{Quantity, Unit, UnitError};

/// A value with its unit as written and, if known, a 95 % interval in the same unit.
/// Serialised as `{"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}`; the short form `"0.0562 deg/s/sqrt(Hz)"` is read too.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub unit: Unit,
    pub interval: Option<[f64; 2]>,
}

impl Measured {
    pub fn si(&self) -> f64 {
        self.unit.to_si(self.value)
    }
    /// From SI into `unit`; the interval is SI too.
    pub fn from_si(value: f64, interval: Option<[f64; 2]>, unit: Unit) -> Self {
        Measured { value: unit.from_si(value), interval: interval.map(|i| i.map(|v| unit.from_si(v))), unit }
    }
}

/// One noise term as documented: kind with its coefficients as [`Measured`].
#[derive(Clone, Debug, PartialEq)]
pub enum TermEntry {
    Quantization { coefficient: Measured },
    White { density: Measured },
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
}

#[derive(Clone, Debug, PartialEq)]
pub struct AxisParams {
    pub name: String,
    /// Constant bias of this log / of the sensor.
    pub bias: Option<Measured>,
    /// Standard deviation of the bias from one power-up to the next; feeds P0.
    pub turn_on_bias: Option<Measured>,
    pub terms: Vec<TermEntry>,
    pub not_identified: Vec<NotIdentified>,
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
}

#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    pub quantity: Quantity,
    /// Hz.
    pub sample_rate_hz: f64,
    pub axes: Vec<AxisParams>,
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
}

impl TermEntry {
    pub fn to_term(&self) -> Term {
        todo!()
    }
}

impl Params {
    pub fn from_json(text: &str, path: &str) -> Result<Params, ParamsError> {
        let _ = (text, path);
        todo!()
    }
    pub fn read(path: &Path) -> Result<Params, ParamsError> {
        let _ = path;
        todo!()
    }
    /// Pretty JSON with a trailing newline; reading it back gives the same document.
    pub fn to_json(&self) -> String {
        todo!()
    }
    /// The published JSON schema.
    pub fn schema() -> serde_json::Value {
        todo!()
    }
}
