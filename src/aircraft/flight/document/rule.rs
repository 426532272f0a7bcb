//! What gains are made by where they are not given.

use schemars::JsonSchema;
use serde::Serialize;

use super::values::{RATE, required, value};
use crate::params::place::{KeyError, Place};
use crate::params::{Measured, Plain, Range};
use crate::units::Dimension;

/// Rate dampers to a damping, attitude loops to a crossover, on exact sensors with servos and delay.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RuleEntry {
    /// Least damping of the pitch oscillations; 0.6 when absent.
    #[schemars(with = "Option<Plain>")]
    pub short_period_damping: f64,
    /// Of the loop of the pitch angle.
    pub pitch_crossover: Measured,
    /// Of the loop of the bank angle.
    pub bank_crossover: Measured,
    /// Roll rate over bank angle in the aileron's command; 0.1 s when absent.
    #[schemars(with = "Option<Measured>")]
    pub bank_lead: Measured,
    /// Least damping of the oscillations of roll and yaw; 0.7 when absent.
    #[schemars(with = "Option<Plain>")]
    pub dutch_roll_damping: f64,
    /// Time constant of the yaw damper's washout; 1 s when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub washout: Option<Measured>,
}

pub(super) fn rule(place: &Place<'_>) -> Result<RuleEntry, KeyError> {
    let known =
        ["short_period_damping", "pitch_crossover", "bank_crossover", "bank_lead", "dutch_roll_damping", "washout"];
    let o = place.object(&known)?;
    let damping = |key: &str, usual: f64| {
        let Some(place) = o.optional(key) else { return Ok(usual) };
        let found = place.plain()?;
        let fits = (0.0..1.0).contains(&found);
        if fits { Ok(found) } else { Err(place.error(format!("found {found}, expected a damping from 0 to below 1"))) }
    };
    let lead = value(&o, "bank_lead", Dimension::TIME, Range::Positive)?;
    Ok(RuleEntry {
        short_period_damping: damping("short_period_damping", 0.6)?,
        pitch_crossover: required(&o, "pitch_crossover", RATE)?,
        bank_crossover: required(&o, "bank_crossover", RATE)?,
        bank_lead: lead.unwrap_or_else(|| Measured::from_si(0.1, None, crate::units::Unit::second())),
        dutch_roll_damping: damping("dutch_roll_damping", 0.7)?,
        washout: value(&o, "washout", Dimension::TIME, Range::Positive)?,
    })
}
