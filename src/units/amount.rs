//! Numbers with a unit, as a person types them.

use super::{Unit, UnitError};

/// `2h`, `250 deg/s`, `1/131 deg/s`, `-1deg/s`: the number and its unit; `None` where there is no finite number with a
/// unit behind it.
pub fn amount(text: &str) -> Option<Result<(f64, Unit), UnitError>> {
    let bytes = text.as_bytes();
    let is_exponent = |i: usize| {
        let digit = |k: usize| bytes.get(k).is_some_and(u8::is_ascii_digit);
        let signed = bytes.get(i + 1).is_some_and(|b| b"+-".contains(b)) && digit(i + 2);
        i > 0 && (digit(i - 1) || bytes[i - 1] == b'.') && (digit(i + 1) || signed)
    };
    let (split, _) = text
        .char_indices()
        .find(|(i, c)| !(c.is_ascii_digit() || "+-./ ".contains(*c) || ("eE".contains(*c) && is_exponent(*i))))?;
    let (number, unit) = text.split_at(split);
    let parse = |text: &str| text.trim().parse::<f64>().ok();
    let value = match number.trim().split_once('/') {
        Some((above, below)) => parse(above).zip(parse(below)).map(|(above, below)| above / below),
        None => parse(number),
    };
    let value = value.filter(|v| v.is_finite())?;
    Some(Unit::parse(unit).map(|unit| (value, unit)))
}
