//! Values that the sections of flight.json share.

use std::path::PathBuf;

use serde_json::Value;

use super::Linked;
use crate::params::place::{KeyError, Object, Place};
use crate::params::{Measured, Range};
use crate::units::Dimension;

pub(super) const ANGLE: Dimension = Dimension::new(2, 0, 0);
pub(super) const RATE: Dimension = Dimension::new(2, 0, -2);
pub(super) const LENGTH: Dimension = Dimension::new(0, 2, 0);
pub(super) const VELOCITY: Dimension = Dimension::new(0, 2, -2);

/// A value of this dimension, if the key is there.
pub(super) fn value(
    object: &Object<'_>,
    key: &str,
    dimension: Dimension,
    range: Range,
) -> Result<Option<Measured>, KeyError> {
    object.optional(key).map(|place| Measured::from_place(&place, dimension, range)).transpose()
}

pub(super) fn required(object: &Object<'_>, key: &str, dimension: Dimension) -> Result<Measured, KeyError> {
    let place = object.required(key).map_err(|error| KeyError {
        message: format!("missing; write it with its unit, for example \"10 {}\"", dimension.example()),
        ..error
    })?;
    Measured::from_place(&place, dimension, Range::Positive)
}

pub(super) fn linked(place: &Place<'_>) -> Result<Linked, KeyError> {
    match place.value() {
        Value::String(path) => Ok(Linked::Path(PathBuf::from(path))),
        Value::Object(_) => Ok(Linked::Document(place.value().clone())),
        _ => Err(place.error("expected the path of a document, or the document itself")),
    }
}

/// One of these words.
pub(super) fn word<'a>(place: &Place<'a>, known: &[&str]) -> Result<&'a str, KeyError> {
    let text = place.text()?;
    if known.contains(&text) {
        return Ok(text);
    }
    Err(place.error(format!("'{text}' is not known; known are {}", known.join(", "))))
}
