//! What a loop must keep: limits by name.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::values::{ANGLE, RATE};
use crate::params::place::{KeyError, Object, Place};
use crate::params::{Measured, Plain, Range};
use crate::units::Dimension;

/// Of what a criterion has one value each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    Surface,
    /// Pitch, and roll with yaw.
    Axes,
}

/// What a limit is set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Criterion {
    pub name: &'static str,
    /// In which values and limits are shown; empty for a plain number.
    pub unit: &'static str,
    pub more_is_better: bool,
    pub subject: Subject,
    /// What it is, as a sentence goes on: "the gain margin of the elevator".
    pub meaning: &'static str,
}

const fn more(name: &'static str, unit: &'static str, subject: Subject, meaning: &'static str) -> Criterion {
    Criterion { name, unit, more_is_better: true, subject, meaning }
}

const fn less(name: &'static str, unit: &'static str, subject: Subject, meaning: &'static str) -> Criterion {
    Criterion { name, unit, more_is_better: false, subject, meaning }
}

/// Every criterion there is.
pub const CRITERIA: [Criterion; 16] = [
    more("disk_margin", "", Subject::Surface, "disk margin"),
    more("multiloop_disk_margin", "", Subject::Axes, "disk margin of all commands at once"),
    more("gain_margin", "dB", Subject::Surface, "gain that can be added"),
    more("gain_reduction", "dB", Subject::Surface, "gain that can be lost"),
    more("phase_margin", "deg", Subject::Surface, "phase margin"),
    more("delay_margin", "s", Subject::Surface, "delay that can be added"),
    less("sensitivity_peak", "", Subject::Axes, "peak of the sensitivity"),
    more("damping", "", Subject::Axes, "damping of the least damped oscillation"),
    less("surface_rate", "deg/s", Subject::Surface, "rms rate of the surface"),
    less("surface_noise", "deg/s", Subject::Surface, "rms rate of the surface that the gyro's noise makes"),
    less("q", "deg/s", Subject::Axes, "rms pitch rate"),
    less("p", "deg/s", Subject::Axes, "rms roll rate"),
    less("r", "deg/s", Subject::Axes, "rms yaw rate"),
    less("theta", "deg", Subject::Axes, "rms pitch angle"),
    less("phi", "deg", Subject::Axes, "rms bank angle"),
    less("offset", "deg", Subject::Axes, "angle that the constant bias of the gyro causes"),
];

/// Share by which a value may be worse than that of another feed when the document says none.
const SHARE: f64 = 0.1;

/// The limits of one criterion, in its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitEntry {
    pub criterion: Criterion,
    pub at_least: Option<f64>,
    pub at_most: Option<f64>,
    /// Name of another feed, and the share by which a value may be worse than there.
    pub not_worse_than: Option<(String, f64)>,
}

/// All limits, in the order of the document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CriteriaEntry(pub Vec<LimitEntry>);

impl Serialize for CriteriaEntry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for entry in &self.0 {
            let unit = entry.criterion.unit;
            let shown = |x: f64| if unit.is_empty() { Value::from(x) } else { Value::from(format!("{x} {unit}")) };
            let mut limits = serde_json::Map::new();
            for (key, limit) in [("at_least", entry.at_least), ("at_most", entry.at_most)] {
                limits.extend(limit.map(|x| (key.to_string(), shown(x))));
            }
            if let Some((feed, share)) = &entry.not_worse_than {
                let by = format!("{} %", 100.0 * share);
                limits.insert("not_worse_than".into(), serde_json::json!({ "feed": feed, "by": by }));
            }
            map.serialize_entry(entry.criterion.name, &limits)?;
        }
        map.end()
    }
}

