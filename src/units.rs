//! Unit strings to SI and back, with half-integer powers and a dimension check (floor 0).
//!
//! Inside kfdesign every number is SI (rad, m, s, K). Conversion happens once, at the edges, by a [`Unit`].

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Exponents of the base dimensions **times two**, so that `1/sqrt(Hz)` is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Dimension {
    pub angle: i8,
    pub length: i8,
    pub time: i8,
    pub temperature: i8,
}

/// A parsed unit: the text as the user wrote it, its factor to SI and its dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    text: String,
    scale: f64,
    dimension: Dimension,
}

/// What a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    AngularRate,
    SpecificForce,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// One clear sentence: what was found, where, what is accepted.
    #[error("unknown unit '{found}': {hint}")]
    Unknown { found: String, hint: String },
    #[error("unit '{found}' is {found_dimension}, expected {expected} (for example {example})")]
    WrongDimension { found: String, found_dimension: String, expected: String, example: String },
}

impl Dimension {
    pub const NONE: Dimension = Dimension::new(0, 0, 0);
    pub const TIME: Dimension = Dimension::new(0, 0, 2);

    /// Doubled exponents of angle, length, time.
    pub const fn new(angle: i8, length: i8, time: i8) -> Self {
        Dimension { angle, length, time, temperature: 0 }
    }

    /// The same dimension times `time^(half_powers/2)`.
    pub const fn times_time(self, half_powers: i8) -> Self {
        Dimension { time: self.time + half_powers, ..self }
    }
}

impl Quantity {
    pub const fn dimension(self) -> Dimension {
        match self {
            Quantity::AngularRate => Dimension::new(2, 0, -2),
            Quantity::SpecificForce => Dimension::new(0, 2, -4),
        }
    }
    /// "rad/s" or "m/s^2".
    pub const fn si_unit(self) -> &'static str {
        match self {
            Quantity::AngularRate => "rad/s",
            Quantity::SpecificForce => "m/s^2",
        }
    }
}

impl Unit {
    /// Parses every spelling people print: `deg/sqrt(h)`, `deg/s/√Hz`, `°/s`, `mdps`, `ug/sqrt(Hz)`,
    /// `[rad s^-1]`, `m/s²`, `1/131 deg/s` (a leading number or fraction scales) …
    pub fn parse(text: &str) -> Result<Unit, UnitError> {
        let _ = text;
        todo!()
    }
    pub fn text(&self) -> &str {
        &self.text
    }
    /// SI value of 1 in this unit.
    pub fn scale(&self) -> f64 {
        self.scale
    }
    pub fn dimension(&self) -> Dimension {
        self.dimension
    }
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.scale
    }
    pub fn from_si(&self, value: f64) -> f64 {
        value / self.scale
    }
    /// `Ok` when the unit has this dimension; the error names both and gives an example.
    pub fn require(&self, expected: Dimension) -> Result<(), UnitError> {
        let _ = expected;
        todo!()
    }
    /// The unit times `time^(half_powers/2)` in the same spelling family: `deg/s` with +1 gives `deg/s/sqrt(Hz)`,
    /// with −1 `deg/s/sqrt(s)`, with +2 the integral (`deg`), with −2 `deg/s^2`. Used to print parameters in the log's own unit.
    pub fn times_time(&self, half_powers: i8) -> Unit {
        let _ = half_powers;
        todo!()
    }
    /// The quantity this unit belongs to, if it is a rate or a specific force.
    pub fn quantity(&self) -> Option<Quantity> {
        [Quantity::AngularRate, Quantity::SpecificForce].into_iter().find(|q| q.dimension() == self.dimension)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
