//! How well the airframe is known: relative standard deviations of groups of its numbers.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};

use super::criteria::share;
use crate::params::place::{KeyError, Place};

/// One standard deviation of each number of a group over its value, "10 %" or 0.1; zero when absent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct UncertaintyEntry {
    /// Every aerodynamic derivative by itself.
    #[schemars(schema_with = "share_schema")]
    #[serde(serialize_with = "percent")]
    pub aerodynamics: f64,
    #[schemars(schema_with = "share_schema")]
    #[serde(serialize_with = "percent")]
    pub mass: f64,
    /// Every moment of inertia by itself.
    #[schemars(schema_with = "share_schema")]
    #[serde(serialize_with = "percent")]
    pub inertia: f64,
    /// Frequency and damping of every servo.
    #[schemars(schema_with = "share_schema")]
    #[serde(serialize_with = "percent")]
    pub servo: f64,
}

pub(super) fn share_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [{ "type": "number" }, { "type": "string", "pattern": "%" }] })
}

pub(super) fn percent<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&format!("{} %", 100.0 * value))
}

pub(super) fn uncertainty(place: &Place<'_>) -> Result<UncertaintyEntry, KeyError> {
    let o = place.object(&["aerodynamics", "mass", "inertia", "servo"])?;
    let get = |key: &str| o.optional(key).map(|p| share(&p)).transpose().map(Option::unwrap_or_default);
    Ok(UncertaintyEntry {
        aerodynamics: get("aerodynamics")?,
        mass: get("mass")?,
        inertia: get("inertia")?,
        servo: get("servo")?,
    })
}
