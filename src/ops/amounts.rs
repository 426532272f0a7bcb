//! Flag values with units.

use std::str::FromStr;

use anyhow::{Context, anyhow};

use crate::units::{Dimension, amount};

/// A number of things, or a seed.
pub(crate) fn whole<T: FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| "expected a whole number of at least 0".into())
}

/// A number with its unit, such as `2h`, `250 deg/s`, `1/131 deg/s` or `-1deg/s`, in SI.
pub(crate) fn with_unit(flag: &str, text: &str, dimension: Dimension, example: &str) -> anyhow::Result<f64> {
    let expected = || anyhow!("{flag} {text}: expected a number and a unit, for example \"{example}\"");
    let (value, unit) = amount(text).ok_or_else(expected)?.with_context(|| format!("{flag} {text}"))?;
    unit.require(dimension).with_context(|| format!("{flag} {text}"))?;
    Ok(unit.to_si(value))
}
