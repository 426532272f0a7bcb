//! What `optimize` makes least, and what must stay.

use schemars::JsonSchema;
use serde::Serialize;

use super::criteria::share;
use super::uncertainty::{percent, share_schema};
use super::values::{VELOCITY, value};
use crate::params::place::{KeyError, Place};
use crate::params::{Measured, Plain, Range};

/// The cost is a sum of squares over those of the raw gyro with the gains as they are: wₛ (surface rates)² + wₐ
/// (angles)².
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OptimizeEntry {
    /// Weight of the rms rates of all surfaces; 1 when absent.
    #[schemars(with = "Option<Plain>")]
    pub surface_rate: f64,
    /// Weight of the rms of pitch and bank angle; 1 when absent.
    #[schemars(with = "Option<Plain>")]
    pub attitude: f64,
    /// Part of the raw loop's disk margins and damping that may be lost, "10 %" or 0.1; 10 % when absent.
    #[schemars(schema_with = "share_schema")]
    #[serde(serialize_with = "percent")]
    pub margins_lost: f64,
    /// Wind at 20 ft under which the result is looked at again; twice that of the flight when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_wind: Option<Measured>,
}

impl Default for OptimizeEntry {
    fn default() -> Self {
        OptimizeEntry { surface_rate: 1.0, attitude: 1.0, margins_lost: 0.1, held_out_wind: None }
    }
}

pub(super) fn optimize(place: &Place<'_>) -> Result<OptimizeEntry, KeyError> {
    let o = place.object(&["surface_rate", "attitude", "margins_lost", "held_out_wind"])?;
    let usual = OptimizeEntry::default();
    let weight = |key: &str, usual: f64| {
        let Some(place) = o.optional(key) else { return Ok(usual) };
        let found = place.plain()?;
        if found >= 0.0 { Ok(found) } else { Err(place.error(format!("found {found}, expected zero or more"))) }
    };
    let entry = OptimizeEntry {
        surface_rate: weight("surface_rate", usual.surface_rate)?,
        attitude: weight("attitude", usual.attitude)?,
        margins_lost: o.optional("margins_lost").map(|p| share(&p)).transpose()?.unwrap_or(usual.margins_lost),
        held_out_wind: value(&o, "held_out_wind", VELOCITY, Range::Positive)?,
    };
    if entry.surface_rate == 0.0 && entry.attitude == 0.0 {
        return Err(place.error("there is nothing to make least: give surface_rate or attitude a weight above zero"));
    }
    Ok(entry)
}
