//! Unit strings to SI and back, with half-integer powers and a dimension check (floor 0).
//!
//! Inside kfdesign every number is SI (rad, m, s, K). Conversion happens once, at the edges, by a [`Unit`].
//! `parse` holds the grammar, `symbol` the table of names, `dimension` the words for what a dimension is.

mod amount;
mod dimension;
mod parse;
mod plain;
mod symbol;

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use amount::amount;
pub use plain::{plain, plain_lines};
use symbol::Symbol;

/// In SI nothing that a sensor gives or has is larger, and nothing but zero smaller than its inverse: fourth powers,
/// ratios of them, and sums of as many as a log has samples stay in the range of doubles.
pub const LARGEST: f64 = 1e30;

/// Exponents of the base dimensions **times two**, so that `1/sqrt(Hz)` is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub struct Dimension {
    pub angle: i8,
    pub length: i8,
    pub time: i8,
    pub temperature: i8,
    pub mass: i8,
    /// Electric.
    pub current: i8,
}

/// A parsed unit: the text as the user wrote it, its factor to SI and its dimension.
///
/// A unit is a factor only. Temperatures in degC, degF and K therefore agree as differences, not as readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    text: String,
    scale: f64,
    dimension: Dimension,
    factors: Vec<Factor>,
}

/// A symbol with its exponent times two.
#[derive(Clone, Debug, PartialEq)]
struct Factor {
    symbol: Symbol,
    half_power: i8,
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

impl Quantity {
    pub const fn dimension(self) -> Dimension {
        match self {
            Quantity::AngularRate => Dimension::new(2, 0, -2),
            Quantity::SpecificForce => Dimension::new(0, 2, -4),
        }
    }
    /// The word in documents.
    pub const fn name(self) -> &'static str {
        match self {
            Quantity::AngularRate => "angular-rate",
            Quantity::SpecificForce => "specific-force",
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
    ///
    /// `g` is standard gravity, 9.80665 m/s². What can be read in two ways (`deg/s·√Hz`, `G`, `d`) is refused with a
    /// hint.
    ///
    /// ```
    /// use kfdesign::units::Unit;
    ///
    /// let walk = Unit::parse("deg/sqrt(h)")?;
    /// assert!((walk.to_si(60.0) - 1_f64.to_radians()).abs() < 1e-15); // 60 s are √3600
    /// assert!(Unit::parse("deg/s·√Hz").is_err());
    /// # Ok::<(), kfdesign::units::UnitError>(())
    /// ```
    pub fn parse(text: &str) -> Result<Unit, UnitError> {
        parse::unit(text)
    }
    /// The unit of plain numbers.
    pub fn one() -> Unit {
        Unit::of_factors(Vec::new())
    }
    /// `s`.
    pub fn second() -> Unit {
        Unit::of_factors(vec![Factor { symbol: Symbol::second(), half_power: 2 }])
    }
    /// `Hz`.
    pub fn hertz() -> Unit {
        Unit::of_factors(vec![Factor { symbol: Symbol::hertz(), half_power: 2 }])
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
        if self.dimension == expected {
            return Ok(());
        }
        Err(UnitError::WrongDimension {
            found: self.text.clone(),
            found_dimension: dimension::found(self.dimension, expected),
            expected: expected.name(),
            example: expected.example(),
        })
    }
    /// The unit times `time^(half_powers/2)` in the same spelling family: `deg/s` with +1 gives `deg/s/sqrt(Hz)`,
    /// with −1 `deg/s/sqrt(s)`, with +2 the integral (`deg`), with −2 `deg/s^2`. Used to print parameters in the
    /// log's own unit.
    ///
    /// The time unit of the family is kept (`deg/h` with −1 gives `deg/h/sqrt(h)`). A leading number (the step of a
    /// converter, `1/131 deg/s`) is dropped, also with 0: parameters are printed in the physical unit.
    pub fn times_time(&self, half_powers: i8) -> Unit {
        let mut factors = self.factors.clone();
        let whole = half_powers / 2;
        for _ in 0..whole.unsigned_abs() {
            shift_time(&mut factors, whole > 0);
        }
        match half_powers % 2 {
            1 => factors.push(Factor { symbol: Symbol::hertz(), half_power: -1 }),
            -1 => {
                let symbol =
                    factors.iter().find(|f| f.is_divisor_time()).map_or_else(Symbol::second, |f| f.symbol.clone());
                factors.push(Factor { symbol, half_power: -1 });
            }
            _ => {}
        }
        Unit::of_factors(factors)
    }
    /// This unit divided by another, without leading numbers: `deg/s` per `degC` is `deg/s/degC`.
    pub fn per(&self, other: &Unit) -> Unit {
        let below = other.factors.iter().map(|f| Factor { half_power: -f.half_power, symbol: f.symbol.clone() });
        Unit::of_factors(self.factors.iter().cloned().chain(below).collect())
    }
    /// The quantity this unit belongs to, if it is a rate or a specific force.
    pub fn quantity(&self) -> Option<Quantity> {
        [Quantity::AngularRate, Quantity::SpecificForce].into_iter().find(|q| q.dimension() == self.dimension)
    }

    /// Factors written in the plain form (`deg/s/sqrt(Hz)`), with no leading number.
    fn of_factors(factors: Vec<Factor>) -> Unit {
        let dimension = factors.iter().fold(Dimension::NONE, |d, f| d.times(f.symbol.dimension, f.half_power));
        let scale = factors.iter().map(Factor::scale).product();
        Unit { text: plain_text(&factors), scale, dimension, factors }
    }
}

impl Factor {
    fn scale(&self) -> f64 {
        let whole = self.symbol.scale.powi(i32::from(self.half_power / 2));
        match self.half_power % 2 {
            0 => whole,
            1 => whole * self.symbol.scale.sqrt(),
            _ => whole / self.symbol.scale.sqrt(),
        }
    }
    /// A whole power of a second, minute or hour below the line.
    fn is_divisor_time(&self) -> bool {
        self.symbol.dimension == Dimension::TIME && self.half_power <= -2
    }
}

/// Multiply (`up`) or divide the factors by their own time unit, once.
fn shift_time(factors: &mut Vec<Factor>, up: bool) {
    let step = if up { 2 } else { -2 };
    if let Some(i) = factors.iter().position(Factor::is_divisor_time) {
        factors[i].half_power = factors[i].half_power.saturating_add(step);
        if factors[i].half_power == 0 {
            factors.remove(i);
        }
    } else if let Some((i, integral)) =
        factors.iter().enumerate().find_map(|(i, f)| Some((i, f.symbol.integral()?))).filter(|_| up)
        && factors[i].half_power == 2
    {
        factors[i].symbol = integral;
    } else {
        factors.push(Factor { symbol: Symbol::second(), half_power: step });
    }
}

fn plain_text(factors: &[Factor]) -> String {
    let power = |f: &Factor| {
        let half = f.half_power.unsigned_abs();
        match half {
            1 => format!("sqrt({})", f.symbol.name),
            2 => f.symbol.name.clone(),
            _ if half.is_multiple_of(2) => format!("{}^{}", f.symbol.name, half / 2),
            _ => format!("{}^{}.5", f.symbol.name, half / 2),
        }
    };
    let above: Vec<String> = factors.iter().filter(|f| f.half_power > 0).map(power).collect();
    let mut text = if above.is_empty() { "1".to_string() } else { above.join("*") };
    for factor in factors.iter().filter(|f| f.half_power < 0) {
        text.push('/');
        text.push_str(&power(factor));
    }
    text
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Four significant digits, plain where readable: 0.05620, 193.9, 1.234e-7.
pub fn digits(x: f64) -> String {
    significant(x, 4)
}

/// So many significant digits, plain where readable.
pub fn significant(x: f64, count: usize) -> String {
    if !x.is_finite() {
        return x.to_string();
    }
    if x == 0.0 {
        return "0".into();
    }
    let exponent = x.abs().log10().floor();
    if (-4.0..6.0).contains(&exponent) {
        let decimals = (count as f64 - 1.0 - exponent).max(0.0) as usize;
        format!("{x:.decimals$}")
    } else {
        let decimals = count.saturating_sub(1);
        format!("{x:.decimals$e}")
    }
}

/// Seconds below two minutes, minutes below two hours, hours below a thousand of them, else days.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", digits(s)),
        s if s < 7200.0 => format!("{} min", digits(s / 60.0)),
        s if s < 3.6e6 => format!("{} h", digits(s / 3600.0)),
        s => format!("{} days", digits(s / 86_400.0)),
    }
}

/// The quantity itself is shown in the unit of the axis, its integral and its derivative (an angle, an acceleration)
/// in the unit that goes with it, all else in SI: scale and text.
pub fn shown_unit(si: &str, quantity: Quantity, unit: &Unit) -> (f64, String) {
    if si == quantity.si_unit() {
        return (unit.scale(), unit.to_string());
    }
    let dimension = Unit::parse(si).map(|si| si.dimension());
    let family = [2, -2].map(|half_powers| unit.times_time(half_powers));
    match family.into_iter().find(|unit| dimension == Ok(unit.dimension())) {
        Some(unit) => (unit.scale(), unit.to_string()),
        None => (1.0, si.to_owned()),
    }
}