impl JsonSchema for CriteriaEntry {
    fn schema_name() -> Cow<'static, str> {
        "Criteria".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (plain, measured) = (generator.subschema_for::<Plain>(), generator.subschema_for::<Measured>());
        let decibels = json_schema!({
            "description": "In dB: 6 or \"6 dB\".",
            "anyOf": [{ "type": "number" }, { "type": "string", "pattern": "^\\s*[-+]?[0-9.]+\\s*(dB)?\\s*$" }]
        });
        let other = json_schema!({
            "description": "Another feed; where a share stands beside it, worse by no more than it (10 % when absent).",
            "anyOf": [
                { "type": "string" },
                {
                    "type": "object",
                    "properties": {
                        "feed": { "type": "string" },
                        "by": { "anyOf": [{ "type": "number" }, { "type": "string", "pattern": "%" }] }
                    },
                    "required": ["feed"],
                    "additionalProperties": false
                }
            ]
        });
        let one = |criterion: &Criterion| {
            let limit = match criterion.unit {
                "" => &plain,
                "dB" => &decibels,
                _ => &measured,
            };
            let schema = serde_json::json!({
                "description": criterion.meaning,
                "type": "object",
                "properties": { "at_least": limit, "at_most": limit, "not_worse_than": other },
                "additionalProperties": false,
                "anyOf": [{ "required": ["at_least"] }, { "required": ["at_most"] }, { "required": ["not_worse_than"] }]
            });
            (criterion.name.to_string(), schema)
        };
        let properties: serde_json::Map<String, Value> = CRITERIA.iter().map(one).collect();
        json_schema!({
            "description": "Limits by name.",
            "type": "object",
            "properties": properties,
            "additionalProperties": false
        })
    }
}

pub(super) fn criteria(place: &Place<'_>) -> Result<CriteriaEntry, KeyError> {
    let object = place.object(&CRITERIA.map(|c| c.name))?;
    let mut limits = Vec::new();
    for criterion in CRITERIA {
        if let Some(place) = object.optional(criterion.name) {
            limits.push(limit(&place, criterion)?);
        }
    }
    Ok(CriteriaEntry(limits))
}

fn limit(place: &Place<'_>, criterion: Criterion) -> Result<LimitEntry, KeyError> {
    let o = place.object(&["at_least", "at_most", "not_worse_than"])?;
    let number = |key: &str| o.optional(key).map(|p| number(&p, criterion.unit)).transpose();
    let entry = LimitEntry {
        criterion,
        at_least: number("at_least")?,
        at_most: number("at_most")?,
        not_worse_than: o.optional("not_worse_than").map(|p| other(&p)).transpose()?,
    };
    let LimitEntry { at_least, at_most, not_worse_than, .. } = &entry;
    if let (Some(least), Some(most)) = (at_least, at_most)
        && least > most
    {
        return Err(place.error(format!("contradicts itself: at least {least} and at most {most}; exchange them")));
    }
    if at_least.is_none() && at_most.is_none() && not_worse_than.is_none() {
        return Err(place.error("no limit; give at_least, at_most or not_worse_than"));
    }
    Ok(entry)
}

/// A limit in the unit of its criterion.
fn number(place: &Place<'_>, unit: &str) -> Result<f64, KeyError> {
    let dimension = match unit {
        "" => return place.plain(),
        "dB" => {
            let text = place.value().as_str().map(|text| text.trim().trim_end_matches("dB").trim_end());
            let Some(text) = text else { return place.number() };
            let value = text.parse().ok().filter(|x: &f64| x.is_finite());
            return value
                .ok_or_else(|| place.error(format!("expected a number of dB, for example \"6 dB\", found '{text}'")));
        }
        "deg" => ANGLE,
        "deg/s" => RATE,
        _ => Dimension::TIME,
    };
    let si = Measured::from_place(place, dimension, Range::Any)?.si();
    Ok(if unit == "s" { si } else { si.to_degrees() })
}

fn other(place: &Place<'_>) -> Result<(String, f64), KeyError> {
    let (name, by) = match place.value() {
        Value::String(_) => (place.clone(), None),
        _ => {
            let o: Object<'_> = place.object(&["feed", "by"])?;
            (o.required("feed")?, o.optional("by"))
        }
    };
    let feed = name.text()?;
    let share = by.map(|place| share(&place)).transpose()?.unwrap_or(SHARE);
    Ok((feed.to_string(), share))
}

/// "10 %" or 0.1.
pub(super) fn share(place: &Place<'_>) -> Result<f64, KeyError> {
    let percent = place.value().as_str().and_then(|text| text.trim().strip_suffix('%'));
    let value = match percent {
        Some(text) => text.trim().parse::<f64>().ok().map(|x| x / 100.0),
        None => place.value().as_f64(),
    };
    value
        .filter(|x| (0.0..=1.0).contains(x))
        .ok_or_else(|| place.error("expected a share from 0 to 1, for example \"10 %\" or 0.1"))
}
