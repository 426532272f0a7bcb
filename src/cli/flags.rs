//! Flag values with units.

use std::str::FromStr;

use anyhow::{Context, anyhow};

use crate::units::{Dimension, Unit};

/// A number of things, or a seed.
pub(super) fn whole<T: FromStr>(text: &str) -> Result<T, String> {
    text.parse().map_err(|_| "expected a whole number of at least 0".into())
}

/// A number with its unit, such as `2h`, `250 deg/s`, `1/131 deg/s` or `-1deg/s`, in SI.
pub(super) fn with_unit(flag: &str, text: &str, dimension: Dimension, example: &str) -> anyhow::Result<f64> {
    let expected = || anyhow!("{flag} {text}: expected a number and a unit, for example \"{example}\"");
    let bytes = text.as_bytes();
    let is_exponent = |i: usize| {
        let digit = |k: usize| bytes.get(k).is_some_and(u8::is_ascii_digit);
        let signed = bytes.get(i + 1).is_some_and(|b| b"+-".contains(b)) && digit(i + 2);
        i > 0 && (digit(i - 1) || bytes[i - 1] == b'.') && (digit(i + 1) || signed)
    };
    let (split, _) = text
        .char_indices()
        .find(|(i, c)| !(c.is_ascii_digit() || "+-./ ".contains(*c) || ("eE".contains(*c) && is_exponent(*i))))
        .ok_or_else(expected)?;
    let (number, unit) = text.split_at(split);
    let number = number.trim();
    let parse = |text: &str| text.trim().parse::<f64>().ok();
    let value = match number.split_once('/') {
        Some((above, below)) => parse(above).zip(parse(below)).map(|(above, below)| above / below),
        None => parse(number),
    };
    let value = value.filter(|v| v.is_finite()).ok_or_else(expected)?;
    let unit = Unit::parse(unit).with_context(|| format!("{flag} {text}"))?;
    unit.require(dimension).with_context(|| format!("{flag} {text}"))?;
    Ok(unit.to_si(value))
}
