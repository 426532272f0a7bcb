//! A value with its unit and, if known, its 95 % interval, as documents hold it.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::place::{KeyError, Place, describe};
use crate::numerics::distribution::NORMAL_95;
use crate::units::{Dimension, LARGEST, Unit};

/// A value with its unit as written and, if known, a 95 % interval in the same unit.
/// Serialised as `{"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}`; the short form `"0.0562
/// deg/s/sqrt(Hz)"` is read too. An open end of the interval is infinite, `null` in the document.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub unit: Unit,
    pub interval: Option<[f64; 2]>,
}

/// Which values make sense at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Range {
    Any,
    Positive,
}

impl Measured {
    pub fn si(&self) -> f64 {
        self.unit.to_si(self.value)
    }
    /// Less than a hundredth of a density, as the white noise that `identify` sets beside a band limit so that a filter
    /// exists: it moves the sum of both by at most 5e-5.
    pub fn is_floor_of(&self, whole_si: f64) -> bool {
        self.si() < 0.01 * whole_si
    }
    /// The interval in SI.
    pub fn interval_si(&self) -> Option<[f64; 2]> {
        self.interval.map(|i| i.map(|v| self.unit.to_si(v)))
    }
    /// Standard deviation of the logarithm by the interval, taken as the 95 % range of a log-normal law; from the
    /// closed side of one that is open on the other.
    pub fn log_spread(&self) -> Option<f64> {
        let [lower, upper] = self.interval?;
        let below = (lower > 0.0).then(|| (self.value / lower).ln());
        let above = upper.is_finite().then(|| (upper / self.value).ln());
        let width = match (below, above) {
            (Some(below), Some(above)) => 0.5 * (below + above),
            (one, other) => one.or(other)?,
        };
        Some(width / NORMAL_95).filter(|spread| *spread > 0.0)
    }
    /// From SI into `unit`; the interval is SI too.
    pub fn from_si(value: f64, interval: Option<[f64; 2]>, unit: Unit) -> Self {
        Measured { value: unit.from_si(value), interval: interval.map(|i| i.map(|v| unit.from_si(v))), unit }
    }

    /// Refuses sizes of which fourth powers, and ratios of them, leave the range of doubles.
    fn size(&self) -> Result<(), String> {
        let si = self.si().abs();
        if self.value == 0.0 || (1.0 / LARGEST..=LARGEST).contains(&si) {
            return Ok(());
        }
        let end = if si > 1.0 { "larger" } else { "smaller" };
        Err(format!("{} {} is {end} than any sensor's: expected a size of 1e-30 to 1e30 in SI", self.value, self.unit))
    }

    /// A positive value from a text such as `0.0562 deg/s/sqrt(Hz)`, with its dimension checked; an error says what is
    /// wrong.
    pub fn positive(text: &str, expected: Dimension) -> Result<Measured, String> {
        let measured = short_form(text)?;
        measured.unit.require(expected).map_err(|e| e.to_string())?;
        measured.size()?;
        if measured.value > 0.0 { Ok(measured) } else { Err(format!("{text} must be greater than zero")) }
    }

    /// Reads either form and checks dimension and range.
    pub(crate) fn from_place(place: &Place<'_>, expected: Dimension, range: Range) -> Result<Measured, KeyError> {
        let example = expected.example();
        let measured = match place.value() {
            Value::String(text) => short_form(text).map_err(|message| place.error(message)),
            Value::Object(_) => long_form(place),
            Value::Number(n) => Err(place.error(format!(
                "the number {n} has no unit; write \"{n} {example}\" or {{\"value\": {n}, \"unit\": \"{example}\"}}"
            ))),
            other => Err(place.error(format!(
                "expected a value with a unit, for example \"0.1 {example}\", found {}",
                describe(other)
            ))),
        }?;
        measured.unit.require(expected).map_err(|e| place.error(e.to_string()))?;
        measured.size().map_err(|message| place.error(message))?;
        if range == Range::Positive {
            if measured.value <= 0.0 {
                return Err(place.error(format!(
                    "{} {} must be greater than zero; leave the key out if there is none",
                    measured.value, measured.unit
                )));
            }
            if measured.interval.is_some_and(|[lower, _]| lower < 0.0) {
                return Err(place.error("the interval reaches below zero"));
            }
        }
        Ok(measured)
    }
}

/// `0.0562 deg/s/sqrt(Hz)`.
fn short_form(text: &str) -> Result<Measured, String> {
    let expected = || format!("expected a number and a unit, for example \"0.1 deg/s\", found \"{text}\"");
    let (number, unit) = text.trim().split_once(char::is_whitespace).ok_or_else(expected)?;
    let value: f64 = number.parse().map_err(|_| expected())?;
    if !value.is_finite() {
        return Err(format!("the value {number} is not finite"));
    }
    let unit = Unit::parse(unit).map_err(|e| e.to_string())?;
    Ok(Measured { value, unit, interval: None })
}

fn long_form(place: &Place<'_>) -> Result<Measured, KeyError> {
    let object = place.object(&["value", "unit", "interval"])?;
    let value = object.required("value")?.number()?;
    let unit = object.required("unit")?;
    let unit = Unit::parse(unit.text()?).map_err(|e| unit.error(e.to_string()))?;
    let interval = object.optional("interval").map(|p| interval(&p, value)).transpose()?;
    Ok(Measured { value, unit, interval })
}

/// `[lower, upper]` around the value; null is an open end.
fn interval(place: &Place<'_>, value: f64) -> Result<[f64; 2], KeyError> {
    let ends = place.list()?;
    let [lower, upper] = ends.as_slice() else {
        return Err(place.error(format!("expected [lower, upper], found {} values", ends.len())));
    };
    let shown = |end: f64| if end.is_finite() { end.to_string() } else { "null".into() };
    let end = |p: &Place<'_>, open: f64| if p.value().is_null() { Ok(open) } else { p.number() };
    let [lower, upper] = [end(lower, f64::NEG_INFINITY)?, end(upper, f64::INFINITY)?];
    if lower > upper {
        return Err(place.error(format!("the lower end {lower} is above the upper end {upper}")));
    }
    if !(lower..=upper).contains(&value) {
        return Err(place.error(format!(
            "the value {value} is not in [{}, {}]; expected lower <= value <= upper",
            shown(lower),
            shown(upper)
        )));
    }
    Ok([lower, upper])
}

impl Serialize for Measured {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut s = serializer.serialize_struct("Measured", 2 + usize::from(self.interval.is_some()))?;
        s.serialize_field("value", &self.value)?;
        s.serialize_field("unit", self.unit.text())?;
        if let Some(interval) = self.interval {
            s.serialize_field("interval", &interval.map(|v| v.is_finite().then_some(v)))?;
        }
        s.end()
    }
}

impl JsonSchema for Measured {
    fn schema_name() -> Cow<'static, str> {
        "Measured".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A value with its unit and, if known, its 95 % interval; as input also the short form \
                            \"0.0562 deg/s/sqrt(Hz)\".",
            "anyOf": [
                {
                    "type": "object",
                    "properties": {
                        "value": { "type": "number" },
                        "unit": { "type": "string" },
                        "interval": {
                            "description": "Lower and upper end in the same unit, the value between them; null is an \
                                            open end.",
                            "type": "array",
                            "items": { "type": ["number", "null"] },
                            "minItems": 2,
                            "maxItems": 2
                        }
                    },
                    "required": ["value", "unit"],
                    "additionalProperties": false
                },
                { "type": "string", "pattern": "^\\s*[-+]?[0-9.][-+.0-9eE]*\\s+\\S" }
            ]
        })
    }
}

/// How a plain number stands in a document: 0.23 or "0.23"; [`Place::plain`] reads it.
#[derive(Debug)]
pub(crate) struct Plain;

impl JsonSchema for Plain {
    fn schema_name() -> Cow<'static, str> {
        "Plain".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number without a unit, 0.23 or \"0.23\".",
            "anyOf": [{ "type": "number" }, { "type": "string", "pattern": "^\\s*[-+]?[0-9.][-+.0-9eE]*\\s*$" }]
        })
    }
}
